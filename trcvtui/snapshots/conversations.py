"""Conversations between other programs. A conversation is watched, or goes through a tap."""

from __future__ import annotations

from msgspec import Struct

TAP, ARMED_TAP = "tap", "armed tap"  # `kernel` of a tap's screen; armed: its keys act without confirmation


class DirectionSnapshot(Struct, frozen=True):
    """Counters of one direction. `rate` is the number of bytes in the last second.

    `held` is the number of bytes that a tap holds back, or None while the tap forwards them. `first` has
    the first held bytes. The tap has been holding for `held_ns`. `round_trip_ns` and `window` of the
    receiver are as the TCP stack of a tap knows them; None means unknown.
    """

    size: int
    rate: int
    segments: int
    again: int  # bytes of retransmissions
    missing: int
    is_closed: bool  # zero window: the receiver takes no bytes
    held: int | None = None
    first: bytes = b""
    round_trip_ns: int | None = None
    window: int | None = None
    held_ns: int = 0


class ConversationSnapshot(Struct, frozen=True):
    """A conversation of other programs. `tap` is the tap that it goes through, or "" if it is only watched.

    `seconds` has the number of bytes in each of the newest seconds, both directions together.
    `handshake_ns` is the time from SYN to the ACK of the SYN-ACK.
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
        """Return how long a tap has held a direction: the longer time of both, or None if none is held."""
        return max((w.held_ns for w in (self.to_plc, self.from_plc) if w.held is not None), default=None)
