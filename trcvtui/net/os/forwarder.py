"""The tap's loop forwards bytes, FINs and RSTs as they come. It reports them as events to one process.

Rule 1: nothing here waits for that process. A process that is too slow misses events; it gets their number.
Rule 2: without that process, no bytes are held, since nobody could release them.
"""

from __future__ import annotations

import select
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from itertools import islice
from typing import Any, Final

from trcvtui.errors import one_line
from trcvtui.net.os.lossy_pipe import LossyPipe
from trcvtui.net.os.system_calls import HAS_POLL, IN, OUT, new_poll_set, read_path_figures
from trcvtui.net.os.tap_ends import TapSerialConversation, TcpRoute, UdpRoute
from trcvtui.net.os.tap_lane import TapLane, TapLoop, apply_order, describe_order, find_refusal
from trcvtui.net.tap import (
    END_KINDS,
    EVENT_HEAD,
    FIGURES_DATA,
    LOSS,
    NEWEST,
    RELEASE_LINE,
    USER_LINE,
    WAY_TO,
    Route,
    TapEventKind,
    TapOrder,
    format_end,
    parse_order,
)
from trcvtui.signals import ignore_signals
from trcvtui.wording import count

MOST_LINE_CHARS: Final = 1000  # characters of a line
FLUSH_NS: Final = 1_000_000_000  # for what still waits when the tap ends
TICK_NS: Final = 50_000_000  # between two NOW events
FIGURES_TICKS: Final = 10  # ticks between two reads of the stack's figures
MOST_FIGURES: Final = 64  # conversations of a tap whose figures are read, the newest
MOST_WAITING_BYTES: Final = 64 << 20  # bytes of events that wait for the process that serves observers


