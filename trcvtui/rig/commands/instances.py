"""`create`, `delete`, `download`, `resize`: what an engineer changes in a running program (7.15.1, notes).

Later lines are read against the project as these commands leave it: `after` says how that is.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from trcvtui.blocks.pins import Direction
from trcvtui.blocks.table import block_row, known_blocks
from trcvtui.errors import UserError
from trcvtui.project.edit import edited, undone
from trcvtui.project.file import WORDS
from trcvtui.project.keys import link_key
from trcvtui.project.names import IDENTIFIER_TEXT, expected_name, is_identifier, with_article
from trcvtui.project.project import DataDecl, InstanceDecl, Project
from trcvtui.project.tables import shown
from trcvtui.rig.commands.edit import edits_of
from trcvtui.rig.commands.read_conditions import read_instance
from trcvtui.rig.commands.tokens import Words, pin_value
from trcvtui.rig.commands.words import (
    Add,
    AddData,
    BenchCommand,
    Change,
    Create,
    Delete,
    Download,
    Remove,
    Resize,
    Undo,
)
from trcvtui.udt.layout.layout import lay_out
from trcvtui.udt.layout.rules import NO_CHOICE
from trcvtui.udt.sources import parse_type


def read_create(words: Words, project: Project) -> Create:
    """Return `create BLOCK NAME connect=C1 data=rx [task=MAIN] [PIN=VALUE ...]`; raise UserError."""
    blocks = known_blocks(project.dialect.blocks)
    block = words.next("a block such as TRCV_C")
    if block not in blocks:
        raise words.wrong(shown(block), expected_name(block, blocks, "block"))
    name = _new_name(words, project)
    given = _read_pairs(words)
    link = _link(given, block, words, project)
    data = None
    if block_row(block).data_pin:
        data = _reference(given, "data", [d.name for d in project.data], "DATA", words)
    known = [d.name for d in project.data]
    pointers = [_reference(given, key, known, "DATA", words) or "" for key in block_row(block).pointers]
    task = _reference(given, "task", [t.name for t in project.tasks], "task", words)
    inputs = _inputs(given, block, words, project)
    task = task or project.tasks[0].name
    made = InstanceDecl(
        name, block, link.name, data, task, inputs, link.addr, link.is_config, tuple(pointers)
    )
    return Create(made)


class _Link(NamedTuple):
    """What a block works on: a CONNECT, a UDP_CONFIG or a ComBuffer, and an ADDR where it has one."""

    name: str
    addr: str | None = None
    is_config: bool = False


def _link(given: dict[str, str], block: str, words: Words, project: Project) -> _Link:
    row = block_row(block)
    if row.on_buffer:
        return _Link(_must(given, row.buffer_pin, [b.name for b in project.combuffers], "ComBuffer", words))
    connects, addrs = [c.name for c in project.connects], [a.name for a in project.addrs]
    if row.speaks_udp and not (row.datagrams and "connect" in given):
        config = _must(given, "config", [u.name for u in project.udp_configs], "UDP_CONFIG", words)
        return _Link(config, _must(given, "addr", addrs, "ADDR", words), is_config=True)
    connect = _must(given, "connect", connects, "CONNECT", words)
    if row.speaks_udp:
        return _Link(connect, _must(given, "addr", addrs, "ADDR", words))
    takes_addr = row.builds and project.dialect.describes_connects
    return _Link(connect, _reference(given, "addr", addrs, "ADDR", words) if takes_addr else None)


def _must(given: dict[str, str], key: str, names: list[str], what: str, words: Words) -> str:
    name = _reference(given, key, names, what, words)
    if name is None:
        raise words.wrong(f"no {key}=", f"{key}= and the name of {with_article(what)}")
    return name


def _new_name(words: Words, project: Project) -> str:
    name = words.next("a name for the new instance")
    if not is_identifier(name) or name in WORDS:
        raise words.wrong(shown(name), IDENTIFIER_TEXT)
    if project.instance(name) is not None or project.data_decl(name) is not None:
        raise words.wrong(f"{shown(name)}, which is there already", "a name of its own")
    return name


def _read_pairs(words: Words) -> dict[str, str]:
    pairs: dict[str, str] = {}
    for word in words.rest():
        key, equals, text = word.partition("=")
        if not equals or key in pairs:
            raise words.wrong(shown(word), "KEY=VALUE once each, such as connect=C1 data=rx CONT=1")
        pairs[key] = text
    return pairs


def _reference(given: dict[str, str], key: str, names: list[str], what: str, words: Words) -> str | None:
    name = given.pop(key, None)
    if name is not None and name not in names:
        raise words.wrong(f"{key}={name}", expected_name(name, names, what))
    return name


def _inputs(
    given: dict[str, str], block: str, words: Words, project: Project
) -> tuple[tuple[str, bool | int], ...]:
    row = block_row(block)
    pins = {pin.name: pin for pin in project.pins(block) if pin.direction is not Direction.OUT}
    link = ("config", "addr") if row.speaks_udp else (link_key(block), *row.pointers)
    keys = (*link, "task", *pins)
    for key in given:
        if key == "data":
            raise words.wrong("'data'", f"nothing: {block} has no DATA")
        if key not in pins:
            with_data = ("data", *keys) if row.data_pin else keys
            raise words.wrong(shown(key), expected_name(key, with_data, "key or input"))
    return tuple((key, pin_value(pins[key], text, words.where)) for key, text in given.items())


def read_delete(words: Words, project: Project) -> Delete:
    """Return `delete TRCV_C_1`; raise UserError."""
    return Delete(read_instance(words, project).name)


def read_download(words: Words, project: Project) -> Download:
    """Return `download TRCV_C_1`; raise UserError."""
    return Download(read_instance(words, project).name)


def read_resize(words: Words, project: Project) -> Resize:
    """Return `resize rx ARRAY[0..9] OF BYTE`; raise UserError."""
    name = words.next("the name of a DATA variable")
    if project.data_decl(name) is None:
        raise words.wrong(shown(name), expected_name(name, [d.name for d in project.data], "DATA"))
    type_name = words.rest_text("an IEC type or a UDT")
    try:
        return Resize(name, type_name, declare(name, type_name, project, words.where))
    except UserError as refused:
        if all(wrong.where.startswith(words.where) for wrong in refused.problems):
            raise
        raise UserError(
            replace(wrong, where=f"{words.where}: {wrong.where}") for wrong in refused.problems
        ) from None


def declare(name: str, type_name: str, project: Project, where: str) -> DataDecl:
    """Return a global variable of this type, laid out as it or the project says; raise UserError."""
    type_ = parse_type(type_name, project.types, where)
    known = project.data_decl(name)
    choice = known.choice if known is not None else NO_CHOICE
    layout = lay_out(type_, choice.rules(project.layout), name)
    is_optimized = known is not None and known.optimized
    return DataDecl(name, type_name, type_, layout, layout.size, is_optimized, choice)


def after(command: BenchCommand, project: Project) -> Project:
    """Return the project as a command leaves it."""
    match command:
        case Create(decl):
            return project.with_instance(decl)
        case Add() | AddData() | Change() | Remove():
            return edited(project, edits_of(command, project))
        case Undo():
            return undone(project)
        case Delete(name):
            return project.without_instance(name)
        case Resize(_, _, decl):
            return project.with_data(decl)
        case _:
            return project
