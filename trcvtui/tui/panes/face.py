"""The base of the faces of pane 5: one is shown at a time, with the same line above and below it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from textual.containers import Vertical

from trcvtui.tui.formatting import clip, wrap_text
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Row, row
from trcvtui.tui.widgets.typed_lines import Target

ROOMY: Final = 100
BYTES_NOT_KEPT: Final = "the view froze without these bytes: F goes back to live"


class DetailLine(LineView, can_focus=False):
    """Below the stream: the origin of the selected byte, or a search. Below DATA: the byte as numbers."""

    DEFAULT_CSS = "DetailLine { height: 1; display: none; }"

    def __init__(self) -> None:
        super().__init__(id="origin-line")
        self.text = ""
        self._may_break = True

    def row_count(self) -> int:
        return 1 if self.line_width >= ROOMY or not self._may_break else 2

    def row_at(self, y: int) -> Row:
        texts = wrap_text(self.text, self.line_width) if self.row_count() > 1 else (self.text,)
        return row((clip(texts[y], self.line_width), "strong")) if y < len(texts) else EMPTY

    def on_resize(self) -> None:
        self.styles.height = self.row_count()
        self.show()

    def show_text(self, text: str, may_break: bool) -> None:
        self.text, self._may_break, self.display = text, may_break, bool(text) or may_break
        self.on_resize()


class ReceivedFace(Vertical):
    """One view of the received bytes. `first` gets the keys. `subtitle` is drawn in the frame."""

    def __init__(self, view_model: ViewModel, below: DetailLine, first: LineView) -> None:
        super().__init__()
        self._view_model, self._below, self.first = view_model, below, first
        self.is_shown = self.is_searching = False  # searched: n and N go to hits
        self.subtitle = self.note = ""  # note: what could not be found or done
        self.hit = -1, ""  # place of the hit, and `hit 2 of 7`

    def job_of_cursor(self) -> tuple[str, int, bytes] | None:
        """Return instance, number and bytes of the past job that is shown, None for DATA."""
        return None

    def offset_in_job(self) -> int:
        return -1

    def explain_lack(self) -> str:
        """Return why the shown bytes are not available, "" if they are."""
        return BYTES_NOT_KEPT if self._view_model.lacks_bytes else ""

    def show_field(self, field: range, goes_there: bool) -> None:
        """Mark the bytes of a member."""

    def _select_offset(
        self, goal: Target, select: Callable[[int], None], kept: range, lack: str = ""
    ) -> None:
        is_here, is_older = goal.number in kept, lack and goal.number < kept.start
        why = lack if is_older else f"not kept (only bytes {kept.start} to {kept.stop - 1} are)"
        self.note = "" if is_here else f"{goal.about} is {why}"
        if is_here:
            select(goal.number)

    def _with_hit(self, place: int | None, text: str) -> str:
        hit = self.hit[1] if self.is_searching and place == self.hit[0] else ""
        return " · ".join(filter(None, (hit, text)))
