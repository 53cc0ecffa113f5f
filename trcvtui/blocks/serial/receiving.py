"""ReceiveData, ReceiveString, ReceiveByte: frames, texts and bytes out of a ComBuffer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from msgspec.structs import replace

from trcvtui.blocks.block import JobBlock, JoblessBlock
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import FrameEnded, NoiseDropped, PartialFrameDropped
from trcvtui.blocks.framing import NO_FRAMES, Frame, FrameEnding, Framer, FrameSummary, Framing, summary_of
from trcvtui.blocks.outcome import Cause, CauseKind, Lamp, Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.serial.com_buffer import BufferBinding

# Rule: Error, RxTimeout and the length stay until the next frame begins.

FRAME_CONDITIONS: Final[Mapping[FrameEnding, Condition]] = {
    FrameEnding.SUFFIX: Condition.FRAME_RECEIVED,
    FrameEnding.SIZE: Condition.FRAME_RECEIVED,
    FrameEnding.GAP: Condition.FRAME_GAP,
    FrameEnding.OVERRUN: Condition.DATA_OVERRUN,
}
NO_FRAME_OUTCOME: Final = Outcome(Condition.FRAME_AWAITED, Cause(CauseKind.WAITING, "no frame has begun"))
RESET: Final = Outcome(Condition.FRAME_AWAITED, Cause(CauseKind.INPUT, "Reset is 1", pin="Reset", value=1))


class FrameReceiveJob:
    """The receive job of one instance; it cuts the frames. `deliver` writes a frame into the variable."""

    adhoc = False

    def __init__(
        self,
        bound: BufferBinding,
        deliver: Callable[[bytes], None],
        conditions: Mapping[FrameEnding, Condition] = FRAME_CONDITIONS,
    ) -> None:
        self.need = 0
        self.framer = Framer()
        self.last: FrameSummary | None = None  # of the frame that was delivered last
        self.tally = NO_FRAMES
        self._env = bound.env
        self._buffer = bound.buffer
        self._instance = bound.instance
        self._deliver = deliver
        self._conditions = conditions
        self._target: tuple[str, int] | None = None  # the data of the part
        self._ends = bound.buffer.ends
        self._idle = NO_FRAME_OUTCOME

    # -- the job, for readers ----------------------------------------------------------------------------

    @property
    def running(self) -> bool:
        return self.framer.busy

    @property
    def have(self) -> int:
        return self.framer.pending

    @property
    def last_bytes_at(self) -> int | None:
        """Return when the newest byte was taken, in ns."""
        return self.framer.last_byte

    def received_part(self) -> bytes:
        return self.framer.partial_frame

    # -- one call ----------------------------------------------------------------------------------------

    def call(self, framing: Framing, target: tuple[str, int]) -> Outcome:
        """Take the bytes that wait in the ComBuffer, up to the end of one frame."""
        received = self._buffer.peek()
        if self._buffer.ends != self._ends:  # a part never joins bytes of another connection
            self._ends = self._buffer.ends
            self.abandon(self._buffer.end_reason)
            self._idle = self._idle if self._idle.condition is not Condition.FRAME_PART else NO_FRAME_OUTCOME
        if self.framer.framing_changed(framing) or (self.framer.busy and target != self._target):
            return self.refuse(
                Condition.PARAMETER_CHANGED, Cause(CauseKind.PARAMETER, "an input changed while busy")
            )
        self.need, self._target = framing.size, target
        noise = self.framer.discarded
        used, frame = self.framer.feed(received, framing, self._env.now)
        self._buffer.read(used)
        if self.framer.discarded > noise:
            total = self.framer.discarded
            stop = self._buffer.head - self.framer.pending - (len(frame.content) if frame is not None else 0)
            size = total - noise
            self._env.write(NoiseDropped(self._instance, self._buffer.name, size, total, stop - size))
        if frame is not None:
            return self._deliver_frame(frame, framing)
        return self._waiting_outcome()

    def reset(self) -> Outcome:
        """Drop the incomplete frame; bytes in the ComBuffer stay there."""
        self.abandon("Reset")
        self._idle = NO_FRAME_OUTCOME
        return RESET

    def refuse(self, condition: Condition, cause: Cause) -> Outcome:
        self.abandon(cause.name)
        if (self._idle.condition, self._idle.cause) != (condition, cause):
            self._idle = Outcome(condition, cause)
        return self._idle

    def abandon(self, reason: str) -> None:
        """Drop the incomplete frame, with a note in the ledger."""
        part = self.framer.flush()
        if part:
            self._note_dropped(part, reason)

    detach = abandon

    def _waiting_outcome(self) -> Outcome:
        if self.framer.busy:
            have = Cause(
                CauseKind.BYTES, "the frame has no end yet", have=self.framer.pending, need=self.need
            )
            if self._idle.cause != have:
                self._idle = Outcome(Condition.FRAME_PART, have, lamp=Lamp.BUSY)
        elif self._idle.condition is Condition.FRAME_PART or self.framer.had_false_start:
            self._idle = NO_FRAME_OUTCOME  # rule: a prefix that began has cleared the last frame's outputs
        return self._idle

    def _note_dropped(self, part: bytes, reason: str) -> None:
        self.tally, size = self.tally.count_dropped(reason), len(part)
        place = self._buffer.head - size
        self._env.write(PartialFrameDropped(self._instance, self._buffer.name, place, size, reason))

    def _deliver_frame(self, frame: Frame, framing: Framing) -> Outcome:
        size, ending = len(frame.content), frame.ending
        if ending not in self._conditions:  # byte 00 in a text
            return self._discard_spoilt(frame)
        self.last, self.tally = summary_of(frame, framing), self.tally.count_ending(ending)
        place = self._buffer.head - size
        more = self.last.prefix, self.last.suffix, self.tally.frame_count
        self._env.write(FrameEnded(self._instance, self._buffer.name, place, size, str(ending), *more))
        self._deliver(frame.content)
        cause = Cause(CauseKind.BYTES, f"ended by: {framing.ended_by(ending)}", have=size, need=self.need)
        is_gap = ending is FrameEnding.GAP
        shown = Outcome(self._conditions[ending], cause, size, lamp=Lamp.DONE, rx_timeout=is_gap)
        self._idle = replace(shown, lamp=None)  # rule
        return shown

    def _discard_spoilt(self, frame: Frame) -> Outcome:
        """Drop a text that a byte 00 has ended, because a STRING cannot hold that byte."""
        size, reason = len(frame.content), str(frame.ending)
        self._note_dropped(frame.content, reason)
        self._idle = Outcome(
            Condition.ZERO_CHARACTER, Cause(CauseKind.BYTES, reason, have=size, need=self.need)
        )
        return self._idle


MILLISECOND_NS = 1_000_000


class ReceiveData(JobBlock):
    def __init__(self, bound: BufferBinding) -> None:
        self.job = FrameReceiveJob(bound, self._deliver)
        self._data, self._prefix, self._suffix = bound.data, bound.prefix, bound.suffix

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call, in this order: reset, pins, bytes."""
        if inputs.reset:
            return self.job.reset()
        wrong = self._find_input_error(inputs)
        if wrong is not None:
            return self.job.refuse(*wrong)
        assert self._data is not None
        framing = Framing(
            inputs.sizereceivedata,
            _read_pointer(self._prefix, inputs.lenprefix),
            _read_pointer(self._suffix, inputs.lensuffix),
            inputs.timeout * MILLISECOND_NS,
        )
        return self.job.call(framing, self._data.shape)

    def _find_input_error(self, inputs: Inputs) -> tuple[Condition, Cause] | None:
        """Return the first of errors 21, 22 and 20 that the inputs have."""
        if self._data is None:
            return Condition.NULL_RECEIVE_POINTER, Cause(
                CauseKind.PARAMETER, "pReceiveData is 0", pin="pReceiveData"
            )
        size, room = inputs.sizereceivedata, self._data.size
        if not 0 < size <= room:  # DATA is never written beyond its end
            cause = Cause(
                CauseKind.PARAMETER, "the size is not greater than 0", pin="SizeReceiveData", value=size
            )
            if size > 0:
                name = "the variable is smaller than SizeReceiveData"
                cause = Cause(CauseKind.PARAMETER, name, pin="SizeReceiveData", have=room, need=size)
            return Condition.RECEIVE_LENGTH_WRONG, cause
        for name, area, length in (
            ("pPrefix", self._prefix, inputs.lenprefix),
            ("pSuffix", self._suffix, inputs.lensuffix),
        ):
            room = area.size if area is not None else 0
            if length > room:
                cause = Cause(
                    CauseKind.PARAMETER, f"{name} points to too few bytes", pin=name, have=room, need=length
                )
                return Condition.NULL_POINTER, cause
        return None

    def _deliver(self, content: bytes) -> None:
        """Write a frame into the data. The bytes after the frame keep their old values."""
        assert self._data is not None
        self._data.write(0, content)


