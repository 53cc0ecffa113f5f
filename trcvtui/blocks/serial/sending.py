"""SendData, SendString, SendByte, ClearComBuffer: what goes into a ComBuffer, or is dropped."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.block import JoblessBlock, NoJob
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, CauseKind, Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.serial.com_buffer import BufferBinding
from trcvtui.blocks.serial.receiving import string_bytes

# Rule: a block sends as often as the program calls it, so each has EN, as its box has in FBD and LD. Bytes
# without room follow in later calls (Busy); no prefix and no suffix is added.

EN_IS_0: Final = Cause(CauseKind.INPUT, "EN is 0", pin="EN", value=0)


class SendBlock(NoJob):
    """The base of the three send blocks. Of `need` bytes, `have` bytes are in the ComBuffer."""

    def __init__(self, bound: BufferBinding) -> None:
        self._env = bound.env
        self._buffer = bound.buffer
        self._data = bound.data
        self._idle = Outcome(Condition.NO_JOB, EN_IS_0)
        self._begun: tuple[int, object] | None = None  # length and data of what is being sent

    @property
    def job(self) -> SendBlock:
        return self

    def call(self, inputs: Inputs) -> Outcome:
        if not inputs.en:
            return self._idle
        return self._remember_outcome(self._send(inputs))

    def stop(self, reason: str) -> None:
        """Forget the bytes that are not in the ComBuffer yet; bytes in the ComBuffer are still sent."""
        self.running = False

    detach = stop

    def bytes_to_send(self, inputs: Inputs) -> bytes | Outcome:
        """Return the bytes, or what is wrong with the inputs."""
        raise NotImplementedError

    def _send(self, inputs: Inputs) -> Outcome:
        payload = self.bytes_to_send(inputs)
        if isinstance(payload, Outcome):
            return payload
        asked = len(payload), self._data.shape if self._data is not None else None
        if self.running and asked != self._begun:
            return Outcome(
                Condition.PARAMETER_CHANGED, Cause(CauseKind.PARAMETER, "an input changed while busy")
            )
        if len(payload) > self._buffer.size:
            have, need = self._buffer.size, len(payload)
            cause = Cause(CauseKind.PARAMETER, "the ComBuffer is too small", have=have, need=need)
            return Outcome(Condition.SEND_OVERRUN, cause)
        if not self.running:
            self.have, self.need, self._begun = 0, len(payload), asked
        return self._put_rest(payload)

    def _put_rest(self, payload: bytes) -> Outcome:
        room = payload[self.have : self.have + self._buffer.free]
        if room:
            self._buffer.put(room, is_received=False)
            self.have += len(room)
            self.last_bytes_at = self._env.now
        is_all = self.have == self.need
        cause = Cause(CauseKind.BYTES, "bytes are in the ComBuffer", have=self.have, need=self.need)
        return Outcome(Condition.SENT if is_all else Condition.SENDING, cause)

    def _remember_outcome(self, shown: Outcome) -> Outcome:
        self.running = shown.busy
        is_over = shown.condition is Condition.SENT  # else Busy or Error stays while EN is 0
        self._idle = Outcome(Condition.NO_JOB, EN_IS_0) if is_over else shown
        return shown


class SendData(SendBlock):
    """One SendData instance: Length bytes from pSendData."""

    def bytes_to_send(self, inputs: Inputs) -> bytes | Outcome:
        have = self._data.size if self._data is not None else 0
        if self._data is None or inputs.length > have:
            name = "pSendData points to too few bytes"
            cause = Cause(CauseKind.PARAMETER, name, pin="pSendData", have=have, need=inputs.length)
            return Outcome(Condition.NULL_POINTER, cause)
        return bytes(self._data.content[: inputs.length])


class SendString(SendBlock):
    """One SendString instance: the characters of a STRING, without its byte 00."""

    def bytes_to_send(self, inputs: Inputs) -> bytes | Outcome:
        if self._data is None:
            return Outcome(
                Condition.NULL_POINTER, Cause(CauseKind.PARAMETER, "no SendString", pin="SendString")
            )
        return string_bytes(self._data)


class SendByte(SendBlock):
    """One SendByte instance: one byte a call."""

    def bytes_to_send(self, inputs: Inputs) -> bytes | Outcome:
        return bytes([inputs.sendbyte])


EN_IS_0_OUTCOME: Final = Outcome(Condition.NO_JOB, EN_IS_0)
EMPTIED_OUTCOME: Final = Outcome(Condition.BUFFER_EMPTY, Cause(CauseKind.INPUT, "EN is 1", pin="EN", value=1))


class ClearComBuffer(JoblessBlock):
    """One ClearComBuffer instance; it has no outputs."""

    def __init__(self, bound: BufferBinding) -> None:
        super().__init__()
        self._buffer = bound.buffer

    def call(self, inputs: Inputs) -> Outcome:
        """Empty the buffer while EN is 1. Bytes that a block has taken stay with the block."""
        if not inputs.en:
            return EN_IS_0_OUTCOME
        self._buffer.discard_all(f"{type(self).__name__}")
        return EMPTIED_OUTCOME
