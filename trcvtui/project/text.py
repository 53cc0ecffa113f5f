"""Edits the text of a project file. Comments, order, quotes and blanks stay as they are.

Rule 1: a new entry follows the last entry of its kind if tomlkit can keep the rest of the text unchanged.
Else the new entry is at the end of the file. The loader reads the same project either way.
Rule 2: the new text is parsed and compared with the wanted document. A text that differs is not returned.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from trcvtui.errors import UserError, mistake
from trcvtui.project.key_rows import KeyValue
from trcvtui.project.keys import TABLES, entry_of, forms_of, kind_name
from trcvtui.project.project import Declaration, Edit
from trcvtui.project.tables import parse_toml

if TYPE_CHECKING:
    from tomlkit import TOMLDocument
    from tomlkit.items import AoT, Table

CRLF: Final = "\r\n"
FILE_KEYS: Final = {"udt": ("file",), "certificate": ("file", "key")}  # keys that name a file


def append_entries(text: str, decls: Sequence[Declaration], where: str) -> str:
    """Return the text with these entries added; raise UserError if they cannot be added."""
    wanted = parse_toml(text, where)
    for decl in decls:
        entries = wanted.setdefault(kind_name(decl), [])
        if isinstance(entries, list):
            entries.append(dict(entry_of(decl)))
    return _try_all(text, wanted, where, lambda plain: _insert_entries(plain, decls), _make_appender(decls))


def change_entry(text: str, edit: Edit, form: int, where: str) -> str:
    """Return the text with one entry changed or removed. Only the changed keys are written.

    `form` is the index of a form in `forms_of`. Raise UserError if the text cannot be changed.
    """
    wanted = parse_toml(text, where)
    _change_document(wanted, edit, form, lambda value: value)
    change = _document_edit(lambda document: _change_document(document, edit, form, _item))
    return _try_all(text, wanted, where, change)


def _change_document(document: Any, edit: Edit, form: int, item: Callable[[KeyValue], Any]) -> bool:
    called = TABLES[edit.kind].called
    entries = document.get(edit.kind, [])
    place = next((n for n, each in enumerate(entries) if str(each.get(called)) == edit.name), None)
    if place is None:
        return False
    if edit.after is None or edit.before is None:
        del entries[place]
        if not len(entries):
            del document[edit.kind]
        return True
    old, new = (dict(forms_of(decl)[form]) for decl in (edit.before, edit.after))
    for key in [key for key in old if key not in new]:
        entries[place].pop(key, None)
    for key, value in new.items():
        if old.get(key) != value:
            entries[place][key] = item(value)
    return True


def relocate_files(text: str, old: Path, new: Path, where: str) -> str:
    """Return a project's text for the folder `new`. Its UDTs and certificates stay in the folder `old`."""
    wanted = parse_toml(text, where)
    relocated = [
        (kind, number, key, relocate(entry[key], old, new))
        for kind, keys in FILE_KEYS.items()
        for number, entry in enumerate(wanted.get(kind, []))
        for key in keys
        if key in entry
    ]
    if all(wanted[kind][number][key] == path for kind, number, key, path in relocated):
        return text
    others = {wanted[kind][number][key]: path for kind, number, key, path in relocated}

    def change(document: Any) -> bool:
        for kind, number, key, path in relocated:
            document[kind][number][key] = path
        return True

    change(wanted)
    return _try_all(text, wanted, where, _document_edit(change), lambda plain: _replace_texts(plain, others))


def add_constants(text: str, constants: Mapping[str, int], where: str) -> str:
    """Return the text with these entries in its [constants]; raise UserError if they cannot be added."""
    wanted = parse_toml(text, where)
    table = wanted.setdefault("constants", {})
    if isinstance(table, dict):
        table |= constants
    lines = [f"{json.dumps(name)} = {number}\n" for name, number in constants.items()]
    at_the_end = "\n[constants]\n" + "".join(lines)

    def change(document: Any) -> bool:
        for name, number in constants.items() if "constants" in document else ():
            document["constants"][name] = number
        return "constants" in document

    return _try_all(text, wanted, where, _document_edit(change), lambda plain: plain + at_the_end)