def _read_pointer(area: DataArea | None, length: int) -> bytes:
    return bytes(area.content[:length]) if area is not None else b""


STRING_CONDITIONS: Final = {
    FrameEnding.SUFFIX: Condition.FRAME_RECEIVED,
    FrameEnding.GAP: Condition.FRAME_GAP,
    FrameEnding.OVERRUN: Condition.STRING_OVERRUN,
}


class ReceiveString(JobBlock):
    longest = 80

    def __init__(self, bound: BufferBinding) -> None:
        self.job = FrameReceiveJob(bound, self._deliver, STRING_CONDITIONS)
        self._data, self._prefix, self._suffix = bound.data, bound.prefix, bound.suffix

    def call(self, inputs: Inputs) -> Outcome:
        if inputs.reset:
            return self.job.reset()
        if self._data is None or self._data.size < 2:
            cause = Cause(CauseKind.PARAMETER, "ReceivedString is not a STRING", pin="ReceivedString")
            return self.job.refuse(Condition.NULL_RECEIVE_POINTER, cause)
        longest = min(self.longest, self._data.size - 1)  # one byte is the 00 after the text
        timeout = inputs.timeout * MILLISECOND_NS
        framing = Framing(longest, string_bytes(self._prefix), string_bytes(self._suffix), timeout, text=True)
        return self.job.call(framing, self._data.shape)

    def _deliver(self, content: bytes) -> None:
        assert self._data is not None
        self._data.write(0, content + b"\0")


