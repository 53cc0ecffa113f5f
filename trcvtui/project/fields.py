"""What a form and the prompt ask for each key of an entry: the rows of `keys`, as fields in their order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from trcvtui.blocks.table import block_row
from trcvtui.project.key_rows import Ask
from trcvtui.project.keys import TABLES, free_name, table_row
from trcvtui.project.project import Project


@dataclass(frozen=True, slots=True)
class AddField:
    """One field: its key, what may stand there, what stands there first."""

    key: str
    hint: str
    choices: tuple[str, ...] = ()
    first: str = ""


class LineKeys(NamedTuple):
    """The keys of a kind that stand bare in a line, and those whose text may have blanks."""

    bare: frozenset[str]
    quoted: frozenset[str]


def keys_of_line(kind: str, project: Project) -> LineKeys:
    """Return how the keys of a kind stand in a line."""
    asks = [(row.name, row.ask) for row in table_row(kind, project.dialect).keys if row.ask]
    return LineKeys(
        frozenset(name for name, ask in asks if ask.is_bare),
        frozenset(name for name, ask in asks if ask.is_quoted),
    )


def fields_of(kind: str, project: Project, block: str = "", to_change: bool = False) -> tuple[AddField, ...]:
    """Return the fields of a kind after its name; those of an instance are its block's."""
    row, chosen = table_row(kind, project.dialect), block or first_block(project)
    asked = {
        key.name: _field(key.name, key.ask, project, chosen)
        for key in row.keys
        if key.ask and key.ask.where(project, chosen) and (to_change or not key.ask.is_of_change)
    }
    first = [asked.pop(name) for name in row.asks_first]
    return (*first, *asked.values())


def _field(key: str, ask: Ask, project: Project, block: str) -> AddField:
    hint = ask.hint if isinstance(ask.hint, str) else ask.hint(project, block)
    first = ask.first if isinstance(ask.first, str) else ask.first(project, block)
    return AddField(key, hint, ask.choices(project, block), first)


def first_block(project: Project) -> str:
    """Return the block that the form begins with: on an empty bench one that receives from anybody."""
    blocks = project.dialect.blocks
    receivers = [block for block in blocks if (row := block_row(block)).builds and row.receives]
    return receivers[0] if receivers and not project.instances else blocks[0]


def first_name(kind: str, project: Project) -> str:
    """Return a name that is free."""
    if kind == "certificate":
        return str(max(project.certificates, default=0) + 1)
    start = f"{first_block(project)}_" if kind == "instance" else TABLES[kind].first_name
    return free_name(kind, start, project)
