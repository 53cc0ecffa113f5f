"""How often the doctor is right, as one table: `make doctor-corpus`.

Public captures, with and without a fault added to them; our own projects and scenarios, each against
expected.toml; the captures of the tests. Below the table stands a line for each file that went wrong.
"""

from __future__ import annotations

import io
import json
import os
import re
import sys
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple
from zipfile import ZipFile

from tests.properties.test_doctor_figures import SEEDS, false_alarms, shares
from tests.rig.diagnosis.doctor_cases import faults, healthy
from tests.rig.diagnosis.mutations import JUMPED, MUTATIONS, Mutation, Subject, subject_of, write_capture
from tests.rig.diagnosis.test_real_stacks import ARCHIVE, CASES, label
from trcvtui.cli import main
from trcvtui.rig.diagnosis.doctor import DoctorQuestion, judge

ROOT = Path(__file__).parents[3]
GIVEN = Path(os.environ.get("TRCVTUI_CAPTURE_CORPUS", ROOT / "../shared/corpus/captures"))
ABSENT = f"no captures in {GIVEN} (TRCVTUI_CAPTURE_CORPUS names another folder)"
DEMO = ROOT / "trcvtui" / "rig" / "demo.toml"
EXPECTED = Path(__file__).with_name("expected.toml")
ONE_RUN = "opendnp3"  # the captures of one conformance run: much alike, so they count apart
MOST_MUTATED = 40
MOST_NUMBER = 1 << 30  # of a text: the half circle of sequence numbers
# False alarms and what was missed in commit 945c0bb, which knew no quality of a capture.
BEFORE: Final = {
    "public captures": (26, 0),
    "packets dropped after the tap": (0, 2),
    "cut by RST in mid message": (1, 9),
    "all packets twice": (16, 40),
    "snaplen 96": (1, 26),
    "snaplen 54": (24, 40),
    "one direction removed": (11, 40),
    "equal stamps": (0, 40),
    "clock goes back": (0, 40),
    JUMPED: (38, 0),
    "own projects": (55, 5),
}  # of all others: none
Verdicts = list[dict[str, Any]]


class Outcome(NamedTuple):
    """What was wrong about one file; `is_due`: there was something to say of it."""

    name: str
    false: Sequence[str]
    missed: Sequence[str] = ()
    is_due: bool = False


@dataclass
class Row:
    """One line of the table: counts, and what went wrong."""

    name: str
    files: int = 0
    false: int = 0
    missed: int = 0
    due: int = 0
    wrong: list[str] = field(default_factory=list)

    def text(self) -> str:
        """Return the line; a set that is absent says so."""
        if not self.files:
            return f"{self.name:32} {' '.join(self.wrong)}"
        missed = f"{self.missed} of {self.due}" if self.due else "-"
        false, lost = BEFORE.get(self.name, (0, 0))
        return f"{self.name:32} {self.files:5} {self.false:13} {missed:>11} {false:13} {lost:7}"


def row(name: str, outcomes: Iterable[Outcome]) -> Row:
    """Count the files of one set."""
    made = Row(name)
    for one in outcomes:
        made.files += 1
        made.false += bool(one.false)
        made.missed += bool(one.missed)
        made.due += one.is_due
        made.wrong += [f"{one.name}: false alarm {text}" for text in dict.fromkeys(one.false)]
        made.wrong += [f"{one.name}: missed {text}" for text in one.missed]
    return made


# -- public captures -----------------------------------------------------------------------------------------


class Given(NamedTuple):
    """A public capture, and the causes that are no false alarm there; "*": any."""

    path: Path
    may_find: Sequence[str]
    not_counted: Sequence[str]

    def allows(self, cause: str) -> bool:
        """Return whether a finding is no false alarm."""
        return "*" in self.may_find or cause in self.may_find or cause in self.not_counted


