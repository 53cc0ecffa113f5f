"""The pairs of ends that a tap joins: TCP, UDP or serial ports. A conversation is one such pair."""

from __future__ import annotations

import errno
import os
import socket
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Final

from trcvtui.errors import mistake, require
from trcvtui.net.os.system_calls import IN, OUT, RESET_ON_CLOSE, count_unread, error_name, peek_at, tcp_info
from trcvtui.net.os.tap_lane import GONE_MASK, DatagramLane, TapConversation, TapEnd, TapLane, TapLoop
from trcvtui.net.tap import WAY_BACK, WAY_TO, Route, TapEventKind, TapPlace
from trcvtui.wording import count

CONNECT_LIMIT_NS: Final = 5_000_000_000  # for the far end to answer
CTS_CHECK_NS: Final = 20_000_000  # between two reads of CTS
REOPEN_PAUSE_NS: Final = 1_000_000_000  # between two attempts to open a port that is gone
MOST_UDP_CLIENTS: Final = 1024  # of a route; then the one that was silent for longest is dropped
LACK_ERRORS: Final = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
LACK_CHECK_NS: Final = 100_000_000  # between two attempts to accept clients again
LACK_WAIT_NS: Final = 2_000_000_000  # for a client to be accepted; then it gets RST
LACK_REPORT_NS: Final = 10_000_000_000  # between two reports of a lack


class TapTcpConversation(TapConversation):
    """A TCP conversation: a client was accepted at the near end, and the far end is being called."""

    has_ends = True

    def __init__(self, route: TcpRoute, near: socket.socket, far: socket.socket, said: bytes) -> None:
        self.route, self.number, self.said = route, route.loop.next_number(), said
        self.loop, self.route_id = route.loop, route.route_id
        self.lanes: tuple[TapLane, TapLane] | tuple[()] = ()
        self.has_ended = False
        self._near, self._far = near, far
        place = route.route.to
        for sock in (near, far):
            sock.setblocking(False)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # a tap adds no delay of its own
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_OOBINLINE, 1)  # else urgent bytes would be lost
        self.report(TapEventKind.OPEN, WAY_TO, said)
        error = self._far.connect_ex((place.address, place.port))
        if error in (errno.EINPROGRESS, errno.EWOULDBLOCK):
            self.loop.register(self._far.fileno(), OUT, self._handle_connected)
            self.loop.call_at(time.monotonic_ns() + CONNECT_LIMIT_NS, self._time_out)
        else:
            self._finish_attempt(error)

    @staticmethod
    def sender(end: TapEnd) -> Callable[[Any], int]:
        send: Callable[[Any], int] = end.port.send
        return send

    @staticmethod
    def receiver(end: TapEnd) -> Callable[[Any], int]:
        receive: Callable[[Any], int] = end.port.recv_into
        return receive

    def _handle_connected(self, _: int) -> None:
        self.loop.unregister(self._far.fileno())
        self._finish_attempt(self._far.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR))

    def _time_out(self) -> None:
        if not self.lanes and not self.has_ended:
            self.loop.unregister(self._far.fileno())
            self._finish_attempt(errno.ETIMEDOUT)

    def _finish_attempt(self, error: int) -> None:
        """Start forwarding if the far end has answered; else send RST to the near end."""
        # Unread bytes prove that it has answered, also if its RST followed at once: they are forwarded.
        if error and not count_unread(self._far):
            self.has_ended = True
            self._far.close()
            _close_with_reset(self._near)
            self.report(TapEventKind.RST, WAY_BACK)
            self._leave_route()
            return
        self.report(TapEventKind.ANSWERED, WAY_BACK)
        near, far = TapEnd(self.loop, self._near), TapEnd(self.loop, self._far)
        self.lanes = TapLane(self, WAY_TO, near, far), TapLane(self, WAY_BACK, far, near)
        if error:
            self.lanes[WAY_BACK].handle_reset(is_read=False)
        near.update_mask()
        far.update_mask()

    def handle_fin(self, lane: TapLane) -> None:
        lane.is_read = True
        if lane.end is None:
            lane.end = TapEventKind.FIN
        lane.source.update_mask()
        lane.pass_end()

    def handle_source_reset(self, lane: TapLane, failed: OSError) -> None:
        lane.handle_reset(True)

    def handle_target_reset(self, lane: TapLane, failed: OSError) -> None:
        lane.target.reads.handle_reset(lane.target.reads.is_read)

    def has_unacknowledged(self, end: TapEnd) -> bool:
        path = tcp_info(end.port)
        return path is not None and path.unacked + path.unsent > 0

    def pass_fin(self, lane: TapLane) -> None:
        self.report(TapEventKind.FIN, lane.way, at=lane.at)
        try:
            lane.target.port.shutdown(socket.SHUT_WR)
        except OSError as failed:
            self.handle_target_reset(lane, failed)
            return
        if all(each.is_over for each in self.lanes):
            self.close()

    def pass_reset(self, lane: TapLane) -> None:
        self.report(TapEventKind.RST, lane.way, at=lane.at)
        self.close(reset=True)

    def close(self, reset: bool = False) -> None:
        """Close both ends; with `reset`, send RST."""
        if not self.has_ended:
            self.has_ended = True
            for lane in self.lanes:
                lane.is_over = True
                lane.source.close(reset)
            if not self.lanes:  # the far end has not answered yet
                with suppress(KeyError):
                    self.loop.unregister(self._far.fileno())
                self._near.close()
                self._far.close()
            self._leave_route()

    def _leave_route(self) -> None:
        self.report(TapEventKind.ENDED, WAY_TO)
        self.route.talks.pop(self.number, None)

    def finish(self) -> None:
        """End the conversation when the tap ends: with FIN, if waiting bytes can be sent in time."""
        for lane in self.lanes:
            if not lane.is_over:
                self.report(TapEventKind.FIN, lane.way, at=lane.at)
            with suppress(OSError):
                lane.source.port.shutdown(socket.SHUT_WR)
            with suppress(OSError):
                lane.source.port.recv_into(self.loop.buffer)  # a close with unread bytes would send RST
        self.close()


