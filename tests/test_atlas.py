"""docs/status-*.md is what the tables say, and what the page names is there."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

from trcvtui.dialects import DIALECTS

DOCS = Path(__file__).parents[1] / "docs"


def make_status() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_status", DOCS / "make_status.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


PAGES = make_status().pages()


def test_dialects_on_one_page_have_one_table() -> None:
    assert {name for dialects in PAGES.values() for name in [d.name for d in dialects]} == set(DIALECTS)
    assert all(dialect.status == dialects[0].status for dialects in PAGES.values() for dialect in dialects)


def written(name: str) -> str:
    return (DOCS / f"status-{name}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_what_the_tables_say(name: str) -> None:
    is_in_step = written(name) == make_status().page(PAGES[name])
    assert is_in_step, f"docs/status-{name}.md is out of step with the tables and scenarios: run `make atlas`"


@pytest.mark.parametrize("name", PAGES)
def test_each_row_has_one_line_in_the_contents_that_leads_to_its_card(name: str) -> None:
    page = written(name)
    cards = re.findall(r"^## (16#[0-9A-F]{4})$", page, re.MULTILINE)
    assert cards == sorted(row.word for row in PAGES[name][0].status)
    lines = re.findall(r"^\| \[(16#[0-9A-F]{4})\]\(#([\w-]+)\) \|", page, re.MULTILINE)
    assert [word for word, _ in lines] == cards
    anchors = [anchor for _, anchor in lines]
    assert len(set(anchors)) == len(anchors)
    assert {anchor.partition("-")[0] for anchor in anchors} == {
        word.replace("#", "").lower() for word in cards
    }


@pytest.mark.parametrize("name", PAGES)
def test_every_scenario_that_the_page_links_is_there(name: str) -> None:
    links = re.findall(r"\]\((\.\./[^)]+)\)", written(name))
    assert links
    assert [link for link in links if not (DOCS / link).exists()] == []


@pytest.mark.parametrize("name", PAGES)
def test_nothing_of_the_page_is_taken_for_html(name: str) -> None:
    outside_code = re.sub(r"`[^`]*`", "", written(name))
    assert re.findall(r"(?<!\\)<", outside_code) == []
