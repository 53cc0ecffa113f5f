"""Keys act in the order in which you type them, each before the next one is read, on every screen.

Textual puts a key into the queue of the widget that has the focus when the key arrives. A letter acts in
that queue. Backspace, enter and tab act only after all parent widgets have passed them on, so later keys
overtake them. Here a key acts at once. While a screen opens, a key waits.

Rule: only an EntryField, or a screen that is a LetterReceiver, takes text. Nothing else reads letters.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, ClassVar, Final, NamedTuple, Protocol, runtime_checkable

from textual import events
from textual.app import App, ComposeResult
from textual.binding import Binding
from textual.containers import Horizontal
from textual.content import Content
from textual.widget import Widget
from textual.widgets import Input, Static

from trcvtui.errors import UserError, mistake
from trcvtui.tui.formatting import plain
from trcvtui.udt.byte_text import SearchPatterns, parse_search


class EntryField(Input):
    """One line to type into, without a frame. Focus selects no text: Textual would select too late."""

    def __init__(self, value: str = "", **settings: Any) -> None:
        super().__init__(value=value, compact=True, select_on_focus=False, **settings)

    async def action_submit(self) -> None:
        """Take the text now: a key typed after enter is not part of it."""
        raise NotImplementedError

    def convert_paste(self, text: str) -> str:
        """Return what a pasted text puts into the field."""
        return text.splitlines()[0]

    async def handle_change(self) -> None:
        """React to a change before the next key acts, such as by changing other fields."""


@runtime_checkable
class LetterReceiver(Protocol):
    """A screen that takes letters without an input field."""

    def accept_letter(self, letter: str) -> None:
        """Take one printable character."""


async def dispatch_key(app: App[None], event: events.Key | events.Paste) -> bool:
    """Run the key's action, or type the key into the focused field; return False if neither happened."""
    app.app_focus = True
    mounted: asyncio.Event = app.screen._mounted_event
    await mounted.wait()  # the key before may have opened the screen: now its fields exist
    field = app.focused
    if not isinstance(field, EntryField):
        return await _run_key_action(app, event)
    before = field.value
    acted = await _run_key_action(app, event)
    if field.is_attached and field.value != before:
        await field.handle_change()
    return acted


async def _run_key_action(app: App[None], event: events.Key | events.Paste) -> bool:
    field, screen = app.focused, app.screen
    if isinstance(event, events.Paste):
        if isinstance(field, EntryField) and event.text:
            field.replace(field.convert_paste(event.text), *field.selection)
        return isinstance(field, Input)
    if event.is_printable and event.character:
        if isinstance(field, Input):
            field.replace(event.character, *field.selection)
            return True
        if isinstance(screen, LetterReceiver):
            screen.accept_letter(event.character)
            return True
    bound = screen.active_bindings.get(event.key)
    return bound is not None and await app.run_action(bound.binding.action, bound.node)


class EntryLine(Horizontal):
    """A sign and a field, shown while the line is open. `back` gets the focus when the line closes."""

    DEFAULT_CSS = """
    EntryLine { height: 1; display: none; background: $panel; padding: 0 1; }
    EntryLine Static { width: 2; color: $accent; text-style: bold; }
    EntryLine Input { background: $panel; width: 1fr; }
    EntryLine Input:focus { background: $panel; background-tint: $primary 12%; }
    """

    def __init__(self, sign: str, field: EntryField, back: Widget | None = None) -> None:
        super().__init__()
        self._sign = sign
        self._input = field
        self._back = back

    def compose(self) -> ComposeResult:
        yield Static(self._sign, markup=False)
        yield self._input

    def open_field(self) -> None:
        self.display = True
        self.screen.set_focus(self._input)

    def close_field(self) -> None:
        self.screen.set_focus(self._back)
        self.display = False


class LineInput(EntryField):
    """Enter calls `take`, escape calls `leave`."""

    BINDINGS: ClassVar = [Binding("escape", "leave", show=False)]

    def __init__(self, take: Callable[[], None], leave: Callable[[], None], **settings: Any) -> None:
        super().__init__(**settings)
        self._take, self._leave = take, leave

    async def action_submit(self) -> None:
        self._take()

    def action_leave(self) -> None:
        self._leave()


class CommandLine(EntryLine):
    """A line to type a command into; it opens with the beginning of the command."""

    def __init__(self, take: Callable[[str], None]) -> None:
        field = LineInput(lambda: self._close(field.value.strip()), lambda: self._close(""), id="ask")
        super().__init__(":", field)
        self._take = take

    def open(self, text: str) -> None:
        if not self.display:
            self._back = self.screen.focused
        self._input.value, self._input.cursor_position = text, len(text)
        self.open_field()

    def _close(self, line: str) -> None:
        self.close_field()
        if line:
            self._take(line)


