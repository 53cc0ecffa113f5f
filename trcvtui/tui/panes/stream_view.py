"""All received bytes as one stream. Rulers show the peer's messages, recv calls, jobs and their scans.

Only the bytes around the view are fetched from the engine. A row is drawn without bytes until the bytes
arrive. A byte's position counts the bytes of its CONNECT since the bench began, so it never changes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Final, NamedTuple

from textual import events

from trcvtui.history.records import (
    AT_END,
    MOST_WINDOW,
    HistoryRequest,
    HistoryWindow,
    JobSpan,
    MessageSpan,
    RecvSpan,
    SeekRequest,
    Span,
    find_spans,
    span_at,
)
from trcvtui.history.waveform_text import merge_pieces
from trcvtui.plc.ledger import A_HOLE, A_PACKET
from trcvtui.tui.formatting import clip
from trcvtui.tui.messages import PastCursorMoved
from trcvtui.tui.widgets.hex_view import CLASS_OF, HOLE, NARROW, WAS, ByteLines, frame_signs, marks_of_span
from trcvtui.tui.widgets.line_view import EMPTY, Part, Row
from trcvtui.udt.byte_text import find_all
from trcvtui.wording import format_ns, stamp_text

# The rulers: from spans and columns of bytes to parts of a line. Where a job ends within a message, a stroke
# between the two bytes marks it in the row and in its ruler: colour is never the only sign.

SPLIT_SIGN: Final = "╱"
START_SIGN: Final = "▕"
MESSAGES, RECV_RULER, JOB_RULER, MARK_RULER = "msg", "recv", "job", "mark"
PACKET_RULER: Final = "packet"  # of a capture: in place of messages and recv calls
CAPTURE_PEERS: Final = frozenset((A_PACKET, A_HOLE))
RULERS: Final = ((MESSAGES, RECV_RULER, JOB_RULER), (MESSAGES, JOB_RULER), ())


class BracketStyle(NamedTuple):
    """The signs that draw the beginning, middle and end of one kind of span, and their style."""

    begin: str
    between: str
    end: str
    style: str


MESSAGE_STYLE: Final = BracketStyle("└", "─", "┘", "key")
RECV_STYLE: Final = BracketStyle("╰", "┄", "╯", "dim")
JOB_STYLE: Final = BracketStyle("╚", "═", "╝", "busy")
DROPPED_STYLE: Final = BracketStyle("×", "×", "×", "warn")


class RulerBracket(NamedTuple):
    """A bracket over columns `first` to `last` of a ruler. The text is the longest of `names` that fits."""

    first: int
    last: int
    begins: bool
    ends: bool
    pen: BracketStyle
    names: tuple[str, ...]


def find_cuts(window: HistoryWindow, start: int, stop: int) -> frozenset[int]:
    found = set()
    for job in find_spans(window.jobs, start, stop):
        message = span_at(window.messages, job.position) if job.position >= start else None
        if message is not None and message.first + job.position - message.position > 0:
            found.add(job.position)
    return frozenset(found)


def sign_before_byte(position: int, signs: dict[int, str], begins: set[int]) -> tuple[str, str]:
    """Return the byte's own sign, else the sign of a message that begins there, else a blank."""
    if position in signs:
        return signs[position], "warn strong"
    return (START_SIGN, "key") if position in begins else (" ", "")


# -- one ruler -----------------------------------------------------------------------------------------------


def ruler_parts(strokes: Sequence[RulerBracket], width: int) -> list[tuple[str, str]]:
    parts: list[tuple[str, str]] = []
    reached = 0
    for stroke in strokes:
        if stroke.first > reached:
            parts.append((" " * (stroke.first - reached), ""))
        parts.append((_bracket(stroke), stroke.pen.style))
        reached = stroke.last + 1
    parts.append((" " * max(0, width - reached), ""))
    return parts


