"""`trcvtui udt` beyond the first contract: export, compare, constants, formats; what is said of a mistake."""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path

import msgspec
import pytest

from tests import golden
from tests.cli.conftest import Run

ONES = "01 00 00 00 02 00 00 00"


@pytest.fixture(autouse=True)
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(golden.FOLDER / "udt", tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)


def test_each_line_prints_what_the_list_says(run: Run) -> None:
    def told(line: str) -> list[str]:
        code, out, err = run("udt", *line.split())
        most = 1 if line.startswith("export") else None  # tests/golden has no programs in Lua
        return [f"exit {code}", *filter(None, out.splitlines()[:most]), *err.splitlines()]

    golden.answers("udt", told, "udt")


def test_export_writes_a_file_and_says_nothing(run: Run) -> None:
    argv = ("udt", "export", "types.st", "--type", "Mixed", "--to", "lua", "--port", "2000")
    _, printed, _ = run(*argv)
    assert run(*argv, "--out", "mixed.lua") == (0, "", "")
    assert Path("mixed.lua").read_text() == printed


# -- compare: 0 equal, 1 different -----------------------------------------------------------------------


def test_bytes_after_the_options_are_compared_as_values(run: Run) -> None:
    argv = "udt compare types.st --type Theirs --byte-order little --byte-order big --format json"
    code, out, _ = run(*argv.split(), *ONES.split())
    assert code == 1
    answer = json.loads(out)
    assert answer["equal"] is False
    assert [answer[side]["byte_order"] for side in ("ours", "theirs")] == ["little", "big"]
    assert [(row["path"], row["differs"]) for row in answer["rows"]] == [
        ("flag", []), ("id", ["value"]), ("extra", []),
    ]  # fmt: skip
    assert answer["rows"][1]["theirs"] == {"type": "DINT", "offset": 4, "size": 4, "value": 2 << 24}
    assert answer["rows"][2]["ours"]["value"] is None


# -- fit and cure ----------------------------------------------------------------------------------------

AXIS = "TYPE Axis : STRUCT kind : BYTE; weight : LREAL; count : INT; END_STRUCT END_TYPE"
NATURAL = "01 00 00 00 00 00 00 00 00 00 00 00 00 00 29 40 d2 04 00 00 00 00 00 00"


def ranked(run: Run, *argv: str) -> tuple[int, list[dict[str, object]]]:
    """Return the exit code and the ranking of `udt fit axis.st ... --format json`."""
    Path("axis.st").write_text(AXIS)
    code, out, err = run("udt", "fit", "axis.st", "--type", "Axis", "--format", "json", *argv)
    assert err == ""
    return code, json.loads(out)


KEYS = ["rank", "layout", "byte_order", "text", "cause", "n", "member", "points", "fits_best", "reasons"]
KEYS += ["doubt", "same"]


@pytest.mark.parametrize(
    ("content", "cause", "n"),
    [
        (NATURAL, None, 0),
        (f"00 18 {NATURAL}", "header", 2),
        (f"AA 55 01 {NATURAL}", "header", 3),
        (f"{NATURAL} 0d 0a", "trailer", 2),
        (f"{NATURAL} 77", "long", 1),
        (NATURAL[:-3], "short", 1),
        (NATURAL * 2, None, 0),
    ],
)
def test_fit_names_the_layout_and_the_cause(content: str, cause: str | None, n: int, run: Run) -> None:
    code, found = ranked(run, content)
    told = {key: found[0].pop(key) for key in ("verdict", "lengths")}  # of all readings
    assert [list(one) for one in found] == [KEYS] * len(found)
    ranks = [one["rank"] for one in found]
    assert ranks == [ranks.index(rank) + 1 for rank in ranks]  # 1, 2, 2, 4
    assert ranks.count(1) == 1
    best = found[0]
    assert ("fits best" in str(told["verdict"])) is best["fits_best"] is (best["doubt"] is None)
    assert told["lengths"] == [len(bytes.fromhex(content))]
    is_sure = (cause, n) not in [("header", 3), ("long", 1)]  # what these bytes mean is not known
    assert (best["layout"], best["byte_order"]) == ("natural8", "little")
    assert (best["cause"], best["n"], best["fits_best"], code) == (cause, n, is_sure, not is_sure)
    assert best["text"] is None and best["member"] is None
    assert [one["fits_best"] for one in found[1:]] == [False] * (len(found) - 1)


def test_fit_names_the_form_of_string(run: Run) -> None:
    for content, form in (
        ("04 02 41 42 00 00", "s7"),
        ("41 42 00 00 00 00", "cstr"),
        ("41 42 43 44 00", "nul"),
    ):
        _, out, _ = run("udt", "fit", "text.st", "07 00 00 00", *content.split(), "--format", "json")
        assert json.loads(out)[0]["text"] == form


@pytest.mark.parametrize("content", ["00 " * 24, "ff " * 24, "01 02 03", "55 " * 16])
def test_fit_is_not_sure_of_bytes_that_say_nothing_and_exits_1(content: str, run: Run) -> None:
    code, found = ranked(run, content)
    assert (code, [one["fits_best"] for one in found]) == (1, [False] * len(found))


