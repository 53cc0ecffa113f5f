"""Bytes in hex and as text, drawn line by line, with a cursor on one byte."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import ClassVar, Final, NamedTuple

from trcvtui.history.records import JobSpan, PreviousJobBytes
from trcvtui.history.waveform_text import merge_pieces
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.tui.messages import ByteSelected
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row
from trcvtui.udt.byte_text import find_all, find_first, find_last

# `02›41 42 43‹0d 0a`: the prefix is before the first sign, the suffix after the second.

DATA_BEGIN_SIGN, DATA_END = "›", "‹"
PREFIX_STYLE, SUFFIX_STYLE, OLD_STYLE = "prefix", "suffix", "faint"


class FrameBounds(NamedTuple):
    """Bytes `start` to `stop` of a frame. The data begin at `data`, the suffix at `suffix`."""

    start: int
    data: int
    suffix: int
    stop: int

    def style(self, place: int) -> str:
        """Return the style of a byte in the prefix or the suffix, or "" for any other byte."""
        if self.start <= place < self.data:
            return PREFIX_STYLE
        return SUFFIX_STYLE if self.suffix <= place < self.stop else ""

    def seam_sign(self, place: int) -> str:
        """Return the sign before the byte at `place`, or ""."""
        if place == self.data and self.start < self.data:
            return DATA_BEGIN_SIGN
        return DATA_END if place == self.suffix and self.suffix < self.stop else ""


NO_MARKS: Final = FrameBounds(0, 0, 0, 0)


def make_marks(start: int, size: int, prefix: int, suffix: int) -> FrameBounds:
    return FrameBounds(start, start + prefix, start + size - suffix, start + size)


def marks_of_span(span: JobSpan) -> FrameBounds:
    if not span.prefix and not span.suffix:
        return NO_MARKS
    return make_marks(span.position, span.size, span.prefix, span.suffix)


def marks_of_data(instance: InstanceSnapshot) -> FrameBounds | None:
    """Return the marks of the newest frame in the instance's DATA, or None if no frame has come."""
    last = instance.framer.last if instance.framer is not None else None
    return make_marks(0, last.size, last.prefix, last.suffix) if last is not None else None


def marks_of_incomplete(instance: InstanceSnapshot) -> FrameBounds | None:
    """Return the marks of an incomplete frame, which has no suffix yet."""
    framer = instance.framer
    if framer is None or not instance.have:
        return None
    return make_marks(0, instance.have, min(instance.have, len(framer.prefix or b"")), 0)


def frame_signs(spans: Sequence[JobSpan]) -> dict[int, str]:
    """Return the sign before each byte that begins data or a suffix."""
    found = {}
    for span in spans:
        marks = marks_of_span(span)
        for place in (marks.data, marks.suffix):
            if sign := marks.seam_sign(place):
                found[place] = sign
    return found


# The character shows the class as well, so that the colour is never the only sign.

NULL, PRINTABLE, SPACE, CONTROL, HIGH = "null", "printable", "space", "control", "high"


def byte_class(byte: int) -> str:
    if byte == 0:
        return NULL
    if byte in b" \t\n\r\x0b\x0c":
        return SPACE
    if byte < 0x20 or byte == 0x7F:
        return CONTROL
    return PRINTABLE if byte < 0x80 else HIGH


def byte_character(byte: int) -> str:
    """Return the character of a byte in the text column."""
    if 0x20 <= byte < 0x7F:
        return chr(byte)
    return {NULL: "⋄", SPACE: "_", CONTROL: "•", HIGH: "×"}[byte_class(byte)]


CLASS_OF: Final = tuple(byte_class(byte) for byte in range(256))
CHARACTER_OF: Final = tuple(byte_character(byte) for byte in range(256))
HEX_OF: Final = tuple(f"{byte:02x}" for byte in range(256))


GHOST_HEX, GHOST_TEXT = "··", "·"
HOLE_HEX, HOLE_TEXT, HOLE = "??", "?", "warn"  # bytes that a capture lacks
NOT_CAPTURED: Final = "missing in the capture"
START_SIGN: Final = "▕"
WIDE_ROW, NARROW = 16, 8
LEAST_DIGITS: Final = 4
WAS: Final = "was"


