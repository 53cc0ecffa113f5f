"""The menu of yank: each way to write what stands there, with its letter and how it begins."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from textual import events
from textual.binding import Binding
from textual.screen import ModalScreen
from textual.widget import Widget

from trcvtui.tui.copying.copy_formats import FORMATS, Format, Subject
from trcvtui.tui.formatting import clip, plain
from trcvtui.tui.widgets.line_view import LineView, Row, row
from trcvtui.tui.widgets.styles import COMPONENT_CLASSES

NAME: int = 34
LETTERS = tuple(form.letter for form in FORMATS)


class YankList(LineView):
    """One line a format; what has nothing to write is pale."""

    BINDINGS: ClassVar = [Binding("enter", "screen.take_chosen", show=False)]

    def __init__(self, subject: Subject, first: str) -> None:
        super().__init__(id="yank")
        self.texts = {form.letter: form.write(subject) for form in FORMATS}
        self.cursor = LETTERS.index(first) if self.texts[first] else self._next(-1, 1)

    def _next(self, place: int, step: int) -> int:
        """Return the next format that has something to write; the place itself where none has."""
        for away in range(1, len(FORMATS) + 1):
            candidate = (place + step * away) % len(FORMATS)
            if self.texts[LETTERS[candidate]]:
                return candidate
        return max(0, place)

    def row_count(self) -> int:
        """Return the number of formats."""
        return len(FORMATS)

    def row_at(self, y: int) -> Row:
        """Return one format."""
        form = FORMATS[y]
        text = self.texts[form.letter]
        begins = plain(" ".join(text[:200].split())) if text else "nothing there"
        chosen = y == self.cursor
        return row(
            ("▸ " if chosen else "  ", "key"),
            (f"{form.letter}  ", "key" if text else "faint"),
            (form.name.ljust(NAME), "" if text else "faint"),
            (clip(begins, max(8, self.line_width - NAME - 5)), "dim" if text else "faint"),
            style="cursor" if chosen else "",
        )

    def action_move(self, rows: int) -> None:
        """Choose another format."""
        self.cursor = self._next(self.cursor, 1 if rows > 0 else -1)
        self.show()

    def on_click(self, event: events.Click) -> None:
        """Take the format under the mouse."""
        place = self.place_of(event)
        if place is not None and place[1] < len(FORMATS):
            self.screen.run_worker(self.screen.run_action(f"take('{LETTERS[place[1]]}')"))


class YankScreen(ModalScreen[tuple[Format, str] | None]):
    """Answers with the chosen format and its text; letters choose at once, `y` again takes the first."""

    BINDINGS: ClassVar = [
        *[Binding(letter, f"take('{letter}')", show=False) for letter in LETTERS],
        Binding("y,enter", "take_chosen", show=False),
        Binding("down", "move(1)", show=False),
        Binding("up", "move(-1)", show=False),
        Binding("escape,q", "leave", show=False),
    ]
    COMPONENT_CLASSES: ClassVar[set[str]] = COMPONENT_CLASSES
    DEFAULT_CSS = """
    YankScreen { align: center middle; background: $background 60%; }
    YankScreen YankList {
        width: 96; max-width: 100%; height: auto; border: round $border; padding: 0 1;
    }
    """

    def __init__(self, subject: Subject, first: str) -> None:
        super().__init__()
        self._list = YankList(subject, first)
        self._title = f"{len(subject.content)} bytes of {plain(subject.name)}" if subject.content else ""

    def compose(self) -> Iterator[Widget]:
        """Compose the list."""
        self._list.set_title(None, "Yank", self._title)
        yield self._list

    def action_move(self, rows: int) -> None:
        """Choose another format."""
        self._list.action_move(rows)

    def action_take_chosen(self) -> None:
        """Yank as the cursor says."""
        self.action_take(LETTERS[self._list.cursor])

    def action_take(self, letter: str) -> None:
        """Yank in the format of a letter, where it has something to write."""
        form = FORMATS[LETTERS.index(letter)]
        text = self._list.texts[letter]
        if text:
            self.dismiss((form, text))

    def action_leave(self) -> None:
        """Yank nothing."""
        self.dismiss(None)
