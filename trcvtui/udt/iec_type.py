"""A type written in one line, as in project files: `INT`, `STRING[20]`, `ARRAY[0..99] OF Telegram`."""

from __future__ import annotations

from trcvtui.udt.sources.st import read_spec
from trcvtui.udt.type_set import NO_TYPES, TypeSet, build
from trcvtui.udt.types import Type


def parse_type(text: str, types: TypeSet = NO_TYPES, where: str = "type") -> Type:
    """Return the type that the text names, with the UDTs of `types`; raise UserError if there is none."""
    return build(read_spec(text, where), types)
