"""The ledger: what happened, in which scan, and why. Every view of the past shows this one list.

Rule: events that a frame causes are NamedTuples. Making a frozen dataclass takes four times as long.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Final, NamedTuple

from msgspec import Struct

from trcvtui.blocks.environment import (
    ModeChanged,
    ReceiveEnded,
    ReceiveStarted,
    SendEnded,
    SendStarted,
    SerialNote,
)
from trcvtui.blocks.outcome import Cause
from trcvtui.blocks.pins import PinValue
from trcvtui.blocks.table import outcome_field
from trcvtui.net.events import BytesDropped, BytesReceived, BytesSent, ConnectionChanged

KEPT_LINES: Final = 20_000


class Outputs(NamedTuple):
    """The outputs of one instance after a scan. `status` is the WORD. `rcvd_len` is bytes, None if no pin.

    For a block on a ComBuffer, `status` is the pin Error. The block may have `rx_timeout` or `byte`, too.
    """

    status: int
    busy: bool
    done: bool
    error: bool
    rcvd_len: int | None
    rx_timeout: bool | None = None
    byte: int | None = None

    def pin(self, name: str) -> PinValue:
        """Return the value of an output pin, 0 if the block does not have it."""
        value: PinValue | None = getattr(self, outcome_field(name))
        return 0 if value is None else value

    @property
    def lit_lamp(self) -> str:
        """Return the lamp that is lit, or "" for none. Error comes before done, and done before busy."""
        return "error" if self.error else "done" if self.done else "busy" if self.busy else ""


class StatusEdge(Struct, frozen=True):
    """The outputs of an instance, written after a scan that changed them; `cause` says why."""

    instance: str
    block: str
    outputs: Outputs
    condition: str
    cause: Cause


class InputEdge(Struct, frozen=True):
    """An input pin of an instance changed."""

    instance: str
    pin: str
    value: PinValue


# The sender, where it is no peer: bytes of a captured packet, bytes that the capture lacks.
A_PACKET, A_HOLE = "packet:", "missing:"
NO_END = "none:"  # in place of the local end: the remote one is the name of a link without connections


class PeerSent(NamedTuple):
    """A peer's message: its number (from 1), and its place in the peer's sent stream.

    `ns` is a captured packet's time in ns from the first packet. With -1, the ledger line's time counts.
    """

    peer: str
    message: int
    local: str
    remote: str
    offset: int
    size: int
    ns: int = -1


class BenchNote(Struct, frozen=True):
    """Something the bench did, such as a peer's connection, an injected fault, a PLC STOP, or written DATA.

    `end` is the partner's address. With `for_all`, the note is about all CONNECTs at the port.
    """

    subject: str
    what: str
    detail: str = ""
    end: str = ""
    for_all: bool = False


Event = (
    StatusEdge
    | InputEdge
    | ReceiveStarted
    | ModeChanged
    | ReceiveEnded
    | SendStarted
    | SendEnded
    | PeerSent
    | BenchNote
    | ConnectionChanged
    | BytesReceived
    | BytesSent
    | BytesDropped
    | SerialNote
)


class Line(NamedTuple):
    """One line of the ledger. `seq` counts from 1 without gaps. `t_ns` is ns from the start of the run."""

    seq: int
    scan: int
    t_ns: int
    event: Event


StampedEvent = tuple[int, int, Event]  # scan, time in ns; cheaper than a line


class Ledger:
    """A bounded list of lines, the oldest dropped first. `write` uses the newest scan's number and time."""

    def __init__(self, keep: int = KEPT_LINES) -> None:
        self._ring: deque[StampedEvent] = deque(maxlen=keep)
        self.last_seq = 0
        self.scan = 0
        self.t_ns = 0

    def write(self, event: Event) -> None:
        """Append one event of the newest scan, or of the gap after that scan."""
        self.last_seq += 1
        self._ring.append((self.scan, self.t_ns, event))

    def write_at(self, t_ns: int, event: Event) -> None:
        """Append one event with a time of its own, not the time of the newest scan."""
        self.last_seq += 1
        self._ring.append((self.scan, t_ns, event))

    def write_all(self, events: Sequence[Event]) -> None:
        scan, t_ns = self.scan, self.t_ns
        self.last_seq += len(events)
        self._ring.extend([(scan, t_ns, event) for event in events])

    def lines_since(self, seq: int, most: int = KEPT_LINES) -> tuple[Line, ...]:
        """Return the newest lines after `seq` that the ledger still has, at most `most`, oldest first."""
        items = self.events_since(seq, most)
        first = self.last_seq - len(items) + 1
        new = tuple.__new__  # quicker than Line(..), which a picture needs for each line
        return tuple([new(Line, (seq, *item)) for seq, item in enumerate(items, first)])

    def events_since(self, seq: int, most: int = KEPT_LINES) -> list[StampedEvent]:
        """Return the newest events after `seq`, at most `most`, oldest first."""
        fresh = min(self.last_seq - seq, len(self._ring), most)
        return list(islice(reversed(self._ring), max(0, fresh)))[::-1]

    def __iter__(self) -> Iterator[Line]:
        """Return the lines that the ledger still has, oldest first."""
        first = self.last_seq - len(self._ring) + 1
        return (Line(first + n, *item) for n, item in enumerate(self._ring))
