"""Reads `write`, `prefix`, `suffix`, and the conditions of `wait` and `expect` on pins, peers and DATA."""

from __future__ import annotations

import re
from typing import Final

from msgspec import Struct

from trcvtui.blocks.table import MARK_NAMES, block_row
from trcvtui.commands.patterns import parse_pattern
from trcvtui.commands.tokens import (
    FORMS,
    KEPT_BYTES,
    Words,
    leaf_bytes,
    parse_delay,
    parse_payload,
    parse_pin_value,
    struct_bytes,
)
from trcvtui.commands.words import (
    DEFAULT_LIMIT_NS,
    NO_MARK,
    PEER_STATES,
    Condition,
    DataIs,
    Expect,
    ExpectTrace,
    MemberIs,
    PeerHasReceived,
    PeerIs,
    PinsAre,
    SetFrameMark,
    Wait,
    WriteBytes,
)
from trcvtui.errors import UserError
from trcvtui.project.project import DataDecl, InstanceDecl, PeerDecl, Project
from trcvtui.project.tables import expected_name, quote
from trcvtui.udt.layout.layout import Leaf
from trcvtui.udt.layout.layout_tree import find_node
from trcvtui.udt.layout.values import decode_leaf
from trcvtui.wording import count

TARGET_FORM: Final = "rx, rx.speed, rx[3] or rx+4 (byte 4)"
VALUE_FORM: Final = "a value, or hex and bytes"
_TARGET_PATTERN: Final = re.compile(r"([^\s\d.\[+][^\s.\[+]*)(?:\+([0-9]{1,9})|((?:\.|\[).*))?")


class DataTarget(Struct, frozen=True):
    """A part of a variable: `size` bytes from `offset` on. `path` has no leading dot; "" is the whole."""

    decl: DataDecl
    path: str
    offset: int
    size: int
    is_raw: bool  # named by a byte offset

    def leaf(self, words: Words) -> Leaf:
        """Return the value at this target; raise UserError if it is not a single value."""
        if not self.is_raw:
            try:
                return self.decl.layout.leaf(self.decl.layout.leaf_number(self.path))
            except UserError:
                pass
        name = f"{self.decl.name}{'+' + str(self.offset) if self.is_raw else ''}"
        found = f"'{name}{'.' * bool(self.path) + self.path}', which is not a single value"
        raise words.error(found, "the path of one value, or bytes such as: hex 01 02")


def base_name(word: str) -> str:
    """Return the name that begins a word such as `rx.speed` or `rx+4`."""
    return re.split(r"[.\[+]", word, maxsplit=1)[0]


def parse_target(words: Words, project: Project) -> DataTarget:
    """Return the target that the next word names. Raise UserError if the word is no part of a variable."""
    word = words.next("the name of a DATA variable")
    decl = project.data_decl(base_name(word))
    if decl is None:
        names = [known.name for known in project.data]
        raise words.make_unknown_error(base_name(word), names, "DATA variable")
    found = _TARGET_PATTERN.fullmatch(word)
    if found is None:
        raise words.error(quote(word), TARGET_FORM)
    _, byte, path = found.groups()
    if byte is None:
        return _member_target(decl, path or "", words)
    offset = int(byte)
    if offset >= decl.size:
        raise words.error(f"byte {offset} of '{decl.name}'", f"a byte from 0 to {decl.size - 1}")
    return DataTarget(decl, "", offset, decl.size - offset, True)


def _member_target(decl: DataDecl, path: str, words: Words) -> DataTarget:
    try:
        number, node = find_node(decl.layout.root, path)
    except LookupError as unknown:
        raise words.error(
            f"'{unknown}' in '{decl.name}{path}'", f"a member of {decl.type_name}, or an index within bounds"
        ) from None
    # A part begins where its first value does: no layout has a gap before the first member.
    offset = decl.layout.leaf(number).offset if node.leaves else 0
    return DataTarget(decl, path.removeprefix("."), offset, node.size if node.leaves else 0, False)


