"""The files that the lab reads its types from, read again when they change on the disk.

Rule: a save that breaks a good type changes nothing but the line that says what is wrong.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from trcvtui.errors import Problem, UserError
from trcvtui.udt.sources import read_files
from trcvtui.udt.type_set import NO_TYPES, TypeSet

Stamp = tuple[int, int] | None  # time of the last change in ns, and size; None: not there


class TypeFiles:
    """Types of one or more files; `trouble` is what is wrong with what stands on the disk now."""

    def __init__(
        self, paths: Iterable[Path], constants: Mapping[str, int], types: TypeSet | None = None
    ) -> None:
        self.paths = tuple(paths)
        self.constants = dict(constants)
        self.types = types or NO_TYPES
        self.trouble = ""
        self._stamps = self._seen()
        if types is None:
            self.types = self._read()

    @property
    def name(self) -> str:
        """Return what the screen calls the files."""
        names = [path.name for path in self.paths]
        return (
            names[0] + (f" and {len(names) - 1} more" if len(names) > 1 else "") if names else "the project"
        )

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Return what is wrong in the files, also in types that nobody uses."""
        return self.types.problems

    @property
    def unknown_constants(self) -> tuple[str, ...]:
        """Return the names of constants to ask for."""
        return self.types.unknown_constants

    def look(self) -> bool:
        """Read the files again when one has changed; return whether the types are others now."""
        stamps = self._seen()
        if stamps == self._stamps:
            return False
        self._stamps = stamps
        return self._read_again()

    def know(self, constants: Mapping[str, int]) -> bool:
        """Read the files with more constants; return whether the types are others now."""
        self.constants |= constants
        return self._read_again()

    def _read_again(self) -> bool:
        try:
            fresh = self._read()
        except UserError as refused:
            self.trouble = refused.lines()[0]
            return False
        lost = [name for key, (name, _) in self.types.types.items() if key not in fresh.types]
        new = [problem for problem in fresh.problems if problem not in self.types.problems]
        if lost and new:
            self.trouble = str(new[0])
            return False
        self.types, self.trouble = fresh, ""
        return True

    def _read(self) -> TypeSet:
        return read_files(self.paths, self.constants) if self.paths else NO_TYPES

    def _seen(self) -> tuple[Stamp, ...]:
        return tuple(_stamp(path) for path in self.paths)


def _stamp(path: Path) -> Stamp:
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None
    return found.st_mtime_ns, found.st_size
