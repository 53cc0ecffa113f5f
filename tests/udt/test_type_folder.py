"""What a type lacks is found in the files beside it or in a folder; what is not sure is refused."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from trcvtui.cli.main import main
from trcvtui.errors import UserError
from trcvtui.udt.command import read_layout
from trcvtui.udt.layout.rules import LayoutChoice
from trcvtui.udt.sources import type_folder

REPORT = "TYPE Report : STRUCT head : BYTE; unit : Unit; END_STRUCT END_TYPE"
UNIT = "TYPE Unit : STRUCT a : DINT; END_STRUCT END_TYPE"
OTHER_UNIT = "TYPE Unit : STRUCT a : LREAL; END_STRUCT END_TYPE"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def put(**files: str) -> None:
    """Write files; `old__unit_st` is old/unit.st."""
    for name, text in files.items():
        path = Path(name.replace("__", "/").replace("_", "."))
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)


def size(file: str, *others: str, name: str | None = None) -> int:
    options = dict.fromkeys(LayoutChoice._fields)
    return read_layout(SimpleNamespace(file=file, others=others, constant=[], type=name, **options)).size


def refusal(file: str, *others: str, name: str | None = None) -> str:
    with pytest.raises(UserError) as raised:
        size(file, *others, name=name)
    return raised.value.lines()[0]


def test_what_a_type_uses_is_found_beside_it_and_told_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    put(report_st=REPORT, unit_st="TYPE Unit : ARRAY[0...GVL.MAX] OF Sub; END_TYPE")
    put(sub_st="TYPE Sub : INT; END_TYPE", GVL_st="VAR_GLOBAL CONSTANT MAX : INT := 2; END_VAR")
    assert size("report.st") == 8
    assert capsys.readouterr().err == (
        "note: Report uses Unit: found in unit.st, GVL.MAX: found in GVL.st, "
        "Sub: found in sub.st beside FILE\n"
    )


def test_a_type_that_lacks_nothing_reads_no_other_file(capsys: pytest.CaptureFixture[str]) -> None:
    put(report_st=f"{REPORT} {UNIT}", unit_st=OTHER_UNIT)
    assert size("report.st", name="Report") == 8
    assert capsys.readouterr().err == ""


def test_two_files_that_differ_are_refused_and_one_given_by_name_decides() -> None:
    put(report_st=REPORT, unit_st=UNIT, unit2_st=OTHER_UNIT)
    assert refusal("report.st") == (
        "unit2.st:1:6: found 'Unit' a second time, "
        "expected one declaration of it; the first is at unit.st:1:6"
    )
    assert size("report.st", "unit2.st") == 12
    put(unit2_st=UNIT.upper())  # the same word for word
    assert size("report.st") == 8
    put(new__unit_st=UNIT, old__unit_st=OTHER_UNIT)
    assert "'Unit' a second time" in refusal("report.st", "new", "old")


def test_what_a_found_type_uses_is_that_of_its_own_file_or_refused() -> None:
    both = "TYPE Unit : Sub; Sub : DINT; END_TYPE"
    put(report_st=REPORT, one_st=both, two_st=both.replace("DINT", "INT"))
    assert "'Sub' a second time" in refusal("report.st")
    put(two_st="", report_st=f"{REPORT} TYPE Sub : INT; END_TYPE")
    assert "'Sub' a second time" in refusal("report.st", name="Report")


def test_a_data_block_is_no_type_of_a_member() -> None:
    put(report_st=REPORT, unit_db='DATA_BLOCK "Unit" STRUCT a : Int; END_STRUCT; BEGIN END_DATA_BLOCK')
    unknown = "report.st:1:42: found 'Unit', expected a known type; add --with FILE that declares it"
    assert refusal("report.st") == refusal("report.st", "unit.db") == unknown
    assert size("report.st", ".", name="Unit") == 2


def test_two_values_of_a_constant_are_refused() -> None:
    put(report_st="TYPE Report : ARRAY[0..MAX] OF BYTE; END_TYPE")
    put(a_st="VAR_GLOBAL CONSTANT MAX : INT := 2; END_VAR", b_st="TYPE E : (MAX := 2, TOP); END_TYPE")
    assert size("report.st") == 3
    put(b_st="VAR_GLOBAL CONSTANT MAX : INT := 3; END_VAR")
    assert "'MAX', which is 2 (a.st:1:21) and 3 (b.st:1:21)" in refusal("report.st")


def test_broken_files_links_in_circles_and_binary_ones_stop_no_good_one(folder: Path) -> None:
    put(report_st=REPORT, units__unit_st=UNIT, half_xml="<Document>Unit", bad_st="TYPE Unit : STRUCT")
    (folder / "Thumbs.db").write_bytes(b"Unit\0\xff" * 999)
    (folder / "self.st").symlink_to("self.st")
    (folder / "units" / "up").symlink_to(folder)
    os.mkfifo(folder / "fifo.st")
    assert refusal("report.st").startswith("bad.st:1:19: found the end of the text")
    assert size("report.st", ".") == 8
    assert size(".", name="Report") == 8


LIB = "TYPE Line : STRUCT no : UDINT; END_STRUCT END_TYPE"
HEADER = (
    "typedef struct Line { unsigned short no[9]; } Line; typedef struct OnlyC { unsigned short x; } OnlyC;"
)


@pytest.mark.parametrize("system", ["SG3", "SG4", "SGC", "sg4"])
def test_a_header_that_b_and_r_generates_counts_where_no_typ_declares_the_name(system: str) -> None:
    put(box_typ="TYPE Box : STRUCT l : Line; c : OnlyC; END_STRUCT END_TYPE", Lib__Lib_typ=LIB)
    Path("Lib", system).mkdir()
    Path("Lib", system, "Lib.h").write_text(HEADER)
    assert size("box.typ", ".") == 8 and size(".", name="Line") == 4
    Path("Lib", "Lib.typ").unlink()
    assert size("box.typ", ".") == 24


def test_variables_of_files_of_one_name_are_told_apart_by_folder(capsys: pytest.CaptureFixture[str]) -> None:
    put(A__Variables_var="VAR a : INT; END_VAR", B__Variables_var="VAR b : ARRAY[0..9] OF DINT; END_VAR")
    put(A__Other_var="VAR c : DINT; END_VAR")
    assert size(".", name="A/Variables") == 4 and size(".", name="b/variables") == 40
    assert size(".", name="Other") == 4
    assert refusal(".", name="Variables").endswith("expected a type of .: A/Variables, B/Variables")
    assert size("A/Variables.var", "B/Variables.var") == 4
    assert size("A/Variables.var", name="Variables") == 4
    assert main(["udt", "types", "."]) == 0
    assert [line.split()[:2] for line in capsys.readouterr().out.splitlines()[1:]] == [
        ["Other", "4"],
        ["A/Variables", "4"],
        ["B/Variables", "40"],
    ]


def test_what_the_packages_around_a_file_declare_is_found_the_nearest_first(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    inner = folder / "Out" / "Logical" / "Pack" / "Sub" / "Prog"
    inner.mkdir(parents=True)
    (inner / "Types.typ").write_text("TYPE T : STRUCT a : ARRAY[1..N] OF Deep; END_STRUCT END_TYPE")
    constant = "VAR CONSTANT N : USINT := {}; END_VAR"
    (inner.parents[2] / "Global.var").write_text(constant.format(9))
    (inner.parents[2] / "Deep.typ").write_text("TYPE Deep : INT; END_TYPE")
    assert size("Out/Logical/Pack/Sub/Prog/Types.typ") == 20
    (inner.parents[1] / "Pack.var").write_text(constant.format(3))
    (inner.parents[1] / "Pack.h").write_text("typedef int Deep;")  # no file of B&R
    assert size("Out/Logical/Pack/Sub/Prog/Types.typ") == 8
    assert "N: found in Pack.var in Out/Logical/Pack\n" in capsys.readouterr().err
    monkeypatch.chdir(inner)
    assert size("Types.typ") == size(".", name="T") == 8
    (inner.parents[1] / "Pack.var").unlink()
    (inner.parents[2] / "Global.var").rename(inner.parents[3] / "Global.var")  # no part of the project
    assert "'N'" in refusal("Types.typ")
    (inner / "Types.st").write_text("TYPE T : ARRAY[1..2] OF Deep; END_TYPE")  # another vendor's
    assert "'Deep'" in refusal("Types.st")


def test_a_folder_that_is_too_large_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    put(report_st=REPORT, **{f"unit{n}_st": UNIT for n in range(4)})
    monkeypatch.setattr(type_folder, "MOST_FILES", 3)
    assert refusal("report.st", ".").startswith(".: found a folder of more than 3 type files or 64 MiB")


def test_a_folder_without_a_type_says_why_its_files_are_not_read(capsys: pytest.CaptureFixture[str]) -> None:
    put(all__l5x_xml="<RSLogix5000Content>")
    assert main(["udt", "types", "all"]) == 2
    assert "all/l5x.xml: found a Rockwell Studio 5000 export" in capsys.readouterr().err
    put(all__unit_st=UNIT)
    assert main(["udt", "types", "all"]) == 0