class _LackReporter:
    """Reports that a route cannot accept clients: at most one line and one event in 10 s."""

    def __init__(self, route: TcpRoute | UdpRoute, unit: str) -> None:
        self._route, self._unit = route, unit
        self.what, self._is_on = "", False
        self.waiting = self.refused = 0

    def note_lack(self, failed: OSError) -> None:
        self.what = "descriptor" if failed.errno in (errno.EMFILE, errno.ENFILE) else "memory"
        if not self._is_on:
            self._is_on = True
            self._route.loop.call_after(LACK_CHECK_NS, self._report)  # more may come at once

    def _report(self) -> None:
        route, waiting, refused = self._route, self.waiting, self.refused
        self._is_on, self.refused = bool(waiting or refused), 0
        if self._is_on:
            waits = count(waiting, "client waits", "clients wait") if waiting else ""
            lost = f"{count(refused, self._unit)} refused" if refused else ""
            lack = f"no {self.what} {'' if waiting else 'was '}left"
            text = f"{lack}: {', '.join(filter(None, (waits, lost)))}"
            route.loop.say(f"{route.route.name}: {text}")
            route.loop.report(TapEventKind.LACK, WAY_TO, route.route_id, 0, waiting, text.encode())
            route.loop.call_after(LACK_REPORT_NS, self._report)


