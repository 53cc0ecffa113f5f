"""M10: what an event of the ledger costs with its making, against reading the clock; and the journal."""

from __future__ import annotations

import gc
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter_ns, thread_time_ns
from typing import Final

from benchmarks.figures import Effort, Figure, against, alternate, ratios, spread
from benchmarks.replayed import recorded
from trcvtui.net.events import BytesReceived
from trcvtui.plc.ledger import Ledger
from trcvtui.recording.journal import decode_entries, encode_blocks
from trcvtui.recording.recording import Recording, RecordingWriter

EVENTS: Final = 20_000


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the writing of events with a timestamp against a timestamp alone; and the journal."""
    gc.collect()
    gc.disable()
    try:
        write = _events(Ledger())
        figures = alternate(lambda: _ns(write), lambda: _ns(_timestamps), effort.pairs)
        note = f"{against(figures, 0, ' ns')} an event"
        yield Figure.of("ledger event with its making, whole / a timestamp", ratios(figures), note=note)
    finally:
        gc.enable()
    yield _journal(min(effort.pairs, 5))


def _journal(times: int) -> Figure:
    """Return what the writer takes in a second of processor time: out of blocks, into the file."""
    with tempfile.TemporaryDirectory() as folder:
        entries = list(Recording(recorded(Path(folder))).read_entries())
        crossing = list(encode_blocks(entries))

        def seconds() -> float:
            writer = RecordingWriter(Path(folder) / "R.pcapng", overwrite=True)
            began = thread_time_ns()
            writer.add_entries(decode_entries(crossing, "R"))
            writer.close()
            return (thread_time_ns() - began) / 1e9

        speed = spread([len(entries) / 1e6 / seconds() for _ in range(times)])
    note = f"{len(entries)} events of a run; the writer makes packets and file, too"
    return Figure.of("journal, events a second", speed, 2, " M", note)


def _ns(act: Callable[[], None]) -> float:
    began = thread_time_ns()
    act()
    return (thread_time_ns() - began) / EVENTS


def _timestamps() -> None:
    for _ in range(EVENTS):
        perf_counter_ns()


def _events(ledger: Ledger) -> Callable[[], None]:
    write_event = ledger.write

    def write() -> None:
        for number in range(EVENTS):
            ledger.t_ns = perf_counter_ns()
            write_event(BytesReceived("C1", 1, number, 4096, 64, "T1"))

    return write
