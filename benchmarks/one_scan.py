"""What a scan costs that receives a frame on every connection, beside bare recv_into calls for the frames.

Processor time is compared, so that a busy machine does not count; the sender has filled every socket before.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Final

from benchmarks.figures import Effort, Figure
from benchmarks.paired import alternate, ratios, spread
from benchmarks.plc import ManyReceivers
from benchmarks.sender import sending
from trcvtui.rig.clock import used_ns

SETTLE_S: Final = 0.02


def measure(effort: Effort, count: int, size: int) -> Iterator[Figure]:
    """Yield the ratio, and in the note what each costs."""
    plc = ManyReceivers(count, size)
    try:
        with sending(size, plc.ports()):
            plc.take_partners()
            plc.receive()
            gc.collect()
            gc.freeze()
            figures = alternate(lambda: _scan_ns(plc, size), _bare_slice(plc, size), 2 * effort.pairs)
    finally:
        gc.unfreeze()
        plc.close()
    ours, bare = (spread([count * ns / 1e6 for ns in column]) for column in zip(*figures, strict=True))
    note = f"processor time {ours.median:.1f} ms against {bare.median:.1f} ms of the 10 ms"
    case = f"scan that receives {count} x {size // 1024} KiB / bare recv_into"
    yield Figure(case, ratios(figures).text(), note=note)


def _scan_ns(plc: ManyReceivers, size: int) -> float:
    """Return the processor time for each frame in the scan in which all jobs start and receive."""
    time.sleep(SETTLE_S)
    before, began = plc.bytes_received(), used_ns()
    plc.scan()
    took = used_ns() - began
    frames = (plc.bytes_received() - before) / size
    plc.scan()  # DONE everywhere: the next scan is again one in which all start
    return took / frames


def _bare_slice(plc: ManyReceivers, size: int) -> Callable[[], float]:
    """Return the reference: one recv_into on each socket."""
    borrowed = plc.sockets()
    sockets = [sock.dup() for sock in borrowed]
    for sock in borrowed:
        sock.detach()
    views = [memoryview(bytearray(size)) for _ in sockets]

    def run() -> float:
        time.sleep(SETTLE_S)
        taken, began = 0, used_ns()
        for sock, view in zip(sockets, views, strict=True):
            with suppress(BlockingIOError):
                taken += sock.recv_into(view)
        return (used_ns() - began) * size / taken

    return run
