"""`udt reload` and `udt constant GVL.MAX=10`: the UDTs of the running project, read again from their files.

Rule: what runs keeps the types that its DATA has; a changed one comes into DATA by `resize`, as a download.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from trcvtui.errors import UserError, mistake
from trcvtui.project.project import Project
from trcvtui.project.tables import shown
from trcvtui.rig.wording import count
from trcvtui.udt.command.command import constants_of
from trcvtui.udt.sources import read_files

RELOAD, CONSTANT = "reload", "constant"
LINES: Final = "udt reload, or udt constant NAME=VALUE; the rest of `udt` is for the screen's lab (L)"


def read_again(rest: str, project: Project, where: str) -> tuple[Project, dict[str, int], str]:
    """Return the project with its types as they stand in their files now, the constants, what to tell.

    `rest` is what stands behind `udt`. A type that somebody uses and that is bad now is refused.
    """
    word, _, pairs = rest.strip().partition(" ")
    if word not in (RELOAD, CONSTANT) or (word == RELOAD) == bool(pairs.strip()):
        raise mistake(where, shown(f"udt {rest}".strip()), LINES)
    given = constants_of(pairs.split()) if word == CONSTANT else {}
    constants = {**project.constants, **given}
    if not project.udt_files:
        return replace(project, constants=constants), given, "the project names no UDT files"
    types = read_files(project.udt_files, constants, library=project.dialect.types)
    used = {decl.type_name.casefold() for decl in project.data} & project.types.types.keys()
    bad = [name for name in sorted(used) if name not in types.types]
    if bad:
        raise UserError(types.broken.get(bad[0]) or mistake(where, f"no {bad[0]}", "its type").problems)
    told = f"{count(len(types.types), 'type')} read; `resize` takes a changed one into DATA"
    return replace(project, types=types, constants=constants), given, told
