"""M1: the free-running scan with the real block against bare recv_into calls on the same sockets.

And what one scan costs that receives a frame on every connection (M2), against the same calls.
"""

from __future__ import annotations

import gc
import select
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Final

from benchmarks.figures import Effort, Figure, Pairs, alternate, ratios, spread
from benchmarks.plc import ManyReceivers
from benchmarks.sender import sending
from trcvtui.clock import now_ns, thread_cpu_ns

CASES: Final = ((1, 65536), (16, 65536), (64, 65536), (256, 65536), (64, 256))
SLICE_NS: Final = 120_000_000
LEAD_IN_NS: Final = 30_000_000  # untimed: until what the other slice left in the sockets is gone
POLL_S: Final = 0.01
SETTLE_S: Final = 0.02  # until the sender has filled every socket

Receive = Callable[[int], tuple[int, int, int]]  # for so many ns; the bytes that came, ns, of processor time


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the share of the bare loop's bytes that the engine reaches, case by case."""
    for count, size in CASES:
        with (
            _receivers(count, size) as (plc, language),
            _sockets(plc) as sockets,
            _bare(sockets, size) as bare,
        ):
            ours, theirs = _Slices(_engine(plc)), _Slices(bare)
            figures = alternate(ours.speed, theirs.speed, effort.pairs)
        mb_s = 1000 * spread([speed for _, speed in figures]).median
        note = (
            f"processor time a message {ours.cost_us(size)} against {theirs.cost_us(size)} us; "
            f"bare loop {mb_s:.0f} MB/s, sender in {language}"
        )
        words = f"{size // 1024} KiB" if size >= 1024 else f"{size} B"
        yield Figure.of(f"{count} x {words}", ratios(figures), note=note)


@contextmanager
def _receivers(count: int, size: int, buffer: int = 0) -> Iterator[tuple[ManyReceivers, str]]:
    """Yield so many that receive while a sender sends, and its language; no collector, as in the engine."""
    plc = ManyReceivers(count, size)
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        with sending(size, plc.ports(), buffer) as language:
            plc.take_partners()
            plc.receive()
            yield plc, language
    finally:
        gc.enable()
        gc.unfreeze()
        plc.close()


@contextmanager
def _sockets(plc: ManyReceivers) -> Iterator[list[socket.socket]]:
    sockets = plc.sockets()
    try:
        yield sockets
    finally:
        for sock in sockets:
            sock.detach()


# -- as fast as it goes (M1) ---------------------------------------------------------------------------------


class _Slices:
    """Slices of receiving: bytes a ns of each, and the processor time of all of them."""

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self._used = self._taken = 0

    def speed(self) -> float:
        self._receive(LEAD_IN_NS)
        taken, took, used = self._receive(SLICE_NS)
        self._used += used
        self._taken += taken
        return taken / took

    def cost_us(self, size: int) -> str:
        return f"{self._used / max(1, self._taken) * size / 1000:.1f}"


def _engine(plc: ManyReceivers) -> Receive:
    def receive_for(ns: int) -> tuple[int, int, int]:
        before, used = plc.bytes_received(), thread_cpu_ns()
        took = plc.scan_for(ns)
        used = thread_cpu_ns() - used
        return plc.bytes_received() - before, took, used

    return receive_for


@contextmanager
def _bare(sockets: Sequence[socket.socket], size: int) -> Iterator[Receive]:
    """Yield the reference: wait until sockets are readable, read once from each."""
    of = {sock.fileno(): sock for sock in sockets}
    views = {fd: memoryview(bytearray(size)) for fd in of}
    with select.epoll() as poller:
        for fd in of:
            poller.register(fd, select.EPOLLIN)

        def receive_for(ns: int) -> tuple[int, int, int]:
            taken, used = 0, thread_cpu_ns()
            began = now = now_ns()
            while now < began + ns:
                for fd, _ in poller.poll(POLL_S, len(of)):
                    taken += of[fd].recv_into(views[fd])
                now = now_ns()
            return taken, now - began, thread_cpu_ns() - used

        yield receive_for


# -- a frame on every connection in one scan (M2) ------------------------------------------------------------


def one_scan(count: int, size: int, pairs: int, buffer: int) -> Pairs:
    """Return what a scan that receives from all costs, and as many bare calls: ms of processor time.

    So a busy machine does not count.
    """
    with _receivers(count, size, buffer) as (plc, _), _sockets(plc) as sockets:
        views = [memoryview(bytearray(size)) for _ in sockets]

        def scan() -> int:
            plc.scan()
            return 0

        def bare() -> int:
            taken = 0
            for sock, view in zip(sockets, views, strict=True):
                with suppress(BlockingIOError):
                    taken += sock.recv_into(view)
            return taken

        def cost(act: Callable[[], int], rest: Callable[[], int]) -> float:
            taken = 0
            while not taken:
                time.sleep(SETTLE_S)
                before, began = plc.bytes_received(), thread_cpu_ns()
                taken = act()
                took = thread_cpu_ns() - began
                taken += plc.bytes_received() - before
                rest()
            return took * size / taken * count / 1e6

        # After the scan that receives comes DONE everywhere: in the next one all jobs start again.
        return alternate(lambda: cost(scan, scan), lambda: cost(bare, lambda: 0), pairs)