class ReceiveString255(ReceiveString):
    """One ReceiveString255 instance: ReceiveString with another maximum length of the text."""

    longest = 255


def string_bytes(area: DataArea | None) -> bytes:
    """Return the characters of a STRING up to its byte 00, or no characters if `area` is None."""
    return bytes(area.content).partition(b"\0")[0] if area is not None else b""


NO_BYTE_CAUSE: Final = Cause(CauseKind.WAITING, "no byte waits")
BYTE_TAKEN_CAUSE: Final = Cause(CauseKind.BYTES, "a byte was taken", have=1, need=1)


class ReceiveByte(JoblessBlock):
    """One ReceiveByte instance. The output ReceivedByte keeps its value until the next byte."""

    def __init__(self, bound: BufferBinding) -> None:
        super().__init__()
        self._buffer = bound.buffer
        self._empty = Outcome(Condition.BUFFER_EMPTY, NO_BYTE_CAUSE)

    def call(self, inputs: Inputs) -> Outcome:
        if not self._buffer.peek():
            return self._empty
        byte = self._buffer.read(1)[0]
        self._empty = Outcome(Condition.BUFFER_EMPTY, NO_BYTE_CAUSE, byte=byte)
        return Outcome(Condition.FRAME_RECEIVED, BYTE_TAKEN_CAUSE, lamp=Lamp.DONE, byte=byte)
