"""What was edited in the project that was opened, and which of it is in a file.

Rule: `create`, `delete` and `resize` change the program that runs; `add`, `set` of a part, `remove` and
`undo` change the project too, and are what `save project` writes. Inputs, DATA and faults of now are the
session's (`save scenario`).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace

from trcvtui.project.edit import difference
from trcvtui.project.project import Edits as Steps
from trcvtui.project.project import Project
from trcvtui.project.tables import read_text
from trcvtui.rig.commands.instances import after
from trcvtui.rig.commands.table import parse_line, to_line
from trcvtui.rig.commands.words import MENDS, Mend
from trcvtui.rig.scenario.scenario import check_bench
from trcvtui.rig.wording import count

WHERE = "prompt"


class Edits:
    """The opened project as it was edited; `done` counts the edits, `saved` those in its file."""

    def __init__(self, project: Project) -> None:
        self.project = project
        self.done = self.saved = 0
        self.before: str | None = None  # what the file said when the bench began, once it has been saved
        self._begun_from_file = True
        self._in_file = project
        self._edits: Steps = ()  # what makes the project of the one in the file
        self._constants: dict[str, int] = {}  # given since the project was opened, or saved
        self._written: set[str] = set()  # real paths

    @property
    def unsaved(self) -> int:
        """Return how many entries stand otherwise in the file, or not at all."""
        return len(self._edits) + len(self._constants)

    @property
    def unsaved_word(self) -> str:
        """Return what the unsaved are."""
        return "addition" if all(edit.before is None for edit in self._edits) else "change"

    def begin(self) -> None:
        """A fresh bench begins with what is known now."""
        self.before, self._begun_from_file = None, self.saved == self.done

    def check(self, command: Mend) -> Mend:
        """Return the command as this project takes it; raise UserError when it cannot be as the bench can."""
        mine = parse_line(to_line(command), self.project, WHERE)
        assert isinstance(mine, MENDS)
        check_bench(after(mine, self.project))
        return mine

    def note(self, command: Mend) -> None:
        """Take what was edited on the bench."""
        self.project = after(command, self.project)
        self._edits = difference(self._in_file, self.project)
        self.done += 1

    def take_types(self, fresh: Project, constants: Mapping[str, int]) -> None:
        """Take UDTs that were read again, and constants that were given for them."""
        self.project = replace(self.project, types=fresh.types, constants=fresh.constants)
        self._constants |= constants

    def save(self, words: str) -> str:
        """Write `[FILE] [!]`, what is behind `save project`; return what to tell; raise UserError."""
        from trcvtui.project.text import with_files_from  # read when first asked for
        from trcvtui.rig.engine.project_save import save_project, target_of

        own = self.project.path
        path = target_of(words, own, self._written, WHERE)
        if not self.unsaved and os.path.realpath(path) == os.path.realpath(own):
            return f"nothing was added to {path}" if not self.done else f"nothing is unsaved in {path}"
        before = read_text(own) if self.before is None and self._begun_from_file else self.before
        loaded = save_project(own, path, self._edits, WHERE, self._constants)
        told = f"the project with {count(self.unsaved, self.unsaved_word)} in {path.absolute()}"
        self.before = before if before is None else with_files_from(before, own.parent, path.parent, str(own))
        self._written.add(os.path.realpath(path))
        self._constants.clear()
        self.saved = self.done
        self.project = replace(self.project, path=loaded.path, base=loaded.base)
        self._in_file, self._edits = self.project, ()
        return told