class ByteLines(LineView):
    """Lines of bytes with a cursor; the bytes of a linked member and of search hits are marked."""

    ROOM: ClassVar = 68  # columns that 16 bytes need beside their offset
    BINDINGS: ClassVar = [("left,h", "step(-1)", "byte back"), ("right,l", "step(1)", "byte on")]

    def __init__(self, id: str) -> None:
        super().__init__(id=id)
        self.cursor: int | None = None
        self.link = range(0)
        self.patterns: tuple[bytes, ...] = ()
        self.shows_before = False  # differing bytes of before, below those of now

    # -- for subclasses ------------------------------------------------------------------------------

    @property
    def pos_digits(self) -> int:
        raise NotImplementedError

    @property
    def per_row(self) -> int:
        """Return how many bytes a row has: 16, or 8 in a narrow pane."""
        return WIDE_ROW if self.line_width >= self.pos_digits + self.ROOM else NARROW

    @property
    def row_lines(self) -> int:
        return 2 if self.shows_before else 1

    def is_hole(self, place: int) -> bool:
        """Return whether a byte is unknown because the capture lacks it."""
        raise NotImplementedError

    def _byte(self, place: int) -> int | None:
        raise NotImplementedError

    def _byte_before(self, place: int) -> int | None:
        """Return the earlier byte to compare with at this place, or None if there is none."""
        raise NotImplementedError

    # -- what is marked -----------------------------------------------------------------------------

    def mark_hits(self, patterns: tuple[bytes, ...]) -> None:
        self.patterns = patterns
        self.show()

    def link_bytes(self, link: range) -> None:
        self.link = link
        self.show()

    def read_known_bytes(self, place: int) -> bytes:
        """Return the bytes from a place up to the first unknown byte, at most `MOST_NUMBER_BYTES`."""
        places = range(place, place + MOST_NUMBER_BYTES)
        return bytes(iter(map(self._byte, places).__next__, None))

    def _differs(self, place: int) -> bool:
        byte = self._byte(place)
        return byte is not None and self._byte_before(place) not in (None, byte)

    # -- columns ------------------------------------------------------------------------------------

    @property
    def _gap_width(self) -> int:
        return 1

    @property
    def _text_column(self) -> int:
        return self._column(self.per_row) + 2

    def _column(self, index: int) -> int:
        return 3 * index + (self._gap_width if self.per_row == WIDE_ROW and index >= NARROW else 0)

    def _index_at(self, x: int) -> int | None:
        """Return which byte of a row is drawn at column `x`, as hex or as text, or None."""
        column = x - self.pos_digits - 2
        if column >= self._text_column:
            index = column - self._text_column
        else:
            index = (
                column - (self._gap_width if self.per_row == WIDE_ROW and column >= 3 * NARROW else 0)
            ) // 3
        return index if column >= 0 and index < self.per_row else None

    def _byte_texts(self, place: int) -> tuple[str, str]:
        byte = self._byte(place)
        if byte is not None:
            return HEX_OF[byte], CHARACTER_OF[byte]
        return (HOLE_HEX, HOLE_TEXT) if self.is_hole(place) else (GHOST_HEX, GHOST_TEXT)

    def _old_bytes_row(self, start: int, stop: int, name: str = WAS) -> Row:
        line = [" "] * self._column(self.per_row)
        for index, place in enumerate(range(start, stop)):
            before = self._byte_before(place)
            if before is not None and before != self._byte(place):
                line[self._column(index) : self._column(index) + 2] = HEX_OF[before]
        return Row(((f"{name:>{self.pos_digits}}  ", "faint"), ("".join(line), "warn")))

    def _scroll_to_row(self, y: int) -> None:
        """Bring a row of bytes into view with all of its lines."""
        self.keep_in_view(y * self.row_lines + self.row_lines - 1)
        self.keep_in_view(y * self.row_lines)
        self.show()


