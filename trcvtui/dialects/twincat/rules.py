"""Beckhoff TwinCAT: the blocks of Tc2_SerialCom, behind a TRCV_C where the bytes come over TCP.

Beckhoff has no TRCV_C: it stands here for whatever brings a stream, and answers as Baosky's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from trcvtui.blocks.rules import Rules
from trcvtui.blocks.status import StatusRow
from trcvtui.dialects.baosky.rules import BAOSKY
from trcvtui.dialects.dialect import Dialect, Switch, SwitchValue, codes_of
from trcvtui.dialects.twincat.errors import COM_ERRORS, SERIAL

STREAMS: Final = ("TRCV_C", "TSEND_C")


def _kept(row: StatusRow) -> StatusRow | None:
    blocks = tuple(block for block in row.blocks if block in STREAMS)
    return replace(row, blocks=blocks) if blocks else None


FOLLOWS_EN_R: Final = Switch(
    "reset_framer_with_en_r",
    "bool",
    False,
    "the part of a frame is thrown away when EN_R of the TRCV_C in front of it falls",
)
STREAM_ROWS: Final = tuple(kept for row in BAOSKY.status if (kept := _kept(row)) is not None)


def answer(values: Mapping[str, SwitchValue]) -> Rules:
    """Return the rules for these switch values."""
    follows = bool(dict(values).get(FOLLOWS_EN_R.name, FOLLOWS_EN_R.default))
    return replace(BAOSKY.answer(values), status_of=codes_of(COM_ERRORS), part_follows_en_r=follows)


TWINCAT: Final = Dialect(
    name="twincat",
    title="Beckhoff TwinCAT 3, Tc2_SerialCom; TRCV_C and TSEND_C as Baosky's",
    blocks=(*SERIAL, *STREAMS),
    status=tuple(sorted((*COM_ERRORS, *STREAM_ROWS), key=lambda row: row.code)),
    switches=(*BAOSKY.switches, FOLLOWS_EN_R),
    models={"TC3": 32},
    default_model="TC3",
    layout="codesys-8",
    answer=answer,
)
