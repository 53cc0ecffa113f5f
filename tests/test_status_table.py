"""The table that `status CODE` answers from says what the tables of the dialects say, word for word."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from trcvtui.__main__ import status_card
from trcvtui.cli import main
from trcvtui.dialects import DIALECTS
from trcvtui.rig.scenario import scenario_index
from trcvtui.status_table import DIALECTS as NAMES

ROOT = Path(__file__).parents[1]
WRITER = ROOT / "docs" / "make_tables.py"


@pytest.fixture(scope="module", autouse=True)
def scenarios_read_once() -> Iterator[None]:
    """Read each scenario file once: it does not change from code to code."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(scenario_index, "shown_by", cache(scenario_index.shown_by))
        yield


def test_the_table_is_what_the_dialects_and_scenarios_say() -> None:
    spec = importlib.util.spec_from_file_location("make_tables", WRITER)
    assert spec is not None and spec.loader is not None
    writer = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(writer)
    is_in_step = writer.TABLE.read_text(encoding="utf-8") == writer.table()
    assert is_in_step, "trcvtui/status_table.py is out of step with the tables: run `make tables`"


CODES = sorted({row.code for dialect in DIALECTS.values() for row in dialect.status})


@pytest.mark.parametrize("dialect", [None, *NAMES])
def test_each_code_is_told_as_cli_tells_it(dialect: str | None, capsys: pytest.CaptureFixture[str]) -> None:
    option = [] if dialect is None else ["--dialect", dialect]
    told = 0
    for code in CODES:
        for text in (f"{code:04X}", f"{code}") if code < 100 else (f"{code:04X}",):
            words = ["status", text, *option]
            card = status_card(words)
            answer = main(words)
            assert (card or "") == capsys.readouterr().out, words
            assert (answer == 0) == (card is not None), words
            told += answer == 0
    assert told >= 35


@pytest.mark.parametrize("text", ["80c5", "16#80C5", "W#16#80C5", "word#16#80c5", "0x80C5"])
def test_each_spelling_finds_the_same_card(text: str) -> None:
    assert status_card(["status", text]) == status_card(["status", "80C5"]) is not None
    assert status_card(["status", text, "--dialect", "Twincat"]) == status_card(
        ["status", "80C5", "--dialect", "twincat"]
    )


@pytest.mark.parametrize(
    "line",
    ["", "status", "status 80C5 --block TRCV_C", "status -h", "status 80G5", "status 16#16#1", "status 180C5",
     "status 1234", "status ٣", "status 80C5 --dialect nix", "status 80C5 --format json", "udt show"],
)  # fmt: skip
def test_what_is_no_plain_question_is_left_to_cli(line: str) -> None:
    assert status_card(line.split()) is None
