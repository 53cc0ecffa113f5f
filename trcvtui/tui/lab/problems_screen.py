"""What is wrong in the type files, line by line, also in types that nobody uses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar

from textual.binding import Binding
from textual.screen import ModalScreen
from textual.widget import Widget

from trcvtui.tui.formatting import wrapped
from trcvtui.tui.widgets.line_view import LineView, Row, row
from trcvtui.tui.widgets.styles import COMPONENT_CLASSES


class ProblemList(LineView):
    """Every problem in as many lines as it needs."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__(id="problems")
        self._problems = problems
        self._rows: list[Row] = []

    def on_resize(self) -> None:
        """Break the lines anew."""
        width = max(20, self.line_width - 2)
        self._rows = [
            row(("✗ " if number == 0 else "  ", "error"), (line, ""))
            for problem in self._problems
            for number, line in enumerate(wrapped(problem, width))
        ]
        self.show()

    def row_count(self) -> int:
        """Return the number of lines."""
        return max(len(self._problems), len(self._rows))

    def row_at(self, y: int) -> Row:
        """Return one line."""
        return self._rows[y] if y < len(self._rows) else Row()


class ProblemsScreen(ModalScreen[None]):
    """Closed by escape."""

    BINDINGS: ClassVar = [Binding("escape,q,w", "app.pop_screen", show=False)]
    COMPONENT_CLASSES: ClassVar[set[str]] = COMPONENT_CLASSES
    DEFAULT_CSS = """
    ProblemsScreen { align: center middle; background: $background 60%; }
    ProblemsScreen ProblemList {
        width: 110; max-width: 100%; height: 80%; border: round $border; padding: 0 1;
    }
    """

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__()
        self._problems = problems

    def compose(self) -> Iterator[Widget]:
        """Compose the list."""
        shown = ProblemList(self._problems)
        shown.set_title(None, "Problems", f"{len(self._problems)} in the type files; esc closes")
        yield shown
