"""Lines that edit the project: `add connect C3 LocalPort=2001`, `set C3 LocalPort=2002`, `remove C3`, `undo`.

Lines use the keys of the project file, and the same readers check them. A type, a message and the steps of
a sequence are written without a key: `add data rx2 INT`, `set message m hex 01`.
Rule: a line changes everything that it says, or nothing. An entry in use is not removed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from trcvtui.blocks.table import affix_pin_names, block_row
from trcvtui.commands.peer import (
    check_all_messages,
    check_message,
    check_routine,
    check_sequence,
    parse_send,
    read_replies,
    read_routines,
)
from trcvtui.commands.tokens import Words, prefix_problems, unquote
from trcvtui.commands.words import AddEntry, AddVariable, Change, EditCommand, Remove, UndoEdit
from trcvtui.errors import Problem, UserError, mistake, one_line
from trcvtui.files import is_disk_replaced
from trcvtui.net.connection.config import ConnectConfig, UdpConfig
from trcvtui.net.results import Endpoint
from trcvtui.project.edit import (
    append_entry,
    apply_edits,
    find_broken_users,
    find_entry,
    find_kinds,
    inverse_edits,
    make_addition,
    make_change,
    read_changed,
    read_entry,
)
from trcvtui.project.key_rows import KeyValue
from trcvtui.project.keys import EDITED, TABLES, array_keys, forms_of, free_name, keys_of, kind_name, names_of
from trcvtui.project.project import (
    DataDecl,
    Declaration,
    Edit,
    Edits,
    InstanceDecl,
    MessageDecl,
    PeerDecl,
    Project,
    SequenceDecl,
    UdtFile,
)
from trcvtui.project.proposals import NEW
from trcvtui.project.tables import SetOverride, quote, with_article
from trcvtui.project.text import relocate
from trcvtui.udt.layout.layout import lay_out
from trcvtui.udt.layout.rules import LAYOUTS
from trcvtui.udt.literals import quote_text
from trcvtui.udt.type_set import TypeSet
from trcvtui.wording import count

# Parts that `add instance` creates. Rule: only what the line leaves out, or calls `new`, is created.
# CONNECT: passive, 127.0.0.1, the first port from 2000 on that no part of the project has; the line may have
# keys of it (LocalPort=2500). DATA: 1024 bytes to receive into, 16 to send. A receiver of a stream is ad hoc,
# so that the first bytes from any partner give a DONE.

FIRST_PORT: Final = 2000
LAST_PORT: Final = 49_151  # the system gives later ports to active ends
DEFAULT_HOST: Final = "127.0.0.1"
CONNECT_KEYS: Final = ("ActiveEstablished", "LocalAddress", "LocalPort", "RemoteAddress", "RemotePort")
RECEIVE_TYPE: Final = "ARRAY[0..1023] OF BYTE"
SEND_TYPE: Final = "ARRAY[0..15] OF BYTE"
LISTEN: Final = ("connect", "udp_config")
NAME_STARTS: Final = {"connect": "C", "udp_config": "U", "addr": "A", "combuffer": "B"}


def free_port(project: Project, after: int = FIRST_PORT - 1) -> int:
    """Return the first port above `after` that no part of the project uses, by default from 2000 on."""
    ends = [each.local for each in project.connects] + [each.local for each in project.udp_configs]
    taken = {end.port for end in ends} | {
        getattr(end, "port", 0) for peer in project.peers for end in (peer.end, peer.source)
    }
    return next(port for port in range(after + 1, LAST_PORT + 1) if port not in taken)


def link_keys(block: str, content: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return the keys of a block that refer to entries such as a CONNECT or an ADDR, each with its kind."""
    row = block_row(block)
    if row.has_com_buffer:
        return ((row.buffer_pin, "combuffer"),)
    link = "config" if row.speaks_udp and not (row.datagrams and "connect" in content) else "connect"
    addr = (("addr", "addr"),) if row.speaks_udp else ()
    return ((link, "udp_config" if link == "config" else link), *addr)


