"""A workbench on any kernel: short names for what the facts need, and how to let the wire settle."""

from __future__ import annotations

import select
import socket
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from trcvtui.net.kernel import Handle, Kernel, KernelLoss, NewClient, SocketOptions
from trcvtui.net.os.kernel import OsKernel
from trcvtui.net.results import WOULD_BLOCK, Endpoint, Fault

LOOPBACK = "127.0.0.1"
ANY_PORT = Endpoint(LOOPBACK, 0)


class Network(Protocol):
    """A kernel and the passing of time."""

    @property
    def kernel(self) -> Kernel: ...

    def breathe(self) -> None:
        """Let a little time pass (a millisecond or so)."""
        ...


class OsNetwork:
    """This machine's network; a breath waits a millisecond on a socket that is never ready."""

    def __init__(self) -> None:
        self.kernel = OsKernel()
        self._quiet, self._other = socket.socketpair()

    def breathe(self) -> None:
        select.select([self._quiet], [], [], 0.001)

    def close(self) -> None:
        self.kernel.close_all()
        self._quiet.close()
        self._other.close()
        assert self.kernel.leaks() == ()


@dataclass
class Pair:
    """Both ends of one connection, both in the poll set, and the listener that it came through."""

    client: Handle
    server: Handle
    listener: Handle
    end: Endpoint  # what the listener listens on


class Bench:
    """The kernel under test, with the moves that many facts share."""

    def __init__(self, network: Network) -> None:
        self.network = network
        self.kernel = network.kernel

    def until(self, holds: Callable[[], object], most: int = 3000) -> None:
        """Poll until it holds, a bounded number of times."""
        for _ in range(most):
            self.kernel.poll()
            if holds():
                return
            self.network.breathe()
        raise AssertionError("it never came true")

    def settle(self) -> None:
        for _ in range(8):
            self.network.breathe()
        self.kernel.poll()

    def socket(
        self, reuse: bool = False, end: Endpoint | None = None, polled: bool = False, owner: str = "X"
    ) -> Handle:
        handle = self.kernel.socket(owner)
        assert not isinstance(handle, Fault), handle
        if reuse:
            assert self.kernel.set_reuse(handle) is None
        if end is not None:
            assert self.kernel.bind(handle, end) is None
        if polled:
            assert self.kernel.poll_add(handle) is None
        return handle

    def listener(
        self, end: Endpoint = ANY_PORT, backlog: int = 4, reuse: bool = True, small: bool = False
    ) -> Handle:
        handle = self.socket(reuse, end)
        if small:
            self.kernel.set_options(handle, SocketOptions(small_buffers=True))
        assert self.kernel.listen(handle, backlog) is None
        assert self.kernel.poll_add(handle) is None
        return handle

    def end(self, handle: Handle) -> Endpoint:
        end = self.kernel.local_end(handle)
        assert end is not None
        return end

    def verdict(self, handle: Handle) -> Fault | None:
        found: list[Fault | None] = []

        def decided() -> bool:
            answer = self.kernel.connect_result(handle)
            if answer is WOULD_BLOCK:
                return False
            assert answer is None or isinstance(answer, Fault)
            found.append(answer)
            return True

        self.until(decided)
        return found[0]

    def connect(self, end: Endpoint, client: Handle | None = None, small: bool = False) -> Handle:
        handle = self.socket() if client is None else client
        if small:
            self.kernel.set_options(handle, SocketOptions(small_buffers=True))
        assert self.kernel.connect(handle, end) is None
        assert self.verdict(handle) is None
        assert self.kernel.poll_add(handle) is None
        return handle

    def accept(self, listener: Handle) -> NewClient:
        """Wait for a client and take it; the new handle goes into the poll set."""
        self.until(lambda: self.kernel.readable(listener))
        got = self.kernel.accept(listener)
        assert isinstance(got, NewClient), got
        assert self.kernel.poll_add(got.handle) is None
        return got

    def pair(self, listener: Handle | None = None, small: bool = False, client: Handle | None = None) -> Pair:
        waiting = self.listener(small=small) if listener is None else listener
        end = self.end(waiting)
        caller = self.connect(end, client, small)
        return Pair(caller, self.accept(waiting).handle, waiting, end)

    def send(self, handle: Handle, data: bytes) -> None:
        assert self.kernel.send(handle, memoryview(data)) == len(data)

    def try_send(self, handle: Handle, data: bytes = b"x") -> object:
        return self.kernel.send(handle, memoryview(data))

    def try_recv(self, handle: Handle, size: int = 100) -> object:
        """Return what recv answers: the bytes, 0 for FIN, WOULD_BLOCK or the Fault."""
        into = bytearray(size)
        got = self.kernel.recv(handle, memoryview(into))
        return bytes(into[:got]) if isinstance(got, int) and got > 0 else got

    def receive(self, handle: Handle, size: int) -> bytes:
        data = bytearray()

        def complete() -> bool:
            got = self.try_recv(handle, size - len(data))
            if isinstance(got, bytes):
                data.extend(got)
            else:
                assert got is WOULD_BLOCK, got
            return len(data) == size

        self.until(complete)
        return bytes(data)

    def answer(self, handle: Handle) -> object:
        """Wait until recv answers anything but WOULD_BLOCK, and return that."""
        found: list[object] = []

        def answered() -> bool:
            got = self.try_recv(handle)
            if got is not WOULD_BLOCK:
                found.append(got)
            return bool(found)

        self.until(answered)
        return found[0]

    def loss(self, handle: Handle) -> KernelLoss:
        found: list[KernelLoss] = []

        def lost() -> bool:
            seen = self.kernel.loss(handle)
            if seen is not None:
                found.append(seen)
            return bool(found)

        self.until(lost)
        return found[0]
