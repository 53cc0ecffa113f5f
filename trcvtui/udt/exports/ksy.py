"""A Kaitai Struct description: a type for each structure, gaps as bytes without a name.

Times and addresses are their stored counts, with the unit in `doc`; BOOL is a byte, or a bit where it is one.
"""

from __future__ import annotations

import keyword
import re
from typing import Final

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
from trcvtui.udt.layout.value_text import UNITS
from trcvtui.udt.st_write import NameScope, ascii_word
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

Lines = list[str]

# What a generated class cannot call a member: words of the target languages, methods of the runtimes.
WORDS: Final = """
abstract alignas auto begin bool boolean byte case catch char checked clone close const decimal default
delegate delete do double dynamic end ensure enum event explicit export extends extern final finalize
fixed float foreach friend from_bytes from_file from_io func function get_class go goto hash_code
implements implicit inline int interface internal let lock long map module mutable namespace native nil
new notify null object operator out override package params private protected public range ref register
repeat root select self short signed sizeof static string struct super switch synchronized template
then this throw throws to_string transient true type typedef typename undef union unless unsigned
until using var virtual void volatile wait when xor
"""
RESERVED: Final = frozenset(WORDS.split()) | {word.lower() for word in keyword.kwlist}
BUILT_IN: Final = re.compile(r"([us][1248]|f[48])(le|be)?|b\d+(le|be)?|strz?|switch")
TEXT_TYPES: Final = {False: "s7_string", True: "s7_wstring"}


def word(name: str) -> str:
    """Return the name as an identifier of Kaitai: lower case, a letter first."""
    found = ascii_word(name).lower().lstrip("_") or "m"
    found = "m_" + found if found[0].isdigit() else found
    return found + "_" if found in RESERVED or BUILT_IN.fullmatch(found) else found


def write(layout: Layout) -> str:
    """Return the description of the type."""
    refuse_empty(layout)
    return "\n".join([*_KsyWriter(layout).lines(), ""])