def _bracket(stroke: RulerBracket) -> str:
    pen, width = stroke.pen, stroke.last - stroke.first + 1
    begin = pen.begin if stroke.begins else pen.between
    end = pen.end if stroke.ends else pen.between
    room = width - 2
    name = next((name for name in stroke.names if len(name) <= room), "")
    return begin + name + pen.between * (room - len(name)) + end


def make_brackets(
    spans: Sequence[Span],
    start: int,
    stop: int,
    column: Callable[[int], int],
    drawn: Callable[[Span], tuple[bool, bool, BracketStyle, tuple[str, ...]]],
) -> list[RulerBracket]:
    """Return the brackets for the spans in a row. `column` returns the column of the row's n-th byte."""
    found = []
    for span in find_spans(spans, start, stop):
        begins, ends, pen, names = drawn(span)
        first, last = max(span.position, start), min(span.stop, stop) - 1
        here = begins and span.position >= start, ends and span.stop <= stop
        found.append(RulerBracket(column(first - start), column(last - start) + 1, *here, pen, names))
    return found


def bracket_of_message(span: MessageSpan) -> tuple[bool, bool, BracketStyle, tuple[str, ...]]:
    peer, number = "" if span.peer == A_PACKET else f"{span.peer} ", f"#{span.number}"
    size = f"{span.first}.." if span.first else f"{span.whole} B"
    return span.begins, span.ends, MESSAGE_STYLE, (f"{peer}{number} {size}", f"{peer}{number}", number)


def bracket_of_recv(span: RecvSpan) -> tuple[bool, bool, BracketStyle, tuple[str, ...]]:
    """Return how a recv call is drawn; number 0 stands for bytes that were never read."""
    if not span.number:
        return True, True, RECV_STYLE, ("never read", "")
    number, scan = span.number, span.scan
    return True, True, RECV_STYLE, (f"recv {number} scan {scan}", f"r{number} s{scan}", f"{number}", "")


def bracket_of_job(span: JobSpan) -> tuple[bool, bool, BracketStyle, tuple[str, ...]]:
    name, ends = span.instance, (span.first == 0, span.first + span.size == span.whole)
    if span.is_open:
        return True, False, RECV_STYLE, (f"{name} {span.reason}".strip(), span.reason, "")
    if not span.done:
        return True, True, DROPPED_STYLE, (f"{span.whole} B dropped: {span.reason}", "dropped", "")
    number = f"{'frame' if span.is_frame else 'job'} {span.number}"
    return *ends, JOB_STYLE, (f"{name} {number} scan {span.scan}", f"{number} scan {span.scan}", number, "")


# -- beside the rulers ---------------------------------------------------------------------------------------


def describe_first_cut(marks: Sequence[int], messages: Sequence[MessageSpan]) -> str:
    message = span_at(messages, marks[0]) if marks else None
    if message is None:
        return ""
    return f"{SPLIT_SIGN} #{message.number} cut at {message.first + marks[0] - message.position}"


def describe_first_arrival(recvs: Sequence[RecvSpan], start: int, stop: int) -> str:
    """Return the time of the first chunk that begins in a row, and the time since the chunk before."""
    first = next((n for n, span in enumerate(recvs) if start <= span.position < stop), None)
    if first is None:
        return ""
    span = recvs[first]
    gap = f" +{format_ns(span.t_ns - recvs[first - 1].t_ns)}" if first else ""
    return f"{stamp_text(span.t_ns)}{gap}"


def describe_job_result(jobs: Sequence[JobSpan], start: int, stop: int) -> str:
    job = next((span for span in jobs if start < span.stop <= stop), None)
    if job is None:
        return ""
    if job.done:
        return f"DONE {stamp_text(job.t_ns)}" if not job.reason else clip(job.reason, 60)
    return job.reason if job.is_open else f"{stamp_text(job.t_ns)} dropped"


LEAST_FILL: Final = 0.6  # least filled share of rows that begin with messages
LEAST_DIGITS, ROOMY, TIGHT = 5, 68, 66  # of a position; what 16 bytes need beside it, with and without blanks
NO_WINDOW: Final = HistoryWindow("", 0, 0)


