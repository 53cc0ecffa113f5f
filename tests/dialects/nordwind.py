"""Nordwind, a vendor that nobody sells: the one file that a new dialect is.

Codes of its own, and a course that differs from the plain one in three answers.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from trcvtui.blocks.conditions import Condition as Is
from trcvtui.blocks.rules import NotConnectedRule, StatusRules, VendorRules
from trcvtui.blocks.status import Reproducibility, StatusRow
from trcvtui.dialects.dialect import Dialect, Switch, SwitchValue
from trcvtui.net.connection.config import ConnectionPolicy

BLOCKS: Final = ("TRCV_C", "TSEND_C")
SECOND: Final = 1_000_000_000  # ns

SWITCHES: Final = (Switch("retry", "duration", SECOND, "pause between two attempts to connect"),)

# code -> what it says, and the conditions that show it
CODES: Final[dict[int, tuple[str, tuple[Is, ...]]]] = {
    0x0010: ("Off", (Is.NOT_CALLED, Is.NO_JOB)),
    0x0020: ("Connecting", (Is.CREATING, Is.CREATED, Is.ESTABLISHING, Is.RESETTING)),
    0x0030: ("Connected", (Is.CONNECTED,)),
    0x0040: ("Sending", (Is.SENDING,)),
    0x0041: ("Sent", (Is.SENT,)),
    0x0050: ("Receiving", (Is.RECEIVING,)),
    0x0051: ("Received", (Is.RECEIVED,)),
    0x0060: ("Closing", (Is.CLOSING, Is.CLOSED)),
    0xE001: ("DATA or LEN", (Is.DATA_EMPTY, Is.LENGTH_WRONG)),
    0xE002: ("The partner is gone", (Is.PARTNER_CLOSED, Is.SHORT_FRAME, Is.LINK_DEAD, Is.SEND_FAILED)),
    0xE003: ("No connection", (Is.NOT_CONNECTED, Is.CONNECT_FAILED)),
}
EVERYTHING_ELSE: Final = 0xE0FF
_NAMED: Final = {condition for _, conditions in CODES.values() for condition in conditions}


def _row(code: int, title: str, conditions: tuple[Is, ...]) -> StatusRow:
    first, *also = conditions
    error = code >= 0xE000
    return StatusRow(
        code,
        first,
        BLOCKS,
        title,
        ("see the manual",),
        ("the cable",),
        Reproducibility.REAL,
        "3",
        error,
        tuple(also),
    )


STATUS: Final = (
    *(_row(code, title, conditions) for code, (title, conditions) in CODES.items()),
    _row(EVERYTHING_ELSE, "Another failure", tuple(each for each in Is if each not in _NAMED)),
)


def answer(values: Mapping[str, SwitchValue]) -> VendorRules:
    return VendorRules(
        status={condition: row.code for row in STATUS for condition in row.conditions},
        course=StatusRules(waiting_req_sends=True, en_r_keeps_job=True, idle_loss=Is.PARTNER_CLOSED),
        not_connected=NotConnectedRule.NEVER,
        policy=ConnectionPolicy(retry_ns=int(values.get("retry", SECOND))),
    )


NORDWIND: Final = Dialect(
    name="nordwind",
    title="Nordwind N1, TCP blocks",
    blocks=BLOCKS,
    status=STATUS,
    switches=SWITCHES,
    models={"N1": 4},
    default_model="N1",
    layout="packed",
    answer=answer,
)
