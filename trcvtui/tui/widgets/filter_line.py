"""The filter of a list: `/` opens it, it acts while it is typed, enter keeps it, escape drops it."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal
from textual.widget import Widget
from textual.widgets import Input, Static

from trcvtui.tui.widgets.keystrokes import TypedField


class FilterInput(TypedField):
    """The words of the filter; up and down go on moving in the list."""

    BINDINGS: ClassVar = [
        Binding("escape", "drop", show=False),
        Binding("up", "list(-1)", show=False),
        Binding("down", "list(1)", show=False),
    ]

    def __init__(self, line: FilterLine) -> None:
        super().__init__(id="filter")
        self._line = line

    async def action_submit(self) -> None:
        """Keep the filter."""
        self._line.close()
        self._line.taken()

    def action_drop(self) -> None:
        """Show everything again."""
        self.value = ""
        self._line.close()

    def action_list(self, files: int) -> None:
        """Move in the list."""
        self._line.move(files)


class FilterLine(Horizontal):
    """One line, there while it is open."""

    DEFAULT_CSS = """
    FilterLine { height: 1; display: none; background: $panel; padding: 0 1; }
    FilterLine Static { width: 2; color: $accent; text-style: bold; }
    FilterLine Input { background: $panel; width: 1fr; }
    FilterLine Input:focus { background: $panel; background-tint: $primary 12%; }
    """

    def __init__(
        self,
        narrow: Callable[[str], None],
        move: Callable[[int], None],
        back: Widget,
        taken: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__()
        self.taken = taken
        self._narrow = narrow
        self.move = move
        self._back = back
        self._input = FilterInput(self)

    def compose(self) -> ComposeResult:
        """Compose the sign and the field."""
        yield Static("/", markup=False)
        yield self._input

    def open(self) -> None:
        """Let the words be typed; the very next key is one of them."""
        self.display = True
        self.screen.set_focus(self._input)

    def clear(self) -> None:
        """Show everything again, from outside the line."""
        self._input.value = ""
        self._narrow("")

    def close(self) -> None:
        """Close the line; what stands in it now is the filter."""
        self._narrow(self._input.value)
        self.screen.set_focus(self._back)
        self.display = False

    def on_input_changed(self, event: Input.Changed) -> None:
        """Filter while typing."""
        event.stop()
        self._narrow(self._input.value)
