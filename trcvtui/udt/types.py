"""IEC types as frozen values: elementary types (one table row each), STRING, ARRAY, STRUCT, enumeration.

Rule: a type knows no offsets. Sizes, gaps and byte order come from its layout.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Final, NamedTuple

MS = 1_000_000
SECOND = 1_000 * MS
DAY = 86_400 * SECOND


class ValueKind(Enum):
    """How the bytes of an elementary type become a value."""

    BOOL = "BOOL"
    INTEGER = "integer"
    BITS = "bit string"
    REAL = "real"
    CHARACTER = "character"
    DURATION = "duration"
    DATE = "date"
    TIME_OF_DAY = "time of day"
    DATE_AND_TIME = "date and time"
    ADDRESS = "address"


WHOLE_KINDS = (ValueKind.INTEGER, ValueKind.BITS)


@dataclass(frozen=True, slots=True)
class Elementary:
    """Size and natural alignment in bytes, `struct` code, nanoseconds per count (`unit_ns`).

    `epoch_ns` is where the count of a date begins, in nanoseconds since 1970.
    """

    name: str
    size: int
    align: int
    code: str
    kind: ValueKind
    unit_ns: int = 0
    epoch_ns: int = 0

    @property
    def limits(self) -> tuple[int, int]:
        """Return the smallest and the largest whole number that the type can hold."""
        bits = 8 * self.size
        return (-(1 << bits - 1), (1 << bits - 1) - 1) if self.code.islower() else (0, (1 << bits) - 1)


# As Baosky: TIME and LTIME with a sign, DATE in days. What no page of Baosky states (the epoch of DATE; TOD,
# DT and the L-forms) follows CODESYS and is shown as unverified.
ELEMENTARY_ROWS = (
    Elementary("BOOL", 1, 1, "?", ValueKind.BOOL),
    Elementary("BIT", 1, 1, "?", ValueKind.BOOL),
    Elementary("BYTE", 1, 1, "B", ValueKind.BITS),
    Elementary("WORD", 2, 2, "H", ValueKind.BITS),
    Elementary("DWORD", 4, 4, "I", ValueKind.BITS),
    Elementary("LWORD", 8, 8, "Q", ValueKind.BITS),
    Elementary("SINT", 1, 1, "b", ValueKind.INTEGER),
    Elementary("INT", 2, 2, "h", ValueKind.INTEGER),
    Elementary("DINT", 4, 4, "i", ValueKind.INTEGER),
    Elementary("LINT", 8, 8, "q", ValueKind.INTEGER),
    Elementary("USINT", 1, 1, "B", ValueKind.INTEGER),
    Elementary("UINT", 2, 2, "H", ValueKind.INTEGER),
    Elementary("UDINT", 4, 4, "I", ValueKind.INTEGER),
    Elementary("ULINT", 8, 8, "Q", ValueKind.INTEGER),
    Elementary("REAL", 4, 4, "f", ValueKind.REAL),
    Elementary("LREAL", 8, 8, "d", ValueKind.REAL),
    Elementary("CHAR", 1, 1, "B", ValueKind.CHARACTER),
    Elementary("WCHAR", 2, 2, "H", ValueKind.CHARACTER),
    Elementary("TIME", 4, 4, "i", ValueKind.DURATION, MS),
    Elementary("LTIME", 8, 8, "q", ValueKind.DURATION, 1),
    Elementary("DATE", 4, 4, "I", ValueKind.DATE, DAY),
    Elementary("LDATE", 8, 8, "q", ValueKind.DATE, 1),
    Elementary("TOD", 4, 4, "I", ValueKind.TIME_OF_DAY, MS),
    Elementary("LTOD", 8, 8, "Q", ValueKind.TIME_OF_DAY, 1),
    Elementary("DT", 4, 4, "I", ValueKind.DATE_AND_TIME, SECOND),
    Elementary("LDT", 8, 8, "q", ValueKind.DATE_AND_TIME, 1),
    Elementary("S5TIME", 2, 2, "H", ValueKind.DURATION),
    Elementary("DTL", 12, 4, "12s", ValueKind.DATE_AND_TIME),
    Elementary("PVOID", 8, 8, "Q", ValueKind.ADDRESS),
    Elementary("XWORD", 8, 8, "Q", ValueKind.ADDRESS),
    Elementary("XINT", 8, 8, "Q", ValueKind.ADDRESS),
    Elementary("UXINT", 8, 8, "Q", ValueKind.ADDRESS),
)
# Names of a single vendor: a file of another vendor may declare its own type of such a name.
VENDOR_NAMES = frozenset({"BIT", "S5TIME", "DTL", "PVOID", "XWORD", "XINT", "UXINT"})
SYNONYMS = {
    "TIME_OF_DAY": "TOD",
    "LTIME_OF_DAY": "LTOD",
    "DATE_AND_TIME": "DT",
    "LDATE_AND_TIME": "LDT",
    "DATE_AND_LTIME": "LDT",
    "__XWORD": "XWORD",
    "__XINT": "XINT",
    "__UXINT": "UXINT",
}

ELEMENTARY = {row.name: row for row in ELEMENTARY_ROWS}
ELEMENTARY |= {synonym: ELEMENTARY[name] for synonym, name in SYNONYMS.items()}
ADDRESS = ELEMENTARY["PVOID"]  # how a pointer is stored


@dataclass(frozen=True, slots=True)
class StringType:
    """STRING or WSTRING of `length` characters. If `length` is None, the layout has a default length.

    With `utf8` (TwinCAT's TcEncoding) the text has `length` bytes of UTF-8, not characters of Latin-1.
    """

    length: int | None = None
    wide: bool = False
    utf8: bool = False


@dataclass(frozen=True, slots=True)
class Subrange:
    """A range such as `INT(0..10)`, stored as its base type. A received value may be outside the range."""

    base: Elementary
    low: int
    high: int


@dataclass(frozen=True, slots=True)
class Pointer:
    """An address: POINTER TO, REFERENCE TO, REF_TO. `text` is the declaration, as `POINTER TO Axis`."""

    text: str


@dataclass(frozen=True, slots=True)
class RawType:
    """A type of the source that has no layout, such as an FB instance, an interface or ANY."""

    name: str
    why: str


@dataclass(frozen=True, slots=True)
class Array:
    """ARRAY with its bounds in declared order; in memory the last index varies fastest."""

    bounds: tuple[tuple[int, int], ...]
    element: Type

    @property
    def count(self) -> int:
        count = 1
        for low, high in self.bounds:
            count *= high - low + 1
        return count


@dataclass(frozen=True, slots=True, eq=False)
class Member:
    name: str
    type: Type = field(repr=False)


class BitField(NamedTuple):
    """A bit-field of C before member number `at`. Only its room counts. Its type has `size` bytes.

    With `element` it is an ARRAY without a length, which has no bytes but aligns the end of the type.
    """

    at: int
    size: int
    width: int
    is_named: bool
    element: Type | None = None


# eq=False: two UDTs are the same type only if they are the same declaration, as in IEC 61131-3. Comparing
# by value would also walk a shared type once for each path to it.
@dataclass(frozen=True, slots=True, eq=False)
class Struct:
    """STRUCT with its own members in declared order. A STRUCT that is written in place has no `name`.

    `base` is the STRUCT after EXTENDS, whose members come first. `pack` is the pack_mode attribute in
    bytes, or None without the attribute. A pack_mode of 0 or 1 leaves no gaps.
    """

    name: str
    members: tuple[Member, ...]
    base: Struct | None = None
    pack: int | None = None
    bit_fields: tuple[BitField, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Union:
    """UNION with all members at offset 0. `base` and `pack` are as in Struct."""

    name: str
    members: tuple[Member, ...]
    base: Union | None = None
    pack: int | None = None
    bit_fields: tuple[BitField, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Enumeration:
    """Enumeration of (name, number) pairs. A number that could not be evaluated is None.

    If `is_named`, the declaration names the base. Else the layout chooses the base.
    """

    name: str
    base: Elementary
    values: tuple[tuple[str, int | None], ...]
    is_named: bool = True


Type = Elementary | StringType | Subrange | Pointer | RawType | Array | Struct | Union | Enumeration
LeafType = Elementary | StringType | Subrange | Pointer | Enumeration


def all_members(type_: Struct | Union | None) -> list[Member]:
    """Return the members of a STRUCT, inherited ones (EXTENDS) first; no members for None."""
    return [*all_members(type_.base), *type_.members] if type_ else []


def direct_parts(type_: Type) -> list[Type]:
    """Return the direct parts of a type: its element, or its base and the types of its members."""
    match type_:
        case Array():
            return [type_.element]
        case Struct() | Union():
            return [*([type_.base] if type_.base else []), *(member.type for member in type_.members)]
        case _:
            return []


def all_parts(type_: Type) -> Iterator[Type]:
    """Yield a type and all types in it, each once, in declared order."""
    waiting, seen = [type_], set()
    while waiting:
        one = waiting.pop()
        if id(one) not in seen:
            seen.add(id(one))
            yield one
            waiting += reversed(direct_parts(one))


def type_text(type_: Type) -> str:
    """Return the type as a declaration names it, such as `ARRAY[0..9] OF STRING[20]`."""
    match type_:
        case Elementary() | RawType():
            return type_.name
        case StringType(length=length, wide=wide):
            return ("WSTRING" if wide else "STRING") + ("" if length is None else f"[{length}]")
        case Subrange(base=base, low=low, high=high):
            return f"{base.name}({low}..{high})"
        case Pointer(text=text):
            return text
        case Array(bounds=bounds, element=element):
            ranges = ",".join(f"{low}..{high}" for low, high in bounds)
            return f"ARRAY[{ranges}] OF {type_text(element)}"
        case Struct(name=name):
            return name or "STRUCT"
        case Union(name=name):
            return name or "UNION"
        case Enumeration(name=name, base=base):
            return name or base.name


FB_INSTANCE: Final = "an FB instance"
ANY_REFERENCE: Final = "a reference of unknown size"

_FUNCTION_BLOCKS = (
    *("TON", "TOF", "TP", "TONR", "LTON", "LTOF", "LTP", "TON_TIME", "TOF_TIME", "TP_TIME", "TONR_TIME"),
    *("TON_LTIME", "TOF_LTIME", "TP_LTIME", "TONR_LTIME", "IEC_TIMER", "IEC_LTIMER", "RTC"),
    *("CTU", "CTD", "CTUD", "CTU_INT", "CTU_DINT", "CTU_LINT", "CTU_UDINT", "CTU_ULINT"),
    *("CTD_INT", "CTD_DINT", "CTUD_INT", "CTUD_DINT", "IEC_COUNTER", "IEC_DCOUNTER"),
    *("R_TRIG", "F_TRIG", "SR", "RS", "SEMA"),
)
_ANY_TYPE_NAMES = (
    *("ANY", "ANY_NUM", "ANY_REAL", "ANY_INT", "ANY_BIT", "ANY_STRING", "ANY_DATE", "ANY_TYPE", "VARIANT"),
    "POINTER",
)

BUILTIN_TYPES: Final[dict[str, Type]] = {
    **{name.casefold(): RawType(name, FB_INSTANCE) for name in _FUNCTION_BLOCKS},
    **{name.casefold(): RawType(name, ANY_REFERENCE) for name in _ANY_TYPE_NAMES},
    "t_maxstring": StringType(255),  # TwinCAT, library Tc2_System
}
