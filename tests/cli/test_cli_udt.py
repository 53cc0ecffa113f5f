"""`trcvtui udt` beyond the first contract: export, compare, constants, formats; what is said of a mistake."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Run

TYPES = """
TYPE Mixed : STRUCT flag : BOOL; id : DINT; x : LREAL; name : STRING[4]; END_STRUCT END_TYPE
TYPE Theirs : STRUCT flag : BOOL; id : DINT; extra : INT; END_STRUCT END_TYPE
TYPE Sized : STRUCT a : ARRAY[1..GVL.MAX] OF INT; END_STRUCT END_TYPE
"""
ONES = "01 00 00 00 02 00 00 00"


@pytest.fixture(autouse=True)
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "types.st").write_text(TYPES)
    (tmp_path / "values.json").write_text('{"flag": true, "id": 2}')
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)


def test_export_prints_the_type_as_laid_out(run: Run) -> None:
    argv = ("types.st", "--type", "Mixed", "--layout", "packed", "--byte-order", "big", "--to", "lua")
    code, out, err = run("udt", "export", *argv)
    assert (code, err) == (0, "")
    assert out.startswith("-- Mixed: layout packed, big")
    assert out.endswith("\n") and not out.endswith("\n\n")


def test_export_writes_a_file_and_says_nothing(run: Run) -> None:
    argv = ("udt", "export", "types.st", "--type", "Mixed", "--to", "lua", "--port", "2000")
    _, printed, _ = run(*argv)
    assert run(*argv, "--out", "mixed.lua") == (0, "", "")
    assert Path("mixed.lua").read_text() == printed


def test_a_constant_that_no_file_declares_comes_from_the_command_line(run: Run) -> None:
    argv = "udt show types.st --type Sized --format json --constant OTHER=1 --constant GVL.MAX=16#10"
    code, out, _ = run(*argv.split())
    assert code == 0
    assert len(json.loads(out)["members"]) == 16


def test_files_that_use_each_other_are_given_with_with(run: Run) -> None:
    Path("outer.st").write_text("TYPE Outer : STRUCT a : ARRAY[1..GVL.N] OF Inner; END_STRUCT END_TYPE")
    Path("inner.st").write_text("TYPE Inner : INT; END_TYPE TYPE Other : BOOL; END_TYPE")
    Path("gvl.st").write_text("VAR_GLOBAL CONSTANT N : INT := 3; END_VAR")
    argv = ("udt", "show", "outer.st", "--with", "inner.st")
    assert run(*argv) == (
        2,
        "",
        "outer.st:1:34: found 'GVL.N', expected a known constant: --constant GVL.N=VALUE,"
        " or --with FILE that declares it\n",
    )
    code, _, err = run("udt", "show", "outer.st", "--constant", "GVL.N=3")
    assert (code, err) == (
        2,
        "outer.st:1:44: found 'Inner', expected a known type: --with FILE that declares it\n",
    )
    code, out, err = run(*argv, "--with", "gvl.st", "--format", "json")
    assert (code, err) == (0, "")
    assert [member["path"] for member in json.loads(out)["members"]] == ["a[1]", "a[2]", "a[3]"]


def test_what_is_worth_knowing_of_a_type_is_told_on_stderr(run: Run) -> None:
    Path("t.udt").write_text(
        "TYPE \"In\"\n{ S7_Optimized_Access := 'TRUE' }\nSTRUCT a : INT; END_STRUCT; END_TYPE\n"
        'TYPE "Out"\nSTRUCT i : "In"; END_STRUCT; END_TYPE\n'
    )
    said = "note: Out: a Siemens source, laid out as s7-standard; --layout takes another\n"
    said += "note: In: optimised access: the CPU sorts the members itself; laid out as standard access\n"
    Path("values.json").write_text("{}")
    for argv in (("show",), ("decode", "00 01"), ("encode", "values.json"), ("export", "--to", "lua")):
        code, out, err = run("udt", argv[0], "t.udt", *argv[1:], "--type", "Out")
        assert (code, err) == (0, said) and "optimised" not in out


@pytest.mark.parametrize(
    ("layout", "told"), [("baosky", True), ("natural8", True), ("packed", False), ("c", False)]
)
def test_a_packing_that_the_layout_leaves_out_is_told(layout: str, told: bool, run: Run) -> None:
    Path("t.h").write_text("#pragma pack(1)\ntypedef struct { char a; double b; } T;")
    code, out, err = run("udt", "show", "t.h", "--layout", layout)
    assert code == 0 and out.startswith("T: ")
    assert ("T: its packing (1) is not applied" in err) is told


def test_the_form_of_text_is_chosen_like_the_byte_order(run: Run) -> None:
    given = "02 00 00 00 41 42 43 00 00 00"
    Path("text.st").write_text("TYPE T : STRUCT a : DINT; s : STRING[4]; END_STRUCT END_TYPE")
    for form, text in (("s7", "C\0\0\0"), ("cstr", "ABC")):
        argv = ("udt", "decode", "text.st", "--text", form, "--format", "json", given)
        _, out, _ = run(*argv)
        assert json.loads(out)["values"]["s"] == text


def test_decode_is_a_table_in_markdown_and_csv(run: Run) -> None:
    argv = ("udt", "decode", "types.st", "--type", "Mixed", ONES, "--format")
    _, out, _ = run(*argv, "md")
    assert out.splitlines()[:4] == [
        "| offset | type | member | value |",
        "| ---: | --- | --- | --- |",
        "| 0 | BOOL | flag | TRUE |",
        "| 4 | DINT | id | 2 |",
    ]
    _, out, _ = run(*argv, "csv")
    assert out.splitlines()[-1] == "16,STRING[4],name,no data"


def test_encode_writes_bytes_as_another_tool_takes_them(run: Run) -> None:
    argv = ("udt", "encode", "types.st", "--type", "Theirs", "values.json", "--format")
    found = {form: run(*argv, form)[1] for form in ("hex", "iec", "st", "c", "python", "base64")}
    assert found["hex"] == ONES + " 00 00 00 00\n"
    assert found["iec"].startswith("16#01, 16#00")
    assert found["st"].startswith("Theirs : ARRAY[0..11] OF BYTE := [")
    assert found["c"].startswith("const uint8_t Theirs[12] = {")
    assert found["python"].startswith('Theirs = (\n    b"\\x01')
    assert found["base64"] == "AQAAAAIAAAAAAAAA\n"


# -- compare: 0 equal, 1 different -----------------------------------------------------------------------


def test_equal_layouts_are_exit_0(run: Run) -> None:
    argv = "udt compare types.st --type Theirs --layout cap4 --layout natural8"
    code, out, err = run(*argv.split())
    assert (code, err) == (0, "")
    assert "none of 3 members differs" in out


def test_differing_rows_are_marked_and_exit_1(run: Run) -> None:
    argv = "udt compare types.st --type Mixed --layout cap4 --layout packed"
    code, out, err = run(*argv.split())
    assert (code, err) == (1, "")
    marked = [line.split() for line in out.splitlines() if line.startswith("*")]
    assert marked == [
        ["*", "id", "4", "1", "place"],
        ["*", "x", "8", "5", "place"],
        ["*", "name", "16", "13", "place"],
    ]


def test_a_stored_form_that_differs_is_exit_1(run: Run) -> None:
    argv = "udt compare types.st --type Mixed --text s7 --text cstr"
    code, out, err = run(*argv.split())
    assert (code, err) == (1, "")
    assert [line.split() for line in out.splitlines() if line.startswith("*")] == [
        ["*", "name", "16", "16", "form"]
    ]
    assert "1 of 4 members differs, the first at byte 16" in out
    code, out, _ = run(*argv.split(), "--format", "json")
    assert (code, json.loads(out)["equal"]) == (1, False)


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


def test_two_types_are_compared_member_by_member(run: Run) -> None:
    argv = "udt compare types.st --type Mixed --type Theirs --format json"
    code, out, _ = run(*argv.split())
    assert code == 1
    rows = {row["path"]: row for row in json.loads(out)["rows"]}
    assert rows["flag"]["differs"] == []
    assert rows["x"]["theirs"] is None
    assert rows["extra"]["ours"] is None


@pytest.mark.parametrize(
    ("constants", "bound", "said"),
    [
        (
            "MAX : INT := 10; END_VAR\nVAR_GLOBAL CONSTANT MAX : INT := 20;",
            "MAX",
            "'MAX', which is 10 (t.st:1:21) and 20 (t.st:2:21), expected one number: --constant MAX=VALUE",
        ),
        (
            "A : INT := B + 1;\nB : INT := A;",
            "A",
            "'A', which is made of itself: A (t.st:1:21), B (t.st:2:1), A,"
            " expected one number: --constant A=VALUE",
        ),
        (
            "A : INT := 1 / 0;",
            "A",
            "'A', which does not work out: A (t.st:1:21), expected one number: --constant A=VALUE",
        ),
    ],
)
def test_a_constant_with_two_values_and_a_circle_of_constants_say_so(
    constants: str, bound: str, said: str, run: Run
) -> None:
    text = f"VAR_GLOBAL CONSTANT {constants} END_VAR\nTYPE T : ARRAY[1..{bound}] OF INT; END_TYPE\n"
    Path("t.st").write_text(text)
    line = text.count("\n")
    assert run("udt", "show", "t.st") == (2, "", f"t.st:{line}:19: found {said}\n")
    code, out, _ = run("udt", "show", "t.st", "--constant", f"{bound}=2", "--format", "json")
    assert code == 0 and json.loads(out)["size"] == 4


def test_one_name_of_two_enumerations_names_both(run: Run) -> None:
    Path("t.st").write_text("TYPE E : (K := 1); F : (K := 2); T : ARRAY[0..K] OF INT; END_TYPE")
    _, _, err = run("udt", "show", "t.st", "--type", "T")
    assert "found 'K', which is 1 (E.K) and 2 (F.K), expected one number" in err


def test_a_subrange_with_unknown_limits_is_laid_out_with_a_note(run: Run) -> None:
    Path("t.st").write_text(
        "TYPE T : STRUCT a : INT(0..GVL.HIGH); b : ARRAY[0..1] OF Small; END_STRUCT\n"
        "Small : SINT(LOW..HIGH); END_TYPE"
    )
    code, out, err = run("udt", "show", "t.st", "--type", "T", "--format", "json")
    assert code == 0 and [member["type"] for member in json.loads(out)["members"]] == ["INT", "SINT", "SINT"]
    assert err.splitlines() == [
        "note: T: t.st:1:21: INT(0..GVL.HIGH) without a known GVL.HIGH is laid out as INT",
        "note: T: t.st:2:9: SINT(LOW..HIGH) without a known LOW, HIGH is laid out as SINT",
    ]


@pytest.mark.parametrize("word", ["STRUCT", "UNION"])
def test_an_empty_struct_warns(word: str, run: Run) -> None:
    Path("t.st").write_text(f"TYPE T : STRUCT a : INT; b : Nil; END_STRUCT Nil : {word} END_{word} END_TYPE")
    code, _, err = run("udt", "show", "t.st", "--type", "T")
    said = f"note: Nil: an empty {word}: 0 bytes here; a partner's compiler may refuse it or give it a byte\n"
    assert (code, err) == (0, said)


def test_a_folder_is_told_what_is_expected(run: Run) -> None:
    said = "folder: found Is a directory, expected a file of type .st, .iecst, .txt, "
    for argv in (("types.st", "--type", "Mixed", "--with", "folder"), ("folder",)):
        code, out, err = run("udt", "show", *argv)
        assert (code, out) == (2, "") and err.startswith(said) and err.count("\n") == 1


TIA = """TYPE "T"
{ S7_Optimized_Access := 'FALSE' }
VERSION : 0.1
   STRUCT
      b : Bool;
      w : Word;
   END_STRUCT;

