"""A type written down as C for a sender: a packed struct in which every gap is a member.

Rule: `#pragma pack(1)` and explicit padding leave the compiler nothing to decide.
"""

from __future__ import annotations

from typing import Final

from trcvtui.udt.cure.padded_type import corrective
from trcvtui.udt.layout.layout import Layout, lay_out
from trcvtui.udt.layout.rules import LayoutRules, rules_for
from trcvtui.udt.renaming import Renaming, c_word
from trcvtui.udt.st_write import named_types
from trcvtui.udt.types import Array, Struct, Text, Type, Union, Unplaced

C_TYPES: Final = {
    "?": "uint8_t",
    "b": "int8_t",
    "B": "uint8_t",
    "h": "int16_t",
    "H": "uint16_t",
    "i": "int32_t",
    "I": "uint32_t",
    "q": "int64_t",
    "Q": "uint64_t",
    "f": "float",
    "d": "double",
}


def c_text(wanted: Layout) -> str | None:
    """Return the C struct that lies as `wanted`; None where a member is one bit or has no C type."""
    rules = rules_for("packed", wanted.rules.byte_order, wanted.rules.text.name)
    found = corrective(wanted, rules)
    if not found.is_possible or not isinstance(found.type, Struct):
        return None
    assert lay_out(found.type, rules).size == wanted.size
    renaming = Renaming(c_word)
    type_ = renaming.of(found.type)
    name = renaming.names(found.layout.name)  # of a type without a name
    parts = [
        f"typedef {_body(each, rules, '')} {each.name or name};\n"
        for each in named_types(type_)
        if isinstance(each, Struct | Union)
    ]
    body = "\n".join(parts)
    return f"#include <stdint.h>\n\n#pragma pack(push, 1)\n{body}#pragma pack(pop)\n"


def _body(type_: Struct | Union, rules: LayoutRules, indent: str) -> str:
    word = "struct" if isinstance(type_, Struct) else "union"
    inner = indent + "    "
    lines = [f"{inner}{_member(member.type, member.name, rules, inner)};\n" for member in type_.members]
    return f"{word} {{\n{''.join(lines)}{indent}}}"


def _member(type_: Type, name: str, rules: LayoutRules, indent: str) -> str:
    match type_:
        case Array(bounds=bounds, element=element):
            dimensions = "".join(f"[{high - low + 1}]" for low, high in bounds)
            return _member(element, name + dimensions, rules, indent)
        case Struct() | Union():
            return f"{type_.name or _body(type_, rules, indent)} {name}"
        case Text(wide=wide):
            units = rules.text.length(type_) + rules.text.extra
            what = "uint16_t" if wide else "uint8_t" if rules.text.header else "char"
            return f"{what} {_indexed(name, units)}"
        case Unplaced():  # it has no layout, so it is in none
            return f"uint8_t {name}"
        case _:
            row = rules.stored(type_)
            if row.code in C_TYPES:
                return f"{C_TYPES[row.code]} {name}"
            return f"uint8_t {_indexed(name, row.size)}"


def _indexed(name: str, units: int) -> str:
    """Return the name with one more, innermost, index."""
    return f"{name}[{units}]"