def test_round_numbers_never_decide_the_byte_order(run: Run) -> None:
    Path("t.st").write_text("TYPE T : STRUCT a : ARRAY[1..12] OF INT; END_STRUCT END_TYPE")
    content = " ".join(f"00 {number:02x}" for number in range(1, 13))  # 256, 512 .. or 1, 2 ..
    code, out, _ = run("udt", "fit", "t.st", content)
    assert code == 1
    assert "has the most points, but is not sure" in out and "fits best" not in out


def test_fit_takes_messages_with_an_empty_line_between_them(run: Run) -> None:
    other = NATURAL.replace("29 40 d2 04", "39 40 d3 04")
    Path("m.hex").write_text(f"00 18 {NATURAL}\n\n00 18 {other}\n")
    code, found = ranked(run, "@m.hex")
    assert (code, found[0]["cause"], found[0]["n"]) == (0, "header", 2)
    assert any("in each message" in str(reason) for reason in found[0]["reasons"])  # type: ignore[attr-defined]


def test_fit_names_our_own_layout_first_and_the_equal_ones_in_its_reasons(run: Run) -> None:
    _, found = ranked(run, NATURAL, "--layout", "codesys-8")
    assert found[0]["layout"] == "codesys-8"
    assert "the same for these bytes: natural8, little-endian" in str(found[0]["reasons"])


def test_fit_names_the_layout_first_that_the_source_of_the_type_tells(run: Run) -> None:
    Path("axis.typ").write_text(AXIS)
    code, out, err = run("udt", "fit", "axis.typ", NATURAL)
    assert (code, out.partition(" (")[0]) == (0, "Axis, 24 bytes: codesys-8, little-endian")
    assert "the same for these bytes: natural8" in out and "usually codesys-8" in err


def test_fit_reads_a_text_that_ours_cannot_hold_in_the_layouts_that_can(run: Run) -> None:
    content = f"07 00 00 00 {b'hello'.ljust(260, bytes(1)).hex()} 00 00 00 00 00 00 29 40"
    code, out, err = run("udt", "fit", "long.TcDUT", content)
    assert (code, out.partition(" (")[0]) == (0, "Long, 272 bytes: codesys-8, little-endian, STRING nul")
    refused = "note: Long: baosky cannot hold this type (Long.s, STRING[255])"
    assert err == f"{refused}; only layouts that can hold it are tried\n"


@pytest.mark.slow
@pytest.mark.parametrize(("members", "size"), [(1 << 17, 1 << 19), (1, 8 << 20)])
def test_the_largest_type_and_the_longest_bytes_are_judged_by_a_part_that_is_named(
    members: int, size: int, run: Run
) -> None:
    Path("t.st").write_text(f"TYPE T : STRUCT a : ARRAY[1..{members}] OF REAL; END_STRUCT END_TYPE")
    Path("m.hex").write_text("41480000" * ((size >> 2) - 1 + (members > 1)))
    code, out, _ = run("udt", "fit", "t.st", "@m.hex", "--format", "json")
    best = json.loads(out)[0]
    assert (best["byte_order"], best["cause"], code) == ("big", None, 0 if members > 1 else 1)
    if members > 1:
        assert f"+0.0 only the first 256 of {members} members are judged" in best["reasons"]


def test_of_very_many_messages_the_last_ones_are_judged_and_that_is_said(run: Run) -> None:
    Path("t.st").write_text("TYPE T : STRUCT a : REAL; i : INT; END_STRUCT END_TYPE")
    Path("m.hex").write_text("\n\n".join(["41480000 0007 0000"] * 100_000))
    _, out, _ = run("udt", "fit", "t.st", "@m.hex", "--format", "json")
    best = json.loads(out)[0]
    assert (best["layout"], best["byte_order"], best["cause"]) == ("baosky", "big", None)
    assert "+0.0 only the last 256 of 100000 messages are judged" in best["reasons"]


# C1, bidirectional, zero-width and line-separating characters: a terminal obeys some, a person sees none.
HIDDEN = "a\x1b]0;x\x07\u202eb\u200bc\x85d\u2028e\u2066f\x9bg"


SHOWING = """
show t.scl
show t.scl --format json
show t.scl --type nope
decode t.scl 00 01 00 00 00 00
decode t.scl --format json 00 01
decode t.scl --format md 00 01
decode t.scl --format csv 00 01
export t.scl --to lua
compare t.scl --layout packed --layout natural8
compare t.scl 01
fit t.scl 00 01 00 00 00 00
cure t.scl --as scl
cure t.scl --as st
cure t.scl --as padded
"""


def test_no_hidden_character_of_a_name_reaches_the_terminal(run: Run) -> None:
    source = f'TYPE "T{HIDDEN}"\nVERSION : 0.1\n STRUCT\n "x{HIDDEN}" : Int;\n "y" : Real;\n'
    Path("t.scl").write_text(source + " END_STRUCT;\nEND_TYPE\n", encoding="utf-8")
    for words in SHOWING.strip().splitlines():
        _, out, err = run("udt", *words.split())
        said = out + err
        assert said and [each for each in said if not each.isprintable() and each != "\n"] == [], words


# -- JSON ------------------------------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="file names are text there")
@pytest.mark.parametrize("line", ["udt types {} --format json", "scenario {} --format jsonl"])
def test_json_with_a_file_name_that_is_no_text_is_read_by_strict_readers(run: Run, line: str) -> None:
    name = os.fsdecode(b"\xff")
    shutil.copy("types.st", name)
    _, out, _ = run(*line.format(name).split())
    assert msgspec.json.decode(out) and out.isascii() and "\\\\udcff" in out
