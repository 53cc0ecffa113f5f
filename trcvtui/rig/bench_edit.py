"""`add connect C3 LocalPort=2001`: one more entry of the project, its keys those of the project file.

A type, a message and the steps of a sequence stand as they are: `add data rx2 INT`, `add message m hex 01`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from trcvtui.errors import UserError, mistake
from trcvtui.plc.names import expected_name
from trcvtui.plc.project import DataDecl, MessageDecl, PeerDecl, Project, SequenceDecl
from trcvtui.plc.project_edit import FIELDS, given, read_entry, with_entry
from trcvtui.plc.project_keys import KIND_OF, KeyValue, keys_of
from trcvtui.plc.tables import Given, shown
from trcvtui.rig.bench_library import check_message, check_sequence
from trcvtui.rig.bench_routine import check_routine
from trcvtui.rig.bench_send import read_send
from trcvtui.rig.bench_tokens import Words
from trcvtui.rig.edit_words import Add, AddData
from trcvtui.rig.member_values import quoted, unquoted
from trcvtui.rig.wording import count

KINDS: Final = tuple(FIELDS)
CERTIFICATE: Final = "certificate"
LISTS: Final = ("says", "replies")  # given once for each
PAIRS: Final = "KEY=VALUE, once each, such as LocalPort=2000"


def read_add(words: Words, project: Project) -> Add | AddData:
    """Return `add KIND NAME ...`; raise UserError."""
    kind = words.next("what to add: " + ", ".join(KINDS))
    if kind not in KINDS:
        raise words.wrong(shown(kind), expected_name(kind, KINDS, "kind"))
    name = words.next(f"a name for the new {kind}")
    where = f"{words.where}: {kind} {name}"
    if kind == CERTIFICATE:  # its number is its name; `number=1` says so, too
        called: dict[str, Any] = {"number": Given("number", name.removeprefix("number="))}
    else:
        called = {"name": name}
    content = {**called, **_CONTENT.get(kind, _pairs)(words)}
    decl = read_entry(kind, content, project, where)
    match decl:
        case DataDecl():
            return AddData(decl.name, decl.type_name, decl)
        case MessageDecl():
            check_message(decl, project, where)
            _check_cuts(decl, project, where)
        case SequenceDecl():
            check_sequence(decl, project, where)
        case PeerDecl():
            if not content.keys() & {"remote", "local", "active", "udp"}:
                found = "neither remote nor local"
                raise mistake(where, found, "remote=@C1 (it connects), or local=127.0.0.1:4000 (it listens)")
            check_routine(decl, with_entry(project, decl), where)
        case _:
            pass
    return Add(decl)


def _check_cuts(decl: MessageDecl, project: Project, where: str) -> None:
    """Refuse cuts behind the end: such a message would go uncut."""
    peer = decl.peer or next((peer.name for peer in project.peers), "")
    send = read_send(Words(decl.text, where), project, peer)
    size = len(send.payload)
    if send.split and sum(send.split) >= size:
        cuts = ",".join(map(str, send.split))
        raise mistake(
            where, f"split={cuts} of {count(size, 'byte')}", f"cuts that add up to less than {size}"
        )


def _pairs(words: Words) -> dict[str, Any]:
    pairs: dict[str, str] = {}
    lists: dict[str, list[str]] = {}
    for word in words.rest():
        key, equals, text = word.partition("=")
        if not equals or key in pairs:
            raise words.wrong(shown(word), PAIRS)
        if key in LISTS:
            lists.setdefault(key, []).append(unquoted(text))
        else:
            pairs[key] = unquoted(text)
    return {**given(pairs.items()), **lists}


def _message(words: Words) -> dict[str, Any]:
    peer = words.next("").partition("=")[2] if words.peek().startswith("peer=") else ""
    text = words.rest_text("what stands after `peer P1 send`, such as hex 01 02")
    return {"text": text, **({"peer": peer} if peer else {})}


_CONTENT: Final[dict[str, Callable[[Words], dict[str, Any]]]] = {
    "data": lambda words: {"type": words.rest_text("an IEC type or a UDT")},
    "message": _message,
    "sequence": lambda words: {
        "steps": [words.next("the names of messages and pauses such as T#100ms"), *words.rest()]
    },
}


def add_line(command: Add | AddData) -> str:
    """Return the line that `read_add` reads as this command."""
    decl = command.decl
    start = f"add {KIND_OF[type(decl)]} {decl.name}"
    match decl:
        case DataDecl():
            return f"{start} {decl.type_name}"
        case MessageDecl():
            return f"{start} {f'peer={decl.peer} ' if decl.peer else ''}{decl.text}"
        case SequenceDecl():
            return " ".join([start, *decl.steps])
        case _:
            return " ".join([start, *(_pair(key, value) for key, value in keys_of(decl))])


def _pair(key: str, value: KeyValue) -> str:
    match value:
        case bool():
            return f"{key}={str(value).lower()}"
        case list():
            return " ".join(f"{key}={quoted(text)}" for text in value)
        case str() if " " in value or not value:
            return f"{key}={quoted(value)}"
        case _:
            return f"{key}={value}"


def refused(command: Add | AddData, project: Project, where: str) -> UserError | None:
    """Return why another project could not take the same entry; None: it could."""
    try:
        read_add(Words(add_line(command).removeprefix("add "), where), project)
    except UserError as wrong:
        return wrong
    return None
