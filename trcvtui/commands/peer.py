"""Reads the `peer` commands: connection verbs, `send`, `play`, `reply`, `check` and `try-splits`."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Final, Protocol, cast

from msgspec import Struct

from trcvtui.blocks.table import block_row
from trcvtui.commands.conditions import parse_instance, parse_peer
from trcvtui.commands.counters_and_checksums import (
    BINARY_NUMBER,
    DECIMAL_DIGITS,
    FILL_KINDS,
    LEAST_FRAME_SIZE,
    NUMBER_KINDS,
    ByteOrder,
    Fill,
    sort_fills,
)
from trcvtui.commands.tokens import (
    MOST_BYTES,
    Payload,
    Words,
    leaf_bytes,
    parse_delay,
    parse_payload,
    parse_value,
    read_quoted_text,
    text_bytes,
)
from trcvtui.commands.words import (
    DEFAULT_CHECK_NS,
    DEFAULT_CHECK_SIZE,
    AddReply,
    BenchCommand,
    Contains,
    FieldIs,
    Match,
    NumberedFramesOff,
    NumberedFramesOn,
    PeerAction,
    PeerPlaySequence,
    PeerSend,
    RemoveReplies,
    StartsWith,
    StopTrySplits,
    TrySplits,
)
from trcvtui.errors import Problem, UserError, collect_problems, raise_all_problems
from trcvtui.project.project import MessageDecl, PeerDecl, Project, SequenceDecl
from trcvtui.project.tables import Kind, expected_name, integer, quote
from trcvtui.udt.byte_text import parse_hex
from trcvtui.udt.compare.checksums import CHECKSUMS
from trcvtui.udt.layout.layout import BYTE_ORDERS, lay_out
from trcvtui.udt.layout.values import decode_leaf
from trcvtui.wording import count

# -- what is sent --------------------------------------------------------------------------------------------

CHUNK_SIZE: Final = integer(1, MOST_BYTES)
REPEAT_KIND: Final = integer(1, 1_000_000)
OFFSET_KIND: Final = integer(0, MOST_BYTES)
WIDTH_KINDS: Final[dict[str, Kind[int]]] = {BINARY_NUMBER: integer(1, 8), DECIMAL_DIGITS: integer(1, 19)}
TIMING: Final = ("split", "gap", "repeat", "every")
SEND_OPTION_NAMES: Final = (*TIMING, *FILL_KINDS)
HEX_HOLE_FORM: Final = "{n}, {n:2}, {n:2:big} or a checksum such as {crc32} or {crc16-modbus:little}"
TEXT_HOLE_FORM: Final = "{n}, or {n:3} for three digits"
FILL_FORM: Final = "an offset, a width and a byte order such as n=4:2:big or crc32=8:little"
_OPTION_PATTERN: Final = re.compile(rf"({'|'.join(SEND_OPTION_NAMES)})=.*", re.DOTALL)
_HOLE_PATTERN: Final = re.compile(r"\{([^{}]*)\}")


def parse_send(words: Words, project: Project, peer: str, holes_in_text: bool = False) -> PeerSend:
    """Read the message after `peer P1 send`. If `holes_in_text`, {n} in a text is the message's number."""
    project = project.with_peer_layout(peer)
    options = words.cut_tail_words(lambda word: _OPTION_PATTERN.fullmatch(word) is not None)
    payload, fills = _read_message(words, project, holes_in_text)
    split: tuple[int, ...] = ()
    gaps: tuple[int, ...] = ()
    given = {"repeat": 1, "every": 0}
    for option in options:
        key, _, text = option.partition("=")
        if _OPTION_PATTERN.fullmatch(option) is None:
            raise words.error(quote(option), f"one of {'=, '.join(TIMING)}= or the end of the command")
        if key == "split":
            split = tuple([parse_value(CHUNK_SIZE, size, "split=", words.where) for size in text.split(",")])
        elif key == "gap":
            gaps = tuple([parse_delay(gap, "gap=", words.where) for gap in text.split(",")])
        elif key == "repeat":
            given[key] = parse_value(REPEAT_KIND, text, "repeat=", words.where)
        elif key == "every":
            given[key] = parse_delay(text, "every=", words.where)
        else:
            fills.append(_parse_fill_option(key, text, project, words))
    content = _extend_for_fills(payload.content, fills, words)
    return PeerSend(
        peer=peer,
        payload=content,
        split=split,
        gap_ns=gaps[-1] if gaps else 0,
        repeat=given["repeat"],
        every_ns=given["every"],
        text=payload.text,
        gaps_ns=gaps if len(set(gaps)) > 1 else (),
        fills=tuple(sort_fills(fills)),
    )


