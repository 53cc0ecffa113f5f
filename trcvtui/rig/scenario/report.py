"""Scenario results as text and as JSON lines (contract 4.3, 4.4), and the table of all formats."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Final, Protocol

from trcvtui.errors import UserError, one_line
from trcvtui.plc.ledger import StatusEdge
from trcvtui.rig.scenario.delivery import NONE_SENT, Delivery
from trcvtui.rig.scenario.errors_told import cause_record
from trcvtui.rig.scenario.junit import Junit
from trcvtui.rig.scenario.runner import Verdict
from trcvtui.rig.scenario.scenario import Scenario
from trcvtui.rig.scenario.step_runner import Failure

Write = Callable[[str], object]


class Report(Protocol):
    """What a format can be told while a scenario runs."""

    def scan(
        self, scan: int, changed: Iterable[StatusEdge], deliveries: Mapping[str, Delivery] = NONE_SENT
    ) -> None:
        """Tell the outputs that changed in a scan, and of instances with DONE how far their bytes are."""
        ...

    def verdict(self, verdict: Verdict) -> None:
        """Tell how the scenario ended."""
        ...


class Document(Protocol):
    """What a format can be told of one call: its files one after the other, then that there are no more."""

    def begin(self, path: Path, scenario: Scenario, interval_ns: int) -> Report:
        """Return the report of a file that is about to run."""
        ...

    def wrong(self, path: Path, error: UserError) -> None:
        """Tell that a file could not be run, or not to its end."""
        ...

    def end(self) -> None:
        """Tell that no file follows."""
        ...


class JsonLines:
    """One object per instance and scan in which any output differs, then one for the scenario."""

    def __init__(self, write: Write, interval_ns: int) -> None:
        self._write = write
        self._interval_ns = interval_ns

    def scan(
        self, scan: int, changed: Iterable[StatusEdge], deliveries: Mapping[str, Delivery] = NONE_SENT
    ) -> None:
        """Write one line for each instance that changed."""
        t_ms = (scan - 1) * self._interval_ns / 1e6
        for edge in changed:
            record = {"scan": scan, "t_ms": t_ms, **_outputs(edge)}
            sent = deliveries.get(edge.instance)
            self._line(record if sent is None else record | asdict(sent))

    def verdict(self, verdict: Verdict) -> None:
        """Write the line of the scenario."""
        self._line(
            {
                "scenario": verdict.scenario,
                "passed": verdict.passed,
                "scans": verdict.scans,
                "failures": [{"step": f.step, "line": f.line, "found": f.found} for f in verdict.failures],
            }
        )

    def _line(self, record: dict[str, object]) -> None:
        # ASCII: bytes from a wire stay data, for a terminal too. DEL is the one control that JSON leaves raw.
        self._write(json.dumps(record, separators=(",", ":")).replace("\x7f", "\\u007f") + "\n")


def _outputs(edge: StatusEdge) -> dict[str, object]:
    """Return the keys of an instance; an output that its block does not have is left edge."""
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


class Text:
    """For people: the verdict, the STATUS of each instance over the whole run, its ERRORs, what failed."""

    def __init__(self, write: Write, interval_ns: int) -> None:
        self._write = write

    def scan(
        self, scan: int, changed: Iterable[StatusEdge], deliveries: Mapping[str, Delivery] = NONE_SENT
    ) -> None:
        """Write nothing: the traces of the verdict tell it in short."""

    def verdict(self, verdict: Verdict) -> None:
        """Write one line for the scenario, then its traces and its failures."""
        word = "passed" if verdict.passed else "FAILED"
        self._write(f"{word}  {one_line(verdict.scenario)}  ({verdict.scans} scans)\n")
        for instance, trace in verdict.traces:
            self._write(f"    {instance}: {trace}\n")
        for error in verdict.errors:
            self._write(f"    ERROR {one_line(str(error))}\n")
        for failure in verdict.failures:
            self._write(f"    step {failure.step}: {one_line(failure.line)}\n")
            self._write(f"        found: {one_line(failure.found)}\n")


class Following:
    """The document of a format whose files stand one behind the other and know nothing of each other."""

    def __init__(self, write: Write, report: Callable[[Write, int], Report]) -> None:
        self._write = write
        self._report = report

    def begin(self, path: Path, scenario: Scenario, interval_ns: int) -> Report:
        """Return the report of a file."""
        return self._report(self._write, interval_ns)

    def wrong(self, path: Path, error: UserError) -> None:
        """Write nothing: stderr has it."""

    def end(self) -> None:
        """Write nothing: the last file ended with its own line."""


class FollowingJson(Following):
    """The document of JSON lines: a file that could not be run has its line, too."""

    def __init__(self, write: Write) -> None:
        super().__init__(write, JsonLines)

    def wrong(self, path: Path, error: UserError) -> None:
        """Write the line of the file; step 0 is none of its steps."""
        failures = tuple(Failure(0, "", line) for line in error.lines())
        self._report(self._write, 0).verdict(Verdict(str(path), 0, failures, (), ()))


FORMATS: Final[dict[str, Callable[[Write], Document]]] = {
    "text": lambda write: Following(write, Text),
    "jsonl": FollowingJson,
    "junit": Junit,
}
