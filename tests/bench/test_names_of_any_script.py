"""Names in letters of any script: in files and lines, in types, and as wide as they are on the screen."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.engine.test_project_save import driven, say
from trcvtui.cli.main import main
from trcvtui.errors import Problem, UserError
from trcvtui.project.file import load_project
from trcvtui.tui.formatting import clip_middle, measure, pad

TYPES = "TYPE Gerät : STRUCT Größe : INT; 重量 : REAL; कि : INT; END_STRUCT END_TYPE\n"
BENCH = """
dialect = "baosky"
[[udt]]
file = "Größe.st"
[[data]]
name = "प्राप्ति"
type = "Gerät"
[[connect]]
name = "Förderband"
LocalAddress = "127.0.0.1"
[[instance]]
name = "设备"
block = "TRCV_C"
connect = "Förderband"
data = "प्राप्ति"
[[peer]]
name = "Пир"
active = true
remote = "@Förderband"
[[message]]
name = "Gruß"
text = "hex 01"
[scenario]
name = "Namen"
steps = '''
set 设备 CONT=1 EN_R=1 LEN=4
run 4
peer Пир connect
wait peer Пир connected
wait 设备 STATUS=7006 within T#1s
write प्राप्ति.Größe 12
write प्राप्ति.कि 3
run 1
expect प्राप्ति.Größe 12
expect प्राप्ति.कि 3
peer Пир send udt Gerät {Größe=7, कि=2}
wait 设备 DONE=1
expect प्राप्ति.Größe 7
expect 设备 trace 0001 7001 7002 80A1! 7004 7006+ 7008
fault recv ECONNRESET on Förderband
peer Пир send message Gruß
fault clear
create TRCV_C 设备二 connect=Förderband data=प्राप्ति
delete 设备二
'''
"""


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    (tmp_path / "Größe.st").write_text(TYPES, encoding="utf-8")
    path = tmp_path / "Übung 设备.toml"
    path.write_text(BENCH, encoding="utf-8")
    return path


def test_files_lines_and_types_take_letters_of_any_script(bench: Path) -> None:
    assert main(["scenario", str(bench)]) == 0


def test_what_is_added_under_such_a_name_is_saved_and_read_back(bench: Path) -> None:
    bench.write_text(BENCH.partition("[scenario]")[0], encoding="utf-8")
    for driver in driven(bench):
        for line in ("add connect 接続 LocalPort=2001", "add data βάρος INT", "save project"):
            answer = say(driver, line).answers[-1]
            assert answer.error == "", answer.error
    project = load_project(bench)
    assert project.connect("接続") is not None and project.data_decl("βάρος") is not None


@pytest.mark.parametrize("name", ["a/b", "a\u202eb", "a\x07b", "a b", "1a", "a\u200db", ""])
def test_a_name_with_other_characters_is_refused_in_one_clear_line(name: str, bench: Path) -> None:
    bench.write_text(BENCH.replace('"Förderband"\nLocal', f'"{name}"\nLocal'.replace("\x07", "\\u0007")))
    with pytest.raises(UserError) as refused:
        load_project(bench)
    lines = refused.value.lines()
    assert all(line.isprintable() for line in lines)
    assert any(
        line.endswith("a name of letters, digits and _ that does not begin with a digit") for line in lines
    )


def test_a_file_whose_name_turns_the_line_round_is_refused(bench: Path) -> None:
    bench.write_text(BENCH.replace("Größe.st", "a\\u202ets.exe"), encoding="utf-8")
    with pytest.raises(UserError) as refused:
        load_project(bench)
    (line,) = refused.value.lines()
    assert "expected a name without control and bidirectional characters" in line
    assert line.isprintable()
    with pytest.raises(UserError, match="expected a name without control and bidirectional characters"):
        load_project(bench.with_name("b\x07.toml"))


def test_of_more_than_ten_mistakes_the_rest_are_counted() -> None:
    problems = [Problem(f"line {n}", "a", "b") for n in range(51)]
    lines = UserError(problems).lines()
    assert len(lines) == 11 and lines[-1] == "and 41 more"
    assert len(UserError(problems[:10]).lines()) == 10


@pytest.mark.parametrize(
    "name", ["设备设备设备设备", "Förderband_der_Halle", "कि_प्राप्ति_कि_प्राप्ति", "TRCV_C_1"]
)
def test_a_squeezed_name_fills_its_column(name: str) -> None:
    assert measure(clip_middle(name, 11)) <= 11
    assert measure(pad(clip_middle(name, 11), 11)) == 11
