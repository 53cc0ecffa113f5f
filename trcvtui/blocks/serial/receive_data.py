"""ReceiveData: frames of any bytes (receivedata.md 2.1)."""

from __future__ import annotations

from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.framing.frame import Framing
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.serial.reception import Reception
from trcvtui.blocks.serial.serial_binding import SerialBinding

MILLISECOND = 1_000_000


class ReceiveData:
    """One ReceiveData instance."""

    def __init__(self, bound: SerialBinding) -> None:
        self.job = Reception(bound, self._deliver)
        self._data, self._prefix, self._suffix = bound.data, bound.prefix, bound.suffix

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call, in the order of receivedata.md 4."""
        if inputs.reset:
            return self.job.reset()
        wrong = self._wrong(inputs)
        if wrong is not None:
            return self.job.refuse(*wrong)
        assert self._data is not None
        framing = Framing(
            inputs.sizereceivedata,
            _pointed(self._prefix, inputs.lenprefix),
            _pointed(self._suffix, inputs.lensuffix),
            inputs.timeout * MILLISECOND,
        )
        return self.job.call(framing, self._data.shape)

    def stop(self, reason: str) -> None:
        """Throw the part of a frame away."""
        self.job.drop(reason)

    def leave(self, reason: str) -> None:
        """Be gone."""
        self.job.drop(reason)

    def _wrong(self, inputs: Inputs) -> tuple[Condition, Cause] | None:
        """Return the first of errors 21, 22 and 20 that the inputs have (step 3)."""
        if self._data is None:
            return Condition.NULL_RECEIVE_POINTER, Cause(
                Why.PARAMETER, "pReceiveData is 0", pin="pReceiveData"
            )
        size, room = inputs.sizereceivedata, self._data.size
        if not 0 < size <= room:
            name = "SizeReceiveData is not greater than 0" if size <= 0 else "the variable is smaller"
            pin = "SizeReceiveData"
            return Condition.RECEIVE_LENGTH_WRONG, Cause(Why.PARAMETER, name, pin=pin, have=room, need=size)
        for name, area, length in (
            ("pPrefix", self._prefix, inputs.lenprefix),
            ("pSuffix", self._suffix, inputs.lensuffix),
        ):
            room = area.size if area is not None else 0
            if length > room:
                cause = Cause(Why.PARAMETER, f"{name} points to less", pin=name, have=room, need=length)
                return Condition.NULL_POINTER, cause
        return None

    def _deliver(self, content: bytes) -> None:
        """Bytes behind the frame keep their old values (step 10)."""
        assert self._data is not None
        self._data.write(0, content)


def _pointed(area: DataArea | None, length: int) -> bytes:
    return bytes(area.content[:length]) if area is not None else b""
