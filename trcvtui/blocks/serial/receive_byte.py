"""ReceiveByte: one byte a call (receivedata.md 2.2)."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.block import NoJob
from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Lamp, Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.serial.serial_binding import SerialBinding

EMPTY: Final = Cause(Why.WAITING, "no byte waits")
TAKEN: Final = Cause(Why.BYTES, "a byte was taken", have=1, need=1)


class ReceiveByte:
    """One ReceiveByte instance; ReceivedByte keeps its value until the next byte."""

    def __init__(self, bound: SerialBinding) -> None:
        self.job = NoJob()
        self._buffer = bound.buffer
        self._empty = Outcome(Condition.BUFFER_EMPTY, EMPTY)

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call."""
        if not self._buffer.look():
            return self._empty
        byte = self._buffer.take(1)[0]
        self._empty = Outcome(Condition.BUFFER_EMPTY, EMPTY, byte=byte)
        return Outcome(Condition.FRAME_RECEIVED, TAKEN, lamp=Lamp.DONE, byte=byte)

    def stop(self, reason: str) -> None:
        """Nothing runs."""

    def leave(self, reason: str) -> None:
        """Be gone."""