def complete_instance(
    content: Mapping[str, Any], project: Project, where: str
) -> tuple[dict[str, Any], tuple[Declaration, ...]]:
    """Return all keys of an instance, missing keys filled in, and the parts created for such keys."""
    made, block = list[Declaration](), _word_text(content.get("block"))
    is_known, row = block in project.dialect.blocks, block_row(block)
    keys = link_keys(block, content) if is_known else ()
    kinds = {**dict(keys), **({"data": "data"} if row.data_pin else {})}
    called = {key for key, value in content.items() if _word_text(value) == NEW and key != "name"}
    to_create = {k for k in called if not is_known or (k in kinds and NEW not in names_of(kinds[k], project))}
    whole = {key: value for key, value in content.items() if key not in to_create}
    missing = [(key, kind) for key, kind in keys if key not in whole]
    if not missing and "data" not in to_create & kinds.keys():
        return whole, ()
    of_connect = CONNECT_KEYS if any(kind in LISTEN for _, kind in missing) else ()
    own: dict[str, Any] = {key: whole.pop(key) for key in of_connect if key in whole}
    parts = [(key, kind, NAME_STARTS[kind], own if kind in LISTEN else {}) for key, kind in missing]
    if row.data_pin and "data" not in whole:
        receives = row.receives_on_net or row.reads_rx_buffer
        type_ = {"type": RECEIVE_TYPE if receives else SEND_TYPE}
        parts.append(("data", "data", "rx" if receives else "tx", type_))
    for key, kind, start, given_keys in parts:
        name = free_name(kind, start, project)
        usual = {"LocalAddress": DEFAULT_HOST, "LocalPort": free_port(project)} if kind in LISTEN else {}
        decl = read_entry(kind, {"name": name, **usual, **given_keys}, project, where)
        project = append_entry(project, decl)
        made.append(decl)
        whole[key] = name
    if not whole.keys() & {"ADHOC", "LEN"}:
        whole |= project.adhoc_inputs(block)
    return whole, tuple(made)


def _word_text(value: object) -> str:
    return value.text if isinstance(value, SetOverride) else str(value or "")


def listening_ends(made: tuple[Declaration, ...]) -> tuple[Endpoint, ...]:
    listening = [decl.local for decl in made if isinstance(decl, ConnectConfig | UdpConfig)]
    return tuple([end for end in listening if end.port])


PART_KINDS: Final = EDITED
CERTIFICATE: Final = "certificate"
INSTANCE: Final = "instance"
PAIRS_FORM: Final = "KEY=VALUE, each key once, such as LocalPort=2000"
NOT_IN_USE_TEXT: Final = "an edit that leaves all other parts valid"


def parse_add(words: Words, project: Project) -> AddEntry | AddVariable:
    kind = words.next_known(PART_KINDS, "kind", "what to add: " + ", ".join(PART_KINDS))
    if kind == UDT:  # a name with blanks needs no quotes
        return AddEntry(
            _read_udt_file(unquote(words.take_rest_text("a file of types")), project, words.where)
        )
    start = words.place
    name = words.next(f"a name for the new {kind}")
    where = f"{words.where}: {kind} {name}"
    if kind == CERTIFICATE:  # it has a number as its name, also written as `number=1`
        called: dict[str, Any] = {"number": SetOverride("number", name.removeprefix("number="))}
    else:
        called = {"name": name}
    content = {**called, **_CONTENT_READERS.get(kind, _read_pairs)(words)}
    if kind == INSTANCE:
        return _make_add_entry(content, project, where, words.text_since(start))
    decl = read_entry(kind, content, project, where)
    if isinstance(decl, DataDecl):
        return AddVariable(decl.name, decl.type_name, decl)
    if isinstance(decl, PeerDecl) and not content.keys() & {"remote", "local", "active", "udp"}:
        found = "neither remote nor local"
        raise mistake(where, found, "remote=@C1 to connect, or local=127.0.0.1:4000 to listen")
    _check_messages(decl, append_entry(project, decl), where)
    return AddEntry(decl)


