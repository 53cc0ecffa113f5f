"""Finds the TCP segment or UDP datagram in a captured packet: link layers, IPv4, IPv6."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from enum import Enum
from typing import Final, NamedTuple

from trcvtui.capture import pcap

TCP: Final = 6
UDP: Final = 17
_IP_TYPES: Final = (b"\x08\x00", b"\x86\xdd")
_VLAN_TYPES: Final = (b"\x81\x00", b"\x88\xa8", b"\x91\x00")
_IP_ALONE: Final = (pcap.RAW_IP, pcap.IPV4, pcap.IPV6, 12, 14)  # 12, 14: raw IP as the BSDs number it
# Offsets of the EtherType and of its content.
_ETHERTYPE_PLACES: Final = {pcap.ETHERNET: (12, 14), pcap.LINUX_SLL: (14, 16), pcap.LINUX_SLL2: (0, 20)}
_EXTENSION_HEADERS: Final = (0, 43, 60, 135)  # IPv6: hop by hop, routing, destination, mobility
_FRAGMENT_HEADER: Final = 44
MOST_FRAGMENTED: Final = 64  # packets that wait for fragments
MOST_FRAGMENTS: Final = 1024  # of one packet
FRAGMENTS_WAIT_NS: Final = 30_000_000_000
_AUTHENTICATION_HEADER: Final = 51
_IP_V4: Final = struct.Struct(">BBHHHBBH4s4s").unpack_from
_IP_V6: Final = struct.Struct(">IHBB16s16s").unpack_from
_PORTS: Final = struct.Struct(">HH").unpack_from
_SACK_BLOCK: Final = struct.Struct(">II").unpack_from
_SCALE_OPTION: Final = 3  # options of TCP
SACK_OPTION: Final = 5


class SkipReason(Enum):
    """Why a packet is not read."""

    JOURNAL = "packets of USER0: in a recording of trcvtui its journal"
    FRAGMENT = "IP fragments of incomplete packets"
    CUT = "packets cut off before their ports"


class OtherPacket(NamedTuple):
    """A packet without TCP and UDP: its name and number, such as `EtherCAT frame` and ` (16#88A4)`."""

    name: str
    number: str = ""


class IpPayload(NamedTuple):
    """The content of an IP packet, from `at` to `end`. The addresses have 4 or 16 bytes."""

    protocol: int
    source: bytes
    target: bytes
    ports: bytes  # source and target, as in the packet
    at: int
    end: int  # as the wire had it: the packet may be cut before


class Fragment(NamedTuple):
    """A piece of an IP packet, from offset `at` of the content on. `head` has the bytes before the content.

    `of` is the key that all pieces of a packet share. `length_at` is the offset of the length in the head.
    The length includes `counted` bytes of the head.
    """

    of: tuple[bytes, ...]
    at: int
    is_last: bool
    head: bytes
    length_at: int
    counted: int
    content: bytes


class _Pieces:
    """The first copy of each piece of a packet, by offset. `size` is None while the size is unknown."""

    def __init__(self, ns: int) -> None:
        self.first_ns = ns
        self.content: dict[int, bytes] = {}
        self.size: int | None = None
        self.first: Fragment | None = None

    def assemble(self) -> bytes | None:
        """Return the packet, or None if a piece is missing or the packet would be too large."""
        first, size = self.first, self.size
        if first is None or size is None or sum(map(len, self.content.values())) < size:
            return None
        content = bytearray()
        for at, piece in sorted(self.content.items()):
            if at > len(content):
                return None
            content += piece[len(content) - at :]
        if len(content) != size or size + first.counted > 0xFFFF:
            return None
        head = bytearray(first.head)
        head[first.length_at : first.length_at + 2] = (size + first.counted).to_bytes(2, "big")
        return bytes(head + content)


class Fragments:
    """Puts IP packets together; the numbers of waiting packets and of their pieces are bounded."""

    def __init__(self) -> None:
        self._packets: dict[tuple[bytes, ...], _Pieces] = {}
        self._done: dict[tuple[bytes, ...], int] = {}  # the newest complete ones: a mirror port shows copies
        self._whole = Counter[tuple[bytes, ...]]()  # by sender and receiver
        self._lost = Counter[tuple[bytes, ...]]()

    def add(self, piece: Fragment, ns: int) -> tuple[bytes, int] | None:
        """If this piece completes a packet, return the packet and the number of its pieces, else None."""
        pieces = self._packets.get(piece.of)
        if pieces is None or not 0 <= ns - pieces.first_ns <= FRAGMENTS_WAIT_NS:
            self._drop_packet(piece.of)
            if len(self._packets) == MOST_FRAGMENTED:
                self._drop_packet(next(iter(self._packets)))
            pieces = self._packets[piece.of] = _Pieces(ns)
        if len(pieces.content) < MOST_FRAGMENTS:
            pieces.content.setdefault(piece.at, piece.content)
        if piece.is_last:
            pieces.size = piece.at + len(piece.content)
        if not piece.at:
            pieces.first = piece
        whole = pieces.assemble()
        if whole is None:
            return None
        del self._packets[piece.of]
        if len(self._done) == MOST_FRAGMENTED:
            del self._done[next(iter(self._done))]
        self._done[piece.of] = ns
        _count_bounded(self._whole, piece.of[:2])
        return whole, len(pieces.content)

    def _drop_packet(self, of: tuple[bytes, ...]) -> None:
        if of in self._packets and self._is_lost(of):
            _count_bounded(self._lost, of[:2])
        self._packets.pop(of, None)

    def _is_lost(self, of: tuple[bytes, ...]) -> bool:
        """Return whether a datagram lacks pieces; a first piece alone does not count (capture filter)."""
        pieces = self._packets[of]
        is_datagram = of not in self._done and of[3:] in ((), (bytes((UDP,)),))
        return is_datagram and (len(pieces.content) > 1 or pieces.first is None)

    def count_lost(self) -> dict[tuple[bytes, ...], int]:
        """Count incomplete datagrams by ends; only counts >= 2, and >= half the number of whole ones."""
        lost = self._lost + Counter(of[:2] for of in self._packets if self._is_lost(of))
        return {ends: n for ends, n in lost.items() if n >= 2 and n * 2 >= self._whole[ends]}


def _count_bounded(known: Counter[tuple[bytes, ...]], ends: tuple[bytes, ...]) -> None:
    if ends in known or len(known) < MOST_FRAGMENTS:
        known[ends] += 1


def find_ip_header(link_type: int, data: bytes, types: tuple[bytes, ...] = _IP_TYPES) -> int:
    """Return where the IP header begins, or the content of another EtherType in `types`. -1: neither."""
    if link_type in _ETHERTYPE_PLACES:
        kind, at = _parse_ethertype(link_type, data)
        return at if kind in types else -1
    return 0 if link_type in _IP_ALONE else 4 if link_type in (pcap.NULL, pcap.LOOP) else -1


def _parse_ethertype(link_type: int, data: bytes) -> tuple[bytes, int]:
    """Return the EtherType behind all VLAN tags, and the offset of its content."""
    kind_at, at = _ETHERTYPE_PLACES[link_type]
    kind = data[kind_at : kind_at + 2]
    while kind in _VLAN_TYPES:
        kind, at = data[at + 2 : at + 4], at + 4
    return kind, at


# Names of EtherTypes, IP protocols and link types.
_ETHERTYPE_NAMES: Final = {
    0x0004: "802.2 LLC", 0x000C: "CAN", 0x000D: "CAN FD",  # as Linux numbers them
    0x0800: "IPv4", 0x0806: "ARP", 0x86DD: "IPv6", 0x8809: "LACP", 0x8847: "MPLS", 0x8863: "PPPoE",
    0x8864: "PPPoE", 0x888E: "802.1X", 0x8892: "PROFINET", 0x88A4: "EtherCAT", 0x88AB: "POWERLINK",
    0x88B8: "GOOSE", 0x88BA: "Sampled Values", 0x88CC: "LLDP", 0x88CD: "SERCOS III", 0x88E1: "HomePlug",
    0x88E3: "MRP", 0x88F7: "PTP", 0x88FB: "PRP", 0x890F: "CC-Link IE", 0x892F: "HSR", 0x9000: "loopback",
}  # fmt: skip
_PROTOCOLS: Final = {1: "ICMP", 2: "IGMP", 47: "GRE", 50: "ESP", 58: "ICMPv6", 89: "OSPF", 112: "VRRP"}
_LINKS: Final = {
    9: "PPP", 105: "802.11", 127: "802.11", 189: "USB", 195: "802.15.4", 220: "USB", 227: "CAN", 249: "USB",
}  # fmt: skip


def other_frame(link_type: int, data: bytes) -> OtherPacket:
    if link_type not in _ETHERTYPE_PLACES:
        return OtherPacket(f"{_LINKS.get(link_type, '')} packet".lstrip(), f" (link type {link_type})")
    kind, _ = _parse_ethertype(link_type, data)
    if len(kind) < 2:
        return OtherPacket("packet", " cut off before its EtherType")
    number = int.from_bytes(kind, "big")
    if number < 0x600 and link_type == pcap.ETHERNET:  # a length
        return OtherPacket("802.3 LLC frame")
    return OtherPacket(f"{_ETHERTYPE_NAMES.get(number, '')} frame".lstrip(), f" (16#{number:04X})")


def _other_ip(protocol: int) -> OtherPacket:
    return OtherPacket(f"{_PROTOCOLS.get(protocol, 'IP')} packet", f" (IP protocol {protocol})")


def ip_identification(link_type: int, data: bytes) -> int:
    """Return the Identification of IPv4, which most hosts increase with each packet, or 0 without IPv4."""
    at = find_ip_header(link_type, data)
    return int.from_bytes(data[at + 4 : at + 6], "big") if at >= 0 and data[at] >> 4 == 4 else 0


_CarriedContent = IpPayload | Fragment | SkipReason | OtherPacket


def parse_packet(link_type: int, data: bytes, length: int) -> _CarriedContent:
    """Return the TCP, UDP or fragment in a packet. `length` is the packet's number of bytes on the wire."""
    at = find_ip_header(link_type, data)
    try:
        read = None if at < 0 else _IP_PARSERS.get(data[at] >> 4)
        return read(data, at, length) if read else other_frame(link_type, data)
    except (IndexError, struct.error):
        return SkipReason.CUT


