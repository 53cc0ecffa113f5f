"""One ISO-on-TCP connection over a stream of bytes: handshake, size, messages; no sockets (siemens.md 5.2).

Rule 1: bytes in, bytes out: `feed` takes what came, `take_output` gives what must be sent.
Rule 2: at most one message is put together, up to `cap` bytes, and complete ones wait, MESSAGES_WAITING or
`cap` bytes of them: who does not take them must not feed more (`wants_more`). What is longer than the cap is
counted on; a message of more than CAPS caps ends the connection, and so does one in more pieces than the cap
has bytes, or in too many empty ones.
Rule 3: whatever cannot be right ends the connection with its reason; nothing raises.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final

from trcvtui.net.layer import Ended, Message, Settings
from trcvtui.net.layers.cotp import (
    DATA_HEADER,
    NO_LIMIT,
    Code,
    Connect,
    Data,
    Disconnect,
    Ignored,
    Malformed,
    Refusal,
    Rejected,
    Tpdu,
    TpktReader,
    encode,
    segments,
)

REFERENCE: Final = 1
OWN_SIZE_CODE: Final = 10  # 1024 bytes: what a CPU proposes
SIZE_CODES: Final = range(2, 17)  # 4 bytes, of which 1 is data, to 65536; the manuals know 7 to 13
NOT_TOLD: Final = 1024  # bytes of a DT that are sent when the partner has told no size (A19)
MESSAGES_WAITING: Final = 4
CAPS: Final = 16
EMPTY_PIECES: Final = 64  # DTs without a byte in one message: nobody has a reason to send one
NO_SUCH_TSAP: Final = "no CONNECT has the TSAP"
REMARKS: Final = 4  # so many TPDUs that were passed over are told of one connection


class Phase(Enum):
    """How far the connection is."""

    WAITS_FOR_CR = auto()
    WAITS_FOR_CC = auto()
    UP = auto()
    ENDED = auto()


@dataclass(frozen=True, slots=True)
class IsoSettings:
    """What a CONNECT says: both TSAPs and the longest message in bytes; an empty `remote` is anyone.

    `size_code` n: TPDUs of at most 2**n bytes are proposed, and taken. `not_told`: bytes of a DT to a partner
    who tells no size.
    """

    local: bytes
    remote: bytes
    cap: int
    size_code: int = OWN_SIZE_CODE
    not_told: int = NOT_TOLD
    is_message_oriented: bool = True
    shares_port: bool = True

    def new(self, is_active: bool) -> IsoOnTcp:
        """Return a fresh session."""
        return IsoOnTcp(self, is_active)


class IsoOnTcp:
    """One end. The passive one waits for a CR, and then for somebody who takes it (`give_to`) or says no."""

    def __init__(self, settings: IsoSettings, is_active: bool) -> None:
        self.phase = Phase.WAITS_FOR_CC if is_active else Phase.WAITS_FOR_CR
        self.ended: Ended | None = None
        self.can_take_back = True
        self.request: Connect | None = None  # the partner's CR, until it is answered
        self._settings = settings
        self._most = settings.not_told - DATA_HEADER
        self._reader = TpktReader()
        self._output = bytearray()
        self._collected = bytearray()
        self._whole = 0
        self._pieces = self._empty_pieces = 0  # DTs of the message
        self._finished = 0  # messages, empty ones too
        self._has_begun = False  # a message whose last DT has not come
        self._ignored = 0
        self._remarks: list[str] = []
        self._messages: deque[Message] = deque()
        if is_active:
            request = Connect(Code.CR, 0, REFERENCE, settings.local, settings.remote, settings.size_code)
            self._output += encode(request)

    # -- as every session -----------------------------------------------------------------------------------

    @property
    def is_up(self) -> bool:
        """Return whether messages may flow."""
        return self.phase is Phase.UP

    @property
    def has_data(self) -> bool:
        """Return whether a message is complete."""
        return bool(self._messages)

    @property
    def wants_more(self) -> bool:
        """Return whether bytes may be fed: nobody has to take a message, or answer a CR, first."""
        if self.phase is Phase.ENDED or self.request is not None:
            return False
        return len(self._messages) < MESSAGES_WAITING and self._waiting() < self._settings.cap

    def _waiting(self) -> int:
        return sum(len(one.data) for one in self._messages)

    @property
    def held(self) -> int:
        """Return how many bytes are kept: complete messages, and what is not complete yet."""
        return self._reader.held + len(self._collected) + self._waiting()

    def feed(self, data: bytes | memoryview, most: int = NO_LIMIT) -> int:
        """Take bytes of the stream, and at most so many TPDUs of them; return how many were taken."""
        tpdus = self._reader.feed(data, most)
        for tpdu in tpdus:
            if self.phase is not Phase.ENDED:
                self._take(tpdu)
        return len(tpdus)

    @property
    def has_backlog(self) -> bool:
        """Return whether TPDUs wait here that may be taken now."""
        return self._reader.stopped_short and self.wants_more

    @property
    def is_dear(self) -> bool:
        """Return False: a handshake of two TPDUs costs nothing."""
        return False

    @property
    def partner_is_done(self) -> bool:
        """Return False: class 0 ends with its stream."""
        return False

    @property
    def unfinished(self) -> int:
        """Return the number of the message that has begun and not ended, 0: there is none."""
        return self._finished + 1 if self._has_begun or self._reader.held else 0

    def give_up(self, why: str) -> None:
        """End a message that takes too long; of a handshake others have their own limit, and word for it."""
        if self.is_up:
            self._end("EPROTO", why)

    def take_remarks(self) -> list[str]:
        """Return which TPDUs were passed over, once; REMARKS of them, and that more are not told."""
        remarks, self._remarks = self._remarks, []
        return remarks

    def say_goodbye(self) -> bool:
        """Say nothing: class 0 ends with its stream."""
        return False

    def partner_closed(self) -> None:
        """Note that the stream has ended, which is how class 0 releases; before the CC it is a refusal."""
        if self.phase is Phase.WAITS_FOR_CC:
            self._end("ECONNREFUSED", "closed instead of a CC")

    def take_output(self) -> bytes:
        """Return what must be sent, once."""
        output = bytes(self._output)
        self._output.clear()
        return output

    def read(self, into: memoryview) -> Message | None:
        """Take the next message: as much of it as there is room for goes into `into`."""
        if not self._messages:
            return None
        data, whole = self._messages.popleft()
        size = min(len(data), len(into))
        into[:size] = data[:size]
        return Message(data[:size], whole)

    def encode(self, data: bytes) -> bytes:
        """Return the DTs that carry one message."""
        return segments(data, self._most)

    def drop_data(self) -> int:
        """Drop what could be read and return how many bytes it was."""
        dropped = self._waiting()
        self._messages.clear()
        return dropped

    # -- the passive end is asked for one of several ---------------------------------------------------

    @property
    def has_asked(self) -> bool:
        """Return whether a CR waits for its answer."""
        return self.request is not None

    def names(self, settings: Settings) -> bool:
        """Return whether the CR names this CONNECT's TSAP."""
        assert self.request is not None
        return isinstance(settings, IsoSettings) and self.request.called == settings.local

    def is_for(self, settings: Settings) -> str:
        """Return "" when the CR asks for this CONNECT, else why not."""
        assert self.request is not None
        if not isinstance(settings, IsoSettings) or not self.names(settings):
            return f"{NO_SUCH_TSAP} {self.request.called.hex(' ')}"
        if settings.remote and self.request.calling != settings.remote:
            return f"the TSAP {self.request.calling.hex(' ')} is not the partner's"
        return ""

    def give_to(self, settings: Settings) -> None:
        """Answer the CR with a CC: the connection is up."""
        request = self.request
        assert request is not None
        assert isinstance(settings, IsoSettings)
        self.request, self._settings = None, settings
        size = _agreed(request.size_code, settings.size_code)
        self._begin(size)
        refs = request.source_ref, REFERENCE
        self._output += encode(Connect(Code.CC, *refs, request.calling, request.called, size))

    def refuse(self, is_known: bool) -> None:
        """Answer the CR with a DR; the stream is closed behind it."""
        if self.request is not None:
            reason = Refusal.NOBODY_WAITS if is_known else Refusal.UNKNOWN_TSAP
            self._output += encode(Disconnect(self.request.source_ref, 0, reason))
        self.request = None
        self._end("ECONNREFUSED", "refused by us")

    # -- what comes ----------------------------------------------------------------------------------------

    def _take(self, tpdu: Tpdu) -> None:
        match tpdu:
            case Malformed(what):
                self._end("EPROTO", what)
            case Connect(unfit=unfit) if unfit:
                self._cannot_agree(tpdu)
            case Connect(code=Code.CR) if self.phase is Phase.WAITS_FOR_CR and self.request is None:
                self.request = tpdu
            case Connect(code=Code.CC) if self.phase is Phase.WAITS_FOR_CC:
                self._begin(_agreed(tpdu.size_code, self._settings.size_code))
            case Data() if self.phase is Phase.UP:
                self._take_data(tpdu)
            case Disconnect(reason=reason):
                was_asking = self.phase is Phase.WAITS_FOR_CC
                self._end("ECONNREFUSED" if was_asking else "ECONNRESET", f"DR, reason {reason:02X}")
            case Rejected(cause=cause):
                self._end("EPROTO", f"ER, cause {cause:02X}")
            case Connect():
                self._end("EPROTO", f"a {tpdu.code.name} out of turn")
            case Data():
                self._end("EPROTO", "a DT out of turn")
            case Ignored(code=code):  # what class 0 does not know is no reason to end
                self._pass_over(code)

    def _cannot_agree(self, asked: Connect) -> None:
        """End it; who has asked for a connection is told by a DR."""
        if asked.code is Code.CR and self.phase is Phase.WAITS_FOR_CR and self.request is None:
            self._output += encode(Disconnect(asked.source_ref, 0, Refusal.NEGOTIATION_FAILED))
        self._end("EPROTO", asked.unfit)

    def _pass_over(self, code: int) -> None:
        self._ignored += 1
        if self._ignored <= REMARKS:
            self._remarks.append(f"a TPDU of code {code:02X}")
        elif self._ignored == REMARKS + 1:
            self._remarks.append("more of them are not told")

    def _begin(self, size_code: int | None) -> None:
        self.phase = Phase.UP
        agreed = self._reader.agreed = 1 << size_code if size_code is not None else None
        own = 1 << self._settings.size_code
        self._most = (agreed or min(self._settings.not_told, own)) - DATA_HEADER

    def _take_data(self, piece: Data) -> None:
        size, agreed = len(piece.payload) + DATA_HEADER, self._reader.agreed
        if agreed is not None and size > agreed:  # it came in one piece with the CC
            self._end("EPROTO", f"a DT of {size} bytes, {agreed} are agreed")
        else:
            self._collect(piece)

    def _collect(self, piece: Data) -> None:
        room = self._settings.cap - len(self._collected)
        self._collected += piece.payload[: max(room, 0)]
        self._whole += len(piece.payload)
        self._has_begun = not piece.is_last
        self._pieces += 1
        self._empty_pieces += not piece.payload
        endless = self._endless()
        if endless:
            self._end("EPROTO", endless)
            return
        if not piece.is_last:
            return
        self._finished += 1
        if self._whole:  # an empty message is none (siemens.md 5.2)
            self._messages.append(Message(bytes(self._collected), self._whole))
        self._collected.clear()
        self._whole = self._pieces = self._empty_pieces = 0

    def _endless(self) -> str:
        """Return in words how the message is longer than any that may come."""
        cap = self._settings.cap
        if self._whole > CAPS * cap:
            return f"a message of more than {CAPS * cap} bytes"
        if self._empty_pieces > EMPTY_PIECES:
            return f"a message with more than {EMPTY_PIECES} empty DTs"
        # One byte in each, the longest message that there is room for has as many pieces as bytes.
        return f"a message in more than {cap} DTs" if self._pieces > cap + EMPTY_PIECES else ""

    def _end(self, error: str, detail: str) -> None:
        if self.ended is None:
            self.ended = Ended(error, detail)
        self.phase = Phase.ENDED
        self._collected.clear()


def _agreed(proposed: int | None, own: int) -> int | None:
    """Return the size code that both keep to: never above what was proposed; None: the partner told none."""
    return None if proposed is None else min(proposed, own)
