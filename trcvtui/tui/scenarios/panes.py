"""A scenario as its file writes it, comments too; while it is played, what each step has come to."""

from __future__ import annotations

from typing import ClassVar, Final

from textual.binding import BindingType

from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.rig.scenario.scenario import ScenarioFile, ScriptLine
from trcvtui.rig.snapshots import DONE, FAILED, HELD, NOW, TO_COME, PlayerSnapshot, StepSnapshot
from trcvtui.tui.formatting import clip, lamp, plain, wrapped
from trcvtui.tui.scenarios.scenario_list import ScenarioListModel
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import ARROW_MOVES, EMPTY, Part, Row, TextView, row

INDENT: Final = 2


class TraceList(TextView):
    """The inputs and the newest of the trace of each instance; `tail` lines of it."""

    DEFAULT_CSS = "TraceList { height: auto; min-height: 3; }"

    def __init__(self, scene: ViewModel) -> None:
        super().__init__(id="traces")
        self._scene = scene
        self.tail = 4

    def follow(self, player: PlayerSnapshot) -> None:
        """Show the instances of the scenario that is played."""
        self.set_title(4, "STATUS, scan by scan")
        pins = {instance.name: _inputs(instance) for instance in self._scene.instances}
        self._rows = []
        for name, trace in player.traces:
            self._rows.append(row((f"{clip(plain(name), 24)}  ", "strong"), *pins.get(name, [])))
            self._rows += self._trace(trace)
        self.show()

    def _trace(self, trace: str) -> list[Row]:
        lines = wrapped(trace, max(20, self.line_width - INDENT - 4)) if trace else ("no scan yet",)
        cut = len(lines) > self.tail
        return [
            row(
                (" " * INDENT, ""),
                ("… " if cut and number == 0 else "", "faint"),
                (line, "" if trace else "dim"),
            )
            for number, line in enumerate(lines[-self.tail :])
        ]


def _inputs(instance: InstanceSnapshot) -> list[Part]:
    parts: list[Part] = []
    for pin, value in instance.inputs:
        if isinstance(value, bool):
            parts.append((f"{pin} {lamp(value)}  ", "on" if value else "faint"))
        else:
            parts.append((f"{pin} {value}  ", "dim"))
    return parts


GUTTER: Final = 7  # number, blank, mark, blank
CONTEXT: Final = 2  # lines that stay in view around the current one
# state: mark, style of the mark, style of the text
LOOKS: Final = {
    TO_COME: (" ", "", ""),
    NOW: ("▶", "busy", "busy"),
    DONE: ("•", "done", "dim"),
    HELD: ("✓", "done", "dim"),
    FAILED: ("✗", "error", "error"),
}
NEXT: Final = ("▸", "key", "strong")


class ScenarioText(TextView, inherit_bindings=False):
    """What the scenario is about, then its steps; the current one stays in view."""

    BINDINGS: ClassVar[list[BindingType]] = ARROW_MOVES

    def __init__(self, model: ScenarioListModel) -> None:
        super().__init__(id="text")
        self._model = model
        self._drawn: tuple[ScenarioFile | None, tuple[StepSnapshot, ...], int, int] | None = None
        self._row_of: dict[int, int] = {}  # by number of the step
        self._followed: tuple[str, int] | None = None

    def follow(self, player: PlayerSnapshot | None, kernel: str) -> None:
        """Show the chosen scenario, and how far it has been played where it is the one that is."""
        said = self._model.chosen_file
        played = player if player is not None and said is not None and player.path == str(said.path) else None
        self._show_title(said, played, kernel)
        shown = said, played.steps if played else (), played.current if played else -1, self.line_width
        if shown != self._drawn:
            if self._drawn is None or shown[0] != self._drawn[0]:
                self.scroll_to(y=0, animate=False)
            self._drawn = shown
            self._rows = self._lines(said, played) if said is not None else []
            self.resize_rows()
            self._follow(played)
        self.show()

    def _show_title(self, said: ScenarioFile | None, played: PlayerSnapshot | None, kernel: str) -> None:
        if said is None:
            self.set_title(2, "Steps")
            return
        words = [kernel]
        if played is not None:
            last = played.steps[-1].number if played.steps else 0
            words.append("over" if played.finished else f"step {_coming(played)} of {last}")
        self.set_title(2, plain(said.path.name), " · ".join(words))

    # -- the lines ----------------------------------------------------------------------------------

    def _lines(self, said: ScenarioFile, played: PlayerSnapshot | None) -> list[Row]:
        self._row_of = {}
        rows = [row((line, "strong")) for line in wrapped(said.name, self.line_width)]
        if said.about:
            rows += [row((line, "dim")) for line in wrapped(said.about, self.line_width)]
        if said.problem:
            rows += [row((line, "error")) for line in wrapped(f"✗ {said.problem}", self.line_width)]
        rows.append(EMPTY)
        steps = {step.number: step for step in played.steps if step.number} if played else {}
        for step in played.steps if played else ():
            if not step.number and step.state == FAILED:
                rows += self._step(ScriptLine(0, 0, f"start: {step.line}"), step, False)
        coming = _coming(played)
        for line in said.lines:
            if line.step:
                self._row_of[line.step] = len(rows)
            rows += self._step(line, steps.get(line.step), 0 < line.step == coming)
        return rows

    def _step(self, line: ScriptLine, step: StepSnapshot | None, is_next: bool) -> list[Row]:
        state = step.state if step is not None and line.text else TO_COME
        mark, mark_style, style = NEXT if is_next and state == TO_COME else LOOKS[state]
        if line.text.startswith("#"):
            style = "dim"
        first, *rest = wrapped(line.text, self.line_width - GUTTER)
        place = f"{line.place:>4} " if line.place else "     "
        ground = "cursor-blurred" if is_next or state == NOW else ""
        rows = [row((place, "faint"), (f"{mark} ", mark_style), (first, style), style=ground)]
        rows += [row((" " * (GUTTER + 2), ""), (more, style), style=ground) for more in rest]
        if step is not None and state == FAILED:
            found = wrapped(f"found {step.found or 'nothing'}", self.line_width - GUTTER - 2)
            rows += [row((" " * (GUTTER + 2), ""), (more, "error")) for more in found]
        return rows

    def _follow(self, played: PlayerSnapshot | None) -> None:
        """Keep the step that runs or comes next in view; a reader who scrolls away is left in peace."""
        if played is None or (played.path, played.current) == self._followed or not played.steps:
            return
        self._followed = played.path, played.current
        number = played.steps[min(played.current, len(played.steps) - 1)].number
        at = self._row_of.get(number, 0)
        self.keep_in_view(min(at + CONTEXT, max(0, len(self._rows) - 1)))
        self.keep_in_view(max(0, at - CONTEXT))


def _coming(played: PlayerSnapshot | None) -> int:
    """Return the number of the step that runs or comes next, 0 where none does."""
    if played is None or played.finished or played.current >= len(played.steps):
        return 0
    return played.steps[played.current].number