def _parse_ip_v4(data: bytes, at: int, length: int) -> _CarriedContent:
    first, _, total, number, fragment, _, protocol, _, source, target = _IP_V4(data, at)
    if protocol not in (TCP, UDP):
        return _other_ip(protocol)
    start = at + (first & 15) * 4
    if first & 15 < 5:  # shorter than the fixed header
        return OtherPacket("packet", " with a wrong IP header")
    # A total of 0: captured before the network card cut it into packets (segmentation offload).
    end = at + total if total else length
    if fragment & 0x3FFF:
        if end > len(data):
            return SkipReason.CUT
        of = source, target, number.to_bytes(2, "big"), bytes((protocol,))
        head = data[: at + 6] + b"\0\0" + data[at + 8 : start]
        place, is_last = (fragment & 0x1FFF) * 8, not fragment & 0x2000
        return Fragment(of, place, is_last, head, at + 2, start - at, data[start:end])
    _PORTS(data, start)
    return IpPayload(protocol, source, target, data[start : start + 4], start, end)


def _parse_ip_v6(data: bytes, at: int, length: int) -> _CarriedContent:
    _, size, protocol, _, source, target = _IP_V6(data, at)
    start = at + 40
    end = start + size if size else length
    type_at = at + 6  # offset of the "next header" byte
    while protocol not in (TCP, UDP):
        if protocol == _FRAGMENT_HEADER:
            fragment = struct.unpack_from(">H", data, start + 2)[0]
            if fragment & 0xFFF9:  # not the only fragment (RFC 6946)
                if end > len(data):
                    return SkipReason.CUT
                of = source, target, data[start + 4 : start + 8]
                head = data[:type_at] + data[start : start + 1] + data[type_at + 1 : start]
                content = data[start + 8 : end]
                return Fragment(
                    of, fragment & 0xFFF8, not fragment & 1, head, at + 4, start - at - 40, content
                )
            protocol, type_at, start = data[start], start, start + 8
        elif protocol in _EXTENSION_HEADERS:
            protocol, type_at, start = data[start], start, start + 8 + data[start + 1] * 8
        elif protocol == _AUTHENTICATION_HEADER:
            protocol, type_at, start = data[start], start, start + 8 + data[start + 1] * 4
        else:
            return _other_ip(protocol)
    _PORTS(data, start)
    return IpPayload(protocol, source, target, data[start : start + 4], start, end)


