"""Snapshots of a bench: answers to command lines, punctuality, triggers, peers and their checks."""

from __future__ import annotations

from msgspec import Struct


class LineAnswer(Struct, frozen=True):
    """The answer to one line. On success `error` is empty. `message` is a result beyond "done".

    If the line has changed the program and not only inputs, `edit` is the line with all its values.
    """

    number: int
    line: str
    error: str
    message: str = ""
    edit: str = ""


class EngineTiming(Struct, frozen=True):
    """How punctual the scans are. Times are in ns. `mode` names what the operating system granted.

    `late_ns` is how late the latest start was. After 10 good seconds, `overruns` and `late_ns` are 0 again.
    `late_by_picture` is the number of scans that a picture has delayed.
    """

    scans: int = 0
    overruns: int = 0
    late_ns: int = 0
    mode: str = ""
    late_by_picture: int = 0


class TriggerEvent(Struct, frozen=True):
    """A trigger that has fired in `scan`; `number` counts from 1 on each bench."""

    number: int
    text: str
    scan: int
    t_ns: int
    holds: bool = False


class ReplyRuleSnapshot(Struct, frozen=True):
    """A reply rule as in `replies` of a project. `missed` counts matches without room for a reply."""

    rule: str
    hits: int
    missed: int = 0


class TrafficCheckTally(Struct, frozen=True):
    """Counters of a receiver of checked frames. `shifts` counts how often no frame began where expected."""

    frames: int
    lost: int
    doubled: int
    shifts: int
    strange: int  # bytes outside frames

    @property
    def is_good(self) -> bool:
        return not (self.lost or self.doubled or self.shifts)


class TrafficCheckSnapshot(Struct, frozen=True):
    """Self-checking traffic: frames sent, and tallies of the frames in DATA and of the returned frames."""

    sent: int
    data: TrafficCheckTally | None
    echo: TrafficCheckTally


class SentMessage(Struct, frozen=True, array_like=True):
    """A message that a peer has sent: its number (from 1), size in bytes, and first bytes."""

    number: int
    size: int
    begin: bytes


class PeerSnapshot(Struct, frozen=True):
    """One peer. `state` is closed, listening, connecting, connected, reset or refused; counters in bytes."""

    name: str
    active: bool
    state: str
    local: str
    remote: str
    stalled: bool
    messages_sent: int
    bytes_sent: int
    bytes_received: int
    pending: int
    last_received: bytes
    received_here: int = 0  # on the current or last connection
    udp: bool = False
    replies: tuple[ReplyRuleSnapshot, ...] = ()
    link: str = ""  # the CONNECT of its connection, "" if unknown
    silent: bool = False  # the wire of `link` is down
    check: TrafficCheckSnapshot | None = None
    last_sent: tuple[SentMessage, ...] = ()  # the newest first
