"""The parts of a project document, one after the other: each leaves its problems and something harmless.

Rule: refused is only what cannot be typed; every value that a pin or a CONNECT can hold goes to the block.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from trcvtui.blocks.parameters import PINS
from trcvtui.blocks.rules import Rules
from trcvtui.dialects import DIALECTS
from trcvtui.dialects.dialect import Dialect, SwitchValue
from trcvtui.dialects.switches import read_switches
from trcvtui.errors import Problem, UserError
from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.connection.udp_config import AddrParam, UdpConfig
from trcvtui.project import parts as parts
from trcvtui.project.addr_words import read_described_addr
from trcvtui.project.combuffers import find_shared_ends, joined_up, read_combuffer
from trcvtui.project.connect_descriptions import read_described
from trcvtui.project.declared_names import WORDS, Names, find_duplicates
from trcvtui.project.names import expected_name
from trcvtui.project.overrides import ENTRIES
from trcvtui.project.project import (
    SERIAL,
    ComBufferDecl,
    DataDecl,
    InstanceDecl,
    MessageDecl,
    PeerDecl,
    SequenceDecl,
    SimDecl,
    Task,
)
from trcvtui.project.tables import FILE, TEXT, TRUTH, Given, Table, shown
from trcvtui.project.tls_words import Certificates, read_certificates
from trcvtui.udt.iec_type import parse_type
from trcvtui.udt.layout.layout import Layout, lay_out
from trcvtui.udt.layout.rules import LayoutRules, rules_for
from trcvtui.udt.sources import read_files
from trcvtui.udt.type_set import NO_TYPES, TypeSet, join
from trcvtui.udt.types import Type

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
        constants = parts.read_constants(self.section("constants"), f"{self.where}: constants", self.problems)
        files = [self.file_of(table) for table in self.entries("udt")]
        types = self.types(files, constants, head.dialect.types)
        certificates = read_certificates(tables["certificate"], self.base)
        tasks = _present([parts.read_task(table) for table in tables["task"]]) or (Task(),)
        instances = self.instances(tables["instance"], head, tasks[0].name)
        return Body(
            types=types or NO_TYPES,
            tasks=tasks,
            data=_present([self.data(table, types, head) for table in tables["data"]]),
            connects=self.connects(tables["connect"], head, certificates),
            udp_configs=_present([parts.read_udp_config(table) for table in tables["udp_config"]]),
            addrs=_present([self.addr(table, head) for table in tables["addr"]]),
            instances=instances,
            peers=_present([parts.read_peer(table, certificates) for table in tables["peer"]]),
            messages=_present([parts.read_message(table) for table in tables["message"]]),
            sequences=_present([parts.read_sequence(table) for table in tables["sequence"]]),
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
        name = table.must("name", parts.NAME)
        text = table.must("type", TEXT)
        optimized = head.rules().area.symbolic_alone and table.get("optimized", TRUTH, False)
        choice = parts.read_choice(table)
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
            return parts.read_connect(table)
        return read_described(table, number, head.rules(), certificates, head.dialect.structures)

    def addr(self, table: Table, head: Head) -> AddrParam | None:
        return read_described_addr(table) if head.dialect.describes_connects else parts.read_addr(table)

    def instances(self, tables: list[Table], head: Head, first_task: str) -> tuple[InstanceDecl, ...]:
        blocks = tuple(block for block in head.dialect.blocks if block in PINS)
        for table in tables:
            self.check_pins(table, head)
        rules = head.rules()
        return _present([parts.read_instance(table, blocks, first_task, rules) for table in tables])

    def check_pins(self, table: Table, head: Head) -> None:
        for pin in head.rules().lacks:
            if table.has(pin):
                table.wrong(pin, "a pin", f"another: blocks of {head.dialect.name} have none of that name")

    # -- the document ----------------------------------------------------------------------------------

    def sim(self) -> SimDecl:
        return parts.read_sim(Table(self.section("sim"), f"{self.where}: sim", self.problems))

    def section(self, key: str) -> Mapping[str, Any]:
        content = self.document.get(key, {})
        if isinstance(content, Mapping):
            return content
        self.problems.append(Problem(f"{self.where}: {key}", shown(content), f"a table [{key}]"))
        return {}

    def entries(self, key: str) -> list[Table]:
        return parts.entries(self.document, key, self.where, self.problems)


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
