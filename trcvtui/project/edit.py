"""Edits of a project: the fields of a form, a new entry, a changed entry, and how an edit is undone.

Rule: an entry is read as in a file, so a command cannot add what a file may not have.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from trcvtui.blocks.table import block_row
from trcvtui.errors import Problem, UserError
from trcvtui.project.file import (
    RESERVED_NAMES,
    NamesByKind,
    all_names,
    check_names,
    mark_used_buffers,
    report_duplicates,
    report_shared_ends,
    types_of_udts,
)
from trcvtui.project.key_rows import Hint, context_of
from trcvtui.project.keys import (
    EDITED,
    TABLES,
    UDT,
    entries_of,
    entry_of,
    forms_of,
    free_name,
    keys_of,
    kind_name,
    kinds_sharing_names,
    names_of,
    read_table,
    table_row,
)
from trcvtui.project.project import (
    CertificateDecl,
    ComBufferDecl,
    DataDecl,
    Declaration,
    Edit,
    Edits,
    Project,
    UdtFile,
)
from trcvtui.project.tables import Table
from trcvtui.udt.type_set import TypeSet


class FormRow(Struct, frozen=True):
    """One field of a form: its key, a hint, the values to choose from, and the value at first."""

    key: str
    hint: str
    choices: tuple[str, ...] = ()
    first: str = ""


class CommandKeys(NamedTuple):
    """Keys of a kind. Command lines have only the value of a `bare` key. `quoted` texts may have blanks."""

    bare: frozenset[str]
    quoted: frozenset[str]


def command_keys_of(kind: str, project: Project) -> CommandKeys:
    asks = [(row.name, row.ask) for row in table_row(kind, project.dialect).keys if row.ask]
    return CommandKeys(
        frozenset(name for name, ask in asks if ask.is_bare),
        frozenset(name for name, ask in asks if ask.is_quoted),
    )


def fields_of(kind: str, project: Project, block: str = "", to_change: bool = False) -> tuple[FormRow, ...]:
    """Return the form fields of a kind except the name. The fields of an instance depend on its block."""
    row, chosen = table_row(kind, project.dialect), block or default_block(project)
    fields = {
        key.name: _field(key.name, key.ask, project, chosen)
        for key in row.keys
        if key.ask and key.ask.where(project, chosen) and (to_change or not key.ask.is_of_change)
    }
    first = [fields.pop(name) for name in row.asks_first]
    return (*first, *fields.values())


def _field(key: str, ask: Hint, project: Project, block: str) -> FormRow:
    hint = ask.hint if isinstance(ask.hint, str) else ask.hint(project, block)
    first = ask.first if isinstance(ask.first, str) else ask.first(project, block)
    return FormRow(key, hint, ask.choices(project, block), first)


def default_block(project: Project) -> str:
    """Return the block that a form begins with. The first instance gets one that connects and receives."""
    blocks = project.dialect.blocks
    receivers = [block for block in blocks if (row := block_row(block)).owns_link and row.receives_on_net]
    return receivers[0] if receivers and not project.instances else blocks[0]


def propose_name(kind: str, project: Project, block: str = "") -> str:
    if kind == "certificate":
        return str(max(project.certificates, default=0) + 1)
    start = f"{block or default_block(project)}_" if kind == "instance" else TABLES[kind].first_name
    return free_name(kind, start, project)


_SET_PREFIX: Final = "--set "
CERTIFICATE: Final = "certificate"
CERTIFICATE_REFS: Final = ("TLSServerCertRef", "TLSClientCertRef")
MOST_UNDOABLE: Final = 20


def read_entry(
    kind: str, content: Mapping[str, Any], project: Project, where: str, number: int = 0
) -> Declaration:
    """Return the declaration of one table; raise UserError with all mistakes in the table.

    `content` has TOML values, or texts as SetOverride with the key as path. `number` is the place of the
    entry among those of its kind, from 1. If `number` is 0, the entry comes last.
    """
    problems: list[Problem] = []
    table = Table(content, where, problems)
    for other in kinds_sharing_names(kind) if kind != CERTIFICATE else ():
        known = [Table({TABLES[other].called: name}, "", problems) for name in names_of(other, project)]
        reserved = RESERVED_NAMES if "data" in kinds_sharing_names(kind) else ()
        report_duplicates([(other, known), (kind, [table])], reserved=reserved)
        if problems:
            break
    around = context_of(project)
    check_names(kind, table, _names(project), around)
    if kind == "combuffer":
        known = [Table(dict(entry_of(b)), "", problems) for b in project.combuffers]
        report_shared_ends([*known, table])
    decl = read_table(kind, table, around, number or len(entries_of(kind, project)) + 1)
    if isinstance(decl, ComBufferDecl):
        decl = mark_used_buffers((decl,), project.instances)[0]
    elif isinstance(decl, CertificateDecl) and decl.number in project.certificates:
        table.report("number", f"{decl.number}, which another certificate has", "an unused number", "taken")
    if problems or decl is None:
        raise UserError(dict.fromkeys(_relocate_problem(problem, where) for problem in problems))
    found: Declaration = decl
    return found


def _names(project: Project) -> NamesByKind:
    blocks = [(each.name, each.block) for each in project.instances]
    ports = tuple([buffer.name for buffer in project.combuffers if buffer.serial is not None])
    names = {kind: names_of(kind, project) for kind in TABLES}
    return all_names(names, blocks, ports, project.dialect.describes_connects)


def _relocate_problem(problem: Problem, where: str) -> Problem:
    if not problem.where.startswith(_SET_PREFIX):
        return problem
    return replace(problem, where=f"{where}: {problem.where.removeprefix(_SET_PREFIX)}")


def find_entry(kind: str, name: str, project: Project) -> Declaration | None:
    return next((each for each in entries_of(kind, project) if each.name == name), None)


def find_kinds(name: str, project: Project) -> tuple[str, ...]:
    """Return the kinds that have an entry of this name; certificates have numbers, and do not count."""
    return tuple([kind for kind in EDITED if kind != CERTIFICATE and name in names_of(kind, project)])


# -- edits -----------------------------------------------------------------------------------------------


def make_addition(decl: Declaration, project: Project) -> Edit:
    """Return the edit that adds an entry as the last one of its kind."""
    kind = kind_name(decl)
    return Edit(kind, None, decl, len(entries_of(kind, project)))


def make_change(before: Declaration, after: Declaration | None, project: Project) -> Edit:
    """Return the edit that replaces an entry by `after`, or that removes the entry if `after` is None."""
    kind = kind_name(before)
    return Edit(kind, before, after, names_of(kind, project).index(before.name))


def apply_edits(project: Project, edits: Edits) -> Project:
    for edit in edits:
        found = [each for each in entries_of(edit.kind, project) if each.name != edit.name]
        if edit.after is not None:
            found.insert(edit.place, edit.after)
        kept: Any = tuple(found)
        if edit.kind == CERTIFICATE:
            kept = {each.number: each for each in found if isinstance(each, CertificateDecl)}
        changed: dict[str, Any] = {TABLES[edit.kind].field: kept}
        project = replace(project, **changed)
    if any(edit.kind == UDT.kind for edit in edits):
        project = replace(project, types=types_of_project(project))
    return replace(project, combuffers=mark_used_buffers(project.combuffers, project.instances))


def types_of_project(project: Project) -> TypeSet:
    """Return the types of the project's UDT files; raise UserError if a file declares no types."""
    constants, has_system_types = tuple(project.constants.items()), project.dialect.describes_connects
    return types_of_udts(project.udts, project.base, constants, has_system_types)


