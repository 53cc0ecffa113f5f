"""`save project [FILE] [!]`: what was added, written into the text of the project's file.

Rule 1: what stands in the file now stays, also what was written there since it was opened.
Rule 2: the new text is loaded before it is written, and takes the place of the old one in one step.
"""

from __future__ import annotations

import codecs
import os
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Final

from trcvtui.errors import mistake
from trcvtui.files import read_bytes, write_file
from trcvtui.plc.project import ComBufferDecl, DataDecl, Project
from trcvtui.plc.project_edit import entries_of
from trcvtui.plc.project_file import read_project
from trcvtui.plc.project_keys import KIND_OF, Declaration, keys_of
from trcvtui.plc.project_text import with_constants, with_entries, with_files_from
from trcvtui.plc.tables import shown
from trcvtui.plc.toml_file import LARGEST_FILE, parse_toml, read_text
from trcvtui.rig import configs_path, demo_path
from trcvtui.rig.scenario import check_bench
from trcvtui.rig.session_file import SUFFIX, target

FORCE: Final = "!"


def target_of(words: str, own: Path, written: Collection[str], where: str) -> Path:
    """Return the file that `[FILE] [!]` names; raise UserError where it would write over somebody else's."""
    name = words.strip()
    is_forced = name.endswith(FORCE)
    name = name.removesuffix(FORCE).strip()
    if not name:
        _refuse_what_came_along(own, where)
        return own
    path = target(name, where)
    if not name.strip("\"'").endswith(SUFFIX):
        raise mistake(where, shown(name), f"a name that ends in {SUFFIX}")
    whole = os.path.realpath(path)
    is_ours = whole in written or whole == os.path.realpath(own)
    if is_ours:
        _refuse_what_came_along(path, where)
    elif not is_forced and os.path.lexists(path):
        expected = f"the name of a new file, or `save project {name} {FORCE}` to write over it"
        raise mistake(where, f"{path}, which is there already", expected)
    return path


def _refuse_what_came_along(path: Path, where: str) -> None:
    here = Path(os.path.realpath(path))
    if any(here.is_relative_to(os.path.realpath(folder)) for folder in (demo_path().parent, configs_path())):
        raise mistake(where, f"{here.name}, which came with trcvtui", "save project FILE, a file of your own")


def save_project(
    own: Path, path: Path, added: Sequence[Declaration], where: str, constants: Mapping[str, int]
) -> Project:
    """Write the text of `own` with what was added to `path`; return what it loads as; raise UserError."""
    if not path.parent.is_dir():
        raise mistake(where, f"{path}: no folder {path.parent}", "a file that can be written")
    text = with_files_from(read_text(own), own.parent, path.parent, str(own))
    if added:
        text = with_entries(text, added, str(own))
    if constants:
        text = with_constants(text, constants, str(own))
    loaded = _loaded(text, path, added)
    if any(loaded.constants.get(name) != number for name, number in constants.items()):
        raise mistake(str(path), "other constants", "the ones that were given")
    write_file(path, _beginning(own) + text.encode(), where, is_own=True)
    return loaded


def _loaded(text: str, path: Path, added: Sequence[Declaration]) -> Project:
    """Return the project that the text says, every addition as it was meant; raise UserError."""
    document = parse_toml(text, str(path))
    document.pop("scenario", None)
    loaded = read_project(document, str(path), path.parent)
    check_bench(loaded)
    for decl in added:
        kind = KIND_OF[type(decl)]
        if not any(_same(decl, entry) for entry in entries_of(kind, loaded)):
            raise mistake(str(path), f"another {kind} {decl.name}", "the one that was added")
    return loaded


def _same(decl: Declaration, other: Declaration) -> bool:
    # A type is laid out anew with each reading; who writes and feeds a ComBuffer, its neighbours tell.
    if isinstance(decl, DataDecl | ComBufferDecl):
        return decl.name == other.name and keys_of(decl) == keys_of(other)
    return decl == other


def _beginning(path: Path) -> bytes:
    """Return the byte order mark that some editors of Windows begin a file with, where it is there."""
    return codecs.BOM_UTF8 if read_bytes(path, LARGEST_FILE).startswith(codecs.BOM_UTF8) else b""
