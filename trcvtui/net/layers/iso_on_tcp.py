"""One ISO-on-TCP connection over a stream of bytes: handshake, size, messages; no sockets (RFC 1006).

Rule 1: bytes in, bytes out. `feed` takes received bytes. `take_output` returns bytes to send.
Rule 2: at most one message at a time is put together, up to `cap` bytes. Bytes beyond `cap` are only
counted. Complete messages wait. Once MOST_WAITING_MESSAGES or `cap` bytes wait, `wants_more` is False. A
message longer than MOST_CAPS caps ends the connection. So does a message with more pieces than the cap has
bytes, or with too many empty pieces.
Rule 3: invalid input raises no exception. Such input ends the connection; `ended` is why.
"""

from __future__ import annotations

from collections import deque
from enum import Enum, IntEnum, auto
from itertools import islice
from typing import Final, NamedTuple

from msgspec import Struct

from trcvtui.net.layer import LayerMessage, LayerSettings, SessionEnd
from trcvtui.net.results import Endpoint, Unread, WaitingMessage

# -- TPDUs -----------------------------------------------------------------------------------------------
#
# Rule 1: the partner's bytes are checked, never trusted: a TPDU that cannot be read is a `MalformedTpdu`.
# Rule 2: a reader holds one TPKT at most (65535 bytes), however the stream cuts the bytes.
# Layout: RFC 1006 and RFC 905. All numbers are big-endian.

TPKT_VERSION: Final = 3
TPKT_HEADER: Final = 4  # bytes: version, reserved, length of the whole
CODE_OFFSET: Final = 5  # of the TPDU's code in a TPKT
LONGEST_HEADER: Final = 255  # bytes of a TPDU without data: its length indicator has one byte
NO_LIMIT: Final = 1 << 62
LEAST_TPKT: Final = 7  # bytes, RFC 1006 6
DATA_HEADER: Final = 3  # bytes of a DT that count against the negotiated size
CLASSES_TAKEN_AS_0: Final = (0, 4)  # some texts of RFC 1006 show class 4
LEAST_SIZE_CODE: Final = 2  # 4 bytes, of which 1 is data
END_OF_MESSAGE: Final = 0x80  # of the message: the EOT mark of a DT
LONGEST_TSAP: Final = 32


class Code(IntEnum):  # of class 0
    CR = 0xE0
    CC = 0xD0
    DR = 0x80
    DT = 0xF0
    ER = 0x70


class DrReason(IntEnum):
    """Reasons of a DR (RFC 905)."""

    NOBODY_WAITS = 0x02
    UNKNOWN_TSAP = 0x03
    NEGOTIATION_FAILED = 0x82


class _Parameter(IntEnum):
    SIZE = 0xC0
    CALLING = 0xC1
    CALLED = 0xC2


class ConnectTpdu(NamedTuple):
    """A CR or CC. `calling` is the TSAP of the end that sent the CR. `size_code` n means 2**n bytes.

    `other_class` is 0, or a class that the TPDU asks for and that cannot be taken as class 0.
    """

    code: Code
    destination_ref: int
    source_ref: int
    calling: bytes = b""
    called: bytes = b""
    size_code: int | None = None
    other_class: int = 0

    @property
    def unfit_reason(self) -> str:
        """Return why class 0 cannot agree to this TPDU, or "" if class 0 can."""
        if self.other_class:
            return f"class {self.other_class} in a {self.code.name}"
        if self.size_code is not None and self.size_code < LEAST_SIZE_CODE:
            return f"the TPDU size code {self.size_code:02X} leaves no room for data"
        return ""


class DataTpdu(NamedTuple):
    """A DT: a piece of a message, and whether it is the last piece."""

    payload: bytes
    is_last: bool


class DisconnectTpdu(NamedTuple):  # DR
    destination_ref: int
    source_ref: int
    reason: int


class ErrorTpdu(NamedTuple):
    """An ER TPDU: the partner could not read a TPDU that we sent."""

    destination_ref: int
    cause: int


