"""What the doctor has found."""

from __future__ import annotations

from typing import NamedTuple

from msgspec import Struct


class RemedySnapshot(NamedTuple):
    """What mends a finding: in words, as a bench command, as `--set` of a what-if, "": there is none.

    One that was not tried on the evidence is advice.
    """

    text: str
    command: str = ""
    set: str = ""
    is_tried: bool = False


class FindingSnapshot(Struct, frozen=True):
    """One cause that the doctor has found: how sure, of which CONNECT and instance ("": of no one alone).

    `ends`: the conversation, `way` to-plc, from-plc or "". When in the run, in which scan, at which byte of
    the direction, None: unknown.
    `title`: the cause in plain words; `status`: STATUS words that it leads to; `packets`: numbers in the
    capture, `filter`: a display filter of Wireshark; `explains`: symptoms of blocks. A remark is one, too.
    """

    cause: str
    confidence: float
    connect: str
    instance: str
    ends: str
    way: str
    t_ns: int | None
    scan: int | None
    byte: int | None
    evidence: tuple[str, ...]
    mends: tuple[RemedySnapshot, ...]
    title: str = ""
    status: tuple[str, ...] = ()
    packets: tuple[int, ...] = ()
    filter: str = ""
    explains: tuple[str, ...] = ()


class DoctorSnapshot(Struct, frozen=True):
    """What the doctor has found, the surest first; it looked so often, last at the run up to `scan`."""

    looks: int = 0
    scan: int = 0
    conversations: int = 0
    findings: tuple[FindingSnapshot, ...] = ()
    trouble: str = ""
    progress: str = ""  # while it looks: "4.5 s: reads night.pcapng: 40%"
    remarks: tuple[FindingSnapshot, ...] = ()  # worth knowing, and no fault
    qualities: tuple[str, ...] = ()  # what the captures lack, as it is shown
