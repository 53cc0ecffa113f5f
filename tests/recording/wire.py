"""Packets for the tests, built byte by byte: TCP in IPv4 or IPv6, below Ethernet and other links."""

from __future__ import annotations

import struct
from ipaddress import ip_address

from trcvtui.capture.pcap import RAW_IP, RTAC_SERIAL, interface_block, packet_block, section_block

PLC = ("10.0.0.5", 2000)
PARTNER = ("10.0.0.9", 51000)
FIN, SYN, RST, PSH, ACK = 1, 2, 4, 8, 16
NS = 1_700_000_000_000_000_000


def ip(source: str, target: str, protocol: int, content: bytes, extra: bytes = b"") -> bytes:
    """Return an IP packet; `extra` stands between header and content (options, extension headers)."""
    one, other = ip_address(source), ip_address(target)
    if one.version == 6:
        first = 0 if extra else protocol
        return (
            struct.pack(">IHBB", 6 << 28, len(extra + content), first, 64)
            + one.packed
            + other.packed
            + (extra + content)
        )
    total = 20 + len(extra + content)
    head = struct.pack(">BBHHHBBH", 0x45 + len(extra) // 4, 0, total, 0, 0, 64, protocol, 0)
    return head + one.packed + other.packed + extra + content


def tcp(
    data: bytes = b"", seq: int = 0, ack: int = 0, flags: int = ACK, window: int = 8192,
    source: tuple[str, int] = PARTNER, target: tuple[str, int] = PLC, extra: bytes = b"",
) -> bytes:  # fmt: skip
    """Return one TCP segment in its IP packet, from the partner to the PLC unless said."""
    head = struct.pack(
        ">HHIIBBHHH", source[1], target[1], seq % 2**32, ack % 2**32, 0x50, flags, window, 0, 0
    )
    return ip(source[0], target[0], 6, head + data, extra)


def answer(data: bytes = b"", seq: int = 0, ack: int = 0, flags: int = ACK, window: int = 8192) -> bytes:
    return tcp(data, seq, ack, flags, window, PLC, PARTNER)


def udp(data: bytes, source: tuple[str, int] = PARTNER, target: tuple[str, int] = PLC) -> bytes:
    return ip(source[0], target[0], 17, struct.pack(">HHHH", source[1], target[1], 8 + len(data), 0) + data)


def handshake(
    there: int = 100, back: int = 500, source: tuple[str, int] = PARTNER, target: tuple[str, int] = PLC
) -> list[bytes]:
    """Return SYN, answer and ACK; the next bytes are `there` + 1 and `back` + 1."""
    return [
        tcp(seq=there, flags=SYN, source=source, target=target),
        tcp(seq=back, ack=there + 1, flags=SYN | ACK, source=target, target=source),
        tcp(seq=there + 1, ack=back + 1, source=source, target=target),
    ]


def serial_line(*events: tuple[int, bytes], name: str = "RX", step_ms: int = 50) -> bytes:
    """Return a capture of a serial line, as an RTAC writes it: the number of each event, its bytes."""
    blocks = [section_block("tests"), interface_block(RTAC_SERIAL, name)]
    for n, (event, data) in enumerate(events):
        head = struct.pack(">IIBBH", NS // 10**9, 0, event, 0, 0)
        blocks.append(packet_block(0, NS + n * step_ms * 1_000_000, head + data))
    return b"".join(blocks)


def capture(packets: list[bytes], link_type: int = RAW_IP, step_ns: int = 1_000_000) -> bytes:
    blocks = [packet_block(0, NS + n * step_ns, data) for n, data in enumerate(packets)]
    return b"".join((section_block("tests"), interface_block(link_type, "t"), *blocks))