class _KsyWriter:
    """Writes the types, and remembers which enumerations and text types they need."""

    def __init__(self, layout: Layout) -> None:
        self.layout, self.rules = layout, layout.rules
        self.taken = NameScope(word)
        self.main = self.taken(layout.name)
        self.names: dict[Struct | Union, str] = {}
        self.enumerations: dict[Enumeration, tuple[str, Lines]] = {}
        self.taken_enumerations = NameScope(word)
        self.further: dict[str, Lines] = {}

    def lines(self) -> Lines:
        root = self.layout.root
        for type_, _ in structs_of(self.layout.type, root):
            is_main = type_ is self.layout.type
            self.names[type_] = self.main if is_main else self.taken(type_.name or "in_place")
        if isinstance(self.layout.type, Struct | Union) and isinstance(root, PlacedStruct):
            main = self.members(self.layout.type, root)
        else:
            entry = self.entry("value", self.layout.type, root, self.layout.name)
            main = ["seq:", *_indented(entry)]
        types: Lines = []
        for type_, node in structs_of(self.layout.type, root):
            if type_ is not self.layout.type:
                types += [f"{self.names[type_]}:", *_indented(self.members(type_, node))]
        for name, lines in self.further.items():
            types += [f"{name}:", *_indented(lines)]
        enums = [line for _, lines in self.enumerations.values() for line in lines]
        return [
            *self.head(),
            *main,
            *(["types:", *_indented(types)] if types else []),
            *(["enums:", *_indented(enums)] if enums else []),
        ]

    def head(self) -> Lines:
        rules = self.rules
        form = f"layout {rules.name}, {rules.byte_order}-endian, {self.layout.size} bytes"
        return [
            "meta:",
            f"  id: {self.main}",
            f"  title: {quoted(f'{self.layout.name} ({form})')}",
            '  ks-version: "0.11"',
            f"  endian: {rules.byte_order[0]}e",
            "  bit-endian: le",
        ]

    def members(self, type_: Struct | Union, node: PlacedStruct) -> Lines:
        """Return the members of a structure as `seq`, those of a union as `instances`."""
        taken = NameScope(word)
        if isinstance(node, PlacedUnion):
            lines: Lines = ["instances:"]
            for field in fields_of(type_, node):
                first, *rest = self.named(field, taken)
                lines += [f"  {first.removeprefix('- id: ')}:", "    pos: 0", *_indented(rest)]
            return lines
        lines, end = ["seq:"], 0
        for field in fields_of(type_, node):
            if field.offset > end:
                lines += _gap(field.offset - end)
            lines += _indented(self.named(field, taken))
            end = max(end, field.offset + field.node.size)
        return lines + (_gap(node.size - end) if node.size > end else [])

    def named(self, field: ExportField, taken: NameScope) -> Lines:
        return self.entry(taken(field.name or BASE_NAME), field.type, field.node, field.name)

    def entry(self, name: str, type_: Type, node: Node, own: str) -> Lines:
        """Return one attribute, the line of its `id` first."""
        shown = own if own.lower() != name else ""
        if isinstance(type_, Array) and isinstance(node, PlacedArray):
            attribute, doc = self.array(type_, node, name)
        else:
            attribute, doc = self.one(type_, node)
        doc = ": ".join(part for part in (shown, doc) if part)
        return [f"- id: {name}", *_indented(attribute), *([f"  doc: {quoted(doc)}"] if doc else [])]

    def array(self, type_: Array, node: PlacedArray, name: str) -> tuple[Lines, str]:
        doc = f"ARRAY{bounds_text(type_)} OF {type_text(type_.element)}"
        if node.is_bits:
            rows = node.count // node.columns
            row = self.add(f"{name}_bits", ["seq:", "  - id: bit", "    type: b1", *_repeat(node.columns, 2)])
            return [f"type: {row}", f"size: {node.row_size}", *_repeat(rows)], doc
        element = type_.element
        if isinstance(element, Array) or (
            isinstance(node.element, PlacedLeaf) and node.pitch != node.element.size
        ):
            lines = ["seq:", *_indented(self.entry("value", element, node.element, ""))]
            row = self.add(f"{name}_element", lines)
            return [f"type: {row}", f"size: {node.pitch}", *_repeat(node.count)], doc
        attribute, more = self.one(element, node.element, node.pitch)
        return [*attribute, *_repeat(node.count)], f"{doc}, {more}" if more else doc

    def one(self, type_: Type, node: Node, size: int | None = None) -> tuple[Lines, str]:
        if isinstance(type_, Struct | Union):
            return [f"type: {self.names[type_]}", f"size: {size or node.size}"], ""
        assert isinstance(node, PlacedLeaf)
        if node.is_bit:
            return ["type: b1"], ""
        if isinstance(node.type, StringType):
            return self.text(node.type, node.size), ""
        row = self.rules.stored(node.type)
        if isinstance(node.type, Enumeration):
            return [f"type: {_number(row)}", *self.enumerated(node.type, row)], ""
        return _elementary(row)

    def text(self, text: StringType, size: int) -> Lines:
        encoding = "UTF-8" if text.utf8 else "ISO-8859-1"
        if text.wide:
            encoding = "UTF-16BE" if self.rules.byte_order == "big" else "UTF-16LE"
        longest, unit = self.rules.text.length(text), 2 if text.wide else 1
        if self.rules.text.header:
            name = self.headed(TEXT_TYPES[text.wide], "u2" if text.wide else "u1", unit, encoding)
            return [f"type: {name}({longest})", f"size: {size}"]
        lines = ["seq:", "  - id: text", "    type: strz", f"    size: {longest * unit}"]
        name = self.add(f"{'w' if text.wide else ''}string_{longest}", [*lines, f"    encoding: {encoding}"])
        return [f"type: {name}", f"size: {size}"]

    def headed(self, name: str, number: str, unit: int, encoding: str) -> str:
        used = f"(actual < capacity ? actual : capacity){' * 2' if unit == 2 else ''}"
        return self.add(
            name,
            [
                "params:", "  - id: capacity", "    type: u2",
                "seq:",
                "  - id: longest", f"    type: {number}",
                "  - id: actual", f"    type: {number}",
                "  - id: text", "    type: str", f"    size: '{used}'", f"    encoding: {encoding}",
            ],
        )  # fmt: skip

    def add(self, name: str, lines: Lines) -> str:
        known = next((name for name, found in self.further.items() if found == lines), None)
        if known is None:
            known = self.taken(name)
            self.further[known] = lines
        return known

    def enumerated(self, type_: Enumeration, row: Elementary) -> Lines:
        if type_ not in self.enumerations:
            name, taken = self.taken_enumerations(type_.name or row.name), NameScope(word)
            numbers: dict[int, str] = {}
            for own, number in type_.values:
                if number is not None and number not in numbers:
                    numbers[number] = taken(own)
            lines = [f"  {number}: {_plain(value)}" for number, value in numbers.items()]
            self.enumerations[type_] = name, [f"{name}:", *lines] if lines else []
        name, lines = self.enumerations[type_]
        return [f"enum: {name}"] if lines else []


def _plain(value: str) -> str:
    # YAML reads on, off, yes and no as truth.
    return f"'{value}'"


def _number(row: Elementary) -> str:
    return f"{'s' if row.code.islower() else 'u'}{row.size}"


def _elementary(row: Elementary) -> tuple[Lines, str]:
    match row.kind:
        case ValueKind.REAL:
            return [f"type: f{row.size}"], ""
        case ValueKind.BOOL:
            return ["type: u1"], "BOOL, 0 is FALSE"
        case ValueKind.CHARACTER if row.size == 1:
            return ["type: str", "size: 1", "encoding: ISO-8859-1"], ""
    if row.code.endswith("s"):
        return [f"size: {row.size}"], row.name
    return [f"type: {_number(row)}"], "" if row.kind is ValueKind.INTEGER else _unit(row)


def _unit(row: Elementary) -> str:
    if not row.unit_ns:
        return row.name
    since = {
        ValueKind.DATE: " since 1970",
        ValueKind.DATE_AND_TIME: " since 1970",
        ValueKind.TIME_OF_DAY: " since midnight",
    }
    epoch = " since 1990" if row.epoch_ns else since.get(row.kind, "")
    return f"{row.name} in {UNITS[row.unit_ns]}{epoch}"


def _repeat(count: int, depth: int = 0) -> Lines:
    blank = "  " * depth
    return [f"{blank}repeat: expr", f"{blank}repeat-expr: {count}"]


def _gap(size: int) -> Lines:
    return [f"  - size: {size}  # padding"]


def _indented(lines: Lines) -> Lines:
    return ["  " + line for line in lines]