def _read_message(words: Words, project: Project, holes_in_text: bool) -> tuple[Payload, list[Fill]]:
    start, form = words.place, words.peek()
    has_holes = form == "hex" or (form == "text" and holes_in_text)
    if not has_holes or not _HOLE_PATTERN.search(words.remaining_text()):
        return parse_payload(words, project), []
    words.next("")
    if form == "hex":
        content, fills = _parse_hex_holes(words.take_rest_text("hex bytes"), project, words)
    else:
        content, fills = _parse_text_holes(words, project)
    return Payload(content, words.text_since(start)), fills


def _parse_hex_holes(text: str, project: Project, words: Words) -> tuple[bytes, list[Fill]]:
    content, fills, at = bytearray(), list[Fill](), 0
    for hole in _HOLE_PATTERN.finditer(text):
        content += parse_hex(" " * at + text[at : hole.start()], f"{words.where}: hex")
        fills.append(_parse_hole(hole[1], len(content), project, words))
        content += bytes(fills[-1].width)
        at = hole.end()
    content += parse_hex(" " * at + text[at:], f"{words.where}: hex")
    return bytes(content), fills


def _parse_text_holes(words: Words, project: Project) -> tuple[bytes, list[Fill]]:
    text, content, fills, at = read_quoted_text(words), bytearray(), list[Fill](), 0
    for hole in _HOLE_PATTERN.finditer(text):
        name, _, width = hole[1].partition(":")
        if name != BINARY_NUMBER:
            continue
        content += text_bytes(text[at : hole.start()], f"{words.where}: text")
        digits = WIDTH_KINDS[DECIMAL_DIGITS].from_text(width or "1")
        if digits is None:
            raise words.error(quote(hole[0]), TEXT_HOLE_FORM)
        fills.append(Fill(DECIMAL_DIGITS, len(content), digits, hole=True))
        content += b"0" * digits
        at = hole.end()
    content += text_bytes(text[at:], f"{words.where}: text")
    if not content:
        raise words.error('""', "at least one character")
    return bytes(content), fills


def _parse_hole(text: str, offset: int, project: Project, words: Words) -> Fill:
    kind, *more = text.strip().split(":")
    if kind not in (BINARY_NUMBER, *CHECKSUMS):
        raise words.error(f"'{{{text}}}'", HEX_HOLE_FORM)
    return _make_fill(kind, offset, more, f"{{{text}}}", HEX_HOLE_FORM, project, words, hole=True)


def _parse_fill_option(kind: str, text: str, project: Project, words: Words) -> Fill:
    first, *more = text.split(":")
    offset = parse_value(OFFSET_KIND, first, f"{kind}=", words.where)
    return _make_fill(kind, offset, more, f"{kind}={text}", FILL_FORM, project, words)


def _make_fill(
    kind: str,
    offset: int,
    more: list[str],
    written: str,
    form: str,
    project: Project,
    words: Words,
    hole: bool = False,
) -> Fill:
    """Return a fill from its width and byte order, `[width][:order]`. The width of a checksum is fixed."""
    width: int | None = CHECKSUMS[kind][0] if kind in CHECKSUMS else 1
    if kind in NUMBER_KINDS and more:
        width = WIDTH_KINDS[kind].from_text(more.pop(0))
    order = more.pop(0) if more and kind != DECIMAL_DIGITS else None
    if width is None or more:
        raise words.error(quote(written), form)
    if order is not None and order not in BYTE_ORDERS:
        raise words.error(f"{quote(written)}", expected_name(order, BYTE_ORDERS, "byte order"))
    if kind in CHECKSUMS and offset == 0:
        raise words.error(quote(written), "at least one byte before the checksum")
    return Fill(kind, offset, width, _fill_byte_order(kind, width, order, project), hole)


