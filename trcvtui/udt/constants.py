"""Formulas with names in them, and the constants of the user, of files and of enumerations.

Rules: a formula comes from a file, so it is bounded and never evaluated as Python. A constant is found by
its whole name, else by its end. The user's constants come before a file's. A name with two numbers has no
value.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from trcvtui.errors import UserError, mistake
from trcvtui.udt.ast import Constant, Formula, Number
from trcvtui.udt.literals import NAME_PATTERN, parse_integer
from trcvtui.udt.types import ELEMENTARY

LookUp = Callable[[str], int | None]

LONGEST_FORMULA = 1000
DEEPEST_FORMULA = 8  # levels; with LONGEST_CHAIN it keeps far below the recursion limit of Python
LARGEST_NUMBER = 1 << 64

_NAME = rf'(?:{NAME_PATTERN}|"[^"]*"|`[^`]*`)'
_TOKEN_PATTERN = (
    rf"\s*(?:(\.?{_NAME}(?:\.{_NAME})*(?:\#(?:\d\w*(?:\#\w+)?|{_NAME}(?:\.{_NAME})*))?)"
    r"|(\d\w*(?:\#\w+)?)|(.))"
)


def evaluate(number: Number, look_up: LookUp) -> int | None:
    """Return the value of a formula, or None if `look_up` lacks one of its names. Raise UserError."""
    if isinstance(number, int):
        return number
    return _Evaluation(number, look_up).result()


def plain_name(name: str) -> str:
    """Return the name to look up: MAX for `"MAX"` and `.MAX`, Limits.UPPER for `Limits#UPPER`."""
    return re.sub('["`]', "", name).replace("#", ".").removeprefix(".")


class _Evaluation:
    """One pass over a formula by recursive descent; an unknown name makes the whole value None."""

    def __init__(self, formula: Formula, look_up: LookUp) -> None:
        self.formula, self.look_up = formula, look_up
        if len(formula.text) > LONGEST_FORMULA:
            raise self.refusal(f"at most {LONGEST_FORMULA} characters")
        self.tokens = [found.group().strip() for found in re.finditer(_TOKEN_PATTERN, formula.text)] + [""]
        self.at = 0

    def refusal(self, expected: str) -> UserError:
        return mistake(self.formula.where, f"'{self.formula.text[:60]}'", expected)

    def result(self) -> int | None:
        value = self.parse_sum(0)
        if self.tokens[self.at]:
            raise self.refusal("a whole number or a constant")
        return value

    def accept(self, *symbols: str) -> str:
        """Take the next token if it is one of these symbols and return it, else return ""."""
        symbol = self.tokens[self.at]
        if not symbol or symbol not in symbols:
            return ""
        self.at += 1
        return symbol

    def parse_sum(self, depth: int) -> int | None:
        return self.parse_chain("+-", lambda: self.parse_chain("*/", lambda: self.parse_factor(depth)))

    def parse_chain(self, signs: str, operand: Callable[[], int | None]) -> int | None:
        value = operand()
        while sign := self.accept(*signs):
            value = self.combine(sign, value, operand())
        return value

    def parse_factor(self, depth: int) -> int | None:
        if depth > DEEPEST_FORMULA:  # bounds the recursion
            raise self.refusal(f"at most {DEEPEST_FORMULA} nested levels")
        if sign := self.accept("+", "-"):
            return self.combine(sign, 0, self.parse_factor(depth + 1))
        if self.accept("("):
            value = self.parse_sum(depth + 1)
            if not self.accept(")"):
                raise self.refusal("')'")
            return value
        return self.parse_operand()

    def parse_operand(self) -> int | None:
        token = self.tokens[self.at]
        plain = parse_integer(token)
        prefix = token.partition("#")[0].upper()
        if plain is None and (not re.match(rf"\.?{_NAME}", token) or ("#" in token and prefix in ELEMENTARY)):
            raise self.refusal("a whole number or a constant")
        self.at += 1
        return self.look_up(plain_name(token)) if plain is None else plain

    def combine(self, sign: str, left: int | None, right: int | None) -> int | None:
        if left is None or right is None:
            return None
        if sign == "/":
            if right == 0:
                raise self.refusal("a divisor other than 0")
            return divide(left, right)
        value = left * right if sign == "*" else left + right if sign == "+" else left - right
        if abs(value) > LARGEST_NUMBER:
            raise self.refusal("a number of at most 64 bits")
        return value


def divide(left: int, right: int) -> int:
    """Return the quotient, rounded towards zero as in IEC 61131-3 and C."""
    whole = abs(left) // abs(right)
    return whole if (left < 0) == (right < 0) else -whole


LONGEST_CHAIN = 12  # constants, each defined by one that is declared later
MOST_ALIKE = 64  # constants with the same last name; with more of them the name has no value
MOST_NAMES_SHOWN = 4  # values or names in one message


class _ConstantEntry(NamedTuple):
    """A number plus an offset. Names in the number are looked up in `scope` first."""

    name: str
    parts: tuple[str, ...]
    layer: int
    number: Number
    offset: int
    scope: str
    where: str = ""

    def __str__(self) -> str:
        return f"{self.name} ({self.where})" if self.where else self.name


class _LookUpResult(NamedTuple):
    value: int | None
    unknown: tuple[str, ...]


class Constants:
    """All constants of a set of types. A constant is found as `Lib.GVL.MAX`, or by the end `GVL.MAX`."""

    def __init__(self, given: Mapping[str, int] | None = None, declared: Iterable[Constant] = ()) -> None:
        self.whole: dict[str, list[_ConstantEntry]] = {}
        self.by_end: dict[str, list[_ConstantEntry]] = {}
        self.found: dict[tuple[str, str], _LookUpResult] = {}
        self.path: list[_ConstantEntry] = []  # the entries under evaluation, the outermost first
        self.reasons: dict[str, str] = {}
        self.is_first = True
        for name, number in (given or {}).items():
            self._add(name, 0, number)
        for constant in declared:
            self._add(constant.name, 1, constant.number, where=constant.where)

    def add_values(self, enumeration: str, values: Iterable[tuple[str, Number | None]]) -> None:
        """Add the values of an enumeration as constants: `E.VALUE`, `E#VALUE`."""
        number: Number = -1
        offset = 0
        for name, own in values:
            number, offset = (number, offset + 1) if own is None else (own, 0)
            self._add(f"{enumeration}.{name}", 2, number, offset, enumeration)

    def evaluate_number(self, number: Number, unknown: list[str], scope: str = "") -> int | None:
        """Return the number's value. Without a value, `unknown` gets the unknown names. Raise UserError."""

        if self.is_first:  # once in the order of the files: a long chain then refers to known values only
            self.is_first = False
            for entries in list(self.whole.values()):
                if entries[0].layer == 1:
                    self._look_up(entries[0].name, "")

        def look_up(name: str) -> int | None:
            found = self._look_up(name, scope)
            unknown.extend(found.unknown)
            return found.value

        return evaluate(number, look_up)

    def missing_reason(self, name: str) -> str:
        """Return why a declared name has no value, such as `which is 1 and 2 (b.st:3:1)`, else ""."""
        return self.reasons.get(name.casefold(), "")

    def _add(
        self, name: str, layer: int, number: Number, offset: int = 0, scope: str = "", where: str = ""
    ) -> None:
        name = plain_name(name)
        key = name.casefold()
        entry = _ConstantEntry(name, tuple(key.split(".")), layer, number, offset, scope, where)
        self.whole.setdefault(key, []).append(entry)
        self.by_end.setdefault(entry.parts[-1], []).append(entry)

    def _look_up(self, name: str, scope: str) -> _LookUpResult:
        key = name.casefold()
        if (key, scope) not in self.found:
            self.found[key, scope] = _LookUpResult(None, (name,))  # for one that is defined by itself
            if len(self.path) < LONGEST_CHAIN:
                self.found[key, scope] = self._evaluate_entries(name, self._find_entries(key, scope))
            else:
                self.reasons.setdefault(
                    key, f"which comes after {LONGEST_CHAIN} others in a chain of constants"
                )
        else:
            self._note_circle(key)
        return self.found[key, scope]

    def _note_circle(self, key: str) -> None:
        names = [entry.name.casefold() for entry in self.path]
        if key in names:
            circle = self.path[names.index(key) :]
            names_text = ", ".join(map(str, [*circle[:MOST_NAMES_SHOWN], circle[0].name]))
            self.reasons.setdefault(key, f"which is defined by itself: {names_text}")

    def _find_entries(self, key: str, scope: str) -> list[_ConstantEntry]:
        own = self.whole.get(f"{scope}.{key}".casefold()) if scope else None
        exact = own or self.whole.get(key)  # the names of the enumeration itself come first
        if exact:
            return _keep_first_layer(exact)
        parts = tuple(key.split("."))
        alike = self.by_end.get(parts[-1], [])
        if len(alike) > MOST_ALIKE:  # bounds the work for a hostile file
            return []
        pairs = [(min(len(entry.parts), len(parts)), entry) for entry in alike]
        return _keep_first_layer([entry for size, entry in pairs if entry.parts[-size:] == parts[-size:]])

    def _evaluate_entries(self, name: str, entries: list[_ConstantEntry]) -> _LookUpResult:
        values: dict[int, _ConstantEntry] = {}
        for entry in entries:
            unknown: list[str] = []
            self.path.append(entry)
            try:
                value = self.evaluate_number(entry.number, unknown, entry.scope)
            except UserError:
                value = None
                self.reasons.setdefault(name.casefold(), f"which cannot be calculated: {entry}")
            self.path.pop()
            if value is None:
                return _LookUpResult(None, tuple(dict.fromkeys(unknown))[:MOST_ALIKE] or (name,))
            values.setdefault(value + entry.offset, entry)
        if len(values) == 1:
            return _LookUpResult(values.popitem()[0], ())
        if values:
            self.reasons.setdefault(name.casefold(), f"which is {_describe_values(name, values)}")
        return _LookUpResult(None, (name,))


def _describe_values(name: str, values: Mapping[int, _ConstantEntry]) -> str:
    texts = []
    for value, entry in list(values.items())[:MOST_NAMES_SHOWN]:
        own = "" if entry.name.casefold() == name.casefold() else entry.name
        at = ", ".join(part for part in (own, entry.where) if part)
        texts.append(f"{value} ({at})" if at else str(value))
    return " and ".join(texts)


def _keep_first_layer(entries: list[_ConstantEntry]) -> list[_ConstantEntry]:
    first = min((entry.layer for entry in entries), default=0)  # the user's, then files', then enumerations'
    return [entry for entry in entries if entry.layer == first]