class UnusedTpdu(NamedTuple):
    """A TPDU that class 0 has no use for."""

    code: int


class MalformedTpdu(NamedTuple):
    """Bytes that cannot be read as a TPDU; they end the connection."""

    what: str


Tpdu = ConnectTpdu | DataTpdu | DisconnectTpdu | ErrorTpdu | UnusedTpdu | MalformedTpdu


class TpktReader:
    """Puts TPDUs together from bytes that come in any pieces. A `MalformedTpdu` ends the reading."""

    def __init__(self) -> None:
        self.agreed: int | None = None  # the most bytes of a DT, if both ends have named a size
        self.stopped_short = False  # a complete TPDU may wait here
        self._held = bytearray()
        self._is_lost = False

    @property
    def held_bytes(self) -> int:
        """Return how many bytes are stored: of incomplete TPKTs, and of TPKTs not yet read."""
        return len(self._held)

    def feed(self, data: bytes | memoryview, most: int = NO_LIMIT) -> list[Tpdu]:
        """Take bytes. Return at most `most` of the TPDUs that the bytes complete, in order."""
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
            wrong = _tpkt_error(self._held[begin], size) or self._size_error(begin, size)
            if wrong:  # before its bytes have come: a wrong length would make us wait, or keep them
                found.append(MalformedTpdu(wrong))
            elif len(self._held) - begin < size:
                break
            else:
                found.append(parse_tpdu(bytes(self._held[begin + TPKT_HEADER : begin + size])))
            begin += size
            self._is_lost = isinstance(found[-1], MalformedTpdu)
        if self._is_lost:
            self._held.clear()
        else:
            del self._held[:begin]
        return found

    def _size_error(self, begin: int, size: int) -> str:
        tpdu = size - TPKT_HEADER
        if self.agreed is None or tpdu <= self.agreed:
            return ""
        if self._held[begin + CODE_OFFSET : begin + CODE_OFFSET + 1] == bytes([Code.DT]):
            return f"a DT of {tpdu} bytes, but {self.agreed} are agreed"
        if tpdu <= LONGEST_HEADER:  # it may carry no data; the agreed size is that of a DT
            return ""
        return f"a TPKT of {size} bytes, but TPDUs of {self.agreed} are agreed"


def _tpkt_error(version: int, size: int) -> str:
    if version != TPKT_VERSION:
        return f"TPKT version {version}"
    return f"a TPKT of {size} bytes" if size < LEAST_TPKT else ""


def parse_tpdu(tpdu: bytes) -> Tpdu:
    """Return the TPDU after a TPKT header; `tpdu` begins with its length indicator."""
    length = tpdu[0]
    if length < 2 or length == 255 or length + 1 > len(tpdu):  # 255 is reserved (RFC 905 13.2.1)
        return MalformedTpdu(f"length indicator {length} in a TPDU of {len(tpdu)} bytes")
    header, rest = tpdu[1 : length + 1], tpdu[length + 1 :]
    # The low half of the code is a credit, but not in a DR.
    code = header[0] if header[0] & 0xF0 == Code.DR else header[0] & 0xF0
    match code:
        case Code.CR | Code.CC:
            return _parse_connect(Code(code), header)
        case Code.DT:
            return DataTpdu(rest, bool(header[1] & END_OF_MESSAGE))
        case Code.DR:
            return _parse_disconnect(header)
        case Code.ER:
            return _parse_error(header)
    return UnusedTpdu(header[0])


