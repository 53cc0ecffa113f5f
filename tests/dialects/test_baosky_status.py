"""The Baosky STATUS table against the code lists of manual 7.15.1 and 7.15.2."""

from __future__ import annotations

from collections import Counter

import pytest

from tests.dialects.foreign import NOT_BAOSKYS
from trcvtui.blocks.conditions import ERROR_CONDITIONS, Condition
from trcvtui.blocks.status import Reproducibility, StatusRow
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.baosky.status import STATUS

# fmt: off
RECEIVE_CODES = [
    0x0000, 0x0001, 0x7000, 0x7001, 0x7002, 0x7003, 0x7004, 0x7006, 0x7007, 0x7008, 0x8000,
    0x8080, 0x8081, 0x8082, 0x8083, 0x8084, 0x8086, 0x8087,
    0x80A0, 0x80A1, 0x80A2, 0x80A3, 0x80A4, 0x80A5, 0x80A6, 0x80A7, 0x80AA, 0x80AB, 0x80AC, 0x80C3, 0x80C5,
]
SEND_CODES = [
    0x0000, 0x0001, 0x7000, 0x7001, 0x7002, 0x7003, 0x7004, 0x7005, 0x7007, 0x7009, 0x8000,
    0x8080, 0x8081, 0x8082, 0x8083, 0x8084, 0x8086, 0x8087,
    0x80A0, 0x80A1, 0x80A2, 0x80A3, 0x80A4, 0x80A5, 0x80A7, 0x80A8, 0x80A9, 0x80AB, 0x80AC, 0x80C3, 0x80C5,
]
# What could be read of 7.15.5 to 7.15.9.
LISTED = {
    "TCON": [0x7002, 0x7004],
    "TDISCON": [0x0000, 0x7003, 0x7007, 0x8087, 0x80A2, 0x80AC],
    "T_RESET": [0x0000, 0x7002, 0x7003, 0x7004, 0x7007, 0x8000, 0x8080, 0x8081, 0x8082, 0x8083, 0x80A3],
    "TSEND": [
        0x7000, 0x7004, 0x7005, 0x7009,
        0x80A1, 0x80A4, 0x80A5, 0x80A7, 0x80A8, 0x80A9, 0x80AB, 0x80C3, 0x80C5,
    ],
    "TRCV": [
        0x7000, 0x7004, 0x7006, 0x7008,
        0x80A1, 0x80A4, 0x80A5, 0x80A6, 0x80A7, 0x80AA, 0x80AB, 0x80C3, 0x80C5,
    ],
}
OF_A_JOB = {0x7005, 0x7006, 0x7008, 0x7009, 0x80A1, 0x80A4, 0x80A5, 0x80A6, 0x80A7, 0x80C3, 0x80C5}
# fmt: on
SECTIONS = {"TRCV_C": 1, "TSEND_C": 2, "TCON": 5, "TDISCON": 6, "T_RESET": 7, "TSEND": 8, "TRCV": 9}
SEND_ONLY = {Condition.SENDING, Condition.SENT, Condition.SEND_BUFFER_FULL, Condition.SEND_FAILED}
RECEIVE_ONLY = {Condition.RECEIVING, Condition.RECEIVED, Condition.SHORT_FRAME, Condition.RECEIVE_FAILED}


@pytest.mark.parametrize(("block", "codes"), [("TRCV_C", RECEIVE_CODES), ("TSEND_C", SEND_CODES)])
def test_a_block_lists_exactly_the_codes_of_its_manual_page_in_order(block: str, codes: list[int]) -> None:
    assert [row.code for row in STATUS if block in row.blocks] == codes


@pytest.mark.parametrize("block", LISTED)
def test_an_inner_block_lists_the_codes_of_its_manual_page_and_a_stop(block: str) -> None:
    codes = [row.code for row in STATUS if block in row.blocks]
    assert {0x0000, *LISTED[block]} <= set(codes)


def test_tdiscon_lists_nothing_but_the_complete_list_of_its_page() -> None:
    assert [row.code for row in STATUS if "TDISCON" in row.blocks] == LISTED["TDISCON"]


