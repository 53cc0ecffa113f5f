"""Pane 5: the bytes of DATA, and below them how far the job is; or, with `H`, all that was received so far.

A receive job: what it has collected but not delivered yet. A send job: how far its bytes have come.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Final

from textual.binding import Binding
from textual.containers import Vertical
from textual.content import Content
from textual.widget import Widget

from trcvtui.history.records import HistoryRequest, JobSpan, MessageSpan, RecvSpan
from trcvtui.plc.ledger import A_HOLE
from trcvtui.plc.snapshot import FramerSnapshot, InstanceSnapshot
from trcvtui.project.project import Project
from trcvtui.tui.formatting import bar, clip, wrapped
from trcvtui.tui.messages import PastSelected
from trcvtui.tui.panes.combuffer import gap_of, gap_parts
from trcvtui.tui.panes.stream_view import StreamView
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.hex_view import (
    CLOSES,
    NOT_CAPTURED,
    OPENS,
    HexView,
    marks_of_data,
    marks_of_part,
    numbers_at,
)
from trcvtui.tui.widgets.line_view import EMPTY, LineView, OneLine, Part, Row, pane_title, row, ruled
from trcvtui.tui.widgets.typed_lines import FindLine, Goal
from trcvtui.udt.byte_text import hit_of
from trcvtui.wording import stamp

BAR: Final = 12
GAP_BESIDE: Final = 74  # columns in which the gap timer stands beside the unfinished frame
ROOMY: Final = 100


class JobLine(OneLine):
    """One line between both views: how far the job is."""

    def __init__(self, view_model: ViewModel) -> None:
        super().__init__(id="job-line")
        self._view_model = view_model

    def line(self) -> Row:
        instance = self._view_model.instance
        if instance is None:
            return EMPTY
        if instance.sends:
            return ruled(self.line_width, *self._sent(instance))
        if instance.framer is not None:
            return ruled(self.line_width, *self._framed(instance, instance.framer))
        if not instance.need:
            return ruled(self.line_width, ("── no job running ", "dim"))
        full, empty = bar(instance.have, instance.need, BAR)
        mode = "ad-hoc, at most" if instance.adhoc else "of"
        numbers = f" {instance.have} {mode} {instance.need} B "
        return ruled(
            self.line_width, ("── job ", "dim"), (full, "busy"), (empty, "faint"), (numbers, "strong"),
            ("not in DATA yet ", "dim"),
        )  # fmt: skip

    def _framed(self, instance: InstanceSnapshot, framer: FramerSnapshot) -> list[Part]:
        if instance.outputs.busy:
            full, empty = bar(instance.have, framer.size, BAR)
            told: list[Part] = [
                ("── unfinished ", "dim"), (full, "busy"), (empty, "faint"),
                (f" {instance.have} of ≤{framer.size} B ", "strong"),
            ]  # fmt: skip
            gap = gap_of(self._view_model, instance)
            if gap is not None and gap.limit_ns and self.line_width >= GAP_BESIDE:
                told += [("· gap ", "dim"), *gap_parts(gap), (" ", "")]
            return told
        last = framer.last
        if last is None:
            return [("── no frame has begun ", "dim")]
        data = last.size - last.prefix - last.suffix
        marks = f"prefix {last.prefix} {OPENS} data {data} {CLOSES} suffix {last.suffix}"
        style = "dim" if last.is_good else "warn"
        return [("── ", "dim"), (f"frame of {last.size} B", "strong"), (f" · {marks} · ", "dim"),
                (f"ended by: {framer.ended_by} ", style)]  # fmt: skip

    def _sent(self, instance: InstanceSnapshot) -> list[Part]:
        """Return how far the bytes of this connection have come: DONE tells of the local stack only."""
        parts: list[Part] = [("── ", "dim")]
        if instance.need:
            full, empty = bar(instance.have, instance.need, BAR)
            numbers = f" {instance.have} of {instance.need} B in the stack  "
            parts += [("job ", "dim"), (full, "busy"), (empty, "faint"), (numbers, "strong")]
        connection = self._view_model.connection
        if connection is None or connection.state != "connected" or connection.udp:
            return parts if instance.need else [*parts, ("no job running ", "dim")]
        parts.append((f"{connection.bytes_sent} B accepted", "strong"))
        if connection.unacknowledged is not None:
            style = "warn" if connection.unacknowledged else "dim"
            parts.append((f" · {connection.unacknowledged} unacknowledged", style))
        for peer in self._view_model.peers:
            if (peer.local, peer.remote) == (connection.remote, connection.local):
                parts.append((f" · {peer.received_here} read by {peer.name}", "dim"))
        return [*parts, (" ", "dim")]


class OriginLine(LineView, can_focus=False):
    """Below the stream: where the selected byte came from, or a search; below DATA: the byte as numbers."""

    DEFAULT_CSS = "OriginLine { height: 1; display: none; }"

    def __init__(self) -> None:
        super().__init__(id="origin-line")
        self.text = ""
        self._may_break = True

    def row_count(self) -> int:
        return 1 if self.line_width >= ROOMY or not self._may_break else 2

    def row_at(self, y: int) -> Row:
        texts = wrapped(self.text, self.line_width) if self.row_count() > 1 else (self.text,)
        return row((clip(texts[y], self.line_width), "strong")) if y < len(texts) else EMPTY

    def on_resize(self) -> None:
        self.styles.height = self.row_count()
        self.show()

    def say(self, text: str, may_break: bool) -> None:
        self.text, self._may_break, self.display = text, may_break, bool(text) or may_break
        self.on_resize()


Labels = tuple[JobSpan | None, RecvSpan | None, MessageSpan | None]


def origin_words(place: int, values: tuple[int | None, int | None], labels: Labels, project: Project) -> str:
    """Return value, message, job, field, recv call, scan and time of the byte at a position.

    `values` are what it is and what stood there in the job before.
    """
    job, recv, message = labels
    if job is None:
        return ""
    is_hole = message is not None and message.peer == A_HOLE
    words = [NOT_CAPTURED if is_hole else _value_words(*values, job)]
    if message is not None and not is_hole:
        byte = message.first + place - message.position
        words.append(f"{message.peer} #{message.number} byte {byte}")
    byte = place - job.position + job.first
    words.append(_job_words(job, byte))
    if job.done and (field := field_at(project, job.instance, byte)):
        words.append(field)
    if recv is not None and recv.number:
        words += [f"recv {recv.number}", f"scan {recv.scan}", f"{stamp(recv.t_ns)} s"]
    if not job.done:
        words.append(job.reason)
    return " · ".join(words)


def _job_words(job: JobSpan, byte: int) -> str:
    """Return whose byte it is, and of which part of a frame."""
    if not job.instance:
        return "no job"
    if not job.done and not job.number:
        return job.instance
    if not job.is_frame:
        return f"{job.instance} job {job.number} byte {byte}"
    is_suffix = byte - job.first >= job.size - job.suffix
    part = "prefix" if byte - job.first < job.prefix else "suffix" if is_suffix else "data"
    return f"{job.instance} frame {job.number} byte {byte}, {part}"


def _value_words(value: int | None, was: int | None, job: JobSpan) -> str:
    if value is None:
        return "dropped"
    differs = was is not None and was != value
    is_dropped = not (job.done or job.is_open)
    return f"16#{value:02X} = {value}" + (f" (was {was:02X})" if differs else " · dropped" * is_dropped)


def field_at(project: Project, instance: str, byte: int) -> str:
    """Return the path of the member of an instance's DATA that holds a byte, "" for padding."""
    data = next((decl.data for decl in project.instances if decl.name == instance), None)
    declared = project.data_decl(data) if data else None
    number = declared.layout.leaf_at(byte) if declared is not None else None
    return declared.layout.leaf(number).path if declared is not None and number is not None else ""


