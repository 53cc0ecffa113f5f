"""The panes as tabs, for a small screen: digit and name, the open one marked."""

from __future__ import annotations

from textual import events

from trcvtui.tui.messages import PaneWanted
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row

TABS = (
    (3, "STATUS"), (2, "Block"), (4, "History"), (5, "Received"), (6, "Members"), (7, "Peer"), (8, "Timing"),
)  # fmt: skip


class TabLine(LineView, can_focus=False):
    """One line; a click opens a tab."""

    DEFAULT_CSS = "TabLine { height: 1; background: $background; padding: 0 1; }"

    def __init__(self, tabs: tuple[tuple[int, str], ...] = TABS, opened: int = 3) -> None:
        super().__init__(id="tabs")
        self._tabs = tabs
        self._open = opened

    def take(self, tabs: tuple[tuple[int, str], ...]) -> None:
        """Have these tabs from now on."""
        self._tabs = tabs

    def mark(self, digit: int) -> None:
        """Mark the tab that is open."""
        self._open = digit
        self.show()

    def row_count(self) -> int:
        """Return 1."""
        return 1

    def row_at(self, y: int) -> Row:
        """Return the tabs."""
        if y:
            return EMPTY
        parts: list[Part] = []
        for digit, name in self._shown():
            style = "cursor strong" if digit == self._open else "dim"
            parts += [
                (f" {digit} ", f"key {style}" if digit == self._open else "key"),
                (f"{name} " if name else "", style),
                (" ", ""),
            ]
        return row(*parts)

    def _shown(self) -> list[tuple[int, str]]:
        """Return the tabs with their names; where these do not fit, the open one alone has its name."""
        whole = sum(len(name) + 5 for _, name in self._tabs) - 1
        fits = whole <= self.line_width or not self.line_width
        return [(digit, name if fits or digit == self._open else "") for digit, name in self._tabs]

    def on_click(self, event: events.Click) -> None:
        """Open the tab under the mouse."""
        place, left = self.place_of(event), 0
        for digit, name in self._shown():
            width = len(name) + (5 if name else 4)
            if place is not None and left <= place[0] < left + width - 1:
                self.post_message(PaneWanted(digit))
            left += width