def relocate(file: str, old: Path, new: Path) -> str:
    """Return the path of a file relative to the folder `new`; `file` is relative to `old`."""
    if Path(file).is_absolute():
        return file
    try:
        return os.path.relpath(os.path.realpath(old / file), os.path.realpath(new)).replace(os.sep, "/")
    except ValueError:  # another drive: Windows has no relative path there
        return os.path.realpath(old / file)


def _try_all(text: str, wanted: dict[str, Any], where: str, *edits: Callable[[str], str | None]) -> str:
    ends = CRLF if CRLF in text else "\n"
    plain = text.replace(CRLF, "\n")
    if plain.replace("\n", ends) != text:
        raise mistake(where, "lines that end with LF and with CRLF", "the same line ends in the whole file")
    plain += "\n" if plain and not plain.endswith("\n") else ""
    for edit in edits:
        edited = edit(plain)
        if edited is not None and _parses_as(edited, wanted):  # rule 2
            return edited.replace("\n", ends)
    raise mistake(where, "a form that cannot be extended", "tables such as [[connect]]")


def _parses_as(text: str, wanted: dict[str, Any]) -> bool:
    try:
        return parse_toml(text, "") == wanted
    except UserError:
        return False


# -- with tomlkit ----------------------------------------------------------------------------------------


def _parse_unchanged(plain: str) -> TOMLDocument | None:
    """Return the document, None if tomlkit would write its text differently."""
    import tomlkit  # only when saving: the import takes as long as two scans
    from tomlkit.exceptions import TOMLKitError

    try:
        document = tomlkit.parse(plain)
    except TOMLKitError:
        return None
    return document if document.as_string() == plain else None


def _insert_entries(plain: str, decls: Sequence[Declaration]) -> str | None:
    document = _parse_unchanged(plain)
    if document is None:
        return None
    from tomlkit.items import AoT

    new: list[Declaration] = []
    for decl in decls:
        entries = document.get(kind_name(decl))
        if isinstance(entries, AoT) and len(entries):
            _append_table(entries, _table(decl))
        else:
            new.append(decl)
    return _make_appender(new)(document.as_string())


def _document_edit(change: Callable[[TOMLDocument], bool]) -> Callable[[str], str | None]:
    """Return a function that returns a text with this change, None if the change is not possible."""

    def edit(plain: str) -> str | None:
        document = _parse_unchanged(plain)
        return document.as_string() if document is not None and change(document) else None

    return edit


def _append_table(entries: AoT, table: Table) -> None:
    from tomlkit.items import Comment, Whitespace

    body = entries[-1].value.body
    start = len(body)
    while start and isinstance(body[start - 1][1], Comment | Whitespace):
        start -= 1
    # Comments after the first blank line belong to what follows: they stay after the new table.
    blank = next((n for n in range(start, len(body)) if isinstance(body[n][1], Whitespace)), len(body))
    after = body[blank:]
    del body[blank:]
    body.append((None, Whitespace("\n")))
    table.value.body.extend(after)
    entries.append(table)


def _table(decl: Declaration) -> Table:
    import tomlkit

    table = tomlkit.table()
    for key, value in entry_of(decl):
        table.append(key, _item(value))
    return table


def _item(value: KeyValue) -> Any:
    import tomlkit

    match value:
        case str():
            is_literal = '"' in value and "'" not in value and value.isprintable()
            return tomlkit.string(value, literal=is_literal)
        case list():
            array = tomlkit.array()
            array.extend(map(_item, value))
            return array
        case _:
            return value


def _make_appender(decls: Sequence[Declaration]) -> Callable[[str], str]:
    def append(plain: str) -> str:
        tables = [f"\n[[{kind_name(decl)}]]\n{_table(decl).as_string()}" for decl in decls]
        return plain + "".join(tables)

    return append


def _replace_texts(plain: str, others: Mapping[str, str]) -> str:
    for old, new in others.items():
        plain = plain.replace(f"= {json.dumps(old)}", f"= {json.dumps(new)}")
    return plain