UDT: Final = "udt"
MOST_TYPES_SHOWN: Final = 8


def _read_udt_file(name: str, project: Project, where: str) -> UdtFile:
    """Return a file with types. Raise UserError if the file has no type, or hides a known type."""
    path = os.path.expanduser(name)
    if not is_disk_replaced():  # each file by one name, from the project's folder on; a link keeps its name
        is_here = os.path.exists(path) and not os.path.exists(project.base / path)
        folder, file = os.path.split(path if is_here else project.base / path)
        path = f"{relocate(os.path.relpath(folder or '.'), Path(), project.base)}/{file}".removeprefix("./")
    with prefix_problems(where):
        decl = read_entry(UDT, {"file": path}, project, path)
        assert isinstance(decl, UdtFile)
        types, names, wrong = _types_with_file(decl, project)
        of_types = {problem for bad in types.broken.values() for problem in bad}
        lost = [name for key, (name, _) in project.types.types.items() if key not in types.types]
        if not names or lost or not of_types.issuperset(wrong):
            found = (
                f"a second file of this name, which would rename the type {lost[0]}" if lost else "no type"
            )
            raise UserError(wrong or mistake(path, found, "a file that declares new types").problems)
    return decl


def _types_with_file(decl: UdtFile, project: Project) -> tuple[TypeSet, list[str], list[Problem]]:
    """Return the types including one more file, the names of the new types, and mistakes in the file."""
    types = append_entry(project, decl).types
    own = types.senders.keys() - project.types.senders.keys()
    names = [name for key, (name, _) in types.types.items() if key in own]
    return types, names, [problem for problem in types.problems if problem not in project.types.problems]


def _describe_types(decl: UdtFile, project: Project) -> str:
    types, names, wrong = _types_with_file(decl, project)
    sender, here = types.sender_layout(names[0]), project.layout
    of_sender = f"sender's {sender.source} {sender.layout}" if sender.layout else "sender's layout not known"
    lines = [f"{count(len(names), 'type')}, here {here.name} {here.byte_order}, {of_sender}"]
    for name in names[:MOST_TYPES_SHOWN]:
        every = (here, LAYOUTS[sender.layout]) if sender.layout else (here,)
        try:
            sizes = [count(lay_out(types.get_type(name), rules, name).size, "byte") for rules in every]
            lines.append(one_line(f"{name} {', sender: '.join(sizes)}"))
        except UserError as refused:
            lines.append(one_line(f"{name}: {refused.problems[0].message}"))
    lines += [f"and {len(names) - MOST_TYPES_SHOWN} more"] * (len(names) > MOST_TYPES_SHOWN)
    return "\n".join([*lines, *(f"bad: {problem}" for problem in wrong[:1])])


def _make_add_entry(content: dict[str, Any], project: Project, where: str, written: str) -> AddEntry:
    whole, made = complete_instance(content, project, where)
    grown = apply_edits(project, tuple([make_addition(decl, project) for decl in made]))
    decl = read_entry(INSTANCE, whole, grown, where)
    assert isinstance(decl, InstanceDecl)
    if not made:
        return AddEntry(decl)
    port = next((end.port for end in listening_ends(made) if "LocalPort" not in content), 0)
    return AddEntry(decl, made, f"add {INSTANCE} {written}{port_text(port) if port else ''}", port)


def _check_messages(decl: Declaration, project: Project, where: str) -> None:
    """Raise UserError for mistakes in messages, steps and routines that the entry's reader cannot find."""
    match decl:
        case MessageDecl():
            check_message(decl, project, where)
            _check_cuts(decl, project, where)
        case SequenceDecl():
            check_sequence(decl, project, where)
        case PeerDecl():
            check_routine(decl, project, where)


