"""One direction of a tapped conversation: the bytes that wait between its ends, and the orders on them.

Rule 1: the bytes that wait in a direction are limited. Bytes that the target has not taken, held bytes and
delayed bytes count. At the limit, the tap does not read the source, and the source's stack closes the
window.
Rule 2: a FIN or RST passes after the bytes before it. An RST waits at most RESET_WAIT_NS for these bytes.
Rule 3: in a held direction, FIN and RST are held, too.
"""

from __future__ import annotations

import socket
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from heapq import heappop, heappush
from itertools import count
from typing import Any, Final

from trcvtui.net.os.system_calls import ERR, HUP, IN, OUT, RESET_ON_CLOSE
from trcvtui.net.tap import MOST_HELD_SHOWN, TapEventKind, TapOrder

RESET_WAIT_NS: Final = 1_000_000_000  # for the bytes before an RST
RESET_CHECK_NS: Final = 2_000_000  # between two checks whether the other end has acknowledged them
UNREGISTERED_MASK, GONE_MASK = -1, -2  # in place of a mask: not in the poll set; the port is gone
SPLIT_PAUSE_NS: Final = 50_000_000  # between two pieces
READ_BYTES: Final = 256 << 10  # bytes of one read
MOST_HELD_BYTES: Final = 1 << 20  # bytes of one direction that are held or delayed
HELD_LIMIT: Final = "the tap holds at most 1 MiB of each direction"


class TapLoop:
    """The poll set and the timers of all conversations."""

    def __init__(self, say: Callable[[str], object], poll: Any) -> None:
        self.say = say
        self.buffer = memoryview(bytearray(READ_BYTES))
        self.holds = False  # each direction from its beginning
        self._numbers = count(1)
        self._poll = poll
        self._handlers: dict[int, Callable[[int], object]] = {}
        self._timers: list[tuple[int, int, Callable[[], None]]] = []
        self._timer_numbers = count()

    def register(self, fd: int, mask: int, ready: Callable[[int], object]) -> None:
        """Call `ready` with the events of a descriptor."""
        self._poll.register(fd, mask)
        self._handlers[fd] = ready

    def set_mask(self, fd: int, mask: int) -> None:
        self._poll.modify(fd, mask)

    def unregister(self, fd: int) -> None:
        if self._handlers.pop(fd, None) is not None:
            self._poll.unregister(fd)

    def call_at(self, ns: int, call: Callable[[], None]) -> None:
        """Call a function at a time of the monotonic clock."""
        heappush(self._timers, (ns, next(self._timer_numbers), call))

    def call_after(self, ns: int, call: Callable[[], None]) -> None:
        self.call_at(time.monotonic_ns() + ns, call)

    def next_number(self) -> int:
        return next(self._numbers)

    def run_once(self, seconds: float) -> None:
        """Call due timers and ready handlers. Wait for them at most `seconds`; -1 means no limit."""
        while self._timers and self._timers[0][0] <= time.monotonic_ns():
            heappop(self._timers)[2]()
            seconds = 0  # the timer may have ended the loop
        if self._timers:
            until_due = max(self._timers[0][0] - time.monotonic_ns(), 0) / 1e9
            seconds = until_due if seconds < 0 else min(until_due, seconds)
        handlers = self._handlers
        for fd, events in self._poll.poll(seconds):
            ready = handlers.get(fd)
            if ready is not None:  # an earlier handler of this round may have unregistered it
                ready(events)

    def report(
        self, kind: TapEventKind, way: int, route_id: int, number: int, at: int, data: bytes | memoryview
    ) -> None:
        raise NotImplementedError


class TapConversation:
    """A conversation with two lanes. Its methods suit kinds without FIN and RST; others override them."""

    loop: TapLoop
    route_id: int
    number: int
    has_ends = False  # FIN and RST

    def report(self, kind: TapEventKind, way: int, data: bytes | memoryview = b"", at: int = 0) -> None:
        self.loop.report(kind, way, self.route_id, self.number, at, data)

    @staticmethod
    def sender(end: Any) -> Callable[[Any], int]:
        raise NotImplementedError

    @staticmethod
    def receiver(end: Any) -> Callable[[Any], int]:
        raise NotImplementedError

    def handle_fin(self, lane: TapLane) -> None:
        """Handle the FIN of a lane's source."""

    def handle_source_reset(self, lane: TapLane, failed: OSError) -> None:
        """Handle the RST of a lane's source: no bytes are left to read."""

    def handle_target_reset(self, lane: TapLane, failed: OSError) -> None:
        """Handle the RST of a lane's target. The target may have sent bytes that are still unread."""

    def has_unacknowledged(self, end: TapEnd) -> bool:
        """Return whether the stack has bytes that the end has not acknowledged."""
        return False

    def pass_fin(self, lane: TapLane) -> None:
        """Send FIN to the target."""

    def pass_reset(self, lane: TapLane) -> None:
        """Send RST to the target."""


