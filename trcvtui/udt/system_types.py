"""The system types of Siemens as types, made from the same rows as a CONNECT."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache

from trcvtui.system_types import ENUMERATIONS, HANDLE_TYPES, STRUCTURES, FieldType, Structure
from trcvtui.udt.types import (
    ELEMENTARY,
    Array,
    BitField,
    Enumeration,
    Member,
    StringType,
    Struct,
    Type,
    all_parts,
)


@cache
def system_types() -> Mapping[str, Type]:
    """Return the types by casefolded name."""
    types: dict[str, Type] = {name.casefold(): ELEMENTARY["UINT"] for name in HANDLE_TYPES}
    for name, values in ENUMERATIONS.items():
        types[name.casefold()] = Enumeration(name, ELEMENTARY["USINT"], tuple(values.items()))
    for structure in STRUCTURES:
        types[structure.name.casefold()] = _make_struct(structure, types)
    return types


def unverified_in(type_: Type) -> list[str]:
    """Return the names of the system types in this type whose offsets no page of the manual shows."""
    unsure = {id(system_types()[each.name.casefold()]) for each in STRUCTURES if not each.is_verified}
    return [part.name for part in all_parts(type_) if isinstance(part, Struct) and id(part) in unsure]


def _make_struct(structure: Structure, types: Mapping[str, Type]) -> Struct:
    members: list[Member] = []
    bits: list[BitField] = []
    end, before, fields = 0, "", structure.fields
    for head in [each for each in STRUCTURES if each.name == structure.head]:
        members.append(Member("ConnPara", types[head.name.casefold()]))
        end, fields = head.size, fields[len(head.fields) :]
    for field in fields:
        # Room without a member; of width 0 it puts a BOOL after a BOOL into the next byte.
        if field.offset > end or before == field.type == FieldType.TRUTH:
            bits.append(BitField(len(members), 1, 8 * (field.offset - end), False))
        members.append(Member(field.name, _make_type(field.data_type, types)))
        end, before = field.offset + field.size, field.type
    return Struct(structure.name, tuple(members), bit_fields=tuple(bits))


def _make_type(name: str, types: Mapping[str, Type]) -> Type:
    if found := re.fullmatch(r"ARRAY\[1\.\.(\d+)\] OF (\w+)", name):
        return Array(((1, int(found[1])),), ELEMENTARY[found[2]])
    return StringType(254) if name == "STRING[254]" else types.get(name.casefold()) or ELEMENTARY[name]
