"""The doctor of a bench: when it judges a run, and how `doctor` lines wait for its findings.

Rule: another process judges (diagnosis/doctor_process.py). Its bounded answer is read between two scans.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Final, Protocol

import msgspec
from msgspec.structs import replace

from trcvtui import clock
from trcvtui.commands.words import AskDoctor
from trcvtui.errors import UserError, mistake
from trcvtui.plc.snapshot import ConnectionSnapshot
from trcvtui.project.project import Project
from trcvtui.snapshots.bench import LineAnswer
from trcvtui.snapshots.doctor import DoctorSnapshot, Ends, Finding
from trcvtui.wording import count

if TYPE_CHECKING:
    from trcvtui.bench.bench import Bench

LOOK_PAUSE_NS: Final = 3_000_000_000  # between two looks while the card is open
REST_FACTOR: Final = 5  # between two looks it rests this many times the last look's duration
HEALTHY: Final = "healthy"
NOT_KEPT_TEXT: Final = 'this run is not kept; the doctor needs [options] black_box = "on", or `--record`'


class Judge(Protocol):
    """A process that judges the run and puts its findings into `result_json`."""

    result_json: bytes
    progress: str  # in plain words, "": none yet
    looks_again: bool  # whether the run continues, so that a later look may find more

    @property
    def is_judging(self) -> bool: ...

    def start_judging(self) -> None:
        """Start the judging process; raise UserError if there is nothing to judge."""

    def poll_process(self) -> None:
        """Find out whether the process has ended."""


class BenchDoctor:
    """Gets findings from a judge, for the card and for `doctor` lines at the prompt."""

    def __init__(self) -> None:
        self.snapshot = DoctorSnapshot()
        self._waiting: list[tuple[int, str, AskDoctor]] = []
        self._began_ns = self._ended_ns = self._took_ns = 0
        self._scan = 0
        self._looks = False

    def ask(self, judge: Judge, bench: Bench, number: int, line: str, command: AskDoctor) -> str:
        """Start the judge if needed. Return the text to show until `advance` returns the answer."""
        if judge.looks_again or not self.snapshot.looks:
            self._start_judging(judge, bench)
        self._waiting.append((number, line, command))
        return "the doctor looks …"

    def _start_judging(self, judge: Judge, bench: Bench) -> None:
        if judge.is_judging:
            return
        try:
            judge.start_judging()
        except OSError as failed:
            raise mistake("doctor", failed.strerror, "room for one more process and file") from None
        self._began_ns, self._scan, self._looks = clock.now_ns(), bench.runtime.scans, True

    def _try_judging(self, judge: Judge, bench: Bench) -> None:
        """Start the judge. If that raises UserError, put the reason into `trouble` of the snapshot."""
        try:
            self._start_judging(judge, bench)
        except UserError as refused:
            looks, scan = self.snapshot.looks + 1, bench.runtime.scans
            self.snapshot = DoctorSnapshot(looks, scan, trouble=refused.problems[0].found)
            self._ended_ns = clock.now_ns()

    def advance(self, judge: Judge | None, bench: Bench, is_wanted: bool) -> Iterable[LineAnswer]:
        """Read the result. If `is_wanted`, start the judge when due. Answer waiting `doctor` lines."""
        if judge is None:
            if is_wanted:
                self.snapshot = DoctorSnapshot(1, trouble=NOT_KEPT_TEXT)
            return ()
        if self._looks:
            judge.poll_process()
            seconds = (clock.now_ns() - self._began_ns) // 500_000_000 / 2
            self.snapshot = replace(self.snapshot, progress=f"{seconds:.1f} s: {judge.progress}".rstrip(": "))
            if not judge.is_judging:
                self._accept_result(judge.result_json, bench)
        if is_wanted and not self._looks and self._is_due(judge):
            self._try_judging(judge, bench)
        if self._looks or not self._waiting:
            return ()
        seen, project = self.snapshot, bench.project
        answers = [
            LineAnswer(number, line, *answer_command(each, seen, project))
            for number, line, each in self._waiting
        ]
        self._waiting.clear()
        return answers

    def _is_due(self, judge: Judge) -> bool:
        rests_until = self._ended_ns + max(LOOK_PAUSE_NS, REST_FACTOR * self._took_ns)
        return not self.snapshot.looks or (judge.looks_again and clock.now_ns() >= rests_until)

    def _accept_result(self, content: bytes, bench: Bench) -> None:
        self._looks, self._ended_ns = False, clock.now_ns()
        self._took_ns = self._ended_ns - self._began_ns
        connections = bench.runtime.snapshot().connections
        self.snapshot = read_result(content, bench.project, connections, self.snapshot.looks + 1, self._scan)


def read_result(
    content: bytes, project: Project, connections: Sequence[ConnectionSnapshot], looks: int, scan: int
) -> DoctorSnapshot:
    """Return a judge's result, each finding with its CONNECT."""
    try:
        result = msgspec.json.decode(content, type=DoctorSnapshot)
    except msgspec.MsgspecError:
        return DoctorSnapshot(looks, scan, trouble="the doctor's process has ended")

    def with_connect(one: Finding) -> Finding:
        decl = project.instance(one.instance)
        connect = decl.connect if decl is not None else _connect_of(one.ends, connections)
        return replace(one, connect=connect)

    findings, remarks = (tuple(map(with_connect, some)) for some in (result.findings, result.remarks))
    return replace(result, looks=looks, scan=scan, findings=findings, remarks=remarks)


def _connect_of(ends: Ends | None, connections: Sequence[ConnectionSnapshot]) -> str:
    if ends is None:
        return ""
    tests: tuple[Callable[[ConnectionSnapshot], bool], ...] = (
        lambda link: ends.plc == link.local or ends.partner == link.remote,
        lambda link: (
            _port(ends.partner if link.active else ends.plc)
            == _port(link.remote if link.active else link.local)
        ),
        lambda link: len(connections) == 1,
    )
    return next((link.name for fits in tests for link in connections if fits(link)), "")


def _port(end: str) -> str:
    return end.rpartition(":")[2]


def answer_command(command: AskDoctor, seen: DoctorSnapshot, project: Project) -> tuple[str, str]:
    """Return an error text or "", and a text with the findings on an instance, on a CONNECT, or all."""
    if seen.trouble:
        return seen.trouble, ""
    some = findings_of(command.name, seen.findings, project)
    texts = [text for one in some for text in finding_lines(one)]
    findings = "\n".join(texts) or f"{HEALTHY}: {count(seen.conversations, 'conversation')} looked at"
    first = some[0].cause if some else HEALTHY
    wrong = f"{first}, expected {command.cause}" if command.cause and first != command.cause else ""
    return wrong, findings


def findings_of(name: str, findings: Iterable[Finding], project: Project) -> tuple[Finding, ...]:
    """Return the findings of an instance or a CONNECT ("": all), and those that have no CONNECT."""
    decl = project.instance(name)
    connect = decl.connect if decl is not None else name
    return tuple(
        [
            one
            for one in findings
            if not name or (one.connect in ("", connect) and (decl is None or one.instance in ("", name)))
        ]
    )


def finding_lines(one: Finding) -> list[str]:
    subject = one.instance or one.connect
    lines = [f"{one.cause} ({one.confidence:.0%} sure)" + (f", {subject}" if subject else "")]
    lines += [f"  {text}" for text in one.evidence]
    lines += [f"  explains: {text}" for text in one.explains]
    return lines + [f"  {mend.display_line}" for mend in one.mend]
