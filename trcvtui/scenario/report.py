"""All formats of scenario results: text, JSON lines, one JUnit XML document."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

from msgspec import Struct

from trcvtui.commands.words import AskDoctor, Expect, ExpectTrace, Step, Wait
from trcvtui.errors import UserError, one_line
from trcvtui.plc.ledger import StatusEdge
from trcvtui.scenario.runner import NO_DELIVERIES, SentCounts, StepResult, Verdict, cause_record
from trcvtui.scenario.scenario import START_STEP, Scenario
from trcvtui.scenario.step_runner import Failure
from trcvtui.wording import json_text

# Rules of JUnit XML: each expectation is a test case. The document is ASCII without control characters, so it
# is well-formed in any encoding, whatever a partner sent. A case has the time since the case before it, so
# that the times add up. It has only results (no clock, no host): a simulated run gives the same bytes twice.

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

    from trcvtui.bench.bench import Bench

Write = Callable[[str], object]

LONGEST_NAME: Final = 120  # GitLab keeps 255 characters; the failure has the whole line
WHOLE_CASE_NAME: Final = "the scenario runs to its end"
NOT_REACHED_TEXT: Final = "not reached: an earlier wait failed"


class JunitCase(Struct, frozen=True):
    """One test case. `outcome` is "", failure, error or skipped. `kind`, `message`, `text` say why."""

    name: str
    ns: int = 0
    outcome: str = ""
    kind: str = ""
    message: str = ""
    text: str = ""


class JunitSuite(Struct, frozen=True):
    """One file: its path as it was given, the scenario's name, its cases, its traces."""

    path: str
    scenario: str
    cases: tuple[JunitCase, ...]
    output: tuple[str, ...] = ()

    @property
    def ns(self) -> int:
        return sum(case.ns for case in self.cases)

    def count(self, outcome: str) -> int:
        return sum(case.outcome == outcome for case in self.cases)


class Report:
    """The report of one command. Methods are called file by file; this base class writes nothing."""

    def __init__(self, write: Write) -> None:
        self._write = write

    def begin_file(self, path: Path, scenario: Scenario, bench: Bench) -> None:
        """Begin a file that is about to run."""

    def write_scan(
        self, scan: int, changed: Iterable[StatusEdge], deliveries: Mapping[str, SentCounts] = NO_DELIVERIES
    ) -> None:
        """Write the outputs that changed in a scan, and the deliveries of instances with DONE."""

    def write_verdict(self, verdict: Verdict) -> None:
        """Write the result of a scenario."""

    def write_error(self, path: Path, error: UserError) -> None:
        """Write that a file could not run, or could not run to its end. stderr also shows the mistakes."""

    def end(self) -> None:
        """End the report: no file follows."""


class Junit(Report):
    """The JUnit document of one command; it is written after the last file, when the sums are known."""

    def __init__(self, write: Write) -> None:
        super().__init__(write)
        self._suites: list[JunitSuite] = []

    def begin_file(self, path: Path, scenario: Scenario, bench: Bench) -> None:
        self._path, self._scenario = path, scenario

    def write_verdict(self, verdict: Verdict) -> None:
        steps = (*self._scenario.start, *self._scenario.steps)
        cases = (*_make_cases(verdict.taken), *_make_skipped_cases(steps[len(verdict.taken) :]))
        answers = (f"{one.step.line}\n{one.answer}" for one in verdict.taken if one.answer)
        output = (self._scenario.about, *(f"{name}: {trace}" for name, trace in verdict.traces), *answers)
        suite = JunitSuite(str(self._path), verdict.scenario, _add_rest_case(cases, verdict), output)
        self._suites.append(suite)

    def write_error(self, path: Path, error: UserError) -> None:
        lines = error.lines()
        case = JunitCase("the file can be run", 0, "error", "file", lines[0], "\n".join(lines))
        self._suites.append(JunitSuite(str(path), path.stem, (case,)))

    def end(self) -> None:
        self._write(_format_xml(self._suites))


# -- steps to cases ----------------------------------------------------------------------------------------


