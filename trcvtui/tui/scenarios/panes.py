"""The list of scenario files, the chosen file with the result of each step, and the traces."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import ClassVar, Final

from textual.binding import BindingType

from trcvtui.paths import configs_path
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.scenario.scenario import ScenarioFile, ScenarioFiles, ScriptLine, read_scenario_file
from trcvtui.snapshots.scenario import DONE, FAILED, HELD, NOW, TO_COME, PlayerSnapshot, StepSnapshot
from trcvtui.tui.formatting import clip, lamp, pad, plain, wrap_text
from trcvtui.tui.messages import KeyClicked, ScenarioChosen
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import ARROW_KEYS, EMPTY, LineView, Part, Row, TextView, row

FILES_AT_ONCE: Final = 4  # reading them takes a few milliseconds
SHIPPED_LABEL: Final = "came with trcvtui"


class ScenarioListModel:
    """Scenario files in reading order. `revision` counts the changes of `rows`."""

    def __init__(self, found: ScenarioFiles, chosen: Path | None = None) -> None:
        self.is_cut = found.is_cut
        self.filter = ""
        self.revision = 0
        self.outcomes: dict[Path, bool] = {}  # of the last play: True if it held
        self._paths = list(found.paths)
        self._read: dict[Path, ScenarioFile] = {}
        self._unread = deque(found.paths)
        self.chosen = chosen if chosen in self._paths else next(iter(self._paths), None)

    # -- reading ------------------------------------------------------------------------------------

    @property
    def is_read(self) -> bool:
        return not self._unread

    def read_next_files(self) -> None:
        """Read the next FILES_AT_ONCE files; a file that is no scenario is removed from the list."""
        for _ in range(min(FILES_AT_ONCE, len(self._unread))):
            self.load_file(self._unread.popleft())
        self._repair_choice()

    def read(self, path: Path) -> ScenarioFile | None:
        found = read_scenario_file(path)
        if found is None:
            self._read.pop(path, None)
            self._paths = [other for other in self._paths if other != path]
        else:
            self._read[path] = found
        self.revision += 1
        return found

    def load_file(self, path: Path | None) -> ScenarioFile | None:
        """Return a file, or None if the list does not have this file. Read the file first if needed."""
        if path is None or path not in self._paths:
            return None
        if path not in self._read:
            self.read(path)
        return self._read.get(path)

    @property
    def chosen_file(self) -> ScenarioFile | None:
        found = self.load_file(self.chosen)
        return self.chosen_file if found is None and self._repair_choice() else found

    # -- what is listed -----------------------------------------------------------------------------

    def list_paths(self) -> list[Path]:
        words = self.filter.casefold().split()
        return [path for path in self._paths if all(word in self._search_text(path) for word in words)]

    def _search_text(self, path: Path) -> str:
        found = self._read.get(path)
        more = f"{found.name} {' '.join(found.blocks)} {found.dialect}" if found else ""
        return f"{path.parent.name}/{path.stem} {more}".casefold()

    def rows(self) -> list[Path | str]:
        rows: list[Path | str] = []
        folder = None
        for path in self.list_paths():
            if path.parent != folder:
                folder = path.parent
                rows.append(_folder_label(folder))
            rows.append(path)
        return rows

    def find_read_file(self, path: Path) -> ScenarioFile | None:
        """Return a file; None if it was not read yet."""
        return self._read.get(path)

    # -- choosing -----------------------------------------------------------------------------------

    def set_filter(self, words: str) -> None:
        self.filter = words
        self.revision += 1
        self._repair_choice()

    def move_choice(self, files: int) -> None:
        listed = self.list_paths()
        if listed:
            here = listed.index(self.chosen) if self.chosen in listed else 0
            self.chosen = listed[max(0, min(len(listed) - 1, here + files))]

    def _repair_choice(self) -> bool:
        listed = self.list_paths()
        if self.chosen in listed:
            return False
        self.chosen = next(iter(listed), None)
        return self.chosen is not None


def _folder_label(folder: Path) -> str:
    try:
        within = folder.relative_to(configs_path())
    except ValueError:
        return str(folder)
    return f"{SHIPPED_LABEL} · {within}"


BLOCK_WIDTH, DIALECT_WIDTH = 13, 8  # columns
OUTCOME_MARKS: Final = {True: ("✓ ", "done"), False: ("✗ ", "error"), None: ("  ", "")}  # None: not played


class ScenarioList(LineView, inherit_bindings=False):
    """One row for each file, under the folder's name. Here the key `k` chooses the kernel."""

    BINDINGS: ClassVar[list[BindingType]] = ARROW_KEYS

    def __init__(self, model: ScenarioListModel) -> None:
        super().__init__(id="scenarios")
        self._model = model
        self._revision = -1
        self._rows: list[Path | str] = []

    def show(self) -> None:
        if self._revision != self._model.revision:
            self._revision = self._model.revision
            self._rows = self._model.rows()
            self.apply_row_count()
            self.keep_choice_in_view()
        self.set_title(1, "Scenarios", self._describe_list())
        super().show()

    def _describe_list(self) -> str:
        files = sum(1 for each in self._rows if isinstance(each, Path))
        words = [f"{files}"]
        if self._model.filter:
            words.append(f"/{clip(plain(self._model.filter), 20)}")
        if not self._model.is_read:
            words.append("reading …")
        elif self._model.is_cut:
            words.append("more files exist than are listed")
        return " · ".join(words)

    def keep_choice_in_view(self) -> None:
        if self._model.chosen in self._rows:
            y = self._rows.index(self._model.chosen)
            self.keep_in_view(y - 1 if y == 1 else y)

    def row_count(self) -> int:
        return max(1, len(self._rows))

    def row_at(self, y: int) -> Row:
        if not self._rows:
            what = "no scenario with these words" if self._model.filter else "no scenario file"
            return row((what, "dim")) if y == 0 else EMPTY
        each = self._rows[y] if y < len(self._rows) else ""
        if isinstance(each, str):
            return row((clip(plain(each), self.line_width), "faint"))
        return self._file_row(each)

    def _file_row(self, path: Path) -> Row:
        chosen = path == self._model.chosen
        found = self._model.find_read_file(path)
        mark, mark_style = OUTCOME_MARKS[self._model.outcomes.get(path)]
        name, name_style = plain(found.name if found else path.stem), "" if found else "dim"
        if found is not None and found.problem:
            mark, mark_style, name, name_style = "! ", "error", f"{plain(path.name)}: error", "warn"
        room = self.line_width - 4 - BLOCK_WIDTH - DIALECT_WIDTH
        return row(
            ("▸ " if chosen else "  ", "key"),
            (mark, mark_style),
            (pad(clip(name, room - 1), room), name_style),
            (pad(_block_text(found), BLOCK_WIDTH), "label"),
            (clip(found.dialect if found else "", DIALECT_WIDTH), "dim"),
            style=self.cursor_style(chosen),
        )

    # -- choosing -----------------------------------------------------------------------------------

    def action_move(self, rows: int) -> None:
        self._model.move_choice(rows)
        self._show_choice()

    def click(self, x: int, y: int) -> None:
        each = self._rows[y] if self._rows else ""
        if not isinstance(each, Path):
            return
        if each == self._model.chosen:
            self.post_message(KeyClicked("load"))
        self._model.chosen = each
        self._show_choice()

    def _show_choice(self) -> None:
        self.keep_choice_in_view()
        self.show()
        self.post_message(ScenarioChosen())


