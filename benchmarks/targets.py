"""The targets in words, the ten of design section 7 and bounded work, and what measures each so far."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

from benchmarks import (
    attacked,
    busy,
    hex_export,
    hex_view,
    idle,
    key_paint,
    lateness,
    start_up,
    throughput,
    udt_decode,
)
from benchmarks.figures import Effort, Figure

Measure = Callable[[Effort], Iterator[Figure]]


@dataclass(frozen=True, slots=True)
class Target:
    """One target: its name, what it promises, and what measures it; None: a later issue."""

    name: str
    promise: str
    measure: Measure | None = None


TARGETS: Final = (
    Target("M1", "free-running engine against a bare recv_into loop", throughput.measure),
    Target("M2", "one DONE in two scans at T#10ms with 256 x 64 KiB; no overrun by the engine", busy.measure),
    Target("M3", "1000 idle instances cost <= 1 % of a 1 ms scan, trace unchanged", idle.measure),
    Target("M4", "p99 start lateness beside the screen <= 2x cyclictest FIFO; no overrun", lateness.measure),
    Target("M5", "key to paint p50 <= 16 ms with 256 instances; UI <= 30 % of a core", key_paint.measure),
    Target("M6", "hex view of 1 GiB as fast as of 64 KiB", hex_view.measure),
    Target("M7", "hex export identical to hexdump -v -C, >= 2x the speed of xxd", hex_export.measure),
    Target("M8", "UDT decode <= 1.1x one struct.Struct, >= 50x construct", udt_decode.measure),
    Target("M9", "first full screen <= 1.3x an empty Textual app; headless <= 3x python", start_up.measure),
    Target("M10", "ledger event <= 3.5x a bare timestamp; journal >= 1 M events/s"),
    Target("M11", "beside one attack 8 good connections lose < 5 % of DONEs; no overrun", attacked.measure),
)
