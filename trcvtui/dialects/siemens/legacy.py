"""Siemens S7-1200 with instructions before 3.0 (CPU up to V4.0): what differs (siemens.md 1.11)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.rules import Rules
from trcvtui.blocks.status import Reach, StatusRow
from trcvtui.dialects.dialect import Dialect, SwitchValue, codes_of
from trcvtui.dialects.siemens.blocks import BOTH_C, RCV_C, SEND_C
from trcvtui.dialects.siemens.connection_errors import LEGACY_ERRORS
from trcvtui.dialects.siemens.rules import S7_1200, SEQUENCES, WORDS, Cpu, answer, with_default
from trcvtui.dialects.siemens.status import STATUS

AD_HOC: Final = frozenset({0, 65535})  # LEN, where there is no ADHOC pin; 65535 in the older manual
CPU: Final = Cpu(8192, 1472, 8, True, True)
MANUAL: Final = "siemens.md 1.11"
UNSURE: Final = "what instructions before 3.0 show between these words is pieced together from two help pages"

BLOCKS: Final = tuple(block for block in S7_1200.blocks if block != "T_DIAG")
_NEWER_ID_ERROR: Final = 0x80C8  # 80A5 here
_NOT_THESE: Final = frozenset({0x0001, 0x7005})  # of the _C blocks


# cont_mode: the status sequences are of instructions V2.0, so they, and no later manual, tell of these.
LEGACY_SWITCHES: Final = with_default("silent_connect", True)


def _row(code: int, block: str) -> StatusRow:
    return next(row for row in STATUS if row.code == code and block in row.blocks)


def _of(row: StatusRow, blocks: tuple[str, ...], *conditions: Condition, title: str, cause: str) -> StatusRow:
    """Return a row of newer instructions with what is different here."""
    first, *also = conditions
    causes = (cause, *row.causes[:3])
    return replace(
        row, condition=first, also=tuple(also), blocks=blocks, title=title, causes=causes, manual=MANUAL,
        unsure=UNSURE,
    )  # fmt: skip


OWN_ROWS: Final = (
    _of(
        _row(0x0000, "TSEND_C"), BOTH_C, Condition.LINK_DONE, Condition.NOT_CALLED, Condition.SENT,
        Condition.RECEIVED, title="Connected, or a job ended well (DONE = 1)",
        cause="DONE shows twice: once when the connection is up, once when the job has ended",
    ),
    _of(
        _row(0x7001, "TSEND_C"), BOTH_C, Condition.CREATING, Condition.CREATED, Condition.ESTABLISHING,
        title="Connecting, or waiting for the partner",
        cause="7001 stays until the connection is up; newer instructions show 7002 for that",
    ),
    _of(
        _row(0x7002, "TSEND_C"), SEND_C, Condition.SENDING,
        title="Sending",
        cause="a send job runs; newer instructions show 7005 for that",
    ),
    _of(
        _row(0x7002, "TRCV_C"), RCV_C, Condition.RECEIVING_PART,
        title="Data is being received",
        cause="some bytes of the frame are here, and the rest is awaited",
    ),
    replace(
        _row(0x7006, "TRCV_C"),
        also=(),
        title="Armed and waiting",
        causes=(
            "nothing has come: with EN_R at 1 this is the normal state of rest",
            "LEN is 0 (or 65535): ad hoc, what is there ends the job; any other LEN is awaited whole",
            "EN_R fell, and the job goes on all the same until data is there",
        ),
        checks=(
            "the partner's length against LEN; 7002 shows while part of a frame is here",
            "frames of varying length: LEN = 0, or ISO-on-TCP, which keeps their ends",
            "shifted values: one rising edge at COM_RST, then watch the first frame",
        ),
        unsure=UNSURE,
    ),
)  # fmt: skip
_OWN: Final = {(row.code, block) for row in OWN_ROWS for block in row.blocks}


# What newer instructions or structures say of themselves, and what stands for it here.
_REWORDED: Final = {
    "; T_DIAG shows State 4 while it stands": "",
    "; T_DIAG behind TDISCON ends here, too": "",
    " (T_DIAG: RESULT)": "",
    ": T_DIAG tells whether it stands": ": a TSEND or TRCV tells whether it stands",
    "ADHOC = 1 into a symbolic DATA": "LEN = 0, ad hoc, into a symbolic DATA",
}
_ONLY_TCON_PARAM: Final = "a TCON_Param, which is all these instructions take, has no name and no certificate"
_NAMES_AND_TLS: Final = range(0x80D0, 0x80F0)


def _lines(lines: tuple[str, ...]) -> tuple[str, ...]:
    """Return lines without what these instructions do not have."""
    for theirs, ours in _REWORDED.items():
        lines = tuple(line.replace(theirs, ours) for line in lines)
    return tuple(line for line in lines if "T_DIAG" not in line)


def _listed(row: StatusRow) -> StatusRow:
    """Return a row as the table has it: names and certificates are not within reach."""
    if row.code not in _NAMES_AND_TLS:
        return row
    why = row.unreached or _ONLY_TCON_PARAM
    return replace(row, condition=None, also=(), reach=Reach.NEVER, unreached=why)


def _kept(row: StatusRow) -> StatusRow | None:
    """Return what these instructions have of a row of the newer ones."""
    gone = {block for block in row.blocks if (row.code, block) in _OWN or block not in BLOCKS}
    gone |= set(BOTH_C) if row.code in _NOT_THESE else set()
    gone |= set(row.blocks) if row.code == _NEWER_ID_ERROR else set()
    blocks = tuple(block for block in row.blocks if block not in gone)
    return (
        replace(row, blocks=blocks, causes=_lines(row.causes), checks=_lines(row.checks)) if blocks else None
    )


_SHOWN: Final = (*(kept for row in STATUS if (kept := _kept(row)) is not None), *OWN_ROWS, *LEGACY_ERRORS)
LEGACY_STATUS: Final = tuple(sorted(map(_listed, _SHOWN), key=lambda row: row.code))


def legacy_answer(values: Mapping[str, SwitchValue]) -> Rules:
    """Return the rules for these switch values."""
    chosen = {switch.name: switch.default for switch in LEGACY_SWITCHES} | dict(values)
    newer = answer(chosen, CPU)
    return replace(
        newer,
        status_of=codes_of(_SHOWN),
        lacks=frozenset({"ADHOC"}),
        types={"LEN": "UINT", "RCVD_LEN": "UINT"},  # 1.11
        receiving_part=Condition.RECEIVING_PART,
        area=replace(newer.area, adhoc_lens=AD_HOC),
        course=replace(
            newer.course,
            job_begins=Condition.LINK_DONE,
            established=Condition.LINK_DONE,
            reset_closes=True,
        ),
    )


S7_1200_LEGACY: Final = Dialect(
    name="s7-1200-legacy",
    title="Siemens S7-1200 up to V4.0, instructions before 3.0",
    blocks=BLOCKS,
    status=LEGACY_STATUS,
    switches=LEGACY_SWITCHES,
    models=S7_1200.models,
    default_model=S7_1200.default_model,
    layout=S7_1200.layout,
    describes_connects=S7_1200.describes_connects,
    structures=("TCON_Param",),  # 1.11
    folder="siemens-legacy",
    words=WORDS,
    follows=SEQUENCES,
    answer=legacy_answer,
)
