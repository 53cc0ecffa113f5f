"""A project file read into a Project (contract 4.2): all of its mistakes together, or none."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, Final, TypeVar

from trcvtui.blocks.parameters import BUFFER_PIN, PINS, POINTERS
from trcvtui.blocks.rules import Rules
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.dialect import Dialect, SwitchValue
from trcvtui.dialects.switches import read_switches
from trcvtui.errors import Problem, UserError
from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.connection.udp_config import AddrParam, UdpConfig
from trcvtui.project.descriptions import is_structure, read_described, read_described_addr
from trcvtui.project.keys import (
    entries,
    find_shared_ends,
    joined_up,
    read_addr,
    read_choice,
    read_combuffer,
    read_connect,
    read_constants,
    read_instance,
    read_message,
    read_peer,
    read_sequence,
    read_sim,
    read_task,
    read_udp_config,
)
from trcvtui.project.layers import read_certificates
from trcvtui.project.names import expected_name, parse_reference
from trcvtui.project.project import (
    SERIAL,
    SIMULATED,
    Certificates,
    ComBufferDecl,
    DataDecl,
    InstanceDecl,
    MessageDecl,
    PeerDecl,
    Project,
    SequenceDecl,
    SimDecl,
    Task,
)
from trcvtui.project.tables import FILE, NAME, TEXT, TRUTH, Given, Table, read_toml, shown
from trcvtui.udt.layout.layout import Layout, lay_out
from trcvtui.udt.layout.rules import LayoutRules, rules_for
from trcvtui.udt.sources import parse_type, read_files
from trcvtui.udt.type_set import NO_TYPES, TypeSet, join
from trcvtui.udt.types import Type

# Rule: instances and DATA share their names, because `expect NAME` means either; so do CONNECTs, UDP_CONFIGs
# and peers, because `@NAME` means any of them. `peer` is a word of the bench commands and no name for an
# instance or DATA.

WORDS: Final = ("peer",)
Named = tuple[str, Sequence[Table]]  # kind of table, its tables


def find_duplicates(kinds: Iterable[Named], reserved: Iterable[str] = ()) -> None:
    """Record every name that an earlier table of these kinds has, or that is reserved."""
    seen = dict.fromkeys(reserved, "a word of the bench commands")
    for kind, tables in kinds:
        for table in tables:
            name = table.peek("name")
            if not isinstance(name, str):
                continue
            if name in seen:
                table.wrong("name", f"{shown(name)}, {seen[name]}", "a name of its own")
            seen.setdefault(name, f"the name of another {kind}")


@dataclass(frozen=True, slots=True)
class Names:
    """The declared names of a project, asked by those who use them."""

    tasks: tuple[str, ...]
    data: tuple[str, ...]
    connects: tuple[str, ...]
    peers: tuple[str, ...]
    udp_configs: tuple[str, ...] = ()
    addrs: tuple[str, ...] = ()
    combuffers: tuple[str, ...] = ()
    receivers: tuple[str, ...] = ()  # instances of TRCV_C
    serial_lines: tuple[str, ...] = ()  # ComBuffers with a port
    senders: tuple[str, ...] = ()  # instances of TSEND_C
    describes: bool = field(default=False, kw_only=True)  # a CONNECT is a connection description

    def check_connect(self, table: Table) -> None:
        """Record a RemotePort, or an IsoPort, that names nothing."""
        for key in ("RemotePort", "IsoPort"):
            name = parse_reference(table.text(key))
            if name is not None:
                _check(table, key, name, (*self.peers, *self.connects), "peer or CONNECT")

    def check_addr(self, table: Table) -> None:
        """Record a RemotePort that names nothing that speaks UDP."""
        for key in ("RemotePort", "rem_port_nr"):
            name = parse_reference(table.text(key))
            if name is not None:
                _check(table, key, name, (*self.peers, *self._udp_ends()), "peer or UDP_CONFIG")

    def check_peer(self, table: Table) -> None:
        """Record a remote that names no CONNECT; with `udp`, no UDP_CONFIG."""
        name = parse_reference(table.text("remote"))
        if name is None:
            return
        if _is_true(table.peek("udp")):
            _check(table, "remote", name, self._udp_ends(), "UDP_CONFIG")
        else:
            _check(table, "remote", name, self.connects, "CONNECT")

    def check_combuffer(self, table: Table) -> None:
        """Record a source that is nothing from which bytes can come."""
        known = (SIMULATED, SERIAL, *self.receivers, *(n for n in self.combuffers if n != table.peek("name")))
        name = table.text("source")
        if name is not None:
            _check(table, "source", name, known, "source")
        line = table.text("line")
        if line is not None:
            what = 'TSEND_C, or ComBuffer with source = "serial"'
            _check(table, "line", line, (*self.serial_lines, *self.senders), what)

    def _udp_ends(self) -> tuple[str, ...]:
        """Return what may receive datagrams: a CONNECT can be of UDP, where it is a description."""
        return (*self.udp_configs, *self.connects) if self.describes else self.udp_configs

    def check_message(self, table: Table) -> None:
        """Record a peer that does not exist."""
        name = table.text("peer")
        if name:
            _check(table, "peer", name, self.peers, "peer")

    def check_instance(self, table: Table) -> None:
        """Record a CONNECT, DATA or task that does not exist."""
        uses = (
            ("connect", self.connects, "CONNECT"),
            ("config", self.udp_configs, "UDP_CONFIG"),
            ("addr", self.addrs, "ADDR"),
            ("data", self.data, "DATA"),
            *((key, self.combuffers, "ComBuffer") for key in sorted(set(BUFFER_PIN.values()))),
            *((key, self.data, "DATA") for key in sorted(set(chain(*POINTERS.values())))),
            ("task", self.tasks or ("MAIN",), "task"),
        )
        for key, names, what in uses:
            name = table.text(key)
            if name is not None:
                _check(table, key, name, names, what)


def _is_true(value: object) -> bool:
    return bool(TRUTH.from_text(value.text) if isinstance(value, Given) else TRUTH.read(value))


def _check(table: Table, key: str, name: str, names: Sequence[str], what: str) -> None:
    if name not in names:
        table.wrong(key, shown(name), expected_name(name, names, what))


# --set PATH=VALUE: what is set is checked like what is written; its mistakes say `--set PATH`.

TOP_KEYS: Final = ("dialect", "model", "start")
SECTIONS: Final = ("options", "sim")
ENTRIES: Final = (
    "task", "data", "connect", "udp_config", "addr", "instance", "peer", "message", "sequence", "certificate",
    "combuffer",
)  # fmt: skip
FORMS: Final = "PATH=VALUE such as connect.C1.LocalPort=2000 or options.retry=T#100ms"


def with_overrides(
    document: Mapping[str, Any], overrides: Iterable[str], problems: list[Problem]
) -> dict[str, Any]:
    """Return a copy of the document with every `PATH=VALUE` in it; of two of one path the last wins."""
    changed = {key: _copied(value) for key, value in document.items()}
    for override in overrides:
        path, equals, text = override.partition("=")
        path = path.strip()
        if not equals or not path:
            problems.append(Problem("--set", shown(override), FORMS))
            continue
        problem = _put(changed, path, Given(path, text.strip()))
        if problem is not None:
            problems.append(problem)
    return changed


def _copied(part: Any) -> Any:
    """Return a copy as deep as a path can reach, and no deeper: keys of a file may be nested without end."""
    if isinstance(part, list):
        return [dict(entry) if isinstance(entry, dict) else entry for entry in part]
    return dict(part) if isinstance(part, dict) else part


def _put(document: dict[str, Any], path: str, value: Given) -> Problem | None:
    match path.split("."):
        case [key] if key in TOP_KEYS:
            document[key] = value
        case ["constants", *parts] if parts:
            table = document.setdefault("constants", {})
            if isinstance(table, dict):
                table[".".join(parts)] = value
        case [section, key] if section in SECTIONS:
            table = document.setdefault(section, {})
            if isinstance(table, dict):
                table[key] = value
        case [kind, name, key] if kind in ENTRIES and key != "name":
            return _put_entry(document, kind, name, key, value)
        case [first, *_]:
            known = (*TOP_KEYS, *SECTIONS, *ENTRIES, "constants")
            expected = FORMS if first in known else expected_name(first, known, "part of a project")
            return Problem(f"--set {path}", shown(first if first not in known else path), expected)
    return None


def _put_entry(document: dict[str, Any], kind: str, name: str, key: str, value: Given) -> Problem | None:
    if kind == "task" and "task" not in document:
        document["task"] = [{"name": "MAIN"}]  # the default task can be set without being written
    tables = document.get(kind)
    entries = [t for t in tables if isinstance(t, dict)] if isinstance(tables, list) else []
    for entry in entries:
        if entry.get("name") == name:
            entry[key] = value
            return None
    names = [entry["name"] for entry in entries if isinstance(entry.get("name"), str)]
    return Problem(f"--set {value.path}", shown(name), expected_name(name, names, kind))


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


# Rule: refused is only what cannot be typed; every value that a pin or a CONNECT can hold goes to the block.

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Head:
    """Which PLC it is."""

    dialect: Dialect
    model: str
    options: dict[str, SwitchValue]
    layout: LayoutRules

    def rules(self) -> Rules:
        """Return the dialect's answers to these options."""
        return self.dialect.answer(self.options)


