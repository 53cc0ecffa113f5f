"""What pane 5 shows after the key `D`: the table of messages, and below it the chosen message's bytes."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import ClassVar, Final

from textual.widget import Widget

from trcvtui.history.messages import MessageRow
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.tui.messages import ByteSelected, PastCursorMoved
from trcvtui.tui.panes.face import DetailLine, ReceivedFace
from trcvtui.tui.panes.message_list import MessageHead, MessageLines
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.hex_view import HexView
from trcvtui.tui.widgets.typed_lines import FilterLine

MOST_HEX_ROWS: Final = 4
VALUES_GONE: Final = "its values are no longer in the ring"
BYTES_NEVER_KEPT: Final = "its bytes were not kept"


class MessageBytes(HexView):
    KEYS: ClassVar = (("hjkl", "byte"), ("y", "yank"), ("D", "DATA now"))


class TableFace(ReceivedFace):
    """The table, and the bytes of the chosen message; pane 6 shows the members of this message."""

    DEFAULT_CSS = "TableFace HexView { height: 1; }"

    def __init__(self, view_model: ViewModel, below: DetailLine) -> None:
        self.messages = MessageLines(view_model)
        super().__init__(view_model, below, self.messages)
        self._head = MessageHead(self.messages)
        self._bytes = MessageBytes("message", shows_job=False)
        self._filter = FilterLine(self._set_filter, self.messages.action_move, self.messages)
        self._chosen: MessageRow | None = None  # the message that pane 6 shows

    def compose(self) -> Iterator[Widget]:
        yield from (self._head, self.messages, self._bytes)

    async def open_filter(self) -> None:
        if not self._filter.is_attached:
            await self.mount(self._filter, before=0)
        self._filter.open()

    def _set_filter(self, text: str) -> None:
        self.messages.set_filter(text)
        self.post_message(PastCursorMoved())

    def make_title(self, instance: InstanceSnapshot | None) -> tuple[str, str]:
        return "Messages", self.messages.describe_rows() if instance is not None else ""

    def request_past(self, instance: InstanceSnapshot) -> None:
        self._view_model.past_wanted = None

    def show(self) -> None:
        self.messages.show()
        self._head.show()
        shown = self.messages.find_current_row()
        if shown != self._chosen:
            self._chosen = shown
            self.post_message(PastCursorMoved())
        content = shown.content if shown is not None else None
        size = shown.size if shown is not None and content is not None else 0
        content = content or b""
        self._bytes.show_bytes(content, size, frozenset(), (range(len(content), size),))
        declared = self._view_model.message_type  # one height for all messages: the table above must not jump
        rows = -(-declared.size // self._bytes.per_row) if declared is not None else MOST_HEX_ROWS
        self._bytes.styles.height = max(1, min(MOST_HEX_ROWS, rows))
        about = f"message {shown.number}, scan {shown.scan}, {shown.size} B" if shown is not None else ""
        self.subtitle = self.note or about
        self._below.show_text(self.explain_lack(), may_break=False)

    async def csv(self) -> str:
        """Return the rows that pass the filter as CSV, made in a thread: the screen stays live."""
        from trcvtui.report.message_table import MessageType, format_csv  # imported on first use

        name, declared = self._view_model.selected, self._view_model.message_type
        type_ = MessageType(name, declared) if declared is not None else None
        begun_ns = self._view_model.live.begun_ns if self._view_model.live is not None else None
        return await asyncio.to_thread(format_csv, self.messages.rows(), type_, name, begun_ns)

    # -- the chosen message ----------------------------------------------------------------------------

    def on_byte_selected(self, message: ByteSelected) -> None:
        message.stop()
        self.post_message(PastCursorMoved())

    def job_of_cursor(self) -> tuple[str, int, bytes] | None:
        shown = self._chosen
        if shown is None or self._view_model.message_type is None:
            return None
        return self._view_model.selected, shown.number, shown.content or b""

    def offset_in_job(self) -> int:
        return -1 if self._bytes.cursor is None else self._bytes.cursor

    def show_field(self, field: range, goes_there: bool) -> None:
        self._bytes.link_bytes(field)
        if goes_there and field:
            self._bytes.go_to(field.start)

    def explain_lack(self) -> str:
        shown = self._chosen
        if shown is None or shown.content is not None:
            return ""
        return f"message {shown.number}: {VALUES_GONE if shown.position >= 0 else BYTES_NEVER_KEPT}"
