"""One row for each key: how it is read, checked and written, where its value is, what a form asks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

from msgspec import Struct, field

from trcvtui.blocks.rules import VendorRules
from trcvtui.blocks.table import known_blocks
from trcvtui.dialects.dialect import Dialect
from trcvtui.net.results import Endpoint
from trcvtui.net.serial_line import SerialSettings
from trcvtui.project.project import Certificates, Declaration, Project
from trcvtui.project.tables import Kind, Table
from trcvtui.udt.layout.rules import LayoutChoice, LayoutRules
from trcvtui.udt.type_set import NO_TYPES, TypeSet

KeyValue = bool | int | float | str | list[str]
KeyPairs = list[tuple[str, KeyValue]]
Refusal = tuple[str, str]  # what was found, what was expected


class ReadContext(Struct, frozen=True):
    """What is needed to read an entry of a project. `types` is None if a file of UDTs cannot be read."""

    dialect: Dialect
    rules: VendorRules
    layout: LayoutRules
    base: Path = Path()
    types: TypeSet | None = NO_TYPES
    certificates: Certificates = field(default_factory=dict)
    first_task: str = "MAIN"

    @property
    def block_types(self) -> tuple[str, ...]:
        """Return the blocks of the dialect that have pins."""
        return known_blocks(self.dialect.blocks)


def context_of(project: Project) -> ReadContext:
    p = project
    return ReadContext(p.dialect, p.rules, p.layout, p.base, p.types, p.certificates, p.tasks[0].name)


class TableValues(dict[str, Any]):
    """The values of one table by key; None: missing or wrong. `number` is the table's place from 1."""

    def __init__(self, table: Table, around: ReadContext, number: int) -> None:
        super().__init__()
        self.table = table
        self.around = around
        self.number = number
        self.by_row: list[tuple[Key, Any]] = []


Offer = Callable[[Project, str], tuple[str, ...]]  # for a project and, of an instance, its block


def offer_none(project: Project, block: str) -> tuple[str, ...]:
    return ()


def offer_fixed(*texts: str) -> Offer:
    return lambda project, block: texts


class Hint(Struct, frozen=True):
    """What a form and completion offer: hint, known values, and the value that is filled in at first.

    A form asks for the key only if `where(project, block)`. With `is_bare`, a line has the value alone.
    With `is_quoted`, the text may have blanks. With `is_of_change`, only a form for changes asks for it.
    """

    hint: str | Callable[[Project, str], str]
    choices: Offer = offer_none
    first: str | Callable[[Project, str], str] = ""
    where: Callable[[Project, str], bool] = lambda project, block: True
    is_bare: bool = False
    is_quoted: bool = False
    is_of_change: bool = False


class NameRef(NamedTuple):
    """The kinds of names that a key takes (`file.NamesByKind`). `by_at` names are written as `@NAME`.

    `words` are other values of the key. With `or_none`, the key may be "". Messages call the name `what`.
    """

    what: str
    kinds: tuple[str, ...]
    by_at: bool = False
    words: tuple[str, ...] = ()
    or_none: bool = False


def _is_always_allowed(table: Table, around: ReadContext) -> bool:
    return True


