"""Constants by name: the user's own, the ones that source files declare, and the values of enumerations.

Rule: a whole name goes before the end of one, what the user gives before what a file says; a name that
could mean two numbers means none.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from trcvtui.errors import UserError
from trcvtui.udt.ast import Constant, Number
from trcvtui.udt.formula import evaluate, plain_name

DEEPEST = 12  # constants that are made of constants below them in the file
MOST_LIKE = 64  # of one last name; with more of them none is meant
MOST_TOLD = 4  # values or names in one message


class _Entry(NamedTuple):
    """A number plus an offset; names in it are looked up in `scope` first."""

    name: str
    parts: tuple[str, ...]
    layer: int
    number: Number
    offset: int
    scope: str
    where: str = ""

    def __str__(self) -> str:
        """Return the name as a message has it, with its place where it is known."""
        return f"{self.name} ({self.where})" if self.where else self.name


class _Found(NamedTuple):
    value: int | None
    unknown: tuple[str, ...]


class Constants:
    """All constants of a set of types; a name is known whole or by its end: `Lib.GVL.MAX`, `GVL.MAX`."""

    def __init__(self, given: Mapping[str, int] | None = None, declared: Iterable[Constant] = ()) -> None:
        self.whole: dict[str, list[_Entry]] = {}
        self.by_end: dict[str, list[_Entry]] = {}
        self.found: dict[tuple[str, str], _Found] = {}
        self.path: list[_Entry] = []  # what is being worked out, the outermost first
        self.reasons: dict[str, str] = {}
        self.is_first = True
        for name, number in (given or {}).items():
            self._add(name, 0, number)
        for constant in declared:
            self._add(constant.name, 1, constant.number, where=constant.where)

    def add_values(self, enumeration: str, values: Iterable[tuple[str, Number | None]]) -> None:
        """Let the values of an enumeration be constants: `E.VALUE`, `E#VALUE`."""
        number: Number = -1
        offset = 0
        for name, own in values:
            number, offset = (number, offset + 1) if own is None else (own, 0)
            self._add(f"{enumeration}.{name}", 2, number, offset, enumeration)

    def value(self, number: Number, unknown: list[str], scope: str = "") -> int | None:
        """Return the value of a number, None with the unknown names in the list; may raise UserError."""

        if self.is_first:  # in the order of the files each is made of known ones, however long the chain
            self.is_first = False
            for entries in list(self.whole.values()):
                if entries[0].layer == 1:
                    self._look_up(entries[0].name, "")

        def look_up(name: str) -> int | None:
            found = self._look_up(name, scope)
            unknown.extend(found.unknown)
            return found.value

        return evaluate(number, look_up)

    def reason(self, name: str) -> str:
        """Return why a name that files declare has no value, such as `which is 1 and 2 (b.st:3:1)`.

        "" where nobody declares it.
        """
        return self.reasons.get(name.casefold(), "")

    def _add(
        self, name: str, layer: int, number: Number, offset: int = 0, scope: str = "", where: str = ""
    ) -> None:
        name = plain_name(name)
        key = name.casefold()
        entry = _Entry(name, tuple(key.split(".")), layer, number, offset, scope, where)
        self.whole.setdefault(key, []).append(entry)
        self.by_end.setdefault(entry.parts[-1], []).append(entry)

    def _look_up(self, name: str, scope: str) -> _Found:
        key = name.casefold()
        if (key, scope) not in self.found:
            self.found[key, scope] = _Found(None, (name,))  # a constant made of itself is unknown
            if len(self.path) < DEEPEST:
                self.found[key, scope] = self._work_out(name, self._meant(key, scope))
            else:
                self.reasons.setdefault(key, f"which comes after {DEEPEST} others in a chain of constants")
        else:
            self._note_circle(key)
        return self.found[key, scope]

    def _note_circle(self, key: str) -> None:
        names = [entry.name.casefold() for entry in self.path]
        if key in names:
            circle = self.path[names.index(key) :]
            told = ", ".join(map(str, [*circle[:MOST_TOLD], circle[0].name]))
            self.reasons.setdefault(key, f"which is made of itself: {told}")

    def _meant(self, key: str, scope: str) -> list[_Entry]:
        own = self.whole.get(f"{scope}.{key}".casefold()) if scope else None
        exact = own or self.whole.get(key)
        if exact:
            return _of_first_layer(exact)
        parts = tuple(key.split("."))
        like = self.by_end.get(parts[-1], [])
        if len(like) > MOST_LIKE:
            return []
        return _of_first_layer([entry for entry in like if _is_end(entry.parts, parts)])

    def _work_out(self, name: str, entries: list[_Entry]) -> _Found:
        values: dict[int, _Entry] = {}
        for entry in entries:
            unknown: list[str] = []
            self.path.append(entry)
            try:
                value = self.value(entry.number, unknown, entry.scope)
            except UserError:
                value = None
                self.reasons.setdefault(name.casefold(), f"which does not work out: {entry}")
            self.path.pop()
            if value is None:
                return _Found(None, tuple(dict.fromkeys(unknown))[:MOST_LIKE] or (name,))
            values.setdefault(value + entry.offset, entry)
        if len(values) == 1:
            return _Found(values.popitem()[0], ())
        if values:
            self.reasons.setdefault(name.casefold(), f"which is {_both(name, values)}")
        return _Found(None, (name,))


def _both(name: str, values: Mapping[int, _Entry]) -> str:
    """Return the values of one name with who says so."""
    told = []
    for value, entry in list(values.items())[:MOST_TOLD]:
        own = "" if entry.name.casefold() == name.casefold() else entry.name
        at = ", ".join(part for part in (own, entry.where) if part)
        told.append(f"{value} ({at})" if at else str(value))
    return " and ".join(told)


def _of_first_layer(entries: list[_Entry]) -> list[_Entry]:
    first = min((entry.layer for entry in entries), default=0)
    return [entry for entry in entries if entry.layer == first]


def _is_end(one: tuple[str, ...], other: tuple[str, ...]) -> bool:
    shared = min(len(one), len(other))
    return one[-shared:] == other[-shared:]