class TapEnd:
    """One end of a conversation: its socket or port. `reads` is the lane whose source is this end."""

    reads: TapLane
    writes: TapLane

    def __init__(self, loop: TapLoop, port: Any) -> None:
        self.loop, self.port, self.fd = loop, port, port.fileno()
        self.mask = 0
        self.is_open = True
        loop.register(self.fd, 0, self.handle_ready)

    def handle_ready(self, events: int) -> None:
        if events & (IN | ERR | HUP):
            if self.mask & IN:
                self.reads.read()
            elif events & (ERR | HUP):
                self._handle_error()
        if events & OUT and self.mask & OUT and self.is_open:
            self.writes.flush()

    def _handle_error(self) -> None:
        if not isinstance(self.port, socket.socket):
            self.reads.talk.handle_fin(self.reads)
            return
        if self.port.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR):
            self.reads.handle_reset(self.reads.is_read)
        if self.is_open and not self.mask:  # the poll set would report its end in every round
            self.loop.unregister(self.fd)
            self.mask = UNREGISTERED_MASK

    def update_mask(self) -> None:
        """Tell the poll set which events this end waits for now."""
        if self.mask == GONE_MASK or not self.is_open:
            return
        mask = (IN if self.reads.may_read() else 0) | (OUT if self.writes.out else 0)
        if mask and self.mask == UNREGISTERED_MASK:
            self.mask = mask
            self.loop.register(self.fd, mask, self.handle_ready)
        elif mask != self.mask and self.mask != UNREGISTERED_MASK:
            self.mask = mask
            self.loop.set_mask(self.fd, mask)

    def close(self, reset: bool = False) -> None:
        if self.is_open:
            self.is_open = False
            if self.mask >= 0:
                self.loop.unregister(self.fd)
            if reset:
                with suppress(OSError):
                    self.port.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET_ON_CLOSE)
            self.port.close()


