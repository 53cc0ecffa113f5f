"""Conversations between other programs: watched, or through a tap."""

from __future__ import annotations

from msgspec import Struct

TAP, ARMED_TAP = "tap", "armed tap"  # `kernel` of a tap's screen; armed: its keys act without confirmation


class DirectionSnapshot(Struct, frozen=True):
    """Counters of one direction; `rate` in bytes per second, of the last second.

    `held`: bytes that a tap holds back, None: it forwards them; `first`: the first of these bytes;
    `held_ns`: how long the tap has been holding. `round_trip_ns` and `window` of the receiver, as the TCP
    stack of a tap knows them; None: unknown.
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
    """A conversation of other programs. `tap`: the tap that it goes through, "" if it is only watched.

    `seconds`: bytes of both directions in each of the newest seconds.
    `handshake_ns`: from SYN to the ACK of the SYN-ACK.
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
        """Return how long a tap has held a direction, of two the longer time; None: neither is held."""
        return max((w.held_ns for w in (self.to_plc, self.from_plc) if w.held is not None), default=None)
