"""Conversations of others that are watched or go through a tap."""

from __future__ import annotations

from msgspec import Struct

TAP, ARMED_TAP = "tap", "armed tap"  # the `kernel` of a tap's screen; armed: its keys act without a question


class DirectionSnapshot(Struct, frozen=True):
    """One direction of a conversation of others: counters; `rate` in bytes a second, of the last second.

    `held`: bytes that a tap holds back, None: it lets them go; `first`: the first of these; `held_ns`: for
    how long it has held back.
    `round_trip_ns` and `window` of who receives, as the stack of a tap knows them; None: unknown.
    """

    size: int
    rate: int
    segments: int
    again: int  # bytes that were sent again
    missing: int
    is_closed: bool  # who receives has told a window of 0
    held: int | None = None
    first: bytes = b""
    round_trip_ns: int | None = None
    window: int | None = None
    held_ns: int = 0


class ConversationSnapshot(Struct, frozen=True):
    """A conversation of others. `tap` is the tap that it goes through, "" for one that is only watched.

    `seconds`: bytes of both directions in each of the newest seconds.
    `handshake_ns`: from SYN to the ACK of its answer.
    """

    number: int
    tap: str
    plc: str
    partner: str
    state: str  # connecting, open, ended, reset; UDP, serial
    to_plc: DirectionSnapshot
    from_plc: DirectionSnapshot
    seconds: tuple[int, ...]
    handshake_ns: int | None = None

    @property
    def held_ns(self) -> int | None:
        """Return for how long a tap has held back one of its directions, the longer time; None: neither."""
        return max((w.held_ns for w in (self.to_plc, self.from_plc) if w.held is not None), default=None)