class TcpRoute:
    """A tap between two TCP ends, for many clients.

    Without a free descriptor, clients wait in the listener's queue, at most LACK_WAIT_NS.
    """

    has_stack = True  # TCP_INFO has figures of each end

    def __init__(self, loop: TapLoop, route: Route, route_id: int) -> None:
        self.loop, self.route, self.route_id = loop, route, route_id
        self.talks: dict[int, Any] = {}
        self._door = _bind_socket(route.listen, socket.SOCK_STREAM)
        self._door.listen(512)
        self._door.setblocking(False)
        self.address = self._door.getsockname()[:2]
        self._family = socket.AF_INET6 if ":" in route.to.address else socket.AF_INET
        self._spare = socket.socket()  # its descriptor is given up to accept a client for its RST
        self._lack = _LackReporter(self, "client")
        self._taken = 0  # clients that were accepted, also for their RST
        self._due: deque[tuple[int, int]] = deque()  # (ns, how many of all clients must be served by then)
        loop.register(self._door.fileno(), IN, self._accept_clients)

    def _accept_clients(self, _: int) -> None:
        for _ in range(64):  # then other conversations have their turn
            far = None
            try:
                far = socket.socket(self._family, socket.SOCK_STREAM)  # first: no client is taken without it
                near, end = self._door.accept()
            except OSError as failed:
                if far is not None:
                    far.close()
                if failed.errno in LACK_ERRORS:
                    self._defer_clients(failed)
                return
            self._taken += 1
            self._lack.waiting = 0
            try:
                talk = TapTcpConversation(self, near, far, _encode_open_event(self.route.to, end))
            except OSError:  # the poll set takes no more
                far.close()
                _close_with_reset(near)
                continue
            if not talk.has_ended:
                self.talks[talk.number] = talk

    def _defer_clients(self, failed: OSError) -> None:
        """Let clients wait in the listener's queue; send RST to those that waited too long."""
        self.loop.set_mask(self._door.fileno(), 0)  # else the poll set would report them all the time
        now, come = time.monotonic_ns(), self._taken + (peek_at(self._door, 0, False).clients or 1)
        if not self._due or come > self._due[-1][1]:
            self._due.append((now + LACK_WAIT_NS, come))
        while self._due and self._due[0][0] <= now:
            _, most = self._due.popleft()
            while self._taken < most and self._reset_client():
                pass
        self._lack.waiting = come - self._taken
        self._lack.note_lack(failed)
        self.loop.call_after(LACK_CHECK_NS, self._resume_accepting)

    def _resume_accepting(self) -> None:
        if self._door.fileno() >= 0:
            self.loop.set_mask(self._door.fileno(), IN)

    def _reset_client(self) -> bool:
        """Accept a client and send it RST; return whether a client was accepted."""
        self._spare.close()
        try:
            near, end = self._door.accept()
        except OSError:
            return False
        _close_with_reset(near)
        with suppress(OSError):  # another program was faster
            self._spare = socket.socket()
        self._taken += 1
        self._lack.refused += 1
        number, why = self.loop.next_number(), f"rst: no {self._lack.what} left".encode()
        events = (
            (TapEventKind.OPEN, WAY_TO, _encode_open_event(self.route.to, end)),
            (TapEventKind.INTERVENTION, WAY_BACK, why),
        )
        for kind, way, data in (
            *events,
            (TapEventKind.RST, WAY_BACK, b""),
            (TapEventKind.ENDED, WAY_TO, b""),
        ):
            self.loop.report(kind, way, self.route_id, number, 0, data)
        return True

    def stop(self) -> None:
        self.loop.unregister(self._door.fileno())
        self._door.close()
        self._spare.close()


