"""`status` as text and as JSON: codes in every spelling, all dialects or one, all blocks or one."""

from __future__ import annotations

import json

import pytest
from msgspec.structs import replace

from trcvtui.dialects.baosky.rules import BAOSKY
from trcvtui.dialects.baosky.status import STATUS
from trcvtui.dialects.status_report import (
    add_scenarios,
    as_json,
    as_table,
    as_text,
    find_explanations,
    parse_code,
    parse_number,
    select_dialects,
)
from trcvtui.dialects.twincat.rules import TWINCAT
from trcvtui.errors import UserError

BLOCKS = "TCON, TDISCON, TRCV, TRCV_C, TSEND, TSEND_C, T_RESET"
TCP = replace(BAOSKY, status=STATUS)


@pytest.mark.parametrize(
    "text",
    ["80C5", "80c5", "16#80C5", "W#16#80C5", "w#16#80c5", "WORD#16#80C5", "0x80c5", "0X80C5", " 80C5 "],
)
def test_a_code_may_be_written_in_every_usual_way(text: str) -> None:
    assert parse_code(text) == 0x80C5


@pytest.mark.parametrize(("text", "code"), [("0", 0), ("1", 1), ("0001", 1), ("16#7006", 0x7006)])
def test_leading_zeros_may_be_left_out(text: str, code: int) -> None:
    assert parse_code(text) == code


@pytest.mark.parametrize(
    "text", ["", "80G5", "180C5", "80C5h", "-1", "W#80C5", "16#", "8 0", "٣", "7" * 10_000]
)
def test_what_is_no_code_is_a_mistake_of_one_line(text: str) -> None:
    with pytest.raises(UserError) as raised:
        parse_code(text)
    [line] = raised.value.lines()
    assert line.endswith("expected a STATUS word such as 80C5, 16#80C5, W#16#80C5 or 0x80c5")
    assert len(line) < 160


def test_json_has_the_keys_of_the_contract_first_and_then_what_else_is_known() -> None:
    shown = add_scenarios(
        find_explanations([TCP], 0x80C5, None), {"baosky": {(0x80C5, "TRCV_C"): ["a.toml"]}}
    )
    [one] = json.loads(as_json(shown))
    assert list(one)[:7] == ["code", "dialect", "blocks", "error", "title", "causes", "checks"]
    assert list(one)[7:] == ["manual", "reach", "scenarios"]
    assert (one["manual"], one["reach"], one["scenarios"]) == (
        "Baosky library manual 7.15.1, 7.15.2",
        "real",
        ["a.toml"],
    )
    assert one["code"] == "16#80C5"
    assert one["dialect"] == "baosky"
    assert one["blocks"] == ["TRCV_C", "TSEND_C", "TSEND", "TRCV"]
    assert one["error"] is True
    assert one["causes"] and one["checks"]


def test_the_card_names_code_title_error_blocks_causes_and_checks() -> None:
    row = TCP.row(0x7006)
    assert row is not None
    card = as_text(find_explanations([TCP], 0x7006, None)).splitlines()
    assert card[0] == "16#7006  Receiving, or ready and waiting"
    assert card[1] == "  no error · TRCV_C, TRCV · baosky"
    assert [line[6:] for line in card if line.startswith("    - ")] == [*row.causes, *row.checks]
    assert card[-2:] == [
        "  can be brought about by real traffic, also on this machine alone",
        "  source: Baosky library manual 7.15.1, 7.15.9",
    ]


def test_the_card_names_the_scenarios_that_show_the_code() -> None:
    shelf = {(0x7006, "TRCV_C"): ["s/7006-static.toml", "s/other.toml"]}
    card = as_text(add_scenarios(find_explanations([TCP], 0x7006, None), {"baosky": shelf}))
    assert card.splitlines()[-2] == "  to see it: trcvtui scenario s/7006-static.toml"


def test_without_a_code_the_whole_table_is_one_line_a_code() -> None:
    lines = as_table(find_explanations([TCP], None, None)).splitlines()
    assert len(lines) == len(TCP.status)
    gap = " " * (46 - len("Not called"))
    assert lines[0] == f"baosky  16#0000    Not called{gap}  TRCV_C TSEND_C TCON TDISCON T_RESET TSEND TRCV"
    assert lines[-1].startswith("baosky  16#80C5 !  The partner closed during the job  ")
    assert lines[-1].endswith("  TRCV_C TSEND_C TSEND TRCV")


def test_a_block_narrows_the_table() -> None:
    codes = [one.row.code for one in find_explanations([TCP], None, "tsend_c")]
    assert 0x7005 in codes
    assert 0x7006 not in codes


def test_all_dialects_are_asked_unless_one_is_named() -> None:
    assert select_dialects([TCP], None) == (TCP,)
    assert select_dialects([TCP], "Baosky") == (TCP,)


@pytest.mark.parametrize(
    ("code", "block", "line"),
    [
        (
            0x1234,
            None,
            "CODE: found 16#1234, expected a code in the table of baosky; "
            "`trcvtui status --dialect baosky` lists them",
        ),
        (
            0x7006,
            "TSEND_C",
            "CODE: found 16#7006, expected a code in the table of TSEND_C (baosky); "
            "`trcvtui status --dialect baosky` lists them",
        ),
        (None, "TRVC_C", "--block: found 'TRVC_C', expected one of " + BLOCKS),
    ],
)
def test_what_is_in_no_table_is_a_mistake_of_one_line(code: int | None, block: str | None, line: str) -> None:
    with pytest.raises(UserError) as raised:
        find_explanations([TCP], code, block)
    assert raised.value.lines() == [line]


def test_an_unknown_dialect_is_answered_with_the_names_that_exist() -> None:
    with pytest.raises(UserError) as raised:
        select_dialects([TCP], "siemnes")
    assert raised.value.lines() == ["--dialect: found 'siemnes', expected one of baosky"]


@pytest.mark.parametrize(
    ("text", "codes"),
    [
        ("23", [23]),
        ("10", [10]),
        ("257", [257]),
        ("16#17", [23]),
        ("16#0101", [257]),
        ("7006", [0x7006]),  # of the TRCV_C that stands there, in hex as ever
        ("80C5", [0x80C5]),
    ],
)
def test_a_decimal_is_the_number_that_the_pin_error_shows_and_a_word_of_trcv_c_stays_hex(
    text: str, codes: list[int]
) -> None:
    found = find_explanations([TWINCAT], parse_code(text), None, parse_number(text))
    assert [one.row.code for one in found] == codes


def test_a_number_that_no_block_shows_is_named_in_both_readings() -> None:
    with pytest.raises(UserError) as raised:
        find_explanations([TWINCAT], parse_code("16"), None, parse_number("16"))
    assert raised.value.lines() == [
        "CODE: found 16#0016, or the number 16, expected a code in the table of twincat; "
        "`trcvtui status --dialect twincat` lists them"
    ]


@pytest.mark.parametrize("name", ["ReceiveData", "receivedata", "RECEIVEDATA"])
def test_a_block_is_found_however_its_name_is_written(name: str) -> None:
    assert 23 in [one.row.code for one in find_explanations([TWINCAT], None, name)]
    assert 10 not in [one.row.code for one in find_explanations([TWINCAT], None, name)]
