"""The frames of receiving blocks, and what was thrown away between them, as one stream a ComBuffer.

Rule: a block is called once a scan and delivers one frame at most, so behind each scan its framer and its
data still hold the bytes that the ledger's lines are about. Bounded as the jobs are (job_history.py).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Final

from trcvtui.blocks.framing.frame import Ending
from trcvtui.blocks.serial_events import BytesArrived, BytesLost, FrameEnded, NoiseDropped, PartDropped
from trcvtui.plc.ledger import Event
from trcvtui.rig.bench.bench import Bench
from trcvtui.rig.history.job_stream import Chunk
from trcvtui.rig.history.window import JobSpan, RecvSpan

MOST_ARRIVALS: Final = 4096  # of one ComBuffer that were not read yet
COPY_A_SCAN: Final = 512 * 1024
LOST_SHOWN: Final = 256
NOISE: Final = "noise before the prefix"
NOT_KEPT: Final = "values not kept"
UNUSUAL: Final = {Ending.GAP: "ended by a gap", Ending.OVERRUN: "size reached, no suffix"}
NOTES: Final = (BytesArrived, FrameEnded, NoiseDropped, PartDropped, BytesLost)


class FrameHistory:
    """Hands each frame and each stretch of dropped bytes to `add`, with the name of its ComBuffer."""

    def __init__(self, bench: Bench, add: Callable[[str, Chunk], None]) -> None:
        self._bench = bench
        self._add = add
        self._arrived: dict[str, deque[RecvSpan]] = {}  # the newest chunks of each line, in its own offsets
        self._read: dict[str, int] = {}  # the place in the ComBuffer behind what the stream has
        self._arrivals: dict[str, int] = {}
        self._frames: dict[str, int] = {}  # by instance
        self._copied = 0
        self._end_of: Callable[[str], int] = lambda name: 0

    def scanned(self, written: Iterable[tuple[int, int, Event]], end_of: Callable[[str], int]) -> None:
        """Take the ledger's lines of a scan; `end_of` tells where a stream ends."""
        self._copied, self._end_of = 0, end_of
        for scan, t_ns, event in written:
            match event:
                case BytesArrived():
                    self._note(event, scan, t_ns)
                case FrameEnded():
                    self._frame(event, scan, t_ns)
                case NoiseDropped(instance, buffer, size, _):
                    content = self._kept(instance, "noise", size)
                    self._drop(buffer, instance, size, NOISE, content, (scan, t_ns))
                case PartDropped(instance, buffer, offset, size, reason):
                    self._read[buffer] = offset
                    content = self._kept(instance, "dropped", size)
                    self._drop(buffer, instance, size, f"incomplete, {reason}", content, (scan, t_ns))
                case BytesLost(buffer, _, size, reason):
                    self._drop(buffer, "", size, reason, b"", (scan, t_ns), in_line=False)

    def _note(self, event: BytesArrived, scan: int, t_ns: int) -> None:
        number = self._arrivals[event.buffer] = self._arrivals.get(event.buffer, 0) + 1
        known = self._arrived.setdefault(event.buffer, deque(maxlen=MOST_ARRIVALS))
        known.append(RecvSpan(0, event.size, number, scan, t_ns, event.offset))

    def _frame(self, event: FrameEnded, scan: int, t_ns: int) -> None:
        framer, content = self._bench.runtime.framer(event.instance), self._content(event)
        number = self._frames[event.instance] = self._frames.get(event.instance, 0) + 1
        marks = framer.last if framer is not None else None
        reason = UNUSUAL.get(marks.ending, "") if marks is not None else ""
        position, self._read[event.buffer] = self._end_of(event.buffer), event.offset
        span = JobSpan(
            position, event.size, event.instance, number, scan, t_ns, True, reason if content else NOT_KEPT,
            is_kept=bool(content), whole=event.size, prefix=marks.prefix if marks is not None else 0,
            suffix=marks.suffix if marks is not None else 0, is_frame=True,
        )  # fmt: skip
        recvs = self._taken(event.buffer, event.size, position, event.size)
        self._add(event.buffer, Chunk(span, event.buffer, 0, content, recvs))

    def _content(self, event: FrameEnded) -> bytes:
        decl = self._bench.project.instance(event.instance)
        self._copied += event.size
        if decl is None or decl.data is None or self._copied > COPY_A_SCAN:
            return b""
        return self._bench.runtime.data(decl.data, event.size)

    def _kept(self, instance: str, what: str, size: int) -> bytes:
        framer = self._bench.runtime.framer(instance)
        kept = getattr(framer, what, b"")
        return bytes(kept[-size:])

    def _drop(
        self,
        buffer: str,
        instance: str,
        size: int,
        reason: str,
        content: bytes,
        when: tuple[int, int],
        in_line: bool = True,
    ) -> None:
        """Take bytes that no frame has; without `in_line` they never were in the ComBuffer."""
        shown = len(content) or min(size, LOST_SHOWN)
        position = self._end_of(buffer)
        span = JobSpan(
            position, shown, instance, 0, *when, False, reason, is_kept=bool(content), whole=size,
        )  # fmt: skip
        recvs = self._taken(buffer, size, position, shown) if in_line else ()
        self._add(buffer, Chunk(span, buffer, 0, content, recvs))

    def _taken(self, buffer: str, size: int, position: int, shown: int) -> tuple[RecvSpan, ...]:
        """Return the arrivals of the next `size` bytes, the last `shown` of them from `position` on."""
        start = self._read.get(buffer, 0)
        stop = self._read[buffer] = start + size
        first, known = stop - shown, self._arrived.get(buffer, deque())
        found: list[RecvSpan] = []
        while known and known[0].offset < stop:
            arrival = known[0]
            begin, end = max(arrival.offset, first), min(arrival.offset + arrival.size, stop)
            if begin < end:
                place = position + begin - first
                found.append(arrival._replace(position=place, size=end - begin, offset=begin))
            if arrival.offset + arrival.size > stop:
                break
            known.popleft()
        return tuple(found)