END_TYPE
"""
OPENNESS = """<Document><SW.Types.PlcStruct><AttributeList><Interface><Sections><Section Name="None">
<Member Name="b" Datatype="Bool"/><Member Name="w" Datatype="Word"/></Section></Sections></Interface>
<Name>T</Name></AttributeList></SW.Types.PlcStruct></Document>"""
SIMATIC_SD = 'TYPE "T" : STRUCT b : Bool; w : Word; END_STRUCT END_TYPE'


@pytest.mark.parametrize(
    ("file", "text"),
    [("t.udt", TIA), ("t.scl", TIA), ("t.st", TIA), ("t.xml", OPENNESS), ("t.s7dcl", SIMATIC_SD)],
)
def test_a_siemens_source_is_laid_out_as_s7_standard_with_a_note(file: str, text: str, run: Run) -> None:
    Path(file).write_text(text)
    said = "note: T: a Siemens source, laid out as s7-standard; --layout takes another\n"
    code, out, err = run("udt", "show", file, "--format", "json")
    shown = json.loads(out)
    assert (code, err) == (0, said)
    assert (shown["layout"], shown["byte_order"], shown["size"]) == ("s7-standard", "big", 4)
    assert run("udt", "decode", file, "--format", "json", "01 00 12 34")[1].count("4660") == 1
    assert run("udt", "compare", file, "--byte-order", "big", "--byte-order", "little")[2] == said
    code, out, err = run("udt", "show", file, "--format", "json", "--layout", "cap4")
    assert (code, err, json.loads(out)["layout"]) == (0, "", "baosky")


def test_of_several_files_the_one_of_the_type_decides_on_the_layout(run: Run) -> None:
    Path("t.udt").write_text(TIA)
    Path("outer.st").write_text('TYPE Outer : STRUCT t : "T"; x : BYTE; END_STRUCT END_TYPE')
    _, out, err = run("udt", "show", "outer.st", "--with", "t.udt", "--format", "json")
    assert (json.loads(out)["layout"], err) == ("baosky", "")


def test_the_size_of_a_pointer_and_an_even_string_are_options(run: Run) -> None:
    Path("t.st").write_text(
        "TYPE T : STRUCT p : POINTER TO INT; s : STRING[3]; b : BYTE; END_STRUCT END_TYPE"
    )

    def size(*options: str) -> int:
        code, out, _ = run("udt", "show", "t.st", "--format", "json", *options)
        assert code == 0
        return int(json.loads(out)["size"])

    packed = ("--layout", "packed")
    assert (size(*packed), size(*packed, "--pointer-size", "4")) == (14, 10)
    assert size(*packed, "--string-even", "yes") == 15
    s7 = ("--layout", "s7-standard", "--pointer-size", "4")
    assert (size(*s7), size(*s7, "--string-even", "no")) == (12, 10)
    _, out, _ = run("udt", "decode", "t.st", *packed, "--pointer-size", "4", "--format", "json", "07")
    assert json.loads(out)["complete"] is False
    Path("values.json").write_text('{"b": 255}')
    _, out, _ = run("udt", "encode", "t.st", *packed, "--pointer-size", "4", "values.json")
    assert len(bytes.fromhex(out)) == 10
    code, out, _ = run("udt", "compare", "t.st", "--pointer-size", "4", "--pointer-size", "8")
    assert code == 1 and "ours    T: 12 bytes" in out and "theirs  T: 16 bytes" in out


# -- fit and cure ----------------------------------------------------------------------------------------

AXIS = "TYPE Axis : STRUCT kind : BYTE; weight : LREAL; count : INT; END_STRUCT END_TYPE"
NATURAL = "01 00 00 00 00 00 00 00 00 00 00 00 00 00 29 40 d2 04 00 00 00 00 00 00"


def ranked(run: Run, *argv: str) -> tuple[int, list[dict[str, object]]]:
    """Return the exit code and the ranking of `udt fit axis.st ... --format json`."""
    Path("axis.st").write_text(AXIS)
    code, out, err = run("udt", "fit", "axis.st", "--type", "Axis", "--format", "json", *argv)
    assert err == ""
    return code, json.loads(out)


KEYS = ["rank", "layout", "byte_order", "cause", "n", "points", "fits_best", "reasons"]


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
    assert [list(one) for one in found] == [KEYS] * len(found)
    ranks = [one["rank"] for one in found]
    assert ranks == [ranks.index(rank) + 1 for rank in ranks]  # 1, 2, 2, 4
    assert ranks.count(1) == 1
    best = found[0]
    assert (best["layout"], best["byte_order"]) == ("natural8", "little")
    assert (best["cause"], best["n"], best["fits_best"], code) == (cause, n, True, 0)
    assert [one["fits_best"] for one in found[1:]] == [False] * (len(found) - 1)


def test_fit_names_exchanged_words_and_bytes(run: Run) -> None:
    for content, cause in (
        ("01 00 00 00 00 00 00 00 29 40 00 00 00 00 00 00 d2 04 00 00 00 00 00 00", "word-swap"),
        ("00 01 00 00 00 00 00 00 00 00 00 00 00 00 40 29 04 d2 00 00 00 00 00 00", "byte-swap"),
    ):
        best = ranked(run, content)[1][0]
        assert (best["layout"], best["byte_order"], best["cause"]) == ("natural8", "little", cause)


def test_readings_that_are_the_same_bytes_share_one_rank_and_name_each_other(run: Run) -> None:
    Path("t.st").write_text("TYPE T : STRUCT a : DINT; b : REAL; c : INT; END_STRUCT END_TYPE")
    content = "12 34 00 02 0e 14 42 f6 01 f7"  # 0x00021234 and 123.4 with their words exchanged
    code, out, _ = run("udt", "fit", "t.st", content, "--layout", "packed", "--format", "json")
    found = json.loads(out)
    twins = [one for one in found if one["rank"] == 1]
    assert code == 1 and [one["fits_best"] for one in found] == [False] * len(found)
    assert [(one["byte_order"], one["cause"]) for one in twins] == [
        ("little", "byte-swap"),
        ("big", "word-swap"),
    ]
    assert found[2]["rank"] == 3
    assert "no byte tells it from packed, big-endian, words exchanged (CDAB)" in twins[0]["reasons"]
    assert (
        "no byte tells it from packed, little-endian, bytes exchanged in 16 bits (BADC)"
        in (twins[1]["reasons"])
    )
    _, out, _ = run("udt", "fit", "t.st", content, "--layout", "packed")
    assert [line.split()[0] for line in out.splitlines() if line[:2].strip().isdigit()][:3] == ["1", "1", "3"]
    _, out, _ = run(
        "udt", "fit", "t.st", content, "--layout", "packed", "--byte-order", "big", "--format", "json"
    )
    best = json.loads(out)[0]
    assert (best["byte_order"], best["cause"], best["rank"]) == ("big", "word-swap", 1), "ours comes first"
    _, out, _ = run("udt", "fit", "t.st", content, "--layout", "packed")
    for twin in ("big-endian, words exchanged (CDAB)", "little-endian, bytes exchanged in 16 bits (BADC)"):
        assert out.count(f"no byte tells it from packed, {twin}\n") == 1


@pytest.mark.parametrize("content", ["00 " * 24, "ff " * 24, "01 02 03", "55 " * 16])
def test_fit_is_not_sure_of_bytes_that_say_nothing_and_exits_1(content: str, run: Run) -> None:
    code, found = ranked(run, content)
    assert (code, [one["fits_best"] for one in found]) == (1, [False] * len(found))


def test_round_numbers_never_decide_the_byte_order(run: Run) -> None:
    Path("t.st").write_text("TYPE T : STRUCT a : ARRAY[1..12] OF INT; END_STRUCT END_TYPE")
    content = " ".join(f"00 {number:02x}" for number in range(1, 13))  # 256, 512 .. or 1, 2 ..
    code, out, _ = run("udt", "fit", "t.st", content)
    assert code == 1
    assert "is ahead, but that is not sure" in out and "fits best" not in out


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


def test_fit_as_text_says_it_in_a_sentence(run: Run) -> None:
    Path("axis.st").write_text(AXIS)
    code, out, err = run("udt", "fit", "axis.st", f"00 18 {NATURAL}")
    assert (code, err) == (0, "")
    assert out.startswith("Axis, 26 bytes: natural8, little-endian, 2 bytes before it (+")
    assert " fits best; next is " in out.splitlines()[0]
    assert "before it stands 00 18, the length 24 of " in out


def test_cure_prints_the_type_and_the_swap_code(run: Run) -> None:
    Path("axis.st").write_text(AXIS)
    argv = ("udt", "cure", "axis.st", "--layout", "natural8", "--byte-order", "big", "--as")
    code, st, err = run(*argv, "st")
    assert (code, err) == (0, "")
    assert "TYPE Axis_natural8 :" in st and "_pad1 : ARRAY[0..6] OF BYTE;" in st
    assert "wire.weight := SWAP8(" in st
    _, scl, _ = run(*argv, "scl")
    assert 'TYPE "Axis_natural8"' in scl and "#wire" in scl
    _, padded, _ = run(*argv, "padded")
    assert "_pad1 : ARRAY[0..6] OF BYTE;" in padded and "SWAP" not in padded


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
        assert f"+0.0 only the first 256 of {members} are judged" in best["reasons"]


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
