"""A Wireshark dissector in Lua, with a ProtoField for each member. It joins TCP segments to whole values.

Rule: a STRUCT is written once for all members of its type, and the element of an array only once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from string import Template
from typing import NamedTuple

from trcvtui.errors import mistake, one_line
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.layout_tree import Node, PlacedArray, PlacedLeaf, PlacedStruct, members_of
from trcvtui.udt.literals import PREFIXES
from trcvtui.udt.st_write import NameScope, ascii_word
from trcvtui.udt.types import DAY, Array, Elementary, Enumeration, StringType, Struct, Type, Union, ValueKind

MOST_FIELDS = 20_000
FILTER_PREFIX = "plc_"  # keeps the filter name apart from the protocols that Wireshark has
LARGEST_EXACT = 1 << 53  # numbers in Lua 5.2 are doubles
CLOCKS = {
    ValueKind.DURATION: "duration",
    ValueKind.DATE: "date",
    ValueKind.TIME_OF_DAY: "clock",
    ValueKind.DATE_AND_TIME: "date_clock",
}
OWN_FORM_READERS = {"8s": "bcd", "12s": "dtl"}


def write_dissector(layout: Layout, port: int | None = None) -> str:
    """Return the dissector; without a port it waits for "Decode As"."""
    if not layout.size or not layout.leaf_count:
        raise mistake(layout.name, "a type without a value", "a type with at least one")
    count = count_fields(layout.type, layout.root)
    if count > MOST_FIELDS:
        raise mistake(layout.name, f"{count} members", f"at most {MOST_FIELDS} for a dissector")
    writer = _LuaWriter(layout)
    root = writer.node(layout.type, layout.root, 0, None, "FILTER", 0)
    # Also collects the readers and enumerations that are written below.
    structs = [writer.struct(type_, node) for type_, node in structs_of(layout.type, layout.root)]
    rules, name = layout.rules, one_line(layout.name)
    form = f"layout {rules.name}, {rules.byte_order}-endian, {layout.size} bytes"
    begin = Template(_read_sections()["begin"].text).substitute(
        name=name,
        form=form,
        where=f"TCP port {port}" if port else '"Decode As" on a TCP port',
        little=str(rules.byte_order == "little").lower(),
        size=layout.size,
        title=quote(name),
        filter=quote(filter_name(layout.name)),
        about=quote(f"{name} ({form})"),
    )
    add = f"add({port}, proto)" if port else "add_for_decode_as(proto)"
    end = Template(_read_sections()["end"].text).substitute(
        root=root, register=f'DissectorTable.get("tcp.port"):{add}'
    )
    readers = [part.text for reader, part in _read_sections().items() if reader in writer.readers]
    return "".join(
        [begin, *readers, *(f"{text}\n" for text in (*writer.enumerations.values(), *structs)), end]
    )


class _LuaSection(NamedTuple):
    text: str
    calls: list[str]


@cache
def _read_sections() -> dict[str, _LuaSection]:
    """Return the parts of `dissector.lua` by name, in the order in which they are written."""
    text = Path(__file__).with_name("dissector.lua").read_text(encoding="utf-8")
    _, *pieces = re.split(r"^--- (.+)\n", text, flags=re.MULTILINE)
    heads = [head.split() for head in pieces[::2]]
    return {name: _LuaSection(text, calls) for (name, *calls), text in zip(heads, pieces[1::2], strict=True)}


def filter_name(name: str) -> str:
    return FILTER_PREFIX + ascii_word(name).lower()


def quote(text: str) -> str:
    """Return the text as a Lua string, everything but plain ASCII as escaped UTF-8 bytes."""
    written = []
    for byte in text.encode("utf-8", "replace"):
        plain = 0x20 <= byte < 0x7F and byte not in b'"\\'
        written.append(chr(byte) if plain else f"\\{byte:03d}")
    return f'"{"".join(written)}"'


class _LuaWriter:
    """Writes nodes, and collects the readers and the enumerations that the nodes need."""

    def __init__(self, layout: Layout) -> None:
        self.layout, self.rules = layout, layout.rules
        self.readers: set[str] = set()
        self.enumerations: dict[Enumeration, str] = {}
        self.value_names: dict[Enumeration, str] = {}
        self.type_names: dict[Struct | Union, str] = {}
        self.taken_types, self.taken_values = NameScope(ascii_word), NameScope(ascii_word)

    def struct_name(self, type_: Struct | Union) -> str:
        if type_ not in self.type_names:
            self.type_names[type_] = self.taken_types("t_" + (type_.name or "in_place"))
        return self.type_names[type_]

    def struct(self, type_: Struct | Union, node: PlacedStruct) -> str:
        lines = [f"types.{self.struct_name(type_)} = function(path)", "  return {"]
        taken = NameScope(ascii_word)
        for name, offset, bit, inner, member in members_of(type_, node):
            if inner.leaves:
                path = f'path .. ".{taken(name)}"'
                lines.append(f"    {self.node(member, inner, offset, name, path, bit or 0)},")
        return "\n".join([*lines, "  }", "end", ""])

    def node(self, type_: Type, node: Node, at: int, name: str | None, path: str, bit: int) -> str:
        shown = "nil" if name is None else quote(name)
        place = f"{at}, {node.size}, {shown}"
        match type_, node:
            case Struct() | Union(), PlacedStruct():
                return f"branch({place}, types.{self.struct_name(type_)}({path}))"
            case Array(), PlacedArray():
                return self.array(type_, node, at, name, path)
            case _, PlacedLeaf():
                return self.leaf(node, place, name or self.layout.name, path, bit)
        raise AssertionError(type_)  # pragma: no cover

    def array(self, type_: Array, node: PlacedArray, at: int, name: str | None, path: str) -> str:
        shown = name or self.layout.name
        bounds = "{ " + ", ".join(f"{{ {low}, {high} }}" for low, high in type_.bounds) + " }"
        place = f"{at}, {node.size}, {quote(shown)}, {bounds}"
        if node.is_bits:
            masked = f"masks({path}, {quote(shown)}, {min(8, node.columns)})"
            return f"bit_list({place}, {node.row_size}, {masked})"
        return f"list({place}, {node.pitch}, {self.node(type_.element, node.element, 0, shown, path, 0)})"

    def leaf(self, node: PlacedLeaf, place: str, name: str, path: str, bit: int) -> str:
        path = f'{path} .. ".value"' if path == "FILTER" else path
        if node.is_bit:
            return f'leaf({place}, field("bool", {path}, {quote(name)}, 8, nil, {1 << bit}))'
        kind, more, read = self.field_form(node)
        more = f", {more}" if more else ""
        read = f", {read}" if read else ""
        return f'leaf({place}, field("{kind}", {path}, {quote(name)}{more}){read})'

    def field_form(self, node: PlacedLeaf) -> tuple[str, str, str]:
        if isinstance(node.type, StringType):
            return "string", "", self.text_reader(node.type)
        row = self.rules.storage(node.type)
        if isinstance(node.type, Enumeration):
            return _integer_type(row), f"base.DEC, {self.use_enumeration(node.type, row)}", ""
        match row.kind:
            case ValueKind.BOOL:
                return "bool", "", ""
            case ValueKind.INTEGER:
                return _integer_type(row), "base.DEC", ""
            case ValueKind.BITS | ValueKind.ADDRESS:
                return _integer_type(row), "base.HEX", ""
            case ValueKind.REAL:
                return "float" if row.size == 4 else "double", "", ""
            case ValueKind.CHARACTER:
                return "string", "", self.use_reader("latin1" if row.size == 1 else "wide")
            case _:
                return "string", "", self.time_reader(row)

    def text_reader(self, text: StringType) -> str:
        name = ("headed" if self.rules.text.header else "ended") + ("_wide" if text.wide else "")
        reader = f", {self.use_reader('as_utf8')}" if text.utf8 else ""
        return f"{self.use_reader(name)}({self.rules.text.length(text)}{reader})"

    def time_reader(self, row: Elementary) -> str:
        if row.code in OWN_FORM_READERS or row.name == "S5TIME":
            return self.use_reader(OWN_FORM_READERS.get(row.code, "s5time"))
        day = f", {row.epoch_ns // DAY}" if row.kind in (ValueKind.DATE, ValueKind.DATE_AND_TIME) else ""
        sign = str(row.code.islower()).lower()
        return f"{self.use_reader(CLOCKS[row.kind])}({quote(PREFIXES[row.name])}, {sign}, {row.unit_ns}{day})"

    def use_reader(self, reader: str) -> str:
        if reader not in self.readers:
            self.readers.add(reader)
            for needed in _read_sections()[reader].calls:
                self.use_reader(needed)
        return reader

    def use_enumeration(self, type_: Enumeration, row: Elementary) -> str:
        if type_ not in self.enumerations:
            name = self.taken_values("e_" + (type_.name or row.name))
            lines = [f"values.{name} = {{"]
            known: set[int] = set()
            for word, number in type_.values:
                if number is not None and abs(number) < LARGEST_EXACT and number not in known:
                    known.add(number)
                    lines.append(f"  [{number}] = {quote(word)},")
            self.enumerations[type_] = "\n".join([*lines, "}", ""])
            self.value_names[type_] = name
        return f"values.{self.value_names[type_]}"


def _integer_type(row: Elementary) -> str:
    return f"{'int' if row.code.islower() else 'uint'}{8 * row.size}"


# -- the walk over the type --------------------------------------------------------------------------------


def structs_of(type_: Type, node: Node) -> Iterator[tuple[Struct | Union, PlacedStruct]]:
    """Yield every structure and union that has leaves, each once and after the types that it uses."""
    seen: set[Struct | Union] = set()

    def walk(type_: Type, node: Node) -> Iterator[tuple[Struct | Union, PlacedStruct]]:
        if isinstance(type_, Array) and isinstance(node, PlacedArray):
            yield from walk(type_.element, node.element)
        elif isinstance(type_, Struct | Union) and isinstance(node, PlacedStruct) and type_ not in seen:
            seen.add(type_)
            for _, _, _, inner, member in members_of(type_, node):
                if inner.leaves:
                    yield from walk(member, inner)
            yield type_, node

    yield from walk(type_, node)


def count_fields(type_: Type, node: Node) -> int:
    """Return the number of paths to leaves, without indices; each level of nesting may double it."""
    counts: dict[Type, int] = {}

    def count_paths(type_: Type, node: Node) -> int:
        while isinstance(type_, Array) and isinstance(node, PlacedArray):
            type_, node = type_.element, node.element
        return counts.get(type_, 1)

    for struct, placed in structs_of(type_, node):
        members = members_of(struct, placed)
        counts[struct] = sum(count_paths(member, inner) for _, _, _, inner, member in members if inner.leaves)
    return count_paths(type_, node)
