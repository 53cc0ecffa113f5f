"""What stands around the PLC, frozen for the screen: peers, checks, played steps, split tests, triggers."""

from __future__ import annotations

from typing import Final, NamedTuple

from msgspec import Struct

TAP, ARMED_TAP = "tap", "armed tap"  # the `kernel` of a tap's screen; armed: its keys act without a question
TO_COME, NOW, DONE, HELD, FAILED = "to come", "now", "done", "held", "failed"


class ReplySnapshot(Struct, frozen=True):
    """A reply rule as `replies` of a project has it; `missed` are hits of a flood that were not answered."""

    rule: str
    hits: int
    missed: int = 0


class DirectionSnapshot(Struct, frozen=True):
    """One direction of a conversation of others: counters; `rate` in bytes a second, of the last second.

    `held`: bytes that a tap holds back, None: it lets them go; `first`: the first of these; `held_ns`: for
    how long it has held back.
    `round_trip_ns` and `window` of who receives, as the stack of a tap knows them; None: unknown.
    """

    size: int
    rate: int
    segments: int
    again: int  # bytes that were sent again
    missing: int
    is_closed: bool  # who receives has told a window of 0
    held: int | None = None
    first: bytes = b""
    round_trip_ns: int | None = None
    window: int | None = None
    held_ns: int = 0


class ConversationSnapshot(Struct, frozen=True):
    """A conversation of others. `tap` is the tap that it goes through, "" for one that is only watched.

    `seconds`: bytes of both directions in each of the newest seconds.
    `handshake_ns`: from SYN to the ACK of its answer.
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
        """Return for how long a tap has held back one of its directions, the longer time; None: neither."""
        return max((w.held_ns for w in (self.to_plc, self.from_plc) if w.held is not None), default=None)


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


class StepSnapshot(Struct, frozen=True):
    """One step of a scenario: its number (0: a command of `start`), its line, its state, what was found."""

    number: int
    line: str
    state: str
    found: str = ""


class PlayerSnapshot(Struct, frozen=True):
    """How far a scenario has been played.

    `current` is the place in `steps` of the one that runs or comes next; `scans_of_step` count in that one.
    `traces` are the newest STATUS runs of each instance.
    """

    path: str
    steps: tuple[StepSnapshot, ...]
    current: int
    running: bool
    finished: bool
    scans_of_step: int
    traces: tuple[tuple[str, str], ...]

    @property
    def failed(self) -> tuple[StepSnapshot, ...]:
        return tuple(step for step in self.steps if step.state == FAILED)


class SplitRow(Struct, frozen=True):
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
        if not self.last:
            return "whole"
        return f"{self.first}" if self.first == self.last else f"{self.first}-{self.last}"


class TrialSnapshot(Struct, frozen=True):
    """How far `try-splits` has come; `state` is running, finished, cancelled or failed."""

    peer: str
    instance: str
    payload: bytes
    state: str
    problem: str
    runs: int
    differing: int
    rows: tuple[SplitRow, ...]

    def summary(self) -> str:
        splits = max(0, self.runs - 1)
        if self.problem:
            return f"{self.state}: {self.problem}"
        if self.state == "finished" and not self.differing:
            return f"all {splits} splits end as the whole message does"
        verdict = f"{self.differing} of {splits} splits differ from the whole message"
        return verdict if self.state == "finished" else f"{self.state}, {verdict} so far"


class TriggerEvent(Struct, frozen=True):
    """A trigger that has fired, and in which scan; `number` counts them on this bench from 1."""

    number: int
    text: str
    scan: int
    t_ns: int
    holds: bool = False


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


CANNOT: Final = "a recording cannot be changed: W tries another value"
BESIDE: Final = "what-if "  # before the name of an instance: the same one in a run with another parameter


class Position(Struct, frozen=True):
    """Where a replay stands in its recording. `last_scan` is known for sure once the recording `is_read`.

    `wanted` is the scan that it goes to, times are ns of the run; `marks` has 1 for each piece of the run in
    which an ERROR comes, 0 for the others. `what_if` is what there is to say of a run with another parameter;
    it parts from the recorded one in scan `parts_at`, 0: nowhere yet.
    """

    scan: int
    last_scan: int
    t_ns: int
    last_t_ns: int
    is_read: bool
    wanted: int
    speed: str
    errors: int
    marks: bytes
    first: int = 0  # the scan before those that are in it
    note: str = ""
    what_if: tuple[str, ...] = ()
    parts_at: int = 0
    first_ns: int | None = None  # UTC of time 0, where it is that of a capture
    beside: tuple[str, ...] = ()  # what is told of the capture
