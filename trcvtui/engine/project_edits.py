"""The edits of the opened project, which of them are in a file, and `save project [FILE] [!]`.

Rule: `create`, `delete` and `resize` change the program that runs. `add`, `set` of a part, `remove` and
`undo` also change the project, and `save project` writes only these edits. Present inputs, DATA and
faults belong to the session, which `save scenario` writes.
Rule of saving 1: the present text of the file is edited, so that changes by other programs stay.
Rule of saving 2: the new text is loaded before it is written; it replaces the old text in one step.
Rule of saving 3: if FILE is another file, it gets the text last opened or saved, with the bench's edits.
"""

from __future__ import annotations

import codecs
import os
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, TextIO

from msgspec.structs import replace

from trcvtui.commands.reader import project_after
from trcvtui.commands.table import format_command, parse_line
from trcvtui.commands.words import EDIT_COMMANDS, EditCommand
from trcvtui.dialects import DIALECTS
from trcvtui.errors import Problem, UserError, mistake
from trcvtui.files import FileName, make_folder, read_bounded, write_file
from trcvtui.paths import configs_path, demo_path
from trcvtui.project.edit import diff_projects, find_entry, is_same_entry
from trcvtui.project.file import read_project
from trcvtui.project.keys import EDITED, forms_of, names_of
from trcvtui.project.project import Edit, Edits, Project, UdtFile
from trcvtui.project.tables import LARGEST_FILE, parse_toml, quote, read_text
from trcvtui.project.text import add_constants, append_entries, change_entry, relocate, relocate_files
from trcvtui.scenario.recorded_session import SUFFIX, parse_toml_path
from trcvtui.scenario.scenario import check_bench_commands
from trcvtui.wording import count

DEFAULT_DIALECT: Final = "baosky"
NO_WORDS: Final = ("n", "no", "q")
YES_WORDS: Final = ("", "y", "yes")
MOST_QUESTIONS: Final = 5
PROJECT_TEMPLATE: Final = """# a bench of trcvtui; `save project` writes here what is added on the screen
dialect = "{dialect}"
"""


def can_create_project(path: Path) -> bool:
    """Return whether a project can be created: the file is empty, or missing in an existing folder."""
    if path.suffix != SUFFIX:
        return False
    if not os.path.lexists(path):
        return path.parent.is_dir()
    return path.is_file() and path.stat().st_size == 0


def offer_project(path: Path, answers: TextIO, talk: TextIO) -> bool:
    """Ask for the PLC of a new project, and write the project; return whether it was written."""
    names = [DEFAULT_DIALECT, *(name for name in DIALECTS if name != DEFAULT_DIALECT)]
    state = "is empty" if path.exists() else "does not exist"
    talk.write(f"{path} {state}. Create it for which PLC?\n")
    for number, name in enumerate(names, 1):
        talk.write(f"  {number}  {name:<16}{DIALECTS[name].title}\n")
    for _ in range(MOST_QUESTIONS):
        talk.write(f"enter: create it for {DEFAULT_DIALECT}; a number or a name: for that one; n: nothing > ")
        talk.flush()
        line = answers.readline()
        word = line.strip().lower()
        if not line or word in NO_WORDS:
            break
        chosen = _parse_choice(word, names)
        if chosen:
            write_file(path, PROJECT_TEMPLATE.format(dialect=chosen), "trcvtui run", is_own=True)
            return True
    talk.write("\nnothing was written\n")
    return False


def _parse_choice(word: str, names: list[str]) -> str:
    if word in YES_WORDS:
        return DEFAULT_DIALECT
    if word.isascii() and word.isdigit() and 0 < int(word[:6]) <= len(names):
        return names[int(word[:6]) - 1]
    return word if word in names else ""


FORCE: Final = "!"


def parse_save_target(words: str, own: Path, written: Collection[str], where: str) -> Path:
    """Return the file that `[FILE] [!]` names. Raise UserError for an existing foreign file without `!`."""
    name = words.strip()
    is_forced = name.endswith(FORCE)
    name = name.removesuffix(FORCE).strip()
    if not name:
        refuse_shipped_file(own, where)
        return own
    path = parse_toml_path(name, where)
    if not name.strip("\"'").endswith(SUFFIX):
        raise mistake(where, quote(name), f"a name that ends in {SUFFIX}")
    whole = os.path.realpath(path)
    is_ours = whole in written or whole == os.path.realpath(own)
    if is_ours:
        refuse_shipped_file(path, where)
    elif not is_forced and os.path.lexists(path):
        expected = f"the name of a new file, or `save project {name} {FORCE}` to write over it"
        raise mistake(where, f"{path}, which is there already", expected)
    return path


