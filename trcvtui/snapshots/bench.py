"""What a bench says beside its PLC: answers to lines, punctuality, triggers, peers and their checks."""

from __future__ import annotations

from msgspec import Struct


class LineAnswer(Struct, frozen=True):
    """What became of one submitted line: `error` is empty when it was taken; `told` is more than "done".

    `edit`: the line, with what it was given, where it has changed the program and not inputs alone.
    """

    number: int
    line: str
    error: str
    told: str = ""
    edit: str = ""


class EngineTiming(Struct, frozen=True):
    """How punctual the scans are. Times in ns; `mode` names what the operating system granted.

    `overruns` and the latest start are those of a bad time, 0 after 10 good seconds.
    `late_by_picture`: so many scans were late because of a picture.
    """

    scans: int = 0
    overruns: int = 0
    late_ns: int = 0
    mode: str = ""
    late_by_picture: int = 0


class TriggerEvent(Struct, frozen=True):
    """A trigger that has fired, and in which scan; `number` counts them on this bench from 1."""

    number: int
    text: str
    scan: int
    t_ns: int
    holds: bool = False


class ReplySnapshot(Struct, frozen=True):
    """A reply rule as `replies` of a project has it; `missed` are hits of a flood that were not answered."""

    rule: str
    hits: int
    missed: int = 0


class CheckTally(Struct, frozen=True):
    """What a receiver of checked frames has seen; `shifts` are places where the stream lost its beat."""

    frames: int
    lost: int
    doubled: int
    shifts: int
    strange: int  # bytes that were no frame

    @property
    def is_good(self) -> bool:
        return not (self.lost or self.doubled or self.shifts)


class CheckSnapshot(Struct, frozen=True):
    """Self-checking traffic: frames sent, what DATA has shown of them, and what has come back."""

    sent: int
    data: CheckTally | None
    echo: CheckTally


class SentMessage(Struct, frozen=True, array_like=True):
    """A message that a peer has sent: its number (from 1), size, and what it begins with."""

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
    replies: tuple[ReplySnapshot, ...] = ()
    link: str = ""  # the CONNECT that it talks to, "" where none is known
    silent: bool = False  # that wire is down
    check: CheckSnapshot | None = None
    last_sent: tuple[SentMessage, ...] = ()  # the newest first
