"""The command line, which `:` opens. While closed, this line shows the last command and its answer."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Final

from textual import events
from textual.containers import Vertical
from textual.timer import Timer
from textual.widget import Widget
from textual.widgets import Input

from trcvtui.snapshots.bench import LineAnswer
from trcvtui.tui.formatting import clip, plain, wrap_text
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import LineView, Row, hidden_bindings, row
from trcvtui.tui.widgets.typed_lines import EntryField, EntryLine

MOST_KEPT_LINES: Final = 200
MOST_ROWS: Final = 4
MESSAGE_TIME_S: Final = 10.0  # then a message disappears, unless it `stays`
PREVIEWED_VERBS: Final = ("set", "remove", "undo")  # the prompt shows the effect of these before enter


class EchoLine(LineView, can_focus=False):
    """The last command with its answer, in up to MOST_ROWS rows."""

    DEFAULT_CSS = "EchoLine { height: 1; background: $background; padding: 0 1; }"

    def __init__(self) -> None:
        super().__init__(id="echo")
        self._line, self._error, self.waits, self._text = "", "", False, ""
        self._rows = 1
        self.note = ""  # the effect of the line that you are typing
        self._end: Timer | None = None

    def show_answer(
        self, line: str, error: str = "", waits: bool = False, text: str = "", stays: bool = False
    ) -> None:
        """Show a command and its answer for MESSAGE_TIME_S; with `waits` or `stays`, until the next one."""
        if self._end is not None:
            self._end.stop()
        expires = bool(line or error or text) and not (waits or stays)
        self._end = self.set_timer(MESSAGE_TIME_S, lambda: self.show_answer("")) if expires else None
        self._line, self._error, self.waits = line, error, waits
        self._text = " · ".join(map(str.strip, text.splitlines()))
        self._fit_height()

    def show_preview(self, note: str) -> None:
        """Show the effect of the line that you are typing. For an empty text, show the last command."""
        if note != self.note:
            self.note = note
            self._fit_height()

    def _fit_height(self) -> None:
        rows = min(MOST_ROWS, self.row_count())
        if rows != self._rows:
            self._rows = self.styles.height = rows
        self.show()

    def _texts(self) -> tuple[str, ...]:
        width = max(20, self.line_width - 2)
        if self.note:
            return wrap_text(self.note, width)
        if self._error:
            return wrap_text(f"{self._line}  ✗ {self._error}", width)
        return wrap_text(f"{self._line}  ✓ {self._text}".lstrip() if self._text else self._line, width)

    def row_count(self) -> int:
        return len(self._texts()) if self.note or self._error or self._text else 1

    def row_at(self, y: int) -> Row:
        if self.note:
            return row(("▸ " if y == 0 else "  ", "dim"), (self._texts()[y], ""))
        if self._error or self._text:
            style = "error" if self._error else ""
            return row((": " if y == 0 else "  ", "dim"), (self._texts()[y], style))
        if not self._line:
            return row((": ", "key"), ("type a bench command: set, pulse, peer, fault, plc …", "faint"))
        mark = ("  … with the next scan", "dim") if self.waits else ("  ✓", "done")
        return row((": ", "dim"), (clip(self._line, self.line_width - 6), ""), mark)


class PromptInput(EntryField):
    KEYS: ClassVar = (("enter", "send"), ("tab", "complete"), ("↑↓", "earlier lines"), ("esc", "close"))
    BINDINGS: ClassVar = hidden_bindings({
        "up": "recall(-1)", "down": "recall(1)", "tab": "complete", "escape": "close",
    })  # fmt: skip

    def __init__(self, prompt: Prompt) -> None:
        super().__init__()
        self._prompt = prompt

    def action_recall(self, step: int) -> None:
        self._prompt.recall(step)

    def action_complete(self) -> None:
        """Complete the last word at once, without waiting for the drawn suggestion."""
        self._prompt.complete()

    async def action_submit(self) -> None:
        self._prompt.submit()

    def on_hide(self, event: events.Hide) -> None:
        if self._prompt.is_open:  # opened again before its closing was drawn: keep the focus
            event.prevent_default()

    def action_close(self) -> None:
        self._prompt.close()


class Prompt(Vertical):
    """The echo line and the input line. The prompt stores the typed lines and the lines to send next."""

    DEFAULT_CSS = "Prompt { height: auto; background: $background; }"

    def __init__(
        self,
        view_model: ViewModel,
        submit: Callable[[str], None],
        only_looks: Callable[[], bool] = lambda: False,
    ) -> None:
        super().__init__(id="prompt")
        self._only_looks = only_looks  # then no line is previewed: a line may name a file
        self._view_model = view_model
        self._submit = submit
        self._echo = EchoLine()
        self.show_preview = self._echo.show_preview  # also for a line that you type in another field
        self._input = PromptInput(self)
        self._open_line = EntryLine(":", self._input)
        self._open_line.id, self._open_line.display = "open-line", False
        self._focus_before: Widget | None = None
        self._lines: list[str] = []
        self._at = 0
        self._last = 0
        self._steps: tuple[str, ...] = ()  # the filled-in line, then the lines that follow its ✓
        self._after = -1  # number of the line whose ✓ releases the next step

    def compose(self) -> list[Widget]:
        """Compose the closed prompt; the input comes right after the first frame."""
        return [self._echo]

    # -- open and closed ----------------------------------------------------------------------------

    async def mount_input(self) -> None:
        """Make the input. The app handles keys only after the input exists."""
        from trcvtui.tui.completion import BenchSuggester

        self._input.suggester = BenchSuggester(lambda: self._view_model.project)
        await self.mount(self._open_line)

    @property
    def is_open(self) -> bool:
        return self._open_line.display

    def open(self, text: str = "", *then: str) -> None:
        """Open the command line with a text. The very next key is typed into this line.

        If you send the text unchanged, each line of `then` is sent after the ✓ of the line before.
        """
        self._steps, self._after = (text, *then), -1
        if not self._input.is_attached:
            return
        if not self.is_open:
            self._focus_before = self.screen.focused
        self._at = len(self._lines)
        self._fill(plain(text))
        self._open_line.display = True
        self._update_preview()
        self.screen.set_focus(self._input)

    def close(self) -> None:
        """Close the command line, and return the focus at once to the pane that had it before."""
        before, self._focus_before = self._focus_before, None
        self.screen.set_focus(before)
        self._open_line.display, self._echo.display = False, True
        self._echo.show_preview("")

    def on_input_changed(self, event: Input.Changed) -> None:
        event.stop()
        self._update_preview()

    def _update_preview(self) -> None:
        from trcvtui.tui.view_model.validity import preview_edit

        if not self.is_open:
            return
        line = self._input.value.strip()
        has_preview = line.partition(" ")[0] in PREVIEWED_VERBS and not self._only_looks()
        notes = [preview_edit(line, self._view_model.project)] if has_preview else []
        notes += [f"then {step}" for step in self._steps[1:] if self._steps[0] == line]
        self._echo.show_preview(" · ".join(filter(None, notes)))
        self._echo.display = bool(self._echo.note)

    def _fill(self, text: str) -> None:
        self._input.value = text
        self._input.cursor_position = len(text)

    def recall(self, step: int) -> None:
        if self._lines:
            self._at = max(0, min(len(self._lines), self._at + step))
            self._fill(self._lines[self._at] if self._at < len(self._lines) else "")

    def complete(self) -> None:
        from trcvtui.tui.completion import complete

        self._fill(complete(self._input.value, self._view_model.project) or self._input.value)

    def submit(self) -> None:
        line = self._input.value.strip()
        self.close()
        if line:
            self._submit(line)

    # -- lines and answers --------------------------------------------------------------------------

    def add_to_history(self, line: str) -> None:
        if not self._lines or self._lines[-1] != line:
            self._lines.append(line)
            del self._lines[:-MOST_KEPT_LINES]

    def show_sent_line(self, line: str, number: int) -> None:
        self._steps = self._steps[1:] if self._steps[:1] == (line,) else ()
        self._after = number if self._steps else -1
        self.add_to_history(line)
        self._last = number
        self._echo.show_answer(line, waits=True)

    def show_result(self, line: str, text: str, error: str = "") -> None:
        self.add_to_history(line)
        self._echo.show_answer(line, error, text=text)

    def accept_answers(self, answers: dict[int, LineAnswer]) -> None:
        for number, answer in answers.items():
            if answer.error or number == self._last:
                self._echo.show_answer(answer.line, answer.error, text=answer.message)
            if number == self._after and not answer.error:
                self._submit(self._steps[0])

    @property
    def is_waiting(self) -> bool:
        return self._echo.waits

    def inform(self, text: str) -> None:
        self._echo.show_answer("", text=text)

    def show_error(self, text: str, stays: bool = False) -> None:
        self._echo.show_answer("", text, stays=stays)
