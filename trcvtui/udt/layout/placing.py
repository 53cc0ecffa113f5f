"""Places members by the rules of a layout, and builds a STRUCT with members at given places.

Rule: only members of a STRUCT are aligned. A type that is a scalar, a text or an array of these has no
gaps. Each STRUCT is placed once, even if many members have its type.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

from trcvtui.errors import MOST_PROBLEMS_SHOWN, Problem, UserError, collect_problems, mistake
from trcvtui.udt.layout.coding import coding_of
from trcvtui.udt.layout.layout_tree import (
    Node,
    PlacedArray,
    PlacedLeaf,
    PlacedMember,
    PlacedStruct,
    PlacedUnion,
)
from trcvtui.udt.layout.rules import LayoutRules, rules_for
from trcvtui.udt.types import (
    ELEMENTARY,
    Array,
    BitField,
    LeafType,
    Member,
    RawType,
    StringType,
    Struct,
    Type,
    Union,
    type_text,
)

# TRCV_C takes at most 65535 bytes; the limits leave room for DATA that is wrong on purpose (80A5).
MOST_BYTES = 4 * 1024 * 1024
MOST_LEAVES = 131_072  # twice the bytes of DATA; bounds the list of leaves in memory

_N = TypeVar("_N", PlacedStruct, PlacedArray)


class PlacedParts(NamedTuple):
    """A candidate for a place in a STRUCT: size, alignment, and its known parts with their offsets."""

    size: int
    align: int
    parts: tuple[tuple[int, Node | PlacedParts], ...] = ()


class Placer:
    """Places the types of one layout, and keeps the types that are placed so far."""

    def __init__(self, rules: LayoutRules) -> None:
        self.rules = rules
        self.placed: dict[int, tuple[Node, Type]] = {}  # by `id`: hashing a type is slower
        self.refused: set[Type] = set()

    def place(self, type_: Type, where: str) -> Node:
        """Return the type laid out; raise UserError if something in it has no layout or is too large."""
        if self.refused and type_ in self.refused:
            raise UserError(())  # without problems: they are reported at its first use
        if id(type_) not in self.placed:  # once, even if many members have this type
            try:
                self.placed[id(type_)] = self.place_new(type_, where), type_
            except UserError:
                if isinstance(type_, Struct | Union):
                    self.refused.add(type_)
                raise
        return self.placed[id(type_)][0]

    def place_new(self, type_: Type, where: str) -> Node:
        match type_:
            case Array():
                return self.place_array(type_, where)
            case Struct():
                return self.place_struct(type_, where)
            case Union():
                return self.place_union(type_, where)
            case RawType(name=name, why=why):
                raise mistake(where, f"{name}, {why}", "a type that can be laid out")
        return self.place_leaf(type_, where)

    def place_leaf(self, type_: LeafType, where: str) -> PlacedLeaf:
        if isinstance(type_, StringType):
            form = self.rules.text
            if form.length(type_) > form.largest_length(type_):
                expected = f"at most {form.largest_length(type_)} characters"
                expected += ", or a layout that ends a text with a NUL: codesys-8" if form.header else ""
                raise mistake(where, type_text(type_), expected)
            align = max(2 if type_.wide else 1, self.rules.text_floor)
            return PlacedLeaf(type_, coding_of(type_, self.rules), form.size(type_), align)
        row = self.rules.storage(type_)
        is_bit = row.name in self.rules.bits
        return PlacedLeaf(type_, coding_of(type_, self.rules), row.size, row.align, is_bit)

    def place_array(self, type_: Array, where: str) -> PlacedArray:
        element = self.place(type_.element, where)
        pitch, align = self.pitch_and_align(element)
        return _check_size(PlacedArray(type_, element, pitch, align), where)

    def pitch_and_align(self, element: Node | PlacedParts) -> tuple[int, int]:
        """Return the distance between the elements of an ARRAY, and the alignment of the ARRAY."""
        pitch = round_up(element.size, min(element.align, self.rules.cap))
        return pitch, max(element.align, self.rules.array_floor)

    def place_members(self, type_: Struct | Union, where: str) -> list[tuple[str, Type, Node]]:
        """Return the members of a STRUCT. The type after EXTENDS comes first, as a member without a name.

        Raise UserError with the problems of all members.
        """
        members: list[tuple[str, Type]] = [] if type_.base is None else [("", type_.base)]
        members += [(member.name, member.type) for member in type_.members]
        placed: list[tuple[str, Type, Node]] = []
        problems: list[Problem] = []
        for name, inner in members:
            with collect_problems(problems):
                placed.append((name, inner, self.place(inner, f"{where}.{name}" if name else where)))
        if len(placed) < len(members):
            raise UserError(problems[:MOST_PROBLEMS_SHOWN])
        return placed

    def place_struct(self, type_: Struct | Union, where: str) -> PlacedStruct:
        parts = self.place_members(type_, where)
        spots, end, align = self.member_spots(type_, parts)
        pairs = zip(parts, spots, strict=True)
        placed = [PlacedMember(name, at, node, bit) for (name, _, node), (at, bit) in pairs]
        return _check_size(PlacedStruct(placed, round_up(end, align), align), where)

    def member_spots(
        self, type_: Struct | Union, parts: Sequence[tuple[str, Type, Node | PlacedParts]]
    ) -> tuple[list[tuple[int, int]], int, int]:
        """Return offset and bit of each part of a STRUCT, the end of the last part, the alignment."""
        cap, rules = self.align_cap(type_), self.rules
        spots: list[tuple[int, int]] = []
        end, align, bit = 0, rules.struct_floor if parts or type_.bit_fields else 1, 0
        for at, (_, inner, node) in enumerate(parts):
            if type_.bit_fields:
                end, align = self.place_bit_fields(type_, at, end, align)
                # A bit-field ends the byte that BITs share.
                bit = 0 if any(one.at == at for one in type_.bit_fields) else bit
            step = self.member_align(node, cap)
            align = max(align, step)
            is_bit = isinstance(node, PlacedLeaf) and node.is_bit
            if is_bit and 0 < bit < 8:  # the next bit of the same byte
                spots.append((end - 1, bit))
                bit += 1
                continue
            offset = round_up(end, step)
            spots.append((offset, 0))
            end = round_up(offset + node.size, self.end_multiple(inner))
            bit = int(is_bit)
        end, align = self.place_bit_fields(type_, len(parts), end, align)
        return spots, end, align

    def place_bit_fields(self, type_: Struct | Union, at: int, end: int, align: int) -> tuple[int, int]:
        """Place the bit-fields before a member as gcc does on x86-64. Return the end and the alignment.

        A bit-field does not cross a boundary of its type, except under any `#pragma pack`. A bit-field of
        width 0 ends at the next boundary.
        """
        cap, place = self.align_cap(type_), 8 * end
        is_packed = cap < 8 or (type_.pack is not None and self.rules.takes_pack)
        for one in type_.bit_fields:
            if one.at != at:
                continue
            step = self.bit_field_align(one, cap)
            unit, align = 8 * (one.size or step), max(align, step)
            if not one.width or (not is_packed and place // unit != (place + one.width - 1) // unit):
                place = round_up(place, unit)
            place += one.width
        return round_up(place, 8) // 8, align

    def bit_field_align(self, one: BitField, cap: int) -> int:
        """Return the alignment of a bit-field, or of an ARRAY without a length."""
        if one.element is None:
            return min(one.size, cap) if one.is_named else 1
        return max(min(self.pitch_and_align(self.place(one.element, ""))[1], cap), self.rules.member_floor)

    def place_union(self, type_: Struct | Union, where: str) -> PlacedStruct:
        cap, parts = self.align_cap(type_), self.place_members(type_, where)
        align = self.rules.struct_floor if parts or type_.bit_fields else 1
        end = max((-(-one.width // 8) for one in type_.bit_fields), default=0)
        align = max([align, *(self.bit_field_align(one, cap) for one in type_.bit_fields)])
        for _, inner, node in parts:
            align = max(align, self.member_align(node, cap))
            end = max(end, round_up(node.size, self.end_multiple(inner)))
        placed = [PlacedMember(name, 0, node) for name, _, node in parts]
        return _check_size(PlacedUnion(placed, round_up(end, align), align), where)

    def align_cap(self, type_: Struct | Union) -> int:
        """Return the largest alignment of members: the pack_mode if the layout applies it, else `cap`."""
        if type_.pack is None or not self.rules.takes_pack:
            return self.rules.cap
        return max(type_.pack, 1)

    def member_align(self, node: Node | PlacedParts, cap: int) -> int:
        """Return the alignment of a member in a STRUCT whose largest alignment is `cap`."""
        return max(min(node.align, cap), self.rules.member_floor)

    def end_multiple(self, type_: Type) -> int:
        """Return the multiple to which the end of a member of this type is rounded up."""
        if isinstance(type_, Array):
            return self.rules.array_floor
        return 2 if isinstance(type_, StringType) and self.rules.string_even else 1


def has_padded_end(type_: Struct | Union) -> bool:
    """Return whether a class of C++ has room behind its members, where a derived class may begin."""
    placing = Placer(rules_for("c"))
    try:
        _, end, align = placing.member_spots(type_, placing.place_members(type_, ""))
    except UserError:
        return True
    return not end or end % align > 0 or any(one.element or not one.is_named for one in type_.bit_fields)


def round_up(offset: int, align: int) -> int:
    return -(-offset // align) * align


def _check_size(node: _N, where: str) -> _N:
    if node.size > MOST_BYTES:
        raise mistake(where, f"{node.size} bytes", f"at most {MOST_BYTES} bytes")
    if node.leaves > MOST_LEAVES:
        raise mistake(where, f"{node.leaves} elements", f"at most {MOST_LEAVES} elements")
    return node


BYTE = ELEMENTARY["BYTE"]


class Unplaceable(Exception):
    """A place where the layout cannot put the member."""

    def __init__(self, path: str, why: str) -> None:
        self.path, self.why = path, why
        super().__init__(f"{path}: {why}")


class Builder:
    """A STRUCT that grows member by member. `cap` is its largest alignment, `taken` the names in it.

    `limit` is the largest alignment with which the STRUCT can still have its wanted size.
    """

    def __init__(self, placing: Placer, cap: int, taken: set[str], limit: int | None = None) -> None:
        self.placing, self.cap, self.taken, self.limit = placing, cap, taken, limit
        self.rules = placing.rules
        self.members: list[Member] = []
        self.end = 0
        self.align = self.rules.struct_floor
        self.bits = 0  # used in the byte in front of `end`
        self._pads = 0

    def put(self, name: str, type_: Type, offset: int, bit: int | None, path: str) -> None:
        """Put a member at an offset. If that is impossible, raise Unplaceable and change nothing."""
        node = self.placing.place(type_, path)
        step = self.placing.member_align(node, self.cap)
        is_bit = isinstance(node, PlacedLeaf) and node.is_bit
        if is_bit and bit:
            if (self.bits, self.end) != (bit, offset + 1):
                raise Unplaceable(path, f"no bit comes right before bit {bit} of byte {offset}")
            self._add(name, type_, self.end)
            self.bits += 1
            return
        if is_bit and 0 < self.bits < 8 and offset == self.end:
            raise Unplaceable(path, f"bit 0 of byte {offset} would become bit {self.bits} of the byte before")
        if offset % step:
            layout, what = self.rules.name, type_text(type_)
            raise Unplaceable(path, f"{layout} places {what} at multiples of {step}, not at byte {offset}")
        if self.limit is not None and step > self.limit:
            why = f"{type_text(type_)} makes the size of its STRUCT a multiple of {step}"
            raise Unplaceable(path, f"{why} under {self.rules.name}")
        self._fill_to(offset, step, path)
        self.align = max(self.align, step)
        self._add(name, type_, round_up(offset + node.size, self.placing.end_multiple(type_)))
        self.bits = int(is_bit)

    def put_raw(self, name: str, offset: int, size: int, is_bit: bool, path: str) -> None:
        """Put bytes in place of a member; in place of a bit, one BYTE for all bits of its byte."""
        if is_bit and self.end > offset:  # the byte is covered already
            return
        if is_bit:
            self.put(claim_name(f"{name}_bits", self.taken), BYTE, offset, None, path)
        elif size:
            self.put(name, Array(((0, size - 1),), BYTE), offset, None, path)

    def least_size(self, size: int) -> int:
        """Return the smallest size of at least `size` that the type can have."""
        return round_up(max(size, self.end), self.align)

    def pad_to_size(self, size: int, path: str) -> None:
        """Pad to the size; raise Unplaceable when the type cannot have that size."""
        if size % self.align:
            layout = self.rules.name
            raise Unplaceable(path, f"under {layout} its size is a multiple of {self.align}, not {size}")
        self._fill_to(size, self.align, path)

    def overlay(self, name: str, type_: Type, path: str) -> None:
        """Put a member of a UNION at offset 0."""
        node = self.placing.place(type_, path)
        self.align = max(self.align, self.placing.member_align(node, self.cap))
        self._add(name, type_, max(self.end, round_up(node.size, self.placing.end_multiple(type_))))

    def pad_union(self, size: int, path: str) -> None:
        """Give a UNION its size with a padding member; raise Unplaceable if it cannot have that size."""
        if self.end > size or size % self.align:
            why = f"a UNION of {size} bytes: under {self.rules.name} its size is a multiple of {self.align}"
            raise Unplaceable(path, why)
        if round_up(self.end, self.align) != size:
            pad = Array(((0, size - 1),), BYTE)
            self.overlay(self._pad_name(), pad, path)
        if round_up(self.end, self.align) != size:
            raise Unplaceable(path, f"under {self.rules.name} a UNION cannot have {size} bytes")

    def _fill_to(self, offset: int, step: int, path: str) -> None:
        kept = len(self.members), self.end, self.bits, self._pads, self.align
        while self.end <= offset and round_up(self.end, step) < offset:
            if not self._pad_once(offset):
                break
        if round_up(self.end, step) != offset:
            end = kept[1]
            del self.members[kept[0] :]
            _, self.end, self.bits, self._pads, self.align = kept
            why = f"it must be at byte {offset}, but under {self.rules.name} the bytes before it end at {end}"
            raise Unplaceable(path, why)

    def _pad_once(self, offset: int) -> bool:
        """Add one padding member before the offset, an ARRAY if an ARRAY can begin there, else a BYTE."""
        floor, member_floor = self.rules.array_floor, self.rules.member_floor
        size = offset - self.end
        if round_up(self.end + size, floor) > offset:
            size -= 1
        array_step = max(min(floor, self.cap), member_floor)
        if size > 1 and self.end % array_step == 0:
            self.align = max(self.align, array_step)
            self._add(self._pad_name(), Array(((0, size - 1),), BYTE), round_up(self.end + size, floor))
        else:
            start = round_up(self.end, member_floor)
            if start >= offset:
                return False
            self._add(self._pad_name(), BYTE, start + 1)
        self.bits = 0
        return True

    def _add(self, name: str, type_: Type, end: int) -> None:
        self.members.append(Member(name, type_))
        self.end = end

    def _pad_name(self) -> str:
        self._pads += 1
        return claim_name(f"_pad{self._pads}", self.taken)


def claim_name(name: str, taken: set[str]) -> str:
    """Return the name, with `_` appended until it is free, and add it to `taken`."""
    while name.casefold() in taken:
        name += "_"
    taken.add(name.casefold())
    return name