def _block_text(file: ScenarioFile | None) -> str:
    first, *more = (file.blocks if file else ()) or ("",)
    count = f" +{len(more)}" if more else ""
    return clip(first, BLOCK_WIDTH - 1 - len(count)) + count


INDENT: Final = 2


class TraceList(TextView):
    """The inputs of each instance, and the last `tail` lines of its trace."""

    DEFAULT_CSS = "TraceList { height: auto; min-height: 3; }"

    def __init__(self, view_model: ViewModel) -> None:
        super().__init__(id="traces")
        self._view_model = view_model
        self.tail = 4

    def show_player(self, player: PlayerSnapshot) -> None:
        self.set_title(4, "STATUS, scan by scan")
        pins = {instance.name: _input_parts(instance) for instance in self._view_model.instances}
        self._rows = []
        for name, trace in player.traces:
            self._rows.append(row((f"{clip(plain(name), 24)}  ", "strong"), *pins.get(name, [])))
            self._rows += self._trace_rows(trace)
        self.show()

    def _trace_rows(self, trace: str) -> list[Row]:
        lines = wrap_text(trace, max(20, self.line_width - INDENT - 4)) if trace else ("no scan yet",)
        cut = len(lines) > self.tail
        return [
            row(
                (" " * INDENT, ""),
                ("… " if cut and number == 0 else "", "faint"),
                (line, "" if trace else "dim"),
            )
            for number, line in enumerate(lines[-self.tail :])
        ]


def _input_parts(instance: InstanceSnapshot) -> list[Part]:
    parts: list[Part] = []
    for pin, value in instance.inputs:
        if isinstance(value, bool):
            parts.append((f"{pin} {lamp(value)}  ", "on" if value else "faint"))
        else:
            parts.append((f"{pin} {value}  ", "dim"))
    return parts