def refuse_shipped_file(path: Path, where: str) -> None:
    """Raise UserError if a file's path is in a folder of trcvtui itself, whether or not the file exists."""
    here = Path(os.path.realpath(path))
    if any(here.is_relative_to(os.path.realpath(folder)) for folder in (demo_path().parent, configs_path())):
        raise mistake(where, f"{here.name}, which came with trcvtui", "save project FILE, a file of your own")


def apply_edits(
    text: str, own: Path, path: Path, edits: Edits, constants: Mapping[str, int]
) -> tuple[str, Project]:
    """Return `text` with the edits, and its project loaded as file `path`. Raise UserError for mistakes."""
    added = [edit.after for edit in edits if edit.before is None and edit.after is not None]
    if added:
        text = append_entries(text, added, str(own))
    for edit in edits:
        if edit.before is not None:
            text = _apply_edit(text, edit, own, path)
    if constants:
        text = add_constants(text, constants, str(own))
    loaded = _load_edited(text, path, edits)
    if any(loaded.constants.get(name) != number for name, number in constants.items()):
        raise mistake(str(path), "other constants", "the ones that were given")
    return text, loaded


def _apply_edit(text: str, edit: Edit, own: Path, path: Path) -> str:
    refused: UserError | None = None
    for form in range(len(forms_of(edit.after)) if edit.after is not None else 1):
        try:
            changed = change_entry(text, edit, form, str(own))
            if edit.after is None or _is_applied(edit, _read_project(changed, path)):
                return changed
        except UserError as wrong:
            refused = refused or wrong
    raise refused or _mismatch_error(edit, path)


def _read_project(text: str, path: Path) -> Project:
    document = parse_toml(text, str(path))
    document.pop("scenario", None)
    return read_project(document, str(path), path.parent)


def _load_edited(text: str, path: Path, edits: Edits) -> Project:
    """Return the project read from the text; raise UserError if an edit is missing or wrong there."""
    loaded = _read_project(text, path)
    check_bench_commands(loaded)
    for edit in edits:
        if not _is_applied(edit, loaded):
            raise _mismatch_error(edit, path)
    return loaded


def _is_applied(edit: Edit, loaded: Project) -> bool:
    found = find_entry(edit.kind, edit.name, loaded)
    return found is None if edit.after is None else found is not None and is_same_entry(edit.after, found)


def _mismatch_error(edit: Edit, path: Path) -> UserError:
    expected = "none" if edit.after is None else "the one of the bench"
    return mistake(str(path), f"another {edit.kind} {edit.name}", expected)


PROMPT = "prompt"


