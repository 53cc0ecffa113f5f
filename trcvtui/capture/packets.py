"""A captured packet to the TCP segment or UDP datagram in it: link layers, IPv4, IPv6."""

from __future__ import annotations

import struct
from enum import Enum
from typing import Final

from trcvtui.capture import pcap
from trcvtui.records import NamedTuple

TCP: Final = 6
UDP: Final = 17
_IP_TYPES: Final = (b"\x08\x00", b"\x86\xdd")
_VLAN_TYPES: Final = (b"\x81\x00", b"\x88\xa8", b"\x91\x00")
_IP_ALONE: Final = (pcap.RAW_IP, pcap.IPV4, pcap.IPV6, 12, 14)  # 12, 14: raw IP as the BSDs number it
_MOVED_BY_8: Final = (0, 43, 60, 135)  # IPv6: hop by hop, routing, destination, mobility
_FRAGMENT: Final = 44
_AUTHENTICATION: Final = 51
_IP_V4: Final = struct.Struct(">BBHHHBBH4s4s").unpack_from
_IP_V6: Final = struct.Struct(">IHBB16s16s").unpack_from
_PORTS: Final = struct.Struct(">HH").unpack_from


class Unread(Enum):
    """Why a packet is none of TCP and UDP."""

    OTHER = "others"
    FRAGMENT = "IP fragments, which are not put together"
    CUT = "packets cut off before their ports"


class Carried(NamedTuple):
    """What an IP packet carries: addresses of 4 or 16 bytes; where its header begins and its data ends."""

    protocol: int
    source: bytes
    target: bytes
    ports: bytes  # source and target, as in the packet
    at: int
    end: int  # as the wire had it: the packet may be cut before


def ip_start(link_type: int, data: bytes) -> int:
    """Return where the IP header begins; -1 for a packet without one."""
    if link_type == pcap.ETHERNET:
        kind_at = 12
    elif link_type == pcap.LINUX_SLL:
        kind_at = 14
    elif link_type == pcap.LINUX_SLL2:
        return _past_vlans(data, 20) if data[:2] in _VLAN_TYPES else 20 if data[:2] in _IP_TYPES else -1
    elif link_type in _IP_ALONE:
        return 0
    else:
        return 4 if link_type in (pcap.NULL, pcap.LOOP) else -1
    kind = data[kind_at : kind_at + 2]
    return kind_at + 2 if kind in _IP_TYPES else _past_vlans(data, kind_at + 2) if kind in _VLAN_TYPES else -1


def _past_vlans(data: bytes, at: int) -> int:
    while True:
        kind = data[at + 2 : at + 4]
        at += 4
        if kind not in _VLAN_TYPES:
            return at if kind in _IP_TYPES else -1


def carried_by(link_type: int, data: bytes, length: int) -> Carried | Unread:
    """Return the TCP or UDP of a packet of which the wire had `length` bytes."""
    at = ip_start(link_type, data)
    if at < 0:
        return Unread.OTHER
    try:
        if data[at] >> 4 == 4:
            return _in_version_4(data, at, length)
        return _in_version_6(data, at, length) if data[at] >> 4 == 6 else Unread.OTHER
    except (IndexError, struct.error):
        return Unread.CUT


def _in_version_4(data: bytes, at: int, length: int) -> Carried | Unread:
    first, _, total, _, fragment, _, protocol, _, source, target = _IP_V4(data, at)
    if protocol not in (TCP, UDP):
        return Unread.OTHER
    if fragment & 0x3FFF:
        return Unread.FRAGMENT
    start = at + (first & 15) * 4
    if first & 15 < 5:
        return Unread.OTHER
    _PORTS(data, start)
    # A total of 0: the sender's network card had yet to cut it into packets.
    return Carried(protocol, source, target, data[start : start + 4], start, at + total if total else length)


def _in_version_6(data: bytes, at: int, length: int) -> Carried | Unread:
    _, size, protocol, _, source, target = _IP_V6(data, at)
    start = at + 40
    end = start + size if size else length
    while protocol not in (TCP, UDP):
        if protocol == _FRAGMENT:
            if struct.unpack_from(">H", data, start + 2)[0] & 0xFFF9:
                return Unread.FRAGMENT
            protocol, start = data[start], start + 8
        elif protocol in _MOVED_BY_8:
            protocol, start = data[start], start + 8 + data[start + 1] * 8
        elif protocol == _AUTHENTICATION:
            protocol, start = data[start], start + 8 + data[start + 1] * 4
        else:
            return Unread.OTHER
    _PORTS(data, start)
    return Carried(protocol, source, target, data[start : start + 4], start, end)


def macs_of(link_type: int, data: bytes) -> tuple[bytes, bytes]:
    """Return the MACs of sender and receiver; b"" where the packet has none."""
    if link_type == pcap.ETHERNET:
        return data[6:12], data[:6]
    if link_type == pcap.LINUX_SLL:
        return (data[6:12], b"") if data[4:6] == b"\0\x06" else (b"", b"")
    return (data[12:18], b"") if link_type == pcap.LINUX_SLL2 and data[11:12] == b"\x06" else (b"", b"")
