"""M1: the free-running scan with the real block against a bare poll and recv_into on the same sockets."""

from __future__ import annotations

import gc
import select
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from benchmarks.figures import Effort, Figure
from benchmarks.paired import alternate, ratios, spread
from benchmarks.plc import ManyReceivers
from benchmarks.sender import sending
from trcvtui.rig.clock import now_ns

CASES: Final = ((1, 65536, 0.95), (16, 65536, 0.95), (64, 65536, 0.95), (256, 65536, 0.95), (64, 256, 0.9))
SLICE_NS: Final = 120_000_000
LEAD_IN_NS: Final = 30_000_000  # untimed: until what the other slice left in the sockets is gone
POLL_S: Final = 0.01

Slice = Callable[[], float]


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the share of the bare loop's bytes that the engine reaches, case by case."""
    for count, size, aim in CASES:
        plc = ManyReceivers(count, size)
        try:
            yield _case(plc, count, size, aim, effort.pairs)
        finally:
            plc.close()


def _case(plc: ManyReceivers, count: int, size: int, aim: float, pairs: int) -> Figure:
    with sending(size, plc.ports()) as language:
        plc.take_partners()
        plc.receive()
        with _without_collector(), _bare_slice(plc, size) as bare:
            figures = alternate(_engine_slice(plc), bare, pairs)
    share, speed = ratios(figures), spread([reference for _, reference in figures])
    return Figure(
        case=f"{count} x {_words(size)}",
        value=share.text(),
        aim=f">= {aim}",
        held=share.median >= aim,
        note=f"bare loop {1000 * speed.median:.0f} MB/s, sender in {language}",
    )


def _engine_slice(plc: ManyReceivers) -> Slice:
    def run() -> float:
        plc.scan_for(LEAD_IN_NS)
        before = plc.bytes_received()
        took = plc.scan_for(SLICE_NS)
        return (plc.bytes_received() - before) / took

    return run


@contextmanager
def _bare_slice(plc: ManyReceivers, size: int) -> Iterator[Slice]:
    """Yield the reference: wait until sockets are readable, read once from each."""
    sockets = {sock.fileno(): sock for sock in plc.sockets()}
    views = {fd: memoryview(bytearray(size)) for fd in sockets}
    with select.epoll() as poller:
        for fd in sockets:
            poller.register(fd, select.EPOLLIN)

        def receive_for(ns: int) -> float:
            taken, began = 0, now_ns()
            now = began
            while now < began + ns:
                for fd, _ in poller.poll(POLL_S, len(sockets)):
                    taken += sockets[fd].recv_into(views[fd])
                now = now_ns()
            return taken / (now - began)

        def run() -> float:
            receive_for(LEAD_IN_NS)
            return receive_for(SLICE_NS)

        yield run
    for sock in sockets.values():
        sock.detach()


@contextmanager
def _without_collector() -> Iterator[None]:
    """Switch the cyclic collector off meanwhile, as the engine process does."""
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
        gc.unfreeze()


def _words(size: int) -> str:
    return f"{size // 1024} KiB" if size >= 1024 else f"{size} B"
