"""The bytes that pass a tap, as packets between the caller and the called end, as if there were no tap.

An intervention is a comment on the packet that the tap made or changed. The recording child process writes
the packets to stdout; a file that is cut off can still be read.
"""

from __future__ import annotations

import json
import os
import struct
import sys
from collections.abc import Iterator, Mapping
from ipaddress import IPv6Address, ip_address
from typing import Annotated, Final, Literal, NamedTuple

from msgspec import Meta, Struct

from trcvtui import __version__
from trcvtui.capture import pcap
from trcvtui.capture.packets import TCP, UDP
from trcvtui.net.os.tap_channels import TapChannel
from trcvtui.net.tap import FIGURES_DATA, LOSS, WAY_BACK, WAY_TO, TapEvent, TapEventKind
from trcvtui.recording.wire import (
    ACK,
    FIN,
    FULL_WINDOW,
    MOST_SEGMENT_BYTES,
    PSH,
    RST,
    SERIAL_RECEIVED,
    SERIAL_SENT,
    SYN,
)
from trcvtui.signals import GROUP_SIGNALS, ignore_signals

READ_BYTES: Final = 1 << 18
WIRE_ID: Final = 0  # the interface of IP packets; those of serial lines come after it and after NOTES, if any
NOTES_ID: Final = 1  # the interface of the tap's own notes
NOTE_NAMES: Final[dict[int, str]] = {
    TapEventKind.OPEN: "open",
    TapEventKind.ENDED: "end",
    TapEventKind.FIGURES: "figures",
    TapEventKind.INTERVENTION: "ours",
    TapEventKind.REFUSED: "refused",
    TapEventKind.HELD: "held",
    TapEventKind.LOST: "lost",
    TapEventKind.LACK: "lack",
}
STATE_KINDS: Final = (TapEventKind.HELD, TapEventKind.FIGURES)  # a newer one replaces the older
_PACK_IP_V4: Final = struct.Struct(">BBHHHBBH4s4s").pack
_PACK_IP_V6: Final = struct.Struct(">IHBB16s16s").pack
_PACK_TCP: Final = struct.Struct(">HHIIBBHHH").pack
_PACK_UDP: Final = struct.Struct(">HHHH").pack
_PACK_SERIAL: Final = struct.Struct(">IIBBH").pack


Port = Annotated[int, Meta(ge=0, le=65535)]


class TapNote(Struct):
    """A note of the tap. docs/fleet-formats.md describes its fields."""

    note: str
    tap: int = 0
    conversation: int = 0
    to_connect: bool = True
    text: str = ""
    kind: Literal["tcp", "udp", "serial"] = "tcp"
    ends: tuple[tuple[str, Port], tuple[str, Port]] = (("", 0), ("", 0))
    new: bool = True
    holds: bool = True
    bytes: int = 0
    first: str = ""
    events: int = 0
    round_trip_us: int = 0
    window: int = 0
    again: int = 0
    waiting: int = 0
    taps: tuple[tuple[str, str, str], ...] = ()
    open: tuple[int, ...] = ()
    plc: str | None = None
    dialect: str | None = None


class TapPacket(NamedTuple):
    """A packet; `interface` counts from 0."""

    interface: int
    ns: int
    data: bytes
    comments: tuple[str, ...]


class _TappedConversation:
    """One conversation: ends and next sequence numbers by direction, and remarks for the next packets."""

    def __init__(self, kind: str, ends: tuple[tuple[bytes, int], tuple[bytes, int]]) -> None:
        self.kind, self.ends = kind, ends
        self.interface = WIRE_ID
        self.next = [0, 0]  # sequence numbers
        self.remarks: tuple[list[str], list[str]] = [], []
        self.is_up = self.is_over = False
        # The part of a checksum that is the same for all segments of a direction: pseudo header and ports.
        self.sums = [
            sum(_split_words(a[0] + b[0])) + a[1] + b[1] + (UDP if kind == "udp" else TCP)
            for a, b in (ends, ends[::-1])
        ]


def _split_words(data: bytes) -> tuple[int, ...]:
    return struct.unpack(f">{len(data) // 2}H", data)


