"""A socket to a reader that may be slow. Data without room is left out, counted, and reported later."""

from __future__ import annotations

import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from trcvtui.net.os.system_calls import ERR, HUP, IN, OUT
from trcvtui.net.os.tap_lane import TapLoop

READ_BYTES: Final = 1 << 16
MOST_LINE: Final = 4 << 20  # bytes of an order
SEND_BUFFER: Final = 4 << 20
PART_OVERHEAD: Final = 200  # bytes of memory for a part beside its data: many small parts are bounded, too


class LossyPipe:
    """Writes without waiting. While the reader is behind, whole parts are left out.

    `report_gap` gets the (events, bytes, ends) that were left out, as soon as all parts before the gap were
    sent. `handle_line` gets each line that the reader sends. `handle_end` is called once, at the close.
    """

    def __init__(
        self,
        loop: TapLoop,
        sock: socket.socket,
        most: int,
        report_gap: Callable[[int, int, bytes], object],
        handle_line: Callable[[bytes], object],
        handle_end: Callable[[], object],
    ) -> None:
        self._loop, self._sock, self.most = loop, sock, most
        self._report_gap, self._handle_line, self._handle_end = report_gap, handle_line, handle_end
        self.waiting: deque[memoryview] = deque()
        self._size = 0  # bytes that wait
        self.is_behind = self.is_gone = False
        self._lost = (0, 0, b"")
        self._line = b""
        sock.setblocking(False)
        with suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        loop.register(sock.fileno(), IN, self._handle_ready)

    def put(self, *parts: bytes | memoryview, events: int = 1, size: int = 0, ends: bytes = b"") -> None:
        """Send or queue parts. If the queue is full, drop the parts, and count them for `report_gap`."""
        if self.is_gone:
            return
        if self.is_behind or self._size > self.most:  # until the queue is empty: one gap, not many
            self.is_behind, lost = True, self._lost
            self._lost = lost[0] + events, lost[1] + size, lost[2] + ends
            return
        sent = 0
        if not self.waiting:
            try:
                sent = self._sock.sendmsg(parts)
            except BlockingIOError:
                pass
            except OSError:
                self.close()
                return
            if sent == sum(map(len, parts)):
                return
            self._loop.set_mask(self._sock.fileno(), IN | OUT)
        rest = memoryview(b"".join(parts))[sent:]
        self.waiting.append(rest)
        self._size += len(rest) + PART_OVERHEAD

    def _handle_ready(self, events: int) -> None:
        if events & (IN | ERR | HUP):
            self._read()
        if events & OUT and not self.is_gone:
            self._flush()

    def _flush(self) -> None:
        try:
            while self.waiting:
                first = self.waiting[0]
                sent = self._sock.send(first)
                self._size -= sent
                if sent < len(first):
                    self.waiting[0] = first[sent:]
                else:
                    self.waiting.popleft()
                    self._size -= PART_OVERHEAD
        except BlockingIOError:
            return
        except OSError:
            self.close()
            return
        self._loop.set_mask(self._sock.fileno(), IN)
        if self.is_behind:  # the queue is empty: the reader has caught up
            self.is_behind, lost = False, self._lost
            self._lost = (0, 0, b"")
            self._report_gap(*lost)

    def _read(self) -> None:
        try:
            data = self._sock.recv(READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        *lines, self._line = (self._line + data).split(b"\n")
        for line in filter(None, lines):
            if not self.is_gone:  # a line may have closed it
                self._handle_line(line)
        if not data or len(self._line) > MOST_LINE:  # a line without end would fill the memory
            self.close()

    def close(self) -> None:
        if not self.is_gone:
            self.is_gone = True
            self._loop.unregister(self._sock.fileno())
            self._sock.close()
            self.waiting.clear()
            self._handle_end()

    def send_rest(self, until_ns: int) -> None:
        """Send the waiting parts, but not after `until_ns` of the monotonic clock. Then close."""
        while self.waiting and (rest := until_ns - time.monotonic_ns()) > 0:
            self._loop.run_once(rest / 1e9)
        self.close()
