"""Pane 5 shows one face at a time: DATA now, all bytes received so far (`H`), or the messages (`D`)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, ClassVar, Final

from textual.binding import Binding
from textual.containers import Vertical
from textual.content import Content
from textual.widget import Widget

from trcvtui.tui.formatting import clip
from trcvtui.tui.messages import MessageChosen, PastCursorMoved
from trcvtui.tui.panes.data_face import DataFace
from trcvtui.tui.panes.face import DetailLine
from trcvtui.tui.panes.stream_face import StreamFace
from trcvtui.tui.panes.table_face import TableFace
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import pane_title
from trcvtui.tui.widgets.typed_lines import FindLine, Target

END_POSITION: Final = 1 << 62  # after every position
SEARCH_KEYS: Final = (("n N", "next hit, hit before"),)


class ReceivedPane(Vertical):
    """Shows one face and switches between faces; the pane's keys act on the shown face."""

    DEFAULT_CSS = "ReceivedPane { background: $surface; }"
    BINDINGS: ClassVar = [
        Binding("H", "past", "all received bytes as a stream, or DATA now", show=False),
        Binding("D", "messages", "messages as a table: values, filter, CSV; or DATA", show=False),
        Binding("slash", "find", "find bytes, text or a number", show=False),
        Binding("n", "find_next(True)", "the next hit, else the next DONE", show=False),
        Binding("N", "find_next(False)", "the hit before, else the DONE before", show=False),
        Binding("left_square_bracket", "done(False)", "the DONE before", show=False),
        Binding("right_square_bracket", "done(True)", "the next DONE", show=False),
        Binding("d", "before", "diff against the job before", show=False),
        Binding("m", "mark_message", "mark the message: d compares with it, y copies from it on", show=False),
        Binding("u", "rulers", "rulers of the stream: all, fewer, none", show=False),
        Binding("escape", "end_find", "end the search", show=False),
    ]

    def __init__(self, view_model: ViewModel, complain: Callable[[str], None]) -> None:
        super().__init__(id="received")
        self._view_model = view_model
        self._find = FindLine(lambda: self._continue_search(True, again=False), self._focus_face, complain)
        self._below = DetailLine()
        self.now = DataFace(view_model, self._below)
        self.past = StreamFace(view_model, self._find, self._below)
        self.data, self.job, self.stream = self.now.data, self.now.job, self.past.stream
        self.table = TableFace(view_model, self._below)
        self._faces = self.now, self.past, self.table
        self._turn_to(self.now)
        self._titles: tuple[Content, str] | None = None

    def compose(self) -> Iterator[Widget]:
        yield self._find
        yield from self._faces
        yield self._below

    @property
    def is_past(self) -> bool:
        return self.face is self.past

    @property
    def is_table(self) -> bool:
        return self.face is self.table

    def _turn_to(self, face: DataFace | StreamFace | TableFace) -> None:
        self.face = face
        for each in self._faces:
            each.is_shown = each.display = each is face
            each.note = ""
        self.now.hide_job()

    def show(self) -> None:
        instance, face = self._view_model.instance, self.face
        if instance is not None:
            self.past.update_stream(instance)
            if (window := self._view_model.past_window) is not None and window.connect == instance.connect:
                self.data.show_before(window.data)
            face.request_past(instance)
        shown = self.now if instance is None and self.is_past else face  # no stream without an instance
        shown.show()
        name, detail = self.face.make_title(instance)
        title = pane_title(5, name, clip(detail, max(60, self.size.width - len(name) - 9)))
        if (title, shown.subtitle) != self._titles:
            self._titles = title, shown.subtitle
            self.border_title, self.border_subtitle = title, Content(shown.subtitle)

    def on_resize(self) -> None:
        """Draw again: the width decides how many bytes a row has, and how long the title may be."""
        self.show()

    # -- keys --------------------------------------------------------------------------------------------

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Allow `end_find` only while there is a search to end, and `rulers` only in the stream."""
        if action == "end_find":
            return bool(self.stream.patterns)
        return action != "rulers" or self.is_past

    def action_past(self) -> None:
        self._open(self.now if self.is_past else self.past)

    def action_messages(self) -> None:
        self._open(self.now if self.is_table else self.table)

    def _open(self, face: DataFace | StreamFace | TableFace) -> None:
        if self.is_table:
            self.post_message(MessageChosen(None))
        self._turn_to(face)
        self.post_message(PastCursorMoved())
        self._focus_face()
        self.show()

    def _open_past(self) -> None:
        if not self.is_past:
            self.action_past()

    def action_done(self, is_forward: bool) -> None:
        """Go to the next or the previous DONE; from the present, go to the newest DONE."""
        self._open_past()
        self._search_stream(self.stream.window.end + 1, is_forward and self.stream.cursor is not None)

    def action_dropped(self) -> None:
        if not self.is_past:
            self.action_past()
            self.stream.cursor = None
        self.past.seeks_drop = True
        self._search_stream(END_POSITION, False, dropped=True)

    def _search_stream(self, end: int, is_forward: bool, **what: Any) -> None:
        """Search the stream from the cursor. Without a cursor, search from position `end`."""
        here = self.stream.cursor
        self.stream.search(here if here is not None else end, is_forward, **what)
        self.past.note = ""
        self.show()

    def go_to(self, byte: int) -> None:
        self._open_past()
        self.stream.go_to(byte)
        self.post_message(PastCursorMoved())

    def action_before(self) -> None:
        self.stream.toggle_before()
        self.data.shows_before = self.stream.shows_before
        self.show()

    def action_mark_message(self) -> None:
        self.face.note = self.past.toggle_message_mark()
        self.show()

    def action_rulers(self) -> None:
        self._open_past()  # the palette may run it while another face is shown
        self.stream.change_rulers()

    # -- searching for bytes -----------------------------------------------------------------------------

    async def action_find(self) -> None:
        """Open the search line; n and N go to the hits until you choose another pane."""
        if self.is_table:
            await self.table.open_filter()
        else:
            self._mark_searching(True)
            await self._find.open()

    def end_search(self) -> None:
        if self.face.is_searching:
            self._mark_searching(False)
            self.action_end_find()

    def _mark_searching(self, is_searched: bool) -> None:
        for face in self._faces:
            face.is_searching = is_searched
        for view in (self.data, self.job, self.stream):
            view.more_keys = SEARCH_KEYS if is_searched else ()

    def _focus_face(self) -> None:
        self.screen.set_focus(self.face.first)

    def action_find_next(self, is_forward: bool) -> None:
        if self.face.is_searching or self.is_table:
            self._continue_search(is_forward, again=True)
        else:
            self.action_done(is_forward)

    def _continue_search(self, is_forward: bool, again: bool) -> None:
        wanted, face = self._find.target, self.face
        if isinstance(face, TableFace):
            face.messages.action_move(1 if is_forward else -1)
        elif wanted is None:  # nothing was typed, or it has a mistake
            self.run_worker(self.action_find())
        elif not isinstance(wanted, Target):
            self._mark_searching(True)  # the palette may run it before `/`
            self._mark_hits(wanted.patterns)
            face.find(wanted, is_forward, again)
        elif wanted.is_job:
            self._open_past()
            self.stream.search(END_POSITION, False, job=(self._view_model.selected, wanted.number))
        else:
            face.go_to_offset(wanted)
        self.show()

    def action_end_find(self) -> None:
        self.face.note, self.stream.seek = "", None
        self._mark_hits(())
        self.show()

    def _mark_hits(self, patterns: tuple[bytes, ...]) -> None:
        for view in (self.data, self.job, self.stream):
            view.mark_hits(patterns)
