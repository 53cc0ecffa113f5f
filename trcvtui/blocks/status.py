"""A vendor's STATUS table: each STATUS word, its condition, and advice for the reader."""

from __future__ import annotations

import re
from enum import StrEnum
from typing import Final

from msgspec import Struct

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.table import BLOCKS

_BLOCK_NAMES_PATTERN: Final = re.compile(r"\b([A-Z_]+(?:, [A-Z_]+)*): ")


class Reproducibility(StrEnum):
    REAL = "real"
    LOGIC = "logic"
    NAMESPACE = "namespace"
    INJECTED = "injected only"
    NEVER = "not on this bench"


class StatusRow(Struct, frozen=True):
    """One code. `manual` is the manual's section on this code, `blocks` the blocks that list the code.

    If `reach` is NEVER, `unreached` says why nothing here shows the code, and `condition` may be None.
    `unsure`: what no manual says about the code, so that a real PLC may differ.
    """

    code: int
    condition: Condition | None
    blocks: tuple[str, ...]
    title: str
    causes: tuple[str, ...]
    checks: tuple[str, ...]
    reach: Reproducibility
    manual: str
    error: bool = True
    also: tuple[Condition, ...] = ()  # further conditions that show this code
    unreached: str = ""
    unsure: str = ""

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Return every condition that shows this code on its blocks."""
        return self.also if self.condition is None else (self.condition, *self.also)

    @property
    def word(self) -> str:
        return f"16#{self.code:04X}"

    def checks_of(self, block: str) -> tuple[str, ...]:
        """Return what to check at this block. Lines that begin with names of other blocks are left out."""
        return tuple(line for line in self.checks if _is_for_block(line, block))

    def causes_of(self, block: str) -> tuple[str, ...]:
        return tuple(line for line in self.causes if _is_for_block(line, block))


def unreached_row(
    code: int,
    blocks: tuple[str, ...],
    title: str,
    causes: tuple[str, ...],
    checks: tuple[str, ...],
    manual: str,
    unreached: str,
    unsure: str = "",
) -> StatusRow:
    """Return a row that nothing on this bench shows."""
    never = Reproducibility.NEVER
    return StatusRow(
        code, None, blocks, title, causes, checks, never, manual, unreached=unreached, unsure=unsure
    )


def _is_for_block(line: str, block: str) -> bool:
    named = [set(names.split(", ")) for names in _BLOCK_NAMES_PATTERN.findall(line)]
    begins = _BLOCK_NAMES_PATTERN.match(line) is not None and named[0] <= BLOCKS.keys()
    return not begins or any(block in names for names in named)
