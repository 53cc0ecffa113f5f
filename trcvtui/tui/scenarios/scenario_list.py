"""The scenario files, folder by folder: name, how it ended when it was last played, what is wrong with it."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import ClassVar, Final

from textual import events
from textual.binding import BindingType

from trcvtui.rig import configs_path
from trcvtui.rig.scenario.scenario import Found, ScenarioFile, read_scenario_file
from trcvtui.tui.formatting import clip, plain
from trcvtui.tui.messages import ScenarioChosen, ScenarioWanted
from trcvtui.tui.widgets.line_view import ARROW_MOVES, EMPTY, LineView, Row, row

FILES_AT_ONCE: Final = 4  # a few milliseconds
SHIPPED: Final = "came with trcvtui"


class ScenarioListModel:
    """Scenario files in reading order. `revision` counts up with each change of `rows`."""

    def __init__(self, found: Found, chosen: Path | None = None) -> None:
        self.is_cut = found.is_cut
        self.filter = ""
        self.revision = 0
        self.outcomes: dict[Path, bool] = {}  # whether it held when it was last played
        self._paths = list(found.paths)
        self._read: dict[Path, ScenarioFile] = {}
        self._unread = deque(found.paths)
        self.chosen = chosen if chosen in self._paths else next(iter(self._paths), None)

    # -- reading ------------------------------------------------------------------------------------

    @property
    def is_read(self) -> bool:
        """Return whether every file has been read."""
        return not self._unread

    def read_some(self) -> None:
        """Read the next few files; what is no scenario leaves the list."""
        for _ in range(min(FILES_AT_ONCE, len(self._unread))):
            self.file(self._unread.popleft())
        self._keep_a_choice()

    def read(self, path: Path) -> ScenarioFile | None:
        """Read a file anew, as it is on the disk now."""
        said = read_scenario_file(path)
        if said is None:
            self._read.pop(path, None)
            self._paths = [other for other in self._paths if other != path]
        else:
            self._read[path] = said
        self.revision += 1
        return said

    def file(self, path: Path | None) -> ScenarioFile | None:
        """Return what a file says; one that has not been read yet is read now."""
        if path is None or path not in self._paths:
            return None
        if path not in self._read:
            self.read(path)
        return self._read.get(path)

    @property
    def chosen_file(self) -> ScenarioFile | None:
        """Return what the chosen file says."""
        said = self.file(self.chosen)
        if said is None and self._keep_a_choice():
            return self.chosen_file
        return said

    # -- what is listed -----------------------------------------------------------------------------

    def listed(self) -> list[Path]:
        """Return the files that the filter lets through."""
        words = self.filter.casefold().split()
        return [path for path in self._paths if all(word in self._spoken(path) for word in words)]

    def _spoken(self, path: Path) -> str:
        said = self._read.get(path)
        return f"{path.parent.name}/{path.stem} {said.name if said else ''}".casefold()

    def rows(self) -> list[Path | str]:
        """Return the listed files, each folder's name before its first one."""
        rows: list[Path | str] = []
        folder = None
        for path in self.listed():
            if path.parent != folder:
                folder = path.parent
                rows.append(_label(folder))
            rows.append(path)
        return rows

    def known(self, path: Path) -> ScenarioFile | None:
        """Return what a file says, None while it has not been read."""
        return self._read.get(path)

    # -- choosing -----------------------------------------------------------------------------------

    def narrow(self, words: str) -> None:
        """List only the files in whose name these words are."""
        self.filter = words
        self.revision += 1
        self._keep_a_choice()

    def move(self, files: int) -> None:
        """Choose another file of the list."""
        listed = self.listed()
        if listed:
            here = listed.index(self.chosen) if self.chosen in listed else 0
            self.chosen = listed[max(0, min(len(listed) - 1, here + files))]

    def _keep_a_choice(self) -> bool:
        """Choose the first file where the chosen one is no longer listed; return whether that helped."""
        listed = self.listed()
        if self.chosen in listed:
            return False
        self.chosen = next(iter(listed), None)
        return self.chosen is not None


def _label(folder: Path) -> str:
    try:
        within = folder.relative_to(configs_path())
    except ValueError:
        return str(folder)
    return f"{SHIPPED} · {within}"


MARKS: Final = {True: ("✓ ", "done"), False: ("✗ ", "error"), None: ("  ", "")}  # whether it held


class ScenarioList(LineView, inherit_bindings=False):
    """One line a file; the cursor is the choice. `k` is not up here: it chooses the kernel."""

    BINDINGS: ClassVar[list[BindingType]] = ARROW_MOVES

    def __init__(self, model: ScenarioListModel) -> None:
        super().__init__(id="scenarios")
        self._model = model
        self._revision = -1
        self._rows: list[Path | str] = []

    def show(self) -> None:
        """Repaint what changed; the choice stays in view while files come and go."""
        if self._revision != self._model.revision:
            self._revision = self._model.revision
            self._rows = self._model.rows()
            self.resize_rows()
            self.follow()
        self.set_title(1, "Scenarios", self._detail())
        super().show()

    def _detail(self) -> str:
        files = sum(1 for each in self._rows if isinstance(each, Path))
        words = [f"{files}"]
        if self._model.filter:
            words.append(f"/{clip(plain(self._model.filter), 20)}")
        if not self._model.is_read:
            words.append("reading …")
        elif self._model.is_cut:
            words.append("there are more files than are looked at")
        return " · ".join(words)

    def follow(self) -> None:
        """Keep the choice in view, and the name of its folder where it is the first one."""
        if self._model.chosen in self._rows:
            y = self._rows.index(self._model.chosen)
            self.keep_in_view(y - 1 if y == 1 else y)

    def row_count(self) -> int:
        """Return the number of lines."""
        return max(1, len(self._rows))

    def row_at(self, y: int) -> Row:
        """Return a folder or a file."""
        if not self._rows:
            what = "no scenario has these words" if self._model.filter else "no scenario file"
            return row((what, "dim")) if y == 0 else EMPTY
        each = self._rows[y] if y < len(self._rows) else ""
        if isinstance(each, str):
            return row((clip(plain(each), self.line_width), "faint"))
        return self._file(each)

    def _file(self, path: Path) -> Row:
        chosen = path == self._model.chosen
        style = self.cursor_style(chosen)
        said = self._model.known(path)
        mark, mark_style = MARKS[self._model.outcomes.get(path)]
        name, name_style = plain(said.name if said else path.stem), "" if said else "dim"
        if said is not None and said.problem:
            mark, mark_style, name, name_style = "! ", "error", f"{plain(path.name)} is wrong", "warn"
        pointer = ("▸ " if chosen else "  ", "key")
        return row(pointer, (mark, mark_style), (clip(name, self.line_width - 4), name_style), style=style)

    # -- choosing -----------------------------------------------------------------------------------

    def action_move(self, rows: int) -> None:
        """Choose another file."""
        self._model.move(rows)
        self._chosen()

    def on_click(self, event: events.Click) -> None:
        """Choose the file under the mouse; a click on the chosen one loads it."""
        place = self.place_of(event)
        each = self._rows[place[1]] if place is not None and place[1] < len(self._rows) else ""
        if not isinstance(each, Path):
            return
        if each == self._model.chosen:
            self.post_message(ScenarioWanted())
        self._model.chosen = each
        self._chosen()

    def _chosen(self) -> None:
        self.follow()
        self.show()
        self.post_message(ScenarioChosen())
