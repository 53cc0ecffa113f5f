"""A capture file made by hand: Ethernet, IPv4 and TCP around given segments of one connection."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

CLIENT_PORT = 40_000


def write_capture(path: Path, segments: Iterable[bytes], port: int) -> None:
    """Write a pcap file in which 127.0.0.1 sends the segments to a port of 127.0.0.1, one packet each."""
    records = [struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)]
    number = 1
    for second, segment in enumerate(segments):
        packet = _packet(segment, number, port)
        records.append(struct.pack("<IIII", second, 0, len(packet), len(packet)) + packet)
        number += len(segment)
    path.write_bytes(b"".join(records))


def _packet(segment: bytes, number: int, port: int) -> bytes:
    tcp = struct.pack(">HHIIBBHHH", CLIENT_PORT, port, number, 1, 5 << 4, 0x18, 65535, 0, 0)
    here = bytes([127, 0, 0, 1])
    ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 40 + len(segment), number & 0xFFFF, 0, 64, 6, 0, here, here)
    return bytes(12) + b"\x08\x00" + ip + tcp + segment
