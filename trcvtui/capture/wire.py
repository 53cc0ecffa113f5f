"""What crosses the wire at the PLC's kernel, as valid packets: IPv4, serial lines.

The calls of the kernel tell more than a wire does: a packet's other half (who sent ACK, and when) is made up.
Segments have at most 1460 bytes; sequence numbers begin at 0 in each direction.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import Final

from trcvtui.capture.journal import WireCall
from trcvtui.capture.packets import TCP, UDP
from trcvtui.net.kernel import Accepted, KernelLoss, LocalAddress
from trcvtui.net.results import ANY_ADDRESS, Datagram, Endpoint, Fault, is_loopback, octets
from trcvtui.records import NamedTuple

MOST_PAYLOAD: Final = 1460
MOST_DATAGRAM: Final = 65_507
FIRST_PORT: Final = 49_152  # of a call whose own port nobody asked for
FIN, SYN, RST, PSH, ACK = 1, 2, 4, 8, 16
WINDOW: Final = 65_535
SERIAL_SENT, SERIAL_RECEIVED = 1, 2  # events of RTAC serial: DATA_TX_START, DATA_RX_START
SERIAL_ERRORS: Final = 7, 8, 9, 10  # FRAMING_ERROR, PARITY_ERROR, SERIAL_BREAK, SERIAL_OVERFLOW
MOST_ERRORS: Final = 16  # events of a kind and a second
RESETS: Final = frozenset({"ECONNRESET", "ECONNREFUSED", "EPIPE", "ECONNABORTED"})
_IP: Final = struct.Struct(">BBHHHBBH4s4s").pack
_TCP: Final = struct.Struct(">HHIIBBHHH").pack
_UDP: Final = struct.Struct(">HHHH").pack
_SERIAL: Final = struct.Struct(">IIBBH").pack


class WirePacket(NamedTuple):
    """One packet; `line` is the ComBuffer of a serial one, "" for IP. `payload`: bytes at its end.

    `owners`: the CONNECT or ComBuffer that it is of; two, where CONNECTs talk with each other: then the PLC
    has both sent and received it. `sent`: by the PLC, or to it; None: both, or a serial line.
    """

    owners: tuple[str, ...]
    line: str
    ns: int
    data: bytes
    payload: int
    sent: bool | None = None


class _TcpStream:
    """One TCP connection: its ends and what each has sent."""

    def __init__(self, owner: str, here: Endpoint, there: Endpoint) -> None:
        self.owners: tuple[str, ...] = (owner,)
        self.ends = here, there
        self.sent = [0, 0]  # sequence numbers of both
        self.has_ended = [False, False]  # FIN or RST
        self.stands = False
        self.is_own = False  # both ends are the PLC's


class WirePackets:
    """The packets of a run's calls, one call after the other; `wall_ns` is UTC at time 0 of the run."""

    def __init__(self, wall_ns: int) -> None:
        self._wall_ns = wall_ns
        self._bound: dict[int, Endpoint] = {}
        self._streams: dict[int, _TcpStream] = {}
        self._address = "127.0.0.1"  # where only 0.0.0.0 was told
        self._port = FIRST_PORT
        self._number = 0  # of IP packets
        self._counted: dict[str, tuple[int, ...]] = {}  # errors of each serial line
        self._at: dict[str, Callable[[WireCall], Iterator[WirePacket]]] = {
            "local_addresses": self._addresses,
            "bind": self._bind,
            "local_end": self._local_end,
            "accept": self._accept,
            "connect": self._connect,
            "connect_result": self._connected,
            "recv": self._received,
            "send": self._sent,
            "recv_from": self._datagram_in,
            "send_to": self._datagram_out,
            "shutdown": self._shut,
            "close": self._closed,
            "abort": self._aborted,
            "loss": self._lost,
            "port read": self._serial,
            "port write": self._serial,
            "port errors": self._line_errors,
        }

    def of(self, call: WireCall) -> Iterator[WirePacket]:
        """Yield the packets of one call, none for most."""
        made = self._at.get(call.call)
        return made(call) if made else iter(())

    # -- who is where -----------------------------------------------------------------------------------

    def _addresses(self, call: WireCall) -> Iterator[WirePacket]:
        found = call.answer if isinstance(call.answer, tuple) else ()
        own = [each.address for each in found if isinstance(each, LocalAddress) and not each.loopback]
        self._address = next((address for address in own if octets(address)), self._address)
        return iter(())

    def _bind(self, call: WireCall) -> Iterator[WirePacket]:
        end = call.args[0] if call.args else None
        if isinstance(end, Endpoint) and call.answer is None:
            self._bound[call.handle] = end
        return iter(())

    def _local_end(self, call: WireCall) -> Iterator[WirePacket]:
        if isinstance(call.answer, Endpoint):
            self._bound[call.handle] = call.answer
        return iter(())

    def _is_own(self, end: Endpoint) -> bool:
        addresses = (end.address, ANY_ADDRESS)
        return any(each.port == end.port and each.address in addresses for each in self._bound.values())

    def _own_end(self, handle: int, other: Endpoint) -> Endpoint:
        end = self._bound.get(handle, Endpoint(ANY_ADDRESS, 0))
        port = end.port
        if not port:
            port, self._port = self._port, FIRST_PORT + (self._port - FIRST_PORT + 1) % 16_384
        usual = "127.0.0.1" if is_loopback(other.address) else self._address
        return Endpoint(usual if end.address == ANY_ADDRESS else end.address, port)

    # -- TCP --------------------------------------------------------------------------------------------

    def _accept(self, call: WireCall) -> Iterator[WirePacket]:
        if isinstance(call.answer, Accepted):
            peer = call.answer.peer
            stream = _TcpStream(call.owner, self._own_end(call.handle, peer), peer)
            caller = next((each for each in self._streams.values() if each.ends == stream.ends[::-1]), None)
            if caller is not None:  # a CONNECT of this PLC, whose calls tell the same packets
                caller.owners += stream.owners
                return
            self._streams[call.answer.handle] = stream
            yield self._segment(call, stream, 1, SYN)
            yield from self._answered(call, stream, 0)

    def _connect(self, call: WireCall) -> Iterator[WirePacket]:
        there = call.args[0] if call.args else None
        if isinstance(there, Endpoint) and octets(there.address):
            stream = _TcpStream(call.owner, self._own_end(call.handle, there), there)
            stream.is_own = self._is_own(there)
            self._streams[call.handle] = stream
            yield self._segment(call, stream, 0, SYN)
            yield from self._refused(call, stream, call.answer)

    def _connected(self, call: WireCall) -> Iterator[WirePacket]:
        stream = self._streams.get(call.handle)
        if stream is not None and call.answer is None and not stream.stands:
            yield from self._answered(call, stream, 1)
        elif stream is not None:
            yield from self._refused(call, stream, call.answer)

    def _answered(self, call: WireCall, stream: _TcpStream, who: int) -> Iterator[WirePacket]:
        stream.stands = True
        yield self._segment(call, stream, who, SYN | ACK)
        yield self._segment(call, stream, 1 - who, ACK)

    def _refused(self, call: WireCall, stream: _TcpStream, answer: object) -> Iterator[WirePacket]:
        if isinstance(answer, Fault) and not answer.injected and answer.error in RESETS:
            yield from self._end(call, stream, 1, RST | ACK)

    def _received(self, call: WireCall) -> Iterator[WirePacket]:
        stream = self._streams.get(call.handle)
        if stream is None:
            return
        count = call.answer
        if isinstance(count, Fault):
            yield from self._refused(call, stream, count)
        elif isinstance(count, int) and count:
            yield from self._data(call, stream, 1)
        elif isinstance(count, int) and call.args != (0,):
            yield from self._end(call, stream, 1, FIN | ACK)

    def _sent(self, call: WireCall) -> Iterator[WirePacket]:
        stream = self._streams.get(call.handle)
        if stream is not None and call.data:
            yield from self._data(call, stream, 0)

    def _data(self, call: WireCall, stream: _TcpStream, who: int) -> Iterator[WirePacket]:
        for at in range(0, len(call.data), MOST_PAYLOAD):
            part = call.data[at : at + MOST_PAYLOAD]
            last = PSH if at + MOST_PAYLOAD >= len(call.data) else 0
            yield self._segment(call, stream, who, ACK | last, part)

    def _shut(self, call: WireCall) -> Iterator[WirePacket]:
        stream = self._streams.get(call.handle)
        if stream is not None and not isinstance(call.answer, Fault):
            yield from self._end(call, stream, 0, FIN | ACK)

    def _closed(self, call: WireCall) -> Iterator[WirePacket]:
        self._bound.pop(call.handle, None)
        stream = self._streams.pop(call.handle, None)
        if stream is not None and stream.stands:
            yield from self._end(call, stream, 0, FIN | ACK)

    def _aborted(self, call: WireCall) -> Iterator[WirePacket]:
        self._bound.pop(call.handle, None)
        stream = self._streams.pop(call.handle, None)
        if stream is not None and stream.stands:
            yield from self._end(call, stream, 0, RST | ACK)

    def _lost(self, call: WireCall) -> Iterator[WirePacket]:
        """Yield what a loss tells: RST at once; a FIN after the bytes that wait, which `recv` tells then."""
        stream = self._streams.get(call.handle)
        if stream is not None and isinstance(call.answer, KernelLoss):
            loss = call.answer
            if loss.fault is None and not loss.unread:
                yield from self._end(call, stream, 1, FIN | ACK)
            yield from self._refused(call, stream, loss.fault)

    def _end(self, call: WireCall, stream: _TcpStream, who: int, flags: int) -> Iterator[WirePacket]:
        if all(stream.has_ended) or (stream.has_ended[who] and not flags & RST):
            return
        yield self._segment(call, stream, who, flags)
        stream.has_ended = (
            [True, True]
            if flags & RST
            else [stream.has_ended[0] or who == 0, stream.has_ended[1] or who == 1]
        )

    def _segment(
        self, call: WireCall, stream: _TcpStream, who: int, flags: int, payload: bytes = b""
    ) -> WirePacket:
        """Return one segment of the end number `who`; 0 is the PLC's."""
        source, target = stream.ends[who], stream.ends[1 - who]
        sequence, seen = stream.sent[who] & 0xFFFFFFFF, stream.sent[1 - who] & 0xFFFFFFFF
        stream.sent[who] += len(payload) + (1 if flags & (SYN | FIN) else 0)
        head = _TCP(
            source.port, target.port, sequence, seen if flags & ACK else 0, 5 << 4, flags, WINDOW, 0, 0
        )
        sent = None if stream.is_own else who == 0
        return self._ip(call, stream.owners, TCP, source, target, head, 16, payload, sent)

    # -- UDP --------------------------------------------------------------------------------------------

    def _datagram_in(self, call: WireCall) -> Iterator[WirePacket]:
        if isinstance(call.answer, Datagram):
            source = call.answer.source
            sent = None if self._is_own(source) else False
            yield self._datagram(call, source, self._own_end(call.handle, source), sent)

    def _datagram_out(self, call: WireCall) -> Iterator[WirePacket]:
        target = call.args[-1] if call.args else None
        if isinstance(target, Endpoint) and octets(target.address) and isinstance(call.answer, int):
            sent = None if self._is_own(target) else True
            yield self._datagram(call, self._own_end(call.handle, target), target, sent)

    def _datagram(self, call: WireCall, source: Endpoint, target: Endpoint, sent: bool | None) -> WirePacket:
        payload = call.data[:MOST_DATAGRAM]
        head = _UDP(source.port, target.port, 8 + len(payload), 0)
        return self._ip(call, (call.owner,), UDP, source, target, head, 6, payload, sent)

    def _ip(
        self,
        call: WireCall,
        owners: tuple[str, ...],
        protocol: int,
        source: Endpoint,
        target: Endpoint,
        head: bytes,
        sum_at: int,
        payload: bytes,
        sent: bool | None,
    ) -> WirePacket:
        """Return an IP packet; the checksum of what it carries stands at `sum_at` of `head`."""
        ends = bytes(octets(source.address) or (0, 0, 0, 0)) + bytes(octets(target.address) or (0, 0, 0, 0))
        size = len(head) + len(payload)
        inner = checksum(ends + bytes((0, protocol)) + size.to_bytes(2, "big") + head + payload)
        if protocol == UDP and not inner:
            inner = 0xFFFF
        head = head[:sum_at] + inner.to_bytes(2, "big") + head[sum_at + 2 :]
        self._number = self._number + 1 & 0xFFFF
        fields = 0x45, 0, 20 + size, self._number, 0x4000, 64, protocol
        outer = checksum(_IP(*fields, 0, ends[:4], ends[4:]))
        data = _IP(*fields, outer, ends[:4], ends[4:]) + head + payload
        return WirePacket(owners, "", self._wall_ns + call.at, data, len(payload), sent)

    # -- serial lines -----------------------------------------------------------------------------------

    def _line_errors(self, call: WireCall) -> Iterator[WirePacket]:
        """Yield an event for each error since the last look, MOST_ERRORS of a kind at most."""
        counted = (
            call.answer if isinstance(call.answer, tuple) and len(call.answer) == len(SERIAL_ERRORS) else None
        )
        before, ns = self._counted.get(call.owner, counted), self._wall_ns + call.at
        if counted is None or before is None:
            return
        self._counted[call.owner] = counted
        for event, had, has in zip(SERIAL_ERRORS, before, counted, strict=True):
            head = _SERIAL(ns // 10**9 & 0xFFFFFFFF, ns % 10**9 // 1000, event, 0, 0)
            for _ in range(min(has - had, MOST_ERRORS)):
                yield WirePacket((call.owner,), call.owner, ns, head, 0)

    def _serial(self, call: WireCall) -> Iterator[WirePacket]:
        if call.data:
            ns = self._wall_ns + call.at
            event = SERIAL_RECEIVED if call.call == "port read" else SERIAL_SENT
            head = _SERIAL(ns // 10**9 & 0xFFFFFFFF, ns % 10**9 // 1000, event, 0, 0)
            yield WirePacket((call.owner,), call.owner, ns, head + call.data, len(call.data))


def checksum(data: bytes) -> int:
    """Return the Internet checksum: the sum of 16-bit words modulo 65535 is that of one large number."""
    number = int.from_bytes(data + b"\0" if len(data) & 1 else data, "big")
    rest = number % 0xFFFF
    return 0xFFFF - (rest or (0xFFFF if number else 0))
