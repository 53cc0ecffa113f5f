"""The `peer` commands: the connection and its trouble, what is sent, what is answered, what is tried."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Final, Protocol, cast

from msgspec import Struct

from trcvtui.blocks.table import block_row
from trcvtui.commands.conditions import parse_instance, parse_peer
from trcvtui.commands.counters_and_checksums import (
    DIGITS,
    KINDS,
    LEAST_SIZE,
    NUMBER,
    NUMBERS,
    Fill,
    Order,
    in_order,
)
from trcvtui.commands.tokens import (
    MOST_BYTES,
    Payload,
    Words,
    duration,
    leaf_bytes,
    parse_payload,
    text_bytes,
    text_in_quotes,
    value_of,
)
from trcvtui.commands.words import (
    DEFAULT_CHECK_NS,
    DEFAULT_CHECK_SIZE,
    BenchCommand,
    CheckOff,
    CheckOn,
    Contains,
    FieldIs,
    Match,
    PeerAction,
    PeerPlay,
    PeerSend,
    ReplyOff,
    ReplyOn,
    Starts,
    TrySplits,
    TryStop,
)
from trcvtui.errors import Problem, UserError, all_problems, noting
from trcvtui.project.project import MessageDecl, PeerDecl, Project, SequenceDecl
from trcvtui.project.tables import Kind, expected_name, shown, whole
from trcvtui.udt.byte_text import parse_hex
from trcvtui.udt.compare.checksums import CHECKSUMS
from trcvtui.udt.layout.layout import BYTE_ORDERS, lay_out
from trcvtui.udt.layout.values import decode_leaf

# -- what is sent --------------------------------------------------------------------------------------------

CHUNK_SIZE: Final = whole(1, MOST_BYTES)
TIMES: Final = whole(1, 1_000_000)
OFFSET: Final = whole(0, MOST_BYTES)
WIDTHS: Final[dict[str, Kind[int]]] = {NUMBER: whole(1, 8), DIGITS: whole(1, 19)}
TIMING: Final = ("split", "gap", "repeat", "every")
OPTIONS: Final = (*TIMING, *KINDS)
HEX_HOLE: Final = "{n}, {n:2}, {n:2:big} or a checksum such as {crc32} or {crc16-modbus:little}"
TEXT_HOLE: Final = "{n} or {n:3}, three digits"
FILL_FORM: Final = "an offset, a width and a byte order such as n=4:2:big or crc32=8:little"
_OPTION: Final = re.compile(rf"({'|'.join(OPTIONS)})=.*", re.DOTALL)
_HOLE: Final = re.compile(r"\{([^{}]*)\}")


def parse_send(words: Words, project: Project, peer: str, holes_in_text: bool = False) -> PeerSend:
    """Return what stands after `peer P1 send`; `holes_in_text`: {n} in a text is a number."""
    project = project.beside(peer)
    options = words.cut(lambda word: _OPTION.fullmatch(word) is not None)
    payload, fills = _read_message(words, project, holes_in_text)
    split: tuple[int, ...] = ()
    gaps: tuple[int, ...] = ()
    given = {"repeat": 1, "every": 0}
    for option in options:
        key, _, text = option.partition("=")
        if _OPTION.fullmatch(option) is None:
            raise words.wrong(shown(option), f"one of {'=, '.join(TIMING)}= or the end of the command")
        if key == "split":
            split = tuple([value_of(CHUNK_SIZE, size, "split=", words.where) for size in text.split(",")])
        elif key == "gap":
            gaps = tuple([duration(gap, "gap=", words.where) for gap in text.split(",")])
        elif key == "repeat":
            given[key] = value_of(TIMES, text, "repeat=", words.where)
        elif key == "every":
            given[key] = duration(text, "every=", words.where)
        else:
            fills.append(_fill_of(key, text, project, words))
    content = _with_room(payload.content, fills, words)
    return PeerSend(
        peer=peer,
        payload=content,
        split=split,
        gap_ns=gaps[-1] if gaps else 0,
        repeat=given["repeat"],
        every_ns=given["every"],
        text=payload.text,
        gaps_ns=gaps if len(set(gaps)) > 1 else (),
        fills=tuple(in_order(fills)),
    )


def _read_message(words: Words, project: Project, holes_in_text: bool) -> tuple[Payload, list[Fill]]:
    start, form = words.place, words.peek()
    has_holes = form == "hex" or (form == "text" and holes_in_text)
    if not has_holes or not _HOLE.search(words.to_come()):
        return parse_payload(words, project), []
    words.next("")
    if form == "hex":
        content, fills = _hex_with_holes(words.rest_text("hex bytes"), project, words)
    else:
        content, fills = _text_with_holes(words, project)
    return Payload(content, words.written(start)), fills


def _hex_with_holes(text: str, project: Project, words: Words) -> tuple[bytes, list[Fill]]:
    content, fills, at = bytearray(), list[Fill](), 0
    for hole in _HOLE.finditer(text):
        content += parse_hex(" " * at + text[at : hole.start()], f"{words.where}: hex")
        fills.append(_hole_of(hole[1], len(content), project, words))
        content += bytes(fills[-1].width)
        at = hole.end()
    content += parse_hex(" " * at + text[at:], f"{words.where}: hex")
    return bytes(content), fills


def _text_with_holes(words: Words, project: Project) -> tuple[bytes, list[Fill]]:
    text, content, fills, at = text_in_quotes(words), bytearray(), list[Fill](), 0
    for hole in _HOLE.finditer(text):
        name, _, width = hole[1].partition(":")
        if name != NUMBER:
            continue
        content += text_bytes(text[at : hole.start()], f"{words.where}: text")
        digits = WIDTHS[DIGITS].from_text(width or "1")
        if digits is None:
            raise words.wrong(shown(hole[0]), TEXT_HOLE)
        fills.append(Fill(DIGITS, len(content), digits, hole=True))
        content += b"0" * digits
        at = hole.end()
    content += text_bytes(text[at:], f"{words.where}: text")
    if not content:
        raise words.wrong('""', "at least one character")
    return bytes(content), fills


def _hole_of(text: str, offset: int, project: Project, words: Words) -> Fill:
    kind, *more = text.strip().split(":")
    if kind not in (NUMBER, *CHECKSUMS):
        raise words.wrong(f"'{{{text}}}'", HEX_HOLE)
    return _fill(kind, offset, more, f"{{{text}}}", HEX_HOLE, project, words, hole=True)


def _fill_of(kind: str, text: str, project: Project, words: Words) -> Fill:
    first, *more = text.split(":")
    offset = value_of(OFFSET, first, f"{kind}=", words.where)
    return _fill(kind, offset, more, f"{kind}={text}", FILL_FORM, project, words)


def _fill(
    kind: str,
    offset: int,
    more: list[str],
    written: str,
    form: str,
    project: Project,
    words: Words,
    hole: bool = False,
) -> Fill:
    """Return a fill of `[width][:order]`; a checksum has its own width."""
    width: int | None = CHECKSUMS[kind][0] if kind in CHECKSUMS else 1
    if kind in NUMBERS and more:
        width = WIDTHS[kind].from_text(more.pop(0))
    order = more.pop(0) if more and kind != DIGITS else None
    if width is None or more:
        raise words.wrong(shown(written), form)
    if order is not None and order not in BYTE_ORDERS:
        raise words.wrong(f"{shown(written)}", expected_name(order, BYTE_ORDERS, "byte order"))
    if kind in CHECKSUMS and offset == 0:
        raise words.wrong(shown(written), "at least one byte before the checksum")
    return Fill(kind, offset, width, _order(kind, width, order, project), hole)


def _order(kind: str, width: int, order: str | None, project: Project) -> Order:
    if width == 1 or kind == DIGITS:
        return "little"
    own = "little" if kind == "crc16-modbus" else project.layout.byte_order  # as Modbus sends it
    return cast(Order, order or own)


def _with_room(content: bytes, fills: list[Fill], words: Words) -> bytes:
    for fill in sorted(fills, key=lambda fill: fill.offset):
        if fill.offset > len(content):
            found = f"{fill.kind}={fill.offset} after {len(content)} bytes"
            raise words.wrong(found, f"an offset from 0 to {len(content)}")
        content += bytes(max(0, fill.offset + fill.width - len(content)))
    return content


# -- the messages and sequences of a project -----------------------------------------------------------------

MESSAGE: Final = "message"


def parse_any_send(words: Words, project: Project, peer: str) -> PeerSend:
    """Return `send message NAME`, or what a payload and its options say; raise UserError."""
    if words.peek() != MESSAGE:
        return parse_send(words, project, peer)
    words.next("")
    name = words.next("the name of a message")
    words.finish()
    return _send_of(_message(name, peer, project, words), peer, project, _place(project, name))


def parse_play(words: Words, project: Project, peer: str) -> PeerPlay:
    name = words.next("the name of a sequence")
    words.finish()
    known = {sequence.name: sequence for sequence in project.sequences}
    if name not in known:
        raise words.unknown(name, known, "sequence")
    return PeerPlay(peer, name, _steps_of(known[name], peer, project, words))


def _message(name: str, peer: str, project: Project, words: Words) -> MessageDecl:
    known = {m.name: m for m in project.messages if m.peer in ("", peer)}
    if name not in known:
        raise words.unknown(name, known, "message")
    return known[name]


def _place(project: Project, message: str) -> str:
    return f"{project.path}: {MESSAGE} {message}"


def _send_of(message: MessageDecl, peer: str, project: Project, where: str) -> PeerSend:
    send = parse_send(Words(message.text, where), project, peer)
    return replace(send, text=f"{MESSAGE} {message.name}")


def _steps_of(
    sequence: SequenceDecl, peer: str, project: Project, words: Words
) -> tuple[tuple[int, PeerSend], ...]:
    """Return each message with the pause before it in ns."""
    steps, pause = [], 0
    for step in sequence.steps:
        if "#" in step:
            pause += duration(step, "", words.where)
        else:
            message = _message(step, peer, project, words)
            steps.append((pause, _send_of(message, peer, project, _place(project, step))))
            pause = 0
    return tuple(steps)


def check_library(project: Project) -> None:
    """Raise UserError with every mistake in the messages and sequences of a project."""
    with all_problems() as problems:
        for message in project.messages:
            with noting(problems):
                check_message(message, project, _place(project, message.name))
        for sequence in project.sequences:
            with noting(problems):
                check_sequence(sequence, project, f"{project.path}: sequence {sequence.name}")


def check_message(message: MessageDecl, project: Project, where: str) -> None:
    """Raise UserError when a message says nothing that can be sent."""
    first = project.peers[0].name if project.peers else ""
    _send_of(message, message.peer or first, project, where)


def check_sequence(sequence: SequenceDecl, project: Project, where: str) -> None:
    """Raise UserError with every step that is no message and no pause."""
    names = [message.name for message in project.messages]
    with all_problems() as problems:
        for number, step in enumerate(sequence.steps, 1):
            place = f"{where}: steps #{number}"
            with noting(problems):
                if "#" in step:
                    duration(step, "", place)
                elif step not in names:
                    expected = f"{expected_name(step, names, 'message')}, or a pause such as T#100ms"
                    problems.append(Problem(place, shown(step), expected))


# -- what is tried and checked -------------------------------------------------------------------------------

LONGEST: Final = 1024  # a message of n bytes takes n runs of some scans each
DIFFER: Final = whole(0, LONGEST - 1)
ANY: Final = "any"


def parse_trial(words: Words, project: Project, peer: str) -> TrySplits | TryStop:
    if words.peek() == "stop":
        words.next("")
        return TryStop(peer)
    aim = words.apart(lambda word: word == "on")
    payload = parse_payload(words, project)
    if not 2 <= len(payload.content) <= LONGEST:
        raise words.wrong(f"{len(payload.content)} byte(s)", f"2 to {LONGEST} bytes, which can be cut")
    aim.next("on and the name of an instance that receives")
    instance = parse_instance(aim, project)
    if not block_row(instance.block).receives_stream:
        raise aim.wrong(f"'{instance.name}', a {instance.block}", "an instance that receives")
    gap, differ = 0, 0
    while aim:
        word = aim.next("")
        key, equals, text = word.partition("=")
        if key == "gap" and equals:
            gap = duration(text, "gap=", aim.where)
        elif key == "differ" and equals:
            differ = -1 if text == ANY else value_of(DIFFER, text, "differ=", aim.where)
        else:
            raise aim.wrong(shown(word), "gap=T#30ms, differ=0, differ=any or the end of the command")
    return TrySplits(peer, payload.content, instance.name, gap, None if differ < 0 else differ, payload.text)


SIZE: Final = whole(LEAST_SIZE, 65507)  # the largest datagram
FORM: Final = "size=64, every=T#100ms, on and an instance, or the end of the command"


def parse_check(words: Words, project: Project, peer: str) -> CheckOn | CheckOff:
    if words.choice("on", "off") == "off":
        words.finish()
        return CheckOff(peer)
    size, every, instance = DEFAULT_CHECK_SIZE, DEFAULT_CHECK_NS, ""
    while words:
        key, equals, text = words.next("").partition("=")
        if key == "size" and equals:
            size = value_of(SIZE, text, "size=", words.where)
        elif key == "every" and equals:
            every = duration(text, "every=", words.where)
        elif key == "on" and not equals:
            instance = _receiver(words, project)
        else:
            raise words.wrong(shown(key), FORM)
    return CheckOn(peer, size, every, instance)


def _receiver(words: Words, project: Project) -> str:
    instance = parse_instance(words, project)
    if not block_row(instance.block).receives_stream or instance.data is None:
        raise words.wrong(f"'{instance.name}', a {instance.block}", "an instance that receives, with DATA")
    return instance.name


# -- what is answered ----------------------------------------------------------------------------------------

MOST_RULES: Final = 64  # of one peer
LONGEST_MATCH: Final = 4096  # of what is looked for
LONGEST_ANSWER: Final = 65536
RULE: Final = whole(1, MOST_RULES)
SEND: Final = "send"


def parse_reply(words: Words, project: Project, peer: str) -> ReplyOn | ReplyOff:
    if words.choice("on", "off") == "off":
        number = value_of(RULE, words.next(""), "", words.where) if words else 0
        words.finish()
        return ReplyOff(peer, number)
    return parse_rule(words, project, peer)


def parse_rule(words: Words, project: Project, peer: str) -> ReplyOn:
    """Return `MATCH send PAYLOAD`, as a project file has it in `replies`; raise UserError."""
    project = project.beside(peer)
    answer = words.apart(lambda word: word == SEND)
    kind = words.next(", ".join(MATCHES))
    if kind not in MATCHES:
        raise words.unknown(kind, MATCHES, "match")
    match = MATCHES[kind](words, project)
    words.finish()
    answer.next("send and a payload")
    send = parse_send(answer, project, peer, holes_in_text=True)
    if len(send.payload) > LONGEST_ANSWER:
        raise words.wrong(f"{len(send.payload)} bytes", f"at most {LONGEST_ANSWER} of an answer")
    return ReplyOn(peer, match, send)


def _payload(words: Words, project: Project) -> tuple[bytes, str]:
    payload = parse_payload(words, project)
    if len(payload.content) > LONGEST_MATCH:
        raise words.wrong(f"{len(payload.content)} bytes", f"at most {LONGEST_MATCH} to look for")
    return payload.content, payload.text


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
        raise words.unknown(name, project.types.names(), "UDT")
    layout = lay_out(project.types.named(name), project.rules_of(name), name)
    try:
        leaf = layout.leaf(layout.number_of(path))
    except UserError:
        raise words.wrong(f"'{target}', which is not one value", f"a member of {name}") from None
    content = leaf_bytes(layout, leaf, value, words.where)
    return FieldIs(name, leaf.path, decode_leaf(layout, leaf, content), layout)


MATCHES: Final[dict[str, Callable[[Words, Project], Match]]] = {
    "contains": lambda words, project: Contains(*_payload(words, project)),
    "starts": lambda words, project: Starts(*_payload(words, project)),
    "field": _field,
}


# -- what the peers of a project file do by themselves -------------------------------------------------------


class Routine(Struct, frozen=True):
    """The messages of one peer, read; times in ns (0: never)."""

    says: tuple[PeerSend, ...]
    every_ns: int
    reconnect_ns: int


def read_replies(project: Project) -> tuple[ReplyOn, ...]:
    """Return the reply rules that the peers of a project begin with; raise UserError with all mistakes."""
    rules: list[ReplyOn] = []
    with all_problems() as problems:
        for decl in project.peers:
            rules += _read_rules(decl, project, f"{project.path}: peer {decl.name}", problems)
    return tuple(rules)


def read_routines(project: Project) -> dict[str, Routine]:
    """Return what the peers of a project do by themselves; raise UserError with every wrong message."""
    routines: dict[str, Routine] = {}
    with all_problems() as problems:
        for decl in project.peers:
            if decl.says or decl.reconnect_ns:
                says = _read_says(decl, project, f"{project.path}: peer {decl.name}", problems)
                routines[decl.name] = Routine(says, decl.every_ns, decl.reconnect_ns)
    return routines


def check_routine(decl: PeerDecl, project: Project, where: str) -> None:
    """Raise UserError with every mistake in what a peer does by itself."""
    with all_problems() as problems:
        _read_rules(decl, project, where, problems)
        _read_says(decl, project, where, problems)


def _read_rules(decl: PeerDecl, project: Project, where: str, problems: list[Problem]) -> list[ReplyOn]:
    rules = []
    if len(decl.replies) > MOST_RULES:
        problems.append(Problem(f"{where}: replies", f"{len(decl.replies)} rules", f"at most {MOST_RULES}"))
    for number, text in enumerate(decl.replies, 1):
        with noting(problems):
            rules.append(parse_rule(Words(text, f"{where}: replies #{number}"), project, decl.name))
    return rules


def _read_says(decl: PeerDecl, project: Project, where: str, problems: list[Problem]) -> tuple[PeerSend, ...]:
    read = []
    for number, text in enumerate(decl.says, 1):
        words = Words(text, f"{where}: says #{number}")
        with noting(problems):
            send = parse_any_send(words, project, decl.name)
            words.finish()
            read.append(send)
    return tuple(read)


# -- every verb ----------------------------------------------------------------------------------------------


class ActsOnPeer(Protocol):
    """What the rows ask of a peer; each answers what is wrong, or ""."""

    @property
    def replies(self) -> ActsOnReplies: ...

    def connect(self, now: int) -> str: ...

    def listen(self) -> str: ...

    def close(self) -> str: ...

    def rst(self) -> str: ...

    def shutdown(self) -> str: ...

    def stall(self) -> str: ...

    def resume(self) -> str: ...

    def send(self, command: PeerSend, now: int) -> str: ...

    def play(self, command: PeerPlay, now: int) -> str: ...


class ActsOnReplies(Protocol):
    """What the rows ask of the rules by which a peer answers."""

    def add(self, rule: ReplyOn) -> str: ...

    def remove(self, number: int, peer: str) -> str: ...


# The words of a peer with nothing after them, and what it does at a time in ns.
SIMPLE: Final[dict[str, Callable[[ActsOnPeer, int], str]]] = {
    "connect": lambda peer, now: peer.connect(now),  # one attempt of an active peer
    "listen": lambda peer, now: peer.listen(),  # a passive one opens its listener, where it has none
    "close": lambda peer, now: peer.close(),  # FIN
    "rst": lambda peer, now: peer.rst(),  # RST
    "shutdown": lambda peer, now: peer.shutdown(),  # FIN, but it keeps reading (half-close)
    "stall": lambda peer, now: peer.stall(),  # it stops reading, so that the window closes
    "resume": lambda peer, now: peer.resume(),  # it reads again
}
TALKS: Final[dict[str, Callable[[Words, Project, str], BenchCommand]]] = {
    "send": parse_any_send,
    "play": parse_play,
    "reply": parse_reply,
    "check": parse_check,
    "try-splits": parse_trial,
}
VERBS: Final = (*SIMPLE, *TALKS)
OF_CONNECTIONS: Final = ("connect", "rst", "shutdown", "try-splits")
OF_UDP: Final = "one of " + ", ".join(verb for verb in VERBS if verb not in OF_CONNECTIONS)


def parse_peer_command(words: Words, project: Project) -> BenchCommand:
    peer = parse_peer(words, project)
    verb = words.next(f"one of {', '.join(VERBS)}")
    if verb not in VERBS:
        raise words.unknown(verb, VERBS, "peer command")
    if verb in SIMPLE:
        words.finish()
    if peer.udp and verb in OF_CONNECTIONS:
        raise words.wrong(f"{verb} of the UDP peer '{peer.name}', which has no connection", OF_UDP)
    if verb in TALKS:
        return TALKS[verb](words, project, peer.name)
    if verb == "connect" and not peer.active:
        raise words.wrong(
            f"connect of the passive peer '{peer.name}'", "listen, or a peer with active = true"
        )
    if verb == "listen" and peer.active:
        raise words.wrong(
            f"listen of the active peer '{peer.name}'", "connect, or a peer with active = false"
        )
    return PeerAction(peer.name, verb)
