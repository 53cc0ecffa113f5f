"""What the ledger gets of a ComBuffer and of the frames on it; offsets are places in the buffer's stream."""

from __future__ import annotations

from typing import NamedTuple


class BytesArrived(NamedTuple):
    """Bytes came into a ComBuffer."""

    buffer: str
    offset: int
    size: int


class BytesLost(NamedTuple):
    """Bytes did not get into a ComBuffer, or were taken out of it unread. `offset`: before which byte."""

    buffer: str
    offset: int
    size: int
    reason: str


class FrameEnded(NamedTuple):
    """A frame was delivered. Its bytes were the newest that the block had taken."""

    instance: str
    buffer: str
    offset: int
    size: int
    ending: str


class PartDropped(NamedTuple):
    """What a block had of a frame was thrown away: `incomplete, 2 bytes, connection closed`."""

    instance: str
    buffer: str
    offset: int
    size: int
    reason: str


class NoiseDropped(NamedTuple):
    """Bytes in front of a prefix were thrown away; `total` of them since the start."""

    instance: str
    buffer: str
    size: int
    total: int


class LineHeld(NamedTuple):
    """A full ComBuffer began to hold the TRCV_C that feeds it (called with EN_R = 0), or let it go."""

    buffer: str
    held: bool


SerialNote = BytesArrived | BytesLost | FrameEnded | PartDropped | NoiseDropped | LineHeld
