"""A STRUCT that is pasted into the form, and the file beside the project that it becomes."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Final, NamedTuple

from trcvtui.errors import UserError, mistake
from trcvtui.files import FilesRead, write_file
from trcvtui.project.tables import hidden_in
from trcvtui.udt.sources import read_text

MOST_PASTED: Final = 64 * 1024  # characters
LONGEST_NAME: Final = 60
UNNAMED: Final = "Pasted.st"  # a STRUCT alone is called as its file


class PastedType(NamedTuple):
    """The text of a file that is not there yet, and its name."""

    name: str
    text: str
    base: Path

    @property
    def reads(self) -> FilesRead:
        """Return what is read in place of the disk while it is looked at."""
        return FilesRead(contents=[(os.fspath(self.base / self.name), self.text.encode())])

    def write(self) -> None:
        """Write the file; raise UserError where it cannot be."""
        from trcvtui.engine.project_edits import refuse_what_came_along  # read when first asked for

        refuse_what_came_along(self.base / self.name, f"udt {self.name}")
        write_file(self.base / self.name, self.text, f"udt {self.name}", is_new=True)


def pasted_type(text: str, base: Path) -> PastedType:
    """Return what a pasted text becomes, under the first name that is free; raise UserError."""
    if len(text) > MOST_PASTED:
        raise mistake("paste", f"{len(text)} characters", f"at most {MOST_PASTED}")
    lines = text.expandtabs(4).splitlines()
    if hidden := hidden_in("".join(lines)):
        raise mistake("paste", f"{hidden[:40]} in it", "a STRUCT without control characters")
    source, name = "\n".join([*lines, ""]), UNNAMED
    with suppress(UserError):  # what is wrong in it the form says
        name = next((declared.name for declared in read_text(source, UNNAMED, ".st").types), UNNAMED)
    safe = re.sub(r"\W", "_", name.removesuffix(".st"))[:LONGEST_NAME]
    names = (f"{safe}{number if number > 1 else ''}.st" for number in count(1))
    return PastedType(next(one for one in names if not os.path.lexists(base / one)), source, base)
