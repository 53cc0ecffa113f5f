"""A line about the play: what comes next, how it went; trouble takes up to three rather than lose its end."""

from __future__ import annotations

from typing import Final

from trcvtui.tui.formatting import wrapped
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Row, row

MOST_ROWS: Final = 3


class OutcomeLine(LineView, can_focus=False):
    """A sentence and the style it is said in."""

    DEFAULT_CSS = "OutcomeLine { height: 1; background: $background; padding: 0 1; }"

    def __init__(self) -> None:
        super().__init__(id="outcome")
        self._said = "", ""
        self._rows = 1

    def say(self, words: str, style: str = "dim") -> None:
        """Show this."""
        self._said = words, style
        self._fit()
        self.show()

    def _fit(self) -> None:
        rows = self.row_count()
        if rows != self._rows:
            self._rows = self.styles.height = rows

    def on_resize(self) -> None:
        """Break the lines anew."""
        self._fit()
        self.show()

    def _texts(self) -> tuple[str, ...]:
        return wrapped(self._said[0], self.line_width or 80)[:MOST_ROWS]

    def row_count(self) -> int:
        """Return the lines that it takes."""
        return len(self._texts())

    def row_at(self, y: int) -> Row:
        """Return one of them."""
        texts = self._texts()
        return row((texts[y], self._said[1])) if y < len(texts) else EMPTY