class TapLane:
    """One direction of one conversation: the bytes between its source and its target."""

    def __init__(self, talk: TapConversation, way: int, source: TapEnd, target: TapEnd) -> None:
        self.talk, self.way, self.source, self.target = talk, way, source, target
        source.reads = target.writes = self
        self.loop = talk.loop
        self.send = talk.sender(target)
        self.receive = talk.receiver(source)
        self.out = bytearray()  # bytes that the target has not taken; they go before all others
        self.held: bytearray | None = bytearray() if talk.loop.holds else None  # None: nothing is held
        self.late: deque[tuple[int, bytes]] = deque()  # delayed bytes, and until when
        self.late_size = 0
        self.delay_ns = 0
        self.cuts: list[int] = []  # sizes of the pieces that the next bytes are split into
        self.at = 0  # bytes that were forwarded
        self.end: TapEventKind | None = None  # FIN or RST that has not passed yet
        self.is_read = False  # the source has no more bytes
        self.is_over = False  # its end has passed, or nothing passes any more
        self.figures: tuple[int, int, int] | None = None  # the last reported ones of its target
        self.is_timed = False  # a timer for `late` is running
        self.is_deaf = False  # bytes of the source are dropped: an ordered FIN has passed before them
        self.gives_up_ns = 0  # when an RST passes without waiting any longer

    # -- in ---------------------------------------------------------------------------------------------

    def room(self) -> int:
        if self.out:  # Rule 1: as a stack does, let the source wait for a slow target
            return 0
        return MOST_HELD_BYTES - self.late_size - (len(self.held) if self.held is not None else 0)

    def may_read(self) -> bool:  # Rule 1
        return not self.is_read and (not self.is_over or self.is_deaf) and self.room() > 0

    def read(self) -> None:
        room = self.room()
        try:
            size = self.receive(self.loop.buffer if room >= READ_BYTES else self.loop.buffer[:room])
        except (BlockingIOError, InterruptedError):
            return
        except OSError as failed:
            self.talk.handle_source_reset(self, failed)
            return
        if not size:
            self.talk.handle_fin(self)
        elif not self.is_deaf:
            self.handle_data(self.loop.buffer[:size])

    def handle_data(self, data: memoryview) -> None:
        if self.held is not None:
            self.held += data
            self.report_held()
            self.source.update_mask()
        elif self.delay_ns or self.late or self.cuts:
            self.delay_data(bytes(data))
        else:
            self.forward(data)

    def report_held(self) -> None:
        """Report the held bytes, or that this direction is not held any more."""
        held = self.held
        shown = b"" if held is None else b"!" + held[:MOST_HELD_SHOWN]
        self.talk.report(TapEventKind.HELD, self.way, memoryview(shown), len(held or b""))

    def delay_data(self, data: bytes) -> None:
        """Queue bytes to be forwarded later, split as the order says."""
        now = time.monotonic_ns()
        due = max(now + self.delay_ns, self.late[-1][0] if self.late else 0)
        if not data:  # a datagram may be empty
            self._append_late(due, data)
        while self.cuts and data:
            piece, data = data[: self.cuts[0]], data[self.cuts[0] :]
            self.cuts[0] -= len(piece)
            self._append_late(due, piece)
            if not self.cuts[0]:
                del self.cuts[0]
                due += SPLIT_PAUSE_NS
        if data:
            self._append_late(due, data)
        self.pass_late()

    def _append_late(self, due: int, data: bytes) -> None:
        self.late.append((due, data))
        self.late_size += len(data)

    def pass_late(self, is_all: bool = False) -> None:
        """Forward the delayed bytes whose time has come. If `is_all`, forward all delayed bytes now."""
        now = time.monotonic_ns()
        while self.late and (is_all or self.late[0][0] <= now) and not self.is_over:
            _, data = self.late.popleft()
            self.late_size -= len(data)
            self.forward(memoryview(data))
        if self.late and not self.is_timed:
            self.is_timed = True
            self.loop.call_at(self.late[0][0], self._pass_late_timed)
        self.source.update_mask()
        self.pass_end()

    def _pass_late_timed(self) -> None:
        self.is_timed = False
        self.pass_late()

    def release_all(self) -> None:
        held, self.held, self.delay_ns = self.held, None, 0
        if held is not None:
            self.report_held()
        self.cuts.clear()
        self.pass_late(is_all=True)
        if held is not None:
            self.pass_held(held)
        if self.end is TapEventKind.RST:
            self.start_reset_timer()
        self.source.update_mask()
        self.pass_end()

    def pass_held(self, held: bytearray) -> None:
        if held:
            self.handle_data(memoryview(held))

    def insert(self, data: bytes) -> None:
        """Put our bytes before the held bytes. If the direction is not held, treat them as new bytes."""
        if self.held is not None:
            self.held[:0] = data
        else:
            self.handle_data(memoryview(data))

    def drop_held(self, size: int) -> None:
        if self.held is not None:
            del self.held[:size]

    # -- out --------------------------------------------------------------------------------------------

    def forward(self, data: memoryview) -> None:
        """Send bytes, and report them as forwarded."""
        if self.is_over:
            return
        sent = 0
        if not self.out:
            try:
                sent = self.send(data)
            except (BlockingIOError, InterruptedError):
                pass
            except OSError as failed:
                self.talk.handle_target_reset(self, failed)
                return
        if sent < len(data):
            self.out += data[sent:]
            self.source.update_mask()
            self.target.update_mask()
        self.talk.report(TapEventKind.BYTES, self.way, data, self.at)
        self.at += len(data)

    def flush(self) -> None:
        try:
            del self.out[: self.send(self.out)]
        except (BlockingIOError, InterruptedError):
            return
        except OSError as failed:
            self.talk.handle_target_reset(self, failed)
            return
        if not self.out:
            self.target.update_mask()
            self.source.update_mask()
            self.pass_end()

    def handle_reset(self, is_read: bool) -> None:
        """Handle an RST of the source. If `is_read` is False, earlier bytes of the source may be unread."""
        back = self.target.reads
        if back.end is TapEventKind.RST:  # both ends have reset it: there is no reader left
            self.talk.pass_reset(self)
            return
        back.is_over = True  # an end that has sent RST takes no more bytes
        back.out.clear()
        back.held, back.late_size = None, 0
        back.late.clear()
        self.is_read |= is_read
        if self.end is not TapEventKind.RST:
            self.end = TapEventKind.RST
            if self.is_over and not self.is_deaf:  # its FIN has passed: no bytes come after it
                self.is_read = True
            if self.held is None:  # Rule 3
                self.start_reset_timer()
        self.source.update_mask()
        self.target.update_mask()
        self.pass_end()

    def start_reset_timer(self) -> None:
        """Start the time limit RESET_WAIT_NS for sending the bytes before an RST."""
        self.gives_up_ns = time.monotonic_ns() + RESET_WAIT_NS
        self.loop.call_at(self.gives_up_ns, self.pass_end)

    def pass_end(self) -> None:
        """Send the FIN or RST on, when all bytes before it were sent."""
        if self.end is None or self.held is not None or not self.target.is_open:  # Rule 3
            return
        if self.end is TapEventKind.RST:
            now = time.monotonic_ns()
            if now < self.gives_up_ns:  # Rule 2
                if not self.is_read or self.out or self.late:
                    return
                # An RST makes the target's stack drop what its program has not read.
                if self.talk.has_unacknowledged(self.target):
                    self.loop.call_at(now + RESET_CHECK_NS, self.pass_end)
                    return
            self.talk.pass_reset(self)
        elif not (self.out or self.late or self.is_over):
            self.is_over = True
            self.talk.pass_fin(self)


