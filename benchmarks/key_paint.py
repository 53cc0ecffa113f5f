"""M5: from a key to the frame that shows its effect, and what the screen costs, beside 256 instances.

The real program in a pseudo terminal of 200 x 50. The key goes to the next instance or to the one before, so
that every pane shows another instance; the clock stops when the instance's name has been written both in the
list and as the title of the block. Keys come at any time of a frame.
"""

from __future__ import annotations

import random
import re
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from benchmarks.figures import Effort, Figure
from benchmarks.paired import percentile, spread
from benchmarks.terminal import TRCVTUI, Terminal
from benchmarks.traffic import traffic
from benchmarks.wired import project

INSTANCES: Final = 256
CONNECTIONS: Final = 32  # a T4 has no more: eight instances share each CONNECT
INTERVAL_NS: Final = 10_000_000
BESIDE: Final = (("256 B a scan", 256), ("a flood of 64 KiB jobs", 65536))
FIRST_PICTURE: Final = ("16#70", "▸ TRCV_C_0")
KEYS_A_ROUND: Final = 40
PAUSE_S: Final = (0.06, 0.20)
DOWN, UP = "j", "k"
P50_MS, P99_MS, SHARE = 16.0, 50.0, 0.30
FRAMES: Final = 20.0
SCAN: Final = re.compile(rb"\bscan (\d+)")


@dataclass(frozen=True, slots=True)
class Quiet:
    """A window in which no key was typed: the screen's share of a core, and its pictures a second."""

    share: float
    frames: float


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield key to paint, and the screen's processor time, beside steady traffic and beside a flood."""
    for traffic_words, message in BESIDE:
        try:
            yield from _beside(traffic_words, message, effort)
        except TimeoutError as failed:
            yield Figure(traffic_words, "not measured", note=f"the screen did not answer: {failed}")


def _beside(words: str, message: int, effort: Effort) -> Iterator[Figure]:
    with (
        tempfile.TemporaryDirectory() as folder,
        traffic(CONNECTIONS, CONNECTIONS, message, INTERVAL_NS) as ports,
    ):
        file = Path(folder) / "bench.toml"
        file.write_text(project("T#10ms", ports, INSTANCES, CONNECTIONS, message))
        with Terminal([str(TRCVTUI), "run", str(file)]) as terminal:
            terminal.wait_for(FIRST_PICTURE)
            terminal.read_for(2.0)
            quiet, keys, place = [], [], 0
            for _ in range(effort.rounds):
                quiet.append(_quiet(terminal, effort.window_s))
                for _ in range(KEYS_A_ROUND):
                    terminal.read_for(random.uniform(*PAUSE_S))
                    key, place = (DOWN, place + 1) if place < CONNECTIONS - 1 else (UP, place - 1)
                    keys.append(1000 * _key(terminal, key, f"TRCV_C_{place}"))
                    if key == UP:
                        place = _home(terminal)
            terminal.end("q")
    yield from _figures(words, keys, quiet)


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
    terminal.type(UP * INSTANCES)
    terminal.wait_for(["▸ TRCV_C_0 "])
    terminal.read_for(0.5)
    return 0


def _quiet(terminal: Terminal, seconds: float) -> Quiet:
    terminal.forget()
    began, used = time.perf_counter(), terminal.used_s()
    terminal.read_for(seconds)
    passed = time.perf_counter() - began
    frames = len(set(SCAN.findall(terminal.written())))
    return Quiet((terminal.used_s() - used) / passed, frames / passed)


def _figures(words: str, keys: Sequence[float], quiet: Sequence[Quiet]) -> Iterator[Figure]:
    count = f"{len(keys)} keys, latest {max(keys):.0f} ms"
    for share, aim in ((0.50, P50_MS), (0.99, P99_MS)):
        reached = percentile(keys, share)
        yield Figure(
            f"key to paint p{share * 100:.0f}, {words}", f"{reached:.1f} ms", f"<= {aim:.0f} ms",
            reached <= aim, count,
        )  # fmt: skip
    cost, frames = spread([window.share for window in quiet]), spread([window.frames for window in quiet])
    note = f"{frames.text(1)} pictures a second; {INSTANCES} instances, 200 x 50"
    yield Figure(f"screen's share of a core, {words}", cost.text(), f"<= {SHARE}", cost.median <= SHARE, note)
