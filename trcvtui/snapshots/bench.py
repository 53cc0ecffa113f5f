"""What a bench says beside its PLC: answers to lines, punctuality, triggers."""

from __future__ import annotations

from msgspec import Struct


class Answer(Struct, frozen=True):
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

    `late_by_picture`: so many scans were late because of a picture.
    """

    scans: int = 0
    overruns: int = 0
    late_p50_ns: int = 0
    late_p99_ns: int = 0
    scan_p99_ns: int = 0
    mode: str = ""
    late_by_picture: int = 0


class TriggerEvent(Struct, frozen=True):
    """A trigger that has fired, and in which scan; `number` counts them on this bench from 1."""

    number: int
    text: str
    scan: int
    t_ns: int
    holds: bool = False
