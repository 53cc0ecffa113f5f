"""The questionnaire: everything that a vendor may decide, as one frozen record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from trcvtui.blocks.conditions import Condition
from trcvtui.net.policy import Policy


class NotConnected(Enum):
    """How long "asked for data, not connected" shows (design 6, row 3)."""

    PULSE = "pulse"
    HOLD = "hold"
    NEVER = "never"


@dataclass(frozen=True, slots=True)
class Rules:
    """One vendor's answers. Lengths in bytes."""

    status: Mapping[Condition, int]
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