def _fill_byte_order(kind: str, width: int, order: str | None, project: Project) -> ByteOrder:
    if width == 1 or kind == DECIMAL_DIGITS:
        return "little"
    own = "little" if kind == "crc16-modbus" else project.layout.byte_order  # as Modbus sends it
    return cast(ByteOrder, order or own)


def _extend_for_fills(content: bytes, fills: list[Fill], words: Words) -> bytes:
    for fill in sorted(fills, key=lambda fill: fill.offset):
        if fill.offset > len(content):
            found = f"{fill.kind}={fill.offset} for a message of {count(len(content), 'byte')}"
            raise words.error(found, f"an offset from 0 to {len(content)}")
        content += bytes(max(0, fill.offset + fill.width - len(content)))
    return content


# -- the messages and sequences of a project -----------------------------------------------------------------

MESSAGE_WORD: Final = "message"


def parse_any_send(words: Words, project: Project, peer: str) -> PeerSend:
    """Read `send message NAME`, or a payload with its options. Raise UserError for a mistake."""
    if words.peek() != MESSAGE_WORD:
        return parse_send(words, project, peer)
    words.next("")
    name = words.next("the name of a message")
    words.expect_end()
    return _parse_message(
        _find_message(name, peer, project, words), peer, project, _message_place(project, name)
    )


def parse_play(words: Words, project: Project, peer: str) -> PeerPlaySequence:
    name = words.next("the name of a sequence")
    words.expect_end()
    known = {sequence.name: sequence for sequence in project.sequences}
    if name not in known:
        raise words.make_unknown_error(name, known, "sequence")
    return PeerPlaySequence(peer, name, _parse_steps(known[name], peer, project, words))


def _find_message(name: str, peer: str, project: Project, words: Words) -> MessageDecl:
    known = {m.name: m for m in project.messages if m.peer in ("", peer)}
    if name not in known:
        raise words.make_unknown_error(name, known, "message")
    return known[name]


def _message_place(project: Project, message: str) -> str:
    return f"{project.path}: {MESSAGE_WORD} {message}"


def _parse_message(message: MessageDecl, peer: str, project: Project, where: str) -> PeerSend:
    send = parse_send(Words(message.text, where), project, peer)
    return replace(send, text=f"{MESSAGE_WORD} {message.name}")


def _parse_steps(
    sequence: SequenceDecl, peer: str, project: Project, words: Words
) -> tuple[tuple[int, PeerSend], ...]:
    """Return each message of a sequence, with the pause before it in ns."""
    steps, pause = [], 0
    for step in sequence.steps:
        if "#" in step:
            pause += parse_delay(step, "", words.where)
        else:
            message = _find_message(step, peer, project, words)
            steps.append((pause, _parse_message(message, peer, project, _message_place(project, step))))
            pause = 0
    return tuple(steps)


def check_all_messages(project: Project) -> None:
    """Raise UserError with every mistake in the messages and sequences of a project."""
    with raise_all_problems() as problems:
        for message in project.messages:
            with collect_problems(problems):
                check_message(message, project, _message_place(project, message.name))
        for sequence in project.sequences:
            with collect_problems(problems):
                check_sequence(sequence, project, f"{project.path}: sequence {sequence.name}")


def check_message(message: MessageDecl, project: Project, where: str) -> None:
    """Raise UserError if a message cannot be sent."""
    first = project.peers[0].name if project.peers else ""
    _parse_message(message, message.peer or first, project, where)


