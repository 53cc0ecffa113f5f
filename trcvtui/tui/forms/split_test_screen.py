"""Every split of one message, as it is tried: a row for the whole message and for each place of the cut."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import ClassVar, Final

from textual.binding import Binding

from trcvtui.commands.snapshots import Answer, SplitRow, TrialSnapshot
from trcvtui.tui.formatting import bar, clip, count, plain, wrapped
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.dialogs import ListDialog
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row

HEAD: Final = 4  # lines above the rows
SHOWN_BYTES: Final = 16
WAITING: Final = "waits for the engine"
HELD: Final = "‖ the scans are held, so nothing is tried: space lets them go on"
KEYS_LINE: Final = "↑↓ rows · enter cut there · x stop · y copy · esc close"


class TrialTable(LineView):
    """The table; the cursor is a row."""

    BINDINGS: ClassVar = [Binding("enter", "choose", show=False)]

    def __init__(self, view_model: ViewModel, choose: Callable[[SplitRow], None]) -> None:
        super().__init__(id="trial")
        self._view_model = view_model
        self._choose = choose
        self.refusal = ""
        self.cursor = 0

    @property
    def trial(self) -> TrialSnapshot | None:
        """Return the table as the newest picture has it; none where the trial was refused."""
        if self.refusal:
            return None
        return self._view_model.picture.trial if self._view_model.picture else None

    def row_count(self) -> int:
        """Return head and rows."""
        if self.refusal:
            return len(wrapped(f"✗ refused: {plain(self.refusal)}", max(20, self.line_width)))
        return HEAD + (len(self.trial.rows) if self.trial else 0)

    def row_at(self, y: int) -> Row:
        """Return one line."""
        trial = self.trial
        if self.refusal:
            lines = wrapped(f"✗ refused: {plain(self.refusal)}", max(20, self.line_width))
            return row((lines[y], "error")) if y < len(lines) else EMPTY
        if trial is None:
            return row((WAITING, "dim")) if y == 0 else EMPTY
        if y >= HEAD:
            return self._split(trial.rows[y - HEAD], y - HEAD == self.cursor)
        return (self._about(trial), self._progress(trial), self._verdict(trial), self._columns())[y]

    def _about(self, trial: TrialSnapshot) -> Row:
        shown = trial.payload[:SHOWN_BYTES].hex(" ").upper() + " …" * (len(trial.payload) > SHOWN_BYTES)
        size = count(len(trial.payload), "byte")
        return row(
            (f"{plain(trial.peer)} → {plain(trial.instance)}  ", "strong"), (f"{size}: {shown}", "dim")
        )

    def _progress(self, trial: TrialSnapshot) -> Row:
        style = _judged(trial)[1]
        full, empty = bar(trial.runs, len(trial.payload), 20)
        return row((full, style), (empty, "faint"), (f"  {trial.runs} of {len(trial.payload)} runs", ""))

    def _verdict(self, trial: TrialSnapshot) -> Row:
        sign, style = _judged(trial)
        if trial.state == "running" and self._view_model.live is not None and self._view_model.live.holding:
            return row((HELD, "hold"))
        return row((sign + plain(trial.summary()), style))

    def _columns(self) -> Row:
        return row((f"  {'cut':<9}{'result':<12}{'DONE':>4}  {'RCVD_LEN':<14}{'DATA':<9}STATUS", "faint"))

    def _split(self, split: SplitRow, is_chosen: bool) -> Row:
        style = self.cursor_style(is_chosen)
        if not split.first:
            verdict: Part = (f"{'':<12}", "")
        else:
            verdict = (f"{'✓ same':<12}", "done") if split.same else (f"{'✗ differs':<12}", "warn")
        data = (f"{'equal':<9}", "") if split.data_equal else (f"{'differs':<9}", "warn")
        return row(
            ("▸ " if is_chosen else "  ", "key"),
            (f"{split.span():<9}", "strong"),
            verdict,
            (f"{split.done:>4}  ", "" if split.done else "warn"),
            (f"{clip(split.lengths, 13):<14}", ""),
            data,
            (plain(split.walk), "dim"),
            style=style,
        )

    def action_move(self, rows: int) -> None:
        """Go to another row."""
        last = max(0, self.row_count() - HEAD - 1)
        self.cursor = max(0, min(last, self.cursor + rows))
        self.scroll_to(y=max(0, self.cursor + HEAD - self.size.height + 1), animate=False)
        self.show()

    def action_choose(self) -> None:
        """Put the cut of this row into the composer."""
        if self.trial is not None and self.cursor < len(self.trial.rows):
            self._choose(self.trial.rows[self.cursor])


def _judged(trial: TrialSnapshot) -> Part:
    if trial.state == "running":
        return "▶ ", "busy"
    if trial.problem:
        return "✗ ", "error"
    return ("≠ ", "warn") if trial.differing else ("✓ ", "done")


class TrialScreen(ListDialog[int]):
    """Ends with the place of the cut that was chosen, 0 where none was; a trial under way goes on."""

    BINDINGS: ClassVar = [
        Binding("x", "stop", show=False),
        Binding("space", "go_on", show=False),
        Binding("y", "yank", show=False),
    ]
    DEFAULT_CSS = "TrialScreen TrialTable { width: 120; height: 80%; border-subtitle-color: $text-muted; }"

    def __init__(self, view_model: ViewModel, submit: Callable[[str], None], line: str = "") -> None:
        self.table = TrialTable(view_model, self._cut_there)
        super().__init__(self.table, 0)
        self._submit = submit
        self._view_model = view_model
        self._line = line
        self.table.set_title(None, "Every split", "")
        self.table.border_subtitle = KEYS_LINE

    def show(self) -> None:
        """Show what the newest picture says."""
        if self.is_mounted:
            self.table.show()

    def answered(self, answers: Iterable[Answer]) -> None:
        """Take note where the engine has refused the line that should begin this trial."""
        refused = (answer.error for answer in answers if answer.line == self._line)
        self.table.refusal = next((error for error in refused if error), self.table.refusal)

    def _cut_there(self, split: SplitRow) -> None:
        self.dismiss(split.first)

    def action_stop(self) -> None:
        """Try no more."""
        trial = self.table.trial
        if trial is not None and trial.state == "running":
            self._submit(f"peer {trial.peer} try-splits stop")

    def action_go_on(self) -> None:
        """Let the scans pass on which the trial waits."""
        if self._view_model.live is not None and self._view_model.live.holding:
            self._submit("go")

    def action_yank(self) -> None:
        """Copy the table as text."""
        from trcvtui.bench.split_test import trial_text  # read when first asked for

        if self.table.trial is not None:
            self.app.copy_to_clipboard(trial_text(self.table.trial))
