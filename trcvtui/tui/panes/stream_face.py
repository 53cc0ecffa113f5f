"""The stream that pane 5 shows after the key `H`: all received bytes, and where each byte came from."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from textual.widget import Widget

from trcvtui.history.records import JobSpan, MessageSpan, RecvSpan
from trcvtui.plc.ledger import A_HOLE
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.project.project import Project
from trcvtui.tui.messages import PastCursorMoved
from trcvtui.tui.panes.face import DetailLine, ReceivedFace
from trcvtui.tui.panes.stream_view import StreamView
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.hex_view import NOT_CAPTURED, numbers_text
from trcvtui.tui.widgets.typed_lines import FindLine, Target
from trcvtui.udt.byte_text import SearchPatterns
from trcvtui.wording import stamp_text

Labels = tuple[JobSpan | None, RecvSpan | None, MessageSpan | None]


def origin_words(place: int, values: tuple[int | None, int | None], labels: Labels, project: Project) -> str:
    """Return value, message, job, field, recv call, scan and time of the byte at a position.

    `values` are this byte and the byte at the same offset in the previous job.
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
    if job.done and (field := find_member_path(project, job.instance, byte)):
        words.append(field)
    if recv is not None and recv.number:
        words += [f"recv {recv.number}", f"scan {recv.scan}", f"{stamp_text(recv.t_ns)} s"]
    if not job.done:
        words.append(job.reason)
    return " · ".join(words)


def _job_words(job: JobSpan, byte: int) -> str:
    """Return the instance and job of a byte; in a frame also prefix, data or suffix."""
    if not job.instance or (not job.done and not job.number):
        return job.instance or "no job"
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


def find_member_path(project: Project, instance: str, byte: int) -> str:
    """Return the path of the member of an instance's DATA that holds a byte, "" for padding."""
    declared = project.received_data(instance)
    number = declared.layout.leaf_number_at(byte) if declared is not None else None
    return declared.layout.leaf(number).path if declared is not None and number is not None else ""


NO_MESSAGE: Final = "nothing to mark: H, then choose a byte of a message"
NO_DROP: Final = "no bytes were thrown away before this place"