_IP_PARSERS: Final = {4: _parse_ip_v4, 6: _parse_ip_v6}


def read_macs(link_type: int, data: bytes) -> tuple[bytes, bytes]:
    """Return the MACs of sender and receiver; b"" where the packet has none."""
    if link_type == pcap.ETHERNET:
        return data[6:12], data[:6]
    if link_type == pcap.LINUX_SLL:
        return (data[6:12], b"") if data[4:6] == b"\0\x06" else (b"", b"")
    return (data[12:18], b"") if link_type == pcap.LINUX_SLL2 and data[11:12] == b"\x06" else (b"", b"")


def _tcp_options(options: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 2 < len(options) and options[at]:
        size = 1 if options[at] == 1 else max(options[at + 1], 2)
        yield options[at], options[at + 2 : at + size]
        at += size


def read_window_scale(options: bytes) -> int:
    """Return the window scale of a SYN in bits (RFC 7323), or 0 if the SYN has none."""
    return next((body[0] & 15 for kind, body in _tcp_options(options) if kind == _SCALE_OPTION and body), 0)


def sack_blocks(options: bytes) -> list[tuple[int, int]]:
    """Return the begin and end sequence numbers of bytes that were received behind a hole (RFC 2018)."""
    blocks = [body for kind, body in _tcp_options(options) if kind == SACK_OPTION]
    return [_SACK_BLOCK(body, at) for body in blocks for at in range(0, len(body) - 7, 8)]
