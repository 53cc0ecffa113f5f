"""Cuts the bytes of one direction of a capture into messages, as they come: by pauses or into records.

Rule 1: a pause ends a message. With a type, the end of a segment also ends a message. But more follows a
full segment. A multiple of the type's size is several records. Any other size is one message.
Rule 2: no record crosses a hole, or a message of another size.
Rule 3: a piece of several records is held until a single message comes. The size of this message shows
whether the piece is records. For example, six messages of 10 bytes are as long as five messages of 12.
Rule 4: the number of held bytes is bounded.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.capture.reassembly import ConversationEvent, SegmentKind, WireDirection
from trcvtui.diagnosis.line_facts import PAUSE_NS, fills_segment

MOST_HELD: Final = 65_535  # bytes of a message
HOLE_REASON: Final = "hole"
UNKNOWN_REST: Final = 1 << 62
CUTTING_KINDS: Final = frozenset({SegmentKind.BYTES, SegmentKind.MISSING, SegmentKind.FIN, SegmentKind.RST})

# Gets the time of the last byte, the bytes, the size including missing ones, the reason of an unusual end (""
# of a usual one), and whether its first byte is the first of a message.
MessageSink = Callable[[int, bytes, int, str, bool], None]


class MessageCutter:
    """Takes the bytes of one direction. `record` is the size of the type, or 0 without a type."""

    def __init__(self, record: int, take: MessageSink) -> None:
        self._record, self._take = record, take
        self._held = bytearray()
        self._ends: list[tuple[int, int]] = []  # the end of each segment in `_held`, and its time
        self._is_write = self._is_full = True  # all segments but the last are full; the last, too
        self._rest = 0  # bytes still to come of a message that began in a hole
        self._good = self._odd = 0  # segments that were one record; messages of another size
        self._waiting: list[tuple[bytes, list[tuple[int, int]]]] = []  # pieces of several records, their ends
        self._last = 0, 0  # time and size of the newest segment

    def add_segment(self, ns: int, data: bytes, largest: int) -> None:
        """Take bytes. `largest` is the direction's largest segment so far, or 0 for reads of a PLC."""
        record, (last_ns, last_size) = self._record, self._last
        self._last = ns, len(data)
        if not self._held and not self._rest:
            if len(data) == record and (largest or not self._odd):
                self._good += 1
                if self._waiting:
                    self._emit_waiting()
                self._take(ns, data, record, "", True)  # the fast path: nearly all messages of a type
                return
        elif ns - last_ns >= PAUSE_NS and not fills_segment(last_size, largest, ns - last_ns):
            self.end_message(ns)
        if self._rest and record and not self._held and len(data) % record == 0:
            self._rest = 0  # rule 2: records begin again after the hole
        if self._rest:
            part, data = data[: self._rest], data[self._rest :]
            self._rest -= len(part)
            self._hold_bytes(ns, part, largest)
            if record and self._rest > MOST_HELD and not self._is_full:
                self._rest = 0  # rule 1: a segment that is not full ends the message
            if not self._rest or len(self._held) >= MOST_HELD:
                self._emit(len(self._held), HOLE_REASON, begins=False)
            if not data:
                return
        if self._held and not self._is_full and 0 < record < len(self._held) + len(data):
            self.end_message(ns)  # rule 1: the held message has another size
        self._hold_bytes(ns, data, largest)
        if len(self._held) >= (record or MOST_HELD) and not (record and self._is_full):
            self.end_message(ns)
        elif len(self._held) >= max(MOST_HELD, 2 * record):
            if largest or self._good:
                self._queue_records()
            if len(self._held) >= MOST_HELD:
                self.end_message(ns)

    def add_datagram(self, ns: int, data: bytes, size: int) -> None:
        """Take a datagram that had `size` bytes on the wire."""
        self._hold_bytes(ns, data, 0)
        if len(data) < size or not data:
            self._emit(len(data), HOLE_REASON if data or size else "", size - len(data))
        else:
            self.end_message(ns)

    def add_hole(self, ns: int, size: int) -> None:
        if self._is_write and not self._rest:
            self._queue_records()
        to_next = self._rest or -len(self._held)
        if self._held:
            self._emit(len(self._held), HOLE_REASON, begins=not self._rest)
        is_known = self._record and self._is_regular and to_next <= MOST_HELD
        self._rest = (to_next - size) % self._record if is_known else UNKNOWN_REST
        self._last = ns, 0

    def handle_answer(self, ns: int) -> None:
        """The other end answers: end the message, unless its last segment is full and more must follow."""
        if self._held and not self._is_full:
            self.end_message(ns)

    def end_message(self, ns: int, reason: str = "") -> None:
        """Emit the held bytes. `reason` says why a record ends short, unless a pause ended the record."""
        size, record = len(self._held), self._record
        if not self._rest and record and size % record == 0 and (self._is_write or size == record):
            self._queue_records()
        is_short = record and ns - self._last[0] < PAUSE_NS
        if self._held:
            self._emit(size, HOLE_REASON if self._rest else reason if is_short else "", begins=not self._rest)
        self._rest = 0
        if reason:
            self._emit_waiting()

    @property
    def _is_regular(self) -> bool:
        """Return whether several records in one piece are likely (rule 3)."""
        return not self._odd or self._good > self._odd

    def _hold_bytes(self, ns: int, data: bytes, largest: int) -> None:
        self._is_write = not self._held or self._is_full
        is_read = self._record > 0 and not largest
        self._is_full = self._is_write and (is_read or fills_segment(len(data), largest, 0))
        self._held += data
        self._ends.append((len(self._held), ns))

    def _queue_records(self) -> None:
        record, content, ends = self._record, bytes(self._held), self._ends
        self._good += len(content) == record
        at = len(content) - len(content) % record if record else 0
        if not at or not (self._is_regular or len(content) == record):
            return
        self._waiting.append((content[:at], ends))
        del self._held[:at]
        self._ends = [(end - at, ns) for end, ns in ends if end > at]
        if self._good or self._odd or sum([len(piece) for piece, _ in self._waiting]) > MOST_HELD:
            self._emit_waiting()

    def _emit_waiting(self) -> None:
        """Emit each waiting piece as records, or as one message if records are unlikely."""
        waiting, self._waiting = self._waiting, []
        for content, ends in waiting:
            record = self._record if self._is_regular or len(content) == self._record else len(content)
            passed, (end, ns) = iter(ends), (0, 0)
            for at in range(record, len(content) + 1, record):
                while end < at:
                    end, ns = next(passed)
                self._take(ns, content[at - record : at], record, "", True)

    def _emit(self, size: int, reason: str, missing: int = 0, begins: bool = True) -> None:
        content, ns = bytes(self._held[:size]), self._ends[-1][1]
        self._odd += reason != HOLE_REASON
        self._emit_waiting()
        self._held.clear()
        self._ends.clear()
        self._take(ns, content, size + missing, reason, begins)