class DatagramLane(TapLane):
    """One direction of datagrams. They are never joined. A datagram without room is lost."""

    def __init__(self, talk: TapConversation, way: int, source: TapEnd, target: TapEnd) -> None:
        super().__init__(talk, way, source, target)
        self._sizes: deque[int] = deque()  # of the held datagrams

    def handle_data(self, data: memoryview) -> None:
        if len(data) > self.room():
            self.talk.report(
                TapEventKind.INTERVENTION, self.way, f"drop {len(data)} bytes: {HELD_LIMIT}".encode()
            )
            return
        if self.held is not None:
            self._sizes.append(len(data))
        super().handle_data(data)

    def forward(self, data: memoryview) -> None:
        """Send a datagram, and report it as forwarded."""
        with suppress(OSError):  # a datagram may be lost: here or in the network is the same
            self.send(data)
        self.talk.report(TapEventKind.BYTES, self.way, data, self.at)
        self.at += len(data)

    def pass_held(self, held: bytearray) -> None:
        sizes, self._sizes = self._sizes, deque()
        at = 0
        for size in sizes:
            self.handle_data(memoryview(held)[at : at + size])
            at += size

    def insert(self, data: bytes) -> None:
        if self.held is not None:
            self._sizes.appendleft(len(data))
        super().insert(data)

    def drop_held(self, size: int) -> None:
        """Drop the first `size` held bytes, and each datagram that is then empty."""
        super().drop_held(size)
        while size and self._sizes:
            first = self._sizes.popleft()
            if first > size:
                self._sizes.appendleft(first - size)
            size -= min(first, size)


def find_refusal(lane: TapLane, order: TapOrder) -> str:
    """Return why an order cannot be done in a direction, "" if it can."""
    held, has_ends = lane.held, lane.talk.has_ends
    size = len(held or b"")
    match order.verb:
        case "rst" | "fin" if not has_ends:
            return "there is no connection that FIN or RST can end"
        case "fin" | "insert" if lane.is_over:
            return "this direction has ended"
        case "insert" if len(order.data) > lane.room():
            return HELD_LIMIT if not lane.out else "the other end takes no bytes, so none can be inserted"
        case "drop" | "edit" if not held:
            return "nothing is held in this direction"
        case "drop" if order.sizes[0] > size:
            return f"only {size} of {order.sizes[0]} bytes held"
        case "edit" if (last := order.sizes[0] + len(order.data)) > size:
            return f"byte {size - 1} is the last held: there is no byte {last - 1}"
    return ""


def apply_order(lane: TapLane, order: TapOrder) -> None:
    """Carry out an order that `find_refusal` has allowed."""
    held = lane.held
    match order.verb:
        case "hold":
            lane.held = bytearray() if held is None else held
        case "go" if held is not None:
            lane.held = None
            lane.report_held()
            lane.pass_held(held)
            if lane.end is TapEventKind.RST:
                lane.start_reset_timer()
            lane.pass_end()
        case "insert":
            lane.insert(order.data)
        case "drop":
            lane.drop_held(order.sizes[0])
        case "edit" if held is not None:
            held[order.sizes[0] : order.sizes[0] + len(order.data)] = order.data
        case "delay":
            lane.delay_ns = order.sizes[0]
            if not lane.delay_ns:
                lane.pass_late(is_all=True)
        case "split":
            lane.cuts = list(order.sizes)
        case "rst":
            lane.talk.pass_reset(lane)
        case "fin":
            lane.release_all()  # before the FIN: what follows is dropped (`is_deaf`)
            lane.is_deaf, lane.end = True, TapEventKind.FIN
            lane.pass_end()


def describe_order(order: TapOrder) -> str:
    sizes = ",".join(map(str, order.sizes))
    if order.verb == "delay":
        sizes = f"{order.sizes[0] // 1_000_000} ms"
    what = {"drop": f"{sizes} bytes", "edit": f"byte {sizes}", "split": sizes, "delay": sizes}.get(order.verb)
    data = order.data[:32].hex(" ") + (f" ({len(order.data)} bytes)" if len(order.data) > 32 else "")
    return " ".join(filter(None, (order.verb, what, data)))