def _check_cuts(decl: MessageDecl, project: Project, where: str) -> None:
    peer = decl.peer or next((peer.name for peer in project.peers), "")
    send = parse_send(Words(decl.text, where), project, peer)
    size = len(send.payload)
    if send.split and sum(send.split) >= size:
        cuts = ",".join(map(str, send.split))
        raise mistake(
            where, f"split={cuts} for {count(size, 'byte')}", f"pieces that add up to less than {size}"
        )


def _read_pairs(words: Words, runs_on: bool = False) -> dict[str, Any]:
    """Return the KEY=VALUE pairs. If `runs_on`, a word without a key continues the value before it."""
    pairs: dict[str, str] = {}
    lists: dict[str, list[str]] = {}
    key, severals = "", array_keys()
    for word in words.take_rest():
        if runs_on and "=" not in word and key in pairs:
            pairs[key] += f" {word}"
            continue
        key, equals, text = word.partition("=")
        if not equals or key in pairs:
            raise words.error(quote(word) + f", the second {key}=" * bool(equals), PAIRS_FORM)
        if key in severals:
            lists.setdefault(key, []).append(unquote(text))
        else:
            pairs[key] = unquote(text)
    return {key: SetOverride(key, text) for key, text in pairs.items()} | lists


def _read_data(words: Words) -> dict[str, Any]:
    after = words.cut_tail(lambda word: "=" in word)
    return {"type": words.take_rest_text("an IEC type or a UDT"), **_read_pairs(after)}


def _read_message(words: Words) -> dict[str, Any]:
    peer = words.next("").partition("=")[2] if words.peek().startswith("peer=") else ""
    text = words.take_rest_text("a payload as after `peer P1 send`, such as hex 01 02")
    return {"text": text, **({"peer": peer} if peer else {})}


_CONTENT_READERS: Final[dict[str, Callable[[Words], dict[str, Any]]]] = {
    "data": _read_data,
    "message": _read_message,
    "sequence": lambda words: {
        "steps": [words.next("the names of messages and pauses such as T#100ms"), *words.take_rest()]
    },
}


# -- set, remove, undo -------------------------------------------------------------------------------------


def parse_change(words: Words, project: Project) -> Change | None:
    """Read `set [KIND] NAME KEY=VALUE ...`, or raise UserError. Return None if the line sets pins."""
    kind, name = _read_kind_and_name(words, project)
    if not kind or (kind == INSTANCE and not _changes_declaration(words, name, project)):
        return None
    words.next(f"the name of {with_article(kind)}")
    before, written = find_entry(kind, name, project), words.remaining_text()
    where = f"{words.where}: {kind} {name}"
    if before is None:
        names = names_of(kind, project)
        raise words.make_unknown_error(name, names, kind)
    decl = read_changed(before, _read_changes(kind, words), project, where)
    _check_messages(decl, apply_edits(project, (make_change(before, decl, project),)), where)
    _check_users((make_change(before, decl, project),), project, where)
    return Change(kind, name, written, before, decl)


def _read_kind_and_name(words: Words, project: Project) -> tuple[str, str]:
    """Return kind and name after `set` or `remove`. Consume the kind if written. Unknown name: kind ""."""
    if words.peek() in PART_KINDS and words.peek(1) and "=" not in words.peek(1):
        return words.next(""), words.peek()
    name = words.peek()
    kinds = find_kinds(name, project)
    if len(kinds) > 1:
        found = f"'{name}', the name of {' and '.join([with_article(kind_text(kind)) for kind in kinds])}"
        verb = words.verb
        ways = " or ".join(f"{verb} {kind} {name} .." for kind in kinds)
        raise words.error(found, ways if verb == "set" else ways.replace(" ..", ""))
    return (kinds[0] if kinds else ""), name


def kind_text(kind: str) -> str:
    return TABLES[kind].what