class HexView(ByteLines):
    """`content` are the known bytes. Bytes still missing up to `need` are dots."""

    KEYS: ClassVar[tuple[tuple[str, str], ...]] = (
        ("hjkl", "byte"), ("/", "find"), ("d", "diff"), ("H", "stream"), ("D", "messages"),
    )  # fmt: skip

    def __init__(self, id: str, shows_job: bool) -> None:
        super().__init__(id)
        self.shows_job = shows_job
        self.content: bytes = b""
        self.need = self.rows_kept = 0  # rows that stay while there are fewer bytes
        self.starts: frozenset[int] = frozenset()
        self.holes: tuple[range, ...] = ()
        self.frame: FrameBounds | None = None  # the frame that begins with the first byte
        self.before: PreviousJobBytes | None = None

    def show_bytes(
        self, content: bytes, need: int, starts: frozenset[int], holes: tuple[range, ...] = ()
    ) -> None:
        """Show these bytes. Mark `starts` as beginnings of messages and `holes` as unknown."""
        self.content, self.need, self.starts, self.holes = content, max(need, len(content)), starts, holes
        self.show()

    def is_hole(self, place: int) -> bool:
        return any(place in hole for hole in self.holes)

    def _byte(self, place: int) -> int | None:
        is_here = place < len(self.content) and not (self.holes and self.is_hole(place))
        return self.content[place] if is_here else None

    def show_before(self, before: PreviousJobBytes | None) -> None:
        """Mark bytes that differ from the job before. With `shows_before`, draw that job's bytes below."""
        self.before = before
        self.show()

    def range_to_fetch(self) -> tuple[int, int]:
        """Return the first byte in view, and how many bytes to ask for from there."""
        rows = self.size.height // self.row_lines + 2
        return self.scroll_offset.y // self.row_lines * self.per_row, rows * self.per_row

    def go_to(self, offset: int) -> None:
        """Put the cursor on a byte and bring it into view; post no Textual message."""
        self.cursor = offset
        self._scroll_to_row(offset // self.per_row)

    @property
    def pos_digits(self) -> int:
        return max(LEAST_DIGITS, len(f"{max(0, self.need - 1):x}"))

    # -- drawing ------------------------------------------------------------------------------------

    def row_count(self) -> int:
        return max(self.rows_kept, -(-self.need // self.per_row) * self.row_lines)

    def row_at(self, y: int) -> Row:
        start = y // self.row_lines * self.per_row
        stop = min(start + self.per_row, self.need)
        if start >= stop:
            return EMPTY
        if y % self.row_lines:
            return self._old_bytes_row(start, stop)
        found = self._matches(start, stop)
        styles = [self._style_of(offset) + (" match" * (offset in found)) for offset in range(start, stop)]
        mark = START_SIGN if start in self.starts else self._seam_sign(start) or " "
        parts: list[Part] = [(f"{start:0{self.pos_digits}x} ", "dim"), (mark, "key")]
        parts += self._hex(start, styles)
        parts += self._text(start, styles)
        return Row(tuple(parts))

    def _matches(self, start: int, stop: int) -> set[int]:
        """Return the bytes of a row that belong to a match; a match may begin or end in another row."""
        if not self.patterns:
            return set()
        more = max(map(len, self.patterns)) - 1
        first = max(0, start - more)
        found = find_all(self.content[first : stop + more], self.patterns)
        return {first + place for match in found for place in match}

    def _byte_before(self, place: int) -> int | None:
        """Return the byte at this place in the job before, or None if this byte or that byte is unknown."""
        before = self.before
        if before is None or self._byte(place) is None:
            return None
        at = place - before.position
        return before.content[at] if 0 <= at < len(before.content) else None

    def _style_of(self, offset: int) -> str:
        style = CLASS_OF[self.content[offset]] if offset < len(self.content) else "ghost"
        if self.holes and self.is_hole(offset):
            style = HOLE
        if self.frame is not None and offset < len(self.content):
            style = OLD_STYLE if offset >= self.frame.stop else self.frame.style(offset) or style
        if self._differs(offset):
            style += " changed"
        if offset in self.link:
            style += " link"
        if offset == self.cursor:
            style += " byte-cursor" if self.has_focus else " link strong"
        return style

    def _hex(self, start: int, styles: list[str]) -> list[Part]:
        parts: list[Part] = []
        for index in range(self.per_row):
            wide_gap = index == NARROW - 1 and self.per_row == WIDE_ROW
            if index >= len(styles):
                parts.append(("    " if wide_gap else "   ", ""))
                continue
            offset = start + index
            parts.append((self._byte_texts(offset)[0], styles[index]))
            parts += self._gap(offset, wide_gap, last=index + 1 >= len(styles))
        return merge_pieces(parts)

    def _gap(self, offset: int, wide: bool, last: bool) -> list[Part]:
        """Return the blank after a byte, or the mark of a message that begins with the next byte."""
        inside = not last and offset in self.link and offset + 1 in self.link
        style = "link" if inside else ""
        begins = not last and offset + 1 in self.starts
        sign = "" if last else self._seam_sign(offset + 1)
        mark = (START_SIGN, f"key {style}") if begins else (sign, f"key {style}") if sign else (" ", style)
        return [(" ", style), mark] if wide else [mark]

    def _seam_sign(self, offset: int) -> str:
        """Return the sign that separates data from prefix or suffix before this byte, or ""."""
        return self.frame.seam_sign(offset) if self.frame is not None else ""

    def _text(self, start: int, styles: list[str]) -> list[Part]:
        text = [self._byte_texts(start + index)[1] for index in range(len(styles))]
        return [(" │", "faint"), *merge_pieces(list(zip(text, styles, strict=True)))]

    # -- the cursor ---------------------------------------------------------------------------------

    def action_step(self, count: int) -> None:
        if self.need:
            here = self.cursor if self.cursor is not None else -count if count > 0 else 0
            self.select(max(0, min(self.need - 1, here + count)))

    def action_move(self, rows: int) -> None:
        here = self.cursor or 0
        target = here + rows * self.per_row
        if self.cursor is None or 0 <= target < self.need:
            self.select(target if self.cursor is not None else here)

    def action_page(self, pages: int) -> None:
        step = pages * max(1, (self.size.height - 1) // self.row_lines) * self.per_row
        self.action_step(step)

    def action_edge(self, direction: int) -> None:
        if self.need:
            self.select(0 if direction < 0 else self.need - 1)

    def select(self, offset: int) -> None:
        if not self.need:
            return
        self.go_to(offset)
        self.post_message(ByteSelected(offset, self.shows_job))

    def find(self, patterns: tuple[bytes, ...], is_forward: bool, again: bool) -> bool:
        """Go to the next or previous match; a first search forward also finds a match at the cursor."""
        here = self.cursor if self.cursor is not None else -1 if is_forward else len(self.content)
        if is_forward:
            place = find_first(self.content, patterns, here + 1 if again else max(0, here))
        else:
            place = find_last(self.content, patterns, here)
        if place is not None:
            self.select(place)
        return place is not None

    def click(self, x: int, y: int) -> None:
        index = self._index_at(x)
        offset = y // self.row_lines * self.per_row + (index or 0)
        if index is not None and offset < self.need:
            self.select(offset)

    def on_focus(self) -> None:
        """Show the cursor, and let the table decode the bytes of this view."""
        self.show()
        self.post_message(ByteSelected(self.cursor if self.cursor is not None else -1, self.shows_job))


# The numbers that begin with a byte, the most useful first: those without room are left out.
NUMBER_CODES: Final = (
    ("u8", "B"), ("i8", "b"), ("u16", "H"), ("i16", "h"), ("REAL", "f"), ("u32", "I"), ("i32", "i"),
    ("LREAL", "d"), ("u64", "Q"), ("i64", "q"),
)  # fmt: skip
MOST_NUMBER_BYTES: Final = 8  # bytes


def numbers_text(content: bytes, width: int) -> str:
    """Return the numbers that fit a line, as `little|big`. Skip signed numbers equal to unsigned ones."""
    line, before = "LE|BE", ""
    for name, code in NUMBER_CODES:
        size = struct.calcsize(code)
        if len(content) < size:
            continue
        values = [struct.unpack(order + code, content[:size])[0] for order in ("<>" if size > 1 else "<")]
        text = "|".join(f"{value:.6g}" if isinstance(value, float) else str(value) for value in values)
        if text != before and len(line) + len(name) + len(text) + 3 <= width:
            line += f"  {name} {text}"
        before = text
    return line if content else ""
