"""ClearComBuffer: empty a ComBuffer (receivedata.md 2.2; from memory, no page of the manual found)."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.block import NoJob
from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.serial.sending import NOT_CALLED
from trcvtui.blocks.serial.serial_binding import SerialBinding

IDLE: Final = Outcome(Condition.NO_JOB, NOT_CALLED)
EMPTIED: Final = Outcome(Condition.BUFFER_EMPTY, Cause(Why.INPUT, "EN is 1", pin="EN", value=1))


class ClearComBuffer:
    """One ClearComBuffer instance; it has no outputs."""

    def __init__(self, bound: SerialBinding) -> None:
        self.job = NoJob()
        self._buffer = bound.buffer

    def call(self, inputs: Inputs) -> Outcome:
        """Empty the buffer while EN is 1; what a block has taken of a frame stays with the block."""
        if not inputs.en:
            return IDLE
        self._buffer.empty(f"{type(self).__name__}")
        return EMPTIED

    def stop(self, reason: str) -> None:
        """Nothing runs."""

    def leave(self, reason: str) -> None:
        """Be gone."""
