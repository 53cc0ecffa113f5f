"""One more entry for a project that is already there: read, checked and named as in its file.

Rule: these are the loader's own readers, so what a file may not say, nobody may add either.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, Final

from trcvtui.blocks.parameters import PINS
from trcvtui.errors import Problem, UserError
from trcvtui.net.description import CONNECTIONS
from trcvtui.plc import project_parts as parts
from trcvtui.plc.combuffers import find_shared_ends, joined_up, read_combuffer
from trcvtui.plc.project import Project
from trcvtui.plc.project_keys import KIND_OF, Declaration, entry_of
from trcvtui.plc.project_names import WORDS, Names, find_duplicates
from trcvtui.plc.project_reader import Head, Reader
from trcvtui.plc.tables import Given, Table
from trcvtui.plc.tls_words import CertificateDecl, read_certificates

# Where the entries of a kind stand in a Project, and which kinds share their names with it.
FIELDS: Final = {
    "connect": "connects",
    "udp_config": "udp_configs",
    "addr": "addrs",
    "data": "data",
    "instance": "instances",
    "peer": "peers",
    "message": "messages",
    "sequence": "sequences",
    "combuffer": "combuffers",
    "certificate": "certificates",
}
SHARED_NAMES: Final = (("data", "instance"), ("connect", "udp_config", "peer", "combuffer"))
CHECKS: Final[dict[str, Callable[[Names, Table], None]]] = {
    "connect": Names.check_connect,
    "addr": Names.check_addr,
    "combuffer": Names.check_combuffer,
    "instance": Names.check_instance,
    "peer": Names.check_peer,
    "message": Names.check_message,
}
_GIVEN: Final = "--set "


def read_entry(kind: str, content: Mapping[str, Any], project: Project, where: str) -> Declaration:
    """Return the declaration of one table; raise UserError with all that is wrong with it.

    `content` holds TOML values, or the text of one as Given with the key as its path.
    """
    problems: list[Problem] = []
    table = Table(content, where, problems)
    for other in _sharing(kind):
        known = [Table({"name": name}, "", problems) for name in names_of(other, project)]
        find_duplicates([(other, known), (kind, [table])], reserved=WORDS if kind in SHARED_NAMES[0] else ())
        if problems:
            break
    if kind in CHECKS:
        CHECKS[kind](_names(project), table)
    if kind == "combuffer":
        known = [Table(dict(entry_of(b)), "", problems) for b in project.combuffers]
        find_shared_ends([*known, table])
    decl = _read(kind, table, project)
    if problems or decl is None:
        raise UserError(dict.fromkeys(_placed(problem, where) for problem in problems))
    return decl


def _sharing(kind: str) -> tuple[str, ...]:
    return next((kinds for kinds in SHARED_NAMES if kind in kinds), (kind,))


def _names(project: Project) -> Names:
    kinds = ("data", "connect", "peer", "udp_config", "addr", "combuffer")
    of_block = {block: _instances(block, project) for block in ("TRCV_C", "TSEND_C")}
    ports = tuple([buffer.name for buffer in project.combuffers if buffer.serial is not None])
    known = [*(names_of(kind, project) for kind in kinds), of_block["TRCV_C"], ports, of_block["TSEND_C"]]
    tasks = tuple(task.name for task in project.tasks)
    return Names(tasks, *known, describes=project.dialect.describes_connects)


def _instances(block: str, project: Project) -> tuple[str, ...]:
    return tuple([each.name for each in project.instances if each.block == block])


def _read(kind: str, table: Table, project: Project) -> Declaration | None:
    reader = Reader({}, table.where, project.base, table.problems)
    match kind:
        case "data":
            return reader.data(table, project.types, _head(project))
        case "instance":
            blocks = tuple(block for block in project.dialect.blocks if block in PINS)
            reader.check_pins(table, _head(project))
            return parts.read_instance(table, blocks, project.tasks[0].name, project.rules)
        case "connect":
            return reader.connect(table, len(project.connects) + 1, _head(project), project.certificates)
        case "combuffer":
            buffer = read_combuffer(table)
            return buffer and joined_up((buffer,), project.instances)[0]
        case "addr":
            return reader.addr(table, _head(project))
        case "certificate":
            return _certificate(table, project)
        case "peer":
            return parts.read_peer(table, project.certificates)
        case _:
            return _READERS[kind](table)


def _certificate(table: Table, project: Project) -> CertificateDecl | None:
    """Return one certificate; its number is its name, in the line that adds it."""
    found = next(iter(read_certificates([table], project.base).values()), None)
    if found is not None and found.number in project.certificates:
        table.wrong("number", f"{found.number}, which is there already", "a number of its own")
    return found


def structures_of(project: Project) -> tuple[str, ...]:
    """Return the connection descriptions that the instructions of this PLC take."""
    return project.dialect.structures or tuple(CONNECTIONS)


_READERS: Final[dict[str, Callable[[Table], Declaration | None]]] = {
    "udp_config": parts.read_udp_config,
    "message": parts.read_message,
    "sequence": parts.read_sequence,
}


def _head(project: Project) -> Head:
    return Head(project.dialect, project.model, dict(project.options), project.layout)


def _placed(problem: Problem, where: str) -> Problem:
    """Return a problem of a given text with the place where it was given."""
    if not problem.where.startswith(_GIVEN):
        return problem
    return replace(problem, where=f"{where}: {problem.where.removeprefix(_GIVEN)}")


def given(pairs: Iterable[tuple[str, str]]) -> dict[str, Given]:
    """Return texts such as `LocalPort=0` as the values of a table."""
    return {key: Given(key, text) for key, text in pairs}


def names_of(kind: str, project: Project) -> tuple[str, ...]:
    """Return the names of a project's entries of one kind."""
    return tuple([entry.name for entry in entries_of(kind, project)])


def entries_of(kind: str, project: Project) -> tuple[Declaration, ...]:
    """Return a project's entries of one kind."""
    found = getattr(project, FIELDS[kind])
    return tuple(found.values()) if isinstance(found, Mapping) else found


def with_entry(project: Project, decl: Declaration) -> Project:
    """Return the project with one more entry, the last of its kind."""
    if isinstance(decl, CertificateDecl):
        return replace(project, certificates={**project.certificates, decl.number: decl})
    field = FIELDS[KIND_OF[type(decl)]]
    changed: dict[str, Any] = {field: (*getattr(project, field), decl)}
    grown = replace(project, **changed)
    return replace(grown, combuffers=joined_up(grown.combuffers, grown.instances))
