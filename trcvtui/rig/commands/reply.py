"""`peer P1 reply on MATCH send PAYLOAD` and `peer P1 reply off`: what a peer answers by itself."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

from trcvtui.errors import UserError
from trcvtui.project.names import expected_name
from trcvtui.project.project import Project
from trcvtui.project.tables import shown, whole
from trcvtui.rig.commands.member_values import leaf_bytes, leaf_value
from trcvtui.rig.commands.read_payload import Payload, read_payload
from trcvtui.rig.commands.send import read_send
from trcvtui.rig.commands.stream_pattern import StreamPattern
from trcvtui.rig.commands.tokens import Words, value_of
from trcvtui.rig.commands.words import Contains, FieldIs, Match, Matches, ReplyOff, ReplyOn, Starts
from trcvtui.udt.layout.layout import lay_out

MOST_RULES: Final = 64  # of one peer
LONGEST: Final = 4096  # of what is looked for
LONGEST_ANSWER: Final = 65536
RULE: Final = whole(1, MOST_RULES)
SEND: Final = "send"


def read_reply(words: Words, project: Project, peer: str) -> ReplyOn | ReplyOff:
    """Return a `reply` command; raise UserError."""
    word = words.next("on or off")
    if word == "off":
        number = value_of(RULE, words.next(""), "", words.where) if words else 0
        words.finish()
        return ReplyOff(peer, number)
    if word != "on":
        raise words.wrong(shown(word), "on or off")
    return read_rule(words, project, peer)


def read_rule(words: Words, project: Project, peer: str) -> ReplyOn:
    """Return `MATCH send PAYLOAD`, as a project file has it in `replies`; raise UserError."""
    project = project.beside(peer)
    answer = words.apart(lambda word: word == SEND)
    kind = words.next(", ".join(MATCHES))
    if kind not in MATCHES:
        raise words.wrong(shown(kind), expected_name(kind, MATCHES, "match"))
    match = MATCHES[kind](words, project)
    words.finish()
    answer.next("send and a payload")
    send = read_send(answer, project, peer, holes_in_text=True)
    if len(send.payload) > LONGEST_ANSWER:
        raise words.wrong(f"{len(send.payload)} bytes", f"at most {LONGEST_ANSWER} of an answer")
    return ReplyOn(peer, match, send)


def _payload(words: Words, project: Project) -> Payload:
    payload = read_payload(words, project)
    if len(payload.content) > LONGEST:
        raise words.wrong(f"{len(payload.content)} bytes", f"at most {LONGEST} to look for")
    return payload


def _contains(words: Words, project: Project) -> Contains:
    payload = _payload(words, project)
    return Contains(payload.content, payload.text)


def _starts(words: Words, project: Project) -> Starts:
    payload = _payload(words, project)
    return Starts(payload.content, payload.text)


def _matches(words: Words, project: Project) -> Matches:
    expected = 'a pattern in double quotes such as "id=[0-9]+;"'
    written = words.next(expected)
    if len(written) < 3 or written[0] != '"' or written[-1] != '"':
        raise words.wrong(shown(written), expected)
    pattern = written[1:-1]
    try:
        found = re.compile(pattern.encode())
    except (re.error, OverflowError, RecursionError) as wrong:
        raise words.wrong(f"{shown(pattern)}: {wrong}", "a pattern") from None
    if found.search(b"") is not None:
        raise words.wrong(f"{shown(pattern)}, which fits where nothing is", "a pattern that needs a byte")
    try:
        StreamPattern(pattern.encode())
    except ValueError as wrong:
        raise words.wrong(f"{shown(pattern)}: {wrong}", "a pattern that a stream can be asked for") from None
    return Matches(pattern)


def _field(words: Words, project: Project) -> FieldIs:
    word = words.next("a UDT and a member such as Telegram.id = 7")
    target, equals, value = word.partition("=")
    if not equals:
        equals = words.next("= and a value")
        if equals != "=":
            raise words.wrong(shown(equals), "= and a value")
    value = value or words.next("a value")
    name, _, path = target.partition(".")
    if name.casefold() not in project.types.types:
        raise words.wrong(shown(name), expected_name(name, project.types.names(), "UDT"))
    layout = lay_out(project.types.named(name), project.rules_of(name), name)
    try:
        leaf = layout.leaf(layout.number_of(path))
    except UserError:
        raise words.wrong(f"'{target}', which is not one value", f"a member of {name}") from None
    content = leaf_bytes(layout, leaf, value, words.where)
    return FieldIs(name, leaf.path, leaf_value(layout, leaf, content), layout)


MATCHES: Final[dict[str, Callable[[Words, Project], Match]]] = {
    "contains": _contains,
    "starts": _starts,
    "regex": _matches,
    "field": _field,
}
