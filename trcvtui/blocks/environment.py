"""What a block may know besides its pins: the scan, its time, the vendor's rules, the PLC's resources."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from trcvtui.blocks.rules import Rules
from trcvtui.blocks.serial_events import SerialNote
from trcvtui.net.connection.resources import Resources


class JobStarted(NamedTuple):
    """A receive job began; `length` is what it wants (static) or its limit (ad-hoc), in bytes."""

    instance: str
    job: int
    connection: str
    incarnation: int
    offset: int
    length: int
    adhoc: bool


class JobEnded(NamedTuple):
    """A receive job ended; `size` bytes of the stream, from `offset` on, went to DATA when `done`.

    They follow each other, unless a job of another priority has read in between: BytesReceived says whose.
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
    """A send job of `length` bytes began; `offset` is in the stream that this incarnation has sent."""

    instance: str
    job: int
    connection: str
    incarnation: int
    offset: int
    length: int


class SendEnded(NamedTuple):
    """A send job ended; the local stack has `size` bytes of it, from `offset` on; all of them when `done`."""

    instance: str
    job: int
    connection: str
    incarnation: int
    offset: int
    size: int
    done: bool
    reason: str


JobNote = JobStarted | JobEnded | SendStarted | SendEnded | SerialNote


@dataclass(slots=True)
class Environment:
    """The surroundings of every block of one PLC; `scan` and `now` (ns) are those of the running scan.

    `write` puts a note into the ledger.
    """

    rules: Rules
    resources: Resources
    write: Callable[[JobNote], None]
    scan: int = 0
    now: int = 0
