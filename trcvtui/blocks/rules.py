"""The questionnaire: everything that a vendor may decide, as one frozen record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.course import Course
from trcvtui.net.set_up import Policy


class NotConnected(Enum):
    """How long "asked for data, not connected" shows (design 6, row 3)."""

    PULSE = "pulse"
    HOLD = "hold"
    NEVER = "never"


@dataclass(frozen=True, slots=True)
class Rules:
    """One vendor's answers. Lengths in bytes."""

    status: Mapping[Condition, int]
    status_of: Mapping[str, Mapping[Condition, int]] = field(
        default_factory=dict
    )  # where a block has its own
    single_instructions: bool = False  # TCON, TSEND, ...: one job for each edge (blocks/single)
    course: Course = field(default_factory=Course)
    longer_than_data: Condition = Condition.LENGTH_WRONG  # LEN against the size of DATA
    not_connected: NotConnected = NotConnected.PULSE
    short_frame_shown: bool = True
    reset_counts_as_close: bool = False
    com_rst_autoclear: bool = True
    max_len: int = 65535
    max_datagram: int = 2048
    large_datagram_cut: bool = False
    lock_across_tasks: bool = False
    policy: Policy = field(default_factory=Policy)
    buffers: int = 64
    queue: int = 64

    def word(self, block: str, condition: Condition) -> int:
        """Return the STATUS that a condition has on a block."""
        own = self.status_of.get(block)
        return self.status[condition] if own is None or condition not in own else own[condition]
