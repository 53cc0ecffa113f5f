"""What a block can read besides its pins, and the events that a block writes into the ledger."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from msgspec import Struct

from trcvtui.blocks.rules import VendorRules
from trcvtui.net.connection.resources import Resources


class BytesBuffered(NamedTuple):
    """Bytes entered a ComBuffer. `position` is where the bytes begin in the ring of received bytes."""

    buffer: str
    offset: int
    size: int
    position: int = 0


class BufferBytesLost(NamedTuple):
    """Bytes did not fit into a ComBuffer, or left it unread. `offset` counts all bytes that had entered."""

    buffer: str
    offset: int
    size: int
    reason: str
    position: int = -1  # of the first lost byte in its ring; -1: the last bytes before `offset` are lost


class FrameEnded(NamedTuple):
    """A frame was delivered. The frame is the last `size` bytes that the block had taken."""

    instance: str
    buffer: str
    offset: int
    size: int
    ending: str
    prefix: int = 0
    suffix: int = 0
    number: int = 0


class PartialFrameDropped(NamedTuple):
    """A partial frame was dropped. It is shown as `incomplete, 2 bytes, connection closed`."""

    instance: str
    buffer: str
    offset: int
    size: int
    reason: str


class NoiseDropped(NamedTuple):
    """Bytes before a prefix were dropped, from `offset` on. `total` counts all noise since the start."""

    instance: str
    buffer: str
    size: int
    total: int
    offset: int = 0


class FeederHold(NamedTuple):
    """EN_R of the TRCV_C that feeds a full ComBuffer is set to 0 from now on, or is no longer set to 0."""

    buffer: str
    held: bool


SerialNote = BytesBuffered | BufferBytesLost | FrameEnded | PartialFrameDropped | NoiseDropped | FeederHold


class ReceiveStarted(NamedTuple):
    """A receive job began. A static job needs `length` bytes, an ad-hoc job takes at most `length`."""

    instance: str
    job: int
    connection: str
    incarnation: int
    offset: int
    length: int
    adhoc: bool


class ModeChanged(NamedTuple):
    """The running receive job has become ad-hoc, or static."""

    instance: str
    job: int
    adhoc: bool


class ReceiveEnded(NamedTuple):
    """A receive job ended. If `done`, `size` bytes of the stream went to DATA, from `offset` on.

    These bytes are contiguous unless a job of another priority has read in between: see BytesReceived.
    """

    instance: str
    job: int
    connection: str
    incarnation: int
    offset: int
    size: int
    done: bool
    reason: str


class SendStarted(NamedTuple):
    """A send job of `length` bytes began, after `offset` bytes of this incarnation of the connection."""

    instance: str
    job: int
    connection: str
    incarnation: int
    offset: int
    length: int


class SendEnded(NamedTuple):
    """A send job ended. The stack took `size` bytes from `offset` on; if `done`, all bytes of the job."""

    instance: str
    job: int
    connection: str
    incarnation: int
    offset: int
    size: int
    done: bool
    reason: str


JobNote = ReceiveStarted | ModeChanged | ReceiveEnded | SendStarted | SendEnded | SerialNote


class Environment(Struct):
    """What all blocks of one PLC share. `scan` and `now` are the number and time (ns) of the running scan.

    `write` puts a note into the ledger.
    """

    rules: VendorRules
    resources: Resources
    write: Callable[[JobNote], None]
    scan: int = 0
    now: int = 0
