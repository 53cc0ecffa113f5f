"""A run on record runs again from its journal alone: the same calls, the same jsonl, no file of the disk."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterable
from contextlib import redirect_stdout
from pathlib import Path

import pytest

from tests.scenario.scenarios import BAOSKY, CONFIGS, SIEMENS
from trcvtui.bench.bench import Bench
from trcvtui.commands.snapshots import EngineTiming
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.errors import UserError
from trcvtui.files import noting_reads
from trcvtui.history.bench_update import UpdateRequest
from trcvtui.recording.files import FileSink, RecordTo
from trcvtui.recording.journal import READ, Answered, Entry, Keyframe, RunBegins, blocks, entries_of
from trcvtui.recording.recorder import RunRecorder
from trcvtui.recording.recording import Recording
from trcvtui.replay.command import check, print_jsonl
from trcvtui.replay.run_again import RunAgain
from trcvtui.scenario.command import run_files
from trcvtui.scenario.scenario import load_bench

SCENARIOS = [
    path
    for path in sorted(CONFIGS.rglob("*.toml"))
    if "[scenario]" in path.read_text(encoding="utf-8") and path.parent.name != "tls"
]


class Kept:
    """A sink that keeps the entries."""

    trouble = ""
    first_scan = 0

    def __init__(self) -> None:
        self.entries: list[Entry] = []

    def keyframe(self, frame: Keyframe) -> None:
        """Do nothing: the entries are enough."""

    def take(self, entries: Iterable[Entry]) -> None:
        self.entries += entries

    def close(self) -> None:
        """Do nothing."""


class InMemory(RecordTo):
    """`--record` without a file."""

    def sink(self, file: Path) -> FileSink:
        return KEPT


KEPT = Kept()


def recorded(path: Path, *overrides: str, file: Path | None = None) -> tuple[str, list[Entry]]:
    """Return what a scenario has printed as jsonl, and its journal; with a file, on real sockets."""
    KEPT.entries = []
    out = io.StringIO()
    record = InMemory(Path("R.pcapng")) if file is None else RecordTo(file)
    with redirect_stdout(out):
        run_files([path], "sim" if file is None else "live", "jsonl", None, overrides, record=record)
    return out.getvalue(), KEPT.entries if file is None else list(Recording(file).entries())


def again(entries: Iterable[Entry]) -> RunAgain:
    return RunAgain(entries_of(blocks(entries), "R"), "R")


def jsonl(entries: Iterable[Entry]) -> str:
    out = io.StringIO()
    print_jsonl(again(entries), out.write)
    return out.getvalue()


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_recorded_scenario_holds_and_prints_the_same(path: Path) -> None:
    text, entries = recorded(path)
    assert check(again(entries)) == ""
    assert jsonl(entries) == text


@pytest.mark.live
@pytest.mark.slow
@pytest.mark.parametrize("path", (BAOSKY + SIEMENS)[1::6], ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_recorded_scenario_on_real_sockets_holds_and_prints_the_same(path: Path, tmp_path: Path) -> None:
    text, entries = recorded(path, file=tmp_path / "R.pcapng")
    assert check(again(entries)) == ""
    assert jsonl(entries) == text


def test_a_run_begins_with_all_that_it_needs_and_no_file_is_read_again(tmp_path: Path) -> None:
    shutil.copytree(CONFIGS, tmp_path / "configs")
    path = tmp_path / "configs" / "scenarios" / "baosky" / "80c5-fin-mid-send.toml"
    text, entries = recorded(path, "options.retry=T#100ms")
    shutil.rmtree(tmp_path / "configs")
    begins = entries[0]
    assert isinstance(begins, RunBegins)
    assert begins.options == ("options.retry=T#100ms",) and begins.is_scenario and begins.kernel == "sim"
    assert begins.files[0] == (str(path), (CONFIGS / path.relative_to(tmp_path / "configs")).read_bytes())
    assert jsonl(entries) == text


def test_names_in_a_journal_never_reach_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = 'dialect = "baosky"\n[[udt]]\nfile = "../../etc/passwd.st"\n[[udt]]\nfile = "/etc/hosts.st"\n'
    begins = RunBegins(
        "0", "sim", 0, 0, False, "a/../../x.toml", (), "/", (("a/../../x.toml", text.encode()),), ()
    )

    def never(*_: object, **__: object) -> None:
        raise AssertionError("a file of the disk was looked at")

    for name in ("open", "stat", "lstat", "listdir", "readlink"):
        monkeypatch.setattr(f"os.{name}", never)
    with pytest.raises(UserError) as told:
        again([begins])
    monkeypatch.undo()
    assert "passwd.st: found No such file" in str(told.value)


def test_a_journal_that_ends_before_its_run_is_told() -> None:
    _, entries = recorded(SCENARIOS[0])
    assert "the end of the journal" in check(again(entries[: len(entries) // 2]))
    assert "the end of the journal" in check(again(entries[:-20]))


def test_another_output_is_told_with_scan_instance_and_call() -> None:
    _, entries = recorded(CONFIGS / "scenarios" / "baosky" / "80c5-fin-mid-send.toml")
    at = next(n for n, one in enumerate(entries) if isinstance(one, Answered) and one.call == "shows")
    one = entries[at]
    assert isinstance(one, Answered)
    said = check(again([*entries[:at], one._replace(args=(0x80C5, *one.args[1:])), *entries[at + 1 :]]))
    assert said.startswith("R: scan 1: found shows (") and f"of {one.owner}" in said


LINES = """set TRCV_C_1 EN_R=1
hold
run 3
peer P1 send hex 01 02 03
add connect C9 LocalPort=2900
add data more ARRAY[0..9] OF BYTE
set connect C9 LocalPort=2901
undo
go
write rx+2 hex AA
plc stop
plc run
link C1 down
link C1 up
fault recv ECONNRESET
remove connect C9"""


def on_the_screen(path: Path, lines: str) -> tuple[Bench, list[Entry]]:
    """Return a bench after these lines with five scans each, and its journal."""
    kept = Kept()
    recorder = RunRecorder(lambda: kept, waits=False)
    with noting_reads(recorder.reads):
        project = load_bench(path)
        with recorder:
            bench = fresh_bench(project, "sim", recorder.seam)
            recorder.begin(bench, path, (), is_scenario=False)
            console = Controller(bench)
            for number, line in enumerate(lines.splitlines()):
                console.take(number, line)
                for _ in range(5):
                    console.scan()
                    console.picture(UpdateRequest(), EngineTiming(mode=""), 10)
                    recorder.gap(bench)
            bench.close()
    return bench, kept.entries


def test_what_the_screen_has_told_acts_again_in_its_scan() -> None:
    """Lines that a bench refuses are recorded and refused again; pictures ask in the gaps."""
    bench, entries = on_the_screen(CONFIGS / "active.toml", LINES)
    run = again(entries)
    assert check(run) == ""
    assert [str(line) for line in run.bench.runtime.ledger] == [str(line) for line in bench.runtime.ledger]
    assert run.bench.project.connects == bench.project.connects


def test_files_that_are_read_on_the_way_are_recorded(tmp_path: Path) -> None:
    types, payload, project = tmp_path / "T.st", tmp_path / "p.bin", tmp_path / "P.toml"
    types.write_text("TYPE T : STRUCT a : BYTE; END_STRUCT END_TYPE")
    payload.write_bytes(b"hello")
    project.write_text(
        'dialect = "baosky"\n[[udt]]\nfile = "T.st"\n[[data]]\nname = "rx"\ntype = "ARRAY[1..20] OF BYTE"\n'
    )
    _, entries = on_the_screen(project, "write rx file p.bin")
    types.write_text("TYPE T : STRUCT a : BYTE; b : WORD; END_STRUCT END_TYPE")
    read = {one.args[0]: one.answer for one in entries if isinstance(one, Answered) and one.call == READ}
    assert read == {str(payload): b"hello"}
    bench, entries = on_the_screen(project, "udt reload\nadd data more T\nwrite rx file p.bin")
    shutil.rmtree(tmp_path)
    run = again(entries)
    assert check(run) == ""
    assert run.bench.runtime.data("rx")[:5] == b"hello"
    assert run.bench.project.data[-1].size == bench.project.data[-1].size