class MessageCutters:
    """Cuts the bytes of conversations. `made` returns a direction's cutter, or None for no cuts."""

    def __init__(self, made: Callable[[WireDirection], MessageCutter | None]) -> None:
        self._made = made
        self._cutters: dict[WireDirection, MessageCutter | None] = {}

    @property
    def has_cutters(self) -> bool:
        return any(self._cutters.values())

    def add_event(self, event: ConversationEvent) -> None:
        ns, conversation, direction, kind, _, size, data = event
        if kind not in CUTTING_KINDS:
            return
        if direction not in self._cutters:
            self._cutters[direction] = self._made(direction)
        cutter, other = self._cutters[direction], self._cutters.get(direction.other)
        if cutter is None:
            return
        if kind is SegmentKind.BYTES and conversation.protocol == "udp":
            cutter.add_datagram(ns, data, size)
        elif kind is SegmentKind.BYTES:
            if other is not None:
                other.handle_answer(ns)
            cutter.add_segment(ns, data, direction.largest if conversation.sent is None else 0)
        elif kind is SegmentKind.MISSING:
            if conversation.protocol != "udp":
                cutter.add_hole(ns, size)
        else:
            cutter.end_message(ns, kind.value)
            if kind is SegmentKind.RST and other is not None:
                other.end_message(ns, kind.value)

    def end_all(self, ns: int) -> None:
        for cutter in self._cutters.values():
            if cutter is not None:
                cutter.end_message(ns, "end of file")
