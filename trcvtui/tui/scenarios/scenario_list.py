"""The scenario files, folder by folder: name, how it ended when it was last played, what is wrong with it."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Final

from textual import events
from textual.binding import Binding, BindingType

from trcvtui.tui.formatting import clip, plain
from trcvtui.tui.messages import ScenarioChosen, ScenarioWanted
from trcvtui.tui.scenarios.scenario_list_model import Library
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Row, row

MARKS: Final = {True: ("✓ ", "done"), False: ("✗ ", "error"), None: ("  ", "")}  # whether it held


class ScenarioList(LineView, inherit_bindings=False):
    """One line a file; the cursor is the choice. `k` is not up here: it chooses the kernel."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down", "move(1)", show=False),
        Binding("up", "move(-1)", show=False),
        Binding("pagedown", "page(1)", show=False),
        Binding("pageup", "page(-1)", show=False),
        Binding("home,g", "edge(-1)", show=False),
        Binding("end,G", "edge(1)", show=False),
    ]

    def __init__(self, library: Library) -> None:
        super().__init__(id="scenarios")
        self._library = library
        self._revision = -1
        self._rows: list[Path | str] = []

    def show(self) -> None:
        """Repaint what changed; the choice stays in view while files come and go."""
        if self._revision != self._library.revision:
            self._revision = self._library.revision
            self._rows = self._library.rows()
            self.resize_rows()
            self.follow()
        self.set_title(1, "Scenarios", self._detail())
        super().show()

    def _detail(self) -> str:
        files = sum(1 for each in self._rows if isinstance(each, Path))
        words = [f"{files}"]
        if self._library.filter:
            words.append(f"/{clip(plain(self._library.filter), 20)}")
        if not self._library.is_read:
            words.append("reading …")
        elif self._library.is_cut:
            words.append("there are more files than are looked at")
        return " · ".join(words)

    def follow(self) -> None:
        """Keep the choice in view, and the name of its folder where it is the first one."""
        if self._library.chosen in self._rows:
            y = self._rows.index(self._library.chosen)
            self.keep_in_view(y - 1 if y == 1 else y)

    def row_count(self) -> int:
        """Return the number of lines."""
        return max(1, len(self._rows))

    def row_at(self, y: int) -> Row:
        """Return a folder or a file."""
        if not self._rows:
            what = "no scenario has these words" if self._library.filter else "no scenario file"
            return row((what, "dim")) if y == 0 else EMPTY
        each = self._rows[y] if y < len(self._rows) else ""
        if isinstance(each, str):
            return row((clip(plain(each), self.line_width), "faint"))
        return self._file(each)

    def _file(self, path: Path) -> Row:
        chosen = path == self._library.chosen
        style = "" if not chosen else "cursor" if self.has_focus else "cursor-blurred"
        said = self._library.known(path)
        mark, mark_style = MARKS[self._library.outcomes.get(path)]
        name, name_style = plain(said.name if said else path.stem), "" if said else "dim"
        if said is not None and said.problem:
            mark, mark_style, name, name_style = "! ", "error", f"{plain(path.name)} is wrong", "warn"
        pointer = ("▸ " if chosen else "  ", "key")
        return row(pointer, (mark, mark_style), (clip(name, self.line_width - 4), name_style), style=style)

    # -- choosing -----------------------------------------------------------------------------------

    def action_move(self, rows: int) -> None:
        """Choose another file."""
        self._library.move(rows)
        self._chosen()

    def on_click(self, event: events.Click) -> None:
        """Choose the file under the mouse; a click on the chosen one loads it."""
        place = self.place_of(event)
        each = self._rows[place[1]] if place is not None and place[1] < len(self._rows) else ""
        if not isinstance(each, Path):
            return
        if each == self._library.chosen:
            self.post_message(ScenarioWanted())
        self._library.chosen = each
        self._chosen()

    def _chosen(self) -> None:
        self.follow()
        self.show()
        self.post_message(ScenarioChosen())