class StreamView(ByteLines):
    """Bytes by position. While `follows` is True, the newest byte stays in view."""

    KEYS: ClassVar = (
        ("[ ]", "DONE"), ("/", "find"), ("m", "mark"), ("d", "diff"), ("u", "rulers"), ("H", "DATA now"),
    )  # fmt: skip

    ROOM: ClassVar = TIGHT

    def __init__(self) -> None:
        super().__init__("stream")
        self.window = NO_WINDOW
        self.follows = True
        self._rulers = 0
        self._knows_messages = False  # only a peer reports its messages
        self._is_capture = False
        self._base = 0
        self._cut = 0, 0  # size of the messages that rows begin with, a place of one; 0: none
        self._rows: dict[int, Row] = {}
        self._drawn: object = None
        self._matched: set[int] = set()
        self._compared_to: dict[int, int] = {}
        self.marked: tuple[range, bytes] | None = None  # the message that others are compared with
        self._compared = range(0)  # the message that is compared
        self.seek: SeekRequest | None = None
        self._seeks = os.getpid() << 32  # request numbers: two tabs of a bench share none
        self._asked = AT_END, 0

    # -- what comes in ----------------------------------------------------------------------------------

    def reset_stream(self) -> None:
        self.window, self.cursor, self.follows, self.seek = NO_WINDOW, None, True, None
        self.link = range(0)
        self._knows_messages = False
        self.marked, self._cut = None, (0, 0)

    def make_request(self, connect: str, job_at: int | None) -> HistoryRequest:
        """Return the request for the page in view, the page before and the page after."""
        if self.size.height:  # while hidden, ask for the same as before
            page = -(-self.size.height // self.row_lines) * self.per_row
            start, stop = max(0, self._first_position() - page), self._first_position() + 2 * page
            if self.marked is not None and stop - self.marked[0].start < MOST_WINDOW:
                start = min(start, self.marked[0].start)  # `y r` copies from the mark to the cursor
            self._asked = AT_END if self.follows else start, min(MOST_WINDOW, max(3 * page, stop - start))
        return HistoryRequest(connect, *self._asked, before=True, seek=self.seek, job_at=job_at)

    def accept_window(self, window: HistoryWindow) -> int | None:
        """Show the bytes of a new window. Return the position that the search has found so far, or None."""
        if window != self.window:
            self.window = window
            self._knows_messages = self._knows_messages or bool(window.messages)
            self._is_capture = self._is_capture or any(m.peer in CAPTURE_PEERS for m in window.messages)
            self._find_matches()
            self._pair_bytes()
        self._rebase()
        sought = window.sought
        found = None
        if self.seek is not None and sought is not None and sought.number == self.seek.number:
            found = sought.position
            if sought.share >= 1:
                self.seek = None
        if self.follows:
            self.apply_row_count()
            self.scroll_to(y=self.row_count(), animate=False)
        return found

    def _pair_bytes(self) -> None:
        """Pair each byte with a byte of the marked message. If no message is marked, use the job before."""
        start, parts = self._compared.start, [(part.position, part.content) for part in self.window.before]
        if self.marked is not None:
            parts = [(start, self.marked[1][: len(self._compared)])]
        self._compared_to = {place + n: byte for place, content in parts for n, byte in enumerate(content)}

    def set_compared(self, marked: tuple[range, bytes] | None, with_: range) -> None:
        if (marked, with_) != (self.marked, self._compared):
            self.marked, self._compared = marked, with_
            self._pair_bytes()
            self._drawn = None

    def difference_text(self) -> str:
        """Return how the message at the cursor differs from the marked message, or "" without a mark."""
        if self.marked is None or not self._compared:
            return ""
        here, there = self.window.part(self._compared), self.marked[1]
        if self._compared == self.marked[0]:
            return "marked: "
        found = sum(one != other for one, other in zip(here, there, strict=False))
        sizes = "" if len(here) == len(there) else f", {len(here)} B against {len(there)}"
        return f"≠ {found} of {min(len(here), len(there))} bytes{sizes}: "

    def _find_matches(self) -> None:
        found = find_all(self.window.content, self.patterns)
        self._matched = {self.window.start + place for match in found for place in match}

    def _rebase(self) -> None:
        """Count rows from the oldest kept byte. When it is dropped, the same bytes stay in view."""
        base = self.window.begin - (self.window.begin - self._cut[1]) % self._row_group[0]
        if base == self._base:
            return
        rows = (base - self._base) // self._row_group[0] * self._row_group[1] * self.row_lines
        self._base = base
        self._rows.clear()
        self.apply_row_count()
        if not self.follows:
            self.scroll_to(y=max(0, self.scroll_offset.y - rows), animate=False)

    def cut_rows(self, messages: Sequence[range]) -> None:
        """Begin rows at messages if all messages have the same size and the rows are mostly full."""
        size, start = (len(messages[0]), messages[0].start) if len(messages) > 1 else self._cut
        is_even = all(len(each) == size and (each.start - start) % size == 0 for each in messages)
        cut = (size, start % size) if size and is_even else (0, 0)
        if cut != self._cut:
            top, self._cut = self._first_position(), cut
            self._rebase()
            self._stay_at(self.window.end if self.follows else top)

    @property
    def _row_group(self) -> tuple[int, int]:
        """Return the numbers of bytes and rows in a group: one row, or the rows of whole messages."""
        size, most = self._cut[0], self.per_row
        unit = max(1, most // size) * size if size else most
        rows = -(-unit // most)
        return (unit, rows) if unit >= LEAST_FILL * rows * most else (most, 1)

    def _row_of(self, position: int) -> int:
        size, rows = self._row_group
        unit, rest = divmod(position - self._base, size)
        return unit * rows + rest // self.per_row

    def _row_range(self, number: int) -> range:
        """Return the positions of a row's bytes, without bytes that have not come yet."""
        size, rows = self._row_group
        unit, rest = divmod(number, rows)
        first = self._base + unit * size
        start = first + rest * self.per_row
        return range(max(0, start), min(start + self.per_row, first + size, self.window.end))

    def search(self, start: int, is_forward: bool, patterns: tuple[bytes, ...] = (), **what: Any) -> None:
        """Request a search from position `start`. `what` has the other fields of SeekRequest."""
        self._seeks += 1
        self.seek = SeekRequest(self._seeks, start, is_forward, patterns, **what)

    def mark_hits(self, patterns: tuple[bytes, ...]) -> None:
        self.patterns = patterns
        self._find_matches()
        self.show()

    def change_rulers(self) -> None:
        top = self._first_position()
        self._rulers = (self._rulers + 1) % len(RULERS)
        self._stay_at(top)

    def toggle_before(self) -> None:
        top = self._first_position()
        self.shows_before = not self.shows_before
        self._stay_at(top)

    def _stay_at(self, position: int) -> None:
        self._rows.clear()
        self.apply_row_count()
        y = self._row_of(position) * self.row_lines
        if self.cursor is not None and not self.follows:  # the cursor goes to the middle
            y = max(0, self._row_of(self.cursor) * self.row_lines - self.size.height // 2)
        self.scroll_to(y=y, animate=False)
        self.show()

    # -- rows -------------------------------------------------------------------------------------------

    @property
    def ruler_names(self) -> tuple[str, ...]:
        known = [track for track in RULERS[self._rulers] if track != MESSAGES or self._knows_messages]
        if self._is_capture:
            known = [PACKET_RULER if track == MESSAGES else track for track in known if track != RECV_RULER]
        return (*((WAS,) if self.shows_before else ()), *known)

    @property
    def row_lines(self) -> int:
        return 1 + len(self.ruler_names)

    @property
    def pos_digits(self) -> int:
        least = len(PACKET_RULER) if self._is_capture else LEAST_DIGITS
        return max(least, len(f"{max(0, self.window.end - 1):x}"))

    @property
    def _gap_width(self) -> int:
        """Return 1 if a row has room for a blank in its middle and a blank before its text, else 0."""
        return 1 if self.line_width >= self.pos_digits + ROOMY or self.per_row == NARROW else 0

    def row_count(self) -> int:
        return (self._row_of(self.window.end - 1) + 1) * self.row_lines if self.window.end > self._base else 0

    def _first_position(self) -> int:
        return max(self.window.begin, self._row_range(self.scroll_offset.y // self.row_lines).start)

    def show(self) -> None:
        shown = id(self.window), self.cursor, self.has_focus, self.link, self.patterns
        drawn = *shown, self.ruler_names, self.line_width, self._base
        if drawn != self._drawn:
            self._drawn = drawn
            self._rows.clear()
        super().show()

    def row_at(self, y: int) -> Row:
        if y not in self._rows:
            row, track = divmod(y, self.row_lines)
            at = self._row_range(row)
            self._rows[y] = self._ruler(self.ruler_names[track - 1], at) if track else self._byte_row(at)
        return self._rows[y]

    @property
    def _width(self) -> int:
        return self._column(self.per_row - 1) + 2

    @property
    def _text_column(self) -> int:
        return self._width + 1 + self._gap_width

    def _byte_row(self, at: range) -> Row:
        start, stop = at.start, at.stop
        if start >= stop:
            return EMPTY
        signs = dict.fromkeys(find_cuts(self.window, start, stop), SPLIT_SIGN)
        signs |= frame_signs(find_spans(self.window.jobs, start, stop))
        begins = {m.position for m in find_spans(self.window.messages, start, stop) if m.begins}
        styles = [self._style_of(position) for position in range(start, stop)]
        parts: list[Part] = [(f"{start:0{self.pos_digits}x} ", "dim"), sign_before_byte(start, signs, begins)]
        for index, position in enumerate(range(start, stop)):
            parts.append((self._byte_texts(position)[0], styles[index]))
            if position + 1 < stop:
                parts.append((" " * (self._column(index + 1) - self._column(index) - 3), ""))
                parts.append(sign_before_byte(position + 1, signs, begins))
        parts.append((" " * (self._width - self._column(stop - start - 1) - 2), ""))
        text = [self._byte_texts(position)[1] for position in range(start, stop)]
        parts += [(" " * self._gap_width + "│", "faint"), *zip(text, styles, strict=True)]
        return Row(tuple(merge_pieces([part for part in parts if part[0]])))

    def _byte(self, place: int) -> int | None:
        window = self.window
        if not window.start <= place < window.stop or self.is_hole(place):
            return None
        job = span_at(window.jobs, place)
        return window.content[place - window.start] if job is not None and job.is_kept else None

    def _byte_before(self, place: int) -> int | None:
        return self._compared_to.get(place)

    def is_hole(self, place: int) -> bool:
        message = span_at(self.window.messages, place) if self._is_capture else None
        return message is not None and message.peer == A_HOLE

    def _style_of(self, position: int) -> str:
        byte, job = self._byte(position), span_at(self.window.jobs, position)
        style = "ghost" if byte is None else CLASS_OF[byte]
        style = HOLE if self.is_hole(position) else style
        if job is not None and (job.prefix or job.suffix or not job.done):
            style = marks_of_span(job).style(position) or (style if job.done or job.is_open else "ghost")
        if self._differs(position):
            style += " changed"
        if position in self.link:
            style += " link"
        if position in self._matched:
            style += " match"
        if position == self.cursor:
            style += " byte-cursor" if self.has_focus else " link strong"
        return style

    def _ruler(self, track: str, at: range) -> Row:
        start, stop = at.start, at.stop
        if start >= stop:
            return EMPTY
        width = self._width
        if track == WAS:
            return self._old_bytes_row(start, stop, WAS if self.marked is None else MARK_RULER)
        head: Part = (f"{track:>{self.pos_digits}} ", "faint")
        parts, side = self._draw_ruler(track, start, stop)
        marks = find_cuts(self.window, start, stop) if track != RECV_RULER else frozenset()
        first: Part = (SPLIT_SIGN, "warn strong") if start in marks else (" ", "")
        side = clip(side, max(0, self.line_width - self.pos_digits - 4 - width))
        return Row((head, first, *self._with_cuts(parts, marks, start, width), ("  ", ""), (side, "dim")))

    def _draw_ruler(self, track: str, start: int, stop: int) -> tuple[list[Part], str]:
        window, column = self.window, self._column
        if track in (MESSAGES, PACKET_RULER):
            drawn = make_brackets(window.messages, start, stop, column, bracket_of_message)
            side = describe_first_cut(sorted(find_cuts(window, start, stop)), window.messages)
        elif track == RECV_RULER:
            drawn = make_brackets(window.recvs, start, stop, column, bracket_of_recv)
            side = describe_first_arrival(window.recvs, start, stop)
        else:
            drawn = make_brackets(window.jobs, start, stop, column, bracket_of_job)
            side = describe_job_result(window.jobs, start, stop)
        return ruler_parts(drawn, self._width), side

    def _with_cuts(self, parts: list[Part], marks: frozenset[int], start: int, width: int) -> list[Part]:
        """Return a ruler with a stroke before each byte at which a job cuts a message."""
        columns = {self._column(mark - start) - 1 for mark in marks if mark > start}
        if not columns:
            return parts
        found: list[Part] = []
        place = 0
        for text, style in parts:
            for character in text:
                found.append((SPLIT_SIGN, "warn strong") if place in columns else (character, style))
                place += 1
        return merge_pieces(found)

    # -- one byte -----------------------------------------------------------------------------------------

    def spans(self) -> tuple[JobSpan | None, RecvSpan | None, MessageSpan | None]:
        if self.cursor is None:
            return None, None, None
        window, place = self.window, self.cursor
        return span_at(window.jobs, place), span_at(window.recvs, place), span_at(window.messages, place)

    def cursor_values(self) -> tuple[int | None, int | None]:
        """Return the byte under the cursor and the corresponding byte of the previous job."""
        place = -1 if self.cursor is None else self.cursor
        return self._byte(place), None if self.marked else self._byte_before(place)

    # -- the cursor ---------------------------------------------------------------------------------------

    def go_to(self, position: int) -> None:
        """Put the cursor on a byte and bring it and its rulers into view; post no Textual message."""
        self.cursor, self.follows = position, False
        self._scroll_to_row(self._row_of(position))

    def select(self, position: int) -> None:
        if self.window.end > self.window.begin:
            self.go_to(max(self.window.begin, min(position, self.window.end - 1)))
            self.post_message(PastCursorMoved())

    def action_step(self, count: int) -> None:
        self.select(self._first_position() if self.cursor is None else self.cursor + count)

    def action_move(self, rows: int) -> None:
        if self.cursor is None:
            self.select(self._first_position())
            return
        row = self._row_of(self.cursor)
        target, column = self._row_range(row + rows), self.cursor - self._row_range(row).start
        if target and self.window.begin < target.stop:
            self.select(min(target.start + column, target.stop - 1))

    def action_page(self, pages: int) -> None:
        self.follows = False
        rows = max(1, self.size.height // self.row_lines)
        self.scroll_to(y=max(0, self.scroll_offset.y + pages * rows * self.row_lines), animate=False)
        if self.cursor is not None:
            self.select(self.cursor + pages * rows * self.per_row)

    def action_edge(self, direction: int) -> None:
        """Go to the oldest byte if `direction` < 0, else to the newest byte, and follow the stream."""
        if direction < 0:
            self.select(self.window.begin)
        else:
            self.select(self.window.end - 1)
            self.follows = True

    def on_resize(self) -> None:
        self._rebase()
        if self.cursor is not None and not self.follows and self.size.height:
            self.go_to(self.cursor)
        self.show()

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        self.follows = False

    def on_click(self, event: events.Click) -> None:
        place = self.place_of(event)
        if place is None:
            return
        index = self._index_at(place[0])
        if index is not None:
            found = self._row_range(place[1] // self.row_lines)
            self.select(min(found.start + index, found.stop - 1))