def _make_cases(taken: Iterable[StepResult]) -> Iterator[JunitCase]:
    before = 0
    for one in taken:
        if not (_is_test_case(one.step) or one.failure):
            continue
        name, ns, before = _case_name(one.step), one.until_ns - before, one.until_ns
        if one.failure is None:
            yield JunitCase(name, ns)
        else:
            found = f"found: {one_line(one.failure.found)}"
            errors = [f"ERROR {one_line(str(error))}" for error in one.errors]
            text = "\n".join((f"step {one.failure.step}: {one_line(one.failure.line)}", found, *errors))
            yield JunitCase(name, ns, "failure", one.step.line.split(maxsplit=1)[0], found, text)


def _make_skipped_cases(steps: Iterable[Step]) -> Iterator[JunitCase]:
    for step in steps:
        if _is_test_case(step):
            yield JunitCase(_case_name(step), 0, "skipped", message=NOT_REACHED_TEXT)


def _add_rest_case(cases: tuple[JunitCase, ...], verdict: Verdict) -> tuple[JunitCase, ...]:
    """Return the cases. Add a case if there is none, or if some time is in no case."""
    whole = verdict.taken[-1].until_ns if verdict.taken else 0
    rest = whole - sum(case.ns for case in cases)
    return (*cases, JunitCase(WHOLE_CASE_NAME, rest)) if rest or not cases else cases


def _is_test_case(step: Step) -> bool:
    command = step.command
    is_asked = isinstance(command, AskDoctor) and bool(command.cause)
    return is_asked or isinstance(command, Wait | Expect | ExpectTrace)


def _case_name(step: Step) -> str:
    """Return a name such as `007 expect C1 STATUS=7004`, unique in the file, and in order when sorted."""
    number = "start" if step.number == START_STEP else f"{step.number:03}"
    line = one_line(step.line)
    return f"{number} {line if len(line) <= LONGEST_NAME else line[: LONGEST_NAME - 3] + '...'}"


# -- cases to XML ------------------------------------------------------------------------------------------


def _format_xml(suites: list[JunitSuite]) -> str:
    # Here: the other formats need no XML, and start faster without it.
    from xml.etree import ElementTree

    root = ElementTree.Element("testsuites", {"name": "trcvtui scenario", **_count_outcomes(suites)})
    for suite in suites:
        _add_suite(root, suite)
    ElementTree.indent(root)
    body = ElementTree.tostring(root, encoding="us-ascii", xml_declaration=False).decode("ascii")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}\n'


def _add_suite(root: Element, suite: JunitSuite) -> None:
    from xml.etree.ElementTree import SubElement

    element = SubElement(root, "testsuite", {"name": one_line(suite.path), **_count_outcomes([suite])})
    for case in suite.cases:
        named = {"classname": one_line(suite.scenario), "name": case.name, "time": _seconds(case.ns)}
        inner = SubElement(element, "testcase", named)
        if case.outcome:
            keys = {"type": case.kind, "message": case.message}
            child = SubElement(inner, case.outcome, {key: text for key, text in keys.items() if text})
            child.text = case.text or None
    output = [one_line(line) for text in suite.output for line in text.splitlines()]
    if output:
        SubElement(element, "system-out").text = "\n".join(output)


def _count_outcomes(suites: list[JunitSuite]) -> dict[str, str]:
    counts = {
        "tests": sum(len(suite.cases) for suite in suites),
        "failures": sum(suite.count("failure") for suite in suites),
        "errors": sum(suite.count("error") for suite in suites),
        "skipped": sum(suite.count("skipped") for suite in suites),
    }
    return {**{name: str(n) for name, n in counts.items()}, "time": _seconds(sum(s.ns for s in suites))}


def _seconds(ns: int) -> str:
    return f"{ns / 1e9:.3f}"


