"""Reads a project file into a Project, or reports all of its mistakes together.

Rule 1: a value is refused only if no type can hold it. The block judges any value of a pin or a CONNECT.
Rule 2: an instance and a DATA variable may not share a name, because `expect NAME` takes both kinds.
CONNECTs, UDP_CONFIGs and peers may not share a name, because `@NAME` takes all three. No instance or DATA
may have the name `peer`, which is a word of the bench commands.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from msgspec.structs import replace

from trcvtui.blocks.table import block_row
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.dialect import Dialect, SwitchValue, read_switches
from trcvtui.errors import Problem, UserError, collect_problems, raise_all_problems
from trcvtui.project.key_rows import ReadContext, context_of
from trcvtui.project.keys import SIM_ROW, TABLES, TOP_ROW, UDT, kinds_sharing_names, read_table, table_row
from trcvtui.project.project import SERIAL, SIMULATED, ComBufferDecl, InstanceDecl, Project, Task, UdtFile
from trcvtui.project.tables import (
    LINT,
    TEXT,
    SetOverride,
    Table,
    expected_name,
    parse_reference,
    quote,
    read_toml,
    with_article,
)
from trcvtui.udt.layout.rules import rules_for
from trcvtui.udt.sources import content_of, read_files
from trcvtui.udt.type_set import NO_TYPES, TypeSet

DEEPEST_NAME: Final = 8  # Lib.Ns.GVL.MAX has 3 dots
RESERVED_NAMES: Final = ("peer",)
NamesByKind = Mapping[str, Mapping[str, None]]  # by kind, and by use such as `stream_in`; in order

# Keys whose value only one ComBuffer may have: what was found with the first user {}, what was expected.
BUFFER_ENDS: Final = (
    ("source", "whose bytes go to {}", "an unused source: each byte goes to only one ComBuffer"),
    ("line", "which sends the bytes of {}", "an unused line: a line sends for only one ComBuffer"),
    ("port", "the port of {}", "an unused port"),
)


def report_duplicates(kinds: Iterable[tuple[str, Sequence[Table]]], reserved: Iterable[str] = ()) -> None:
    """Report each name that is a reserved word, or that an earlier table of these kinds has."""
    seen = dict.fromkeys(reserved, "a word of the bench commands")
    for kind, tables in kinds:
        for table in tables:
            called = TABLES[kind].called
            name = table.peek(called)
            if not isinstance(name, str):
                continue
            if name in seen:
                table.report(called, f"{quote(name)}, {seen[name]}", "an unused name", "taken")
            seen.setdefault(name, f"which {with_article(TABLES[kind].what)} already has")


def all_names(
    names: Mapping[str, tuple[str, ...]],
    blocks: Iterable[tuple[str, str]],
    ports: tuple[str, ...],
    describes: bool,
) -> NamesByKind:
    """Return the names that keys may refer to, by kind and by use.

    `blocks` has pairs of an instance's name and its block. `ports` are the ComBuffers that have a port.
    Instances in `stream_in` can feed a ComBuffer, those in `stream_out` can empty one. `udp_end` has the
    UDP_CONFIGs; if `describes`, also the CONNECTs, since a description can be for UDP.
    """
    builders = [(name, row) for name, block in blocks if (row := block_row(block)).owns_link]
    found = {
        "stream_in": tuple([name for name, row in builders if row.receives_on_net]),
        "stream_out": tuple([name for name, row in builders if row.sends_on_net]),
    }
    ends = (*names["udp_config"], *(names["connect"] if describes else ()))
    found = {**names, **found, "port": ports, "udp_end": ends, "task": names["task"] or ("MAIN",)}
    return {of: dict.fromkeys(each) for of, each in found.items()}


def check_names(kind: str, table: Table, names: NamesByKind, around: ReadContext) -> None:
    """Report every key of a table that refers to an unknown name."""
    rows = table_row(kind, around.dialect).keys
    own = table.peek("name") if kind == "combuffer" else None
    references = [(row.name, row.refers) for row in rows if row.refers and row.only(table, around)]
    for key, refers in dict.fromkeys(references):
        text = table.text(key)
        name = parse_reference(text) if refers.by_at else text
        if name is None or (refers.or_none and not name):
            continue
        if name in refers.words or (name != own and any(name in names[of] for of in refers.kinds)):
            continue
        known = [*refers.words, *(each for of in refers.kinds for each in names[of] if each != own)]
        table.report_unknown_name(key, name, known, refers.what)


def report_shared_ends(tables: Sequence[Table]) -> None:
    """Report a source, line or port that two ComBuffers have, or a source ComBuffer that has a line."""
    for key, has, expected in BUFFER_ENDS:
        seen: dict[str, str] = {}
        for table in tables:
            end, name = table.text(key), table.text("name")
            if not end or not name or end in (SIMULATED, SERIAL) or (key == "port" and "://" in end):
                continue  # these can be used several times; each opening of a URL is a new connection
            if end in seen:
                table.report(key, f"{quote(end)}, {has.format(seen[end])}", expected)
            seen.setdefault(end, name)
    lines = {table.text("name"): table.text("line") for table in tables}
    for table in tables:
        source = table.text("source")
        if source and lines.get(source):
            found = f"{quote(source)}, which goes out over {lines[source]}"
            table.report("source", found, "a ComBuffer without a line")


def mark_used_buffers(
    buffers: Iterable[ComBufferDecl], instances: tuple[InstanceDecl, ...]
) -> tuple[ComBufferDecl, ...]:
    written = {i.connect for i in instances if block_row(i.block).writes_tx_buffer}
    names = {i.name for i in instances}
    return tuple([replace(b, is_written=b.name in written, is_fed=b.source in names) for b in buffers])


# --set PATH=VALUE: its value is checked as one in the file is; the place of its mistakes is `--set PATH`.

TOP_KEYS: Final = ("dialect", "model", "start")
SET_SECTIONS: Final = ("options", "sim")
BLACK_BOX: Final = "black_box"
SET_FORM: Final = "PATH=VALUE such as connect.C1.LocalPort=2000 or options.retry=T#100ms"


def apply_overrides(
    document: Mapping[str, Any], overrides: Iterable[str], problems: list[Problem]
) -> dict[str, Any]:
    """Return a copy of the document, changed by every `PATH=VALUE`. The last value for a path counts."""
    changed = {key: _copy_part(value) for key, value in document.items()}
    for override in overrides:
        path, equals, text = override.partition("=")
        path = path.strip()
        if not equals or not path:
            problems.append(Problem("--set", quote(override), SET_FORM))
            continue
        problem = _set_path(changed, path, SetOverride(path, text.strip()))
        if problem is not None:
            problems.append(problem)
    return changed


def _copy_part(part: Any) -> Any:
    if isinstance(part, list):
        return [dict(entry) if isinstance(entry, dict) else entry for entry in part]
    return dict(part) if isinstance(part, dict) else part


def _set_path(document: dict[str, Any], path: str, value: SetOverride) -> Problem | None:
    match path.split("."):
        case [key] if key in TOP_KEYS:
            document[key] = value
        case ["constants", *parts] if parts:
            table = document.setdefault("constants", {})
            if isinstance(table, dict):
                table[".".join(parts)] = value
        case [section, key] if section in SET_SECTIONS:
            table = document.setdefault(section, {})
            if isinstance(table, dict):
                table[key] = value
        case [kind, name, key] if kind in TABLES and key != "name":
            return _set_key(document, kind, name, key, value)
        case [first, *_]:
            known = (*TOP_KEYS, *SET_SECTIONS, *TABLES, "constants")
            expected = SET_FORM if first in known else expected_name(first, known, "part of a project")
            return Problem(f"--set {path}", quote(first if first not in known else path), expected)
    return None


def _set_key(document: dict[str, Any], kind: str, name: str, key: str, value: SetOverride) -> Problem | None:
    if kind == "task" and "task" not in document:
        document["task"] = [{"name": "MAIN"}]  # the default task exists without a table, so it can be set
    tables = document.get(kind)
    entries = [t for t in tables if isinstance(t, dict)] if isinstance(tables, list) else []
    for entry in entries:
        if entry.get("name") == name:
            entry[key] = value
            return None
    names = [entry["name"] for entry in entries if isinstance(entry.get("name"), str)]
    return Problem(f"--set {value.path}", quote(name), expected_name(name, names, kind))


# -- a file ------------------------------------------------------------------------------------------------

DOCUMENT_KEYS: Final = (
    "dialect", "model", "options", *TABLES, "start", "program", "sim", "constants",
)  # fmt: skip


def load_project(path: Path | str, overrides: Iterable[str] = ()) -> Project:
    """Return the project of a file with `PATH=VALUE` overrides; raise UserError with all problems.

    For a scenario file, return the project that the scenario runs on.
    """
    path = Path(path)
    document = read_toml(path)
    if document.pop("scenario", None) is not None:
        return _read_scenario_project(document, path, overrides)
    return read_project(document, str(path), path.parent, overrides)


def load_scenario_document(
    path: Path | str, overrides: Iterable[str] = ()
) -> tuple[Project, Mapping[str, Any]]:
    """Return the project of a scenario file, and its `[scenario]` table as it is.

    The project is in the file itself or, with `project = "other.toml"`, in another file.
    """
    path = Path(path)
    document = read_toml(path)
    scenario = document.pop("scenario", None)
    with raise_all_problems() as problems:
        if not isinstance(scenario, Mapping):
            found = "nothing" if scenario is None else quote(scenario)
            problems.append(Problem(f"{path}: scenario", found, "a table [scenario] with steps"))
        with collect_problems(problems):
            project = _read_scenario_project(document, path, overrides)
    return project, scenario


def _read_scenario_project(document: dict[str, Any], path: Path, overrides: Iterable[str]) -> Project:
    if "project" not in document:
        return read_project(document, str(path), path.parent, overrides, also=("scenario",))
    table = Table(document, str(path), [])
    other = table.read("project", TEXT)
    table.mark_known("scenario")
    table.report_unread_keys('key beside project = "..."')
    if table.problems or other is None:
        raise UserError(table.problems)
    beside = path.parent / other
    named = read_toml(beside)
    # The other file may be a scenario with its own project; one that names a third file is refused below.
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

    `where` is the name of the document in messages. Relative file names start at `base`. `also` are further
    keys, which the caller reads itself.
    """
    problems: list[Problem] = []
    changed = apply_overrides(document, overrides, problems)
    top = Table(changed, where, problems)
    top.mark_known(*DOCUMENT_KEYS, *also)
    top.report_unread_keys()
    return DocumentReader(changed, where, base, problems).project(top)


