"""The STATUS atlas as Markdown: text stays text."""

from __future__ import annotations

from msgspec.structs import replace

from tests.docs_scripts import script
from trcvtui.blocks.status import StatusRow
from trcvtui.dialects.baosky.rules import BAOSKY
from trcvtui.dialects.status_report import Explanation, add_scenarios, find_explanations

make_status = script("make_status")


def page(*found: Explanation, base: tuple[StatusRow, ...] = ()) -> list[str]:
    return "\n\n".join(make_status.body(found, "../", base, "status-other.md")).splitlines()


def explained(code: int) -> Explanation:
    (one,) = find_explanations([BAOSKY], code, "TSEND_C")
    return one


def test_a_card_tells_everything_of_its_row() -> None:
    one = replace(explained(0x80C5), scenarios=("configs/80c5-partner.toml", "configs/other.toml"))
    lines = page(one)
    start = lines.index("## 16#80C5")
    assert lines[start + 2].startswith("**The partner closed during the job** · ERROR=1 · TRCV_C, TSEND_C")
    assert lines[start + 2].endswith(" · real")
    bullets = [line[2:] for line in lines[start:] if line.startswith("- ")]
    assert bullets == [*one.row.causes, *one.row.checks]
    assert lines[-1] == "[80c5-partner](../configs/80c5-partner.toml)"


def test_a_card_of_a_page_of_differences_prints_what_the_other_row_has_not() -> None:
    one = explained(0x80C5)
    other = replace(one.row, checks=("look elsewhere",), unsure="all of it")
    assert page(one, base=(one.row,))[2:] == []
    lines = page(one, base=(other,))
    start = lines.index("## 16#80C5")
    assert [line[2:] for line in lines[start:] if line.startswith("- ")] == [*one.row.checks]
    assert "Not certain: nothing." in lines
    assert lines[-1] == "Everything else: as [16#80C5](status-other.md#1680c5)."


def test_what_markdown_would_read_as_its_own_is_escaped_but_not_in_code() -> None:
    row = replace(explained(0x80C5).row, causes=("a <b> | *c* `d <e>`", "another cause of it"))
    assert r"- a \<b\> \| \*c\* `d <e>`" in page(Explanation("baosky", row))


def test_a_code_with_two_rows_has_two_cards_and_a_link_to_each() -> None:
    one = explained(0x80C5)
    other = Explanation("baosky", replace(one.row, blocks=("URECV_C",), title="Something else"))
    lines = page(explained(0x80C3), one, other)
    contents = [line.partition(" | ")[0] for line in lines if line.startswith("| [")]
    assert contents == ["| [16#80C3](#1680c3)", "| [16#80C5](#1680c5)", "| [16#80C5](#1680c5-1)"]
    assert [line for line in lines if line.startswith("## ")] == ["## 16#80C3", "## 16#80C5", "## 16#80C5"]
    assert "Causes and checks: as [16#80C5](#1680c5)." in lines


def test_scenarios_go_to_the_row_of_their_code_block_and_dialect() -> None:
    shelf = {(0x7002, "TSEND_C"): ["b.toml", "c.toml"], (0x7002, "TRCV_C"): ["a.toml", "b.toml"]}
    other = {(0x7004, "TRCV_C"): ["x.toml"]}
    shown = add_scenarios([explained(0x7002), explained(0x7004)], {"baosky": shelf, "other": other})
    assert [one.scenarios for one in shown] == [("a.toml", "b.toml", "c.toml"), ()]
    row = replace(explained(0x7002).row, blocks=("TRCV_C",))
    (one,) = add_scenarios([Explanation("baosky", row)], {"baosky": shelf})
    assert one.scenarios == ("a.toml", "b.toml")


def test_the_telling_scenarios_begin_with_the_code_or_name_it_else_they_are_the_first_three() -> None:
    files = ("s/1.toml", "s/80c3-80c5-both.toml", "s/2.toml", "s/80c5-x.toml", "s/3.toml")
    one = replace(explained(0x80C5), scenarios=files)
    assert one.select_scenarios() == ("s/80c5-x.toml", "s/80c3-80c5-both.toml")
    assert replace(explained(0x7002), scenarios=files).select_scenarios() == files[:3]
    assert explained(0x80C5).select_scenarios() == ()


def test_an_error_also_tells_the_first_few_notes_of_the_manual_that_show_it() -> None:
    files = ("s/80c5-x.toml", *(f"s/note-{n}.toml" for n in range(9)), "s/note-80c5.toml", "s/row-1.toml")
    one = replace(explained(0x80C5), scenarios=files)
    notes = ("s/note-0.toml", "s/note-1.toml", "s/note-2.toml")
    assert one.select_scenarios() == ("s/80c5-x.toml", "s/note-80c5.toml", *notes)
    assert replace(explained(0x7002), scenarios=files[1:]).select_scenarios() == notes
