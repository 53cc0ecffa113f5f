"""What a source file declares, before names are looked up: each name still knows where it stands.

Every source format is read into these values; `type_set.py` turns them into types.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from trcvtui.errors import Problem
from trcvtui.udt.types import Pointer, StringType, Unplaced

# Baosky allows 6 or 8 levels; beyond this no tool in the field follows.
MOST_NESTED = 32
MOST_DIMENSIONS = 8
NO_LENGTH = -1  # in place of a width: an ARRAY OF `spec` without a length at the end, which is no member
CPP_NOTE = "this is C++"
PACK_MODES = (0, 1, 2, 4, 8)  # what a pack_mode may be


class Formula(NamedTuple):
    """A whole number written with names (`GVL.MAX + 1`); worked out when constants are known."""

    text: str
    where: str


Number = int | Formula


class Reference(NamedTuple):
    """The name of a type, qualified or not (`Lib.T`, `_.T`)."""

    name: str
    where: str


class TextSpec(NamedTuple):
    """STRING or WSTRING whose length is a formula; one with a plain length is a `StringType` at once."""

    length: Formula
    wide: bool
    utf8: bool = False


class RangeSpec(NamedTuple):
    """A subrange such as `INT(0..10)`."""

    base: Reference
    low: Number
    high: Number


class ArraySpec(NamedTuple):
    """ARRAY with its bounds."""

    bounds: tuple[tuple[Number, Number], ...]
    element: Spec


class MemberSpec(NamedTuple):
    """One member of a STRUCT or UNION; `width` is that of a bit-field of C, which is no member."""

    name: str
    spec: Spec
    where: str
    width: int | None = None


class StructSpec(NamedTuple):
    """STRUCT, or UNION; `base` is what it EXTENDS, `pack` its pack_mode attribute in bytes.

    A class of C++ `is_class`: it may lie in the padding at the end of its base.
    """

    members: tuple[MemberSpec, ...]
    base: Reference | None = None
    pack: int | None = None
    is_union: bool = False
    is_class: bool = False


class EnumSpec(NamedTuple):
    """Enumeration; no base is the layout's own (INT for most).

    A value of None is one more than the value before it, the first one 0. Those of a scoped one are known
    in it alone.
    """

    base: Reference | None
    values: tuple[tuple[str, Number | None], ...]
    is_scoped: bool = False


# A type without names to look up is itself its specification.
Spec = Reference | StringType | Pointer | Unplaced | TextSpec | RangeSpec | ArraySpec | StructSpec | EnumSpec


class Declaration(NamedTuple):
    """One declared type; `problems` are mistakes in its own text, `spec` is None when nothing is left.

    `notes` are no mistakes: what is to be shown beside the type (optimised access, another name).
    `is_data`: a data block or variables, which no member can be of.
    """

    name: str
    spec: Spec | None
    where: str
    problems: tuple[Problem, ...] = ()
    notes: tuple[str, ...] = ()
    is_data: bool = False


class Constant(NamedTuple):
    """A constant that a file declares, and where."""

    name: str
    number: Number
    where: str = ""


class SenderLayout(NamedTuple):
    """The layout that most senders of a `source` such as TwinCAT have.

    Without a source the file itself stands for it (a TIA source: s7-standard): its types are laid out so.
    """

    layout: str = ""
    source: str = ""


class Declarations(NamedTuple):
    """All of a file: its types in order, the mistakes that belong to no type, and constants it declares.

    `others` are the blocks in it that declare no type, such as FUNCTION_BLOCK. `copies` are types that other
    files declare: each counts where none of them is given.
    """

    types: tuple[Declaration, ...]
    problems: tuple[Problem, ...] = ()
    constants: tuple[Constant, ...] = ()
    sender: SenderLayout = SenderLayout()
    others: tuple[str, ...] = ()
    copies: tuple[Declaration, ...] = ()


def strip_places(part: Any) -> Any:
    """Return a part of a declaration without its places."""
    if isinstance(part, tuple):
        names = getattr(part, "_fields", ())
        kept = [each for at, each in enumerate(part) if names[at : at + 1] != ("where",)]
        return type(part), *map(strip_places, kept)
    return str(part).casefold().removeprefix("_.")  # `_.T` of SIMATIC SD is T
