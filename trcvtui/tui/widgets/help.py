"""Help: the keys, the bench commands, and the whole STATUS table of the dialect in use."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, Final

from textual.binding import Binding
from textual.screen import ModalScreen
from textual.widget import Widget

from trcvtui.plc.wired_pins import BUFFER_PINS
from trcvtui.tui.formatting import plain, wrapped
from trcvtui.tui.view_model.view_model import Scene
from trcvtui.tui.widgets.keys import BLOCK, LETTERS, SECTION_OF, SECTIONS, KeyTable
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Row, row
from trcvtui.tui.widgets.styles import COMPONENT_CLASSES

KEY: Final = 18
SIGNS: Final = (
    ("■ □ ◆", "a lamp on, off, lit for one scan a moment ago (with its scan)"),
    ("⋄ _ • ×", "bytes: NUL, white space, control, 16#80 and up"),
    ("▕", "before a byte: a message of the peer begins here"),
    ("▁ ▔ █ ┃ ░", "over time: 0, 1, 1 for one scan, a pulse or more in the column, not known"),
    ("≠", "a scan in which the dialects of a race differ"),
    ("··", "a byte that the running job still waits for"),
    ("▸ ▶ • ✓ ✗", "a step of a scenario: the next, running, done, held, failed"),
)


class HelpText(LineView):
    """All of it as one scrolling text."""

    def __init__(self, scene: Scene, focused: Widget | None) -> None:
        super().__init__(id="help")
        self._scene = scene
        self._focused = focused
        self._rows: list[Row] = []

    def on_resize(self) -> None:
        """Break the lines anew."""
        self._rows = [*self._keys(), *self._table()]
        self.show()

    def row_count(self) -> int:
        """Return the number of lines."""
        return len(self._rows)

    def row_at(self, y: int) -> Row:
        """Return one line."""
        return self._rows[y] if y < len(self._rows) else EMPTY

    def _keys(self) -> list[Row]:
        rows: list[Row] = []
        names: dict[str, str] = getattr(self.app, "key_names", {})
        for problem in getattr(self.app, "problems", ()):
            first, *rest = wrapped(f"✗ {plain(problem)}", self.line_width - 2)
            rows += [row((first, "error")), *(row(("  " + line, "error")) for line in rest)]
        rows += [EMPTY] * bool(rows)
        for title, table in sections_for(self._focused):
            rows.append(row((title, "strong")))
            for shown, what in table:
                key = names.get(shown.split(" or ")[0], shown)
                first, *rest = wrapped(what, self.line_width - KEY - 3)
                rows.append(row((f"  {key:<{KEY}}", "key"), (first, "")))
                rows += [row((" " * (KEY + 2), ""), (line, "")) for line in rest]
            rows.append(EMPTY)
        return rows

    def _table(self) -> list[Row]:
        dialect, instance = self._scene.project.dialect, self._scene.instance
        rows = [row((f"STATUS of {plain(dialect.title)}", "strong"))]
        for found in dialect.status:
            current = instance is not None and found.code == instance.status
            rows.append(
                row(
                    ("▸ " if current else "  ", "key"),
                    (f"{found.word}  ", "error" if found.error else "strong"),
                    ("ERROR " if found.error else "      ", "error"),
                    (plain(found.title), "strong" if current else ""),
                    style="cursor" if current else "",
                )
            )
            for cause in found.causes:
                rows += self._indented("because", cause)
            for check in found.checks:
                rows += self._indented("check", check)
        return rows

    def _indented(self, label: str, text: str) -> list[Row]:
        lines = wrapped(text, self.line_width - 20)
        return [
            row((f"           {label if number == 0 else '':<8}", "faint"), (line, "dim"))
            for number, line in enumerate(lines)
        ]


def sections_for(focused: Widget | None) -> list[tuple[str, KeyTable]]:
    """Return the tables of keys, that of the pane with the focus first."""
    sections: list[tuple[str, KeyTable]] = [*SECTIONS, ("Signs", SIGNS)]
    around = [widget.id for widget in focused.ancestors_with_self] if focused is not None else []
    title = next((SECTION_OF[id] for id in around if id in SECTION_OF), None)
    here = focused.keys() if isinstance(focused, LineView) else ()
    table = dict(sections).get(title or "", ())
    if title == BLOCK and here:  # the pane tells its own letters; those of the other blocks are none here
        is_buffered = any(what in BUFFER_PINS for _, what in here)
        table = tuple(line for line in table if line not in (LETTERS if is_buffered else LETTERS[2:]))
    if not here and not table:
        return sections
    first = (f"Here: {title}" if title else "Here", (*here, *table))
    return [first, *(section for section in sections if section[0] != title)]


class HelpScreen(ModalScreen[None]):
    """Closed by the keys that opened it, and by escape."""

    BINDINGS: ClassVar = [
        Binding("escape,q", "app.pop_screen", show=False),
        Binding("question_mark,f1", "app.pop_screen", show=False, id="help"),
    ]
    COMPONENT_CLASSES: ClassVar[set[str]] = COMPONENT_CLASSES
    DEFAULT_CSS = """
    HelpScreen { align: center middle; background: $background 60%; }
    HelpScreen HelpText {
        width: 100; max-width: 100%; height: 90%; border: round $border; padding: 0 1;
    }
    """

    def __init__(self, scene: Scene, focused: Widget | None = None) -> None:
        super().__init__()
        self._scene = scene
        self._focused = focused

    def compose(self) -> Iterator[Widget]:
        """Compose the text."""
        text = HelpText(self._scene, self._focused)
        text.set_title(None, "Help", "↑↓ and page keys scroll, esc closes")
        yield text