def _changes_declaration(words: Words, name: str, project: Project) -> bool:
    """Return whether a key changes the declaration (block, CONNECT, DATA, task), not an input."""
    decl = project.instance(name)
    if decl is None:
        return False
    pins = {pin.name for pin in project.pins(decl.block)}
    of_others = set(affix_pin_names()) - set(block_row(decl.block).pointers)
    wired = {row.name for row in TABLES[INSTANCE].keys if row.refers or row.name == "block"}
    keys = wired - of_others - pins
    return any(word.partition("=")[0] in keys for word in words.remaining_words())


def _read_changes(kind: str, words: Words) -> dict[str, Any]:
    if kind in ("message", "sequence"):
        return _CONTENT_READERS[kind](words)
    bare = kind == "data" and "=" not in words.peek()
    content = _read_data(words) if bare else _read_pairs(words, runs_on=kind == "data")
    if not content:
        raise words.error("no further word", PAIRS_FORM)
    if "name" in content or TABLES[kind].called in content:
        raise words.error("a new name", "other changes: to rename a part, remove it and add it again")
    return {
        key: None if isinstance(each, SetOverride) and not each.text else each
        for key, each in content.items()
    }


def parse_remove(words: Words, project: Project) -> Remove:
    """Read `remove [KIND] NAME`. Raise UserError if the entry does not exist or is in use."""
    kind, name = _read_kind_and_name(words, project)
    missing = "the name of what to remove"
    name = unquote(words.take_rest_text(missing)) if kind == UDT else words.next(missing)
    decl = find_entry(kind, name, project) if kind else None
    if decl is None:
        names = names_of(kind, project) if kind else [n for each in EDITED for n in names_of(each, project)]
        raise words.make_unknown_error(name, names, kind_text(kind) if kind else "name")
    _check_users((make_change(decl, None, project),), project, f"{words.where}: {kind} {name}")
    return Remove(kind, name, decl)


def parse_undo(words: Words, project: Project) -> UndoEdit:
    """Read `undo`. Raise UserError if there is no edit to take back."""
    edits = inverse_edits(project)
    if not edits:
        raise words.error("undo without an edit", "an add, set or remove of a part before it")
    _check_users(edits, project, f"{words.where}: undo")
    return UndoEdit()


def _check_users(edits: Edits, project: Project, where: str) -> None:
    """Raise UserError if these edits would make another entry invalid."""
    users = find_broken_users(edits, project)
    if users:
        names = [f"{kind_text(kind_name(decl))} {decl.name}" for decl, _ in users]
        changed = next((edit for edit in edits if edit.after is not None), None)
        wrong = users[0][1].problems[0]
        reason = f" ({wrong.where.lstrip(': ')}: expected {wrong.expected})" if changed else ""
        raise mistake(where, f"in use by {', '.join(names)}{reason}", NOT_IN_USE_TEXT)
    after = apply_edits(project, edits)
    for check in (read_routines, read_replies, check_all_messages):
        try:
            check(after)
        except UserError as wrong:
            raise mistake(where, f"in use: {wrong.lines()[0]}", NOT_IN_USE_TEXT) from None


# -- what a line does to a project ------------------------------------------------------------------------


def make_edits(command: EditCommand, project: Project) -> Edits:
    match command:
        case AddEntry() | AddVariable():
            with_it = command.with_it if isinstance(command, AddEntry) else ()
            return tuple([make_addition(decl, project) for decl in (*with_it, command.decl)])
        case Change(kind, name, _, _, decl):
            before = find_entry(kind, name, project)
            return (make_change(before, decl, project),) if before is not None else ()
        case Remove(kind, name):
            gone = find_entry(kind, name, project)
            return (make_change(gone, None, project),) if gone is not None else ()
        case UndoEdit():
            return inverse_edits(project)


