"""One ISO-on-TCP connection over a stream of bytes: handshake, size, messages; no sockets (siemens.md 5.2).

Rule 1: bytes in, bytes out: `feed` takes what came, `take_output` gives what must be sent.
Rule 2: at most one message is put together, up to `cap` bytes, and complete ones wait in a short queue: who
does not take them must not feed more (`wants_more`).
Rule 3: whatever cannot be right ends the connection with its reason; nothing raises.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum, auto
from typing import Final, NamedTuple

from trcvtui.net.cotp import (
    DATA_HEADER,
    Code,
    Connect,
    Data,
    Disconnect,
    Malformed,
    Refusal,
    Rejected,
    Tpdu,
    TpktReader,
    encode,
    segments,
)

OWN_SIZE_CODE: Final = 10  # 1024 bytes: what a CPU proposes
SIZE_CODES: Final = range(7, 17)  # 128 bytes .. 65536
NOT_TOLD: Final = 1024  # bytes of a DT that are sent when the partner has told no size (A19)
MESSAGES_WAITING: Final = 4


class Phase(Enum):
    """How far the connection is."""

    WAITS_FOR_CR = auto()
    WAITS_FOR_CC = auto()
    UP = auto()
    ENDED = auto()


class Message(NamedTuple):
    """One message: its first bytes up to the cap, and how many it had."""

    data: bytes
    whole: int


class Ended(NamedTuple):
    """Why the connection is over; `is_refusal`: it never was up, and the partner said so."""

    why: str
    is_refusal: bool = False


@dataclass(frozen=True, slots=True)
class Selectors:
    """TSAPs of both ends; an empty `remote` of a passive end takes every caller."""

    local: bytes
    remote: bytes = b""


class IsoOnTcp:
    """One end. The passive one answers a CR that its owner has accepted (`accept`), or refuses it."""

    def __init__(self, is_active: bool, selectors: Selectors, cap: int, reference: int = 1) -> None:
        self.phase = Phase.WAITS_FOR_CC if is_active else Phase.WAITS_FOR_CR
        self.ended: Ended | None = None
        self.request: Connect | None = None  # the partner's CR, until it is answered
        self.messages: deque[Message] = deque()
        self._selectors = selectors
        self._cap = cap
        self._reference = reference
        self._partner_reference = 0
        self._most = NOT_TOLD - DATA_HEADER
        self._reader = TpktReader()
        self._output = bytearray()
        self._collected = bytearray()
        self._whole = 0
        if is_active:
            self._output += encode(
                Connect(Code.CR, 0, reference, selectors.local, selectors.remote, OWN_SIZE_CODE)
            )

    @property
    def wants_more(self) -> bool:
        """Return whether bytes may be fed: nobody has to take a message first."""
        return self.phase is not Phase.ENDED and len(self.messages) < MESSAGES_WAITING

    @property
    def held(self) -> int:
        """Return how many bytes of unfinished things are kept."""
        return self._reader.held + len(self._collected)

    def take_output(self) -> bytes:
        """Return what must be sent, once."""
        output = bytes(self._output)
        self._output.clear()
        return output

    def feed(self, data: bytes | memoryview) -> None:
        """Take bytes of the stream."""
        for tpdu in self._reader.feed(data):
            if self.phase is Phase.ENDED:
                return
            self._take(tpdu)

    def partner_closed(self) -> None:
        """Note that the stream has ended: class 0 is released by that."""
        self._end("the partner closed", is_refusal=self.phase is Phase.WAITS_FOR_CC)

    def message(self, data: bytes | memoryview) -> bytes:
        """Return the bytes that carry one message."""
        return segments(data, self._most)

    # -- the passive end answers --------------------------------------------------------------------------

    def matches(self, request: Connect) -> Refusal | None:
        """Return why this CR is none for us, None: it is."""
        if request.called != self._selectors.local:
            return Refusal.UNKNOWN_TSAP
        if self._selectors.remote and request.calling != self._selectors.remote:
            return Refusal.REFUSED
        return None

    def accept(self) -> None:
        """Answer the CR: the connection is up."""
        request = self.request
        assert request is not None
        self.request = None
        size = _agreed(request.size_code)
        self._begin(request.source_ref, size)
        answer = Connect(Code.CC, request.source_ref, self._reference, request.calling, request.called, size)
        self._output += encode(answer)

    def refuse(self, reason: Refusal) -> None:
        """Answer the CR with a DR; the owner closes the stream behind it."""
        assert self.request is not None
        self._output += encode(Disconnect(self.request.source_ref, 0, reason))
        self.request = None
        self._end(f"refused: {reason.name.replace('_', ' ').lower()}")

    # -- what comes ----------------------------------------------------------------------------------------

    def _take(self, tpdu: Tpdu) -> None:
        match tpdu:
            case Malformed(what):
                self._end(what)
            case Connect(code=Code.CR) if self.phase is Phase.WAITS_FOR_CR and self.request is None:
                self.request = tpdu
            case Connect(code=Code.CC) if self.phase is Phase.WAITS_FOR_CC:
                self._begin(tpdu.source_ref, tpdu.size_code)
            case Data() if self.phase is Phase.UP:
                self._collect(tpdu)
            case Disconnect(reason=reason):
                was_asking = self.phase is Phase.WAITS_FOR_CC
                self._end(f"the partner sent DR, reason {reason:02X}", is_refusal=was_asking)
            case Rejected(cause=cause):
                self._end(f"the partner sent ER, cause {cause:02X}")
            case Connect() | Data():
                self._end(f"a {tpdu.code.name if isinstance(tpdu, Connect) else 'DT'} out of turn")
            case _:  # what class 0 does not know is no reason to end
                pass

    def _begin(self, partner_reference: int, size_code: int | None) -> None:
        self.phase = Phase.UP
        self._partner_reference = partner_reference
        size = NOT_TOLD if size_code not in SIZE_CODES or size_code is None else 1 << size_code
        self._most = max(size, 1 << SIZE_CODES.start) - DATA_HEADER

    def _collect(self, piece: Data) -> None:
        room = self._cap - len(self._collected)
        self._collected += piece.payload[: max(room, 0)]
        self._whole += len(piece.payload)
        if not piece.is_last:
            return
        if self._whole:  # an empty message is none (siemens.md 5.2)
            self.messages.append(Message(bytes(self._collected), self._whole))
        self._collected.clear()
        self._whole = 0

    def _end(self, why: str, is_refusal: bool = False) -> None:
        if self.ended is None:
            self.ended = Ended(why, is_refusal)
        self.phase = Phase.ENDED
        self._collected.clear()


def _agreed(proposed: int | None) -> int | None:
    """Return the size code of our CC: never above the caller's; None: he told none, so neither do we."""
    if proposed is None:
        return None
    return min(max(proposed, SIZE_CODES.start), OWN_SIZE_CODE)
