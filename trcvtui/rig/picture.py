"""What the screen gets when it asks the engine: one frozen picture; and the few words it may say."""

from __future__ import annotations

from dataclasses import dataclass

from trcvtui.plc.ledger import Line
from trcvtui.plc.snapshot import Snapshot


@dataclass(frozen=True, slots=True)
class PictureRequest:
    """What the screen wants: the ledger's news after `since_seq`, the bytes of these variables and jobs."""

    since_seq: int = 0
    data: tuple[str, ...] = ()
    partial_of: tuple[str, ...] = ()
    most_lines: int = 2000


@dataclass(frozen=True, slots=True)
class PeerSnapshot:
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


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of one submitted line: `error` is empty when it was taken."""

    number: int
    line: str
    error: str


@dataclass(frozen=True, slots=True)
class EngineTiming:
    """How punctual the scans are. Times in ns; `mode` names what the operating system granted."""

    scans: int = 0
    overruns: int = 0
    late_p50_ns: int = 0
    late_p99_ns: int = 0
    scan_p99_ns: int = 0
    mode: str = ""


@dataclass(frozen=True, slots=True)
class Picture:
    """The bench after its last scan. `holding` is True while no scans pass."""

    snapshot: Snapshot
    lines: tuple[Line, ...]
    lines_skipped: int
    data: tuple[tuple[str, bytes], ...]
    partial: tuple[tuple[str, bytes], ...]
    peers: tuple[PeerSnapshot, ...]
    answers: tuple[Answer, ...]
    timing: EngineTiming
    holding: bool
    kernel: str
