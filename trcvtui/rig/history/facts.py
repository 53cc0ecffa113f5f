"""What the ledger has told, kept small: the facts of one CONNECT.

Rule: only what was seen stands in here; a field that is empty or None is not known, and no rule may guess it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from trcvtui.blocks.cause import Cause

NOT_BUILT: Final = frozenset({"description", "identity"})  # these attempts end before there is a socket
PAUSE_SCANS: Final = 5  # as long without a byte, and the next one begins a new burst


@dataclass(frozen=True, slots=True)
class Moment:
    """A scan and its time in ns of the run."""

    scan: int = 0
    t_ns: int = 0


@dataclass(frozen=True, slots=True)
class Message:
    """One message of a peer: where it lies in the stream that this CONNECT receives, in bytes."""

    number: int
    offset: int
    size: int


@dataclass(frozen=True, slots=True)
class Sizes:
    """How large things were: `last` are the newest sizes in bytes, oldest first; `count` counts all."""

    count: int = 0
    last: tuple[int, ...] = ()

    @property
    def only(self) -> int | None:
        """Return the one size that all of the last had, None where they differ or there are none."""
        return self.last[0] if self.last and min(self.last) == max(self.last) else None


@dataclass(frozen=True, slots=True)
class Drop:
    """A job that ended in mid frame: `have` of `need` bytes, up to byte `end` of the stream, went nowhere."""

    at: Moment
    instance: str
    reason: str
    have: int
    need: int
    end: int


@dataclass(frozen=True, slots=True)
class Failures:
    """Attempts that failed in one way since the connection was last up. `error` is `connect ECONNREFUSED`."""

    error: str
    count: int
    last: Moment
    injected: bool = False
    peer: str = ""


@dataclass(frozen=True, slots=True)
class Attempt:
    """The last attempt that failed since the connection was last up, or since it began to listen.

    `status` and `condition`: what the instance showed of it, 0 and "" where it showed none of its own.
    `said`: what the partner or the session said, in words.
    """

    at: Moment
    cause: Cause
    status: int = 0
    condition: str = ""
    said: str = ""


@dataclass(frozen=True, slots=True)
class Dropped:
    """A client that was let go before it was a partner: its handshake was wrong, or named another TSAP."""

    at: Moment
    peer: str
    why: str


@dataclass(frozen=True, slots=True)
class TurnedAway:
    """Clients that were reset at once: wrong partners, or second ones. `peer` is the last of them."""

    count: int
    peer: str
    last: Moment


@dataclass(frozen=True, slots=True)
class Loss:
    """The last time that a connection ended: in which word of the ledger, with which partner and error."""

    at: Moment
    what: str
    peer: str = ""
    error: str = ""
    injected: bool = False
    up_ns: int | None = None  # how long it had stood


@dataclass(frozen=True, slots=True)
class Facts:
    """What the ledger has told of one CONNECT and one instance on it, however many lines have passed since.

    `sender` and `messages` are known of a peer of this bench only; `bursts` are bytes between two pauses, of
    any partner. Offsets count in the stream of the present connection.
    """

    sender: str = ""
    messages: Sizes = Sizes()
    begins_in: Message | None = None  # the message that holds the first byte of the running job
    bursts: Sizes = Sizes()
    longest_gap_ns: int = 0  # between the last bursts
    received: int = 0  # bytes of the stream so far
    job_offset: int | None = None
    job_began: Moment | None = None
    job_adhoc: bool = False
    drop: Drop | None = None
    drops: int = 0
    drop_cuts: bool | None = None  # whether a message goes on behind the last drop
    behind_drop: Message | None = None  # the message that holds the first byte behind it
    up_since: Moment | None = None
    down_since: Moment | None = None
    failures: tuple[Failures, ...] = ()
    attempt: Attempt | None = None
    dropped: Dropped | None = None
    wrong_partner: TurnedAway | None = None
    second_client: TurnedAway | None = None
    loss: Loss | None = None
    losses: int = 0
    datagrams: Sizes = Sizes()  # of a UDP socket, whoever sent them, as long as they were on the wire
    open_since: Moment | None = None  # that socket
