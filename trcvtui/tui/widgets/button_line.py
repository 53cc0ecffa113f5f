"""Buttons in as few lines as they fit in: each with its letter, pressed by mouse, by letter or by enter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar

from textual import events

from trcvtui.tui.messages import ButtonPointed
from trcvtui.tui.widgets.line_view import LineView, Part, Row, row


class ButtonLine(LineView):
    """`labels` gives (letter, label) now, `press` is told the index; `chosen` is the one in force."""

    DEFAULT_CSS = "ButtonLine { height: auto; }"
    KEYS: ClassVar = (("←→", "button"), ("enter", "press"))
    BINDINGS: ClassVar = [
        ("left", "move(-1)", "left"),
        ("right", "move(1)", "right"),
        ("enter", "press", "press"),
    ]

    def __init__(
        self,
        id: str,
        labels: Callable[[], Sequence[tuple[str, str]]],
        press: Callable[[int], None],
        chosen: Callable[[], int] | None = None,
    ) -> None:
        super().__init__(id=id)
        self._labels = labels
        self._press = press
        self._chosen = chosen
        self.cursor = 0
        self.hover: int | None = None
        self._told: int | None = None

    def show(self) -> None:
        """Repaint what changed, and tell when another button is pointed at."""
        if (pointed := self.pointed_at()) != self._told:
            self._told = pointed
            self.post_message(ButtonPointed())
        super().show()

    def row_count(self) -> int:
        """Return in how many lines they fit."""
        return max((line for _, line, _, _ in self._places()), default=0) + 1

    def _places(self) -> list[tuple[int, int, int, int]]:
        """Return index, line, first column and width of each button."""
        places, line, left = [], 0, 0
        for index, (letter, label) in enumerate(self._labels()):
            width = len(letter) + len(label) + (3 if letter else 2)
            if left and left + width > self.line_width > 0:
                line, left = line + 1, 0
            places.append((index, line, left, width))
            left += width + 1
        return places

    def row_at(self, y: int) -> Row:
        """Return the buttons of one line."""
        labels = self._labels()
        parts: list[Part] = []
        for index, line, _, _ in self._places():
            if line != y:
                continue
            letter, label = labels[index]
            style = self._style(index)
            chosen = self._chosen is not None and index == self._chosen()
            parts += [
                ("▸" if chosen else "[", f"{'key' if chosen else 'faint'} {style}"),
                (letter, f"key {style}"),
            ]
            parts += [(f" {label}" if letter else label, style)]
            parts += [("◂" if chosen else "]", f"{'key' if chosen else 'faint'} {style}"), (" ", "")]
        return row(*parts)

    def _style(self, index: int) -> str:
        if self._chosen is not None and index == self._chosen():
            return "cursor strong" if self.has_focus else "cursor-blurred strong"
        if self._chosen is None and self.has_focus and index == self.cursor:
            return "cursor"
        return "hover" if index == self.hover else ""

    def pointed_at(self) -> int | None:
        """Return the button under the mouse, else the one under the cursor of a focused line."""
        return self.hover if self.hover is not None else self.cursor if self.has_focus else None

    def action_move(self, count: int) -> None:
        """Move the cursor; where one button is in force, the next one comes into force."""
        here = self._chosen() if self._chosen else self.cursor
        self.cursor = (here + count) % len(self._labels())
        if self._chosen is not None:
            self._press(self.cursor)
        self.show()

    def action_press(self) -> None:
        """Press the button under the cursor."""
        self._press(min(self.cursor, len(self._labels()) - 1))
        self.show()

    def on_click(self, event: events.Click) -> None:
        """Press the button under the mouse."""
        index = self._index_at(event)
        if index is not None:
            self.cursor = index
            self.action_press()

    def on_mouse_move(self, event: events.MouseMove) -> None:
        """Show which button a click would press."""
        self.hover = self._index_at(event)
        self.show()

    def on_leave(self) -> None:
        """The mouse has gone."""
        self.hover = None
        self.show()

    def _index_at(self, event: events.MouseEvent) -> int | None:
        place = self.place_of(event)
        if place is None:
            return None
        found = (
            index
            for index, line, left, width in self._places()
            if line == place[1] and left <= place[0] < left + width
        )
        return next(found, None)