MOST_JOB_ROWS: Final = 4
LEAST_ROWS: Final = 6  # with fewer there is no line of numbers below DATA
PAST: Final = "-past"
NEXT_HIT: Final = (("n N", "next hit, hit before"),)
MOST: Final = 1 << 62  # after every position
NO_MESSAGE: Final = "nothing to mark: H, then choose a byte of a message"
NO_DROP: Final = "no bytes were thrown away before this place"
NOT_KEPT: Final = "the view froze without its bytes: F shows those of now"


class Received(Vertical):
    """Both hex views in one frame, or the stream."""

    DEFAULT_CSS = """
    Received { background: $surface; }
    Received #data { height: 1fr; min-height: 1; }
    Received.-roomy JobLine { margin: 1 0 0 0; }
    Received #job { height: 1; display: none; }
    Received #stream { height: 1fr; display: none; }
    Received.-past #data, Received.-past #job-line, Received.-past #job { display: none; }
    Received.-past #stream { display: block; }
    """
    BINDINGS: ClassVar = [
        Binding("H", "past", "all received bytes as a stream, or DATA now", show=False),
        Binding("slash", "find", "find bytes, text or a number", show=False),
        Binding("n", "find_next(True)", "find the next", show=False),
        Binding("N", "find_next(False)", "find the one before", show=False),
        Binding("left_square_bracket", "done(False)", "the DONE before", show=False),
        Binding("right_square_bracket", "done(True)", "the next DONE", show=False),
        Binding("d", "before", "diff against the job before", show=False),
        Binding("m", "mark_message", "mark the message: d compares with it, y copies from it on", show=False),
        Binding("u", "rulers", "rulers of the stream: all, fewer, none", show=False),
        Binding("escape", "end_find", "look for nothing any more", show=False),
    ]

    def __init__(self, view_model: ViewModel) -> None:
        super().__init__(id="received")
        self._view_model = view_model
        self.data = HexView("data", of_job=False)
        self.job = HexView("job", of_job=True)
        self.stream = StreamView()
        self.past_job: tuple[int, bytes] | None = None  # position and bytes of the job under the cursor
        self._job_here: JobSpan | None = None
        self._line = JobLine(view_model)
        self._origin_line = OriginLine()
        self._find = FindLine(lambda: self._go_on(True, again=False), self._back_to_bytes)
        self._is_searched = False  # n and N are those of the search
        self._nowhere = ""
        self._hit = -1, ""  # where the search has come to, and which hit of how many that is
        self._seeks_drop = False
        self._known = ("", 0)  # CONNECT and bench of the stream
        self._title = ""
        self._subtitle = ""
        self._job_rows = 0
        self._data_rows: int | None = None

    def compose(self) -> Iterator[Widget]:
        yield self._find
        yield self.data
        yield self._line
        yield self.job
        yield self.stream
        yield self._origin_line

    @property
    def is_past(self) -> bool:
        return self.has_class(PAST)

    def show(self) -> None:
        instance = self._view_model.instance
        if instance is not None:
            self._take_past(instance)
        self._show_title(instance)
        if instance is None:
            self._show_nothing()
        elif self.is_past:
            self._show_past()
        else:
            self._show_now(instance)

    def _show_now(self, instance: InstanceSnapshot) -> None:
        self.data.frame, self.job.frame = marks_of_data(instance), marks_of_part(instance)
        declared = self._view_model.declaration
        if declared is not None:  # as high before its bytes have come: one layout, not two
            self.data.rows_kept = -(-declared.size // self.data.per_row) * self.data.lines
        self.data.show_bytes(self._view_model.data, 0, *self._marks(False))
        self._line.show()
        self._size_job(instance)
        self._stand_together()
        grown = len(self._view_model.partial) > len(self.job.content)
        self.job.show_bytes(self._view_model.partial, instance.need, *self._marks(True))
        self._show_origin()
        if grown and not self.job.has_focus:
            self.job.keep_in_view(max(0, len(self._view_model.partial) - 1) // self.job.per_row)

    def _show_nothing(self) -> None:
        """No instance is left: its bytes go with it."""
        for view in (self.data, self.job):
            view.frame = None
            view.show_bytes(b"", 0, frozenset())
        self._line.show()
        self._show_origin()

    def _marks(self, of_job: bool) -> tuple[frozenset[int], tuple[range, ...]]:
        index, selected = self._view_model.stream_index, self._view_model.selected
        return index.message_starts(selected, of_job), index.holes(selected, of_job)

    def _show_origin(self) -> None:
        if self._view_model.instance is not None and self._view_model.lacks_bytes:
            self._say_below(NOT_KEPT)
            self._origin_line.say("", may_break=False)
            return
        view = self.job if self.job.has_focus else self.data
        byte = view.cursor
        text = "" if byte is None or byte >= len(view.content) else self._origin(view, byte)
        has_room = byte is not None and self.size.height >= LEAST_ROWS
        numbers = numbers_at(view.known_from(byte or 0), self.size.width - 2) if has_room else ""
        self._origin_line.say(numbers, may_break=False)
        self._say_below(self._nowhere or self._with_hit(byte, text))

    def _say_below(self, text: str) -> None:
        if text != self._subtitle:
            self._subtitle = text
            self.border_subtitle = Content(text)

    def _origin(self, view: HexView, byte: int) -> str:
        value = view.content[byte]
        text = f"byte {byte} = 16#{value:02X} = {value}"
        if view.is_hole(byte):
            text = f"byte {byte}: {NOT_CAPTURED}"
        origin = self._view_model.stream_index.origin(self._view_model.selected, view.of_job, byte)
        if origin is None:
            return text
        text += f" · job {origin.job.number}"
        if origin.recv is not None:
            text += f" · recv {origin.recv.number}, scan {origin.recv.scan}"
        if origin.message is not None and not view.is_hole(byte):
            text += f" · {origin.message.peer} #{origin.message.number} byte {origin.message.first}"
        if origin.recv is not None:
            text += f" · {stamp(origin.recv.t_ns)} s"
        return text

    # -- the past ----------------------------------------------------------------------------------------

    def _take_past(self, instance: InstanceSnapshot) -> None:
        known = instance.connect, self._view_model.bench
        if known != self._known:
            self._known, self.past_job, self._job_here = known, None, None
            self.stream.begin_anew()
        window = self._view_model.past
        if window is not None and window.connect == instance.connect:
            self.data.show_before(window.data)
            found = self.stream.take(window)
            self.stream.cut_rows([each.positions for each in self._view_model.messages])
            if found is not None:
                self._hit = found, window.sought.hit if window.sought is not None else ""
                self.stream.go_to(found)
                self.post_message(PastSelected())
            if window.job is not None and window.job != self.past_job:
                self.past_job = window.job
                self.post_message(PastSelected())
        if self.is_past:
            if self._view_model.is_frozen:
                self.stream.follows = False
            self._view_model.past_wanted = self.stream.request(instance.connect, self._job_wanted())
        else:
            first, size = self.data.in_view()
            wanted = HistoryRequest(instance.connect, data=(instance.name, first, size))
            self._view_model.past_wanted = None if instance.sends else wanted

    def _job_wanted(self) -> int | None:
        """Return where the job lies whose bytes are to come, None where they are here."""
        job = self.job_here()
        known = self.past_job is not None and job is not None and self.past_job[0] == job.position
        return None if job is None or job.is_open or known else job.position

    def _show_past(self) -> None:
        self.stream.compare(self.stream.marked, self.message_here())
        self.stream.show()
        text = self._search_text() or self._nowhere or self._past_origin()
        place = self.stream.cursor
        numbers = "" if place is None else numbers_at(self.stream.known_from(place), self.size.width - 4)
        self._say_below(numbers)
        self._origin_line.say(text, may_break=True)

    def _search_text(self) -> str:
        window = self._view_model.past
        sought = window.sought if window is not None else None
        if self.stream.seek is None:
            if self._seeks_drop and sought is not None:
                self._seeks_drop = False
                self._nowhere = NO_DROP if sought.position is None else ""
            wanted = self._find.wanted
            if sought is not None and sought.position is None and wanted is not None:
                self._nowhere = f"{wanted.about}: not found there"
            return ""
        self._nowhere = ""
        return f"looking … {sought.share:.0%}" if sought is not None and sought.share < 1 else "looking …"

    def _past_origin(self) -> str:
        if self.stream.cursor is None:
            return "" if self.stream.window.end else "nothing was received yet"
        project = self._view_model.project
        origin = origin_words(self.stream.cursor, self.stream.values(), self.stream.labels(), project)
        window = self.stream.window
        if window.lack and self.stream.cursor == window.begin:
            origin += f" · the oldest byte here, others are {window.lack}"
        return self._with_hit(self.stream.cursor, self.stream.difference() + origin)

    def _with_hit(self, place: int | None, text: str) -> str:
        hit = self._hit[1] if self._is_searched and place == self._hit[0] else ""
        return " · ".join(filter(None, (hit, text)))

    def message_here(self) -> range:
        """Return the message under the cursor, its job where no message is known; empty: not all is here."""
        place, job = self.stream.cursor, self.job_here()
        of_job = range(job.position, job.stop) if job is not None else range(0)
        found = [each.positions for each in self._view_model.messages if place in each.positions]
        return found[0] if found else of_job if self.stream.window.knows(of_job) else range(0)

    def copied(self) -> tuple[bytes, bytes]:
        """Return the message under the cursor, and what stands from the marked one to the cursor or back."""
        window, mark, place = self.stream.window, self.stream.marked, self.stream.cursor
        between = range(0)
        if mark is not None and place is not None:
            between = range(min(mark[0].start, place), max(place + 1, mark[0].stop * (place < mark[0].start)))
        return window.cut(self.message_here()), window.cut(between) if window.knows(between) else b""

    def action_mark_message(self) -> None:
        """Compare others with the message under the cursor, until it is marked again."""
        here, stream = self.message_here() if self.is_past else range(0), self.stream
        is_marked = stream.marked is not None and stream.marked[0] == here
        stream.compare(None if is_marked or not here else (here, stream.window.cut(here)), here)
        self._nowhere = "" if here else NO_MESSAGE
        self.show()

    def job_here(self) -> JobSpan | None:
        """Return the job under the cursor of the stream, also when it has been scrolled out of the window."""
        job, place, last = self.stream.labels()[0], self.stream.cursor, self._job_here
        if job is None and last is not None and place is not None and last.position <= place < last.stop:
            return last
        self._job_here = job
        return job

    def job_of_cursor(self) -> tuple[str, int, bytes] | None:
        """Return instance, number and bytes of the job under the cursor of the stream, once they are here.

        Of bytes that were dropped the number is 0.
        """
        job = self.job_here() if self.is_past else None
        here = job is not None and self.past_job is not None and self.past_job[0] == job.position
        if job is None or self.past_job is None or not here or len(self.past_job[1]) < job.whole:
            return None
        return job.instance, job.number * job.done, self.past_job[1]

    def lack(self) -> str:
        """Return why the bytes of what is shown cannot be had, "" where they can."""
        if not self.is_past or self.stream.cursor is None:
            return NOT_KEPT if self._view_model.lacks_bytes else ""
        job = self.job_here()
        if job is not None and (job.is_open or not job.is_kept):
            return job.reason if job.is_open else f"{job.whole} B dropped, {job.reason}"
        if job is not None and job.position - job.first < self.stream.window.begin:
            return f"the first bytes of it are {self.stream.window.lack}"
        return "" if self.job_of_cursor() is not None else "the bytes of this job have not come yet"

    def byte_in_job(self) -> int:
        """Return the place of the stream's cursor in its job, -1 where there is none."""
        job = self.job_here()
        here = self.stream.cursor
        return -1 if job is None or here is None else here - job.position + job.first

    def show_field(self, field: range, goes_there: bool) -> None:
        job = self.job_here()
        if job is None:
            return
        begin = job.position - job.first
        here = range(max(job.position, begin + field.start), min(job.stop, begin + field.stop))
        self.stream.show_link(here)
        if goes_there and here:
            self.stream.go_to(here.start)

    # -- keys --------------------------------------------------------------------------------------------

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Leave n to the screen before a search and in another pane, escape while nothing is marked."""
        if action == "find_next":
            return self._is_searched
        if action == "end_find":
            return bool(self.stream.patterns)
        return action != "rulers" or self.is_past

    def action_past(self) -> None:
        self.toggle_class(PAST)
        self._title = self._nowhere = ""
        self.job.display, self._job_rows = False, 0
        self.post_message(PastSelected())
        self._back_to_bytes()
        self.show()

    def action_done(self, is_forward: bool) -> None:
        if not self.is_past:
            self.action_past()
        stream = self.stream
        here = stream.cursor if stream.cursor is not None else stream.window.end + 1
        stream.look_for(here, is_forward)
        self._nowhere = ""
        self.show()

    def action_dropped(self) -> None:
        """Go to the newest bytes that were thrown away, then to the ones before, and so on."""
        if not self.is_past:
            self.action_past()
            self.stream.cursor = None
        stream = self.stream
        self._seeks_drop, self._nowhere = True, ""
        stream.look_for(stream.cursor if stream.cursor is not None else MOST, False, dropped=True)
        self.show()

    def go_to(self, byte: int) -> None:
        if not self.is_past:
            self.action_past()
        self.stream.go_to(byte)
        self.post_message(PastSelected())

    def action_before(self) -> None:
        self.stream.change_before()
        self.data.shows_before = self.stream.shows_before
        self.show()

    def action_rulers(self) -> None:
        if not self.is_past:  # by name, from the palette
            self.action_past()
        self.stream.change_rulers()

    # -- looking for bytes -------------------------------------------------------------------------------

    async def action_find(self) -> None:
        """Open the line for what is to be looked for; n and N go to the hits until another pane is chosen."""
        self._let_search(True)
        await self._find.open()

    def end_search(self) -> None:
        if self._is_searched:
            self._let_search(False)
            self.action_end_find()

    def _let_search(self, is_searched: bool) -> None:
        self._is_searched = is_searched
        for view in (self.data, self.job, self.stream):
            view.more_keys = NEXT_HIT if is_searched else ()

    def _back_to_bytes(self) -> None:
        self.screen.set_focus(self.stream if self.is_past else self.data)

    def action_find_next(self, is_forward: bool) -> None:
        self._go_on(is_forward, again=True)

    def _go_on(self, is_forward: bool, again: bool) -> None:
        wanted, stream = self._find.wanted, self.stream
        if wanted is None:  # nothing was typed, or what cannot be looked for
            self.run_worker(self.action_find())
            return
        if isinstance(wanted, Goal):
            self._go_to_goal(wanted)
            return
        self._let_search(True)  # by name, from the palette
        self._nowhere, patterns = "", wanted.patterns
        self._mark(patterns)
        if self.is_past:
            here = stream.cursor if stream.cursor is not None else stream.window.begin
            after = is_forward and again and stream.cursor is not None
            stream.look_for(here + after, is_forward, patterns)
        elif self.data.find(patterns, is_forward, again):
            place = self.data.cursor or 0
            self._hit = place, hit_of([(0, self.data.content)], patterns, place)
        else:
            self._nowhere = f"{wanted.about}: not found {'further on' if again else 'in DATA'}"
        self.show()

    def _go_to_goal(self, goal: Goal) -> None:
        """Go to an offset of what is shown, or to a job of the stream."""
        self._nowhere = ""
        if goal.is_job:
            if not self.is_past:
                self.action_past()
            self.stream.look_for(MOST, False, job=(self._view_model.selected, goal.number))
        else:
            view = self.stream if self.is_past else self.data
            kept = self.stream.window
            first, stop = (kept.begin, kept.end) if self.is_past else (0, self.data.need)
            if first <= goal.number < stop:
                view.select(goal.number)
            else:
                is_older = self.is_past and goal.number < first
                why = kept.lack if is_older else f"not here: bytes {first} to {stop - 1} are"
                self._nowhere = f"{goal.about} is {why}"
        self.show()

    def action_end_find(self) -> None:
        self._nowhere, self.stream.seek = "", None
        self._mark(())
        self.show()

    def _mark(self, patterns: tuple[bytes, ...]) -> None:
        for view in (self.data, self.job, self.stream):
            view.mark(patterns)

    # -- layout ------------------------------------------------------------------------------------------

    def on_resize(self) -> None:
        """Other widths hold other numbers of bytes in a line."""
        self.show()

    def _size_job(self, instance: InstanceSnapshot) -> None:
        # Between two jobs there is a scan without one: the room stays, or the screen would jump at each DONE.
        connection = self._view_model.connection
        is_up = connection is not None and connection.state == "connected"
        if not instance.need and instance.pin("EN_R") and is_up:
            return
        if not instance.need and instance.framer is not None and self._job_rows:
            return  # the next frame will want it
        need = 0 if instance.sends else instance.need
        self.job.rows_kept = -(-need // self.job.per_row)
        rows = min(MOST_JOB_ROWS - self._origin_line.display, self.job.rows_kept)
        if rows != self._job_rows:
            self._job_rows = rows
            self.job.styles.height = max(1, rows)
            self.job.display = rows > 0

    def _stand_together(self) -> None:
        rows = max(1, self.data.row_count())
        wanted = rows if rows + 2 + self._job_rows <= self.size.height else None
        if wanted != self._data_rows:
            self._data_rows = wanted
            self.data.styles.height = "1fr" if wanted is None else wanted
            self.set_class(wanted is not None, "-roomy")

    def _show_title(self, instance: InstanceSnapshot | None) -> None:
        declared = self._view_model.declaration
        name, detail = "Received", ""
        if instance is not None:
            detail = f"{declared.name}, {declared.size} B" if declared else "no DATA"
            name = "RESULT" if instance.data_pin == "RESULT" else "Sent" if instance.sends else name
        if self.is_past and instance is not None:
            size = f"{self.stream.window.end - self.stream.window.begin} B kept"
            name, detail = "Received so far", f"{instance.connect}, {size} · H: DATA now"
        if f"{name} {detail}" != self._title or not self.border_title:
            self._title = f"{name} {detail}"
            self.border_title = pane_title(5, name, clip(detail, 60))
