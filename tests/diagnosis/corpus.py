"""How often the doctor is right, as one table: `make doctor-corpus`.

Public captures, with and without a fault added to them; our own projects and scenarios, each against
expected.toml. Below the table stands a line for each false alarm and each miss.
"""

from __future__ import annotations

import io
import json
import os
import re
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from tests.diagnosis.doctor_cases import verdicts_of
from tests.diagnosis.mutations import JUMPED, MUTATIONS, Mutation, Subject, subject_of, write_capture
from trcvtui.cli.main import main

ROOT = Path(__file__).parents[2]
GIVEN = Path(os.environ.get("TRCVTUI_CAPTURE_CORPUS", ROOT / "../shared/corpus/captures"))
ABSENT = f"no captures in {GIVEN} (TRCVTUI_CAPTURE_CORPUS names another folder)"
DEMO = ROOT / "trcvtui" / "demo" / "demo.toml"
ONE_RUN = "opendnp3"  # the captures of one conformance run: much alike, so they count apart
OUR_NAMES = {"no-arp-answer": "no-such-host"}  # for a cause of the list of captures
MOST_MUTATED = 40
MOST_NUMBER = 1 << 30  # in a text: the half circle of sequence numbers
Found = list[dict[str, Any]]  # findings, as JSON has them
SYMPTOMS = ("block-error", "not-connected", "job-waits", "members-unwritten", "odd-values")


class Outcome(NamedTuple):
    """What was wrong about one file; `is_due`: there was something to say of it; `found`: what was said."""

    name: str
    false: Sequence[str]
    missed: Sequence[str]
    is_due: bool
    found: Sequence[dict[str, Any]] = ()


def texts(found: Found) -> list[str]:
    """Return a line for each cause, with the evidence of its first finding."""
    first = {one["cause"]: "; ".join(one["evidence"]) for one in reversed(found)}
    return [f"{cause}: {evidence}" for cause, evidence in first.items()]


class Given(NamedTuple):
    """A public capture; `may_find`: causes that it has; `allowed`: those that are no false alarm."""

    path: Path
    may_find: frozenset[str]
    allowed: frozenset[str]

    def wrong(self, found: Found) -> Found:
        """Return the false alarms; "*" allows all."""
        return [] if "*" in self.allowed else [one for one in found if one["cause"] not in self.allowed]


def given_captures() -> list[Given]:
    """Return them in the order of their list, the conformance run last; none where they are not there."""
    if not GIVEN.is_dir():
        return []
    told = json.loads((GIVEN / "MANIFEST.json").read_text(encoding="utf-8"))
    rows = [(GIVEN / one["file"], frozenset(one["may_find"])) for one in told["captures"]]
    not_counted = {OUR_NAMES.get(one, one) for one in told["not_counted"]}
    made = [Given(path, may_find, may_find | not_counted) for path, may_find in rows]
    return sorted(made, key=lambda one: ONE_RUN in one.path.name)


def told_in(path: Path) -> tuple[Found, Found, list[dict[str, Any]]]:
    """Return all findings in a capture, all remarks, and its verdicts."""
    verdicts = verdicts_of(path)
    findings, remarks = [[one for each in verdicts for one in each[key]] for key in ("findings", "remarks")]
    return findings, remarks, verdicts


def outcome_of_given(given: Given) -> Outcome:
    """Judge a public capture; one of the causes that it has is to be found, "*" to be found or explained."""
    found, remarks, _ = told_in(given.path)
    is_found = any(one["cause"] in given.may_find for one in found)
    is_found = is_found or ("*" in given.may_find and bool(found or remarks))
    missed = [" or ".join(given.may_find)] if given.may_find and not is_found else []
    return Outcome(given.path.name, texts(given.wrong(found)), missed, bool(given.may_find))


def subjects(most: int = MOST_MUTATED) -> Iterator[tuple[Given, Subject]]:
    number = 0
    for given in given_captures():
        subject = subject_of(given.path, number) if number < most else None
        if subject is not None:
            number += 1
            yield given, subject


def outcome_of_mutation(given: Given, subject: Subject, mutation: Mutation, folder: Path) -> Outcome:
    """Judge a capture with a fault added: it should say that, and nothing that the original does not say."""
    path = folder / "mutated.pcap"
    write_capture(path, subject.link_type, mutation.change(subject))
    found, remarks, verdicts = told_in(path)
    same = {one["cause"] for part in told_in(given.path)[:2] for one in part} | {mutation.cause}
    if mutation.quality == "one-direction":
        same = set()  # half of a conversation proves nothing
    false = texts([one for one in given.wrong(found) if one["cause"] not in same])
    said = set()
    for one in verdicts:
        if one["conversation"] and subject.ends() == {one["conversation"][end] for end in ("plc", "partner")}:
            said |= {*one["quality"], *[finding["cause"] for finding in one["findings"]]}
    if mutation.name == JUMPED:
        text = " ".join(texts(found) + texts(remarks)).replace(",", "")
        numbers = re.findall(r"\d{10,}|[\d.]+e\+\d+", text)
        false = [number for number in numbers if float(number) > MOST_NUMBER]
    due = {mutation.cause or mutation.quality} if mutation.is_due(subject) else set()
    return Outcome(given.path.name, false, [*due - said], bool(due))