class ProjectEdits:
    """The opened project with its edits. `done` counts edits. `saved` is that count at the last save."""

    def __init__(self, project: Project) -> None:
        self.project = project
        self.done = self.saved = 0
        self.before: str | None = None  # the file's text when the bench began; None until a save
        self._begun_from_file = True
        self._in_file = project
        self._edits: Edits = ()  # from the project in the file to the present one
        self._constants: dict[str, int] = {}  # given since the project was opened, or saved
        self._written: set[str] = set()  # real paths
        self._inode = 0
        self._keep_text(self.read_file_text())

    @property
    def unsaved_count(self) -> int:
        """Return how many entries and new constants of the project differ from the file."""
        return len(self._edits) + len(self._constants)

    @property
    def unsaved_noun(self) -> str:
        return "addition" if all(edit.before is None for edit in self._edits) else "change"

    def read_file_text(self) -> str:
        """Return the present text of the file, "" if it cannot be read. `text` is the text kept earlier."""
        return _text_of(self.project.path)

    def note_new_bench(self) -> None:
        self.before, self._begun_from_file = None, self.saved == self.done

    def parse_own_edit(self, command: EditCommand) -> EditCommand:
        """Return the command, parsed for this project; raise UserError if the project refuses it."""
        mine = parse_line(format_command(command), self.project, PROMPT)
        assert isinstance(mine, EDIT_COMMANDS)
        check_bench_commands(project_after(mine, self.project))
        return mine

    def add_edit(self, command: EditCommand) -> None:
        self.project = project_after(command, self.project)
        self._edits = diff_projects(self._in_file, self.project)
        self.done += 1

    def accept_types(self, fresh: Project, constants: Mapping[str, int]) -> None:
        known = names_of("udt", self.project)
        by_hand = [each for each in fresh.udts if each.name not in known]  # these are in the file
        self._in_file = replace(self._in_file, udts=(*self._in_file.udts, *by_hand))
        self.project = replace(self.project, types=fresh.types, constants=fresh.constants, udts=fresh.udts)
        self._constants |= constants
        self._keep_text(self.text)

    def save(self, words: str) -> str:
        """Write the project to `[FILE] [!]`; return the message. Raise UserError if saving is refused."""
        own = self.project.path
        path = parse_save_target(words, own, self._written, PROMPT)
        if not path.parent.is_dir():
            raise mistake(PROMPT, f"{path}: no folder {path.parent}", "a file that can be written")
        is_own, fault = os.path.realpath(path) == os.path.realpath(own), self._find_obstacle()
        if is_own and fault and not self.text:
            raise mistake(PROMPT, f"{own}, which is no file", "a project that was opened from a file")
        if is_own and fault and not words.rstrip().endswith(FORCE):
            raise mistake(
                fault.where, fault.found, f"{fault.expected}; `save project {FORCE}` writes it anew"
            )
        if is_own and not fault and not self.unsaved_count:
            return f"nothing was added to {path}" if not self.done else f"nothing is unsaved in {path}"
        message = f"the project with {count(self.unsaved_count, self.unsaved_noun)} in {path.absolute()}"
        text = self.text if fault or not is_own else read_text(own)
        if fault or self.read_file_text() != text:
            now = f"{fault.where}: found {fault.found}" if fault else f"{own} has changed"
            message += f", on the text that was read before ({now})"
        before = self.text if self.before is None and self._begun_from_file else self.before
        old = own.parent if own.parent.is_dir() else path.parent  # files of a folder that is gone come along
        self._restore_types(old)
        text = relocate_files(text, old, path.parent, str(own))
        edits = _move_part(self._edits, old, path.parent)
        text, new = apply_edits(text, own, path, edits, self._constants)
        bom = codecs.BOM_UTF8 if _read_content(own).startswith(codecs.BOM_UTF8) else b""  # of Windows
        write_file(path, bom + text.encode(), PROMPT, is_own=True)
        self.before = before and relocate_files(before, old, path.parent, str(own))
        self._written.add(os.path.realpath(path))
        self._constants.clear()
        self.saved = self.done
        self.project = move_project(self.project, new.path)
        self._in_file, self._edits = self.project, ()
        self._keep_text(text)
        return message

    def _keep_text(self, text: str) -> None:
        """Store the text of the file, in case the file is missing later."""
        self.text = text
        with suppress(OSError):
            self._inode = os.stat(self.project.path).st_ino if text else 0

    def _restore_types(self, folder: Path) -> None:
        """Write each missing type file again. The names of type files are relative to `folder`."""
        for each in self.project.udts:
            place = folder / each.name
            if each.content and not place.exists():
                make_folder(place.parent, PROMPT)
                write_file(place, each.content, PROMPT, is_new=True)

    def _find_obstacle(self) -> Problem | None:
        """Return why the edits cannot be written, such as a missing file; None if they can be written."""
        own, was = self.project.path, self._in_file
        try:
            text = read_text(own)
            now = _read_project(text, own)
            kept = [(kind, name) for kind in EDITED for name in names_of(kind, was)]
            is_left = not kept or any(name in names_of(kind, now) for kind, name in kept)
            if not is_left or now.dialect.name != was.dialect.name:
                raise mistake(str(own), "another project", "the one of the bench")
            apply_edits(text, own, own, self._edits, self._constants)
            return None
        except UserError as wrong:
            first = wrong.problems[0]
        with suppress(OSError):
            for each in [] if os.path.lexists(own) else [*os.scandir(own.parent)]:
                if each.inode() == self._inode and _text_of(each.path) == self.text:  # it was renamed
                    return replace(first, found=f"{each.name}, its new name")
        return first


def move_project(project: Project, path: Path) -> Project:
    """Return the project moved to another file; its UDT files get names relative to the new folder."""
    new = path.parent
    old = project.base if project.base.is_dir() else new  # else its files have come along
    parts = {key: _move_part(getattr(project, key), old, new) for key in ("udts", "undoable")}
    return replace(project, path=path, base=new, **parts)


def _move_part(part: Any, old: Path, new: Path) -> Any:
    if isinstance(part, UdtFile):
        return replace(part, name=relocate(part.name, old, new))
    if isinstance(part, Edit):
        return replace(part, before=_move_part(part.before, old, new), after=_move_part(part.after, old, new))
    return tuple([_move_part(each, old, new) for each in part]) if isinstance(part, tuple) else part


def _read_content(path: FileName) -> bytes:
    with suppress(OSError, ValueError):
        return read_bounded(path, LARGEST_FILE)
    return b""


def _text_of(path: FileName) -> str:
    return _read_content(path).decode("utf-8-sig", "replace")
