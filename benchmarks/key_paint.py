"""M5: from a key to the frame that shows its effect, and what the screen costs; 8 and 256 instances.

The real program in a pseudo terminal of 200 x 50. The key goes to the next instance or to the one before, so
that every pane shows another instance; the clock stops when the instance's name has been written both in the
list and as the title of the block. Keys come at any time of a frame.
"""

from __future__ import annotations

import random
import re
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Final

from benchmarks.figures import Effort, Figure, percentile, spread
from benchmarks.terminal import Terminal
from benchmarks.traffic import project, traffic

INSTANCES: Final = (8, 256)
CONNECTIONS: Final = 32  # a T4 has no more: eight instances share each CONNECT
INTERVAL_NS: Final = 10_000_000
BESIDE: Final = (("256 B a scan", 256), ("a flood of 64 KiB jobs", 65536))
FIRST_PICTURE: Final = ("16#70", "▸ TRCV_C_0")
KEYS_A_ROUND: Final = 40
PAUSE_S: Final = (0.06, 0.20)
CALM_AFTER_S: Final = 1.5  # the screen takes more pictures for a second after a key
DOWN, UP = "j", "k"
WATCHED: Final = Path(__file__).with_name("watched.py")
SCAN: Final = re.compile(rb"\bscan (\d+)")


@dataclass(frozen=True, slots=True)
class Quiet:
    """A window in which no key was typed: the screen's share of a core, and its pictures a second."""

    share: float
    frames: float


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield key to paint, and the screen's processor time, beside steady traffic and beside a flood."""
    for instances, (traffic_words, message) in product(INSTANCES, BESIDE):
        words = f"{instances} instances, {traffic_words}"
        try:
            yield from _beside(words, instances, message, effort)
        except TimeoutError as failed:
            yield Figure.missing(words, f"the screen did not answer: {failed}")


def _beside(words: str, instances: int, message: int, effort: Effort) -> Iterator[Figure]:
    connections = min(CONNECTIONS, instances)
    with (
        tempfile.TemporaryDirectory() as folder,
        traffic(connections, connections, message, INTERVAL_NS) as ports,
    ):
        file, pauses = Path(folder) / "bench.toml", Path(folder) / "pauses"
        file.write_text(project("T#10ms", ports, instances, connections, message))
        with Terminal([sys.executable, *map(str, (WATCHED, pauses, "run", file))]) as terminal:
            terminal.wait_for(FIRST_PICTURE)
            terminal.read_for(2.0)
            quiet, keys, typing, place = [], [], [], 0
            for _ in range(effort.rounds):
                quiet.append(_quiet(terminal, effort.window_s))
                began = time.perf_counter()
                for _ in range(KEYS_A_ROUND):
                    terminal.read_for(random.uniform(*PAUSE_S))
                    key, place = (DOWN, place + 1) if place < connections - 1 else (UP, place - 1)
                    keys.append(1000 * _key(terminal, key, f"TRCV_C_{place}"))
                    if key == UP:
                        place = _home(terminal)
                typing.append((began, time.perf_counter()))
            terminal.end("q")
        paused = [tuple(map(float, line.split())) for line in pauses.read_text().splitlines()]
    yield from _figures(words, keys, quiet)
    longest = [1000 * s for at, s in paused if any(began <= at < ended for began, ended in typing)]
    value, note = f"{max(longest, default=0.0):.1f} ms", f"{len(longest)} pauses, {len(paused)} in all"
    yield Figure(f"longest collector pause while keys come, {words}", value, max(longest, default=0.0), note)


def _key(terminal: Terminal, key: str, name: str) -> float:
    """Return after how many seconds the key had been obeyed everywhere."""
    terminal.forget()
    began = time.perf_counter()
    terminal.type(key)
    terminal.wait_for([f"▸ {name} ", f"2 {name} ·"])
    return time.perf_counter() - began


def _home(terminal: Terminal) -> int:
    """Go back to the first instance; this is not timed."""
    terminal.forget()
    terminal.type("g")
    terminal.wait_for(["▸ TRCV_C_0 ", "2 TRCV_C_0 ·"])
    terminal.read_for(0.5)
    return 0


def _quiet(terminal: Terminal, seconds: float) -> Quiet:
    terminal.read_for(CALM_AFTER_S)
    terminal.forget()
    began, used = time.perf_counter(), terminal.used_s()
    terminal.read_for(seconds)
    passed = time.perf_counter() - began
    frames = len(set(SCAN.findall(terminal.written())))
    return Quiet((terminal.used_s() - used) / passed, frames / passed)


def _figures(words: str, keys: Sequence[float], quiet: Sequence[Quiet]) -> Iterator[Figure]:
    count = f"{len(keys)} keys, latest {max(keys):.0f} ms"
    for share in (0.50, 0.99):
        ms = percentile(keys, share)
        yield Figure(f"key to paint p{100 * share:.0f}, {words}", f"{ms:.1f} ms", ms, count)
    cost, frames = spread([window.share for window in quiet]), spread([window.frames for window in quiet])
    note = f"{frames.text(1)} pictures a second; 200 x 50"
    yield Figure.of(f"screen's share of a core, {words}", cost, note=note)