class DocumentReader:
    """Reads one document; each method collects problems, and replaces a wrong value by a harmless one."""

    def __init__(self, document: dict[str, Any], where: str, base: Path, problems: list[Problem]) -> None:
        self.document = document
        self.where = where
        self.base = base
        self.problems = problems

    def project(self, top: Table) -> Project:
        """Return the project; raise UserError with all problems."""
        name = top.require("dialect", TEXT)
        if name is not None and name not in DIALECTS:
            top.report_unknown_name("dialect", name, DIALECTS, "dialect")
        if name is None or name not in DIALECTS:
            raise UserError(self.problems)  # without a dialect nothing else in the file has a meaning
        dialect = DIALECTS[name]
        model, options = self.model(top, dialect), self.options(dialect)
        around = ReadContext(dialect, dialect.answer(options), rules_for(dialect.layout), self.base)
        body = self.read_all_entries(around)
        sim = SIM_ROW.read(Table(self.section("sim"), f"{self.where}: sim", self.problems), around)
        texts = TOP_ROW.read(top, around)
        if self.problems:
            # A bad UDT is reported once, even if many variables have it.
            raise UserError(dict.fromkeys(self.problems))
        return Project(
            path=Path(self.where),
            base=self.base,
            dialect=dialect,
            model=model,
            connection_limit=dialect.models[model],
            options=options,
            black_box=self.black_box,
            rules=around.rules,
            layout=around.layout,
            sim=sim,
            **texts,
            **body,
        )

    def model(self, top: Table, dialect: Dialect) -> str:
        model = top.get("model", TEXT, dialect.default_model)
        if model in dialect.models:
            return model
        top.report_unknown_name("model", model, dialect.models, "model")
        return dialect.default_model

    def options(self, dialect: Dialect) -> dict[str, SwitchValue]:
        raw = dict(self.section("options"))
        self.black_box = self.read_black_box(raw.pop(BLACK_BOX, "on"))
        written = {key: value for key, value in raw.items() if not isinstance(value, SetOverride)}
        given = {key: value.text for key, value in raw.items() if isinstance(value, SetOverride)}
        values, wrong = read_switches(dialect, written, f"{self.where}: options")
        overriding, also_wrong = read_switches(dialect, given, "--set options")
        self.problems += [*wrong, *also_wrong]
        return values | {key: value for key, value in overriding.items() if key in given}

    def read_black_box(self, written: object) -> bool:
        """Return whether a run on the screen keeps its newest scans; this option is in every dialect."""
        is_given = isinstance(written, SetOverride)
        value = written.text if isinstance(written, SetOverride) else written
        if value not in ("on", "off"):
            where = "--set options" if is_given else f"{self.where}: options"
            self.problems.append(Problem(f"{where}.{BLACK_BOX}", quote(value), "on or off"))
        return value != "off"

    def read_all_entries(self, around: ReadContext) -> dict[str, Any]:
        """Return all entries, by the name of their field in Project, and the types."""
        tables = {kind: self.entries(kind) for kind in TABLES}
        self.check_names(tables, around)
        constants = read_constants(self.section("constants"), f"{self.where}: constants", self.problems)
        udts = [UDT.read(table, around) for table in tables.pop("udt")]
        types = self.types(udts, constants, around)
        around = replace(around, types=types)
        certificates = {}
        for table in tables.pop("certificate"):
            one = read_table("certificate", table, around)
            if one is not None and one.number in certificates:
                table.report("number", f"{one.number}, which another certificate has", "an unused number")
            elif one is not None:
                certificates[one.number] = one
        tasks = _entries("task", tables.pop("task"), around) or (Task(),)
        around = replace(around, certificates=certificates, first_task=tasks[0].name)
        found = {kind: _entries(kind, of_kind, around) for kind, of_kind in tables.items()}
        found["combuffer"] = mark_used_buffers(found["combuffer"], found["instance"])
        return {
            "types": types or NO_TYPES,
            "tasks": tasks,
            "constants": constants,
            "udts": tuple([each for each in udts if each is not None]),
            "certificates": certificates,
            **{TABLES[kind].field: entries for kind, entries in found.items()},
        }

    def check_names(self, tables: Mapping[str, list[Table]], around: ReadContext) -> None:
        """Report every name that is declared twice, and every name that is used but not declared."""
        done: set[str] = set()
        for kind in TABLES:
            if kind not in done and kind != "certificate":
                kinds = kinds_sharing_names(kind)
                done.update(kinds)
                reserved = RESERVED_NAMES if kind == "data" else ()  # rule 2
                report_duplicates([(each, tables[each]) for each in kinds], reserved)
        names = {kind: _names(of_kind) for kind, of_kind in tables.items()}
        blocks = [(table.text("name") or "", table.text("block") or "") for table in tables["instance"]]
        ports = _names(table for table in tables["combuffer"] if table.text("source") == SERIAL)
        known = all_names(names, blocks, ports, around.dialect.describes_connects)
        for kind, of_kind in tables.items():
            for table in of_kind:
                check_names(kind, table, known, around)
        report_shared_ends(tables["combuffer"])

    def types(
        self, udts: list[UdtFile | None], constants: Mapping[str, int], around: ReadContext
    ) -> TypeSet | None:
        """Return the UDTs of all files, None if a file cannot be read."""
        read = tuple([each for each in udts if each is not None])
        has_system_types = around.dialect.describes_connects
        try:
            types = types_of_udts(read, self.base, tuple(constants.items()), has_system_types)
        except UserError as refused:
            self.problems += refused.problems
            return None
        # A mistake in a type is reported by the variable that has it: files also have types of no use here.
        of_types = {problem for bad in types.broken.values() for problem in bad}
        self.problems += [problem for problem in types.problems if problem not in of_types]
        return types if None not in udts else None

    def section(self, key: str) -> Mapping[str, Any]:
        content = self.document.get(key, {})
        if isinstance(content, Mapping):
            return content
        self.problems.append(Problem(f"{self.where}: {key}", quote(content), f"a table [{key}]"))
        return {}

    def entries(self, key: str) -> list[Table]:
        """Return the tables of `[[key]]`. Messages name each table by its name, or by its number from 1."""
        content = self.document.get(key, [])
        if not isinstance(content, list) or not all(isinstance(entry, Mapping) for entry in content):
            found, expected = quote(content), f"tables that begin with [[{key}]]"
            self.problems.append(Problem(f"{self.where}: {key}", found, expected))
            return []
        return [
            Table(entry, f"{self.where}: {key} {_label(entry, n)}", self.problems)
            for n, entry in enumerate(content, 1)
        ]


