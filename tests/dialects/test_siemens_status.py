"""The Siemens STATUS tables against the code lists of the STEP 7 help, and what a block can show."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reproducibility
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.siemens.states import ALL_BLOCKS
from trcvtui.dialects.siemens.status import STATUS

ROOT = Path(__file__).parents[2]

# fmt: off
# By the STEP 7 help; what a _C block passes through from TCON, TSEND, TRCV stands after the first break.
LISTED = {
    "TSEND_C": [
        0x0000, 0x0001, 0x0003, 0x7000, 0x7001, 0x7002, 0x7003, 0x7004, 0x7005,
        0x8085, 0x8086, 0x8087, 0x8088, 0x8089, 0x8091, 0x809A, 0x809B, 0x80A1, 0x80A3, 0x80A4, 0x80A7,
        0x80AA,
        0x80B3, 0x80B4, 0x80B5, 0x80B6, 0x80B7, 0x80C3, 0x80C4, 0x80C5, 0x80C6,
        0x8722, 0x873A, 0x877F, 0x8822, 0x8824, 0x8832, 0x883A, 0x887F, 0x893A,
        0x80A2, 0x80B1, 0x80CE, 0x80D0, 0x80D1, 0x80D2, 0x80D3,
    ],
    "TRCV_C": [
        0x0000, 0x0001, 0x0003, 0x7000, 0x7001, 0x7002, 0x7003, 0x7004, 0x7006,
        0x8085, 0x8086, 0x8087, 0x8088, 0x8089, 0x8091, 0x809A, 0x809B, 0x80A1, 0x80A3, 0x80A4, 0x80AA,
        0x80B3, 0x80B4, 0x80B5, 0x80B6, 0x80B7, 0x80C3, 0x80C4, 0x80C5, 0x80C6,
        0x8722, 0x873A, 0x877F, 0x8922, 0x8924, 0x8932, 0x893A, 0x897F, 0x8A3A,
        0x80A2, 0x80C9, 0x80CE, 0x80D0, 0x80D1, 0x80D2, 0x80D3,
    ],
    "TCON": [
        0x0000, 0x7000, 0x7001, 0x7002, 0x8085, 0x8086, 0x8087, 0x8089, 0x8090, 0x809A, 0x809B, 0x809C,
        0x80A1, 0x80A2, 0x80A3, 0x80A4, 0x80A7, 0x80B4, 0x80B5, 0x80B6, 0x80B7, 0x80B8,
        0x80C3, 0x80C4, 0x80C5, 0x80C6, 0x80C7, 0x80C8, 0x80C9, 0x80CE, 0x80D0, 0x80D1, 0x80D2, 0x80D3,
        0x80E0, 0x80E1, 0x80E2, 0x80E3, 0x80E4, 0x80E5, 0x80E6, 0x80E7, 0x80E9, 0x80EA, 0x80EB, 0x80EC,
        0x80ED,
    ],
    "TSEND": [
        0x0000, 0x7000, 0x7001, 0x7002, 0x8085, 0x8086, 0x8088,
        0x80A1, 0x80B1, 0x80B3, 0x80C3, 0x80C4, 0x80C5, 0x80C6, 0x80C7, 0x80EE,
    ],
    "TRCV": [
        0x0000, 0x7000, 0x7001, 0x7002, 0x8085, 0x8086, 0x8088,
        0x80A1, 0x80B1, 0x80B3, 0x80C3, 0x80C4, 0x80C5, 0x80C6, 0x80C7, 0x80C9, 0x80EE,
    ],
    "TDISCON": [0x0000, 0x7000, 0x7001, 0x7002, 0x8086, 0x80A3, 0x80C4],
    "T_RESET": [0x0000, 0x0001, 0x7000, 0x7001, 0x7002, 0x8081],
    "T_DIAG": [0x0000, 0x7000, 0x7001, 0x7002, 0x8086, 0x8089, 0x80A3, 0x80B1, 0x80C4],
    "TUSEND": [
        0x0000, 0x7000, 0x7001, 0x7002, 0x8085, 0x8086, 0x8088, 0x8089, 0x80A1, 0x80A4, 0x80B1, 0x80B3,
        0x80B7,
        0x80C3, 0x80C4, 0x80C5, 0x80C6, 0x80C7, 0x80D3, 0x80EA,
    ],
    "TURCV": [
        0x0000, 0x7000, 0x7001, 0x7002, 0x8085, 0x8086, 0x8088, 0x8089, 0x80A1, 0x80B1, 0x80B3, 0x80B7,
        0x80C3, 0x80C4, 0x80C5, 0x80C7, 0x80C9, 0x80EA,
    ],
}
# fmt: on


def conditions(names: str) -> set[Condition]:
    return {Condition[name] for name in names.split()}


_SET_UP = conditions(
    """
    NO_SOCKET QUEUE_FULL WRONG_LOCAL_ADDRESS NOT_NOW PORT_IN_USE PORT_RESERVED REFUSED UNREACHABLE
    REMOTE_WRONG NO_DESCRIPTION DESCRIPTION_LENGTH ID_WRONG INTERFACE_WRONG INTERFACE_BARE TYPE_WRONG
    NEEDS_ADDR UDP_ACTIVE TSAP_WRONG PARAMETER_WRONG NAME_EMPTY NAME_NOT_FULL NO_RESOLVER NAME_UNKNOWN
    TLS_MESSAGE TLS_HANDSHAKE TLS_UNSUPPORTED TLS_DISCARDED TLS_NO_CA TLS_EXPIRED TLS_INTEGRITY
    TLS_EXTENSION TLS_SERVER_BARE TLS_DATAGRAMS TLS_CLIENT_ASKS TLS_SERVER_CHECKS TLS_REFERENCE
    """
)
_COURSE = conditions(
    """
    NOT_CALLED NO_JOB CREATING CREATED ESTABLISHING CLOSING CONNECTED JOB_BEGINS ESTABLISHED CLOSED
    POLL_DEL_FAILED DISCONNECT_FAILED RESET_FAILED FOUND_CLOSED LET_GO
    """
)
_AREA = conditions(
    """
    DATA_MISSING DATA_EMPTY DATA_REFUSED DATA_SYMBOLIC LENGTH_WRONG LEN_OVER_DATA AREA_CHANGED
    NO_BUFFER CONNECT_IN_USE
    """
)
_LOSS = {Condition.PARTNER_CLOSED, Condition.LINK_DEAD}
_SENDS = {Condition.SENT, Condition.SEND_BUFFER_FULL, Condition.SEND_FAILED}
_RECEIVES = {Condition.RECEIVED, Condition.RECEIVE_FAILED, Condition.MESSAGE_TOO_LONG}
_SINGLE = {Condition.NOT_CALLED, Condition.NO_JOB, Condition.STARTED, Condition.RUNNING}
_ENDS = _SINGLE | {Condition.FINISHED}

# A TCON_Param, the one description that they take, has no name and no certificate.
_NAMES_AND_TLS = {c for c in Condition if c.name.startswith(("TLS_", "NAME_"))} | {Condition.NO_RESOLVER}
NOT_BEFORE_3 = _NAMES_AND_TLS

# What each block can show: the conditions that its code makes.
CAN_SHOW = {
    "TSEND_C": _SET_UP | _COURSE | _AREA | _LOSS | _SENDS | {Condition.SENDING, Condition.RESET_IN_JOB},
    "TRCV_C": _SET_UP
    | _COURSE
    | _AREA
    | _LOSS
    | _RECEIVES
    | {Condition.RECEIVING, Condition.RECEIVING_PART, Condition.STILL_ASKED},
    "TCON": _SET_UP | _ENDS | {Condition.ENDPOINT_THERE, Condition.RESET_IN_JOB},
    "TDISCON": _ENDS
    | {
        Condition.ENDPOINT_GONE,
        Condition.QUEUE_FULL,
        Condition.POLL_DEL_FAILED,
        Condition.DISCONNECT_FAILED,
    },
    "T_RESET": _ENDS
    | {
        Condition.NOTHING_TO_RESET,
        Condition.ENDPOINT_GONE,
        Condition.QUEUE_FULL,
        Condition.POLL_DEL_FAILED,
        Condition.RESET_FAILED,
    },
    "T_DIAG": _ENDS | {Condition.ENDPOINT_GONE, Condition.RESULT_WRONG, Condition.AREA_CHANGED},
    "TSEND": _SINGLE | _AREA | _LOSS | _SENDS | {Condition.NOT_CONNECTED},
    "TRCV": _SINGLE | _AREA | _LOSS | _RECEIVES | {Condition.NOT_CONNECTED, Condition.STILL_ASKED},
    "TUSEND": _SINGLE
    | _AREA
    | _SENDS
    | {Condition.NOT_CONNECTED, Condition.REMOTE_WRONG, Condition.NEEDS_ADDR},
    "TURCV": _SINGLE | _AREA | _RECEIVES | {Condition.NOT_CONNECTED},
}


def test_a_block_has_a_row_for_each_code_and_each_condition_and_one_alone() -> None:
    wrong: list[tuple[object, ...]] = []
    for block in ALL_BLOCKS:
        rows = [row for row in STATUS if block in row.blocks]
        codes = Counter(row.word for row in rows)
        wrong += [(block, code) for code, times in codes.items() if times > 1]
        wrong += [(block, code) for code in LISTED[block] if f"16#{code:04X}" not in codes]
        conditions = Counter(condition for row in rows for condition in row.conditions)
        wrong += [(block, condition) for condition in CAN_SHOW[block] if conditions[condition] != 1]
    assert wrong == []


def test_all_blocks_of_the_dialect_have_rows_and_no_others() -> None:
    listed = {block for row in STATUS for block in row.blocks}
    assert listed == set(ALL_BLOCKS) == set(DIALECTS["s7-1500"].blocks) == set(DIALECTS["s7-1200"].blocks)


def test_what_a_block_shows_is_what_its_row_says() -> None:
    rules = DIALECTS["s7-1500"].answer({})
    assert rules.status_word("TSEND_C", Condition.RESET_IN_JOB) == 0x80A7
    assert rules.status_word("T_RESET", Condition.ENDPOINT_GONE) == 0x8081
    assert rules.status_word("TDISCON", Condition.ENDPOINT_GONE) == 0x80A3
    assert (
        rules.status_word("TSEND_C", Condition.DATA_REFUSED),
        rules.status_word("TRCV", Condition.DATA_REFUSED),
    ) == (
        0x8824,
        0x8924,
    )
    assert rules.status_word("TUSEND", Condition.SEND_FAILED) == 0x80C6


def test_instructions_before_3_have_one_row_for_each_condition_that_they_can_show() -> None:
    legacy = DIALECTS["s7-1200-legacy"]
    for block in legacy.blocks:
        rows = Counter(c for row in legacy.status if block in row.blocks for c in row.conditions)
        assert {str(c): rows[c] for c in CAN_SHOW[block] - NOT_BEFORE_3 if rows[c] != 1} == {}
        assert {str(c) for c in _NAMES_AND_TLS if rows[c]} == set()


@pytest.mark.parametrize(
    ("switch", "words"),
    [("figures", (0x7002, 0x7005, 0x7006, 0x7006)), ("help", (0x7001, 0x7002, 0x7006, 0x7002))],
)
def test_instructions_before_3_show_the_words_of_the_figures_or_of_their_help(
    switch: str, words: tuple[int, ...]
) -> None:
    rules = DIALECTS["s7-1200-legacy"].answer({"status_sequence": switch})
    asked = (
        ("TSEND_C", Condition.ESTABLISHING),
        ("TSEND_C", Condition.SENDING),
        ("TRCV_C", Condition.RECEIVING),
        ("TRCV_C", Condition.RECEIVING_PART),
    )
    assert tuple(rules.status_word(*each) for each in asked) == words
    assert rules.status_word("TRCV_C", Condition.LINK_DONE) == 0x0000


def test_a_scenario_that_a_row_names_is_there() -> None:
    named = {
        word.strip("`") for row in STATUS for check in row.checks for word in check.split() if ".toml" in word
    }
    assert named
    assert [path for path in named if not (ROOT / path).exists()] == []


def test_a_code_that_no_manual_is_clear_about_says_so() -> None:
    of_c_blocks = (0x7003, "TSEND_C"), (0x7001, "TRCV_C"), (0x80C4, "TRCV_C"), (0x80A3, "TSEND_C")
    of_others = (0x8824, "TSEND"), (0x80B4, "TCON"), (0x80E4, "TCON"), (0x809A, "TCON")
    for code, block in (*of_c_blocks, *of_others):
        [row] = [row for row in STATUS if row.code == code and block in row.blocks]
        assert len(row.unsure) > 20


def test_instructions_before_3_send_nobody_to_a_block_or_a_pin_that_they_do_not_have() -> None:
    legacy = DIALECTS["s7-1200-legacy"]
    told = [line for row in legacy.status for line in (*row.causes, *row.checks)]
    assert [line for line in told if "T_DIAG" in line or "ADHOC" in line] == []


def test_instructions_before_3_cannot_reach_names_and_certificates_and_say_why() -> None:
    rows = [row for row in DIALECTS["s7-1200-legacy"].status if 0x80D0 <= row.code < 0x80F0]
    assert len(rows) > 15
    assert {row.reach for row in rows} == {Reproducibility.NEVER}
    assert all(row.unreached for row in rows)


@pytest.mark.parametrize("name", ["s7-1500", "s7-1200", "s7-1200-legacy"])
def test_no_label_of_a_siemens_state_speaks_of_a_socket(name: str) -> None:
    dialect = DIALECTS[name]
    labels = {condition: dialect.label(condition) for row in dialect.status for condition in row.conditions}
    assert {str(c): label for c, label in labels.items() if "socket" in label} == {}
    assert labels[Condition.CREATED] == "connecting"
    assert DIALECTS["baosky"].label(Condition.CREATED) == "socket created"
