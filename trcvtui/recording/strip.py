"""`trcvtui recording`: a copy to hand on, as a capture without what shall not leave; the Lua for Wireshark.

Rule: what is left out is gone from everywhere, so the journal is left out with it: it has the project, the
commands and every byte that blocks and peers got.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from trcvtui.capture import pcap
from trcvtui.capture.packets import TCP, UDP, IpPayload, carried_by
from trcvtui.errors import mistake
from trcvtui.files import replacing
from trcvtui.net.results import is_loopback
from trcvtui.recording.recording import JOURNAL, SERIAL_HEADER, WIRE, Recording
from trcvtui.recording.wire import checksum

DISSECTOR: Final = "journal.lua"  # beside this file
_PACKET_HEAD: Final = 20
LEFT_OUT: Final = "the journal, left out"
PLAIN: Final = "begins in the middle", "repeated: "  # how comments begin that have no names
_IP_HEADER: Final = 20  # ours have no options
_HEADERS: Final = {TCP: 20, UDP: 8}
_SUM_AT: Final = {TCP: 16, UDP: 6}  # byte of the checksum in the header


@dataclass(frozen=True, slots=True)
class LeaveOut:
    """What a copy is to have no more of."""

    payload: bool
    secrets: bool
    names: bool


def dissector() -> str:
    return Path(__file__).with_name(DISSECTOR).read_text(encoding="utf-8")


def strip(source: str, target: str, out: LeaveOut) -> Iterator[str]:
    """Write the copy; yield what is said of it. Raise UserError for a file that is no recording."""
    recording = Recording(source)
    if not (out.payload or out.secrets or out.names):
        raise mistake("recording strip", "nothing to leave out", "--no-payload, --no-secrets or --anonymise")
    keeps_journal = not (
        out.payload or out.names or any(kind == pcap.SECRETS for kind, _ in recording.blocks())
    )
    with replacing(target, target, is_new=True, mode=0o600) as file:
        for block in _Copy(out, keeps_journal).of(recording.blocks()):
            file.write(block)
    if recording.stopped:
        yield recording.stopped
    if not keeps_journal:
        yield f"{target}: a capture for Wireshark and trcvtui watch; it cannot be replayed"
    if out.names and not out.payload:
        yield f"{target}: it has all payload, with names and addresses in it; --no-payload leaves that out"


class _Copy:
    def __init__(self, out: LeaveOut, keeps_journal: bool) -> None:
        self._out, self._keeps_journal = out, keeps_journal
        self._interfaces = 0
        self._addresses: dict[bytes, bytes] = {}
        self._names: dict[str, str] = {}

    def of(self, blocks: Iterator[tuple[int, bytes]]) -> Iterator[bytes]:
        for kind, body in blocks:
            if kind == pcap.INTERFACE:
                yield self._interface(body)
                self._interfaces += 1
            elif kind == pcap.ENHANCED_PACKET:
                yield from self._packet(body)
            elif kind == pcap.SECTION and self._out.names:
                yield pcap.section_block("trcvtui")
            elif kind == pcap.SECTION or not (self._out.secrets or self._out.payload or self._out.names):
                yield pcap.block(kind, body)

    def _interface(self, body: bytes) -> bytes:
        if self._interfaces == JOURNAL and not self._keeps_journal:
            return pcap.interface_block(pcap.USER0, LEFT_OUT)
        if self._interfaces > JOURNAL and self._out.names:
            return pcap.interface_block(pcap.RTAC_SERIAL, f"line {self._interfaces - JOURNAL}")
        return pcap.block(pcap.INTERFACE, body)

    def _packet(self, body: bytes) -> Iterator[bytes]:
        if (
            len(body) < _PACKET_HEAD
            or (size := int.from_bytes(body[12:16], "little")) > len(body) - _PACKET_HEAD
        ):
            return  # unknown what is in it
        interface, high, low = struct.unpack_from("<III", body)
        if interface == JOURNAL and not self._keeps_journal:
            return
        if interface == JOURNAL or not (self._out.payload or self._out.names):
            yield pcap.block(pcap.ENHANCED_PACKET, body)
            return
        data = bytearray(body[_PACKET_HEAD : _PACKET_HEAD + size])
        if interface == WIRE:
            self._clear_ip(data)
        elif self._out.payload:
            data[SERIAL_HEADER:] = bytes(max(0, len(data) - SERIAL_HEADER))
        options = [*pcap.options_of(body, _PACKET_HEAD + size + (-size & 3), len(body), "<")]
        comments = [value.decode("utf-8", "replace") for code, value in options if code == pcap.COMMENT]
        sent = pcap.is_sent(dict(options).get(pcap.FLAGS), "<")
        said = tuple(filter(None, map(self._nameless, comments)) if self._out.names else comments)
        yield pcap.packet_block(interface, high << 32 | low, bytes(data), said, sent=sent)

    def _clear_ip(self, data: bytearray) -> None:
        found = carried_by(pcap.RAW_IP, bytes(data), len(data))
        if not isinstance(found, IpPayload) or not _is_ours(found, data):
            data[:] = bytes(len(data))  # unknown what is in it
            return
        if self._out.payload:
            head = (data[_IP_HEADER + 12] >> 4) * 4 if found.protocol == TCP else _HEADERS[UDP]
            start = min(_IP_HEADER + max(head, _HEADERS[found.protocol]), len(data))
            data[start:] = bytes(len(data) - start)
        if self._out.names:
            for at in (12, 16):
                data[at : at + 4] = self._address(bytes(data[at : at + 4]))
        data[10:12] = bytes(2)
        data[10:12] = checksum(bytes(data[:_IP_HEADER])).to_bytes(2, "big")
        at = _IP_HEADER + _SUM_AT[found.protocol]
        data[at : at + 2] = bytes(2)
        inner = bytes(data[_IP_HEADER:])
        pseudo = bytes(data[12:20]) + bytes((0, found.protocol)) + len(inner).to_bytes(2, "big")
        total = checksum(pseudo + inner)
        data[at : at + 2] = (total or (0xFFFF if found.protocol == UDP else 0)).to_bytes(2, "big")

    def _address(self, address: bytes) -> bytes:
        if is_loopback(".".join(map(str, address))):
            return address
        number = len(self._addresses) + 1
        return self._addresses.setdefault(address, bytes((10, 0, number >> 8 & 255, number & 255)))

    def _nameless(self, comment: str) -> str:
        name, colon, rest = comment.partition(": 16#")
        if not colon:  # one of a file that begins in the middle; else it is unknown what is in it
            return comment if comment.startswith(PLAIN) else ""
        return self._names.setdefault(name, f"instance {len(self._names) + 1}") + colon + rest


def _is_ours(found: IpPayload, data: bytearray) -> bool:
    return data[0] == 0x45 and len(data) >= _IP_HEADER + _HEADERS[found.protocol]
