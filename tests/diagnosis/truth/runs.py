"""A run recorded with A, asked for B by its recording alone, and really run with B: are they equal?"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

from trcvtui.cli.main import main
from trcvtui.recording.files import RecordTarget
from trcvtui.scenario.command import run_files

Line = dict[str, Any]  # of jsonl
KEYS = ("instance", "STATUS", "BUSY", "DONE", "ERROR", "RCVD_LEN", "RxTimeout", "ReceivedByte", "cause")
CANNOT = "a recording cannot answer this"
MS = 1_000_000


class Case(NamedTuple):
    """A scenario, and what is asked of its recording: values for `--set`, or a dialect."""

    kind: str
    text: str
    sets: tuple[str, ...] = ()
    dialect: str = ""
    interval: int = 10  # ms


class Told(NamedTuple):
    """What `replay --set` has answered: lines of the recorded run and of the what-if, and the last one."""

    code: int
    stderr: str
    both: tuple[list[Line], list[Line]]
    sums: Line

    @property
    def guess_from(self) -> int | None:
        guess: int | None = self.sums.get("guess_from_scan")
        marked = [int(line["scan"]) for line in self.both[1] if line.get("guess")]
        return min([*marked[:1], *([] if guess is None else [guess])], default=None)


class Verdict(NamedTuple):
    """What the answer is worth: equal, refused, marked (a guess up to the first difference), or SILENT."""

    word: str
    differs: str
    told: Told
    true: list[Line]

    @property
    def changes(self) -> bool:
        return [shown(line) for line in self.told.both[0]] != [shown(line) for line in self.true]

    def __str__(self) -> str:
        guess = "" if self.told.guess_from is None else f"guess {self.told.guess_from}"
        done = "/".join(str(len(sizes(run))) for run in (*self.told.both, self.true))
        return f"{self.word:8}{guess:10} {done} DONE {'' if self.changes else '(same)'} {self.differs}"


def _here(call: Callable[[], int]) -> tuple[int, str, str]:
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        code = call()
    return code, out.getvalue(), err.getvalue()


def run(path: Path, *sets: str, record: Path | None = None) -> str:
    """Run a scenario, on record where a file is named; return its jsonl."""
    to = None if record is None else RecordTarget(record, overwrite=True)
    code, out, err = _here(lambda: run_files([path], "sim", "jsonl", None, sets, record=to))
    assert code == 0 and (not err or "holds TLS secrets" in err), (sets, err, out[-400:])
    return out


def records(text: str, run: str = "") -> list[Line]:
    lines = map(json.loads, text.splitlines())
    return [line for line in lines if "instance" in line and line.get("run", "") == run]


def shown(line: Line) -> tuple[Any, ...]:
    return tuple(line.get(key) for key in KEYS)


def sizes(lines: Sequence[Line]) -> list[int | None]:
    return [line.get("RCVD_LEN") for line in lines if line["DONE"]]


def ask(recording: Path, case: Case) -> Told:
    """Ask the recording; nothing else is left of the run."""
    given = [word for text in case.sets for word in ("--set", text)]
    given += ["--dialect", case.dialect] if case.dialect else []
    code, out, err = _here(lambda: main(["replay", str(recording), *given, "--format", "jsonl"]))
    last = json.loads(out.splitlines()[-1]) if out else {}
    return Told(code, err, (records(out, "recorded"), records(out, "what-if")), last)


def _by_time(lines: Sequence[Line], step: int, end: int) -> dict[int, list[tuple[Any, ...]]]:
    """Return what changed when, up to the end; the clock counts where it is told, else scan x interval."""
    found: dict[int, list[tuple[Any, ...]]] = {}
    for line in lines:
        at = round(line["at"] * 1e9) if "at" in line else (line["scan"] - 1) * step
        if at <= end:
            found.setdefault(at, []).append(shown(line))
    return {at: sorted(each, key=str) for at, each in found.items()}


def judge(case: Case, folder: Path) -> Verdict:
    """Record with A, ask for B without the scenario's file, and run B; compare up to the first end."""
    folder.mkdir()
    path, recording = folder / "case.toml", folder / "case.pcapng"
    path.write_text(case.text)
    recorded = run(path, record=recording)
    path.unlink()
    told = ask(recording, case)
    path.write_text(case.text)
    truth = run(path, *case.sets, *([f"dialect={case.dialect}"] if case.dialect else []))
    true = records(truth)
    if told.code == 2 and CANNOT in told.stderr:
        return Verdict("refused", "", told, true)
    assert told.code == 0, (case, told.stderr)
    said = [int(text.split("#")[1][:-2]) for text in case.sets if text.startswith("task.MAIN.interval=")]
    step = (said or [case.interval])[0] * MS
    if not said:
        assert list(map(shown, told.both[0])) == list(map(shown, records(recorded))), case
    scans = [json.loads(text.splitlines()[-1])["scans"] - 1 for text in (recorded, truth)]
    end = min(scans[0] * case.interval * MS, scans[1] * step)
    asked, real = _by_time(told.both[1], step, end), _by_time(true, step, end)
    at = min((at for at in asked.keys() | real.keys() if asked.get(at) != real.get(at)), default=None)
    if at is None:
        return Verdict("equal" if told.guess_from is None else "marked", "", told, true)
    is_marked = told.guess_from is not None and (told.guess_from - 1) * step <= at
    brief = [" ".join(f"{one[0]}:{one[1]}/{one[5]}" for one in side.get(at, [])) for side in (asked, real)]
    differs = f"at {at / 1e9:.2f} s what-if {brief[0] or '-'}, really {brief[1] or '-'}"
    return Verdict("marked" if is_marked else "SILENT", differs, told, true)
