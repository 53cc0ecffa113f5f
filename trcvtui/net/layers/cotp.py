"""TPDUs of ISO-on-TCP (RFC 1006 over ISO 8073 class 0): bytes to values and back, no sockets, no state.

Rule 1: what the partner sends is judged, never trusted: a TPDU that cannot be read is `Malformed`.
Rule 2: a reader holds one TPKT at most (65535 bytes), however the bytes are cut.
Layout and vectors: siemens.md 5.1 and 5.3. All numbers are big-endian.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final, NamedTuple

TPKT_VERSION: Final = 3
TPKT_HEADER: Final = 4  # bytes: version, reserved, length of the whole
CODE_AT: Final = 5  # where the code of the TPDU stands in a TPKT
LONGEST_HEADER: Final = 255  # bytes of a TPDU without data: its length indicator has one byte
NO_LIMIT: Final = 1 << 62
LEAST_TPKT: Final = 7
DATA_HEADER: Final = 3  # bytes of a DT that count against the negotiated size
TAKEN_AS_0: Final = (0, 4)  # some texts of RFC 1006 show class 4
LEAST_SIZE_CODE: Final = 2  # 4 bytes, of which 1 is data
LAST: Final = 0x80  # of the message: the EOT mark of a DT
LONGEST_TSAP: Final = 32


class Code(IntEnum):
    """The TPDU codes that class 0 knows."""

    CR = 0xE0
    CC = 0xD0
    DR = 0x80
    DT = 0xF0
    ER = 0x70


class Refusal(IntEnum):
    """Reasons of a DR (siemens.md 5.1)."""

    UNSPECIFIED = 0x00
    NOBODY_WAITS = 0x02
    UNKNOWN_TSAP = 0x03
    NORMAL = 0x80
    PROTOCOL_ERROR = 0x85
    NEGOTIATION_FAILED = 0x82
    REFUSED = 0x88


class _Parameter(IntEnum):
    SIZE = 0xC0
    CALLING = 0xC1
    CALLED = 0xC2


class Connect(NamedTuple):
    """A CR or CC. `calling` is the TSAP of the CR's sender; `size_code` n is 2**n bytes, None: not told.

    `other_class`: the one that it asks for where that is not taken as class 0.
    """

    code: Code
    destination_ref: int
    source_ref: int
    calling: bytes = b""
    called: bytes = b""
    size_code: int | None = None
    other_class: int = 0

    @property
    def unfit(self) -> str:
        """Return what class 0 cannot agree to; "" where there is nothing."""
        if self.other_class:
            return f"class {self.other_class} in a {self.code.name}"
        if self.size_code is not None and self.size_code < LEAST_SIZE_CODE:
            return f"the TPDU size code {self.size_code:02X} leaves no room for data"
        return ""


class Data(NamedTuple):
    """A DT: a piece of a message, and whether it is the last."""

    payload: bytes
    is_last: bool


class Disconnect(NamedTuple):
    """A DR."""

    destination_ref: int
    source_ref: int
    reason: int


class Rejected(NamedTuple):
    """An ER: the partner could not read a TPDU of ours."""

    destination_ref: int
    cause: int


class Ignored(NamedTuple):
    """A TPDU that class 0 has no use for."""

    code: int


class Malformed(NamedTuple):
    """What cannot be read; the connection cannot go on behind it."""

    what: str


Tpdu = Connect | Data | Disconnect | Rejected | Ignored | Malformed


class TpktReader:
    """Puts TPDUs together from bytes that come in any pieces; behind `Malformed` nothing more is read."""

    def __init__(self) -> None:
        self.agreed: int | None = None  # bytes of a DT, where both ends have told
        self.stopped_short = False  # a TPDU that is complete may wait here
        self._held = bytearray()
        self._is_lost = False

    @property
    def held(self) -> int:
        """Return how many bytes of a TPKT that is not complete are kept."""
        return len(self._held)

    def feed(self, data: bytes | memoryview, most: int = NO_LIMIT) -> list[Tpdu]:
        """Take bytes and return the TPDUs that they complete, in order, at most so many."""
        if self._is_lost:
            return []
        self._held += data
        self.stopped_short = False
        found: list[Tpdu] = []
        begin = 0
        while not self._is_lost and len(self._held) - begin >= TPKT_HEADER:
            if len(found) == most:
                self.stopped_short = True
                break
            size = int.from_bytes(self._held[begin + 2 : begin + 4], "big")
            wrong = _wrong_tpkt(self._held[begin], size) or self._too_large(begin, size)
            if wrong:
                found.append(Malformed(wrong))
            elif len(self._held) - begin < size:
                break
            else:
                found.append(parse(bytes(self._held[begin + TPKT_HEADER : begin + size])))
            begin += size
            self._is_lost = isinstance(found[-1], Malformed)
        if self._is_lost:
            self._held.clear()
        else:
            del self._held[:begin]
        return found

    def _too_large(self, begin: int, size: int) -> str:
        """Return what is wrong with a TPKT larger than agreed; its header is enough to know."""
        tpdu = size - TPKT_HEADER
        if self.agreed is None or tpdu <= self.agreed:
            return ""
        if self._held[begin + CODE_AT : begin + CODE_AT + 1] == bytes([Code.DT]):
            return f"a DT of {tpdu} bytes, {self.agreed} are agreed"
        if tpdu <= LONGEST_HEADER:  # it may be a TPDU that carries no data
            return ""
        return f"a TPKT of {size} bytes, TPDUs of {self.agreed} are agreed"


def _wrong_tpkt(version: int, size: int) -> str:
    if version != TPKT_VERSION:
        return f"TPKT version {version}"
    return f"a TPKT of {size} bytes" if size < LEAST_TPKT else ""


def parse(tpdu: bytes) -> Tpdu:
    """Return the TPDU behind a TPKT header; `tpdu` begins with its length indicator."""
    length = tpdu[0]
    if length < 2 or length == 255 or length + 1 > len(tpdu):
        return Malformed(f"length indicator {length} in a TPDU of {len(tpdu)} bytes")
    header, rest = tpdu[1 : length + 1], tpdu[length + 1 :]
    code = header[0] if header[0] & 0xF0 == Code.DR else header[0] & 0xF0
    match code:
        case Code.CR | Code.CC:
            return _connect(Code(code), header)
        case Code.DT:
            return Data(rest, bool(header[1] & LAST))
        case Code.DR:
            return _disconnect(header)
        case Code.ER:
            return _rejected(header)
    return Ignored(header[0])


def _connect(code: Code, header: bytes) -> Tpdu:
    if len(header) < 6:
        return Malformed(f"a {code.name} of {len(header)} bytes")
    parameters = _parameters(header[6:])
    if parameters is None:
        return Malformed(f"parameters of a {code.name} that run over its end")
    calling, called = parameters.get(_Parameter.CALLING, b""), parameters.get(_Parameter.CALLED, b"")
    if max(len(calling), len(called)) > LONGEST_TSAP:
        return Malformed(f"a TSAP of {max(len(calling), len(called))} bytes")
    size = parameters.get(_Parameter.SIZE)
    asked = header[5] >> 4
    return Connect(
        code,
        int.from_bytes(header[1:3], "big"),
        int.from_bytes(header[3:5], "big"),
        calling,
        called,
        size[0] if size is not None and len(size) == 1 else None,
        asked if asked not in TAKEN_AS_0 else 0,
    )


def _parameters(data: bytes) -> dict[int, bytes] | None:
    found: dict[int, bytes] = {}
    at = 0
    while at < len(data):
        if at + 2 > len(data) or at + 2 + data[at + 1] > len(data):
            return None
        found[data[at]] = data[at + 2 : at + 2 + data[at + 1]]
        at += 2 + data[at + 1]
    return found


def _disconnect(header: bytes) -> Tpdu:
    if len(header) < 6:
        return Malformed(f"a DR of {len(header)} bytes")
    return Disconnect(int.from_bytes(header[1:3], "big"), int.from_bytes(header[3:5], "big"), header[5])


def _rejected(header: bytes) -> Tpdu:
    if len(header) < 4:
        return Malformed(f"an ER of {len(header)} bytes")
    return Rejected(int.from_bytes(header[1:3], "big"), header[3])


# -- values to bytes ---------------------------------------------------------------------------------


def encode(tpdu: Connect | Data | Disconnect | Rejected) -> bytes:
    """Return the TPDU with its TPKT header."""
    match tpdu:
        case Connect():
            refs = _refs(tpdu.destination_ref, tpdu.source_ref)
            body = bytes([tpdu.code]) + refs + bytes([tpdu.other_class << 4]) + _own(tpdu)
        case Data():
            return _framed(bytes([2, Code.DT, LAST if tpdu.is_last else 0]) + tpdu.payload)
        case Disconnect():
            refs = _refs(tpdu.destination_ref, tpdu.source_ref)
            body = bytes([Code.DR]) + refs + bytes([tpdu.reason])
        case Rejected():
            body = bytes([Code.ER]) + tpdu.destination_ref.to_bytes(2, "big") + bytes([tpdu.cause])
    return _framed(bytes([len(body)]) + body)


def _refs(destination: int, source: int) -> bytes:
    return destination.to_bytes(2, "big") + source.to_bytes(2, "big")


def _own(tpdu: Connect) -> bytes:
    # C1, C2, C0: the one order that every partner is known to take (LOGO! takes no other).
    given = [(_Parameter.CALLING, tpdu.calling), (_Parameter.CALLED, tpdu.called)]
    if tpdu.size_code is not None:
        given.append((_Parameter.SIZE, bytes([tpdu.size_code])))
    return b"".join(bytes([code, len(value)]) + value for code, value in given if value)


def _framed(tpdu: bytes) -> bytes:
    size = TPKT_HEADER + len(tpdu)
    return bytes([TPKT_VERSION, 0]) + size.to_bytes(2, "big") + tpdu


def segments(message: bytes | memoryview, most: int) -> bytes:
    """Return the DTs of one message, at most `most` bytes of it in each; an empty message is one empty DT."""
    pieces = [bytes(message[at : at + most]) for at in range(0, len(message), most)] or [b""]
    return b"".join(encode(Data(piece, n == len(pieces))) for n, piece in enumerate(pieces, 1))
