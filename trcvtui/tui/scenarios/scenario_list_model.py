"""The scenario files as the screen knows them: found at once, read one by one, filtered, one chosen."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import Final

from trcvtui.rig import configs_path
from trcvtui.rig.scenario.files import Found, ScenarioFile, read_scenario_file

FILES_AT_ONCE: Final = 4  # a few milliseconds
SHIPPED: Final = "came with trcvtui"


class Library:
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