class UdpRoute:
    """A tap between UDP ends. Each client has its own socket to the far end, for both directions."""

    has_stack = False

    def __init__(self, loop: TapLoop, route: Route, route_id: int) -> None:
        self.loop, self.route, self.route_id = loop, route, route_id
        self.talks: dict[int, Any] = {}
        self._clients: dict[Any, TapUdpConversation] = {}  # the client of the newest datagram is last
        self.listener = _bind_socket(route.listen, socket.SOCK_DGRAM)
        self.listener.setblocking(False)
        self.address = self.listener.getsockname()[:2]
        self._lack = _LackReporter(self, "datagram")
        loop.register(self.listener.fileno(), IN, self._read_datagrams)

    def _read_datagrams(self, _: int) -> None:
        for _ in range(64):
            try:
                size, client = self.listener.recvfrom_into(self.loop.buffer)
            except OSError:  # no datagram, or an ICMP message
                return
            talk = self._clients.pop(client, None) or self._begin_conversation(client)
            if talk is not None:
                self._clients[client] = talk
                talk.lanes[WAY_TO].handle_data(self.loop.buffer[:size])

    def _begin_conversation(self, client: Any) -> TapUdpConversation | None:
        if len(self._clients) >= MOST_UDP_CLIENTS:
            self._drop_client(next(iter(self._clients)))
        place = self.route.to
        try:
            family = socket.AF_INET6 if ":" in place.address else self.listener.family
            sock = socket.socket(family, socket.SOCK_DGRAM)
            sock.setblocking(False)
            sock.connect((place.address, place.port))
        except OSError as failed:
            if failed.errno in LACK_ERRORS:
                self._lack.refused += 1
                self._lack.note_lack(failed)
            return None
        talk = TapUdpConversation(self, self.loop.next_number(), sock, client)
        self.talks[talk.number] = talk
        return talk

    def _drop_client(self, client: Any) -> None:
        talk = self._clients.pop(client)
        del self.talks[talk.number]
        talk.close()

    def stop(self) -> None:
        """Forward what was held, then stop listening."""
        for client in tuple(self._clients):
            self._drop_client(client)
        self.loop.unregister(self.listener.fileno())
        self.listener.close()


class _DatagramEnd(TapEnd):
    """One end of a UDP conversation. It is always read: without room, a datagram is lost."""

    def __init__(self, port: socket.socket, send: Callable[[Any], int]) -> None:
        self.port, self.sends = port, send
        self.is_open = True

    def update_mask(self) -> None:
        """Do nothing: the route or the conversation has registered the socket."""


class TapUdpConversation(TapConversation):
    def __init__(self, route: UdpRoute, number: int, sock: socket.socket, client: Any) -> None:
        self.number, self.loop, self.route_id, self._sock = number, route.loop, route.route_id, sock
        self.said = _encode_open_event(route.route.to, client)
        near = _DatagramEnd(route.listener, lambda data: route.listener.sendto(data, client))
        far = _DatagramEnd(sock, sock.send)
        self.lanes = DatagramLane(self, WAY_TO, near, far), DatagramLane(self, WAY_BACK, far, near)
        self.loop.register(sock.fileno(), IN, self._read_answers)
        self.report(TapEventKind.OPEN, WAY_TO, self.said)

    @staticmethod
    def sender(end: Any) -> Callable[[Any], int]:
        send: Callable[[Any], int] = end.sends
        return send

    receiver = sender  # never called: the route reads

    def _read_answers(self, _: int) -> None:
        for _ in range(64):
            try:
                size = self._sock.recv_into(self.loop.buffer)
            except OSError:
                return
            self.lanes[WAY_BACK].handle_data(self.loop.buffer[:size])

    def close(self) -> None:
        for lane in self.lanes:
            lane.release_all()
            lane.is_over = True
        self.loop.unregister(self._sock.fileno())
        self._sock.close()
        self.report(TapEventKind.ENDED, WAY_TO)