GUTTER_WIDTH: Final = 7  # number, blank, mark, blank
CONTEXT_LINES: Final = 2  # lines that stay in view around the current one
STEP_STYLES: Final = {  # by state: mark, style of the mark, style of the text
    TO_COME: (" ", "", ""),
    NOW: ("▶", "busy", "busy"),
    DONE: ("•", "done", "dim"),
    HELD: ("✓", "done", "dim"),
    FAILED: ("✗", "error", "error"),
}
NEXT_STEP_STYLE: Final = ("▸", "key", "strong")


class ScenarioText(TextView, inherit_bindings=False):
    """What the scenario is about, then its steps; the present step stays in view."""

    BINDINGS: ClassVar[list[BindingType]] = ARROW_KEYS

    def __init__(self, model: ScenarioListModel) -> None:
        super().__init__(id="text")
        self._model = model
        self._drawn: tuple[ScenarioFile | None, tuple[StepSnapshot, ...], int, int] | None = None
        self._row_of: dict[int, int] = {}  # by number of the step
        self._followed: tuple[str, int] | None = None

    def show_player(self, player: PlayerSnapshot | None, kernel: str) -> None:
        file = self._model.chosen_file
        played = player if player is not None and file is not None and player.path == str(file.path) else None
        self._show_title(file, played, kernel)
        shown = file, played.steps if played else (), played.current if played else -1, self.line_width
        if shown != self._drawn:
            if self._drawn is None or shown[0] != self._drawn[0]:
                self.scroll_to(y=0, animate=False)
            self._drawn = shown
            self._rows = self._text_rows(file, played) if file is not None else []
            self.apply_row_count()
            self._keep_step_in_view(played)
        self.show()

    def _show_title(self, file: ScenarioFile | None, played: PlayerSnapshot | None, kernel: str) -> None:
        if file is None:
            self.set_title(2, "Steps")
            return
        words = [kernel]
        if played is not None:
            last = played.steps[-1].number if played.steps else 0
            words.append("over" if played.finished else f"step {_coming_step(played)} of {last}")
        self.set_title(2, plain(file.path.name), " · ".join(words))

    # -- the lines ----------------------------------------------------------------------------------

    def _text_rows(self, file: ScenarioFile, played: PlayerSnapshot | None) -> list[Row]:
        self._row_of = {}
        rows = [row((line, "strong")) for line in wrap_text(file.name, self.line_width)]
        if file.about:
            rows += [row((line, "dim")) for line in wrap_text(file.about, self.line_width)]
        if file.problem:
            rows += [row((line, "error")) for line in wrap_text(f"✗ {file.problem}", self.line_width)]
        rows.append(EMPTY)
        steps = {step.number: step for step in played.steps if step.number} if played else {}
        for step in played.steps if played else ():
            if not step.number and step.state == FAILED:  # commands of `start` are not in the text
                rows += self._step_rows(ScriptLine(0, 0, f"start: {step.line}"), step, False)
        coming = _coming_step(played)
        for line in file.lines:
            if line.step:
                self._row_of[line.step] = len(rows)
            rows += self._step_rows(line, steps.get(line.step), 0 < line.step == coming)
        return rows

    def _step_rows(self, line: ScriptLine, step: StepSnapshot | None, is_next: bool) -> list[Row]:
        state = step.state if step is not None and line.text else TO_COME
        mark, mark_style, style = NEXT_STEP_STYLE if is_next and state == TO_COME else STEP_STYLES[state]
        if line.text.startswith("#"):
            style = "dim"
        first, *rest = wrap_text(line.text, self.line_width - GUTTER_WIDTH)
        place = f"{line.place:>4} " if line.place else "     "
        ground = "cursor-blurred" if is_next or state == NOW else ""
        rows = [row((place, "faint"), (f"{mark} ", mark_style), (first, style), style=ground)]
        rows += [row((" " * (GUTTER_WIDTH + 2), ""), (more, style), style=ground) for more in rest]
        if step is not None and state == FAILED:
            found = wrap_text(f"found {step.found or 'nothing'}", self.line_width - GUTTER_WIDTH - 2)
            rows += [row((" " * (GUTTER_WIDTH + 2), ""), (more, "error")) for more in found]
        return rows

    def _keep_step_in_view(self, played: PlayerSnapshot | None) -> None:
        # Only when the step changes: between steps you may scroll.
        if played is None or (played.path, played.current) == self._followed or not played.steps:
            return
        self._followed = played.path, played.current
        number = played.steps[min(played.current, len(played.steps) - 1)].number
        at = self._row_of.get(number, 0)
        self.keep_in_view(min(at + CONTEXT_LINES, max(0, len(self._rows) - 1)))
        self.keep_in_view(max(0, at - CONTEXT_LINES))


def _coming_step(played: PlayerSnapshot | None) -> int:
    """Return the number of the step that runs or comes next, 0 if there is no such step."""
    if played is None or played.finished or played.current >= len(played.steps):
        return 0
    return played.steps[played.current].number