def _label(entry: Mapping[str, Any], number: int) -> str:
    name = entry.get("name")
    return name if isinstance(name, str) and name.isidentifier() else f"#{number}"


@lru_cache(maxsize=4)  # an edit reads the same UDT files several times
def types_of_udts(
    udts: tuple[UdtFile, ...], base: Path, constants: tuple[tuple[str, int], ...], has_system_types: bool
) -> TypeSet:
    """Return the UDTs of these contents; no file is read. Raise UserError for a file without types."""
    contents = {base / each.name: each.content for each in udts}
    return read_files(contents, dict(constants), has_system_types, contents)


def reread_udts(project: Project) -> tuple[UdtFile, ...]:
    """Return the UDT files as they are now, also files that were added to the project file by hand."""
    document: Mapping[str, Any] = {}
    try:
        document = read_toml(project.path)
    except UserError as refused:
        if refused.problems[0].kind != "file":  # a project that was never saved has no file
            raise
    with raise_all_problems() as problems:
        tables = DocumentReader(dict(document), str(project.path), project.base, problems).entries("udt")
        report_duplicates([("udt", tables)])
        rows = [UDT.read(table, context_of(project)) for table in tables]
    own = [each.name for each in project.udts]
    removed = {edit.name for step in project.undoable for edit in step if edit.after is None} - {*own}
    found = {each.name: each for each in rows if each is not None and each.name not in removed}
    others = [UdtFile(name, content_of(project.base / name)) for name in own if name not in found]
    return (*found.values(), *others)


def read_constants(content: Mapping[str, Any], where: str, problems: list[Problem]) -> dict[str, int]:
    """Return the constants of the UDTs, such as `"GVL.MAX" = 10`. Without quotes TOML makes a table GVL."""
    flat: dict[str, Any] = {}
    waiting = list(content.items())
    while waiting:
        name, value = waiting.pop(0)
        if isinstance(value, Mapping) and name.count(".") < DEEPEST_NAME:  # deeper: no number, a mistake
            waiting += [(f"{name}.{key}", inner) for key, inner in value.items()]
        else:
            flat[name] = value
    table = Table(flat, where, problems)
    return {name: number for name in flat if (number := table.read(name, LINT)) is not None}


def _entries(kind: str, tables: Iterable[Table], around: ReadContext) -> tuple[Any, ...]:
    read = [read_table(kind, table, around, number) for number, table in enumerate(tables, 1)]
    return tuple([entry for entry in read if entry is not None])


def _names(tables: Iterable[Table]) -> tuple[str, ...]:
    return tuple([name for table in tables if isinstance(name := table.peek("name"), str)])
