"""`save project [FILE] [!]`: what was edited, written into the text of the project's file.

Rule 1: what stands in the file now stays, also what was written there since it was opened.
Rule 2: the new text is loaded before it is written, and takes the place of the old one in one step.
"""

from __future__ import annotations

import codecs
import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Final

from trcvtui.errors import UserError, mistake
from trcvtui.files import read_bytes, write_file
from trcvtui.project.edit import entry, same
from trcvtui.project.file import read_project
from trcvtui.project.keys import forms_of
from trcvtui.project.project import Edit, Edits, Project
from trcvtui.project.tables import LARGEST_FILE, parse_toml, read_text, shown
from trcvtui.project.text import with_change, with_constants, with_entries, with_files_from
from trcvtui.rig import configs_path, demo_path
from trcvtui.rig.scenario.scenario import check_bench
from trcvtui.rig.scenario.session_file import SUFFIX, target

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


def save_project(own: Path, path: Path, edits: Edits, where: str, constants: Mapping[str, int]) -> Project:
    """Write the text of `own` with these edits to `path`; return what it loads as; raise UserError."""
    if not path.parent.is_dir():
        raise mistake(where, f"{path}: no folder {path.parent}", "a file that can be written")
    text = with_files_from(read_text(own), own.parent, path.parent, str(own))
    added = [edit.after for edit in edits if edit.before is None and edit.after is not None]
    if added:
        text = with_entries(text, added, str(own))
    for edit in edits:
        if edit.before is not None:
            text = _with_change(text, edit, own, path)
    if constants:
        text = with_constants(text, constants, str(own))
    loaded = _loaded(text, path, edits)
    if any(loaded.constants.get(name) != number for name, number in constants.items()):
        raise mistake(str(path), "other constants", "the ones that were given")
    write_file(path, _beginning(own) + text.encode(), where, is_own=True)
    return loaded


def _with_change(text: str, edit: Edit, own: Path, path: Path) -> str:
    """Return the text with one entry changed or gone, written in the form in which it means that."""
    refused: UserError | None = None
    for form in range(len(forms_of(edit.after)) if edit.after is not None else 1):
        try:
            changed = with_change(text, edit, form, str(own))
            if edit.after is None or _stands(edit, _read(changed, path)):
                return changed
        except UserError as wrong:
            refused = refused or wrong
    raise refused or _another(edit, path)


def _read(text: str, path: Path) -> Project:
    document = parse_toml(text, str(path))
    document.pop("scenario", None)
    return read_project(document, str(path), path.parent)


def _loaded(text: str, path: Path, edits: Edits) -> Project:
    """Return the project that the text says, every edit as it was meant; raise UserError."""
    loaded = _read(text, path)
    check_bench(loaded)
    for edit in edits:
        if not _stands(edit, loaded):
            raise _another(edit, path)
    return loaded


def _stands(edit: Edit, loaded: Project) -> bool:
    found = entry(edit.kind, edit.name, loaded)
    return found is None if edit.after is None else found is not None and same(edit.after, found)


def _another(edit: Edit, path: Path) -> UserError:
    expected = "none" if edit.after is None else "the one of the bench"
    return mistake(str(path), f"another {edit.kind} {edit.name}", expected)


def _beginning(path: Path) -> bytes:
    """Return the byte order mark that some editors of Windows begin a file with, where it is there."""
    return codecs.BOM_UTF8 if read_bytes(path, LARGEST_FILE).startswith(codecs.BOM_UTF8) else b""