class TapSerialConversation(TapConversation):
    """Two serial ports; they are the route and its only conversation. A lost port is opened again."""

    said = b""
    has_stack = False

    def __init__(self, loop: TapLoop, route: Route, route_id: int) -> None:
        self.loop, self.route, self.route_id = loop, route, route_id
        self.address: tuple[str, int] | None = None
        self.number = loop.next_number()
        self.talks = {self.number: self}
        self._ports = [_open_serial_port(each) for each in (route.listen, route.to)]
        ends = [TapEnd(loop, port) for port in self._ports]
        self.lanes = TapLane(self, WAY_TO, *ends), TapLane(self, WAY_BACK, *ends[::-1])
        self.said = f"serial|{route.listen.line and route.listen.line.port}|0|".encode()
        self.said += f"{route.to.line and route.to.line.port}|0".encode()
        self.report(TapEventKind.OPEN, WAY_TO, self.said)
        for end in ends:
            end.update_mask()
        self._pass_cts()

    @staticmethod
    def sender(end: TapEnd) -> Callable[[Any], int]:
        return lambda data: os.write(end.fd, data)

    @staticmethod
    def receiver(end: TapEnd) -> Callable[[Any], int]:
        return lambda view: os.readv(end.fd, [view])

    def _pass_cts(self) -> None:
        try:
            for one, other in (self._ports, self._ports[::-1]):
                if other.rts != (cts := one.cts):
                    other.rts = cts
        except Exception:  # a port without CTS and RTS: drivers raise anything
            return
        self.loop.call_at(time.monotonic_ns() + CTS_CHECK_NS, self._pass_cts)

    def handle_fin(self, lane: TapLane) -> None:
        self.handle_source_reset(lane, OSError(errno.EIO, "gone"))

    def handle_source_reset(self, lane: TapLane, failed: OSError) -> None:
        """Report that a port is gone, and open it again."""
        place = self.route.listen if lane.way == WAY_TO else self.route.to
        self.loop.say(f"{self.route.name}: {place} is gone ({error_name(failed)}): it is opened again")
        end = lane.source
        end.loop.unregister(end.fd)
        end.mask = GONE_MASK
        end.writes.out.clear()  # stale when the port is back
        with suppress(Exception):
            end.port.close()
        self._reopen(lane, place)

    def _reopen(self, lane: TapLane, place: TapPlace) -> None:
        end = lane.source
        if not end.is_open:
            return
        try:
            port = _open_serial_port(place)
        except Exception:  # it is not back yet
            self.loop.call_at(time.monotonic_ns() + REOPEN_PAUSE_NS, lambda: self._reopen(lane, place))
            return
        self._ports[lane.way] = end.port = port
        end.fd, end.mask = port.fileno(), 0
        self.loop.register(end.fd, 0, end.handle_ready)
        end.update_mask()
        self.loop.say(f"{self.route.name}: {place} is there again")
        self._pass_cts()

    def handle_target_reset(self, lane: TapLane, failed: OSError) -> None:
        if lane.target.mask != GONE_MASK:
            self.handle_source_reset(lane.target.reads, failed)

    def stop(self) -> None:
        """Do nothing: serial ports have no listener."""

    def finish(self) -> None:
        for lane in self.lanes:
            lane.source.close()


def _close_with_reset(sock: socket.socket) -> None:
    with suppress(OSError):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET_ON_CLOSE)
    sock.close()


def _encode_open_event(place: TapPlace, near: Sequence[Any]) -> bytes:
    return f"{place.kind}|{near[0]}|{near[1]}|{place.address}|{place.port}".encode()


def _bind_socket(place: TapPlace, kind: int) -> socket.socket:
    """Return a socket bound to a place (address and port); raise UserError if the system refuses."""
    family = socket.AF_INET6 if ":" in place.address else socket.AF_INET
    sock = socket.socket(family, kind)
    try:
        if family == socket.AF_INET6:  # else [::] would also take the port of 0.0.0.0
            sock.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        if kind == socket.SOCK_STREAM and os.name == "posix":  # on Windows it could steal a port
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind((place.address, place.port))
    except OSError as failed:
        sock.close()
        raise mistake("LISTEN", f"{place} ({error_name(failed)})", "a free address of this machine") from None
    return sock


def _open_serial_port(place: TapPlace) -> Any:
    """Return an open serial port; raise UserError if it cannot be opened."""
    from trcvtui.net.os.serial import PARITIES, fault_from_error

    assert place.line is not None
    s = place.line
    serial = require("serial", "serial", s.port, "a serial port, but no pyserial")
    try:
        port = serial.Serial(s.port, s.baud, s.data_bits, PARITIES[s.parity], s.stop_bits, timeout=0)
        os.set_blocking(port.fileno(), False)
    except Exception as failed:  # drivers raise anything
        raise mistake(s.port, fault_from_error("open", failed), "a serial port that can be opened") from None
    return port