def parse_write(words: Words, project: Project) -> WriteBytes:
    """Read `write rx.speed 12.5`, `write rx hex 01 02` or `write rx {speed=1.5}`, or raise UserError."""
    start = words.place
    target = parse_target(words, project)
    payload = _parse_write_bytes(target, words, project)
    return WriteBytes(target.decl.name, target.offset, payload, words.text_since(start))


def _parse_write_bytes(target: DataTarget, words: Words, project: Project) -> bytes:
    if words.peek() in FORMS:
        return _check_fits(target, parse_payload(words, project).content, words)
    if words.peek().startswith("{") and not target.is_raw:
        return _parse_struct_bytes(target, words.take_rest_text(VALUE_FORM), words)
    value = words.next(VALUE_FORM)
    words.expect_end()
    leaf = target.leaf(words)
    if leaf.bit is not None:  # a write has whole bytes, and the other bits of this byte are not known here
        found = f"'{leaf.path}', bit {leaf.bit} of byte {leaf.offset}"
        raise words.error(found, f"the whole byte, such as: write {target.decl.name}+{leaf.offset} hex 01")
    return leaf_bytes(target.decl.layout, leaf, value, words.where)


def _check_fits(target: DataTarget, payload: bytes, words: Words) -> bytes:
    if len(payload) > target.size:
        raise words.error(f"{len(payload)} bytes", f"at most {count(target.size, 'byte')} at this place")
    return payload


def _parse_struct_bytes(target: DataTarget, braces: str, words: Words) -> bytes:
    if target.path:
        braces = f"{{{target.path}={braces}}}"
    whole = struct_bytes(target.decl.layout, braces, words.where)
    return whole[target.offset : target.offset + target.size]


def parse_data_condition(words: Words, project: Project) -> Condition:
    """Read a condition such as `rx hex 01 02` or `rx.speed 12.5`. Raise UserError for a mistake."""
    start = words.place
    target = parse_target(words, project)
    if words.peek() in FORMS:
        payload = _check_fits(target, parse_payload(words, project).content, words)
        return DataIs(target.decl.name, target.offset, payload, words.text_since(start))
    leaf = target.leaf(words)
    value = words.next(VALUE_FORM)
    words.expect_end()
    layout = target.decl.layout
    return MemberIs(
        target.decl.name, leaf.path, decode_leaf(layout, leaf, leaf_bytes(layout, leaf, value, words.where))
    )


NOTHING_WORD: Final = "nothing"
UDP_STATES: Final = ("listening", "closed")
OF_UDP: Final = "listening, closed or received"
SUBJECT_FORM: Final = "an instance, a DATA variable or peer NAME"


def parse_wait(words: Words, project: Project) -> Wait:
    """Read `wait CONDITION [within T#..]`. Raise UserError for a mistake."""
    within = _read_within(words)
    return Wait(_read_condition(words, project), DEFAULT_LIMIT_NS if within is None else within)


def parse_expect(words: Words, project: Project) -> Expect | ExpectTrace:
    """Read `expect CONDITION [within T#..]` or `expect X trace PATTERN`. Raise UserError for a mistake."""
    if words.peek(1) == "trace" and words.peek() != "peer":
        instance = parse_instance(words, project)
        words.next("trace")
        return ExpectTrace(instance.name, parse_pattern(" ".join(words.take_rest()), f"{words.where}: trace"))
    within = _read_within(words)
    return Expect(_read_condition(words, project), within)


def _read_within(words: Words) -> int | None:
    tail = words.cut_tail_words(lambda word: word == "within")
    if not tail:
        return None
    if len(tail) != 2:
        raise words.error(quote(" ".join(tail)), "one duration after within, such as within T#2s")
    return parse_delay(tail[1], "within ", words.where)


def _read_condition(words: Words, project: Project) -> Condition:
    word = words.peek()
    if word == "peer":
        words.next("peer")
        return _read_peer_condition(words, project)
    name = base_name(word)
    if project.data_decl(name) is not None:
        return parse_data_condition(words, project)
    if project.instance(word) is None:
        names = [*(i.name for i in project.instances), *(d.name for d in project.data), "peer"]
        found = quote(name) if word else "no further word"
        raise words.error(found, expected_name(name, names, SUBJECT_FORM) if word else SUBJECT_FORM)
    return _read_pins(words, project)


