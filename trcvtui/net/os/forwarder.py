"""The tap's loop: bytes and ends from one side to the other as they come, told to those who look on.

Rule 1: nothing here waits for anybody but all: who looks on and does not read misses events, and is told.
Rule 2: without who gives the orders nothing is held.
"""

from __future__ import annotations

import select
import signal
import socket
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from itertools import islice
from typing import Any, Final

from trcvtui.errors import one_line
from trcvtui.net.os.system_calls import ERR, HAS_POLL, HUP, IN, OUT, end_figures, new_poll_set
from trcvtui.net.os.tapped_ends import SerialTalk, TcpRoute, UdpRoute
from trcvtui.net.os.tapped_lane import TapLane, TapLoop, in_words, intervene, refusal
from trcvtui.net.tap import (
    EVENT,
    FIGURES,
    LOSS,
    NEWEST,
    TO,
    Route,
    TapEventKind,
    TapOrder,
    end_text,
    order_of,
)
from trcvtui.signals import leave
from trcvtui.wording import count

MOST_SAID: Final = 1000  # characters of a line
FLUSH_NS: Final = 1_000_000_000  # for what still waits when the tap ends
TICK_NS: Final = 50_000_000  # between two looks of shadows at the time
BEAT_NS: Final = 1_000_000_000  # between two signs of life for guests
FIGURES_TICKS: Final = 10  # between two looks at what the stack says of the ends
MOST_FIGURES: Final = 64  # conversations of a tap that are looked at, the newest
MOST_UNTOLD: Final = 64 << 20  # bytes of events that wait for one who looks on
MOST_OF_GUEST: Final = 8 << 20  # for one at the socket
ENDS: Final = (TapEventKind.FIN, TapEventKind.RST, TapEventKind.OVER)
EVENT_BYTES: Final = 200  # that an event takes beside its own
MOST_LINE: Final = 4 << 20  # bytes of an order


class Observer:
    """A program that is told events over a socket, and may give orders; it never makes the loop wait."""

    def __init__(
        self,
        loop: Forwarder,
        sock: socket.socket,
        what: str,
        gives_orders: bool,
        wants_bytes: bool,
        is_guest: bool,
    ) -> None:
        self.lost = self.lost_bytes = 0
        self._newest = 0  # conversation that it was told of
        self._ends: list[bytes] = []  # of those, while events are left out: they are told afterwards
        self.wants_bytes = wants_bytes
        self.what, self.gives_orders = what, gives_orders
        self.has_ordered = gives_orders and not is_guest  # what it holds goes on when it leaves
        self._loop, self._sock = loop, sock
        self._waiting: deque[memoryview] = deque()
        self._size, self.is_guest = 0, is_guest  # bytes that wait
        self._orders = b""
        self.is_gone = False
        sock.setblocking(False)
        with suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 << 20)
        loop.hear(sock.fileno(), IN, self._ready)

    def take(self, head: bytes, data: bytes | memoryview) -> None:
        """Hand an event over, or let it wait; leave it out where too much waits, but for ends."""
        if self.is_gone:
            return
        if self.lost or self._size > (MOST_OF_GUEST if self.is_guest else MOST_UNTOLD):
            kind, _, _, number, *_ = EVENT.unpack(head)
            if kind in ENDS and number <= self._newest:
                self._ends.append(head)
            elif kind == TapEventKind.BYTES:
                self.lost_bytes += len(data)
            self.lost += 1
            return
        if head[0] == TapEventKind.OPEN:
            self._newest = max(self._newest, EVENT.unpack(head)[3])
        sent = 0
        if not self._waiting:
            try:
                sent = self._sock.sendmsg((head, data))
            except BlockingIOError:
                pass
            except OSError:
                self.end()
                return
            if sent == len(head) + len(data):
                return
            self._loop.want(self._sock.fileno(), IN | OUT)
        rest = memoryview(b"".join((head, data)))[sent:]
        self._waiting.append(rest)
        self._size += len(rest) + EVENT_BYTES

    def _ready(self, events: int) -> None:
        if events & (IN | ERR | HUP):
            self._hear_orders()
        if events & OUT and not self.is_gone:
            self.go_on()

    def go_on(self) -> None:
        """Hand over what waits, as much as it takes."""
        try:
            while self._waiting:
                first = self._waiting[0]
                sent = self._sock.send(first)
                self._size -= sent
                if sent < len(first):
                    self._waiting[0] = first[sent:]
                else:
                    self._waiting.popleft()
                    self._size -= EVENT_BYTES
        except BlockingIOError:
            return
        except OSError:
            self.end()
            return
        self._loop.want(self._sock.fileno(), IN)
        if self.lost:
            lost, size, ends = self.lost - len(self._ends), self.lost_bytes, self._ends
            self.lost, self.lost_bytes, self._ends = 0, 0, []
            self._loop.tell_again(self, LOSS.pack(lost, size), ends)

    def _hear_orders(self) -> None:
        try:
            said = self._sock.recv(1 << 16)
        except BlockingIOError:
            return
        except OSError:
            said = b""
        if not said or len(self._orders) > MOST_LINE:
            self.end()
            return
        *lines, self._orders = (self._orders + said).split(b"\n")
        for line in filter(None, lines) if self.gives_orders else ():  # the first one says that all is well
            try:
                order = order_of(line, len(self._loop.routes))
            except ValueError as wrong:
                self._loop.say(f"{self.what or 'the screen'} gives an order that is none: {wrong}")
                continue
            self.has_ordered = True
            self._loop.obey(order)

    def end(self) -> None:
        """Forget it; nothing that it holds stays held."""
        if not self.is_gone:
            self.is_gone = True
            self._loop.forget(self._sock.fileno())
            self._sock.close()
            self._waiting.clear()
            self._loop.lose(self)

    def finish(self, until_ns: int) -> None:
        """Hand over what waits, for so long at most."""
        with suppress(OSError):
            self._sock.settimeout(max(until_ns - time.monotonic_ns(), 0) / 1e9)
            for each in self._waiting:
                self._sock.sendall(each)
        self.end()