def _parse_connect(code: Code, header: bytes) -> Tpdu:
    if len(header) < 6:
        return MalformedTpdu(f"a {code.name} of {len(header)} bytes")
    parameters = _parse_parameters(header[6:])
    if parameters is None:
        return MalformedTpdu(f"parameters of a {code.name} that run over its end")
    calling, called = parameters.get(_Parameter.CALLING, b""), parameters.get(_Parameter.CALLED, b"")
    if max(len(calling), len(called)) > LONGEST_TSAP:
        return MalformedTpdu(f"a TSAP of {max(len(calling), len(called))} bytes")
    size = parameters.get(_Parameter.SIZE)
    protocol_class = header[5] >> 4
    return ConnectTpdu(
        code,
        int.from_bytes(header[1:3], "big"),
        int.from_bytes(header[3:5], "big"),
        calling,
        called,
        size[0] if size is not None and len(size) == 1 else None,
        protocol_class if protocol_class not in CLASSES_TAKEN_AS_0 else 0,
    )


def _parse_parameters(data: bytes) -> dict[int, bytes] | None:
    found: dict[int, bytes] = {}
    at = 0
    while at < len(data):
        if at + 2 > len(data) or at + 2 + data[at + 1] > len(data):
            return None
        found[data[at]] = data[at + 2 : at + 2 + data[at + 1]]
        at += 2 + data[at + 1]
    return found


def _parse_disconnect(header: bytes) -> Tpdu:
    if len(header) < 6:
        return MalformedTpdu(f"a DR of {len(header)} bytes")
    return DisconnectTpdu(int.from_bytes(header[1:3], "big"), int.from_bytes(header[3:5], "big"), header[5])


def _parse_error(header: bytes) -> Tpdu:
    if len(header) < 4:
        return MalformedTpdu(f"an ER of {len(header)} bytes")
    return ErrorTpdu(int.from_bytes(header[1:3], "big"), header[3])


# -- values to bytes ---------------------------------------------------------------------------------


def encode_tpdu(tpdu: ConnectTpdu | DataTpdu | DisconnectTpdu | ErrorTpdu) -> bytes:
    """Return the TPDU with its TPKT header."""
    match tpdu:
        case ConnectTpdu():
            refs = _encode_references(tpdu.destination_ref, tpdu.source_ref)
            body = bytes([tpdu.code]) + refs + bytes([tpdu.other_class << 4]) + _encode_parameters(tpdu)
        case DataTpdu():
            return _add_tpkt_header(bytes([2, Code.DT, END_OF_MESSAGE if tpdu.is_last else 0]) + tpdu.payload)
        case DisconnectTpdu():
            refs = _encode_references(tpdu.destination_ref, tpdu.source_ref)
            body = bytes([Code.DR]) + refs + bytes([tpdu.reason])
        case ErrorTpdu():
            body = bytes([Code.ER]) + tpdu.destination_ref.to_bytes(2, "big") + bytes([tpdu.cause])
    return _add_tpkt_header(bytes([len(body)]) + body)


def _encode_references(destination: int, source: int) -> bytes:
    return destination.to_bytes(2, "big") + source.to_bytes(2, "big")


def _encode_parameters(tpdu: ConnectTpdu) -> bytes:
    # C1, C2, C0: the one order that all known partners accept (LOGO! accepts no other).
    given = [(_Parameter.CALLING, tpdu.calling), (_Parameter.CALLED, tpdu.called)]
    if tpdu.size_code is not None:
        given.append((_Parameter.SIZE, bytes([tpdu.size_code])))
    return b"".join(bytes([code, len(value)]) + value for code, value in given if value)


def _add_tpkt_header(tpdu: bytes) -> bytes:
    size = TPKT_HEADER + len(tpdu)
    return bytes([TPKT_VERSION, 0]) + size.to_bytes(2, "big") + tpdu


def encode_message(message: bytes | memoryview, most: int) -> bytes:
    """Return the DTs of one message, with at most `most` bytes each. An empty message is one empty DT."""
    pieces = [bytes(message[at : at + most]) for at in range(0, len(message), most)] or [b""]
    return b"".join(encode_tpdu(DataTpdu(piece, n == len(pieces))) for n, piece in enumerate(pieces, 1))