def _read_pins(words: Words, project: Project) -> PinsAre:
    instance = parse_instance(words, project)
    pins = {pin.name: pin for pin in project.pins(instance.block)}
    found = []
    for word in words.take_rest() or [words.next("a pin such as STATUS=7006")]:
        name, equals, text = word.partition("=")
        if not equals:
            raise words.error(quote(word), "PIN=VALUE such as STATUS=7006")
        if name not in pins:
            raise words.make_unknown_error(name, pins, "pin")
        found.append((name, parse_pin_value(pins[name], text, words.where)))
    return PinsAre(instance.name, tuple(found))


def _read_peer_condition(words: Words, project: Project) -> Condition:
    peer = parse_peer(words, project)
    state = words.next(f"received, or a state: {', '.join(PEER_STATES)}")
    if state == "received" and words.peek() == NOTHING_WORD:
        words.next(NOTHING_WORD)
        words.expect_end()
        return PeerHasReceived(peer.name, b"")
    if state == "received":
        payload = parse_payload(words, project)
        if len(payload.content) > KEPT_BYTES:
            raise words.error(f"{len(payload.content)} bytes", f"at most {KEPT_BYTES} bytes, a peer's limit")
        return PeerHasReceived(peer.name, payload.content, payload.text)
    words.expect_end()
    if state not in PEER_STATES:
        raise words.make_unknown_error(state, (*PEER_STATES, "received"), "state")
    if peer.udp and state not in UDP_STATES:
        raise words.error(f"'{state}' for the UDP peer '{peer.name}', which has no connection", OF_UDP)
    return PeerIs(peer.name, state)


def parse_instance(words: Words, project: Project) -> InstanceDecl:
    known = {instance.name: instance for instance in project.instances}
    return known[words.next_known(known, "instance")]


def parse_peer(words: Words, project: Project) -> PeerDecl:
    known = {peer.name: peer for peer in project.peers}
    return known[words.next_known(known, "peer")]


LONGEST_MARK: Final = 255  # LenPrefix is a BYTE


def parse_mark(mark: str, words: Words, project: Project) -> SetFrameMark:
    """Read `prefix RD hex 02`, `prefix RD text "x"` or `suffix RD none`. Raise UserError for a mistake."""
    instance = parse_instance(words, project)
    if not block_row(instance.block).pointers:
        found = f"'{instance.name}', a {instance.block}"
        raise words.error(found, "a block with prefix and suffix, such as ReceiveData")
    variable = _find_mark_variable(instance, mark, words)
    decl = project.data_decl(variable)
    assert decl is not None
    payload, text = b"", NO_MARK
    if words.peek() == NO_MARK:
        words.next(NO_MARK)
    else:
        given = parse_payload(words, project)
        payload, text = given.content, given.text
    lengths = block_row(instance.block).mark_lengths
    pin = lengths[MARK_NAMES.index(mark)] if lengths else ""  # a STRING has its own length
    room = min(decl.size, LONGEST_MARK) if pin else decl.size - 1
    if len(payload) > room:
        found = count(len(payload), "byte")
        raise words.error(found, f"at most {room}: '{variable}' is {decl.type_name} (`resize` changes it)")
    return SetFrameMark(instance.name, mark, payload, variable, pin, decl.size, text)


def _find_mark_variable(instance: InstanceDecl, mark: str, words: Words) -> str:
    """Return the variable with the bytes of a prefix or suffix. Raise UserError if the pointer is 0."""
    number = MARK_NAMES.index(mark)
    pointer = block_row(instance.block).pointers[number]
    name = instance.pointers[number] if number < len(instance.pointers) else ""
    if not name:
        found = f"{pointer} of '{instance.name}', which is 0"
        raise words.error(found, f"`{pointer}` with a variable, in the project or at `create`")
    return name
