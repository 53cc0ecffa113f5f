"""M12: the messages of the selected instance with 10,000 rows: from a key to the table, a picture of a curve.

The curve is that of a member of 10,000 messages in 180 x 40 cells, one message newer in each picture: the new
one is decoded, all are drawn. The table is the real program in a pseudo terminal, while messages come.
"""

from __future__ import annotations

import random
import re
import struct
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from benchmarks.figures import Effort, Figure, percentile
from benchmarks.key_paint import KEYS_A_ROUND, PAUSE_S, WATCHED
from benchmarks.terminal import Terminal
from benchmarks.traffic import project, traffic
from trcvtui.history.messages import MOST_INSTANCE_ROWS, MessageRow, MessagesDelta
from trcvtui.history.records import MAX_SCAN
from trcvtui.project.file import load_project
from trcvtui.tui.view_model.known_messages import KnownMessages
from trcvtui.tui.view_model.member_numbers import MemberNumbers
from trcvtui.tui.widgets.curves import curve

CELLS: Final = 180, 40
PICTURES: Final = 40  # of a round
MESSAGE: Final = 12
INTERVAL_NS: Final = 2_000_000
FILL_S: Final = 120.0
CHOSEN: Final = re.compile(rb"\xe2\x96\xb8( *(\d+)) ")
UP, DOWN = "\x1b[A", "\x1b[B"


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield what a picture of a curve costs, and key to paint in the table."""
    yield from _curve(effort)
    try:
        yield from _table(effort)
    except TimeoutError as failed:
        yield Figure.missing("table", f"the screen did not answer: {failed}")


def _curve(effort: Effort) -> Iterator[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bench.toml"
        file.write_text('dialect = "baosky"\n[[data]]\nname = "rx"\ntype = "ARRAY[0..2] OF REAL"\n')
        layout = load_project(file).data[0].layout
    known, numbers, took = KnownMessages(), MemberNumbers(layout, layout.leaf(1)), list[float]()
    known.make_request("X")
    _bring(known, MOST_INSTANCE_ROWS)
    numbers.update_numbers(known, known.next_number)
    for _ in range(effort.rounds * PICTURES):
        _bring(known, 1)
        began = time.perf_counter()
        times = [each.t_ns for each in known.rows]
        curve(times, numbers.update_numbers(known, known.next_number), (times[0], times[-1]), *CELLS)
        took.append(1000 * (time.perf_counter() - began))
    for share in (0.50, 0.99):
        ms = percentile(took, share)
        yield Figure(f"a picture of a curve p{100 * share:.0f}", f"{ms:.1f} ms", ms, f"{len(took)} pictures")


def _bring(known: KnownMessages, count: int) -> None:
    """Let so many messages come, one a second."""
    rows = []
    for number in range(known.next_number + 1, known.next_number + count + 1):
        content = struct.pack("<3f", 0, random.random(), 0)
        row = MessageRow(number, number, number * 10**9, 10**9, MESSAGE, 0x7008, "C", 0, "", MESSAGE, content)
        rows.append(row)
    known.accept_rows(MessagesDelta("X", known.next_number, known.next_number + count, tuple(rows)), MAX_SCAN)


def _table(effort: Effort) -> Iterator[Figure]:
    with tempfile.TemporaryDirectory() as folder, traffic(1, 1, MESSAGE, INTERVAL_NS) as ports:
        file = Path(folder) / "bench.toml"
        file.write_text(project("T#1ms", ports, 1, 1, MESSAGE))
        with Terminal(
            [sys.executable, *map(str, (WATCHED, Path(folder) / "pauses", "run", file))]
        ) as terminal:
            terminal.wait_for(("16#70", "▸ TRCV_C_0"))
            terminal.type("5D")
            _wait_until(terminal, MOST_INSTANCE_ROWS)
            keys = list[float]()
            for _ in range(effort.rounds):
                terminal.type(UP)
                terminal.read_for(1.0)
                width, number = _chosen(terminal)
                for turn in range(KEYS_A_ROUND):
                    terminal.read_for(random.uniform(*PAUSE_S))
                    key, step = (DOWN, 1) if turn % 8 == 7 else (UP, -1)
                    number += step
                    terminal.forget()
                    began = time.perf_counter()
                    terminal.type(key)
                    terminal.wait_for([f"▸{number:>{width}}"])
                    keys.append(1000 * (time.perf_counter() - began))
            terminal.end("q")
    for share in (0.50, 0.99):
        ms, note = (
            percentile(keys, share),
            f"{len(keys)} keys, latest {max(keys):.0f} ms; {MOST_INSTANCE_ROWS} rows",
        )
        yield Figure(f"key to paint in the table p{100 * share:.0f}", f"{ms:.1f} ms", ms, note)


def _wait_until(terminal: Terminal, rows: int) -> None:
    end = time.perf_counter() + FILL_S
    while time.perf_counter() < end:
        terminal.read_for(1.0)
        if any(int(found[2]) > rows for found in CHOSEN.finditer(terminal.written())):
            return
    raise TimeoutError(f"not {rows} messages in {FILL_S:.0f} s")


def _chosen(terminal: Terminal) -> tuple[int, int]:
    """Return the columns and the number of the message that was chosen last."""
    *_, last = CHOSEN.finditer(terminal.written())
    return len(last[1]), int(last[2])
