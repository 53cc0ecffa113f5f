"""A run recorded with A, asked for B by its recording alone, and really run with B: are they equal?"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

from trcvtui.cli import main
from trcvtui.rig.recording.files import RecordTo
from trcvtui.rig.scenario.command import run_files

SHOWN = ("STATUS", "BUSY", "DONE", "ERROR", "RCVD_LEN", "RxTimeout", "ReceivedByte")
CANNOT = "a recording cannot answer this: "
Moment = tuple[int, list[tuple[Any, ...]]]  # ns since the start, and what instances show from then on


class Case(NamedTuple):
    """A scenario, and what is asked of its recording: values for `--set`, or a dialect."""

    kind: str
    text: str
    sets: tuple[str, ...] = ()
    dialect: str = ""
    interval: int = 10  # ms

    @property
    def question(self) -> str:
        return " ".join(self.sets) or self.dialect

    @property
    def steps(self) -> tuple[int, int]:
        """Return the interval of the recorded run and the one that is asked for, in ns."""
        said = [int(text.split("#")[1][:-2]) for text in self.sets if text.startswith("task.MAIN.interval=")]
        return self.interval * 1_000_000, (said or [self.interval])[-1] * 1_000_000


class Told(NamedTuple):
    """What `replay --set` has answered; `guess_ns`: from when on it is a guess."""

    code: int
    moments: Mapping[str, list[Moment]]
    guess_ns: int | None
    guess_from: int | None
    sums: Mapping[str, Any]
    stderr: str
    text: str


class Verdict(NamedTuple):
    """What the answer is worth: equal, refused, marked, or SILENT; `differs`: ns, asked and true."""

    word: str
    differs: tuple[int, object, object] | None
    told: Told
    true: list[Moment]

    def __str__(self) -> str:
        runs = (*(self.told.moments.get(name, []) for name in ("recorded", "what-if")), self.true)
        changes = "" if list(runs[0]) != list(runs[2]) else " nothing changes"
        done = "/".join(str(len(sizes(one, ""))) for one in runs)
        guess = "" if self.told.guess_from is None else f" guess {self.told.guess_from}"
        if self.differs is None:
            return f"{self.word:8}{guess} DONE {done}{changes}"
        ns, asked, true = self.differs
        return f"{self.word:8}{guess} DONE {done}, at {ns / 1e9:.2f} s what-if {asked} truth {true}"


def run_here(call: Callable[[], int]) -> tuple[int, str, str]:
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = call()
    return code, out.getvalue(), err.getvalue()


def run(path: Path, *sets: str, record: Path | None = None, kernel: str = "sim") -> str:
    """Run a scenario, on record where a file is named; return its jsonl."""
    to = None if record is None else RecordTo(record, overwrite=True)
    code, out, err = run_here(lambda: run_files([path], kernel, "jsonl", None, sets, record=to))
    assert (code, err) == (0, ""), (sets, err, out[-400:])
    return out


def records(text: str, run: str = "") -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = [json.loads(line) for line in text.splitlines()]
    return [one for one in found if "instance" in one and one.get("run", "") == run]


def moments(lines: Sequence[Mapping[str, Any]], interval_ns: int) -> list[Moment]:
    """Return what changed when; the clock's time counts where it is told, else scan x interval."""
    found: dict[int, list[tuple[Any, ...]]] = {}
    for line in lines:
        at = round(line["at"] * 1e9) if "at" in line else (line["scan"] - 1) * interval_ns
        shown = (line["instance"], *(line.get(key) for key in SHOWN))
        found.setdefault(at, []).append(shown)
    return [(at, sorted(shown, key=str)) for at, shown in sorted(found.items())]


def sizes(all_moments: Sequence[Moment], instance: str) -> list[int]:
    """Return RCVD_LEN of each DONE; "" is any instance."""
    return [one[5] for _, shown in all_moments for one in shown if instance in ("", one[0]) and one[3]]


def ask(recording: Path, case: Case) -> Told:
    """Ask the recording; nothing else is left of the run."""
    given = [word for text in case.sets for word in ("--set", text)]
    given += ["--dialect", case.dialect] if case.dialect else []
    code, out, err = run_here(lambda: main(["replay", str(recording), *given, "--format", "jsonl"]))
    interval, asked = case.steps
    parts = {
        name: moments(records(out, name), step) for name, step in (("recorded", interval), ("what-if", asked))
    }
    last = json.loads(out.splitlines()[-1]) if out else {}
    guess = last.get("guess_from_scan")
    first = [at for at, _ in moments([r for r in records(out, "what-if") if r.get("guess")], asked)][:1]
    guess_ns = min([*([] if guess is None else [(guess - 1) * asked]), *first], default=None)
    return Told(code, parts, guess_ns, guess, last, err, out)


def verdict(case: Case, told: Told, true: list[Moment], end_ns: int) -> Verdict:
    """Compare every line of every scan up to the end of the shorter run."""
    if told.code == 2 and CANNOT in told.stderr:
        return Verdict("refused", None, told, true)
    assert told.code == 0, (case.kind, case.question, told.stderr)
    asked, real = (
        {at: shown for at, shown in one if at <= end_ns} for one in (told.moments["what-if"], true)
    )
    at = min((at for at in asked.keys() | real.keys() if asked.get(at) != real.get(at)), default=None)
    if at is None:
        return Verdict("equal" if told.guess_ns is None else "marked", None, told, true)
    word = "marked" if told.guess_ns is not None and told.guess_ns <= at else "SILENT"
    what_if, truth = [[f"{one[0]}:{one[1]}/{one[5]}" for one in side.get(at, [])] for side in (asked, real)]
    return Verdict(word, (at, what_if, truth), told, true)


def judge(case: Case, folder: Path) -> Verdict:
    """Record with A, ask for B without the scenario's file, run B."""
    folder.mkdir()
    path, recording = folder / "case.toml", folder / "case.pcapng"
    path.write_text(case.text)
    recorded = run(path, record=recording)
    path.unlink()
    told = ask(recording, case)
    path.write_text(case.text)
    sets = case.sets + ((f"dialect={case.dialect}",) if case.dialect else ())
    true = run(path, *sets)
    interval, asked = case.steps
    lasts = [
        (json.loads(text.splitlines()[-1])["scans"] - 1) * step
        for text, step in ((recorded, interval), (true, asked))
    ]
    if told.code == 0 and interval == asked:
        assert told.moments["recorded"] == moments(records(recorded), interval), case
    return verdict(case, told, moments(records(true), asked), min(lasts))
