"""Makes valid packets from the calls of the PLC's kernel at the wire, for IPv4 and serial lines.

Calls do not show acknowledgements. So what a packet acknowledges, and when, is made up.
Segments have at most 1460 bytes; sequence numbers begin at 0 in each direction.
Rule: the partner's FIN or RST follows all bytes that came before it, even if blocks read these bytes later.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Final, NamedTuple

from trcvtui.capture.packets import TCP, UDP
from trcvtui.net.kernel import KernelLoss, LocalAddress, NewClient
from trcvtui.net.results import ANY_ADDRESS, Endpoint, Fault, is_loopback, parse_octets
from trcvtui.recording.journal import WireCall

MOST_SEGMENT_BYTES: Final = 1460
MOST_DATAGRAM_BYTES: Final = 65_507
FIRST_MADE_UP_PORT: Final = 49_152  # of a connection whose local port was never asked of the stack
FIN, SYN, RST, PSH, ACK = 1, 2, 4, 8, 16
FULL_WINDOW: Final = 65_535
SERIAL_SENT, SERIAL_RECEIVED = 1, 2  # events of RTAC serial: DATA_TX_START, DATA_RX_START
SERIAL_ERRORS: Final = 7, 8, 9, 10  # FRAMING_ERROR, PARITY_ERROR, SERIAL_BREAK, SERIAL_OVERFLOW
MOST_ERRORS: Final = 16  # events of a kind and a second
MOST_TAIL_BYTES: Final = 320 << 10  # bytes of a direction that the next file may repeat
MOST_MESSAGES: Final = 1024  # unread datagrams of a socket, and ends of jobs, that are kept
DATA_TPDU: Final = 0xF0
NO_END_ERRORS: Final = frozenset({"ETIMEDOUT", "EHOSTUNREACH", "ENETUNREACH"})  # no FIN or RST ends it
RESET_ERRORS: Final = frozenset({"ECONNRESET", "ECONNREFUSED", "EPIPE", "ECONNABORTED", "ENOTCONN"})
_PACK_IP: Final = struct.Struct(">BBHHHBBH4s4s").pack
_PACK_TCP: Final = struct.Struct(">HHIIBBHHH").pack
_PACK_UDP: Final = struct.Struct(">HHHH").pack
_PACK_SERIAL: Final = struct.Struct(">IIBBH").pack


class WirePacket(NamedTuple):
    """One packet. `line` names a ComBuffer, or is "" for IP. The last `payload` bytes are the payload."""

    owners: tuple[str, ...]
    line: str
    ns: int
    data: bytes
    payload: int
    sent: bool | None = None
    flow: Flow | None = None
    at: int = 0
    remark: str = ""


class Flow:
    """One direction of a connection, a UDP socket or a serial line; places count bytes from the beginning.

    A datagram counts one byte more than it has, so that an empty datagram has a place, too.
    """

    def __init__(self, is_stream: bool = False) -> None:
        self.is_stream = is_stream
        self.in_packets = self.whole = self.taken = (
            0  # bytes in packets, bytes that came, bytes that were read
        )
        self.tail = bytearray()  # of a stream: bytes in packets since `job`, the newest MOST_TAIL_BYTES
        self.job = 0  # where the last job has ended
        self.ends: deque[tuple[int, int]] = deque(maxlen=MOST_MESSAGES)  # of jobs: from which scan on, place
        self.unread: deque[WirePacket] = deque(maxlen=MOST_MESSAGES)  # datagrams
        self.read: list[WirePacket] = []  # datagrams, since `job`
        self.is_part = False  # the newest call has sent a part of a job
        self.ended_in = -9  # the scan of its FIN or RST

    def add_bytes(self, data: bytes) -> None:
        self.in_packets += len(data)
        self.whole = max(self.whole, self.in_packets)
        self.tail += data
        del self.tail[: max(0, len(self.tail) - MOST_TAIL_BYTES)]

    def take_job_end(self, scan: int, expected: int, is_sent: bool) -> int:
        """Return the place where the job with DONE in `scan` ended, or 0 if this place is unknown."""
        places = [place for since, place in self.ends if since <= scan]
        if not places:
            return 0
        self._end_job(expected if expected in places else places[0 if is_sent else -1])
        return self.job

    def take_failed_job_end(self, scan: int) -> int:
        """Return where the bytes end that a job with ERROR took in `scan` or the scan before, else 0."""
        since, place = self.ends[-1] if self.ends else (-9, self.job)
        self._end_job(place)
        return place if since >= scan - 1 else 0

    def _end_job(self, place: int) -> None:
        self.job = max(self.job, place)
        while self.ends and self.ends[0][1] <= self.job:
            self.ends.popleft()
        self.read.clear()
        del self.tail[: max(0, len(self.tail) - (self.in_packets - self.job))]

    def find_tsdu_end(self) -> int:
        """Return the end of the ISO-on-TCP message that follows the last message that was read."""
        begin = self.ends[-1][1] if self.ends else self.job
        first = self.in_packets - len(self.tail)
        at, is_last = begin - first, False
        while at >= 0 and not is_last and len(self.tail) >= at + 7:
            is_last = self.tail[at + 5] == DATA_TPDU and self.tail[at + 6] > 127  # EOT (RFC 905, 13.7)
            at += max(7, int.from_bytes(self.tail[at + 2 : at + 4], "big"))  # TPKT (RFC 1006); 0 would stay
        return min(first + at, self.taken) if is_last else self.taken


NO_FLOWS: Final = Flow(), Flow()


class _TcpStream:
    def __init__(self, owner: str, here: Endpoint, there: Endpoint) -> None:
        self.owners: tuple[str, ...] = (owner,)
        self.ends = here, there
        self.flows = Flow(True), Flow(True)  # from the PLC, to it
        self.controls = [0, 0]  # SYN and FIN take a sequence number each
        self.has_ended = [False, False]  # FIN or RST
        self.coming_end = 0  # the partner's FIN or RST, which waits for bytes without a packet
        self.is_open = False
        self.is_own = False  # both ends are the PLC's
        self.is_tls = False
        self.first_remark = ""  # the remark of its first packet in this file


class WirePackets:
    """Makes packets of the calls of a run, one after the other; `wall_ns` is UTC at time 0 of the run."""

    def __init__(self) -> None:
        self.wall_ns = 0
        self.scan = 0
        self.flows: dict[int, tuple[Flow, Flow]] = {}  # of each handle: from the PLC, to it
        self.newest: dict[str, tuple[Flow, Flow]] = {}  # of each CONNECT or ComBuffer
        self._bound: dict[int, Endpoint] = {}
        self._streams: dict[int, _TcpStream] = {}
        self._address = "127.0.0.1"  # of a socket that is bound to 0.0.0.0
        self._port = FIRST_MADE_UP_PORT
        self._number = 0  # of IP packets
        self._counted: dict[str, tuple[int, ...]] = {}  # errors of each serial line
        self._at: dict[str, Callable[[WireCall], Iterator[WirePacket] | None]] = {
            "local_addresses": self._note_addresses,
            "bind": self._note_bind,
            "local_end": self._note_local_end,
            "accept": self._handle_accept,
            "connect": self._handle_connect,
            "connect_result": self._handle_connect_result,
            "recv": self._handle_recv,
            "arrived": self._handle_arrival,
            "ended": self._handle_partner_end,
            "message": self._handle_message,
            "send": self._handle_send,
            "send_to": self._handle_send_to,
            "shutdown": self._handle_shutdown,
            "close": self._handle_close,
            "abort": self._handle_abort,
            "loss": self._handle_loss,
            "port read": self._handle_serial_bytes,
            "port write": self._handle_serial_bytes,
            "port errors": self._handle_line_errors,
        }

    def make_packets(self, call: WireCall) -> Iterator[WirePacket]:
        made = self._at.get(call.call)
        return (made(call) if made else None) or iter(())

    # -- addresses --------------------------------------------------------------------------------------

    def _note_addresses(self, call: WireCall) -> None:
        found = call.answer if isinstance(call.answer, tuple) else ()
        own = [each.address for each in found if isinstance(each, LocalAddress) and not each.loopback]
        self._address = next((address for address in own if parse_octets(address)), self._address)

    def _note_bind(self, call: WireCall) -> None:
        end = call.args[0] if call.args else None
        if isinstance(end, Endpoint) and call.answer is None:
            self._bound[call.handle] = end

    def _note_local_end(self, call: WireCall) -> None:
        if isinstance(call.answer, Endpoint):
            self._bound[call.handle] = call.answer

    def _is_own(self, end: Endpoint) -> bool:
        addresses = (end.address, ANY_ADDRESS)
        return any(each.port == end.port and each.address in addresses for each in self._bound.values())

    def _own_end(self, handle: int, other: Endpoint) -> Endpoint:
        end = self._bound.get(handle, Endpoint(ANY_ADDRESS, 0))
        port = end.port
        if not port:  # unknown: make one up
            port, self._port = self._port, FIRST_MADE_UP_PORT + (self._port - FIRST_MADE_UP_PORT + 1) % 16_384
        usual = "127.0.0.1" if is_loopback(other.address) else self._address  # as a stack chooses
        return Endpoint(usual if end.address == ANY_ADDRESS else end.address, port)

    # -- TCP --------------------------------------------------------------------------------------------

    def _handle_accept(self, call: WireCall) -> Iterator[WirePacket]:
        if isinstance(call.answer, NewClient):
            peer = call.answer.peer
            stream = _TcpStream(call.owner, self._own_end(call.handle, peer), peer)
            caller = next((each for each in self._streams.values() if each.ends == stream.ends[::-1]), None)
            if caller is not None:  # a CONNECT of this PLC, whose calls make these packets
                caller.owners += stream.owners
                self._add_flows(call.owner, call.answer.handle, caller.flows[::-1])
                return
            self._streams[call.answer.handle] = stream
            self._add_flows(call.owner, call.answer.handle, stream.flows)
            yield self._make_segment(call, stream, 1, SYN)
            yield from self._establish(call, stream, 0)

    def _handle_connect(self, call: WireCall) -> Iterator[WirePacket]:
        there = call.args[0] if call.args else None
        if isinstance(there, Endpoint) and parse_octets(there.address):
            stream = _TcpStream(call.owner, self._own_end(call.handle, there), there)
            stream.is_own = self._is_own(there)
            self._streams[call.handle] = stream
            self._add_flows(call.owner, call.handle, stream.flows)
            if call.answer is None or _is_reset(call.answer):  # else nothing was sent
                yield self._make_segment(call, stream, 0, SYN)
            yield from self._handle_fault(call, stream, call.answer)

    def _add_flows(self, owner: str, handle: int, flows: tuple[Flow, Flow]) -> tuple[Flow, Flow]:
        self.newest[owner] = self.flows[handle] = flows
        return flows

    def _handle_connect_result(self, call: WireCall) -> Iterator[WirePacket]:
        stream, answer = self._streams.get(call.handle), call.answer
        if stream is None:
            return
        # An RST that answers our SYN is ECONNREFUSED; before ECONNRESET the connection was open.
        is_reset = isinstance(answer, Fault) and answer.error == "ECONNRESET" and not answer.injected
        if not stream.is_open and (answer is None or is_reset):
            yield from self._establish(call, stream, 1)
        yield from self._handle_fault(call, stream, answer)

    def _establish(self, call: WireCall, stream: _TcpStream, side: int) -> Iterator[WirePacket]:
        stream.is_open = True
        yield self._make_segment(call, stream, side, SYN | ACK)
        yield self._make_segment(call, stream, 1 - side, ACK)

    def _handle_fault(self, call: WireCall, stream: _TcpStream, answer: object) -> Iterator[WirePacket]:
        if isinstance(answer, Fault) and not answer.injected:
            stream.is_open &= answer.error not in NO_END_ERRORS
        if _is_reset(answer):
            yield from self._note_partner_end(call, stream, RST | ACK)

    def _note_partner_end(self, call: WireCall, stream: _TcpStream, flags: int) -> Iterator[WirePacket]:
        stream.coming_end = max(stream.coming_end, flags)  # RST outweighs FIN
        yield from self._add_partner_bytes(call, stream, stream.flows[1].in_packets)

    def _handle_recv(self, call: WireCall) -> Iterator[WirePacket]:
        stream, count = self._streams.get(call.handle), call.answer
        if isinstance(count, int) and call.handle in self.flows:
            flow = self.flows[call.handle][1]
            flow.taken += count
            flow.whole = max(flow.whole, flow.taken)
        if stream is None:
            return
        if isinstance(count, Fault):
            yield from self._handle_fault(call, stream, count)
        elif isinstance(count, int) and count:
            yield from self._add_partner_bytes(call, stream, stream.flows[1].taken - count)
        elif isinstance(count, int) and call.args != (0,):  # 0 bytes although there was room: FIN
            yield from self._note_partner_end(call, stream, FIN | ACK)

    def _handle_arrival(self, call: WireCall) -> Iterator[WirePacket]:
        stream, whole = self._streams.get(call.handle), call.args[0]
        if stream is not None and isinstance(whole, int):
            flow = stream.flows[1]
            flow.whole = max(flow.whole, whole)
            yield from self._add_partner_bytes(call, stream, max(flow.in_packets, flow.taken))

    def _handle_partner_end(self, call: WireCall) -> Iterator[WirePacket]:
        stream = self._streams.get(call.handle)
        if stream is not None:
            yield from self._note_partner_end(call, stream, ACK | (RST if call.args[0] == "rst" else FIN))

    def _add_partner_bytes(self, call: WireCall, stream: _TcpStream, at: int) -> Iterator[WirePacket]:
        """Yield packets of the partner's new bytes, then a due FIN or RST. `call.data` begins at `at`."""
        flow = stream.flows[1]
        new = call.data[max(0, flow.in_packets - at) :] if call.data else b""
        if new:
            flow.in_packets = max(flow.in_packets, at)  # discarded bytes are missing
            yield from self._add_data(call, stream, 1, new)
        if stream.coming_end and flow.in_packets >= flow.whole:  # Rule
            yield from self._make_end(call, stream, 1, stream.coming_end)

    def _handle_send(self, call: WireCall) -> Iterator[WirePacket]:
        stream = self._streams.get(call.handle)
        if stream is None:
            if call.handle in self.flows:  # a CONNECT of this PLC reads them
                self.flows[call.handle][0].whole += len(call.data)
        elif call.data:
            yield from self._add_data(call, stream, 0, call.data)
        elif not stream.has_ended[0]:  # after our end a send fails without a packet
            yield from self._handle_fault(call, stream, call.answer)

    def _add_data(self, call: WireCall, stream: _TcpStream, side: int, data: bytes) -> Iterator[WirePacket]:
        flow, at = stream.flows[side], stream.flows[side].in_packets
        if not at and data[:2] == b"\x16\3" and data[5:6] == b"\1":  # ClientHello (RFC 8446, 4.1.2)
            stream.is_tls = True
        flow.add_bytes(data)
        return self._split_data(call, stream, side, at, data)

    def _split_data(
        self, call: WireCall, stream: _TcpStream, side: int, at: int, data: bytes, remark: str = ""
    ) -> Iterator[WirePacket]:
        for skip in range(0, len(data), MOST_SEGMENT_BYTES):
            part = data[skip : skip + MOST_SEGMENT_BYTES]
            last = PSH if skip + MOST_SEGMENT_BYTES >= len(data) else 0
            yield self._make_segment(call, stream, side, ACK | last, part, at + skip, remark)
            remark = ""

    def _handle_shutdown(self, call: WireCall) -> Iterator[WirePacket]:
        stream = self._streams.get(call.handle)
        if stream is not None and call.answer is None:
            yield from self._make_end(call, stream, 0, FIN | ACK)
        elif stream is not None:
            yield from self._handle_fault(call, stream, call.answer)

    def _handle_close(self, call: WireCall) -> Iterator[WirePacket]:
        """Yield RST if the stack or our own count shows unread bytes (RFC 1122, 4.2.2.13), else FIN."""
        flow = self.flows.get(call.handle, NO_FLOWS)[1]
        unread = call.args[0] if call.args else flow.whole - flow.taken
        yield from self._end_stream(call, (RST if unread else FIN) | ACK)

    def _handle_abort(self, call: WireCall) -> Iterator[WirePacket]:
        yield from self._end_stream(call, RST | ACK)

    def _end_stream(self, call: WireCall, flags: int) -> Iterator[WirePacket]:
        self._bound.pop(call.handle, None)
        self.flows.pop(call.handle, None)
        stream = self._streams.pop(call.handle, None)
        if stream is None or not stream.is_open:
            return
        flow = stream.flows[1]
        remark = f"{flow.whole - flow.in_packets} bytes to the PLC are missing: they were never read"
        if flow.in_packets == flow.whole:
            remark = ""
        if stream.coming_end:
            flow.in_packets = flow.whole
            yield from self._make_end(call, stream, 1, stream.coming_end, remark)
            remark = ""
        yield from self._make_end(call, stream, 0, flags, remark)

    def _handle_loss(self, call: WireCall) -> Iterator[WirePacket]:
        stream = self._streams.get(call.handle)
        if stream is not None and isinstance(call.answer, KernelLoss):
            loss, flow = call.answer, stream.flows[1]
            flow.whole = max(flow.whole, flow.taken + loss.unread)
            if loss.fault is None:
                yield from self._note_partner_end(call, stream, FIN | ACK)
            yield from self._handle_fault(call, stream, loss.fault)

    def _make_end(
        self, call: WireCall, stream: _TcpStream, side: int, flags: int, remark: str = ""
    ) -> Iterator[WirePacket]:
        if all(stream.has_ended) or (stream.has_ended[side] and not flags & RST):
            return  # after FIN only RST is new
        yield self._make_segment(call, stream, side, flags, remark=remark)
        stream.flows[side].ended_in = self.scan
        stream.has_ended = (
            [True, True]
            if flags & RST
            else [stream.has_ended[0] or side == 0, stream.has_ended[1] or side == 1]
        )

    def _make_segment(
        self,
        call: WireCall,
        stream: _TcpStream,
        side: int,
        flags: int,
        payload: bytes = b"",
        at: int = -1,
        remark: str = "",
    ) -> WirePacket:
        """Return one segment that a side sends. Side 0 is the PLC. The payload begins at byte `at`."""
        source, target = stream.ends[side], stream.ends[1 - side]
        flow, other = stream.flows[side], stream.flows[1 - side]
        at = flow.in_packets if at < 0 else at
        sequence = at + (1 if payload else stream.controls[side]) & 0xFFFFFFFF  # SYN has taken number 0
        seen = other.in_packets + stream.controls[1 - side] & 0xFFFFFFFF
        stream.controls[side] += 1 if flags & (SYN | FIN) else 0
        window = FULL_WINDOW if side else max(0, FULL_WINDOW - (other.whole - other.taken))
        head = _PACK_TCP(
            source.port, target.port, sequence, seen if flags & ACK else 0, 5 << 4, flags, window, 0, 0
        )
        sent = None if stream.is_own else side == 0
        if stream.first_remark:
            remark = "; ".join(filter(None, (stream.first_remark, remark)))
            stream.first_remark = ""
        data = self._make_ip_packet(TCP, source, target, head, 16, payload)
        ns = self.wall_ns + call.at
        return WirePacket(stream.owners, "", ns, data, len(payload), sent, flow, at, remark)

    # -- the next file ----------------------------------------------------------------------------------

    def list_open_streams(self) -> Iterator[tuple[str, int, Flow, int]]:
        """Yield each open stream's owner, handle, flow to the PLC, partner's FIN or RST (0: none)."""
        for handle, stream in self._streams.items():
            if stream.is_open:
                yield stream.owners[0], handle, stream.flows[1], stream.coming_end & (FIN | RST)

    def begin_file(self, now: int) -> Iterator[WirePacket]:
        """Yield the packets that a new file repeats: for each open stream, the bytes of unfinished jobs."""
        for stream in self._streams.values():
            if not stream.is_open:
                continue
            ours, theirs = stream.flows
            again = [bytes(ours.tail) if ours.is_part or ours.ends else b"", bytes(theirs.tail)]
            again = [b"", b""] if stream.is_tls else again  # without the handshake it cannot be decrypted
            out, come = (flow.in_packets - len(tail) for flow, tail in zip(stream.flows, again, strict=True))
            stream.first_remark = (
                f"begins in the middle: {come} bytes to the PLC and {out} bytes from it came before"
            )
            if stream.is_tls:
                stream.first_remark += "; TLS: cannot be decrypted in this file"
            call = WireCall(now, stream.owners[0], "", 0, (), None, b"")
            for side, at in ((1, come), (0, out)):
                flow = stream.flows[side]
                missing, unread = at - flow.job, flow.whole - flow.taken if side else 0
                remark = f"repeated: {len(again[side])} bytes of an unfinished job"
                remark += f", of which {unread} unread" if unread else ""
                remark += f", {missing} bytes before them are missing" if missing else ""
                flow.in_packets = at
                yield from self._split_data(call, stream, side, at, again[side], remark)
                flow.in_packets += len(again[side])
        for _, flow in self.flows.values():
            for packet in (*flow.read, *flow.unread):
                yield packet._replace(ns=self.wall_ns + now, remark="repeated: it came before")

    # -- UDP --------------------------------------------------------------------------------------------

    def _handle_message(self, call: WireCall) -> Iterator[WirePacket]:
        source, flow = call.args[0], self._get_flows(call)[1]
        if isinstance(source, Endpoint):
            sent = None if self._is_own(source) else False
            flow.unread.append(self._make_udp(call, source, self._own_end(call.handle, source), sent, flow))
            yield flow.unread[-1]

    def _handle_send_to(self, call: WireCall) -> Iterator[WirePacket]:
        target = call.args[-1] if call.args else None
        if isinstance(target, Endpoint) and parse_octets(target.address) and isinstance(call.answer, int):
            sent, flow = None if self._is_own(target) else True, self._get_flows(call)[0]
            yield self._make_udp(call, self._own_end(call.handle, target), target, sent, flow)

    def _get_flows(self, call: WireCall) -> tuple[Flow, Flow]:
        return self.flows.get(call.handle) or self._add_flows(call.owner, call.handle, (Flow(), Flow()))

    def _make_udp(
        self, call: WireCall, source: Endpoint, target: Endpoint, sent: bool | None, flow: Flow
    ) -> WirePacket:
        payload = call.data[:MOST_DATAGRAM_BYTES]
        head = _PACK_UDP(source.port, target.port, 8 + len(payload), 0)
        data = self._make_ip_packet(UDP, source, target, head, 6, payload)
        at, flow.in_packets = flow.in_packets, flow.in_packets + len(payload) + 1
        return WirePacket((call.owner,), "", self.wall_ns + call.at, data, len(payload), sent, flow, at)

    def _make_ip_packet(
        self, protocol: int, source: Endpoint, target: Endpoint, head: bytes, sum_at: int, payload: bytes
    ) -> bytes:
        """Return an IP packet. The checksum goes to offset `sum_at` of the transport header `head`."""
        ends = _pack_address(source.address) + _pack_address(target.address)
        size = len(head) + len(payload)
        inner = checksum(ends + bytes((0, protocol)) + size.to_bytes(2, "big") + head + payload)
        if protocol == UDP and not inner:  # 0 would mean: no checksum (RFC 768)
            inner = 0xFFFF
        head = head[:sum_at] + inner.to_bytes(2, "big") + head[sum_at + 2 :]
        self._number = self._number + 1 & 0xFFFF
        fields = 0x45, 0, 20 + size, self._number, 0x4000, 64, protocol  # not to be fragmented
        outer = checksum(_PACK_IP(*fields, 0, ends[:4], ends[4:]))
        return _PACK_IP(*fields, outer, ends[:4], ends[4:]) + head + payload

    # -- serial lines -----------------------------------------------------------------------------------

    def _handle_line_errors(self, call: WireCall) -> Iterator[WirePacket]:
        counted = (
            call.answer if isinstance(call.answer, tuple) and len(call.answer) == len(SERIAL_ERRORS) else None
        )
        before, ns = self._counted.get(call.owner, counted), self.wall_ns + call.at
        if counted is None or before is None:
            return
        self._counted[call.owner] = counted
        for event, had, has in zip(SERIAL_ERRORS, before, counted, strict=True):
            head = _make_serial_head(ns, event)
            for _ in range(min(has - had, MOST_ERRORS)):  # a broken line may count thousands
                yield WirePacket((call.owner,), call.owner, ns, head, 0)

    def _handle_serial_bytes(self, call: WireCall) -> Iterator[WirePacket]:
        if call.data:
            ns, comes = self.wall_ns + call.at, call.call == "port read"
            flow = self.newest.setdefault(call.owner, (Flow(), Flow()))[comes]
            at, flow.in_packets = flow.in_packets, flow.in_packets + len(call.data)
            flow.ends.append((self.scan, flow.in_packets))
            head = _make_serial_head(ns, SERIAL_RECEIVED if comes else SERIAL_SENT)
            size = len(call.data)
            yield WirePacket((call.owner,), call.owner, ns, head + call.data, size, flow=flow, at=at)


def _make_serial_head(ns: int, event: int) -> bytes:
    return _PACK_SERIAL(ns // 10**9 & 0xFFFFFFFF, ns % 10**9 // 1000, event, 0, 0)


@lru_cache(1024)
def _pack_address(address: str) -> bytes:
    return bytes(parse_octets(address) or (0, 0, 0, 0))


def _is_reset(answer: object) -> bool:  # an injected fault has nothing at the wire
    return isinstance(answer, Fault) and not answer.injected and answer.error in RESET_ERRORS


def checksum(data: bytes) -> int:
    """Return the checksum of RFC 1071, computed modulo 65535 from all words as one number."""
    number = int.from_bytes(data + b"\0" if len(data) & 1 else data, "big")
    rest = number % 0xFFFF
    return 0xFFFF - (rest or (0xFFFF if number else 0))
