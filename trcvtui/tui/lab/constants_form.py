"""A form for the constants that no file declares: a field a name, whole numbers in any IEC notation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar, Final, cast

from textual.binding import Binding
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.screen import ModalScreen
from textual.widget import Widget
from textual.widgets import Input, Static

from trcvtui.tui.formatting import clip, plain, wrapped
from trcvtui.tui.widgets.line_view import LineView, Row, row
from trcvtui.tui.widgets.theme import COMPONENT_CLASSES
from trcvtui.tui.widgets.typed_lines import TypedField
from trcvtui.udt.literals import parse_integer


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


MOST_FIELDS: Final = 32
NAME: Final = 34


class NumberField(TypedField):
    """The value of one constant; empty: it stays unknown."""

    def __init__(self, name: str) -> None:
        super().__init__(placeholder="whole number")
        self.constant = name

    async def action_submit(self) -> None:
        """Go on in the form."""
        cast("ConstantsForm", self.screen).go_on(self)

    @property
    def number(self) -> int | None:
        """Return the value, None where there is none yet."""
        text = self.value.strip()
        return parse_integer(text) if text else None


class ConstantsForm(ModalScreen[dict[str, int]]):
    """Ends with the values that were given; none when it is left."""

    BINDINGS: ClassVar = [Binding("escape", "leave", show=False)]
    DEFAULT_CSS = """
    ConstantsForm { align: center middle; background: $background 60%; }
    ConstantsForm #form {
        width: 72; max-width: 100%; height: auto; max-height: 90%; border: round $border; padding: 0 1;
        background: $surface; border-subtitle-color: $text-muted;
    }
    ConstantsForm VerticalScroll { height: auto; max-height: 100%; }
    ConstantsForm Horizontal { height: 1; }
    ConstantsForm .name { width: 34; }
    ConstantsForm NumberField { width: 1fr; background: $panel; padding: 0 1; }
    ConstantsForm NumberField:focus { background: $panel; background-tint: $primary 18%; }
    ConstantsForm NumberField.-bad { color: $error; text-style: underline; }
    ConstantsForm #form-line { height: 2; color: $text-muted; }
    """

    def __init__(self, names: Sequence[str], where: str) -> None:
        super().__init__()
        self._fields = [NumberField(name) for name in names[:MOST_FIELDS]]
        self._where = where
        self._line = Static("", markup=False, id="form-line")

    def compose(self) -> Iterator[Widget]:
        """Compose a line a constant."""
        with Vertical(id="form") as form:
            form.border_title = clip(f"Constants that {plain(self._where)} uses", 66)
            form.border_subtitle = "tab field · enter take · esc leave"
            with VerticalScroll(can_focus=False):
                for field in self._fields:
                    with Horizontal():
                        yield Static(clip(plain(field.constant), NAME - 1), markup=False, classes="name")
                        yield field
            yield self._line

    def on_mount(self) -> None:
        """Begin in the first field."""
        self.set_focus(self._fields[0])
        self._judge()

    def _judge(self) -> None:
        bad = [field for field in self._fields if field.value.strip() and field.number is None]
        for field in self._fields:
            field.set_class(field in bad, "-bad")
        said = (
            "no whole number" if bad else "bounds of arrays such as ARRAY[1..MAX]; `save project` keeps them"
        )
        self._line.update(f"✗ {said}, such as 10 or 16#0A" if bad else said)

    def on_input_changed(self, event: Input.Changed) -> None:
        """Judge while typing."""
        event.stop()
        self._judge()

    def go_on(self, field: NumberField) -> None:
        """Go to the next empty field; behind the last one, end with what was given."""
        empty = [field for field in self._fields if not field.value.strip()]
        if field.value.strip() and empty:
            self.set_focus(empty[0])
            return
        given = {field.constant: field.number for field in self._fields if field.value.strip()}
        numbers = {name: number for name, number in given.items() if number is not None}
        if len(numbers) == len(given):
            self.dismiss(numbers)

    def action_leave(self) -> None:
        """Give nothing."""
        self.dismiss({})