REFERENCE: Final = 1
OWN_SIZE_CODE: Final = 10  # 1024 bytes: what a CPU proposes
DEFAULT_DT_BYTES: Final = 1024  # bytes of a DT to a partner that has named no size
MOST_WAITING_MESSAGES: Final = 4
MOST_CAPS: Final = 16
MOST_EMPTY_PIECES: Final = 64  # DTs without data in one message: they cost work, and no partner needs them
NO_SUCH_TSAP: Final = "no CONNECT has the TSAP"
MOST_REMARKS: Final = 4  # ignored TPDUs of one connection that are reported


class IsoPhase(Enum):
    WAITS_FOR_CR = auto()
    WAITS_FOR_CC = auto()
    UP = auto()
    ENDED = auto()


class IsoSettings(Struct, frozen=True):
    """Settings of a CONNECT: both TSAPs and the longest message in bytes. An empty `remote` means any TSAP.

    The CONNECT proposes and accepts TPDUs of at most 2**`size_code` bytes. If a partner names no size, a DT
    to this partner has `default_dt_bytes` at most.
    """

    local: bytes
    remote: bytes
    cap: int
    size_code: int = OWN_SIZE_CODE
    default_dt_bytes: int = DEFAULT_DT_BYTES
    is_message_oriented: bool = True
    shares_port: bool = True

    def make_session(self, is_active: bool) -> IsoSession:
        return IsoSession(self, is_active)


