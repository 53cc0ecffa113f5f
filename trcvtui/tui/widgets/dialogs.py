"""Dialogs above the panes: a list to choose from, a result to read, a form to fill in."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import ClassVar, Final, Generic, TypeVar

from textual.binding import Binding
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.screen import ModalScreen
from textual.widget import Widget
from textual.widgets import Input, Static

from trcvtui.tui.formatting import clip, pad, wrap_text
from trcvtui.tui.widgets.line_view import LineView, Row, TextView, row
from trcvtui.tui.widgets.typed_lines import EntryField

Answered = TypeVar("Answered")


class Dialog(ModalScreen[Answered], Generic[Answered]):
    """A frame above the panes. Escape closes the dialog with the answer `nothing`."""

    BINDINGS: ClassVar = [
        Binding("escape", "leave", show=False),
        Binding("P", "app.picture", show=False, id="picture"),
    ]
    DEFAULT_CSS = "Dialog { align: center middle; background: $background 60%; }"

    def __init__(self, nothing: Answered) -> None:
        super().__init__()
        self.nothing = nothing

    def action_leave(self) -> None:
        self.dismiss(self.nothing)


class ViewDialog(Dialog[Answered], Generic[Answered]):
    BINDINGS: ClassVar = [Binding("q", "leave", show=False)]
    DEFAULT_CSS = "ViewDialog LineView { max-width: 100%; border: round $border; padding: 0 1; }"

    def __init__(self, shown: LineView, nothing: Answered) -> None:
        super().__init__(nothing)
        self.shown = shown

    def compose(self) -> Iterator[Widget]:
        yield self.shown


LABEL_WIDTH: Final = 9  # columns


class LabelledText(TextView):
    """Texts, each with a label before its first line."""

    @property
    def _width(self) -> int:
        return max(40, self.line_width)

    def _labelled_rows(self, label: str, texts: Sequence[str], style: str) -> list[Row]:
        lines = [line for text in texts for line in wrap_text(text, self._width - LABEL_WIDTH)]
        return [
            row((("" if number else label).ljust(LABEL_WIDTH), "label"), (line, style))
            for number, line in enumerate(lines)
        ]


class ResultText(TextView):
    """The text of a result. `rows` returns the rows for a given width."""

    def __init__(self, id: str, rows: Callable[[int], list[Row]]) -> None:
        super().__init__(id=id)
        self._rows_for = rows

    def make_rows(self) -> list[Row]:
        return self._rows_for(max(20, self.line_width))


class ResultScreen(ViewDialog[None]):
    """A result to read. Escape closes the screen, and `y` copies the text."""

    BINDINGS: ClassVar = [Binding("y", "yank", show=False)]
    DEFAULT_CSS = "ResultScreen ResultText { width: 110; height: auto; max-height: 90%; }"

    def __init__(self, id: str, title: str, detail: str, rows: Callable[[int], list[Row]]) -> None:
        self.text = ResultText(id, rows)
        self.text.set_title(None, title, detail)
        super().__init__(self.text, None)

    def show(self) -> None:
        if self.is_mounted:
            self.text.draw()

    def action_yank(self) -> None:
        rows = self.text.make_rows()
        self.app.copy_to_clipboard("\n".join("".join(text for text, _ in each.parts) for each in rows))


class QuitTapScreen(ViewDialog[str]):
    """Asks how to quit a tap: "c" cuts its connections, "d" closes only the screen, "" stays."""

    BINDINGS: ClassVar = [Binding(key, f"dismiss('{key}')", show=False) for key in "cd"]
    DEFAULT_CSS = "QuitTapScreen ResultText { width: 72; height: auto; }"

    def __init__(self, cuts: str) -> None:
        choices = (
            ("c", f"end the tap: cuts {cuts}"),
            ("d", "close the screen: the tap forwards until Ctrl+C or SIGTERM"),
            ("esc q", "stay"),
        )
        text = ResultText("cut", lambda _: [row((f"{key:<7}", "key"), (what, "")) for key, what in choices])
        text.set_title(None, f"{cuts} open", "")
        super().__init__(text, "")


def text_rows(text: str, width: int) -> list[Row]:
    return [row((part, "")) for line in text.splitlines() for part in wrap_text(line, width)]


class FormDialog(Dialog[Answered], Generic[Answered]):
    """Fields in `#form`, and below them the line `#form-line` with the result of their check."""

    DEFAULT_CSS = """
    FormDialog #form {
        max-width: 100%; height: auto; max-height: 90%; border: round $border; padding: 0 1;
        background: $surface; border-subtitle-color: $text-muted;
    }
    FormDialog VerticalScroll { height: auto; max-height: 100%; }
    FormDialog Horizontal { height: auto; }
    FormDialog EntryField { width: 1fr; background: $panel; padding: 0 1; }
    FormDialog EntryField:focus { background: $panel; background-tint: $primary 18%; }
    FormDialog EntryField.-bad { color: $error; text-style: underline; }
    FormDialog #form-line { height: 2; color: $text-muted; }
    FormDialog #form-line.-bad { color: $error; }
    """

    def __init__(self, nothing: Answered) -> None:
        super().__init__(nothing)
        self._line = Static("", markup=False, id="form-line")


class FormField(EntryField):
    """One field of a form; up and down go to the field above or below."""

    BINDINGS: ClassVar = [Binding("up", "step(-1)", show=False), Binding("down", "step(1)", show=False)]

    def action_step(self, step: int) -> None:
        (self.screen.focus_next if step > 0 else self.screen.focus_previous)()


Field = TypeVar("Field", bound=FormField)
FieldColumns = Mapping[str, str]  # texts before a field, by the class of their style


class FieldsDialog(FormDialog[Answered], Generic[Answered, Field]):
    """A form with a fixed list of fields."""

    def __init__(
        self, nothing: Answered, title: str, keys: str, rows: Sequence[tuple[FieldColumns, Field]]
    ) -> None:
        super().__init__(nothing)
        self._title, self._keys, self._rows = title, keys, rows
        self._fields = [field for _, field in rows]

    def compose(self) -> Iterator[Widget]:
        with Vertical(id="form") as form:
            form.border_title, form.border_subtitle = self._title, self._keys
            with VerticalScroll(can_focus=False):
                for columns, field in self._rows:
                    with Horizontal():
                        for kind, text in columns.items():
                            yield Static(text, markup=False, classes=kind)
                        yield field
            yield self._line

    def on_mount(self) -> None:
        self._check_fields()
        if self._fields:
            self.set_focus(self._fields[0])

    def _check_fields(self) -> None:
        raise NotImplementedError

    def on_input_changed(self, event: Input.Changed) -> None:
        event.stop()
        self._check_fields()


NAME_WIDTH: Final = 30


class ChoiceList(LineView, inherit_bindings=False):
    """One row for each choice; letters filter the list and do not move the cursor."""

    BINDINGS: ClassVar = [Binding("enter", "screen.take", show=False)]

    def __init__(self, choices: Sequence[tuple[str, str]], now: str) -> None:
        super().__init__(id="choice")
        self._all, self.now, self.typed = list(choices), now, ""
        names = [name for name, _ in choices]
        self.cursor = names.index(now) if now in names else 0

    @property
    def listed_choices(self) -> list[tuple[str, str]]:
        return [choice for choice in self._all if self.typed.casefold() in choice[0].casefold()]

    @property
    def choice(self) -> str | None:
        listed = self.listed_choices
        return listed[self.cursor][0] if self.cursor < len(listed) else None

    def row_count(self) -> int:
        return len(self.listed_choices)

    def row_at(self, y: int) -> Row:
        name, about = self.listed_choices[y]
        chosen = y == self.cursor
        return row(
            ("▸ " if chosen else "  ", "key"),
            ("● " if name == self.now else "  ", "on"),
            (pad(clip(name, NAME_WIDTH - 1), NAME_WIDTH), "strong" if chosen else ""),
            (clip(about, max(8, self.line_width - NAME_WIDTH - 4)), "dim"),
            style="cursor" if chosen else "",
        )

    def action_move(self, rows: int) -> None:
        self.cursor = max(0, min(self.row_count() - 1, self.cursor + rows))
        self.keep_in_view(self.cursor)
        self.show()

    def set_filter(self, typed: str) -> None:
        self.typed, self.cursor = typed, 0
        self.refresh()
        self.show()

    def click(self, x: int, y: int) -> None:
        self.cursor = y
        self.screen.run_worker(self.screen.run_action("take"))


class ChoiceScreen(ViewDialog[str | None]):
    """A list to choose from. The answer is the name of the choice, or None if you close the screen."""

    BINDINGS: ClassVar = [
        Binding("enter", "take", show=False),
        Binding("down", "move(1)", show=False, priority=True),
        Binding("up", "move(-1)", show=False, priority=True),
        Binding("backspace", "back", show=False),
    ]
    DEFAULT_CSS = "ChoiceScreen ChoiceList { width: 78; height: auto; max-height: 90%; }"

    def __init__(self, title: str, choices: Sequence[tuple[str, str]], now: str) -> None:
        self._title = title
        self._list = ChoiceList(choices, now)
        self._list.set_title(None, title, "↑↓ enter")
        super().__init__(self._list, None)

    def accept_letter(self, letter: str) -> None:
        self._set_filter(self._list.typed + letter)

    def _set_filter(self, typed: str) -> None:
        self._list.set_filter(typed)
        self._list.set_title(None, self._title, f"{typed}…" if typed else "↑↓ enter")

    def action_back(self) -> None:
        self._set_filter(self._list.typed[:-1])

    def action_move(self, rows: int) -> None:
        self._list.action_move(rows)

    def action_take(self) -> None:
        self.dismiss(self._list.choice)