def describe_edit(command: EditCommand, project: Project) -> str:
    """Return what a line changes in the project: the old and new values, and the parts that restart."""
    if isinstance(command, AddEntry) and isinstance(command.decl, UdtFile):
        return _describe_types(command.decl, project)
    if isinstance(command, AddEntry | AddVariable):
        made = command.with_it if isinstance(command, AddEntry) else ()
        return f"with {', '.join(map(_describe_made_part, made))}" if made else ""
    changes = [_describe_entry_edit(edit) for edit in make_edits(command, project)]
    anew = dict.fromkeys(what for edit in make_edits(command, project) for what in _restarts(edit, project))
    back = "taken back: " if isinstance(command, UndoEdit) else ""
    return back + ", ".join(changes) + (f"; restarts: {', '.join(anew)}" if anew else "")


def port_text(port: int) -> str:
    """Return the text for the end of a line that chooses this port."""
    return f" LocalPort={port}"


def _describe_made_part(decl: Declaration) -> str:
    what = f"{kind_text(kind_name(decl))} {decl.name}"
    match decl:
        case ConnectConfig() | UdpConfig():
            return f"{what} at {decl.local}"
        case DataDecl():
            return f"{what}, {decl.type_name}"
        case _:
            return what


def _describe_entry_edit(edit: Edit) -> str:
    what = f"{kind_text(edit.kind)} {edit.name}"
    if edit.before is None or edit.after is None:
        keys = " ".join(_pair_text(key, value) for key, value in keys_of(edit.after)) if edit.after else ""
        return f"{what} is added: {keys}".removesuffix(": ") if edit.after else f"{what} is removed"
    before, now = (dict(forms_of(decl)[-2:][0]) for decl in (edit.before, edit.after))
    changes = [
        f"{key} {_value_text(before.get(key))} before, {_value_text(now.get(key))} now"
        for key in {**before, **now}
        if before.get(key) != now.get(key)
    ]
    return f"{what}: {', '.join(changes) or 'as it was'}"


def _value_text(value: KeyValue | None) -> str:
    return "none" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


def _restarts(edit: Edit, project: Project) -> list[str]:
    if edit.before is None or edit.after is None:
        return []
    if edit.kind in (INSTANCE, "peer"):
        return [f"{edit.kind} {edit.name}"]
    has: dict[str, Callable[[InstanceDecl], bool]] = {
        "connect": lambda i: (
            i.connect == edit.name and not i.on_config and not block_row(i.block).has_com_buffer
        ),
        "udp_config": lambda i: i.connect == edit.name and i.on_config,
        "combuffer": lambda i: i.connect == edit.name and block_row(i.block).has_com_buffer,
        "addr": lambda i: i.addr == edit.name,
    }
    if edit.kind not in has:
        return []
    return [
        f"{kind_text(edit.kind)} {edit.name}",
        *(f"instance {i.name}" for i in project.instances if has[edit.kind](i)),
    ]


def format_add(command: AddEntry | AddVariable) -> str:
    """Return the line from which `parse_add` makes this command."""
    if isinstance(command, AddEntry) and command.text:
        return command.text
    decl = command.decl
    start = f"add {kind_name(decl)} {decl.name}"
    match decl:
        case DataDecl():
            return " ".join([f"{start} {decl.type_name}", *(_pair_text(k, v) for k, v in keys_of(decl)[1:])])
        case MessageDecl():
            return f"{start} {f'peer={decl.peer} ' if decl.peer else ''}{decl.text}"
        case SequenceDecl():
            return " ".join([start, *decl.steps])
        case _:
            return " ".join([start, *(_pair_text(key, value) for key, value in keys_of(decl))])


def _pair_text(key: str, value: KeyValue) -> str:
    match value:
        case bool():
            return f"{key}={str(value).lower()}"
        case list():
            return " ".join(f"{key}={quote_text(text)}" for text in value)
        case str() if " " in value or not value:
            return f"{key}={quote_text(value)}"
        case _:
            return f"{key}={value}"