class IsoSession:
    """One end. A passive session waits for a CR, and then for a call of `accept_for` or `refuse`."""

    next_is_costly = False  # a handshake of two TPDUs needs no calculation
    partner_is_done = False  # class 0 ends with its stream (RFC 905 6.7, implicit variant)

    def __init__(self, settings: IsoSettings, is_active: bool) -> None:
        self.phase = IsoPhase.WAITS_FOR_CC if is_active else IsoPhase.WAITS_FOR_CR
        self.ended: SessionEnd | None = None
        self.can_take_back = True
        self.request: ConnectTpdu | None = None  # the partner's CR, until it is answered
        self._settings = settings
        self._most = settings.default_dt_bytes - DATA_HEADER
        self._reader = TpktReader()
        self._output = bytearray()
        self._collected = bytearray()
        self._whole = 0
        self._pieces = self._empty_pieces = 0  # DTs of the message
        self._finished = 0  # messages, with empty ones
        self._has_begun = False  # a message whose last DT has not come yet
        self._ignored = 0
        self._remarks: list[str] = []
        self._messages: deque[LayerMessage] = deque()
        if is_active:
            request = ConnectTpdu(Code.CR, 0, REFERENCE, settings.local, settings.remote, settings.size_code)
            self._output += encode_tpdu(request)

    # -- as every session -----------------------------------------------------------------------------------

    @property
    def is_up(self) -> bool:
        return self.phase is IsoPhase.UP

    @property
    def has_data(self) -> bool:
        return bool(self._messages)

    def unread(self, peer: Endpoint, skip: int) -> Unread:
        found = [WaitingMessage(peer, *one) for one in islice(self._messages, skip, None)]
        return Unread(is_full=not self.wants_more, messages=tuple(found), has_session=True)

    @property
    def wants_more(self) -> bool:
        """Return whether bytes may be fed. While a CR has no answer, or enough messages wait, none may."""
        if self.phase is IsoPhase.ENDED or self.request is not None:
            return False  # bytes after a CR are not read before it is accepted
        return len(self._messages) < MOST_WAITING_MESSAGES and self._waiting_bytes() < self._settings.cap

    def _waiting_bytes(self) -> int:
        return sum(len(one.data) for one in self._messages)

    @property
    def held_bytes(self) -> int:
        return self._reader.held_bytes + len(self._collected) + self._waiting_bytes()

    def feed(self, data: bytes | memoryview, most: int = NO_LIMIT) -> int:
        """Take bytes of the stream, and read at most `most` TPDUs. Return how many TPDUs were read."""
        tpdus = self._reader.feed(data, most)
        for tpdu in tpdus:
            if self.phase is not IsoPhase.ENDED:
                self._handle_tpdu(tpdu)
        return len(tpdus)

    @property
    def has_backlog(self) -> bool:
        return self._reader.stopped_short and self.wants_more

    @property
    def open_message(self) -> int:
        return self._finished + 1 if self._has_begun or self._reader.held_bytes else 0

    def time_out(self, why: str) -> None:
        if self.is_up:  # only a message: the caller reports a late handshake itself
            self._end("EPROTO", why)

    def take_remarks(self) -> list[str]:
        """Return the remarks on ignored TPDUs once: at most MOST_REMARKS, and a line if there are more."""
        remarks, self._remarks = self._remarks, []
        return remarks

    def say_goodbye(self) -> bool:
        return False  # class 0 ends with its stream

    def note_partner_end(self) -> None:
        """Note the end of the stream: it ends a connection of class 0, or refuses it before the CC."""
        if self.phase is IsoPhase.WAITS_FOR_CC:
            self._end("ECONNREFUSED", "closed instead of a CC")

    def take_output(self) -> bytes:
        output = bytes(self._output)
        self._output.clear()
        return output

    def read(self, into: memoryview) -> LayerMessage | None:
        if not self._messages:
            return None
        data, whole = self._messages.popleft()
        size = min(len(data), len(into))
        into[:size] = data[:size]
        return LayerMessage(data[:size], whole)

    def encode(self, data: bytes) -> bytes:
        return encode_message(data, self._most)

    def drop_data(self) -> int:
        dropped = self._waiting_bytes()
        self._messages.clear()
        return dropped

    # -- the choice of one of several CONNECTs (passive end) --------------------------------------------

    @property
    def has_asked(self) -> bool:
        return self.request is not None  # a CR that is not answered

    def asks_for_name_of(self, settings: LayerSettings) -> bool:
        assert self.request is not None
        return isinstance(settings, IsoSettings) and self.request.called == settings.local

    def find_mismatch(self, settings: LayerSettings) -> str:
        assert self.request is not None
        if not isinstance(settings, IsoSettings) or not self.asks_for_name_of(settings):
            return f"{NO_SUCH_TSAP} {self.request.called.hex(' ')}"
        if settings.remote and self.request.calling != settings.remote:
            return f"the TSAP {self.request.calling.hex(' ')} is not the partner's"
        return ""

    def accept_for(self, settings: LayerSettings) -> None:
        """Answer the CR with a CC: the connection is up."""
        request = self.request
        assert request is not None
        assert isinstance(settings, IsoSettings)
        self.request, self._settings = None, settings
        size = _agree_size_code(request.size_code, settings.size_code)
        self._begin_data_phase(size)
        refs = request.source_ref, REFERENCE
        self._output += encode_tpdu(ConnectTpdu(Code.CC, *refs, request.calling, request.called, size))

    def refuse(self, is_known: bool) -> None:
        """Answer the CR with a DR; the caller then closes the stream."""
        if self.request is not None:
            reason = DrReason.NOBODY_WAITS if is_known else DrReason.UNKNOWN_TSAP
            self._output += encode_tpdu(DisconnectTpdu(self.request.source_ref, 0, reason))
        self.request = None
        self._end("ECONNREFUSED", "refused by us")  # bytes that still come are not read

    # -- what comes ----------------------------------------------------------------------------------------

    def _handle_tpdu(self, tpdu: Tpdu) -> None:
        match tpdu:
            case MalformedTpdu(what):  # Rule 3
                self._end("EPROTO", what)
            case ConnectTpdu(unfit_reason=reason) if reason:
                self._refuse_unfit(tpdu)
            case ConnectTpdu(code=Code.CR) if self.phase is IsoPhase.WAITS_FOR_CR and self.request is None:
                self.request = tpdu
            case ConnectTpdu(code=Code.CC) if self.phase is IsoPhase.WAITS_FOR_CC:
                self._begin_data_phase(_agree_size_code(tpdu.size_code, self._settings.size_code))
            case DataTpdu() if self.phase is IsoPhase.UP:
                self._handle_data(tpdu)
            case DisconnectTpdu(reason=reason):
                was_asking = self.phase is IsoPhase.WAITS_FOR_CC
                self._end("ECONNREFUSED" if was_asking else "ECONNRESET", f"DR, reason {reason:02X}")
            case ErrorTpdu(cause=cause):
                self._end("EPROTO", f"ER, cause {cause:02X}")
            case ConnectTpdu():
                self._end("EPROTO", f"a {tpdu.code.name} out of turn")
            case DataTpdu():
                self._end("EPROTO", "a DT out of turn")
            case UnusedTpdu(code=code):  # harmless: its length is known, so the next TPDU can be read
                self._note_unused(code)

    def _refuse_unfit(self, tpdu: ConnectTpdu) -> None:
        if tpdu.code is Code.CR and self.phase is IsoPhase.WAITS_FOR_CR and self.request is None:
            self._output += encode_tpdu(DisconnectTpdu(tpdu.source_ref, 0, DrReason.NEGOTIATION_FAILED))
        self._end("EPROTO", tpdu.unfit_reason)

    def _note_unused(self, code: int) -> None:
        self._ignored += 1
        if self._ignored <= MOST_REMARKS:
            self._remarks.append(f"a TPDU of code {code:02X}")
        elif self._ignored == MOST_REMARKS + 1:
            self._remarks.append("more of them are not shown")

    def _begin_data_phase(self, size_code: int | None) -> None:
        self.phase = IsoPhase.UP
        agreed = self._reader.agreed = 1 << size_code if size_code is not None else None
        own = 1 << self._settings.size_code
        self._most = (agreed or min(self._settings.default_dt_bytes, own)) - DATA_HEADER

    def _handle_data(self, piece: DataTpdu) -> None:
        size, agreed = len(piece.payload) + DATA_HEADER, self._reader.agreed
        if agreed is not None and size > agreed:  # it came with the CC: the reader knew no size yet
            self._end("EPROTO", f"a DT of {size} bytes, but {agreed} are agreed")
        else:
            self._collect(piece)

    def _collect(self, piece: DataTpdu) -> None:
        room = self._settings.cap - len(self._collected)
        self._collected += piece.payload[: max(room, 0)]  # Rule 2: bytes beyond the cap are counted only
        self._whole += len(piece.payload)
        self._has_begun = not piece.is_last
        self._pieces += 1
        self._empty_pieces += not piece.payload
        endless = self._size_limit_error()
        if endless:
            self._end("EPROTO", endless)
            return
        if not piece.is_last:
            return
        self._finished += 1
        if self._whole:  # an empty message is ignored
            self._messages.append(LayerMessage(bytes(self._collected), self._whole))
        self._collected.clear()
        self._whole = self._pieces = self._empty_pieces = 0

    def _size_limit_error(self) -> str:
        cap = self._settings.cap
        if self._whole > MOST_CAPS * cap:
            return f"a message of more than {MOST_CAPS * cap} bytes"
        if self._empty_pieces > MOST_EMPTY_PIECES:  # they add no byte, so no other limit would end it
            return f"a message with more than {MOST_EMPTY_PIECES} empty DTs"
        # With one byte a piece, the longest message that fits has as many pieces as bytes.
        return f"a message in more than {cap} DTs" if self._pieces > cap + MOST_EMPTY_PIECES else ""

    def _end(self, error: str, detail: str) -> None:
        if self.ended is None:
            self.ended = SessionEnd(error, detail)
        self.phase = IsoPhase.ENDED
        self._collected.clear()


def _agree_size_code(proposed: int | None, own: int) -> int | None:
    """Return the size code for both ends, never above the proposal; None: the partner named no size."""
    return None if proposed is None else min(proposed, own)
