"""What a source file declares, before names are looked up. Each name has its place in the file.

Every source format is read into these values. `type_set.py` turns these values into types.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from trcvtui.errors import Problem
from trcvtui.udt.types import Pointer, RawType, StringType

# Baosky allows 6 or 8 levels; beyond this no tool in the field follows.
MOST_NESTED = 32
MOST_DIMENSIONS = 8
NO_LENGTH = -1  # as a `width`: an ARRAY OF `spec` without a length at the end of a type of C, not a member
CPP_NOTE = " (C++)"
PACK_MODES = (0, 1, 2, 4, 8)  # what a pack_mode may be


class Formula(NamedTuple):
    """A whole number written with names, as `GVL.MAX + 1`. It is evaluated when the constants are known."""

    text: str
    where: str


Number = int | Formula


class TypeName(NamedTuple):
    """The name of a type, qualified or not (`Lib.T`, `_.T`)."""

    name: str
    where: str


class TextSpec(NamedTuple):
    """STRING or WSTRING whose length is a formula. A plain length makes a `StringType` instead."""

    length: Formula
    wide: bool
    utf8: bool = False


class RangeSpec(NamedTuple):
    """A subrange such as `INT(0..10)`."""

    base: TypeName
    low: Number
    high: Number


class ArraySpec(NamedTuple):
    bounds: tuple[tuple[Number, Number], ...]
    element: Spec


class MemberSpec(NamedTuple):
    """A member of a STRUCT or UNION. With a `width` it is a bit-field of C: only its room counts."""

    name: str
    spec: Spec
    where: str
    width: int | None = None


class StructSpec(NamedTuple):
    """STRUCT or UNION. `base` is the type after EXTENDS, `pack` the pack_mode attribute in bytes.

    If `is_class`, it is a class of C++, whose members may begin in the padding at the end of its base.
    """

    members: tuple[MemberSpec, ...]
    base: TypeName | None = None
    pack: int | None = None
    is_union: bool = False
    is_class: bool = False


class EnumSpec(NamedTuple):
    """Enumeration. Without a `base` the layout chooses the base, which is INT for most layouts.

    A number that is None is one more than the number before, or 0 for the first. If `is_scoped`, the names
    are known only inside the enumeration.
    """

    base: TypeName | None
    values: tuple[tuple[str, Number | None], ...]
    is_scoped: bool = False


# A type that names no other type is its own specification.
Spec = TypeName | StringType | Pointer | RawType | TextSpec | RangeSpec | ArraySpec | StructSpec | EnumSpec


class Declaration(NamedTuple):
    """One declared type. `problems` are mistakes in the text. `spec` is None if the text is unreadable.

    `notes` are shown beside the type and are not mistakes, such as a note on optimised access.
    If `is_data`, the declaration is a data block or variables, which cannot be the type of a member.
    """

    name: str
    spec: Spec | None
    where: str
    problems: tuple[Problem, ...] = ()
    notes: tuple[str, ...] = ()
    is_data: bool = False


class Constant(NamedTuple):
    name: str
    number: Number
    where: str = ""


class SenderLayout(NamedTuple):
    """The layout of most senders whose types come from a `source` such as TwinCAT.

    Without a `source` the file itself decides the layout, as in a TIA source, which has s7-standard.
    """

    layout: str = ""
    source: str = ""


class Declarations(NamedTuple):
    """One file: its types in order, the mistakes that belong to no type, its constants.

    `others` are the keywords of blocks that declare no type, such as FUNCTION_BLOCK. `copies` are types of
    other files that this file repeats. A copy is used only if no given file declares that type.
    """

    types: tuple[Declaration, ...]
    problems: tuple[Problem, ...] = ()
    constants: tuple[Constant, ...] = ()
    sender: SenderLayout = SenderLayout()
    others: tuple[str, ...] = ()
    copies: tuple[Declaration, ...] = ()


def strip_places(part: Any) -> Any:
    """Return a part of a declaration in lower case and without places in files, to compare it."""
    if isinstance(part, tuple):
        names = getattr(part, "_fields", ())
        kept = [each for at, each in enumerate(part) if names[at : at + 1] != ("where",)]
        return type(part), *map(strip_places, kept)
    return str(part).casefold().removeprefix("_.")  # `_.T` of SIMATIC SD is T
