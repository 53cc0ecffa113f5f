"""The line that `/` opens in a pane of bytes: hex, a text in quotes or a number, judged while it is typed."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual.binding import Binding
from textual.containers import Horizontal
from textual.content import Content
from textual.widgets import Input, Static

from trcvtui.errors import UserError
from trcvtui.tui.formatting import plain
from trcvtui.tui.widgets.keystrokes import TypedField
from trcvtui.udt.byte_text import Wanted, wanted

HINT = '29 00 · "abc" · =1234 · =1.5'


class FindInput(TypedField):
    """The field; enter looks, escape leaves."""

    KEYS: ClassVar = (("enter", "find"), ("esc", "leave"))
    BINDINGS: ClassVar = [Binding("escape", "leave", show=False)]

    def __init__(self, line: FindLine) -> None:
        super().__init__(placeholder=HINT)
        self._line = line

    async def action_submit(self) -> None:
        """Look for what stands there."""
        self._line.submit()

    def action_leave(self) -> None:
        """Close without looking."""
        self._line.close()

    def on_input_changed(self, event: Input.Changed) -> None:
        """Say what that would look for."""
        self._line.judge()


class FindLine(Horizontal):
    """Closed it takes no room; `found` gets what is to be looked for, `left` is called when it closes."""

    DEFAULT_CSS = """
    FindLine { height: 1; display: none; background: $panel; }
    FindLine #find-mark { width: 2; color: $accent; text-style: bold; }
    FindLine FindInput { width: 1fr; background: $panel; }
    FindLine #find-about { width: auto; max-width: 60%; color: $text-muted; padding: 0 1; }
    """

    def __init__(self, found: Callable[[Wanted], None], left: Callable[[], None]) -> None:
        super().__init__(id="find-line")
        self._found = found
        self._left = left
        self._field = FindInput(self)
        self._about = Static("", id="find-about", markup=False)

    async def open(self) -> None:
        """Open the line; the very next key is typed into it."""
        if not self._field.is_attached:
            await self.mount(Static("/", id="find-mark", markup=False), self._field, self._about)
        self.display = True
        self.screen.set_focus(self._field)
        self._field.action_select_all()

    def close(self) -> None:
        """Close the line and go back to the bytes."""
        self._left()
        self.display = False

    def judge(self) -> None:
        """Show what the text asks for, or what is wrong with it."""
        text = self._field.value.strip()
        asked = self._read(text) if text else HINT
        self._about.update(Content(plain(asked.about if isinstance(asked, Wanted) else asked)))

    def _read(self, text: str) -> Wanted | str:
        try:
            return wanted(text)
        except UserError as wrong:
            return f"✗ {wrong.lines()[0]}"

    def submit(self) -> None:
        """Look for it; what cannot be looked for stays open with its mistake."""
        text = self._field.value.strip()
        asked = self._read(text)
        if not text:
            self.close()
        elif isinstance(asked, Wanted):
            self.close()
            self._found(asked)
        else:
            self.judge()