def check_sequence(sequence: SequenceDecl, project: Project, where: str) -> None:
    """Raise UserError with every step that is neither a message nor a pause."""
    names = [message.name for message in project.messages]
    with raise_all_problems() as problems:
        for number, step in enumerate(sequence.steps, 1):
            place = f"{where}: steps #{number}"
            with collect_problems(problems):
                if "#" in step:
                    parse_delay(step, "", place)
                elif step not in names:
                    expected = f"{expected_name(step, names, 'message')}, or a pause such as T#100ms"
                    problems.append(Problem(place, quote(step), expected))


# -- what is tried and checked -------------------------------------------------------------------------------

LONGEST_TRIAL: Final = 1024  # a message of n bytes takes n runs of some scans each
DIFFER_KIND: Final = integer(0, LONGEST_TRIAL - 1)
ANY_WORD: Final = "any"


def parse_trial(words: Words, project: Project, peer: str) -> TrySplits | StopTrySplits:
    if words.peek() == "stop":
        words.next("")
        return StopTrySplits(peer)
    aim = words.cut_tail(lambda word: word == "on")
    payload = parse_payload(words, project)
    if not 2 <= len(payload.content) <= LONGEST_TRIAL:
        raise words.error(count(len(payload.content), "byte"), f"2 to {LONGEST_TRIAL} bytes to cut")
    aim.next("`on` and the name of a receiving instance")
    instance = parse_instance(aim, project)
    if not block_row(instance.block).receives_stream:
        raise aim.error(f"'{instance.name}', a {instance.block}", "a receiving instance")
    gap, differ = 0, 0
    while aim:
        word = aim.next("")
        key, equals, text = word.partition("=")
        if key == "gap" and equals:
            gap = parse_delay(text, "gap=", aim.where)
        elif key == "differ" and equals:
            differ = -1 if text == ANY_WORD else parse_value(DIFFER_KIND, text, "differ=", aim.where)
        else:
            raise aim.error(quote(word), "gap=T#30ms, differ=0, differ=any or the end of the command")
    return TrySplits(peer, payload.content, instance.name, gap, None if differ < 0 else differ, payload.text)


FRAME_SIZE_KIND: Final = integer(LEAST_FRAME_SIZE, 65507)  # the largest datagram
CHECK_FORM: Final = "size=64, every=T#100ms, on INSTANCE or the end of the command"


def parse_check(words: Words, project: Project, peer: str) -> NumberedFramesOn | NumberedFramesOff:
    if words.next_choice("on", "off") == "off":
        words.expect_end()
        return NumberedFramesOff(peer)
    size, every, instance = DEFAULT_CHECK_SIZE, DEFAULT_CHECK_NS, ""
    while words:
        key, equals, text = words.next("").partition("=")
        if key == "size" and equals:
            size = parse_value(FRAME_SIZE_KIND, text, "size=", words.where)
        elif key == "every" and equals:
            every = parse_delay(text, "every=", words.where)
        elif key == "on" and not equals:
            instance = _read_receiver(words, project)
        else:
            raise words.error(quote(key), CHECK_FORM)
    return NumberedFramesOn(peer, size, every, instance)


def _read_receiver(words: Words, project: Project) -> str:
    instance = parse_instance(words, project)
    if not block_row(instance.block).receives_stream or instance.data is None:
        raise words.error(f"'{instance.name}', a {instance.block}", "a receiving instance whose DATA is set")
    return instance.name


# -- what is answered ----------------------------------------------------------------------------------------

MOST_RULES: Final = 64  # of one peer
LONGEST_MATCH: Final = 4096  # bytes to look for
LONGEST_ANSWER: Final = 65536
RULE_NUMBER_KIND: Final = integer(1, MOST_RULES)
SEND_WORD: Final = "send"


def parse_reply(words: Words, project: Project, peer: str) -> AddReply | RemoveReplies:
    if words.next_choice("on", "off") == "off":
        number = parse_value(RULE_NUMBER_KIND, words.next(""), "", words.where) if words else 0
        words.expect_end()
        return RemoveReplies(peer, number)
    return parse_rule(words, project, peer)