class JsonLines(Report):
    """One object for each instance and scan in which an output changes, then one for the scenario."""

    def __init__(self, write: Write, interval_ns: int = 0, bench: Bench | None = None) -> None:
        super().__init__(write)
        self._interval_ns = interval_ns
        self._bench = bench

    def begin_file(self, path: Path, scenario: Scenario, bench: Bench) -> None:
        self._interval_ns, self._bench = bench.runtime.interval_ns, bench

    def write_error(self, path: Path, error: UserError) -> None:
        """Write the verdict on a file with errors outside its steps; such an error has step 0."""
        failures = tuple(Failure(0, "", line) for line in error.lines())
        self.write_verdict(Verdict(str(path), 0, failures, (), ()))

    def write_scan(
        self, scan: int, changed: Iterable[StatusEdge], deliveries: Mapping[str, SentCounts] = NO_DELIVERIES
    ) -> None:
        for edge in changed:
            sent = deliveries.get(edge.instance)
            self.write_line(
                scan, outputs_record(edge) if sent is None else outputs_record(edge) | sent._asdict()
            )

    def write_line(self, scan: int, record: Mapping[str, object]) -> None:
        times = {"t_ms": (scan - 1) * self._interval_ns / 1e6}
        if self._bench is not None:
            late = {"late_ms": self._bench.late_ns / 1e6} if self._bench.late_ns else {}
            times |= {"at": self._bench.now / 1e9, **late}
        self.write_record({"scan": scan, **times, **record})

    def write_verdict(self, verdict: Verdict) -> None:
        answers = [
            {"step": one.step.number, "line": one.step.line, "told": one.answer.splitlines()}
            for one in verdict.taken
            if one.answer
        ]
        self.write_record(
            {
                "scenario": verdict.scenario,
                "passed": verdict.has_passed,
                "scans": verdict.scans,
                **({"late_scans": verdict.late_scans} if verdict.late_scans else {}),
                "failures": [{"step": f.step, "line": f.line, "found": f.found} for f in verdict.failures],
                **({"told": answers} if answers else {}),
            }
        )

    def write_record(self, record: Mapping[str, object]) -> None:
        self._write(json_line(record))


def json_line(record: Mapping[str, object]) -> str:
    return json_text(record, separators=(",", ":")) + "\n"


def outputs_record(edge: StatusEdge) -> dict[str, object]:
    """Return an instance's outputs as an object of JSON, without those that its block does not have."""
    record: dict[str, object] = {
        "instance": edge.instance,
        "block": edge.block,
        "STATUS": f"{edge.outputs.status:04X}",
        "BUSY": edge.outputs.busy,
        "DONE": edge.outputs.done,
        "ERROR": edge.outputs.error,
        "RCVD_LEN": edge.outputs.rcvd_len,
        "RxTimeout": edge.outputs.rx_timeout,
        "ReceivedByte": edge.outputs.byte,
    }
    known = {key: value for key, value in record.items() if value is not None}
    return known if not edge.outputs.error else known | {"cause": cause_record(edge.cause, edge.block)}


class Text(Report):
    """Text to read: the verdict, the STATUS of each instance over the whole run, its ERRORs, what failed."""

    def write_verdict(self, verdict: Verdict) -> None:
        word = "passed" if verdict.has_passed else "FAILED"
        late = f", {verdict.late_scans} of them late" if verdict.late_scans else ""
        self._write(f"{word}  {one_line(verdict.scenario)}  ({verdict.scans} scans{late})\n")
        for instance, trace in verdict.traces:
            self._write(f"    {instance}: {trace}\n")
        for error in verdict.errors:
            self._write(f"    ERROR {one_line(str(error))}\n")
        for taken in verdict.taken:
            if taken.answer:
                self._write(f"    step {taken.step.number}: {one_line(taken.step.line)}\n")
                self._write("".join(f"        {one_line(text)}\n" for text in taken.answer.splitlines()))
        for failure in verdict.failures:
            self._write(f"    step {failure.step}: {one_line(failure.line)}\n")
            self._write(f"        found: {one_line(failure.found)}\n")


FORMATS: Final[dict[str, Callable[[Write], Report]]] = {"text": Text, "jsonl": JsonLines, "junit": Junit}