class FilterInput(LineInput):
    """The input field of the filter; up and down still move in the list."""

    BINDINGS: ClassVar = [Binding("up", "list(-1)", show=False), Binding("down", "list(1)", show=False)]

    def __init__(self, line: FilterLine) -> None:
        super().__init__(line.submit, line.cancel, id="filter")
        self._line = line

    def action_list(self, files: int) -> None:
        self._line.move(files)


class FilterLine(EntryLine):
    """The filter of a list: it acts as you type, enter keeps it, escape drops it."""

    def __init__(
        self,
        narrow: Callable[[str], None],
        move: Callable[[int], None],
        back: Widget,
        taken: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__("/", FilterInput(self), back)
        self._taken, self._narrow, self.move = taken, narrow, move

    def open(self) -> None:
        """Open the line with the last words of the filter, and apply these words again."""
        self.open_field()
        self._narrow(self._input.value)

    def clear(self) -> None:
        self._input.value = ""
        self._narrow("")

    def submit(self) -> None:
        self._narrow(self._input.value)
        self.close_field()
        self._taken()

    def cancel(self) -> None:
        self.clear()
        self.close_field()

    def on_input_changed(self, event: Input.Changed) -> None:
        event.stop()
        self._narrow(self._input.value)


FIND_HINT = "29 00 · abc · =1.5 · @offset · #job"
_JUMP_SYNTAX: Final = {"@": "an offset such as @480 or @16#1E0", "#": "a job such as #12"}


class Target(NamedTuple):
    number: int
    is_job: bool
    about: str


def parse_jump(text: str) -> Target:
    """Return the target of a text `@offset` or `#job`; raise UserError if no number follows."""
    try:
        number = int(text[1:].strip().replace("16#", "0x"), 0)
        if 0 <= number < 1 << 62:
            is_job = text[0] == "#"
            return Target(number, is_job, f"job {number}" if is_job else f"offset {number} = 16#{number:X}")
    except ValueError:
        pass
    raise mistake("go to", f"'{text[:20]}'", _JUMP_SYNTAX[text[0]])


class FindInput(LineInput):
    KEYS: ClassVar = (("enter", "find"), ("esc", "leave"))


class FindLine(Horizontal):
    """A line that takes no room while closed. Enter calls `find`, and closing calls `refocus`.

    As you type, `complain` gets the mistake in the text, because this line has no room for the mistake.
    """

    DEFAULT_CSS = """
    FindLine { height: 1; display: none; background: $panel; }
    FindLine #find-mark { width: 2; color: $accent; text-style: bold; }
    FindLine FindInput { width: 1fr; background: $panel; }
    FindLine #find-about { width: auto; max-width: 60%; color: $text-muted; padding: 0 1; }
    """

    def __init__(
        self, find: Callable[[], None], refocus: Callable[[], None], complain: Callable[[str], None]
    ):
        super().__init__(id="find-line")
        self._find, self._refocus, self._complain = find, refocus, complain
        self._field = FindInput(self.submit, self.close, placeholder=FIND_HINT)
        self._about = Static("", id="find-about", markup=False)

    async def open(self) -> None:
        """Open the line; the very next key is typed into it."""
        if not self._field.is_attached:
            await self.mount(Static("/", id="find-mark", markup=False), self._field, self._about)
        self.display = True
        self.screen.set_focus(self._field)
        self._field.action_select_all()

    def close(self) -> None:
        self._refocus()
        self._complain("")
        self.display = False

    def on_input_changed(self) -> None:
        self._show_check()

    def _show_check(self) -> None:
        text = self._field.value.strip()
        target = self._parse_target(text) if text else ""
        wrong, about = (target, "") if isinstance(target, str) else ("", target.about)
        self._about.update(Content(plain(about)))
        self._complain(wrong)

    @property
    def target(self) -> SearchPatterns | Target | None:
        """Return the target of the search, also after escape. Return None if the text has a mistake."""
        target = self._parse_target(self._field.value.strip())
        return target if not isinstance(target, str) else None

    def _parse_target(self, text: str) -> SearchPatterns | Target | str:
        try:
            return parse_jump(text) if text[:1] in ("@", "#") else parse_search(text)
        except UserError as wrong:
            return f"✗ {wrong.lines()[0]}"

    def submit(self) -> None:
        """Search, or stay open and show the mistake in the text."""
        if self.target is not None:
            self.close()
            self._find()
        elif self._field.value.strip():
            self._show_check()
        else:
            self.close()