def given_captures() -> tuple[Given, ...]:
    """Return them, in the order of their list; none where the folder is not there."""
    if not GIVEN.is_dir():
        return ()
    told = json.loads((GIVEN / "MANIFEST.json").read_text(encoding="utf-8"))
    rows = told["captures"]
    return tuple([Given(GIVEN / one["file"], one["may_find"], told["not_counted"]) for one in rows])


def findings_of(path: Path) -> tuple[list[dict[str, Any]], Verdicts]:
    """Return all findings in a capture, and its verdicts."""
    verdicts, _, _ = judge(str(path), DoctorQuestion())
    return [finding for one in verdicts for finding in one["findings"]], verdicts


def texts(found: Sequence[dict[str, Any]]) -> list[str]:
    """Return a line for each cause, with the evidence of its first finding."""
    first = {one["cause"]: one["evidence"] for one in reversed(found)}
    return [f"{cause}: {'; '.join(evidence)}" for cause, evidence in first.items()]


def outcome_of_given(given: Given) -> Outcome:
    """Judge a public capture; one of the causes that it has is to be found."""
    found, _ = findings_of(given.path)
    wrong = texts([one for one in found if not given.allows(one["cause"])])
    hits = [one for one in found if "*" in given.may_find or one["cause"] in given.may_find]
    missed = [" or ".join(given.may_find)] if given.may_find and not hits else []
    return Outcome(given.path.name, wrong, missed, bool(given.may_find))


# -- mutations of them ---------------------------------------------------------------------------------------


def subjects(most: int = MOST_MUTATED) -> Iterator[tuple[Given, Subject]]:
    """Yield the captures that a fault can be added to, the conformance run last."""
    number = 0
    for given in sorted(given_captures(), key=lambda one: ONE_RUN in one.path.name):
        subject = subject_of(given.path, number) if number < most else None
        if subject is not None:
            number += 1
            yield given, subject


def outcome_of_mutation(given: Given, subject: Subject, mutation: Mutation, folder: Path) -> Outcome:
    """Judge a capture with a fault added: it should say that, and nothing that the original does not say."""
    path = folder / "mutated.pcap"
    write_capture(path, subject.link_type, mutation.change(subject))
    (before, _), (found, verdicts) = findings_of(given.path), findings_of(path)
    allowed = {one["cause"] for one in before} | {mutation.cause}
    if mutation.quality == "one-direction":
        allowed = set()  # half of a conversation proves nothing
    false = texts([one for one in found if not (one["cause"] in allowed or given.allows(one["cause"]))])
    ends, due, is_told = subject.ends(), mutation.is_due(subject), False
    for one in verdicts:
        talk = one["conversation"]
        if talk is not None and ends == {talk["plc"], talk["partner"]}:
            causes = {finding["cause"] for finding in one["findings"]}
            is_told |= mutation.cause in causes or mutation.quality in one.get("quality", [])
    if mutation.name == JUMPED:
        text = json.dumps([[one["findings"], one.get("remarks")] for one in verdicts]).replace(",", "")
        false = [number for number in re.findall(r"\d{10,}", text) if int(number) > MOST_NUMBER]
    missed = [mutation.cause or mutation.quality] if due and not is_told else []
    return Outcome(given.path.name, false, missed, due)


# -- our own projects ----------------------------------------------------------------------------------------


def told_by(words: Sequence[str]) -> tuple[Verdicts | None, str]:
    """Return the verdicts of `trcvtui doctor`; None, and why, where it has read nothing."""
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()) as err:
        code = main(["doctor", *words, "--format", "json"])
    return (None, err.getvalue()) if code > 1 else (json.loads(out.getvalue()), "")


def name_of(path: Path) -> str:
    """Return how expected.toml calls a project."""
    if path == DEMO:
        return "demo"
    return str(path.relative_to(ROOT / "configs").with_suffix("")).removeprefix("scenarios/")


