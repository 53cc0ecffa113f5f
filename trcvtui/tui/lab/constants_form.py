"""A form for the constants that no file declares: a field a name, whole numbers in any IEC notation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar, Final, cast

from textual.binding import Binding
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widget import Widget
from textual.widgets import Input, Static

from trcvtui.tui.formatting import clip, plain, wrapped
from trcvtui.tui.widgets.dialogs import FormDialog, ListDialog
from trcvtui.tui.widgets.line_view import Row, TextView, row
from trcvtui.tui.widgets.typed_lines import TypedField
from trcvtui.udt.literals import parse_integer


class ProblemList(TextView):
    """Every problem in as many lines as it needs."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__(id="problems")
        self._problems = problems

    def make_rows(self) -> list[Row]:
        """Return the problems line by line."""
        width = max(20, self.line_width - 2)
        return [
            row(("✗ " if number == 0 else "  ", "error"), (line, ""))
            for problem in self._problems
            for number, line in enumerate(wrapped(problem, width))
        ]


class ProblemsScreen(ListDialog[None]):
    """Closed by escape."""

    BINDINGS: ClassVar = [Binding("w", "leave", show=False)]
    DEFAULT_CSS = "ProblemsScreen ProblemList { width: 110; height: 80%; }"

    def __init__(self, problems: Sequence[str]) -> None:
        shown = ProblemList(problems)
        shown.set_title(None, "Problems", f"{len(problems)} in the type files; esc closes")
        super().__init__(shown, None)


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


class ConstantsForm(FormDialog[dict[str, int]]):
    """Ends with the values that were given; none when it is left."""

    DEFAULT_CSS = """
    ConstantsForm #form { width: 72; }
    ConstantsForm .name { width: 34; }
    """

    def __init__(self, names: Sequence[str], where: str) -> None:
        super().__init__({})
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