class Key(Struct, frozen=True):
    """One key. A key without a `kind` is read together with another key. `help` is one sentence.

    `of` is the path of the value in the declaration, as `local.port`. `writes(decl)` returns the value to
    write, or None to leave the key out. `default` is the value of a missing key. With `is_said`, a default
    value is written, too. `only` returns whether the table may have the key, or why not. `reads` reads the
    key together with other keys. If `is_played`, a replay with another value of the key gives a true answer
    (replay/partners.py). Such a key changes what the PLC does with its input, not the input.
    """

    name: str
    kind: Kind[Any] | None
    help: str
    of: str = ""
    default: Any = None
    ask: Hint | None = None
    refers: NameRef | None = None
    writes: Callable[[Any], Any] | None = None
    is_needed: bool = False
    is_said: bool = False
    only: Callable[[Table, ReadContext], bool | Refusal] = _is_always_allowed
    reads: Callable[[TableValues], None] | None = None
    is_played: bool = False

    def read(self, values: TableValues) -> None:
        """Read the key from the table, if the table may have it."""
        if self.reads is not None:
            self.reads(values)
            return
        table, allowed = values.table, self.only(values.table, values.around)
        if self.kind is None or not allowed:
            return
        if isinstance(allowed, tuple):  # a reason: the key exists, but not with the other keys of this table
            if table.has(self.name):
                table.mark_known(self.name)
                table.report(self.name, *allowed)
            return
        found = table.require(self.name, self.kind) if self.is_needed else table.read(self.name, self.kind)
        value = self.default if found is None and not self.is_needed else found
        values[self.name] = value
        values.by_row.append((self, value))

    def toml_value(self, decl: Declaration) -> KeyValue | None:
        """Return the value as written in TOML, or None to leave the key out."""
        if self.writes is not None:
            value = self.writes(decl)
        else:
            value = _get_by_path(decl, self.of)
        if value is None or self.kind is None or (value == self.default and not self.is_said):
            return None
        found: KeyValue = self.kind.write(value)
        return found


def _get_by_path(decl: Any, of: str) -> Any:
    """Return the attribute at a path such as `local.port`, or None if there is none."""
    for name in of.split(".") if of else ("",):
        decl = getattr(decl, name, None)
    return decl


def _no_keys(decl: Any) -> KeyPairs:
    return []


class TableRow(Struct, frozen=True):
    """One kind of table, `[[kind]]`: its keys, and the declaration that they make.

    `field` is the field of Project that has the entries of this kind. `what` is the word for the kind in
    sentences, and `title` in forms. `first_name` is the beginning of proposed names. `makes` is the class
    of the declaration, or a function that makes it. A name of a kind in `shares` may not be used here
    again. A form first asks for `asks_first`. `head` and `tail` return keys that have no row.
    """

    kind: str
    field: str
    makes: Callable[..., Any]
    help: str
    keys: tuple[Key, ...]
    what: str = ""
    title: str = ""
    first_name: str = ""
    called: str = "name"
    also: Callable[[TableValues], dict[str, Any] | None] = lambda values: {}
    finish: Callable[[TableValues], None] = lambda values: values.table.report_unread_keys()
    shares: tuple[str, ...] = ()
    asks_first: tuple[str, ...] = ()
    head: Callable[[Any], KeyPairs] = _no_keys
    tail: Callable[[Any], KeyPairs] = _no_keys

    def read(self, table: Table, around: ReadContext, number: int = 1) -> Any:
        """Return the declaration of a table, None if a needed key is missing or wrong."""
        values = TableValues(table, around, number)
        for key in self.keys:
            key.read(values)
        self.finish(values)
        also = self.also(values)
        if also is None or any(value is None for key, value in values.by_row if key.is_needed):
            return None
        return self.makes(**_arguments(values) | also)

    def toml_keys(self, decl: Any) -> KeyPairs:
        found = [(k.name, k.toml_value(decl)) for k in self.keys if k.name != self.called]
        keys: KeyPairs = [(name, value) for name, value in found if value is not None]
        return [*self.head(decl), *keys, *self.tail(decl)]


PART_CLASSES: Final[dict[str, Callable[..., Any]]] = {
    "local": Endpoint,
    "choice": LayoutChoice,
    "serial": SerialSettings,
}


def _arguments(values: TableValues) -> dict[str, Any]:
    """Return the arguments of the class. The value of a path such as `local.port` goes into `local`."""
    arguments: dict[str, Any] = {}
    parts: dict[str, dict[str, Any]] = {}
    for key, value in values.by_row:
        head, _, tail = key.of.partition(".")
        if tail:
            parts.setdefault(head, {})[tail] = value
        elif head:
            arguments[head] = value
    return arguments | {head: PART_CLASSES[head](**part) for head, part in parts.items()}
