"""The system types of Siemens as types, made of the rows that a CONNECT is made of, too."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache

from trcvtui.system_types import ENUMERATIONS, HANDLES, STRUCTURES, FieldType, Structure
from trcvtui.system_types import UNSURE_HANDLES as UNSURE_HANDLES
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

_UNVERIFIED = [structure.name for structure in STRUCTURES if not structure.is_verified]


@cache
def system_types() -> Mapping[str, Type]:
    """Return the types by casefolded name."""
    types: dict[str, Type] = {name.casefold(): ELEMENTARY["UINT"] for name in HANDLES}
    for name, values in ENUMERATIONS.items():
        types[name.casefold()] = Enumeration(name, ELEMENTARY["USINT"], tuple(values.items()))
    for structure in STRUCTURES:
        types[structure.name.casefold()] = _struct(structure, types)
    return types


def unverified_in(type_: Type) -> Iterator[str]:
    """Yield the names of the system types in a type whose offsets no page shows."""
    unverified = [system_types()[name.casefold()] for name in _UNVERIFIED]
    return (_UNVERIFIED[unverified.index(part)] for part in all_parts(type_) if part in unverified)


def _struct(structure: Structure, types: Mapping[str, Type]) -> Struct:
    head = next((one for one in STRUCTURES if one.name == structure.head), None)
    members = [Member("ConnPara", types[head.name.casefold()])] if head else []
    bits: list[BitField] = []
    end, before = head.size if head else 0, ""
    for field in structure.fields[len(head.fields) if head else 0 :]:
        # Room without a member; where there is none, a BOOL after a BOOL still has a byte of its own.
        if field.offset > end or before == field.type == FieldType.TRUTH:
            bits.append(BitField(len(members), 1, 8 * (field.offset - end), False))
        members.append(Member(field.name, _type(field.data_type, types)))
        end, before = field.offset + field.size, field.type
    return Struct(structure.name, tuple(members), bit_fields=tuple(bits))


def _type(name: str, types: Mapping[str, Type]) -> Type:
    if found := re.fullmatch(r"ARRAY\[1\.\.(\d+)\] OF (\w+)", name):
        return Array(((1, int(found[1])),), ELEMENTARY[found[2]])
    return StringType(254) if name == "STRING[254]" else types.get(name.casefold()) or ELEMENTARY[name]