def outcome_of_project(path: Path, folder: Path, expected: dict[str, dict[str, list[str]]]) -> Outcome:
    """Judge a project, by itself and by ten seconds of its traffic, or a scenario by its recording."""
    name = name_of(path)
    recording = folder / "run.pcapng"
    words = [str(path), "--for", "T#10s", "--kernel", "sim"]
    if "scenarios" in path.parts:
        words = [str(recording)]
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            main(["scenario", str(path), "--record", str(recording), "--overwrite"])
    verdicts, trouble = told_by(words)
    must, may = [
        {cause for cause, names in expected[one].items() if name in names} for one in ("must", "may")
    ]
    if verdicts is None:
        return Outcome(name, [], [f"everything: {trouble}"], True)
    found = [one for verdict in verdicts for one in verdict["findings"]]
    false = texts([one for one in found if one["cause"] not in must | may])
    return Outcome(name, false, sorted(must - {one["cause"] for one in found}), bool(must))


def own_projects() -> Iterator[Path]:
    """Yield the demo and all projects, stories and scenarios."""
    yield DEMO
    for pattern in ("*.toml", "stories/*.toml", "scenarios/**/*.toml"):
        yield from sorted((ROOT / "configs").glob(pattern))


def outcome_of_real(case: str, folder: Path) -> Outcome:
    """Judge a capture of real programs: its cause should be the surest."""
    project, capture = folder / f"{case}.toml", folder / f"{case}.pcapng.gz"
    verdicts, _ = told_by([str(capture), *(["--project", str(project)] if project.exists() else [])])
    found = [finding for one in verdicts or () for finding in one["findings"]]
    causes = [one["cause"] for one in sorted(found, key=lambda one: -one["confidence"])]
    due = label(case)
    if due == "healthy":
        return Outcome(case, causes)
    return Outcome(case, [], [] if causes[:1] == [due] else [f"{due}, said {causes}"], True)


# -- the table -----------------------------------------------------------------------------------------------


def generated(folder: Path) -> Iterator[Row]:
    """Yield the figures of the generated captures, as tests/properties counts them."""
    with_fault, without = list(faults(SEEDS)), list(healthy(SEEDS))
    first, _ = shares("one fault", with_fault, folder / "c.pcapng")
    total = len(with_fault)
    yield Row("generated: right cause first", total, 0, round(total * (1 - first)), total)
    false = false_alarms("healthy", without, folder / "c.pcapng")
    yield Row("generated: healthy", len(without), round(len(without) * false))


def rows(folder: Path) -> Iterator[Row]:
    """Yield the lines of the table, each as soon as it is counted."""
    given = given_captures()
    if not given:
        yield Row("public captures", wrong=[ABSENT])
    else:
        one_run = [one for one in given if ONE_RUN in one.path.name]
        yield row("public captures", map(outcome_of_given, [one for one in given if one not in one_run]))
        yield row("public captures, one run", map(outcome_of_given, one_run))
        chosen = list(subjects())
        for each in MUTATIONS:
            yield row(each.name, [outcome_of_mutation(*pair, each, folder) for pair in chosen])
    expected = tomllib.loads(EXPECTED.read_text(encoding="utf-8"))
    yield row("own projects", [outcome_of_project(path, folder, expected) for path in own_projects()])
    with ZipFile(ARCHIVE) as archive:
        archive.extractall(folder)
    real = [outcome_of_real(case, folder) for case in CASES]
    yield row("real stacks: right cause first", [one for one in real if one.is_due])
    yield row("real stacks: healthy", [one for one in real if not one.is_due])
    yield from generated(folder)


def print_table() -> None:
    """Print the table, then what went wrong."""
    wrong = []
    print(f"{'':32} files  false alarms      missed   at 945c0bb:   missed")
    with TemporaryDirectory() as folder:
        for one in rows(Path(folder)):
            print(one.text(), flush=True)
            wrong += [f"{one.name}: {text}" for text in one.wrong if one.files]
    print(*["", *wrong] if wrong else (), sep="\n")


if __name__ == "__main__":
    print_table()
    sys.exit(0)
