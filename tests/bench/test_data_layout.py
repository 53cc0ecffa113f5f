"""DATA with a layout and byte order of its own: in the file, by line, in what is expected, written, sent."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import golden
from tests.local_driver import LocalDriver
from trcvtui.engine.controller import fresh_bench
from trcvtui.project.file import load_project
from trcvtui.scenario.command import run_files
from trcvtui.scenario.scenario import load_bench_project, load_scenario

TYPES = "TYPE Telegram : STRUCT id : DINT; alarm : BOOL; speed : REAL; END_STRUCT END_TYPE"
PROJECT = """dialect = "baosky"

[[udt]]
file = "telegram.st"

[[data]]
name = "rx"
type = "Telegram"  # the scale's
{keys}
[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"

[[instance]]
name = "R1"
block = "TRCV_C"
connect = "C1"
data = "rx"

[[peer]]
name = "P1"
remote = "@C1"
"""
PACKED = 'layout = "packed"\nbyte_order = "big"\n'
# id 7, alarm, speed 12.5 as a packed, big-endian sender has them
THEIRS = "00 00 00 07 01 41 48 00 00"


def written(folder: Path, keys: str = "", scenario: str = "") -> Path:
    (folder / "telegram.st").write_text(TYPES)
    path = folder / "bench.toml"
    path.write_text(PROJECT.format(keys=keys) + scenario)
    return path


STEPS = f"""[scenario]
name = "theirs"
about = "a packed, big-endian sender"
steps = '''
{{first}}
set R1 CONT=1
wait R1 STATUS=7002
peer P1 connect
wait R1 STATUS=7004
set R1 EN_R=1
wait R1 STATUS=7006
peer P1 send hex {THEIRS}
wait R1 DONE=1
expect R1 RCVD_LEN=9
expect rx.id 7
expect rx.alarm TRUE
expect rx.speed 12.5
write rx.speed 1.5
run 1
expect rx hex 00 00 00 07 01 3F C0 00 00
set R1 EN_R=0
run 2
set R1 EN_R=1
wait R1 STATUS=7006
peer P1 send udt Telegram {{{{id=1, speed=-2.0}}}}
wait R1 DONE=1
expect rx hex 00 00 00 01 00 C0 00 00 00
expect rx.speed -2.0
'''
"""


@pytest.mark.parametrize(
    ("keys", "first"), [(PACKED, ""), ("", "set rx layout=packed byte_order=big")], ids=["key", "line"]
)
def test_what_a_packed_big_endian_sender_says_is_read_by_its_members(
    keys: str, first: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, keys, STEPS.format(first=first or "run 1"))
    load_scenario(path)
    assert run_files([path], "sim", "text", None, []) == 0, capsys.readouterr().out


def test_a_layout_by_line_is_kept_by_save_project_and_taken_back_by_undo(tmp_path: Path) -> None:
    path = written(tmp_path)
    desk = LocalDriver(fresh_bench(load_bench_project(path), "sim"))
    assert desk.answer("set rx layout=packed byte_order=big") == (
        "DATA variable rx: layout none before, packed now, byte_order none before, big now"
    )
    assert desk.answer("save project").startswith("saved") or "bench.toml" in desk.answer("save project")
    text = path.read_text()
    assert 'layout = "packed"' in text and 'byte_order = "big"' in text and "# the scale's" in text
    declared = load_project(path).data_decl("rx")
    assert declared is not None and declared.size == 9 and declared.layout.rules.byte_order == "big"
    desk.answer("undo")
    now = desk.bench.project.data_decl("rx")
    assert now is not None and now.size == 12 and str(now.choice) == ""


def test_another_type_by_resize_lies_as_before(tmp_path: Path) -> None:
    desk = LocalDriver(fresh_bench(load_bench_project(written(tmp_path, PACKED)), "sim"))
    assert "✗" not in desk.answer("resize rx ARRAY[0..1] OF Telegram")
    now = desk.bench.project.data_decl("rx")
    assert now is not None and now.size == 18


def test_what_is_no_layout_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    golden.mistakes("layouts of DATA", lambda keys: load_project(written(Path(), f"{keys}\n")))