class Forwarder(TapLoop):
    """The tap's loop. `say` gets lines for the user."""

    def __init__(self, say: Callable[[str], object], poll: Any = None) -> None:
        super().__init__(say, poll or new_poll_set())
        self.routes: list[TcpRoute | UdpRoute | TapSerialConversation] = []
        self.pipe: LossyPipe | None = None
        self._newest = 0  # conversation that was reported
        self._ends = False
        self._ticks = 0

    def open_route(self, route: Route) -> None:
        """Listen at the tap's address, or open its serial ports. Raise UserError if that fails."""
        kinds: dict[str, Callable[..., TcpRoute | UdpRoute | TapSerialConversation]] = {
            "tcp": TcpRoute,
            "udp": UdpRoute,
            "serial": TapSerialConversation,
        }
        self.routes.append(kinds[route.listen.kind](self, route, len(self.routes)))

    def attach_server(self, sock: socket.socket, end: Callable[[], object]) -> None:
        """Report events to the observer server, and do its orders. If the server ends first, call `end`."""

        def drop_pipe() -> None:
            self.pipe = None
            if not self._ends:  # Rule 2
                self.release_all()
                end()

        self.pipe = LossyPipe(
            self, sock, MOST_WAITING_BYTES, self._report_missed, self._handle_line, drop_pipe
        )
        self._report_open()
        if not self._ticks:  # a second server must not start a second timer
            self._report_time()

    def _handle_line(self, line: bytes) -> None:
        if line == RELEASE_LINE:
            self.release_all()
        elif line.startswith(USER_LINE):
            self.say(line[len(USER_LINE) :].decode(errors="replace"))
        else:
            try:
                order = parse_order(line, len(self.routes))
            except ValueError as wrong:
                self.say(f"an observer gives an invalid order: {wrong}")
            else:
                self.execute_order(order)

    def _report_time(self) -> None:
        """Report the time for the shadows, and every FIGURES_TICKS ticks the figures of the ends."""
        self._ticks += 1
        if self.pipe is not None and not self.pipe.is_behind:
            if not self._ticks % FIGURES_TICKS:
                self._report_figures()
            self.report(TapEventKind.NOW, WAY_TO, 0, 0, 0, b"")
        self.call_after(TICK_NS, self._report_time)

    def _report_figures(self) -> None:
        for route in self.routes:
            talks = islice(reversed(route.talks.items()), MOST_FIGURES) if route.has_stack else ()
            for number, talk in talks:
                for lane in talk.lanes:
                    found = read_path_figures(lane.target.port)
                    if found is not None and found != lane.figures:
                        lane.figures = found
                        self.report(
                            TapEventKind.FIGURES,
                            lane.way,
                            route.route_id,
                            number,
                            0,
                            FIGURES_DATA.pack(*found),
                        )

    def release_all(self) -> None:
        """Forward all held and delayed bytes; from now on hold and delay none."""
        self.holds = False
        for lane in self._list_lanes():
            lane.release_all()

    def describe_open(self) -> str:
        """Return how many connections or conversations are open, or "" for none."""
        number = sum(len(route.talks) for route in self.routes)
        has_others = any(route.route.to.kind != "tcp" for route in self.routes)
        return count(number, "conversation" if has_others else "connection") if number else ""

    def _list_lanes(self) -> list[TapLane]:
        return [lane for route in self.routes for talk in route.talks.values() for lane in talk.lanes]

    def report(
        self, kind: TapEventKind, way: int, route_id: int, number: int, at: int, data: bytes | memoryview
    ) -> None:
        pipe = self.pipe
        if pipe is None:  # forwarding does not depend on observers
            return
        head = EVENT_HEAD.pack(kind, way, route_id, number, at, time.time_ns(), len(data))
        if kind is TapEventKind.BYTES:
            pipe.put(head, data, size=len(data))
            return
        is_end = kind in END_KINDS and number <= self._newest  # never lost: else a reader keeps it open
        pipe.put(head, data, events=0 if is_end else 1, ends=head if is_end else b"")
        if kind is TapEventKind.OPEN and not pipe.is_behind:
            self._newest = max(self._newest, number)

    def _report_missed(self, events: int, size: int, ends: bytes) -> None:
        """Report how many events and bytes were missed, what has ended since, and what is open."""
        heads = [ends[at : at + EVENT_HEAD.size] for at in range(0, len(ends), EVENT_HEAD.size)]
        numbers = [number.to_bytes(4, "little") for route in self.routes for number in route.talks]
        numbers += [head[4:8] for head in heads]
        self.report(TapEventKind.LOST, WAY_TO, 0, 0, 0, LOSS.pack(events, size) + b"".join(numbers))
        if self.pipe is not None:
            self.pipe.put(ends, events=0, ends=ends)
        self._report_open()

    def _report_open(self) -> None:
        for route in self.routes:
            for number, talk in route.talks.items():
                self.report(TapEventKind.OPEN, WAY_TO, route.route_id, number, 1, talk.said)
                for lane in talk.lanes:
                    if lane.held is not None:
                        lane.report_held()

    # -- orders --------------------------------------------------------------------------------------------

    def execute_order(self, order: TapOrder) -> None:
        """Carry out an order; report what was done, or why it cannot be done."""
        route = self.routes[order.route]
        number = order.number or max((n for n, talk in route.talks.items() if talk.lanes), default=NEWEST)
        talk = route.talks.get(number)
        if talk is None or not talk.lanes:
            what = f"conversation {number}" if number else "a conversation"
            self.report(
                TapEventKind.REFUSED, order.way, order.route, number, 0, f"{what} is not there".encode()
            )
            return
        lane = talk.lanes[order.way]
        why = find_refusal(lane, order)
        kind = TapEventKind.REFUSED if why else TapEventKind.INTERVENTION
        self.report(kind, order.way, order.route, number, lane.at, (why or describe_order(order)).encode())
        if not why:
            apply_order(lane, order)
            if lane.held is not None:
                lane.report_held()
        lane.source.update_mask()

    # -- the loop ------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Forward until SIGTERM or Ctrl+C, even if the terminal closes. Then close all conversations."""
        wakes, wakened = socket.socketpair()  # a signal alone would not wake the poll set
        for sock in (wakes, wakened):
            sock.setblocking(False)
        self.register(wakened.fileno(), IN, lambda _: self.stop())
        signal.set_wakeup_fd(wakes.fileno())
        for name in ("SIGTERM", "SIGINT", "SIGQUIT"):
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), lambda *_: None)
        ignore_signals(("SIGHUP",))  # a closed terminal must not cut the plant's connections
        while not self._ends:
            self.run_once(-1)
        self.close()
        signal.set_wakeup_fd(-1)
        self.unregister(wakened.fileno())
        wakes.close()
        wakened.close()

    def stop(self) -> None:
        self._ends = True

    def close(self) -> None:
        """Stop listening, send what waits, close all conversations, and let observers read the rest."""
        self._ends = True
        for route in self.routes:
            route.stop()
        for lane in self._list_lanes():
            lane.release_all()
        until = time.monotonic_ns() + FLUSH_NS
        while any(lane.out for lane in self._list_lanes()) and (rest := until - time.monotonic_ns()) > 0:
            self.run_once(rest / 1e9)
        for route in self.routes:
            for talk in tuple(route.talks.values()):
                talk.finish()
        self.routes.clear()
        if self.pipe is not None:
            self.pipe.send_rest(time.monotonic_ns() + FLUSH_NS)


def write_or_drop_line(line: str) -> None:
    """Write a line for the user to stderr, or drop it if stderr is not read. The tap must not wait."""
    with suppress(OSError, ValueError):
        if HAS_POLL and (stderr := sys.__stderr__) is not None and sys.stderr is stderr:
            poller = select.poll()
            poller.register(stderr.fileno(), OUT)
            if not poller.poll(0):
                return
        sys.stderr.write(f"{one_line(line)[:MOST_LINE_CHARS]}\n")  # fits into a pipe that is writable
        sys.stderr.flush()


def raise_descriptor_limit() -> None:
    """Raise the limit of open descriptors as far as the system allows."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def list_reachable(addresses: Iterable[tuple[str, int] | None]) -> list[str]:
    """Return, as text, the addresses that other machines can reach."""
    from ipaddress import ip_address

    return [format_end(*each) for each in addresses if each and not ip_address(each[0]).is_loopback]
