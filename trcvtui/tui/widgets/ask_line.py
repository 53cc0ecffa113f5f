"""A line to type a command into: opened with its beginning, enter takes it, escape drops it."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal
from textual.widget import Widget
from textual.widgets import Static

from trcvtui.tui.widgets.keystrokes import TypedField


class AskInput(TypedField):
    """What is typed."""

    BINDINGS: ClassVar = [Binding("escape", "drop", show=False)]

    def __init__(self, line: AskLine) -> None:
        super().__init__(id="ask")
        self._line = line

    async def action_submit(self) -> None:
        """Take the line."""
        self._line.close(self.value.strip())

    def action_drop(self) -> None:
        """Take nothing."""
        self._line.close("")


class AskLine(Horizontal):
    """One line, there while it is open."""

    DEFAULT_CSS = """
    AskLine { height: 1; display: none; background: $panel; padding: 0 1; }
    AskLine Static { width: 2; color: $accent; text-style: bold; }
    AskLine Input { background: $panel; width: 1fr; }
    AskLine Input:focus { background: $panel; background-tint: $primary 12%; }
    """

    def __init__(self, take: Callable[[str], None]) -> None:
        super().__init__()
        self._take = take
        self._input = AskInput(self)
        self._back: Widget | None = None

    def compose(self) -> ComposeResult:
        """Compose the sign and the field."""
        yield Static(":", markup=False)
        yield self._input

    def open(self, text: str) -> None:
        """Let a line be typed that begins like that; the very next key is part of it."""
        if not self.display:
            self._back = self.screen.focused
        self._input.value, self._input.cursor_position = text, len(text)
        self.display = True
        self.screen.set_focus(self._input)

    def close(self, line: str) -> None:
        """Close the line, and take what was typed."""
        self.screen.set_focus(self._back)
        self.display = False
        if line:
            self._take(line)
