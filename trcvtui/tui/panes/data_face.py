"""The face "DATA now" of pane 5: DATA, and below it the progress of the job.

A receive job shows its bytes that are not delivered yet. A send job shows how far its bytes have come.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from textual.widget import Widget

from trcvtui.history.records import HistoryRequest
from trcvtui.plc.snapshot import DataSummary, FramerSnapshot, InstanceSnapshot
from trcvtui.tui.formatting import bar
from trcvtui.tui.panes.combuffer import find_gap_timer, gap_parts
from trcvtui.tui.panes.face import DetailLine, ReceivedFace
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.hex_view import (
    DATA_BEGIN_SIGN,
    DATA_END,
    NOT_CAPTURED,
    HexView,
    make_marks,
    marks_of_data,
    marks_of_incomplete,
    numbers_text,
)
from trcvtui.tui.widgets.line_view import EMPTY, OneLine, Part, Row, rule
from trcvtui.tui.widgets.typed_lines import Target
from trcvtui.udt.byte_text import SearchPatterns, describe_hit
from trcvtui.wording import stamp_text

BAR_WIDTH: Final = 12
LEAST_GAP_WIDTH: Final = 74  # columns from which the gap timer fits beside the unfinished frame


class JobLine(OneLine):
    """One line between the two hex views: how far the job is."""

    def __init__(self, view_model: ViewModel) -> None:
        super().__init__(id="job-line")
        self._view_model = view_model

    def line(self) -> Row:
        instance = self._view_model.instance
        if instance is None:
            return EMPTY
        if instance.sends:
            return rule(self.line_width, *self._sent_parts(instance))
        if instance.framer is not None:
            return rule(self.line_width, *self._frame_parts(instance, instance.framer))
        if not instance.need:
            return rule(self.line_width, ("── no job running ", "dim"))
        full, empty = bar(instance.have, instance.need, BAR_WIDTH)
        mode = "ad-hoc, at most" if instance.adhoc else "of"
        numbers = f" {instance.have} {mode} {instance.need} B "
        return rule(
            self.line_width, ("── job ", "dim"), (full, "busy"), (empty, "faint"), (numbers, "strong"),
            ("not in DATA yet ", "dim"),
        )  # fmt: skip

    def _frame_parts(self, instance: InstanceSnapshot, framer: FramerSnapshot) -> list[Part]:
        if instance.outputs.busy:
            full, empty = bar(instance.have, framer.size, BAR_WIDTH)
            parts: list[Part] = [
                ("── unfinished ", "dim"), (full, "busy"), (empty, "faint"),
                (f" {instance.have} of ≤{framer.size} B ", "strong"),
            ]  # fmt: skip
            gap = find_gap_timer(self._view_model, instance)
            if gap is not None and gap.limit_ns and self.line_width >= LEAST_GAP_WIDTH:
                parts += [("· gap ", "dim"), *gap_parts(gap), (" ", "")]
            return parts
        last = framer.last
        if last is None:
            return [("── no frame has begun ", "dim")]
        data = last.size - last.prefix - last.suffix
        marks = f"prefix {last.prefix} {DATA_BEGIN_SIGN} data {data} {DATA_END} suffix {last.suffix}"
        style = "dim" if last.is_good else "warn"
        return [("── ", "dim"), (f"frame of {last.size} B", "strong"), (f" · {marks} · ", "dim"),
                (f"ended by: {framer.last_ending_text} ", style)]  # fmt: skip

    def _sent_parts(self, instance: InstanceSnapshot) -> list[Part]:
        """Return how far the sent bytes have come; DONE only means that the local stack has taken them."""
        parts: list[Part] = [("── ", "dim")]
        if instance.need:
            full, empty = bar(instance.have, instance.need, BAR_WIDTH)
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
            # The same connection, seen from its other end.
            if (peer.local, peer.remote) == (connection.remote, connection.local):
                parts.append((f" · {peer.received_here} read by {peer.name}", "dim"))
        return [*parts, (" ", "dim")]


MOST_JOB_ROWS: Final = 4
LEAST_ROWS: Final = 6  # with fewer there is no line of numbers below DATA


class DataFace(ReceivedFace):
    """Both hex views: DATA, and the bytes of the running job."""

    DEFAULT_CSS = """
    DataFace #data { height: 1fr; min-height: 1; }
    DataFace.-roomy { height: auto; }
    DataFace.-roomy JobLine { margin: 1 0 0 0; }
    DataFace #job { height: 1; display: none; }
    """

    def __init__(self, view_model: ViewModel, below: DetailLine) -> None:
        self.data = HexView("data", shows_job=False)
        self.job = HexView("job", shows_job=True)
        super().__init__(view_model, below, self.data)
        self._line = JobLine(view_model)
        self._job_rows = 0
        self._data_rows: int | None = None

    def compose(self) -> Iterator[Widget]:
        yield from (self.data, self._line, self.job)

    def make_title(self, instance: InstanceSnapshot | None) -> tuple[str, str]:
        if instance is None:
            return "Received", ""
        declared = self._view_model.declaration
        name = "RESULT" if instance.data_pin == "RESULT" else "Sent" if instance.sends else "Received"
        if declared is None:
            return name, "no DATA"
        new = self._partly_new_data()
        size = f" · {new.newest} of {new.longest} B are new" if new else f", {declared.size} B"
        return name, f"{declared.name}{size}"

    def _partly_new_data(self) -> DataSummary | None:
        """Return DATA if older bytes follow the bytes of the newest write, else None."""
        instance, snapshot = self._view_model.instance, self._view_model.snapshot
        if snapshot is None or instance is None or instance.sends:
            return None
        return next((d for d in snapshot.data if d.name == instance.data and d.newest < d.longest), None)

    def request_past(self, instance: InstanceSnapshot) -> None:
        wanted = HistoryRequest(instance.connect, data=(instance.name, *self.data.range_to_fetch()))
        self._view_model.past_wanted = None if instance.sends else wanted

    @property
    def _pane_height(self) -> int:
        return self.parent.size.height if isinstance(self.parent, Widget) else 0

    def hide_job(self) -> None:
        self.job.display, self._job_rows = False, 0

    def show(self) -> None:
        instance, partial = self._view_model.instance, self._view_model.job_bytes
        self._line.show()
        if instance is None:  # no bytes without an instance
            for view in (self.data, self.job):
                view.frame = None
                view.show_bytes(b"", 0, frozenset())
            self._show_origin()
            return
        self.data.frame, self.job.frame = marks_of_data(instance), marks_of_incomplete(instance)
        if self.data.frame is None and (new := self._partly_new_data()) is not None:
            self.data.frame = make_marks(0, new.newest, 0, 0)
        declared = self._view_model.declaration
        if declared is not None:  # full height before the bytes arrive: one layout, not two
            self.data.rows_kept = -(-declared.size // self.data.per_row) * self.data.row_lines
        self.data.show_bytes(self._view_model.data, 0, *self._starts_and_holes(False))
        self._size_job(instance)
        self._fit_data_height()
        grown = len(partial) > len(self.job.content)
        self.job.show_bytes(partial, instance.need, *self._starts_and_holes(True))
        self._show_origin()
        if grown and not self.job.has_focus:
            self.job.keep_in_view((len(partial) - 1) // self.job.per_row)

    def _starts_and_holes(self, of_job: bool) -> tuple[frozenset[int], tuple[range, ...]]:
        index, selected = self._view_model.stream_index, self._view_model.selected
        return index.list_message_starts(selected, of_job), index.list_missing(selected, of_job)

    def _show_origin(self) -> None:
        lack = self.explain_lack() if self._view_model.instance is not None else ""
        view = self.job if self.job.has_focus else self.data
        byte = view.cursor
        text = "" if byte is None or byte >= len(view.content) else self._origin(view, byte)
        has_room = byte is not None and self._pane_height >= LEAST_ROWS and not lack
        numbers = numbers_text(view.read_known_bytes(byte or 0), self.size.width - 2) if has_room else ""
        self._below.show_text(numbers, may_break=False)
        self.subtitle = lack or self.note or self._with_hit(byte, text)

    def _origin(self, view: HexView, byte: int) -> str:
        value, is_hole = view.content[byte], view.is_hole(byte)
        words = [f"byte {byte}: {NOT_CAPTURED}" if is_hole else f"byte {byte} = 16#{value:02X} = {value}"]
        origin = self._view_model.stream_index.find_origin(self._view_model.selected, view.shows_job, byte)
        if origin is not None:
            recv, message = origin.recv, origin.message
            words.append(f"job {origin.job.number}")
            words += [f"recv {recv.number}, scan {recv.scan}"] if recv is not None else []
            if message is not None and not is_hole:
                words.append(f"{message.peer} #{message.number} byte {message.first}")
            words += [f"{stamp_text(recv.t_ns)} s"] if recv is not None else []
        return " · ".join(words)

    # -- searching for bytes -----------------------------------------------------------------------------

    def find(self, wanted: SearchPatterns, is_forward: bool, again: bool) -> None:
        self.note, patterns = "", wanted.patterns
        if self.data.find(patterns, is_forward, again):
            place = self.data.cursor or 0
            self.hit = place, describe_hit([(0, self.data.content)], patterns, place)
        else:
            self.note = f"{wanted.about}: not found {'further on' if again else 'in DATA'}"

    def go_to_offset(self, goal: Target) -> None:
        self._select_offset(goal, self.data.select, range(self.data.need))

    # -- layout ------------------------------------------------------------------------------------------

    def _size_job(self, instance: InstanceSnapshot) -> None:
        # Between two jobs there is a scan without one: the room stays, or the screen would jump at each DONE.
        connection = self._view_model.connection
        is_up = connection is not None and connection.state == "connected"
        wants_more = (instance.pin("EN_R") and is_up) or (instance.framer is not None and self._job_rows)
        if not instance.need and wants_more:  # keep the room for the next job or frame
            return
        need = 0 if instance.sends else instance.need
        self.job.rows_kept = -(-need // self.job.per_row)
        rows = min(MOST_JOB_ROWS - self._below.display, self.job.rows_kept)
        if rows != self._job_rows:
            self._job_rows = rows
            self.job.styles.height = max(1, rows)
            self.job.display = rows > 0

    def _fit_data_height(self) -> None:
        rows = max(1, self.data.row_count())
        wanted = rows if rows + 2 + self._job_rows <= self._pane_height else None
        if wanted != self._data_rows:
            self._data_rows = wanted
            self.data.styles.height = "1fr" if wanted is None else wanted
            self.set_class(wanted is not None, "-roomy")