class Forwarder(TapLoop):
    """The loop; `say` gets lines for the user."""

    def __init__(self, say: Callable[[str], object], poll: Any = None) -> None:
        super().__init__(say, poll or new_poll_set())
        self.routes: list[TcpRoute | UdpRoute | SerialTalk] = []
        self._lookers: tuple[Observer, ...] = ()
        self._ends = False
        self._ticks = 0

    # -- who looks on ----------------------------------------------------------------------------------------

    def add_route(self, route: Route) -> None:
        """Listen, or open the ports; raise UserError."""
        kinds: dict[str, Callable[..., TcpRoute | UdpRoute | SerialTalk]] = {
            "tcp": TcpRoute,
            "udp": UdpRoute,
            "serial": SerialTalk,
        }
        self.routes.append(kinds[route.listen.kind](self, route, len(self.routes)))

    @staticmethod
    def pair() -> tuple[socket.socket, socket.socket]:
        """Return our end and the other one of what events cross to one who looks on."""
        return socket.socketpair()

    def add_looker(
        self,
        sock: socket.socket,
        what: str,
        gives_orders: bool = False,
        wants_bytes: bool = True,
        is_guest: bool = False,
    ) -> None:
        """Tell events to one more, and obey it; `what` it does, for when it is gone, "": that is not said.

        Of a guest's orders nothing holds that another one has given; fewer bytes wait for it.
        """
        looker = Observer(self, sock, what, gives_orders, wants_bytes, is_guest)
        self._lookers += (looker,)
        self._tell_all(looker)

    def tell_time(self) -> None:
        """Let who gives orders know the time, again and again."""
        self.tell_ordering(TapEventKind.NOW, b"")
        self._ticks = (self._ticks + 1) % FIGURES_TICKS
        if not self._ticks:
            self._tell_figures()
        self.after(TICK_NS, self.tell_time)

    def beat(self) -> None:
        """Let guests know the time, again and again: where it stops, we hang or what stands between."""
        for looker in self._lookers:
            if looker.is_guest and not looker.lost:
                self._tell_one(looker, TapEventKind.NOW, 0, 0, 0, b"")
        self.after(BEAT_NS, self.beat)

    def _tell_figures(self) -> None:
        for route in self.routes:
            talks = islice(reversed(route.talks.items()), MOST_FIGURES) if route.has_stack else ()
            for number, talk in talks:
                for lane in talk.lanes:
                    found = end_figures(lane.target.port)
                    if found is not None and found != lane.figures:
                        lane.figures = found
                        told = FIGURES.pack(*found)
                        self.tell_ordering(TapEventKind.FIGURES, told, lane.way, route.place, number)

    def tell_ordering(
        self, kind: TapEventKind, data: bytes, way: int = TO, place: int = 0, number: int = 0
    ) -> None:
        """Tell those that give orders."""
        for looker in self._lookers:
            if looker.gives_orders and not (looker.lost and kind is not TapEventKind.LINE):
                self._tell_one(looker, kind, place, number, 0, data, way)

    def let_all_go(self) -> None:
        """Hold and delay nothing any more."""
        self.holds = False
        for lane in self._lanes():
            lane.let_go()

    def lose(self, looker: Observer) -> None:
        """Go on without one who looks on; what was held goes on, too."""
        self._lookers = tuple([each for each in self._lookers if each is not looker])
        if looker.what and not self._ends:
            self.say(f"{looker.what} has ended: bytes still go on")
        if looker.has_ordered:
            self.let_all_go()

    def open_in_words(self) -> str:
        """Return how many connections are open, "" for none; with UDP and serial lines: conversations."""
        number = sum(len(route.talks) for route in self.routes)
        has_others = any(route.route.to.kind != "tcp" for route in self.routes)
        return count(number, "conversation" if has_others else "connection") if number else ""

    def _lanes(self) -> list[TapLane]:
        return [lane for route in self.routes for talk in route.talks.values() for lane in talk.lanes]

    def tell(
        self, kind: TapEventKind, way: int, place: int, number: int, at: int, data: bytes | memoryview
    ) -> None:
        if self._lookers:
            head = EVENT.pack(kind, way, place, number, at, time.time_ns(), len(data))
            for looker in self._lookers:
                if looker.wants_bytes or kind is not TapEventKind.BYTES:
                    looker.take(head, data)

    def tell_again(self, looker: Observer, loss: bytes, ends: Sequence[bytes]) -> None:
        """Tell one who has missed something how much that is, what has ended, and what there is now."""
        numbers = [number.to_bytes(4, "little") for route in self.routes for number in route.talks]
        numbers += [head[4:8] for head in ends]
        self._tell_one(looker, TapEventKind.LOST, 0, 0, 0, loss + b"".join(numbers))
        for head in ends:
            looker.take(head, b"")
        self._tell_all(looker)

    def _tell_all(self, looker: Observer) -> None:
        for route in self.routes:
            for number, talk in route.talks.items():
                self._tell_one(looker, TapEventKind.OPEN, route.place, number, 1, talk.said)

    @staticmethod
    def _tell_one(
        looker: Observer, kind: TapEventKind, place: int, number: int, at: int, data: bytes, way: int = TO
    ) -> None:
        looker.take(EVENT.pack(kind, way, place, number, at, time.time_ns(), len(data)), data)

    # -- orders --------------------------------------------------------------------------------------------

    def obey(self, order: TapOrder) -> None:
        """Intervene, and tell what was done, or why it cannot be."""
        route = self.routes[order.route]
        number = order.number or max((n for n, talk in route.talks.items() if talk.lanes), default=NEWEST)
        talk = route.talks.get(number)
        if talk is None or not talk.lanes:
            what = f"conversation {number}" if number else "a conversation"
            self.tell(
                TapEventKind.REFUSED, order.way, order.route, number, 0, f"{what} is not there".encode()
            )
            return
        lane = talk.lanes[order.way]
        why = refusal(lane, order)
        kind = TapEventKind.REFUSED if why else TapEventKind.OURS
        self.tell(kind, order.way, order.route, number, lane.at, (why or in_words(order)).encode())
        if not why:
            intervene(lane, order)
            if lane.held is not None:
                lane.tell_held()
        lane.source.want()

    # -- the loop ------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Forward until SIGTERM or Ctrl+C, also when its terminal is closed; then end both ends of all."""
        wakes, wakened = socket.socketpair()
        for sock in (wakes, wakened):
            sock.setblocking(False)
        self.hear(wakened.fileno(), IN, lambda _: self.stop())
        signal.set_wakeup_fd(wakes.fileno())
        for name in ("SIGTERM", "SIGINT", "SIGQUIT"):
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), lambda *_: None)
        leave(("SIGHUP",))
        while not self._ends:
            self.turn(-1)
        self.close()
        signal.set_wakeup_fd(-1)
        self.forget(wakened.fileno())
        wakes.close()
        wakened.close()

    def stop(self) -> None:
        self._ends = True

    def close(self) -> None:
        """Listen no more, end both ends of all, let those who look on have what waits."""
        self._ends = True
        for route in self.routes:
            route.stop()
        for lane in self._lanes():
            lane.let_go()
        until = time.monotonic_ns() + FLUSH_NS
        while any(lane.out for lane in self._lanes()) and (left := until - time.monotonic_ns()) > 0:
            self.turn(left / 1e9)
        for route in self.routes:
            for talk in tuple(route.talks.values()):
                talk.finish()
        self.routes.clear()
        until = time.monotonic_ns() + FLUSH_NS
        for looker in self._lookers:
            looker.finish(until)


def say_at_once(line: str) -> None:
    """Tell the user a line on stderr; where what was told before is not read, leave it out."""
    with suppress(OSError, ValueError):
        if HAS_POLL and (stderr := sys.__stderr__) is not None and sys.stderr is stderr:
            poller = select.poll()
            poller.register(stderr.fileno(), OUT)
            if not poller.poll(0):
                return
        sys.stderr.write(f"{one_line(line)[:MOST_SAID]}\n")  # as much as a pipe that is ready takes
        sys.stderr.flush()


def raise_limit() -> None:
    """Ask the system for as many descriptors as it gives."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def reachable(addresses: Iterable[tuple[str, int] | None]) -> list[str]:
    """Return those of the addresses that other machines reach."""
    from ipaddress import ip_address

    return [end_text(*each) for each in addresses if each and not ip_address(each[0]).is_loopback]