def apply_as_step(project: Project, edits: Edits) -> Project:
    """Return the project after these edits, which `undo` takes back as one step."""
    return replace(apply_edits(project, edits), undoable=(*project.undoable, edits)[-MOST_UNDOABLE:])


def inverse_edits(project: Project) -> Edits:
    """Return the edits that undo the newest step, or none if there is no step."""
    return tuple([edit.inverse for edit in reversed(project.undoable[-1])]) if project.undoable else ()


def undo_step(project: Project) -> Project:
    return replace(apply_edits(project, inverse_edits(project)), undoable=project.undoable[:-1])


def append_entry(project: Project, decl: Declaration) -> Project:
    """Return the project with one more entry, the last of its kind."""
    return apply_edits(project, (make_addition(decl, project),))


def read_changed(decl: Declaration, pairs: Mapping[str, Any], project: Project, where: str) -> Declaration:
    """Return a declaration with some keys changed; None removes a key. Raise UserError if it is invalid.

    The entry is written in the first of its equivalent forms that can be read with the changes.
    """
    edit = make_change(decl, None, project)
    others = apply_edits(project, (edit,))
    first: UserError | None = None
    for own in _equivalent_forms(decl, edit, others):
        changed = own | dict(pairs)
        if "LocalPort" in pairs and "ListenPort" not in pairs:
            changed.pop("ListenPort", None)  # else the bench would not listen on the new LocalPort
        kept = {key: value for key, value in changed.items() if value is not None}
        try:
            return read_entry(edit.kind, kept, others, where, edit.place + 1)
        except UserError as wrong:
            first = first or wrong
    raise first or UserError([Problem(where, "an entry that cannot be written", "add and remove")])


