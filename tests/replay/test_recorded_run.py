"""A run on record runs again from its journal alone: the same calls, the same jsonl, no file of the disk."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.replay.journals import again, jsonl, on_the_screen, recorded
from tests.scenario.scenarios import CONFIGS
from trcvtui.errors import UserError
from trcvtui.recording.journal import FILE_READ, CallRecord, RunHeader
from trcvtui.replay.command import find_difference


def test_a_run_begins_with_all_that_it_needs_and_no_file_is_read_again(tmp_path: Path) -> None:
    shutil.copytree(CONFIGS, tmp_path / "configs")
    path = tmp_path / "configs" / "scenarios" / "baosky" / "80c5-fin-mid-send.toml"
    text, entries = recorded(path, "options.retry=T#100ms")
    shutil.rmtree(tmp_path / "configs")
    begins = entries[0]
    assert isinstance(begins, RunHeader)
    assert begins.options == ("options.retry=T#100ms",) and begins.is_scenario and begins.kernel == "sim"
    assert begins.files[0] == (str(path), (CONFIGS / path.relative_to(tmp_path / "configs")).read_bytes())
    assert jsonl(entries) == text


def test_names_in_a_journal_never_reach_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = 'dialect = "baosky"\n[[udt]]\nfile = "../../etc/passwd.st"\n[[udt]]\nfile = "/etc/hosts.st"\n'
    begins = RunHeader(
        "0", "sim", 0, 0, False, "a/../../x.toml", (), "/", (("a/../../x.toml", text.encode()),), ()
    )

    def never(*_: object, **__: object) -> None:
        raise AssertionError("a file of the disk was looked at")

    for name in ("open", "stat", "lstat", "listdir", "readlink"):
        monkeypatch.setattr(f"os.{name}", never)
    with pytest.raises(UserError) as told:
        again([begins])
    monkeypatch.undo()
    assert "passwd.st: found 'No such file" in str(told.value)


def test_another_output_is_told_with_scan_instance_and_call() -> None:
    _, entries = recorded(CONFIGS / "scenarios" / "baosky" / "80c5-fin-mid-send.toml")
    at = next(n for n, one in enumerate(entries) if isinstance(one, CallRecord) and one.call == "shows")
    one = entries[at]
    assert isinstance(one, CallRecord)
    said = find_difference(
        again([*entries[:at], one._replace(args=(0x80C5, *one.args[1:])), *entries[at + 1 :]])
    )
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


def test_what_the_screen_has_told_acts_again_in_its_scan() -> None:
    """Lines that a bench refuses are recorded and refused again; pictures ask in the gaps."""
    bench, entries = on_the_screen(CONFIGS / "active.toml", LINES)
    run = again(entries)
    assert find_difference(run) == ""
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
    read = {
        one.args[0]: one.answer for one in entries if isinstance(one, CallRecord) and one.call == FILE_READ
    }
    assert read == {str(payload): b"hello"}
    bench, entries = on_the_screen(project, "udt reload\nadd data more T\nwrite rx file p.bin")
    shutil.rmtree(tmp_path)
    run = again(entries)
    assert find_difference(run) == ""
    assert run.bench.runtime.data("rx")[:5] == b"hello"
    assert run.bench.project.data[-1].size == bench.project.data[-1].size