@dataclass(frozen=True, slots=True)
class Body:
    """What is in it and around it."""

    types: TypeSet
    tasks: tuple[Task, ...]
    data: tuple[DataDecl, ...]
    connects: tuple[ConnectConfig, ...]
    udp_configs: tuple[UdpConfig, ...]
    addrs: tuple[AddrParam, ...]
    instances: tuple[InstanceDecl, ...]
    peers: tuple[PeerDecl, ...]
    messages: tuple[MessageDecl, ...]
    sequences: tuple[SequenceDecl, ...]
    constants: dict[str, int]
    udt_files: tuple[Path, ...]
    certificates: Certificates
    combuffers: tuple[ComBufferDecl, ...]


class Reader:
    """One reading of one document."""

    def __init__(self, document: dict[str, Any], where: str, base: Path, problems: list[Problem]) -> None:
        self.document = document
        self.where = where
        self.base = base
        self.problems = problems

    # -- head ----------------------------------------------------------------------------------------

    def head(self, top: Table) -> Head:
        name = top.must("dialect", TEXT)
        if name is not None and name not in DIALECTS:
            top.wrong("dialect", shown(name), expected_name(name, DIALECTS, "dialect"))
        if name is None or name not in DIALECTS:
            raise UserError(self.problems)  # what else the file says means something in a dialect only
        dialect = DIALECTS[name]
        return Head(dialect, self.model(top, dialect), self.options(dialect), rules_for(dialect.layout))

    def model(self, top: Table, dialect: Dialect) -> str:
        model = top.get("model", TEXT, dialect.default_model)
        if model in dialect.models:
            return model
        top.wrong("model", shown(model), expected_name(model, dialect.models, "model"))
        return dialect.default_model

    def options(self, dialect: Dialect) -> dict[str, SwitchValue]:
        raw = self.section("options")
        written = {key: value for key, value in raw.items() if not isinstance(value, Given)}
        given = {key: value.text for key, value in raw.items() if isinstance(value, Given)}
        values, wrong = read_switches(dialect, written, f"{self.where}: options")
        overriding, also_wrong = read_switches(dialect, given, "--set options")
        self.problems += [*wrong, *also_wrong]
        return values | {key: value for key, value in overriding.items() if key in given}

    # -- body ----------------------------------------------------------------------------------------

    def body(self, head: Head) -> Body:
        tables = {key: self.entries(key) for key in ENTRIES}
        self.check_names(tables, head.dialect.describes_connects)
        constants = read_constants(self.section("constants"), f"{self.where}: constants", self.problems)
        files = [self.file_of(table) for table in self.entries("udt")]
        types = self.types(files, constants, head.dialect.types)
        certificates = read_certificates(tables["certificate"], self.base)
        tasks = _present([read_task(table) for table in tables["task"]]) or (Task(),)
        instances = self.instances(tables["instance"], head, tasks[0].name)
        return Body(
            types=types or NO_TYPES,
            tasks=tasks,
            data=_present([self.data(table, types, head) for table in tables["data"]]),
            connects=self.connects(tables["connect"], head, certificates),
            udp_configs=_present([read_udp_config(table) for table in tables["udp_config"]]),
            addrs=_present([self.addr(table, head) for table in tables["addr"]]),
            instances=instances,
            peers=_present([read_peer(table, certificates) for table in tables["peer"]]),
            messages=_present([read_message(table) for table in tables["message"]]),
            sequences=_present([read_sequence(table) for table in tables["sequence"]]),
            constants=constants,
            udt_files=tuple([file for file in files if file is not None]),
            certificates=certificates,
            combuffers=joined_up(_present(map(read_combuffer, tables["combuffer"])), instances),
        )

    def check_names(self, tables: Mapping[str, list[Table]], describes: bool) -> None:
        find_duplicates([("task", tables["task"])])
        find_duplicates([("data", tables["data"]), ("instance", tables["instance"])], reserved=WORDS)
        find_duplicates([(key, tables[key]) for key in ("connect", "udp_config", "peer", "combuffer")])
        for key in ("addr", "message", "sequence"):
            find_duplicates([(key, tables[key])])
        kinds = ("task", "data", "connect", "peer", "udp_config", "addr", "combuffer")
        receivers = [table for table in tables["instance"] if table.peek("block") == "TRCV_C"]
        ports = [table for table in tables["combuffer"] if table.text("source") == SERIAL]
        senders = [table for table in tables["instance"] if table.peek("block") == "TSEND_C"]
        kept = (*map(tables.__getitem__, kinds), receivers, ports, senders)
        names = Names(*(_declared(of_kind) for of_kind in kept), describes=describes)
        for table in tables["connect"]:
            names.check_connect(table)
        for table in tables["addr"]:
            names.check_addr(table)
        for table in tables["instance"]:
            names.check_instance(table)
        for table in tables["combuffer"]:
            names.check_combuffer(table)
        find_shared_ends(tables["combuffer"])
        for table in tables["peer"]:
            names.check_peer(table)
        for table in tables["message"]:
            names.check_message(table)

    def types(self, files: list[Path | None], constants: Mapping[str, int], library: str) -> TypeSet | None:
        """Return the UDTs of all files and the library's, None where a file cannot be read."""
        if not files and not library:
            return join([], NO_TYPES.where, constants)
        try:
            read = [file for file in files if file is not None]
            types = read_files(read, constants, library=library)
        except UserError as refused:
            self.problems += refused.problems
            return None
        # What is wrong in a type is told with the variable that has it: files hold types of no use here too.
        of_types = {problem for bad in types.broken.values() for problem in bad}
        self.problems += [problem for problem in types.problems if problem not in of_types]
        return types if None not in files else None

    def file_of(self, table: Table) -> Path | None:
        file = table.must("file", FILE)
        table.finish()
        return self.base / file if file is not None else None

    def data(self, table: Table, types: TypeSet | None, head: Head) -> DataDecl | None:
        name = table.must("name", NAME)
        text = table.must("type", TEXT)
        optimized = head.rules().area.symbolic_alone and table.get("optimized", TRUTH, False)
        choice = read_choice(table)
        table.finish()
        if text is None:
            return None
        try:
            type_ = parse_type(text, types or NO_TYPES, table.place("type"))
            laid_out = _placed(type_, choice.rules(head.layout), name or "?", table.place("type"))
        except UserError as refused:
            if types is not None:  # else the type may stand in the file that cannot be read
                self.problems += refused.problems
            return None
        return DataDecl(name or "", text, type_, laid_out, laid_out.size, optimized, choice)

    def connects(
        self, tables: list[Table], head: Head, certificates: Certificates
    ) -> tuple[ConnectConfig, ...]:
        return _present([self.connect(table, n, head, certificates) for n, table in enumerate(tables, 1)])

    def connect(
        self, table: Table, number: int, head: Head, certificates: Certificates
    ) -> ConnectConfig | None:
        if not head.dialect.describes_connects:
            return read_connect(table)
        return read_described(table, number, head.rules(), certificates, head.dialect.structures)

    def addr(self, table: Table, head: Head) -> AddrParam | None:
        is_described = head.dialect.describes_connects and is_structure(table)
        return read_described_addr(table) if is_described else read_addr(table)

    def instances(self, tables: list[Table], head: Head, first_task: str) -> tuple[InstanceDecl, ...]:
        blocks = tuple(block for block in head.dialect.blocks if block in PINS)
        for table in tables:
            self.check_pins(table, head)
        rules = head.rules()
        return _present([read_instance(table, blocks, first_task, rules) for table in tables])

    def check_pins(self, table: Table, head: Head) -> None:
        for pin in head.rules().lacks:
            if table.has(pin):
                table.wrong(pin, "a pin", f"another: blocks of {head.dialect.name} have none of that name")

    # -- the document ----------------------------------------------------------------------------------

    def sim(self) -> SimDecl:
        return read_sim(Table(self.section("sim"), f"{self.where}: sim", self.problems))

    def section(self, key: str) -> Mapping[str, Any]:
        content = self.document.get(key, {})
        if isinstance(content, Mapping):
            return content
        self.problems.append(Problem(f"{self.where}: {key}", shown(content), f"a table [{key}]"))
        return {}

    def entries(self, key: str) -> list[Table]:
        return entries(self.document, key, self.where, self.problems)


def _placed(type_: Type, rules: LayoutRules, name: str, place: str) -> Layout:
    """Return the layout of a variable; let its mistakes begin with the place in the file."""
    try:
        return lay_out(type_, rules, name)
    except UserError as refused:
        raise UserError(
            Problem(place + wrong.where[len(name) :], wrong.found, wrong.expected)
            for wrong in refused.problems
        ) from None


def _declared(tables: Iterable[Table]) -> tuple[str, ...]:
    return tuple([name for table in tables if isinstance(name := table.peek("name"), str)])


def _present(found: Iterable[T | None]) -> tuple[T, ...]:
    return tuple([entry for entry in found if entry is not None])
