"""Runs a script on a bench without a stop: its steps in order, every scan observed, one verdict.

Bounds: MOST_ERRORS different ERRORs (the oldest are dropped first), NEWEST_ERRORS of them at a failed step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

from msgspec import Struct
from msgspec.structs import replace

from trcvtui.bench.bench import Bench
from trcvtui.blocks.outcome import Cause
from trcvtui.blocks.table import block_row
from trcvtui.commands import words
from trcvtui.plc.ledger import StatusEdge
from trcvtui.scenario.step_runner import Failure, StepRunner

if TYPE_CHECKING:
    from trcvtui.bench.doctor_requests import Judge

MOST_ERRORS: Final = 100
NEWEST_ERRORS: Final = 5


class ErrorSummary(Struct, frozen=True):
    """One cause of ERROR at one instance: STATUS, first and last scan, and how often the ERROR came."""

    instance: str
    status: int
    text: str
    scan: int
    last: int
    times: int = 1

    def __str__(self) -> str:
        """Return a text such as `TRCV_C_1 80C5 in scan 12: the partner closed ...`."""
        when = f"in scan {self.scan}"
        if self.times > 1:
            when = f"{self.times} times in scans {self.scan} to {self.last}"
        return f"{self.instance} {self.status:04X} {when}: {self.text}"


class ErrorSummaries:
    def __init__(self) -> None:
        self._summaries: dict[tuple[str, int, str], ErrorSummary] = {}

    def add_errors(self, scan: int, changed: Iterable[StatusEdge]) -> None:
        for edge in changed:
            if not edge.outputs.error:
                continue
            new = ErrorSummary(
                edge.instance, edge.outputs.status, _explain(edge.cause, edge.block), scan, scan
            )
            key = new.instance, new.status, new.text
            known = self._summaries.get(key)
            self._summaries[key] = new if known is None else replace(known, last=scan, times=known.times + 1)
            if len(self._summaries) > MOST_ERRORS:
                del self._summaries[next(iter(self._summaries))]

    def list_all(self) -> tuple[ErrorSummary, ...]:
        return tuple(self._summaries.values())

    def list_newest(self) -> tuple[ErrorSummary, ...]:
        return tuple(sorted(self._summaries.values(), key=lambda each: each.last)[-NEWEST_ERRORS:])


def cause_record(cause: Cause, block: str) -> dict[str, object]:
    """Return a cause as an object of JSON; a part that the cause does not have is null."""
    return {
        "text": _explain(cause, block),
        "call": cause.kernel_call or None,
        "errno": cause.errno or None,
        "peer": cause.peer or None,
        "injected": cause.injected,
    }


class SentCounts(NamedTuple):
    """Counts of the bytes sent on a CONNECT's present connection since the connection began.

    The local stack took `accepted` bytes. The partner's stack has not acknowledged `unacknowledged` of
    them (None: unknown). The partner's program has read `read_by_peer` (None: no peer of this bench).
    """

    accepted: int
    unacknowledged: int | None
    read_by_peer: int | None


NO_DELIVERIES: Final[Mapping[str, SentCounts]] = {}


def count_sent_bytes(bench: Bench, changed: Iterable[StatusEdge]) -> Mapping[str, SentCounts]:
    """Return the counts for each instance that shows DONE of a send in this scan."""
    return {
        edge.instance: found
        for edge in changed
        if edge.outputs.done
        and block_row(edge.block).sends_stream
        and (found := _read_sent_counts(bench, edge.instance)) is not None
    }


def _read_sent_counts(bench: Bench, instance: str) -> SentCounts | None:
    decl = bench.project.instance(instance)
    sent = bench.runtime.sent_count(decl.connect) if decl is not None else None
    if sent is None:
        return None
    read = [
        peer.received_here
        for peer in (peer.snapshot() for peer in bench.peers.values())
        if peer.state == "connected" and (peer.local, peer.remote) == (sent.remote, sent.local)
    ]
    return SentCounts(sent.accepted, sent.unacknowledged, read[0] if read else None)


class StepResult(Struct, frozen=True):
    """One step that was carried out: when it ended, in ns of the run, and its failure."""

    step: words.Step
    until_ns: int
    failure: Failure | None
    errors: tuple[ErrorSummary, ...] = ()  # if it failed: the newest ones before that
    answer: str = ""  # the answer of the doctor


class Verdict(Struct, frozen=True):
    """How one scenario ended. `traces` has the STATUS of each instance over the whole scenario.

    `taken` has the steps that were carried out, none after a failed `wait`. `errors` has the oldest first.
    """

    scenario: str
    scans: int
    failures: tuple[Failure, ...]
    traces: tuple[tuple[str, str], ...]
    taken: tuple[StepResult, ...]
    errors: tuple[ErrorSummary, ...] = ()
    late_scans: int = 0

    @property
    def has_passed(self) -> bool:
        return not self.failures


class Pace(Protocol):
    """Decides when the next scan begins: at once in virtual time, or by the clock."""

    def next_scan(self, bench: Bench) -> None: ...


class VirtualPace:
    """Scans follow each other at once, at the multiples of the interval."""

    def next_scan(self, bench: Bench) -> None:
        bench.step()


class ScenarioRunner:
    """One scenario on one bench. `on_scan` gets the changes of each scan, and the deliveries."""

    def __init__(
        self,
        bench: Bench,
        name: str,
        pace: Pace,
        on_scan: Callable[[int, Iterable[StatusEdge], Mapping[str, SentCounts]], None],
        judge: Judge | None = None,
    ) -> None:
        self._bench = bench
        self._name = name
        self._pace = pace
        self._on_scan = on_scan
        self._stage = StepRunner(bench)
        self._stage.judge = judge
        self._taken: list[StepResult] = []
        self._errors = ErrorSummaries()

    def play(self, steps: Iterable[words.Step]) -> Verdict:
        """Carry out the steps in order; a failed `wait` ends the file."""
        for step in steps:
            for _ in self._stage.run_step(step):
                self._scan()
            failure = self._stage.failure or self._find_internal_error(step)
            errors = self._errors.list_newest() if failure is not None else ()
            self._taken.append(
                StepResult(step, self._stage.scans_end_ns, failure, errors, self._stage.answer)
            )
            if self._stage.is_over:
                break
        return Verdict(
            self._name,
            self._bench.runtime.scans,
            tuple(taken.failure for taken in self._taken if taken.failure is not None),
            tuple((name, str(trace)) for name, trace in self._stage.traces.items()),
            tuple(self._taken),
            self._errors.list_all(),
            self._bench.late_scans,
        )

    def _find_internal_error(self, step: words.Step) -> Failure | None:
        found = self._bench.containment.take_messages()
        return Failure(step.number, step.line, found) if found else None

    def _scan(self) -> None:
        runtime = self._bench.runtime
        self._pace.next_scan(self._bench)
        self._stage.note_scan()
        if runtime.changed:
            self._errors.add_errors(runtime.scans, runtime.changed)
            self._on_scan(runtime.scans, runtime.changed, count_sent_bytes(self._bench, runtime.changed))


def _explain(cause: Cause, block: str) -> str:
    from trcvtui.diagnosis.advice import describe_cause  # loads all advice: only an ERROR needs it

    return describe_cause(cause, block)