def told_by(words: Sequence[str]) -> Found | None:
    """Return the findings of `trcvtui doctor`; None where it has read nothing."""
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()):
        if main(["doctor", *words, "--format", "json"]) > 1:
            return None
    return [finding for one in json.loads(out.getvalue()) for finding in one["findings"]]


def own_projects() -> list[Path]:
    patterns = "*.toml", "stories/*.toml", "scenarios/**/*.toml"
    return [DEMO, *[path for one in patterns for path in sorted((ROOT / "configs").glob(one))]]


def expected() -> dict[str, dict[str, list[str]]]:
    """Return the names of projects, by "must" or "may" and by cause."""
    return tomllib.loads(Path(__file__).with_name("expected.toml").read_text(encoding="utf-8"))


def outcome_of_project(path: Path, folder: Path) -> Outcome:
    """Judge a project, by itself and by ten seconds of its traffic, or a scenario by its recording."""
    words, run = [str(path), "--for", "T#10s", "--kernel", "sim"], str(folder / "run.pcapng")
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        if "scenarios" in path.parts:
            words = [run]
            main(["scenario", str(path), "--record", run, "--overwrite"])
        else:
            out = folder / path.stem
            words_of_record = ["record", str(path), "--out", str(out), "--duration", "T#10s"]
            assert not main([*words_of_record, "--kernel", "sim"])
            run = str(next(out.glob("*.pcapng")))
    must, may = [
        {cause for cause, names in expected()[one].items() if path.stem in names} for one in ("must", "may")
    ]
    found = told_by(words)
    if found is None:
        return Outcome(path.stem, [], ["everything: it was not read"], True)
    waits = {code for code, names in expected()["waits"].items() if path.stem in names}
    due = errors_at_the_end(run) - waits
    named = set(re.findall(r"\b[0-9A-F]{4}\b", str([(one["status"], one["explains"]) for one in found])))
    false = texts([one for one in found if one["cause"] not in must | may and not one["explains"]])
    missed = [*sorted(must - {one["cause"] for one in found}), *sorted(due - named)]
    return Outcome(path.stem, false, missed, bool(must or due), found)


def errors_at_the_end(run: str) -> set[str]:
    """Return each STATUS that an instance shows with ERROR last of all, or again after a DONE.

    It is the rule by which our own projects are judged, asked of what a replay prints and not of the doctor.
    What explains an ERROR is no false alarm.
    """
    with redirect_stdout(io.StringIO()) as out, redirect_stderr(io.StringIO()):
        main(["replay", run, "--format", "jsonl"])
    found, last, ended = set(), dict[str, str](), set[tuple[str, str]]()
    for record in map(json.loads, out.getvalue().splitlines()):
        name, status = record.get("instance"), record.get("STATUS")
        if name is None or record.get("cause", {}).get("expected"):
            continue
        if record["ERROR"]:
            found |= {status} if (name, status) in ended else set()
            last[name] = status
        elif record["DONE"]:
            ended |= {(name, last.pop(name))} if name in last else set()
        elif record["BUSY"] or status == "7004":  # all is well again
            last.pop(name, None)
    return found | {*last.values()}


def sets(folder: Path) -> Iterator[tuple[str, list[Outcome]]]:
    given = given_captures()
    for is_one_run, name in enumerate(("public captures", "public captures, one run")):
        chosen = [one for one in given if (ONE_RUN in one.path.name) == bool(is_one_run)]
        yield name, [outcome_of_given(one) for one in chosen]
    mutable = list(subjects())
    for each in MUTATIONS:
        yield each.name, [outcome_of_mutation(*one, each, folder) for one in mutable]
    yield "own projects", [outcome_of_project(one, folder) for one in own_projects()]


def symptoms_and_remedies(found: Found) -> str:
    """Return how many symptoms were found and explained, and how many remedies were tried, or are advice."""
    alone = [row for row in found if row["cause"] in SYMPTOMS]
    explained = {text for row in found if row["cause"] not in SYMPTOMS for text in row["explains"]}
    mends = [mend for row in found for mend in row["mend"]]
    tried = sum(mend["tried"] for mend in mends)
    lines = sum(bool(mend["command"] or mend["set"]) for mend in mends)
    return (
        f"symptoms: {len(alone) + len(explained)}, explained {len(explained)}; findings without a remedy: "
        f"{sum(not row['mend'] for row in found)}; remedies: {len(mends)}, a line {lines}, tried {tried}"
    )


def print_table() -> None:
    print(f"{'':32} files  false alarms       missed")
    wrong = []
    with TemporaryDirectory() as folder:
        for name, outcomes in sets(Path(folder)):
            if not outcomes:
                print(f"{name:32} {ABSENT}")
                continue
            false, missed, due, _ = [sum(map(bool, part)) for part in [*zip(*outcomes, strict=True)][1:]]
            print(f"{name:32} {len(outcomes):5} {false:13} {missed:5} of {due:3}", flush=True)
            found = [row for one in outcomes for row in one.found]
            if found:
                print(f"{'':4}{symptoms_and_remedies(found)}")
            for one in outcomes:
                wrong += [f"{name}: {one.name}: false alarm {text}" for text in one.false]
                wrong += [f"{name}: {one.name}: missed {text}" for text in one.missed]
    print("", *wrong, sep="\n")


if __name__ == "__main__":
    print_table()