def changeable_keys(decl: Declaration, project: Project) -> dict[str, Any]:
    """Return the keys of a declaration in the form that `read_changed` uses."""
    edit = make_change(decl, None, project)
    own = next(_equivalent_forms(decl, edit, apply_edits(project, (edit,))), dict(keys_of(decl)))
    return {key: value for key, value in own.items() if key != TABLES[edit.kind].called}


def _equivalent_forms(decl: Declaration, edit: Edit, others: Project) -> Iterator[dict[str, Any]]:
    for form in forms_of(decl):
        own = dict([entry_of(decl)[0], *form])
        if _reads_same(edit, own, others, decl):
            yield own


def _reads_same(edit: Edit, content: Mapping[str, Any], others: Project, decl: Declaration) -> bool:
    try:
        return is_same_entry(read_entry(edit.kind, content, others, "", edit.place + 1), decl)
    except UserError:
        return False


def is_same_entry(decl: Declaration, other: Declaration) -> bool:
    # By their keys: each reading makes a new layout, and a ComBuffer's is_written, is_fed depend on others.
    if isinstance(decl, DataDecl | ComBufferDecl | UdtFile):
        return decl.name == other.name and keys_of(decl) == keys_of(other)
    return decl == other


def diff_projects(before: Project, after: Project) -> Edits:
    """Return the edits that turn the entries of one project into those of another."""
    found: list[Edit] = []
    for kind in EDITED:
        old = {each.name: each for each in entries_of(kind, before)}
        new = {each.name: each for each in entries_of(kind, after)}
        found += [make_change(each, None, before) for name, each in old.items() if name not in new]
        for place, (name, each) in enumerate(new.items()):
            was = old.get(name)
            if was is None or not (was is each or is_same_entry(was, each)):
                found.append(Edit(kind, was, each, place))
    return tuple(found)


def find_broken_users(edits: Edits, project: Project) -> list[tuple[Declaration, UserError]]:
    """Return the entries that these edits would make invalid, each with the reason."""
    after = apply_edits(project, edits)
    gone, kinds = {(edit.kind, edit.name) for edit in edits}, {edit.kind for edit in edits}
    found = _find_certificate_users(edits, after)
    for kind in EDITED:
        for place, each in enumerate(entries_of(kind, after), 1):
            uses_type = kind == "data" and UDT.kind in kinds
            if (kind, each.name) in gone or not (uses_type or _mentions(each, [e.name for e in edits])):
                continue
            wrong = _find_refusal(each, kind, place, after)
            if wrong is not None and _find_refusal(each, kind, place, project) is None:
                found.append((each, wrong))
    return found


def _find_certificate_users(edits: Edits, after: Project) -> list[tuple[Declaration, UserError]]:
    numbers = {edit.name for edit in edits if edit.kind == CERTIFICATE and edit.before is not None}
    refs = (*CERTIFICATE_REFS, "certificate", "authority")
    having: tuple[Declaration, ...] = (*after.connects, *after.peers)
    return [
        (each, UserError([Problem(each.name, f"certificate {value}", "the one that it has")]))
        for each in having
        for key, value in forms_of(each)[-2:][0]
        if key in refs and str(value) in numbers
    ]


def _mentions(decl: Declaration, names: list[str]) -> bool:
    texts = [str(value) for _, value in keys_of(decl)]
    return any(name in text for name in names for text in texts)


def _find_refusal(decl: Declaration, kind: str, number: int, project: Project) -> UserError | None:
    others = apply_edits(project, (make_change(decl, None, project),))
    try:
        read_entry(kind, dict(entry_of(decl)), others, "", number)
    except UserError as wrong:
        return wrong
    return None
