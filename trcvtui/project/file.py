"""A project file read into a Project (contract 4.2): all of its mistakes together, or none."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from trcvtui.errors import Problem, UserError
from trcvtui.project.overrides import with_overrides
from trcvtui.project.project import Project
from trcvtui.project.reader import Reader
from trcvtui.project.tables import TEXT, Table, shown
from trcvtui.project.toml_file import read_toml

KEYS: Final = (
    "dialect", "model", "options", "task", "udt", "data", "connect", "udp_config", "addr", "instance", "peer",
    "message", "sequence", "certificate", "combuffer",
    "start", "program", "sim", "constants",
)  # fmt: skip


def load_project(path: Path | str, overrides: Iterable[str] = ()) -> Project:
    """Return the project of a file, `PATH=VALUE` overrides in it; raise UserError with all problems.

    Of a scenario file it is the project that the scenario runs on.
    """
    path = Path(path)
    document = read_toml(path)
    if document.pop("scenario", None) is not None:
        return _project_of(document, path, overrides)
    return read_project(document, str(path), path.parent, overrides)


def load_scenario_document(
    path: Path | str, overrides: Iterable[str] = ()
) -> tuple[Project, Mapping[str, Any]]:
    """Return the project of a scenario file and its `[scenario]` table, unread.

    The project is the file itself or, with `project = "other.toml"`, another file beside it.
    """
    path = Path(path)
    document = read_toml(path)
    scenario = document.pop("scenario", None)
    problems: list[Problem] = []
    if not isinstance(scenario, Mapping):
        found = "nothing" if scenario is None else shown(scenario)
        problems.append(Problem(f"{path}: scenario", found, "a table [scenario] with steps"))
    try:
        project = _project_of(document, path, overrides)
    except UserError as wrong:
        problems += wrong.problems
    if problems:
        raise UserError(problems)
    return project, scenario


def _project_of(document: dict[str, Any], path: Path, overrides: Iterable[str]) -> Project:
    if "project" not in document:
        return read_project(document, str(path), path.parent, overrides, also=("scenario",))
    table = Table(document, str(path), [])
    other = table.read("project", TEXT)
    table.know("scenario")
    table.finish('key beside project = "..."')
    if table.problems or other is None:
        raise UserError(table.problems)
    beside = path.parent / other
    named = read_toml(beside)
    # A scenario with a project of its own lends that one; who names another again is refused by that key.
    named.pop("scenario", None)
    return read_project(named, str(beside), beside.parent, overrides)


def read_project(
    document: Mapping[str, Any],
    where: str,
    base: Path,
    overrides: Iterable[str] = (),
    also: Iterable[str] = (),
) -> Project:
    """Return the project of a TOML document; raise UserError with all problems.

    `where` names the document in messages, `base` is where relative file names start, `also` are known keys
    that belong to somebody else.
    """
    problems: list[Problem] = []
    changed = with_overrides(document, overrides, problems)
    top = Table(changed, where, problems)
    top.know(*KEYS, *also)
    top.finish()
    return _checked(Reader(changed, where, base, problems), top)


def _checked(reader: Reader, top: Table) -> Project:
    head = reader.head(top)
    body = reader.body(head)
    sim = reader.sim()
    start = top.get("start", TEXT, "")
    program = top.get("program", TEXT, "")
    if reader.problems:
        # A bad UDT is told once, however many variables have it.
        raise UserError(dict.fromkeys(reader.problems))
    return Project(
        path=Path(reader.where),
        base=reader.base,
        dialect=head.dialect,
        model=head.model,
        connection_limit=head.dialect.models[head.model],
        options=head.options,
        rules=head.dialect.answer(head.options),
        layout=head.layout,
        types=body.types,
        tasks=body.tasks,
        data=body.data,
        connects=body.connects,
        instances=body.instances,
        peers=body.peers,
        start=start,
        program=program,
        sim=sim,
        udp_configs=body.udp_configs,
        addrs=body.addrs,
        messages=body.messages,
        sequences=body.sequences,
        constants=body.constants,
        udt_files=body.udt_files,
        certificates=body.certificates,
        combuffers=body.combuffers,
    )
