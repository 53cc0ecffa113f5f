"""The padded type: a declaration that has in one layout the offsets that a type has in another layout.

Gaps become members, and a value that is stored differently becomes a bit string of its size. A member that
cannot have its place becomes raw bytes, with a reason. Rule: the result is laid out and every member is
compared, so `is_possible` is proved. If the type is longer than what is sent, LEN is the wanted size.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from contextlib import suppress
from dataclasses import replace
from typing import Final, NamedTuple

from trcvtui.udt.layout.layout import Layout, lay_out
from trcvtui.udt.layout.layout_tree import (
    Node,
    PlacedArray,
    PlacedLeaf,
    PlacedMember,
    PlacedStruct,
    PlacedUnion,
    members_of,
)
from trcvtui.udt.layout.placing import BYTE, Builder, Placer, Unplaceable, claim_name
from trcvtui.udt.layout.rules import S7, LayoutRules
from trcvtui.udt.layout.value_text import stored_form
from trcvtui.udt.types import (
    ELEMENTARY,
    Array,
    Enumeration,
    LeafType,
    Member,
    StringType,
    Struct,
    Type,
    Union,
    type_text,
)

Replacement = tuple[LeafType | None, str]  # the type to use and a note, or None and the reason
BIT_STRINGS = {1: "BYTE", 2: "WORD", 4: "DWORD", 8: "LWORD"}


class MemberNote(NamedTuple):
    """A note on a member, or on the type if `path` is "". In an ARRAY `path` names the first element."""

    path: str
    text: str


def substitute_leaf(node: PlacedLeaf, theirs: LayoutRules, ours: LayoutRules) -> Replacement:
    """Return our type that stores what a leaf of theirs stores, and a note; or None and the reason."""
    if node.is_bit:
        if "BOOL" in ours.bits or ours.takes_pack:  # only CODESYS has BIT
            return ELEMENTARY["BOOL" if "BOOL" in ours.bits else "BIT"], ""
        return None, f"{theirs.name} stores it as one bit; {ours.name} has no one-bit type"
    if isinstance(node.type, StringType):
        return _substitute_text(node.type, node.size, theirs, ours)
    stored, own = theirs.storage(node.type), ours.storage(node.type)
    if own.name in ours.bits:  # their BOOL has a byte, ours would be a bit
        return ELEMENTARY["BYTE"], f"a BOOL is one byte in {theirs.name}, one bit in {ours.name}; here a BYTE"
    if stored_form(node.type, theirs) == stored_form(node.type, ours):
        return node.type, ""
    if isinstance(node.type, Enumeration):
        name = type_text(node.type)
        return ELEMENTARY[stored.name], f"{name} has {stored.size} bytes in {theirs.name}: here {stored.name}"
    bits = BIT_STRINGS.get(node.size)
    if bits is None:
        return None, f"{theirs.name} stores {stored.name} differently"
    note = f"{theirs.name} stores {stored.name} differently; here it is a {bits} that you convert"
    return ELEMENTARY[bits], note


def _substitute_text(type_: StringType, size: int, theirs: LayoutRules, ours: LayoutRules) -> Replacement:
    if theirs.text.header != ours.text.header:
        forms = ("ends a STRING with a NUL", "begins a STRING with two lengths")
        there, here = forms[theirs.text.header], forms[ours.text.header]
        return None, f"{theirs.name} {there}, {ours.name} {here}"
    declared = theirs.text.length(type_)
    length = size // (2 if type_.wide else 1) - ours.text.extra
    found = StringType(length, type_.wide, type_.utf8)
    if length < declared or length > ours.text.largest_length(found):
        name = type_text(StringType(declared, type_.wide))
        return None, f"{ours.name} has no {name} of {size} bytes"
    return (type_ if ours.text.length(type_) == length else found), ""


RawMember = tuple[int, str]  # `id` of the wanted node of its STRUCT, its name


def prove_places(
    wanted: Node, found: Node, raw: Collection[RawMember], path: str = "", proved: set[object] | None = None
) -> None:
    """Raise Unplaceable unless members have their wanted place; one in `raw` may be bytes or padding."""
    proved = set() if proved is None else proved
    if found.size < wanted.size:
        raise Unplaceable(path, f"{found.size} bytes instead of {wanted.size}")
    if (key := (id(wanted), id(found))) in proved:
        return
    if isinstance(wanted, PlacedStruct) and isinstance(found, PlacedStruct):
        own = {one.name.casefold(): one for one in found.flat_members()}
        for name, offset, bit, node, _ in wanted.flat_members():
            one = own.get(name.casefold())
            is_raw = (id(wanted), name) in raw
            if is_raw and (bit is not None or one is None):  # a bit, or covered by padding
                continue
            if one is None or one.offset != offset or (is_raw and one.node.size != node.size):
                raise Unplaceable(_join_path(path, name), "its place would differ")
            if not is_raw:
                if one.bit != bit:
                    raise Unplaceable(_join_path(path, name), "its bit would differ")
                prove_places(node, one.node, raw, _join_path(path, name), proved)
    elif isinstance(wanted, PlacedUnion) and isinstance(found, PlacedArray):  # as bytes
        if found.size != wanted.size:
            raise Unplaceable(path, "it has another size")
    elif isinstance(wanted, PlacedArray) and isinstance(found, PlacedArray):
        ours, theirs = found, wanted
        if (ours.bounds, ours.pitch, ours.row_size) != (theirs.bounds, theirs.pitch, theirs.row_size):
            raise Unplaceable(path, "the places of its elements would differ")
        prove_places(wanted.element, found.element, raw, path + "[]", proved)
    elif not (isinstance(wanted, PlacedLeaf) and isinstance(found, PlacedLeaf)) or (
        (wanted.size, wanted.is_bit) != (found.size, found.is_bit)
    ):
        raise Unplaceable(path, "it has another size")
    proved.add(key)


MOST_NOTES: Final = 1024  # raw members that are named; a type with some may be used many times


class PaddedType(NamedTuple):
    """A type with the wanted offsets, except for `unreached`. `notes` are members that need a conversion.

    An unreached member is raw bytes, or missing if it is a bit. The note names the part that causes this.
    If the type is longer than wanted, LEN of the block is the wanted size.
    """

    type: Type
    layout: Layout
    unreached: tuple[MemberNote, ...]
    notes: tuple[MemberNote, ...]

    @property
    def is_possible(self) -> bool:
        return not self.unreached


def padded_type(wanted: Layout, rules: LayoutRules, is_scl: bool = False) -> PaddedType:
    """Return the type that has the offsets of `wanted` under `rules`, in the byte order of `rules`.

    For the receiver `wanted` is the sender's layout, and `rules` are the receiver's own. For the sender,
    exchange the two sides. A STRUCT that cannot have its place is replaced by its members. SCL has no
    pack_mode, and in SCL a UNION becomes its bytes.
    """
    rules = replace(rules, takes_pack=False) if is_scl else rules
    found, apart = _find_nearest(wanted, rules, is_scl), []
    while parts := _flatten_structs(wanted, {one.path for one in found.unreached}):  # inner STRUCTs next
        wanted, notes = parts
        apart += notes
        found = _find_nearest(wanted, rules, is_scl)
    return found._replace(notes=(*apart, *found.notes))


def _flatten_structs(wanted: Layout, names: Collection[str]) -> tuple[Layout, list[MemberNote]] | None:
    """Return a layout with these STRUCTs replaced by their members, and notes, or None if there is none."""
    type_, root = wanted.type, wanted.root
    if not (isinstance(type_, Struct) and isinstance(root, PlacedStruct)) or root.leaves > MOST_NOTES:
        return None
    taken = {one.name.casefold() for one in root.flat_members()}
    members: list[Member] = []
    placed: list[PlacedMember] = []
    notes: list[MemberNote] = []
    for name, offset, bit, node, inner in members_of(type_, root):
        parts = [("", 0, bit, node, inner)]
        if isinstance(inner, Struct) and isinstance(node, PlacedStruct) and name in names:
            parts = list(members_of(inner, node))
            notes.append(MemberNote(name, f"its members are declared one by one, as {name}_.."))
        for below, at, own_bit, part, part_type in parts:
            own = claim_name(f"{name}_{below}", taken) if below else name
            members.append(Member(own, part_type))
            placed.append(PlacedMember(own, offset + at, part, own_bit or 0))
    if not notes:
        return None
    flat = Struct(type_.name and f"{wanted.name}_flat", tuple(members), None, type_.pack)
    return Layout(wanted.name, flat, wanted.rules, PlacedStruct(placed, root.size, root.align)), notes


def _find_nearest(wanted: Layout, rules: LayoutRules, is_scl: bool) -> PaddedType:
    packs = (None, 1) if rules.takes_pack else (None,)
    rebuilt = [_Rebuilder(wanted, rules, pack, longer, is_scl) for longer in (False, True) for pack in packs]
    tries = [_try_rebuild(wanted, rules, rebuild) for rebuild in rebuilt]
    # Raw bytes alone are the last resort, else the fewest unreached members win.
    return min(tries, key=lambda found: (any(not one.path for one in found.unreached), len(found.unreached)))


def _try_rebuild(wanted: Layout, rules: LayoutRules, rebuild: _Rebuilder) -> PaddedType:
    try:
        type_ = rebuild.rebuild_type(wanted.type, wanted.root, "")
        layout = lay_out(type_, rules, f"{wanted.name}_{rebuild.suffix}")
        prove_places(wanted.root, layout.root, rebuild.raw)
        unreached = tuple(MemberNote(one.path, one.reason) for one in rebuild.unreached)
        return PaddedType(type_, layout, unreached, tuple(rebuild.notes))
    except Unplaceable as failed:  # only bytes are left: every layout can hold them
        raw = Array(((0, max(wanted.size, 1) - 1),), BYTE)
        layout = lay_out(raw, rules, f"{wanted.name}_{rebuild.suffix}")
        why = f"{failed.path}: {failed.why}" if failed.path else failed.why
        return PaddedType(raw, layout, (MemberNote("", why),), ())


class _RawMemberNote(NamedTuple):
    """A member that became raw bytes: its path, the part inside it that is the cause, and the reason."""

    path: str
    inner: str
    why: str

    @property
    def reason(self) -> str:
        return f"{self.path}{self.inner}: {self.why}" if self.inner else self.why


class _RebuildResult(NamedTuple):
    """A rebuilt STRUCT; paths are relative to it."""

    type: Struct | Union
    unreached: list[_RawMemberNote]
    notes: list[MemberNote]


class _Rebuilder:
    """Rebuilds a declaration. Each STRUCT is rebuilt once, even if many members have its type."""

    def __init__(
        self, wanted: Layout, rules: LayoutRules, pack: int | None, is_longer: bool, is_scl: bool
    ) -> None:
        self.theirs, self.rules, self.pack, self.is_scl = wanted.rules, rules, pack, is_scl
        self.longer = wanted.root if is_longer else None  # only the whole type may be longer than is sent
        self.name = wanted.name
        self.suffix = wanted.rules.name.replace("-", "_")
        self.placing = Placer(rules)
        self.unreached: list[_RawMemberNote] = []
        self.notes: list[MemberNote] = []
        self.raw: set[RawMember] = set()
        self._built: dict[int, _RebuildResult | Unplaceable] = {}

    def rebuild_type(self, type_: Type, node: Node, path: str) -> Type:
        """Return the type to use instead of this one; raise Unplaceable."""
        match type_:
            case Array():
                assert isinstance(node, PlacedArray)
                return self.rebuild_array(type_, node, path)
            case Union() if self.is_scl:
                if not node.size:
                    raise Unplaceable(path, "the UNION is empty")
                return Array(((0, node.size - 1),), BYTE)
            case Struct() | Union():
                assert isinstance(node, PlacedStruct)
                return self.rebuild_once(type_, node, path)
            case _:
                assert isinstance(node, PlacedLeaf)
                found, why = substitute_leaf(node, self.theirs, self.rules)
                if self.is_scl and isinstance(found, StringType):
                    length, most = self.rules.text.length(found), S7.text.largest_length(found)
                    if length > most:
                        raise Unplaceable(path, f"{type_text(found)}: SCL allows at most {most} characters")
                if found is None:
                    raise Unplaceable(path, why)
                if why:
                    self.notes.append(MemberNote(path, why))
                return found

    def rebuild_once(self, type_: Struct | Union, node: PlacedStruct, path: str) -> Struct | Union:
        if id(type_) not in self._built:
            self._built[id(type_)] = self.rebuild(type_, node, path)
        built = self._built[id(type_)]
        if isinstance(built, Unplaceable):
            raise Unplaceable(_join_path(path, built.path) if built.path else path, built.why)
        for one in built.unreached[: max(MOST_NOTES - len(self.unreached), 0)]:
            self.unreached.append(one._replace(path=_join_path(path, one.path)))
        for note in built.notes[: max(MOST_NOTES - len(self.notes), 0)]:
            self.notes.append(note._replace(path=_join_path(path, note.path)))
        return built.type

    def rebuild(self, type_: Struct | Union, node: PlacedStruct, path: str) -> _RebuildResult | Unplaceable:
        others = self.unreached, self.notes
        self.unreached, self.notes = [], []
        try:
            made = self.lay_struct(type_, node) if isinstance(type_, Struct) else self.lay_union(type_, node)
            return _RebuildResult(self.make_type(type_, made, path), self.unreached, self.notes)
        except Unplaceable as failed:
            return failed
        finally:
            self.unreached, self.notes = others

    def rebuild_array(self, type_: Array, node: PlacedArray, path: str) -> Type:
        first = ",".join(str(low) for low, _ in type_.bounds)
        element = self.rebuild_type(type_.element, node.element, f"{path}[{first}]")
        found = type_ if element is type_.element else Array(type_.bounds, element)
        placed = self.placing.place(found, path)
        assert isinstance(placed, PlacedArray)
        if (placed.pitch, placed.row_size) != (node.pitch, node.row_size):
            why = f"its elements are {node.pitch} bytes apart, but {placed.pitch} under {self.rules.name}"
            raise Unplaceable(path, why)
        return found

    def lay_struct(self, type_: Struct, node: PlacedStruct) -> Builder:
        # A larger alignment of a member would round up the size of the STRUCT.
        limit = None if node is self.longer else max(node.size & -node.size or 1, self.rules.struct_floor)
        fill = self.make_builder(type_, node, limit)
        for name, offset, bit, child, inner in members_of(type_, node):
            mark = len(self.unreached), len(self.notes)
            try:
                fill.put(name, self.rebuild_type(inner, child, name), offset, bit, name)
            except Unplaceable as failed:
                del self.unreached[mark[0] :], self.notes[mark[1] :]
                self.unreached.append(_RawMemberNote(name, failed.path[len(name) :], failed.why))
                self.raw.add((id(node), name))
                with suppress(Unplaceable):  # if bytes cannot begin there either, padding covers it
                    fill.put_raw(name, offset, child.size, bit is not None, name)
        fill.pad_to_size(self.choose_size(node, fill), "")
        return fill

    def lay_union(self, type_: Union, node: PlacedStruct) -> Builder:
        fill = self.make_builder(type_, node)
        for name, _, _, child, inner in members_of(type_, node):
            fill.overlay(name, self.rebuild_type(inner, child, name), name)
        fill.pad_union(self.choose_size(node, fill), "")
        return fill

    def choose_size(self, node: PlacedStruct, fill: Builder) -> int:
        return fill.least_size(node.size) if node is self.longer else node.size

    def make_builder(self, type_: Struct | Union, node: PlacedStruct, limit: int | None = None) -> Builder:
        cap = max(self.pack, 1) if self.pack is not None else self.placing.align_cap(type_)
        return Builder(self.placing, cap, {one.name.casefold() for one in node.flat_members()}, limit)

    def make_type(self, type_: Struct | Union, fill: Builder, path: str) -> Struct | Union:
        members = tuple(fill.members)
        is_old = self.pack is None and not type_.base and not type_.bit_fields
        if is_old and [id(one.type) for one in members] == [id(one.type) for one in type_.members]:
            return type_
        pack = type_.pack if self.pack is None else self.pack
        name = type_.name
        if pack is not None and not name:  # only a named type can have a pack_mode
            without_indices = re.sub(r"\[[^\]]*\]", "", path)
            name = re.sub(r"\W+", "_", f"{self.name}.{without_indices}")
        name = f"{name}_{self.suffix}" if name else ""
        made = Struct if isinstance(type_, Struct) else Union
        return made(name, members, None, pack)


def _join_path(path: str, inner: str) -> str:
    return f"{path}.{inner}" if path else inner


def list_notes(found: PaddedType) -> list[str]:
    lines = [f"{one.path or type_text(found.type)}: not possible: {one.text}" for one in found.unreached]
    return lines + [f"{note.path}: {note.text}" for note in found.notes]
