"""What was added to the project that was opened, and which of it is in a file.

Rule: `create`, `delete` and `resize` change the program that runs; `add` changes the project too, and is what
`save project` writes. Inputs, DATA and faults of now are the session's (`save scenario`).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace

from trcvtui.plc.project import Project
from trcvtui.plc.project_edit import with_entry
from trcvtui.plc.project_keys import Declaration
from trcvtui.plc.toml_file import read_text
from trcvtui.rig.bench_edit import refused
from trcvtui.rig.edit_words import Add, AddData
from trcvtui.rig.scenario import start_steps
from trcvtui.rig.wording import count

WHERE = "prompt"


class Edits:
    """The opened project with what was added; `done` counts the additions, `saved` those in its file."""

    def __init__(self, project: Project) -> None:
        self.project = project
        self.done = self.saved = 0
        self.before: str | None = None  # what the file said when the bench began, once it has been saved
        self._begun_from_file = True
        self._pending: list[Declaration] = []
        self._constants: dict[str, int] = {}  # given since the project was opened, or saved
        self._written: set[str] = set()  # real paths

    @property
    def unsaved(self) -> int:
        """Return how many additions are in no file."""
        return len(self._pending) + len(self._constants)

    def begin(self) -> None:
        """A fresh bench begins with what is known now."""
        self.before, self._begun_from_file = None, self.saved == self.done

    def check(self, command: Add | AddData) -> None:
        """Raise UserError when the project cannot take what the running program could."""
        wrong = refused(command, self.project, WHERE)
        if wrong is not None:
            raise wrong
        start_steps(with_entry(self.project, command.decl))

    def note(self, command: Add | AddData) -> None:
        """Take what was added to the bench."""
        self.project = with_entry(self.project, command.decl)
        self._pending.append(command.decl)
        self.done += 1

    def take_types(self, fresh: Project, constants: Mapping[str, int]) -> None:
        """Take UDTs that were read again, and constants that were given for them."""
        self.project = replace(self.project, types=fresh.types, constants=fresh.constants)
        self._constants |= constants

    def save(self, words: str) -> str:
        """Write `[FILE] [!]`, what is behind `save project`; return what to tell; raise UserError."""
        from trcvtui.plc.project_text import with_files_from  # read when first asked for
        from trcvtui.rig.project_save import save_project, target_of

        own = self.project.path
        path = target_of(words, own, self._written, WHERE)
        if not self.unsaved and os.path.realpath(path) == os.path.realpath(own):
            return f"nothing was added to {path}"
        before = read_text(own) if self.before is None and self._begun_from_file else self.before
        loaded = save_project(own, path, self._pending, WHERE, self._constants)
        told = f"the project with {count(self.unsaved, 'addition')} in {path.absolute()}"
        self.before = before if before is None else with_files_from(before, own.parent, path.parent, str(own))
        self._written.add(os.path.realpath(path))
        self._pending.clear()
        self._constants.clear()
        self.saved = self.done
        self.project = replace(self.project, path=loaded.path, base=loaded.base)
        return told