class TapPacketMaker:
    """Makes packets from a tap's events, in their order."""

    def __init__(self, first_line: int = 1) -> None:
        self.lines: list[str] = []  # names of serial lines; the first is interface `first_line`
        self._first_line = first_line
        self._talks: dict[int, _TappedConversation] = {}
        self._number = 0  # of IP packets

    def make_packets(self, event: TapEvent) -> Iterator[TapPacket]:
        kind, way, ns = event.kind, event.way, event.ns
        if kind == TapEventKind.OPEN:
            yield from self._handle_open(event)
            return
        if kind == TapEventKind.LOST:
            yield from self._handle_lost(event)
            return
        talk = self._talks.get(event.number)
        if talk is None:
            return
        if kind == TapEventKind.BYTES:
            yield from self._handle_bytes(talk, event)
        elif kind == TapEventKind.INTERVENTION:
            talk.remarks[way].append(f"{pcap.OWN_PREFIX}{event.data.decode(errors='replace')}")
        elif kind == TapEventKind.ANSWERED and talk.kind == "tcp":
            talk.is_up = True
            yield self._make_segment(talk, WAY_BACK, ns, SYN | ACK)
            yield self._make_segment(talk, WAY_TO, ns, ACK)
        elif kind in (TapEventKind.FIN, TapEventKind.RST) and talk.kind == "tcp":
            if talk.is_up:
                talk.next[way] = event.at + 1
            yield self._make_segment(talk, way, ns, ACK | (FIN if kind == TapEventKind.FIN else RST))
            talk.is_over |= kind == TapEventKind.RST
        elif kind == TapEventKind.ENDED:
            yield from self._end_conversation(event.number, ns)

    def _handle_open(self, event: TapEvent) -> Iterator[TapPacket]:
        if event.number in self._talks:
            return
        kind, near, near_port, far, far_port = event.data.decode().split("|")
        if kind == "serial":
            talk = self._talks[event.number] = _TappedConversation(kind, ((b"", 0), (b"", 0)))
            self.lines.append(f"{near} - {far}")
            talk.interface = self._first_line + len(self.lines) - 1
            return
        addresses = [ip_address(near.partition("%")[0]), ip_address(far)]
        if addresses[0].version != addresses[1].version:
            addresses = [each if each.version == 6 else IPv6Address(f"::ffff:{each}") for each in addresses]
        ends = (addresses[0].packed, int(near_port)), (addresses[1].packed, int(far_port))
        talk = self._talks[event.number] = _TappedConversation(kind, ends)
        if kind == "tcp" and not event.at:
            yield self._make_segment(talk, WAY_TO, event.ns, SYN)
        talk.is_up = bool(event.at)

    def _end_conversation(self, number: int, ns: int) -> Iterator[TapPacket]:
        talk = self._talks.pop(number)
        for way in (WAY_TO, WAY_BACK):
            if talk.remarks[way] and talk.kind == "tcp":
                yield self._make_segment(talk, way, ns, ACK)

    def _handle_lost(self, event: TapEvent) -> Iterator[TapPacket]:
        count, size = LOSS.unpack_from(event.data)
        alive = {number for (number,) in struct.iter_unpack("<I", event.data[LOSS.size :])}
        text = f"{size} bytes before this are not in the recording ({count} events)"
        for number, talk in tuple(self._talks.items()):
            if number not in alive:
                yield from self._end_conversation(number, event.ns)
                continue
            for remarks in talk.remarks:
                remarks.append(text)

    def _handle_bytes(self, talk: _TappedConversation, event: TapEvent) -> Iterator[TapPacket]:
        way, data, ns = event.way, event.data, event.ns
        if talk.kind == "serial":
            head = _PACK_SERIAL(ns // 10**9 & 0xFFFFFFFF, ns % 10**9 // 1000, _EVENT_OF[way], 0, 0)
            yield TapPacket(talk.interface, ns, head + data, self._take_remarks(talk, way))
            return
        if talk.kind == "udp":
            yield self._datagram(talk, way, ns, data)
            return
        talk.next[way] = event.at + 1
        for at in range(0, len(data), MOST_SEGMENT_BYTES):
            part = data[at : at + MOST_SEGMENT_BYTES]
            yield self._make_segment(
                talk, way, ns, ACK if at + MOST_SEGMENT_BYTES < len(data) else ACK | PSH, part
            )

    @staticmethod
    def _take_remarks(talk: _TappedConversation, way: int) -> tuple[str, ...]:
        found = tuple(talk.remarks[way])
        talk.remarks[way].clear()
        return found

    def _make_segment(
        self, talk: _TappedConversation, way: int, ns: int, flags: int, data: bytes = b""
    ) -> TapPacket:
        source, target = talk.ends[way], talk.ends[1 - way]
        seq = talk.next[way] & 0xFFFFFFFF
        ack = talk.next[1 - way] & 0xFFFFFFFF if flags & ACK else 0
        talk.next[way] += len(data) + (1 if flags & (SYN | FIN) else 0)
        size = 20 + len(data)
        total = talk.sums[way] + size + seq + ack + 0x5000 + flags + FULL_WINDOW + _sum_words(data)
        sum_of = 0xFFFF - (total % 0xFFFF or 0xFFFF)
        head = _PACK_TCP(source[1], target[1], seq, ack, 5 << 4, flags, FULL_WINDOW, sum_of, 0)
        whole = b"".join((self._make_ip_header(source[0], target[0], TCP, size), head, data))
        return TapPacket(WIRE_ID, ns, whole, self._take_remarks(talk, way))

    def _datagram(self, talk: _TappedConversation, way: int, ns: int, data: bytes) -> TapPacket:
        source, target = talk.ends[way], talk.ends[1 - way]
        size = 8 + len(data)
        total = talk.sums[way] + 2 * size + _sum_words(data)
        head = _PACK_UDP(source[1], target[1], size, 0xFFFF - (total % 0xFFFF or 0xFFFF) or 0xFFFF)
        whole = b"".join((self._make_ip_header(source[0], target[0], UDP, size), head, data))
        return TapPacket(WIRE_ID, ns, whole, self._take_remarks(talk, way))

    def _make_ip_header(self, source: bytes, target: bytes, protocol: int, size: int) -> bytes:
        if len(source) == 16:
            return _PACK_IP_V6(0x6000_0000, size, protocol, 64, source, target)
        self._number = self._number + 1 & 0xFFFF
        total = 0x4500 + 20 + size + self._number + 0x4000 + (64 << 8) + protocol
        total += int.from_bytes(source, "big") + int.from_bytes(target, "big")
        sum_of = 0xFFFF - (total % 0xFFFF or 0xFFFF)
        return _PACK_IP_V4(0x45, 0, 20 + size, self._number, 0x4000, 64, protocol, sum_of, source, target)


_EVENT_OF: Final = (SERIAL_RECEIVED, SERIAL_SENT)  # by way: the end at LISTEN is the one received from


_SUM_FOLDS: Final = tuple([(bits, (1 << bits) - 1) for bits in (5840, 2928, 1472, 736)])


def _sum_words(data: bytes) -> int:
    """Return the sum of the 16-bit words modulo 65535. For a full segment this is twice as fast as `%`."""
    if len(data) != MOST_SEGMENT_BYTES:
        return int.from_bytes(data if not len(data) & 1 else data + b"\0", "big")
    number = int.from_bytes(data, "little")
    for bits, mask in _SUM_FOLDS:
        number = (number >> bits) + (number & mask)
    number %= 0xFFFF
    return (number & 0xFF) << 8 | number >> 8  # the sum of swapped words is the swapped sum


class TapEncoder:
    """Makes the pcapng of a tap in whole blocks. `taps` has its routes and says which end is the PLC.

    Notes on the tap's actions and losses are packets of JSON on a separate interface. If no packet has
    the time, a statistics block has it. Interfaces of serial lines come after `NOTES_ID`.
    """

    def __init__(self, title: str, taps: Mapping[str, object]) -> None:
        self._title, self._taps = title, taps
        self._packets = TapPacketMaker(NOTES_ID + 1)
        # Of each open conversation: its OPEN event, and the newest state of each direction.
        self._open: dict[int, dict[tuple[int, int], TapEvent]] = {}
        self._lost = self._ns = 0  # events that the tap left out; time of the newest head or loss

    def encode_head(self, ns: int) -> bytes:
        self._ns = ns
        made = pcap.section_block(f"trcvtui {__version__}", (self._title,))
        made += pcap.interface_block(pcap.RAW_IP, "tap")
        made += pcap.interface_block(pcap.USER0, pcap.NOTES)
        return made + _encode_note(ns, {"note": "taps", **self._taps, "open": [*self._open]})

    def encode_interfaces(self, since: int) -> list[bytes]:
        return [pcap.interface_block(pcap.RTAC_SERIAL, name) for name in self._packets.lines[since:]]

    def encode_event(self, event: TapEvent) -> bytes:
        if event.kind == TapEventKind.OPEN:
            self._open[event.number] = {(event.kind, event.way): event._replace(at=1)}
        elif event.kind in STATE_KINDS and event.number in self._open:
            self._open[event.number][event.kind, event.way] = event
        elif event.kind == TapEventKind.ENDED:
            self._open.pop(event.number, None)
        blocks = [*self._encode_notes(event)]
        blocks += [pcap.packet_block(*packet) for packet in self._packets.make_packets(event)]
        return b"".join(blocks)

    def encode_loss(self, ns: int, dropped: int, events: int, size: int) -> bytes:
        # This observer's loss counts on the interface of notes; the tap's own, for all, on that of packets.
        self._ns, note = ns, {"note": "lost", "events": events, "bytes": size}
        return pcap.statistics_block(NOTES_ID, ns, dropped) + _encode_note(ns, note)

    def encode_open_talks(self) -> bytes:
        """Return notes of the open conversations and their state."""
        events = [event._replace(ns=self._ns) for each in self._open.values() for event in each.values()]
        return b"".join([block for event in events for block in self._encode_notes(event)])

    def _encode_notes(self, event: TapEvent) -> Iterator[bytes]:
        if event.kind in (TapEventKind.LOST, TapEventKind.NOW):
            self._lost += LOSS.unpack_from(event.data)[0] if event.data else 0
            yield pcap.statistics_block(WIRE_ID, event.ns, self._lost)
        name = NOTE_NAMES.get(event.kind)
        if name is None:
            return
        note: dict[str, object] = {"note": name, "tap": event.route, "conversation": event.number}
        if event.kind == TapEventKind.LOST:
            note |= dict(zip(("events", "bytes"), LOSS.unpack_from(event.data), strict=True))
        elif event.kind == TapEventKind.LACK:
            note |= {"waiting": event.at, "text": event.data.decode()}
        elif event.kind == TapEventKind.HELD:
            holds, first = bool(event.data), event.data[1:].hex()
            note |= {"to_connect": event.way == WAY_TO, "holds": holds, "bytes": event.at, "first": first}
        elif event.kind == TapEventKind.OPEN:
            kind, near, near_port, far, far_port = event.data.decode().split("|")
            ends = (near, int(near_port)), (far, int(far_port))
            note |= {"kind": kind, "ends": ends, "new": not event.at}
        elif event.kind == TapEventKind.FIGURES:
            figures = zip(("round_trip_us", "window", "again"), FIGURES_DATA.unpack(event.data), strict=True)
            note |= {"to_connect": event.way == WAY_TO, **dict(figures)}
        elif event.kind != TapEventKind.ENDED:
            note |= {"to_connect": event.way == WAY_TO, "text": event.data.decode(errors="replace")}
        yield _encode_note(event.ns, note)


def _encode_note(ns: int, note: Mapping[str, object]) -> bytes:
    return pcap.packet_block(NOTES_ID, ns, json.dumps(note).encode())


# -- the recording child process -----------------------------------------------------------------------------


def record_tap(asks: int) -> None:
    """Write the tap's pcapng to stdout until the tap ends. Exit with 2 if the disk is full.

    If the server process was killed, its successor begins a new section. The earlier blocks are whole.
    """
    ignore_signals(GROUP_SIGNALS)  # they end the tap, and this process ends with it
    way = TapChannel(asks)
    try:
        while (data := way.feed(os.read(way.fd, READ_BYTES))) != b"":
            _write_stdout(data or b"")
    except OSError as failed:
        sys.stderr.write(f"--record: the recording has ended ({failed.strerror})\n")
        sys.exit(2)


def _write_stdout(data: bytes) -> None:
    left = memoryview(data)
    while left:
        left = left[os.write(1, left) :]
