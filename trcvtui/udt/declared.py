"""What a source file declares, before names are looked up: each name still knows where it stands.

Every source format is read into these values; `type_set.py` turns them into types.
"""

from __future__ import annotations

from typing import NamedTuple

from trcvtui.errors import Problem
from trcvtui.udt.types import Text


class Reference(NamedTuple):
    """The name of a type."""

    name: str
    where: str


class ArraySpec(NamedTuple):
    """ARRAY with its bounds."""

    bounds: tuple[tuple[int, int], ...]
    element: Spec


class MemberSpec(NamedTuple):
    """One member of a STRUCT."""

    name: str
    spec: Spec
    where: str


class StructSpec(NamedTuple):
    """STRUCT."""

    members: tuple[MemberSpec, ...]


class EnumSpec(NamedTuple):
    """Enumeration; no base is INT."""

    base: Reference | None
    values: tuple[tuple[str, int | None], ...]


Spec = Reference | Text | ArraySpec | StructSpec | EnumSpec


class Declaration(NamedTuple):
    """One declared type; `problems` are mistakes in its own text, `spec` is None when nothing is left."""

    name: str
    spec: Spec | None
    where: str
    problems: tuple[Problem, ...] = ()


class Declarations(NamedTuple):
    """All of a file: its types in order, and the mistakes that belong to no type."""

    types: tuple[Declaration, ...]
    problems: tuple[Problem, ...] = ()