@pytest.mark.parametrize("block", ["TCON", "TDISCON", "T_RESET"])
def test_a_block_that_moves_no_bytes_lists_no_code_of_a_job(block: str) -> None:
    codes = {row.code for row in STATUS if block in row.blocks}
    assert not codes & OF_A_JOB


def test_no_inner_block_lists_what_neither_c_block_does() -> None:
    assert [row.word for row in STATUS if not {"TRCV_C", "TSEND_C"} & set(row.blocks)] == []


def test_a_row_names_the_manual_sections_of_its_c_blocks() -> None:
    for row in STATUS:
        sections = row.manual.removeprefix("Baosky library manual ").split(", ")
        assert sections == sorted(sections)
        assert {f"7.15.{SECTIONS[b]}" for b in row.blocks if b.endswith("_C")} <= set(sections)


@pytest.mark.parametrize(("block", "foreign"), [("TRCV_C", SEND_ONLY), ("TSEND_C", RECEIVE_ONLY)])
def test_each_condition_that_a_block_can_show_has_exactly_one_row(
    block: str, foreign: set[Condition]
) -> None:
    rows = Counter(row.condition for row in STATUS if block in row.blocks)
    assert rows == Counter(set(Condition) - foreign - NOT_BAOSKYS)


def test_no_two_rows_have_the_same_code() -> None:
    codes = Counter(row.code for row in STATUS)
    assert [code for code, rows in codes.items() if rows > 1] == []


def test_a_row_of_any_dialect_says_what_it_means_what_to_look_at_next_and_where_it_stands() -> None:
    manuals = {"baosky": "Baosky library manual 7.15.", "s7-1500": "STEP 7 help"}
    for name, manual in manuals.items():
        wrong = [row.word for row in DIALECTS[name].status if not is_sound(row, manual)]
        assert wrong == []


def is_sound(row: StatusRow, manual: str) -> bool:
    """Return whether flags, texts and the manual of a row are as each row has them."""
    texts = (*row.causes, *row.checks)
    return (
        row.error == (row.code > 0x8000)  # 8000: a reset in progress
        and {condition in ERROR_CONDITIONS for condition in row.conditions} <= {row.error}
        and (row.reach is Reproducibility.NEVER) == bool(row.unreached) == (row.condition is None)
        and 3 < len(row.title) <= 46
        and all(2 <= len(said) <= 4 and len(set(said)) == len(said) for said in (row.causes, row.checks))
        and all(12 < len(line) <= 130 and line.isprintable() and line == line.strip() for line in texts)
        and row.manual.startswith(manual)
    )


def test_a_status_that_a_cut_line_does_not_change_says_so() -> None:
    quiet = {Condition.CONNECTED, Condition.RECEIVING}
    rows = [(name, row) for name, one in DIALECTS.items() for row in one.status if quiet & {*row.conditions}]
    wrong = [(name, row.word) for name, row in rows if "a cut line" not in " ".join(row.causes + row.checks)]
    assert wrong == [] and len(rows) > 2 * len(DIALECTS)


@pytest.mark.parametrize(
    ("reach", "codes"),
    [
        (Reproducibility.LOGIC, [0x0000, 0x0001, 0x7000, 0x80A1, 0x80A4, 0x80A5, 0x80A7, 0x80AC, 0x80C3]),
        (Reproducibility.NAMESPACE, [0x80AB]),
        (Reproducibility.INJECTED, [0x8082, 0x8084, 0x8087]),
    ],
)
def test_what_plain_traffic_cannot_bring_about_is_marked(reach: Reproducibility, codes: list[int]) -> None:
    assert [row.code for row in STATUS if row.reach is reach] == codes


def test_what_concerns_another_block_is_not_among_the_checks_of_one() -> None:
    row = next(row for row in STATUS if row.code == 0x7004)
    assert any(line.startswith("TRCV_C: ") for line in row.checks_of("TRCV_C"))
    assert not any("TSEND_C" in line for line in (*row.checks_of("TRCV_C"), *row.causes_of("TRCV_C")))
    assert any(line.startswith("TSEND_C: ") for line in row.checks_of("TSEND_C"))
    idle = next(row for row in STATUS if row.code == 0x7000)
    assert any(line.startswith("TCON: ") for line in idle.causes_of("TSEND"))
    assert not any(line.startswith("TCON: ") for line in idle.causes_of("TRCV_C"))
