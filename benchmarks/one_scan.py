"""What a scan costs that receives a frame on every connection, beside bare recv_into calls for the frames.

Processor time is compared, so that a busy machine does not count; the sender has filled every socket before.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
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
            with _bare_slice(plc, size) as bare:
                figures = alternate(lambda: _scan_ns(plc, size), bare, 2 * effort.pairs)
    finally:
        gc.unfreeze()
        plc.close()
    ours, theirs = (spread([count * ns / 1e6 for ns in column]) for column in zip(*figures, strict=True))
    note = f"processor time {ours.median:.1f} ms against {theirs.median:.1f} ms of the 10 ms"
    case = f"scan that receives {count} x {size // 1024} KiB / bare recv_into"
    yield Figure(case, ratios(figures).text(), note=note)


def _scan_ns(plc: ManyReceivers, size: int) -> float:
    """Return the processor time for each frame in the scan in which all jobs start and receive."""
    taken = 0
    while not taken:
        time.sleep(SETTLE_S)
        before, began = plc.bytes_received(), used_ns()
        plc.scan()
        took = used_ns() - began
        taken = plc.bytes_received() - before
        plc.scan()  # DONE everywhere: the next scan is again one in which all start
    return took * size / taken


@contextmanager
def _bare_slice(plc: ManyReceivers, size: int) -> Iterator[Callable[[], float]]:
    """Yield the reference: one recv_into on each socket."""
    sockets = plc.sockets()
    views = [memoryview(bytearray(size)) for _ in sockets]

    def run() -> float:
        taken = 0
        while not taken:
            time.sleep(SETTLE_S)
            began = used_ns()
            for sock, view in zip(sockets, views, strict=True):
                with suppress(BlockingIOError):
                    taken += sock.recv_into(view)
            took = used_ns() - began
        return took * size / taken

    yield run
    for sock in sockets:
        sock.detach()
