"""An ImHex pattern: a struct for each structure, gaps as `padding`, bits as bitfields of one byte."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from typing import Final

from trcvtui.errors import one_line
from trcvtui.udt.exports.outline import (
    BASE_NAME,
    ExportField,
    bounds_text,
    fields_of,
    quoted,
    refuse_empty,
    structs_of,
)
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf, PlacedStruct, PlacedUnion
from trcvtui.udt.st_write import NameScope, escaper
from trcvtui.udt.types import (
    Array,
    Elementary,
    Enumeration,
    StringType,
    Struct,
    Type,
    Union,
    ValueKind,
    type_text,
)

WORDS: Final = """
addressof as auto be bitfield bool break catch char char16 const continue double else enum false float fn for
from if import in le match namespace null out padding parent ref reference return s128 s16 s24 s32 s48 s64 s8
s96 section signed sizeof std str struct this true try type typenameof u128 u16 u24 u32 u48 u64 u8 u96 union
unsigned using while
"""
RESERVED: Final = frozenset(WORDS.split())
NUMBERS: Final = {
    "b": "s8", "B": "u8", "h": "s16", "H": "u16", "i": "s32", "I": "u32", "q": "s64", "Q": "u64",
    "f": "float", "d": "double", "?": "bool",
}  # fmt: skip
BYTE_OF_BITS: Final = "BitsOfAByte"

escaped = escaper(RESERVED)


def write(layout: Layout) -> str:
    """Return the pattern of the type, placed at address 0."""
    refuse_empty(layout)
    return _ImhexWriter(layout).text()


class _ImhexWriter:
    """Writes types in the order in which they need each other; each is written once."""

    def __init__(self, layout: Layout) -> None:
        self.layout, self.rules = layout, layout.rules
        self.taken = NameScope(escaped)
        self.names: dict[Struct | Union | Enumeration, str] = {}
        self.written: dict[str, str] = {}  # head and body of a type -> its name
        self.types: list[str] = []

    def text(self) -> str:
        layout, rules = self.layout, self.rules
        main = layout.type if isinstance(layout.type, Struct | Union) else None
        if main is not None:
            self.names[main] = self.taken(layout.name)  # first, so that nobody else has this name
        for type_, node in structs_of(layout.type, layout.root):
            if type_ not in self.names:
                self.names[type_] = self.taken(type_.name or "in_place")
            self.struct(type_, node)
        placed = self.declaration(layout.name, layout.type, layout.root)
        form = f"{layout.name}: layout {rules.name}, {rules.byte_order}-endian, {layout.size} bytes"
        head = [f"#pragma description {one_line(form)}", f"#pragma endian {rules.byte_order}", ""]
        name, brackets, doc = placed
        notes = _notes(layout.name, escaped(layout.name), doc)
        variable = f"{name} {NameScope(escaped)(layout.name.lower() + '_at_0')}{brackets} @ 0x00{notes};"
        return "\n".join([*head, *self.types, variable, ""])

    def struct(self, type_: Struct | Union, node: PlacedStruct) -> None:
        name, is_union = self.names[type_], isinstance(node, PlacedUnion)
        fields, base = fields_of(type_, node), ""
        if not is_union and fields and not fields[0].name and isinstance(fields[0].type, Struct):
            base = f" : {self.names[fields[0].type]}"
        lines, end, taken = [], 0, NameScope(escaped)
        for offset, group in groupby(fields, key=lambda field: field.offset):
            if offset > end:
                lines.append(f"    padding[{offset - end}];")
            members = [field for field in group if field.name or not base]
            lines += [
                f"    {line}" for line in self.members(members, taken, is_union, f"{name}_bits_{offset}")
            ]
            end = max(end, offset, *(offset + field.node.size for field in fields if field.offset == offset))
        if node.size > end:
            whole = node.size if is_union else node.size - end  # in a union it begins at 0, too
            lines.append(f"    padding[{whole}];")
        body = "\n".join([f"{'union' if is_union else 'struct'} {name}{base} {{", *lines, "};", ""])
        self.types.append(body)

    def members(
        self, fields: list[ExportField], taken: NameScope, is_union: bool, bits: str
    ) -> Iterable[str]:
        """Yield the lines of members at one offset: several of them are the bits of a byte."""
        if fields and fields[0].is_bit and not is_union:
            yield f"{self.bitfield(bits, fields)} {taken(f'bits_{fields[0].offset}')};"
            return
        for field in fields:
            word = taken(field.name or BASE_NAME)
            if field.is_bit:
                yield f"{self.bitfield(f'{bits}_{len(self.types)}', [field])} {word};"
            else:
                name, brackets, doc = self.declaration(field.name, field.type, field.node)
                yield f"{name} {word}{brackets}{_notes(field.name, word, doc)};"

    def bitfield(self, name: str, fields: list[ExportField]) -> str:
        taken = NameScope(escaped)
        words = [(field.name, taken(field.name)) for field in fields]
        lines = [f"    {word} : 1{_notes(name, word, '')};" for name, word in words]
        rest = [f"    padding : {8 - len(fields)};"] if len(fields) < 8 else []
        return self.add("bitfield", name, [*lines, *rest])

    def add(self, kind: str, name: str, lines: list[str], base: str = "") -> str:
        key = "\n".join([kind + base, *lines])
        if key not in self.written:
            self.written[key] = self.taken(name)
            self.types.append("\n".join([f"{kind} {self.written[key]}{base} {{", *lines, "};", ""]))
        return self.written[key]

    def declaration(self, own: str, type_: Type, node: Node) -> tuple[str, str, str]:
        if isinstance(type_, Array) and isinstance(node, PlacedArray):
            doc = f"ARRAY{bounds_text(type_)} OF {type_text(type_.element)}"
            if node.is_bits:
                lines = [f"    bit_{bit} : 1;" for bit in range(8)]
                name = self.add("bitfield", BYTE_OF_BITS, lines)
                return name, f"[{node.size}]", doc
            return self.element(own, type_, node), f"[{node.count}]", doc
        return self.one(type_, node)

    def element(self, own: str, type_: Array, node: PlacedArray) -> str:
        name, brackets, _ = self.declaration("value", type_.element, node.element)
        gap = node.pitch - node.element.size
        if not (brackets or gap):
            return name
        lines = [f"    {name} value{brackets};", *([f"    padding[{gap}];"] if gap else [])]
        return self.add("struct", f"{own}_element", lines)

    def one(self, type_: Type, node: Node) -> tuple[str, str, str]:
        if isinstance(type_, Struct | Union):
            return self.names[type_], "", ""
        assert isinstance(node, PlacedLeaf)
        if isinstance(node.type, StringType):
            return (*self.string(node.type), type_text(node.type))
        row = self.rules.stored(node.type)
        if isinstance(node.type, Enumeration):
            return self.enumeration(node.type, row), "", ""
        if row.code.endswith("s"):
            return "u8", f"[{row.size}]", row.name
        if row.kind is ValueKind.CHARACTER:
            return ("char" if row.size == 1 else "char16"), "", ""
        plain = row.kind in (ValueKind.BOOL, ValueKind.REAL, ValueKind.INTEGER)
        return NUMBERS[row.code], "", "" if plain else row.name

    def string(self, text: StringType) -> tuple[str, str]:
        character, number = ("char16", "u16") if text.wide else ("char", "u8")
        form, longest = self.rules.text, self.rules.text.length(text)
        if not form.header:
            return character, f"[{longest + form.extra}]"
        lines = [f"    {number} longest;", f"    {number} actual;", f"    {character} text[{longest}];"]
        return self.add("struct", f"{'W' if text.wide else ''}String{longest}", lines), ""

    def enumeration(self, type_: Enumeration, row: Elementary) -> str:
        if type_ not in self.names:
            taken = NameScope(escaped)
            lines = [f"    {taken(own)} = {number}," for own, number in type_.values if number is not None]
            name = type_.name or row.name
            self.names[type_] = (
                self.add("enum", name, lines, f" : {NUMBERS[row.code]}") if lines else NUMBERS[row.code]
            )
        return self.names[type_]


def _notes(own: str, word: str, doc: str) -> str:
    notes = [] if not own or own == word else [f"name({quoted(own)})"]
    notes += [f"comment({quoted(doc)})"] if doc else []
    return f" [[{', '.join(notes)}]]" if notes else ""
