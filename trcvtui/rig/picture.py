"""What the screen gets when it asks the engine: one frozen picture; and the few words it may say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from trcvtui.blocks.serial.recording import Recording
from trcvtui.plc.ledger import Line
from trcvtui.plc.snapshot import Snapshot
from trcvtui.rig.facts import Facts, Fired
from trcvtui.rig.history_window import HistoryRequest, HistoryWindow
from trcvtui.rig.wave_news import WaveNews

if TYPE_CHECKING:  # the screen's process starts the engine before it knows what a project is
    from trcvtui.plc.project import Project

TO_COME, NOW, DONE, HELD, FAILED = "to come", "now", "done", "held", "failed"


@dataclass(frozen=True, slots=True)
class PictureRequest:
    """What the screen wants: the ledger's news after `since_seq`, the bytes of these variables and jobs.

    `waves` are the instances whose pins are drawn over time, with the number of the last change it knows.
    `bench` and `project` are the numbers of those that the screen knows, as the last picture told them.
    """

    since_seq: int = 0
    data: tuple[str, ...] = ()
    partial_of: tuple[str, ...] = ()
    most_lines: int = 2000
    bench: int = 0
    project: int = 0
    waves: tuple[tuple[str, int], ...] = ()
    history: HistoryRequest | None = None
    recordings_of: tuple[str, ...] = ()  # ComBuffers


@dataclass(frozen=True, slots=True)
class ReplySnapshot:
    """A reply rule as `replies` of a project has it; `missed` are hits of a flood that were not answered."""

    rule: str
    hits: int
    missed: int = 0


@dataclass(frozen=True, slots=True)
class Tally:
    """What a receiver of checked frames has seen; `shifts` are places where the stream lost its beat."""

    frames: int
    lost: int
    doubled: int
    shifts: int
    strange: int  # bytes that were no frame

    @property
    def is_good(self) -> bool:
        """Return whether nothing is wrong."""
        return not (self.lost or self.doubled or self.shifts)


@dataclass(frozen=True, slots=True)
class CheckSnapshot:
    """Self-checking traffic: frames sent, what DATA has shown of them, and what has come back."""

    sent: int
    data: Tally | None
    echo: Tally


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
    received_here: int = 0  # on the current or last connection
    udp: bool = False
    replies: tuple[ReplySnapshot, ...] = ()
    link: str = ""  # the CONNECT that it talks to, "" where none is known
    silent: bool = False  # that wire is down
    check: CheckSnapshot | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """What became of one submitted line: `error` is empty when it was taken; `told` is more than "done"."""

    number: int
    line: str
    error: str
    told: str = ""


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
class StepSnapshot:
    """One step of a scenario: its number (0: a command of `start`), its line, its state, what was found."""

    number: int
    line: str
    state: str
    found: str = ""


@dataclass(frozen=True, slots=True)
class PlayerSnapshot:
    """How far a scenario has been played.

    `current` is the place in `steps` of the one that runs or comes next; `scans_of_step` count in that one.
    `traces` are the newest STATUS runs of each instance.
    """

    path: str
    scenario: str
    about: str
    steps: tuple[StepSnapshot, ...]
    current: int
    running: bool
    finished: bool
    scans_of_step: int
    traces: tuple[tuple[str, str], ...]

    @property
    def failed(self) -> tuple[StepSnapshot, ...]:
        """Return the steps that failed."""
        return tuple(step for step in self.steps if step.state == FAILED)


@dataclass(frozen=True, slots=True)
class SplitRow:
    """What cuts `first` to `last` (0: the whole message) have come to; `same`: as the whole message.

    `walk` is the STATUS walk in the notation of a trace, `lengths` the RCVD_LEN of each DONE.
    """

    first: int
    last: int
    walk: str
    done: int
    lengths: str
    data_equal: bool
    same: bool

    def span(self) -> str:
        """Return the cuts of this row."""
        if not self.last:
            return "whole"
        return f"{self.first}" if self.first == self.last else f"{self.first}-{self.last}"


@dataclass(frozen=True, slots=True)
class TrialSnapshot:
    """How far `try-splits` has come; `state` is running, finished, cancelled or failed."""

    peer: str
    instance: str
    payload: bytes
    gap_ns: int
    state: str
    problem: str
    runs: int
    differing: int
    rows: tuple[SplitRow, ...]

    def summary(self) -> str:
        """Return in one line what it has come to."""
        splits = max(0, self.runs - 1)
        if self.problem:
            return f"{self.state}: {self.problem}"
        if self.state == "finished" and not self.differing:
            return f"all {splits} splits end as the whole message does"
        verdict = f"{self.differing} of {splits} splits differ from the whole message"
        return verdict if self.state == "finished" else f"{self.state}, {verdict} so far"


@dataclass(frozen=True, slots=True)
class Picture:
    """The bench after its last scan. `holding` is True while no scans pass.

    `bench` counts the fresh benches, `project_number` what its project has become; `project` comes only where
    the screen does not know it yet. `player` is there while a scenario is loaded, `trial` from the first
    `try-splits` on. `facts` come of the instances
    in `partial_of`. `armed` is the trigger that is waited for; with `fired` this is the picture of the very
    scan in which one fired, and the PLC has gone on since.
    """

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
    bench: int = 0
    project_number: int = 0
    project: Project | None = None
    player: PlayerSnapshot | None = None
    trial: TrialSnapshot | None = None
    waves: tuple[WaveNews, ...] = ()
    history: HistoryWindow | None = None
    unsaved: int = 0  # edits of the project that are in no file
    unsaved_word: str = "addition"
    facts: tuple[tuple[str, Facts], ...] = ()
    armed: str = ""
    fired: Fired | None = None
    recordings: tuple[
        tuple[str, Recording], ...
    ] = ()  # of the ComBuffers that were asked for, up to 64 KiB each