def parse_rule(words: Words, project: Project, peer: str) -> AddReply:
    """Read `MATCH send PAYLOAD`, as in `replies` of a project file. Raise UserError for a mistake."""
    project = project.with_peer_layout(peer)
    answer = words.cut_tail(lambda word: word == SEND_WORD)
    kind = words.next("one of " + ", ".join(MATCH_READERS))
    if kind not in MATCH_READERS:
        raise words.make_unknown_error(kind, MATCH_READERS, "match")
    match = MATCH_READERS[kind](words, project)
    words.expect_end()
    answer.next("`send` and a payload")
    send = parse_send(answer, project, peer, holes_in_text=True)
    if len(send.payload) > LONGEST_ANSWER:
        raise words.error(f"{len(send.payload)} bytes", f"at most {LONGEST_ANSWER} bytes in an answer")
    return AddReply(peer, match, send)


def _read_match_bytes(words: Words, project: Project) -> tuple[bytes, str]:
    payload = parse_payload(words, project)
    if len(payload.content) > LONGEST_MATCH:
        raise words.error(f"{len(payload.content)} bytes", f"at most {LONGEST_MATCH} bytes to look for")
    return payload.content, payload.text


def _read_field_match(words: Words, project: Project) -> FieldIs:
    word = words.next("a UDT and a member such as Telegram.id = 7")
    target, equals, value = word.partition("=")
    if not equals:
        equals = words.next("= and a value")
        if equals != "=":
            raise words.error(quote(equals), "= and a value")
    value = value or words.next("a value")
    name, _, path = target.partition(".")
    if name.casefold() not in project.types.types:
        raise words.make_unknown_error(name, project.types.names(), "UDT")
    layout = lay_out(project.types.get_type(name), project.layout_rules_of(name), name)
    try:
        leaf = layout.leaf(layout.leaf_number(path))
    except UserError:
        raise words.error(f"'{target}', which is not a single value", f"a member of {name}") from None
    content = leaf_bytes(layout, leaf, value, words.where)
    return FieldIs(name, leaf.path, decode_leaf(layout, leaf, content), layout)


MATCH_READERS: Final[dict[str, Callable[[Words, Project], Match]]] = {
    "contains": lambda words, project: Contains(*_read_match_bytes(words, project)),
    "starts": lambda words, project: StartsWith(*_read_match_bytes(words, project)),
    "field": _read_field_match,
}


# -- what the peers of a project file do by themselves -------------------------------------------------------


class PeerRoutine(Struct, frozen=True):
    """What one peer sends by itself, and when it reconnects. Times are in ns, and 0 means never."""

    says: tuple[PeerSend, ...]
    every_ns: int
    reconnect_ns: int


def read_replies(project: Project) -> tuple[AddReply, ...]:
    """Return the reply rules in the `replies` of all peers. Raise UserError with all mistakes."""
    rules: list[AddReply] = []
    with raise_all_problems() as problems:
        for decl in project.peers:
            rules += _read_rules(decl, project, f"{project.path}: peer {decl.name}", problems)
    return tuple(rules)


def read_routines(project: Project) -> dict[str, PeerRoutine]:
    """Return what each peer does by itself; raise UserError with every wrong message."""
    routines: dict[str, PeerRoutine] = {}
    with raise_all_problems() as problems:
        for decl in project.peers:
            if decl.says or decl.reconnect_ns:
                says = _read_says(decl, project, f"{project.path}: peer {decl.name}", problems)
                routines[decl.name] = PeerRoutine(says, decl.every_ns, decl.reconnect_ns)
    return routines


def check_routine(decl: PeerDecl, project: Project, where: str) -> None:
    """Raise UserError with every mistake in what a peer does by itself."""
    with raise_all_problems() as problems:
        _read_rules(decl, project, where, problems)
        _read_says(decl, project, where, problems)