class StreamFace(ReceivedFace):
    """The view of the stream in pane 5. It takes new bytes even while pane 5 shows another view."""

    def __init__(self, view_model: ViewModel, find: FindLine, below: DetailLine) -> None:
        self.stream = StreamView()
        super().__init__(view_model, below, self.stream)
        self._find = find
        self.past_job: tuple[int, bytes] | None = None  # position and bytes of the job under the cursor
        self._job_here: JobSpan | None = None
        self.seeks_drop = False
        self._known = ("", 0)  # CONNECT and bench of the stream

    def compose(self) -> Iterator[Widget]:
        yield self.stream

    def make_title(self, instance: InstanceSnapshot | None) -> tuple[str, str]:
        kept = self.stream.window
        detail = f"{instance.connect}, {kept.end - kept.begin} B kept · H: DATA now" if instance else ""
        return "Received so far", detail

    def update_stream(self, instance: InstanceSnapshot) -> None:
        known = instance.connect, self._view_model.bench
        if known != self._known:
            self._known, self.past_job, self._job_here = known, None, None
            self.stream.reset_stream()
        window = self._view_model.past_window
        if window is not None and window.connect == instance.connect:
            found = self.stream.accept_window(window)
            self.stream.cut_rows([each.positions for each in self._view_model.messages])
            if found is not None:
                self.hit = found, window.sought.hit if window.sought is not None else ""
                self.stream.go_to(found)
                self.post_message(PastCursorMoved())
            if window.job is not None and window.job != self.past_job:
                self.past_job = window.job
                self.post_message(PastCursorMoved())

    def request_past(self, instance: InstanceSnapshot) -> None:
        if self._view_model.is_frozen:
            self.stream.follows = False
        job = self.job_here()
        is_here = job is None or job.is_open or self._has_bytes_of(job)
        wanted = job.position if job is not None and not is_here else None  # the job to fetch bytes of
        self._view_model.past_wanted = self.stream.make_request(instance.connect, wanted)

    def _has_bytes_of(self, job: JobSpan) -> bool:
        return self.past_job is not None and self.past_job[0] == job.position

    def show(self) -> None:
        self.stream.set_compared(self.stream.marked, self.message_here())
        self.stream.show()
        text, place = self._report_search() or self.note or self._describe_origin(), self.stream.cursor
        width = self.size.width - 4
        self.subtitle = "" if place is None else numbers_text(self.stream.read_known_bytes(place), width)
        self._below.show_text(text, may_break=True)

    def _report_search(self) -> str:
        window = self._view_model.past_window
        sought = window.sought if window is not None else None
        if self.stream.seek is not None:
            self.note = ""
            return (
                f"searching … {sought.share:.0%}"
                if sought is not None and sought.share < 1
                else "searching …"
            )
        if self.seeks_drop and sought is not None:
            self.seeks_drop, self.note = False, NO_DROP if sought.position is None else ""
        if sought is not None and sought.position is None and (wanted := self._find.target) is not None:
            self.note = f"{wanted.about}: not found"
        return ""

    def _describe_origin(self) -> str:
        if self.stream.cursor is None:
            return "" if self.stream.window.end else "nothing received yet"
        project = self._view_model.project
        origin = origin_words(self.stream.cursor, self.stream.cursor_values(), self.stream.spans(), project)
        window = self.stream.window
        if window.lack and self.stream.cursor == window.begin:
            origin += f" · the oldest kept byte, others are {window.lack}"
        return self._with_hit(self.stream.cursor, self.stream.difference_text() + origin)

    def message_here(self) -> range:
        """Return the positions of the message at the cursor, else of the job there if all of it is here."""
        place, job = self.stream.cursor, self.job_here()
        of_job = range(job.position, job.stop) if job is not None else range(0)
        found = [each.positions for each in self._view_model.messages if place in each.positions]
        return found[0] if found else of_job if self.stream.window.has_values(of_job) else range(0)

    def bytes_to_copy(self) -> tuple[bytes, bytes]:
        """Return the message under the cursor, and all bytes from the marked message to the cursor."""
        window, mark, place = self.stream.window, self.stream.marked, self.stream.cursor
        between = range(0)
        if mark is not None and place is not None:
            between = range(min(mark[0].start, place), max(place + 1, mark[0].stop * (place < mark[0].start)))
        return window.part(self.message_here()), window.part(between) if window.has_values(between) else b""

    def toggle_message_mark(self) -> str:
        """Mark or unmark the message under the cursor for comparing. Return an error, or ""."""
        here, stream = self.message_here() if self.is_shown else range(0), self.stream
        is_marked = stream.marked is not None and stream.marked[0] == here
        stream.set_compared(None if is_marked or not here else (here, stream.window.part(here)), here)
        return "" if here else NO_MESSAGE

    def job_here(self) -> JobSpan | None:
        """Return the job under the stream's cursor, also after the job was scrolled out of the window."""
        job, place, last = self.stream.spans()[0], self.stream.cursor, self._job_here
        if job is None and last is not None and place is not None and last.position <= place < last.stop:
            return last
        self._job_here = job
        return job

    def job_of_cursor(self) -> tuple[str, int, bytes] | None:
        """Return instance, number (0: dropped) and bytes of the job at the cursor; None without bytes."""
        job, known = self.job_here() if self.is_shown else None, self.past_job
        if job is None or known is None or not self._has_bytes_of(job) or len(known[1]) < job.whole:
            return None
        return job.instance, job.number * job.done, known[1]

    def explain_lack(self) -> str:
        if self.stream.cursor is None:
            return super().explain_lack()
        job = self.job_here()
        if job is not None and (job.is_open or not job.is_kept):
            return job.reason if job.is_open else f"{job.whole} B dropped, {job.reason}"
        if job is not None and job.position - job.first < self.stream.window.begin:
            return f"its first bytes are {self.stream.window.lack}"
        return "" if self.job_of_cursor() is not None else "the bytes of this job have not arrived yet"

    def offset_in_job(self) -> int:
        """Return the offset of the stream's cursor in its job, -1 without a job."""
        job, here = self.job_here(), self.stream.cursor
        return -1 if job is None or here is None else here - job.position + job.first

    def show_field(self, field: range, goes_there: bool) -> None:
        job = self.job_here()
        if job is None:
            return
        begin = job.position - job.first
        here = range(max(job.position, begin + field.start), min(job.stop, begin + field.stop))
        self.stream.link_bytes(here)
        if goes_there and here:
            self.stream.go_to(here.start)

    # -- searching for bytes -----------------------------------------------------------------------------

    def go_to_offset(self, goal: Target) -> None:
        kept = self.stream.window
        self._select_offset(goal, self.stream.select, range(kept.begin, kept.end), kept.lack)

    def find(self, wanted: SearchPatterns, is_forward: bool, again: bool) -> None:
        self.note, stream = "", self.stream
        here = stream.cursor if stream.cursor is not None else stream.window.begin
        after = is_forward and again and stream.cursor is not None
        stream.search(here + after, is_forward, wanted.patterns)
