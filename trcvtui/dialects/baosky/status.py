"""The STATUS table of the Baosky TCP blocks (manual 7.15.1, 7.15.2, 7.15.5 to 7.15.9): one row a code."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from trcvtui.blocks.status import StatusRow
from trcvtui.dialects.baosky.connection_errors import CONNECTION_ERRORS
from trcvtui.dialects.baosky.job_errors import JOB_ERRORS
from trcvtui.dialects.baosky.states import STATES

# The lists are those of the manual as far as they could be read (baosky.md sections 4 and 5), and what a
# block cannot help showing: 0000 while the PLC is in STOP, 8087 when a lost connection is released, 80AB
# when its link is dead, 80AC when the queue is full; TCON, and T_RESET after a reset, the words of every
# set-up. 7000 is the idle word of blocks that have no connection.

# fmt: off
INNER_BLOCKS: Final[dict[str, tuple[int, ...]]] = {
    "TCON": (
        0x0000, 0x0001, 0x7000, 0x7001, 0x7002, 0x7004,
        0x8080, 0x8081, 0x8082, 0x8083, 0x8084, 0x8086, 0x8087, 0x80A0, 0x80AB, 0x80AC,
    ),
    "TDISCON": (0x0000, 0x7003, 0x7007, 0x8087, 0x80A2, 0x80AC),
    "T_RESET": (
        0x0000, 0x7002, 0x7003, 0x7004, 0x7007, 0x8000,
        0x8080, 0x8081, 0x8082, 0x8083, 0x8084, 0x8086, 0x8087, 0x80A0, 0x80A3, 0x80AC,
    ),
    "TSEND": (
        0x0000, 0x7000, 0x7004, 0x7005, 0x7009,
        0x8087, 0x80A1, 0x80A4, 0x80A5, 0x80A7, 0x80A8, 0x80A9, 0x80AB, 0x80C3, 0x80C5,
    ),
    "TRCV": (
        0x0000, 0x7000, 0x7004, 0x7006, 0x7008,
        0x8087, 0x80A1, 0x80A4, 0x80A5, 0x80A6, 0x80A7, 0x80AA, 0x80AB, 0x80C3, 0x80C5,
    ),
}
# fmt: on


def with_inner_blocks(rows: Iterable[StatusRow]) -> tuple[StatusRow, ...]:
    """Return the rows of the _C blocks with the inner blocks that show the same code behind them."""
    return tuple(replace(row, blocks=(*row.blocks, *_showing(row.code))) for row in rows)


def _showing(code: int) -> tuple[str, ...]:
    return tuple(block for block, codes in INNER_BLOCKS.items() if code in codes)


STATUS: Final[tuple[StatusRow, ...]] = with_inner_blocks(STATES + CONNECTION_ERRORS + JOB_ERRORS)