def _read_rules(decl: PeerDecl, project: Project, where: str, problems: list[Problem]) -> list[AddReply]:
    rules = []
    if len(decl.replies) > MOST_RULES:
        problems.append(Problem(f"{where}: replies", f"{len(decl.replies)} rules", f"at most {MOST_RULES}"))
    for number, text in enumerate(decl.replies, 1):
        with collect_problems(problems):
            rules.append(parse_rule(Words(text, f"{where}: replies #{number}"), project, decl.name))
    return rules


def _read_says(decl: PeerDecl, project: Project, where: str, problems: list[Problem]) -> tuple[PeerSend, ...]:
    read = []
    for number, text in enumerate(decl.says, 1):
        words = Words(text, f"{where}: says #{number}")
        with collect_problems(problems):
            send = parse_any_send(words, project, decl.name)
            words.expect_end()
            read.append(send)
    return tuple(read)


# -- every verb ----------------------------------------------------------------------------------------------


class PeerActions(Protocol):
    """The methods of a peer that bench commands call. Each method returns what is wrong, or ""."""

    @property
    def replies(self) -> ReplyActions: ...

    def connect(self, now: int) -> str: ...

    def listen(self) -> str: ...

    def close(self) -> str: ...

    def rst(self) -> str: ...

    def shutdown(self) -> str: ...

    def stall(self) -> str: ...

    def resume(self) -> str: ...

    def send(self, command: PeerSend, now: int) -> str: ...

    def play(self, command: PeerPlaySequence, now: int) -> str: ...


class ReplyActions(Protocol):
    """The methods of a peer's reply rules that bench commands call."""

    def add(self, rule: AddReply) -> str: ...

    def remove(self, number: int, peer: str) -> str: ...


# The verbs of a peer without arguments, and what it does then; `now` in ns.
SIMPLE_VERBS: Final[dict[str, Callable[[PeerActions, int], str]]] = {
    "connect": lambda peer, now: peer.connect(now),  # one attempt of an active peer
    "listen": lambda peer, now: peer.listen(),  # a passive one opens its listener if it has none
    "close": lambda peer, now: peer.close(),  # FIN
    "rst": lambda peer, now: peer.rst(),  # RST
    "shutdown": lambda peer, now: peer.shutdown(),  # FIN, but it keeps reading (half-close)
    "stall": lambda peer, now: peer.stall(),  # it stops reading, so that the window closes
    "resume": lambda peer, now: peer.resume(),  # it reads again
}
VERB_READERS: Final[dict[str, Callable[[Words, Project, str], BenchCommand]]] = {
    "send": parse_any_send,
    "play": parse_play,
    "reply": parse_reply,
    "check": parse_check,
    "try-splits": parse_trial,
}
ALL_PEER_VERBS: Final = (*SIMPLE_VERBS, *VERB_READERS)
CONNECTION_VERBS: Final = ("connect", "rst", "shutdown", "try-splits")
UDP_VERBS_FORM: Final = "one of " + ", ".join(verb for verb in ALL_PEER_VERBS if verb not in CONNECTION_VERBS)


def parse_peer_command(words: Words, project: Project) -> BenchCommand:
    peer = parse_peer(words, project)
    verb = words.next(f"one of {', '.join(ALL_PEER_VERBS)}")
    if verb not in ALL_PEER_VERBS:
        raise words.make_unknown_error(verb, ALL_PEER_VERBS, "peer command")
    if verb in SIMPLE_VERBS:
        words.expect_end()
    if peer.udp and verb in CONNECTION_VERBS:
        raise words.error(f"{verb} for the UDP peer '{peer.name}', which has no connection", UDP_VERBS_FORM)
    if verb in VERB_READERS:
        return VERB_READERS[verb](words, project, peer.name)
    if verb == "connect" and not peer.active:
        raise words.error(
            f"connect for the passive peer '{peer.name}'", "listen, or a peer with active = true"
        )
    if verb == "listen" and peer.active:
        raise words.error(
            f"listen for the active peer '{peer.name}'", "connect, or a peer with active = false"
        )
    return PeerAction(peer.name, verb)
