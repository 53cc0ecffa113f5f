"""ReceiveString and ReceiveString255: frames of text, with a byte 00 behind it (receivedata.md 2.2)."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.framing.frame import Ending, Framing
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.serial.receive_data import MILLISECOND
from trcvtui.blocks.serial.reception import Reception
from trcvtui.blocks.serial.serial_binding import SerialBinding

TEXTS: Final = {
    Ending.SUFFIX: Condition.FRAME_RECEIVED,
    Ending.GAP: Condition.FRAME_GAP,
    Ending.OVERRUN: Condition.STRING_OVERRUN,
}


class ReceiveString:
    """One ReceiveString instance."""

    longest = 80

    def __init__(self, bound: SerialBinding) -> None:
        self.job = Reception(bound, self._deliver, TEXTS)
        self._data, self._prefix, self._suffix = bound.data, bound.prefix, bound.suffix

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call."""
        if inputs.reset:
            return self.job.reset()
        if self._data is None or self._data.size < 2:
            cause = Cause(Why.PARAMETER, "ReceivedString is no STRING", pin="ReceivedString")
            return self.job.refuse(Condition.NULL_RECEIVE_POINTER, cause)
        longest = min(self.longest, self._data.size - 1)  # one byte is the 00 behind the text
        timeout = inputs.timeout * MILLISECOND
        framing = Framing(longest, text_of(self._prefix), text_of(self._suffix), timeout, text=True)
        return self.job.call(framing, self._data.shape)

    def stop(self, reason: str) -> None:
        """Throw the part of a text away."""
        self.job.drop(reason)

    def leave(self, reason: str) -> None:
        """Be gone."""
        self.job.drop(reason)

    def _deliver(self, content: bytes) -> None:
        assert self._data is not None
        self._data.write(0, content + b"\0")


class ReceiveString255(ReceiveString):
    """One ReceiveString255 instance: only the length differs."""

    longest = 255


def text_of(area: DataArea | None) -> bytes:
    """Return the characters of a STRING, up to its byte 00; of no STRING: none."""
    return bytes(area.content).partition(b"\0")[0] if area is not None else b""
