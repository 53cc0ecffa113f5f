"""M3: what a thousand idle instances cost in a scan: connected, EN_R = 1, nothing received."""

from __future__ import annotations

import resource
import socket
from collections.abc import Iterator
from typing import Final

from benchmarks.figures import Effort, Figure
from benchmarks.paired import alternate, ratios, spread
from benchmarks.plc import ManyReceivers

INSTANCES: Final = 1000
DESCRIPTORS: Final = 4 * INSTANCES  # listener, connection, partner, and some to spare
SCAN_NS: Final = 1_000_000
SLICE_NS: Final = 50_000_000
AIM: Final = 0.01


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the share of a 1 ms scan, and the share of what calling all of them costs."""
    if not _enough_descriptors():
        yield Figure(f"{INSTANCES} idle instances", "not measured", note=f"needs ulimit -n {DESCRIPTORS}")
        return
    plc = ManyReceivers(INSTANCES, 64)
    partners = [socket.create_connection(("127.0.0.1", port)) for port in plc.ports()]
    try:
        plc.take_partners()
        plc.receive()
        plc.scan(10)
        figures = alternate(lambda: _scan_ns(plc, False), lambda: _scan_ns(plc, True), effort.pairs)
    finally:
        for partner in partners:
            partner.close()
        plc.close()
    share = spread([ours / SCAN_NS for ours, _ in figures])
    note = f"{1e6 * share.median / 1000:.1f} us a scan; trace: tests/properties/test_ready_only.py"
    held = share.median <= AIM
    yield Figure(f"{INSTANCES} idle / a 1 ms scan", share.text(4), f"<= {AIM}", held, note)
    yield Figure(f"{INSTANCES} idle asleep / called all", ratios(figures).text(4))


def _scan_ns(plc: ManyReceivers, call_all: bool) -> float:
    plc.runtime.calls_all = call_all
    before = plc.runtime.scans
    took = plc.scan_for(SLICE_NS)
    return took / (plc.runtime.scans - before)


def _enough_descriptors() -> bool:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(DESCRIPTORS, hard)
    if soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0] >= DESCRIPTORS
