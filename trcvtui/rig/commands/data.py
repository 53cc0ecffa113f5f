"""DATA variables in bench commands: what `rx`, `rx.speed`, `rx[3].x` and `rx+4` stand for."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from trcvtui.errors import UserError
from trcvtui.project.names import expected_name
from trcvtui.project.project import DataDecl, Project
from trcvtui.project.tables import shown
from trcvtui.rig.commands.member_values import leaf_bytes, leaf_value, struct_bytes
from trcvtui.rig.commands.read_payload import is_payload, read_payload
from trcvtui.rig.commands.tokens import Words
from trcvtui.rig.commands.words import Condition, DataIs, MemberIs, Write
from trcvtui.udt.layout.layout import Leaf
from trcvtui.udt.layout.layout_tree import find

TARGET_FORM: Final = "rx, rx.speed, rx[3] or rx+4 (byte 4)"
VALUE_FORM: Final = "a value, or hex and bytes"
_TARGET: Final = re.compile(r"([^\s\d.\[+][^\s.\[+]*)(?:\+([0-9]{1,9})|((?:\.|\[).*))?")


@dataclass(frozen=True, slots=True)
class Target:
    """A part of a variable: `size` bytes from `offset` on; `path` has no leading dot, "" is the whole."""

    decl: DataDecl
    path: str
    offset: int
    size: int
    is_raw: bool  # named by a byte offset

    def leaf(self, words: Words) -> Leaf:
        """Return the one value that it stands for; raise UserError when it is none."""
        if not self.is_raw:
            try:
                return self.decl.layout.leaf(self.decl.layout.number_of(self.path))
            except UserError:
                pass
        name = f"{self.decl.name}{'+' + str(self.offset) if self.is_raw else ''}"
        found = f"'{name}{'.' * bool(self.path) + self.path}', which is not one value"
        raise words.wrong(found, "the path of one, or hex and bytes")


def base_name(word: str) -> str:
    """Return the name that a word such as `rx.speed` or `rx+4` begins with."""
    return re.split(r"[.\[+]", word, maxsplit=1)[0]


def read_target(words: Words, project: Project) -> Target:
    """Return what the next word stands for; raise UserError when it is no part of a variable."""
    word = words.next("the name of a DATA variable")
    decl = project.data_decl(base_name(word))
    if decl is None:
        names = [known.name for known in project.data]
        raise words.wrong(shown(base_name(word)), expected_name(base_name(word), names, "DATA variable"))
    found = _TARGET.fullmatch(word)
    if found is None:
        raise words.wrong(shown(word), TARGET_FORM)
    _, offset, path = found.groups()
    if offset is not None:
        return _raw_target(decl, int(offset), words)
    return _member_target(decl, path or "", words)


def _raw_target(decl: DataDecl, offset: int, words: Words) -> Target:
    if offset >= decl.size:
        raise words.wrong(f"byte {offset} of '{decl.name}'", f"a byte from 0 to {decl.size - 1}")
    return Target(decl, "", offset, decl.size - offset, True)


def _member_target(decl: DataDecl, path: str, words: Words) -> Target:
    try:
        number, node = find(decl.layout.root, path)
    except LookupError as unknown:
        raise words.wrong(
            f"'{unknown}' in '{decl.name}{path}'", f"a member of {decl.type_name}, or an index within bounds"
        ) from None
    # A part begins where its first value does: no layout has a gap before the first member.
    offset = decl.layout.leaf(number).offset if node.leaves else 0
    return Target(decl, path.removeprefix("."), offset, node.size if node.leaves else 0, False)


def read_write(words: Words, project: Project) -> Write:
    """Return `write rx.speed 12.5`, `write rx hex 01 02`, `write rx {speed=1.5}`; raise UserError."""
    start = words.place
    target = read_target(words, project)
    payload = _bytes_for(target, words, project)
    return Write(target.decl.name, target.offset, payload, words.written(start))


def _bytes_for(target: Target, words: Words, project: Project) -> bytes:
    if is_payload(words.peek()):
        return _fitting(target, read_payload(words, project).content, words)
    if words.peek().startswith("{") and not target.is_raw:
        return _struct_for(target, words.rest_text(VALUE_FORM), words)
    value = words.next(VALUE_FORM)
    words.finish()
    leaf = target.leaf(words)
    if leaf.bit is not None:  # a write has whole bytes, and the other bits of this one are not known here
        found = f"'{leaf.path}', bit {leaf.bit} of byte {leaf.offset}"
        raise words.wrong(found, f"the whole byte, such as: write {target.decl.name}+{leaf.offset} hex 01")
    return leaf_bytes(target.decl.layout, leaf, value, words.where)


def _fitting(target: Target, payload: bytes, words: Words) -> bytes:
    if len(payload) > target.size:
        raise words.wrong(f"{len(payload)} bytes", f"at most {target.size}, which is what there is")
    return payload


def _struct_for(target: Target, braces: str, words: Words) -> bytes:
    if target.path:
        braces = f"{{{target.path}={braces}}}"
    whole = struct_bytes(target.decl.layout, braces, words.where)
    return whole[target.offset : target.offset + target.size]


def read_data_condition(words: Words, project: Project) -> Condition:
    """Return `rx hex 01 02` or `rx.speed 12.5` as a condition; raise UserError."""
    start = words.place
    target = read_target(words, project)
    if is_payload(words.peek()):
        payload = _fitting(target, read_payload(words, project).content, words)
        return DataIs(target.decl.name, target.offset, payload, words.written(start))
    leaf = target.leaf(words)
    value = words.next(VALUE_FORM)
    words.finish()
    layout = target.decl.layout
    return MemberIs(
        target.decl.name,
        leaf.path,
        leaf_value(layout, leaf, leaf_bytes(layout, leaf, value, words.where)),
    )
