"""docs/status-*.md is what the tables say, and what the page names is there."""

from __future__ import annotations

import re

import pytest

from tests.docs_scripts import DOCS, script
from trcvtui.blocks.status import StatusRow
from trcvtui.dialects import DIALECTS

make_status = script("make_status")
PAGES = make_status.pages()


def test_dialects_on_one_page_have_one_table() -> None:
    assert {name for dialects in PAGES.values() for name in [d.name for d in dialects]} == set(DIALECTS)
    assert all(dialect.status == dialects[0].status for dialects in PAGES.values() for dialect in dialects)


def written(name: str) -> str:
    return (DOCS / f"status-{name}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_what_the_tables_say(name: str) -> None:
    is_in_step = written(name) == make_status.page(PAGES[name])
    assert is_in_step, f"docs/status-{name}.md is out of step with the tables and scenarios: run `make atlas`"


@pytest.mark.parametrize("name", PAGES)
def test_each_card_has_one_line_in_the_contents_that_leads_to_it(name: str) -> None:
    page = written(name)
    cards = re.findall(r"^## (16#[0-9A-F]{4})$", page, re.MULTILINE)
    lines = re.findall(r"^\| \[(16#[0-9A-F]{4})\]\(#([\w-]+)\) \|", page, re.MULTILINE)
    assert [word for word, _ in lines] == cards == sorted(cards)
    anchors = [anchor for _, anchor in lines]
    assert len(set(anchors)) == len(anchors)
    assert {anchor.partition("-")[0] for anchor in anchors} == {
        word.replace("#", "").lower() for word in cards
    }


def cards_of(name: str) -> set[tuple[str, str]]:
    """Return each code of a page with each block of its cards."""
    found = re.findall(r"^## (\S+)\n\n.* · (?:ERROR=1|no error) · (.*) · ", written(name), re.MULTILINE)
    return {(word, block) for word, blocks in found for block in blocks.split(", ")}


def rows_of(name: str) -> dict[tuple[str, str], StatusRow]:
    return {(row.word, block): row for row in PAGES[name][0].status for block in row.blocks}


@pytest.mark.parametrize("name", PAGES)
def test_a_code_of_a_block_has_a_card_or_means_what_it_means_on_the_other_page(name: str) -> None:
    mine, others = rows_of(name), rows_of(make_status.BASES.get(name, name))
    if name not in make_status.BASES:
        assert cards_of(name) == mine.keys()
        return
    told = cards_of(name)
    assert told and told < mine.keys()
    for code, block in mine.keys() - told:
        row, other = mine[code, block], others[code, block]
        assert (row.title, row.error, row.reach) == (other.title, other.error, other.reach)
        assert (row.unsure, row.unreached, row.manual) == (other.unsure, other.unreached, other.manual)
        assert row.causes_of(block) == other.causes_of(block)
        assert row.checks_of(block) == other.checks_of(block)


def test_the_page_of_differences_names_what_the_other_page_has_alone() -> None:
    lines = re.findall(r"^- (.*) that only that page has: (.*)\.$", written("siemens-legacy"), re.MULTILINE)
    assert lines == [("Codes", "16#80C8 (TSEND_C, TRCV_C, TCON)"), ("Blocks", "T_DIAG")]


@pytest.mark.parametrize("name", PAGES)
def test_every_scenario_that_the_page_links_is_there(name: str) -> None:
    links = re.findall(r"\]\((\.\./[^)]+)\)", written(name))
    assert links
    assert [link for link in links if not (DOCS / link).exists()] == []


@pytest.mark.parametrize("name", PAGES)
def test_nothing_of_the_page_is_taken_for_html(name: str) -> None:
    outside_code = re.sub(r"`[^`]*`", "", written(name))
    assert re.findall(r"(?<!\\)<", outside_code) == []
