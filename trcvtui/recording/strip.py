"""`trcvtui recording`: a copy to pass on, without payload, secrets or names, and the Lua for Wireshark.

Rule: a part that is left out is nowhere in the copy. So the copy has no journal: a journal has the project,
the commands and every byte that blocks and peers received.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from trcvtui.capture import pcap
from trcvtui.capture.packets import TCP, UDP, IpPayload, parse_packet
from trcvtui.errors import mistake
from trcvtui.files import replace_file
from trcvtui.net.results import is_loopback
from trcvtui.recording.recording import JOURNAL, SERIAL_HEADER_BYTES, WIRE_ID, Recording
from trcvtui.recording.wire import checksum

DISSECTOR_FILE: Final = "journal.lua"  # beside this file
_PACKET_HEAD_BYTES: Final = 20
REMOVED_JOURNAL_NAME: Final = "the journal, left out"
NAMELESS_COMMENTS: Final = "begins in the middle", "repeated: "  # how comments begin that have no names
_IP_HEADER_BYTES: Final = 20  # ours have no options
_HEADER_BYTES: Final = {TCP: 20, UDP: 8}
_CHECKSUM_OFFSETS: Final = {TCP: 16, UDP: 6}  # byte of the checksum in the header


@dataclass(frozen=True, slots=True)
class StripOptions:
    """What to leave out of a copy."""

    payload: bool
    secrets: bool
    names: bool


def read_dissector() -> str:
    return Path(__file__).with_name(DISSECTOR_FILE).read_text(encoding="utf-8")


def strip_recording(source: str, target: str, omit: StripOptions) -> Iterator[str]:
    """Write the copy; yield remarks on it. Raise UserError for a file that is no recording."""
    recording = Recording(source)
    if not (omit.payload or omit.secrets or omit.names):
        raise mistake("recording strip", "nothing to leave out", "--no-payload, --no-secrets or --anonymise")
    keeps_journal = not (  # Rule; without secrets in the file, --no-secrets leaves nothing out
        omit.payload or omit.names or any(kind == pcap.SECRETS_BLOCK for kind, _ in recording.read_blocks())
    )
    with replace_file(target, target, is_new=True, mode=0o600) as file:
        for block in _StrippedCopy(omit, keeps_journal).strip_blocks(recording.read_blocks()):
            file.write(block)
    if recording.stopped:
        yield recording.stopped
    if not keeps_journal:
        yield f"{target}: a capture for Wireshark and trcvtui watch; it cannot be replayed"
    if omit.names and not omit.payload:
        yield f"{target}: the payload is kept, with names and addresses in it; --no-payload removes it"


class _StrippedCopy:
    def __init__(self, out: StripOptions, keeps_journal: bool) -> None:
        self._out, self._keeps_journal = out, keeps_journal
        self._interfaces = 0
        self._addresses: dict[bytes, bytes] = {}
        self._names: dict[str, str] = {}

    def strip_blocks(self, blocks: Iterator[tuple[int, bytes]]) -> Iterator[bytes]:
        for kind, body in blocks:
            if kind == pcap.INTERFACE_BLOCK:
                yield self._strip_interface(body)
                self._interfaces += 1
            elif kind == pcap.ENHANCED_PACKET:
                yield from self._strip_packet(body)
            elif kind == pcap.SECTION and self._out.names:
                yield pcap.section_block("trcvtui")
            elif kind == pcap.SECTION or not (self._out.secrets or self._out.payload or self._out.names):
                yield pcap.make_block(kind, body)

    def _strip_interface(self, body: bytes) -> bytes:
        if self._interfaces == JOURNAL and not self._keeps_journal:
            return pcap.interface_block(pcap.USER0, REMOVED_JOURNAL_NAME)
        if self._interfaces > JOURNAL and self._out.names:
            return pcap.interface_block(pcap.RTAC_SERIAL, f"line {self._interfaces - JOURNAL}")
        return pcap.make_block(pcap.INTERFACE_BLOCK, body)

    def _strip_packet(self, body: bytes) -> Iterator[bytes]:
        if (
            len(body) < _PACKET_HEAD_BYTES
            or (size := int.from_bytes(body[12:16], "little")) > len(body) - _PACKET_HEAD_BYTES
        ):
            return  # a broken one: its content is unknown
        interface, high, low = struct.unpack_from("<III", body)
        if interface == JOURNAL and not self._keeps_journal:
            return
        if interface == JOURNAL or not (self._out.payload or self._out.names):
            yield pcap.make_block(pcap.ENHANCED_PACKET, body)
            return
        data = bytearray(body[_PACKET_HEAD_BYTES : _PACKET_HEAD_BYTES + size])
        if interface == WIRE_ID:
            self._strip_ip_packet(data)
        elif self._out.payload:
            data[SERIAL_HEADER_BYTES:] = bytes(max(0, len(data) - SERIAL_HEADER_BYTES))
        options = [*pcap.parse_options(body, _PACKET_HEAD_BYTES + size + (-size & 3), len(body), "<")]
        comments = [value.decode("utf-8", "replace") for code, value in options if code == pcap.COMMENT]
        sent = pcap.parse_sent_flag(dict(options).get(pcap.FLAGS_OPTION), "<")
        texts = tuple(filter(None, map(self._anonymise_comment, comments)) if self._out.names else comments)
        yield pcap.packet_block(interface, high << 32 | low, bytes(data), texts, sent=sent)

    def _strip_ip_packet(self, data: bytearray) -> None:
        found = parse_packet(pcap.RAW_IP, bytes(data), len(data))
        if not isinstance(found, IpPayload) or not _has_plain_header(found, data):
            data[:] = bytes(len(data))  # its content is unknown
            return
        if self._out.payload:
            head = (data[_IP_HEADER_BYTES + 12] >> 4) * 4 if found.protocol == TCP else _HEADER_BYTES[UDP]
            start = min(_IP_HEADER_BYTES + max(head, _HEADER_BYTES[found.protocol]), len(data))
            data[start:] = bytes(len(data) - start)
        if self._out.names:
            for at in (12, 16):
                data[at : at + 4] = self._anonymise_address(bytes(data[at : at + 4]))
        data[10:12] = bytes(2)
        data[10:12] = checksum(bytes(data[:_IP_HEADER_BYTES])).to_bytes(2, "big")
        at = _IP_HEADER_BYTES + _CHECKSUM_OFFSETS[found.protocol]
        data[at : at + 2] = bytes(2)
        inner = bytes(data[_IP_HEADER_BYTES:])
        pseudo = bytes(data[12:20]) + bytes((0, found.protocol)) + len(inner).to_bytes(2, "big")
        total = checksum(pseudo + inner)
        data[at : at + 2] = (total or (0xFFFF if found.protocol == UDP else 0)).to_bytes(2, "big")  # RFC 768

    def _anonymise_address(self, address: bytes) -> bytes:
        if is_loopback(".".join(map(str, address))):  # it says nothing of a network
            return address
        number = len(self._addresses) + 1
        return self._addresses.setdefault(address, bytes((10, 0, number >> 8 & 255, number & 255)))

    def _anonymise_comment(self, comment: str) -> str:
        name, colon, rest = comment.partition(": 16#")
        if not colon:  # one without names, of a file that begins in the middle; else its names are unknown
            return comment if comment.startswith(NAMELESS_COMMENTS) else ""
        return self._names.setdefault(name, f"instance {len(self._names) + 1}") + colon + rest


def _has_plain_header(found: IpPayload, data: bytearray) -> bool:
    return data[0] == 0x45 and len(data) >= _IP_HEADER_BYTES + _HEADER_BYTES[found.protocol]  # no options
