"""Whole numbers written with names, such as `GVL.MAX + 1` or `2 * (Limits#UPPER - 16#0F)`, worked out.

Rule: a formula is data of a file: bounded in length, depth and size, and never evaluated as Python.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from trcvtui.errors import UserError, mistake
from trcvtui.udt.ast import Formula, Number
from trcvtui.udt.literals import parse_integer
from trcvtui.udt.types import ELEMENTARY
from trcvtui.udt.words import NAME

LookUp = Callable[[str], int | None]

LONGEST = 1000
DEEPEST = 8  # with constants.DEEPEST: what stays well below the depth of calls that Python allows
LARGEST = 1 << 64

_NAME = rf'(?:{NAME}|"[^"]*"|`[^`]*`)'
_TOKEN = (
    rf"\s*(?:({_NAME}(?:\.{_NAME})*(?:\#(?:\d\w*(?:\#\w+)?|{_NAME}(?:\.{_NAME})*))?)|(\d\w*(?:\#\w+)?)|(.))"
)


def read_number(text: str, where: str) -> Number:
    """Return the number that a text says, as a formula if there are names in it; raise UserError."""
    plain = parse_integer(text)
    if plain is not None:
        return plain
    formula = Formula(text.strip(), where)
    value = evaluate(formula, lambda name: None)
    return formula if value is None else value


def evaluate(number: Number, look_up: LookUp) -> int | None:
    """Return the value of a formula, None if `look_up` knows one of its names not; raise UserError."""
    if isinstance(number, int):
        return number
    return _Evaluation(number, look_up).result()


def plain_name(name: str) -> str:
    """Return the name of a constant as it is looked up: `"MAX"` is MAX, `Limits#UPPER` is Limits.UPPER."""
    return re.sub('["`]', "", name).replace("#", ".")


class _Evaluation:
    """One pass over a formula: recursive descent, the usual precedence; an unknown name makes it unknown."""

    def __init__(self, formula: Formula, look_up: LookUp) -> None:
        self.formula, self.look_up = formula, look_up
        if len(formula.text) > LONGEST:
            raise self.refusal(f"at most {LONGEST} characters")
        self.tokens = [found.group().strip() for found in re.finditer(_TOKEN, formula.text)] + [""]
        self.at = 0

    def refusal(self, expected: str) -> UserError:
        return mistake(self.formula.where, f"'{self.formula.text[:60]}'", expected)

    def result(self) -> int | None:
        value = self.sum(0)
        if self.tokens[self.at]:
            raise self.refusal("a whole number or a constant")
        return value

    def accept(self, *symbols: str) -> str:
        """Return the symbol at hand and go behind it, nothing if it is none of these."""
        symbol = self.tokens[self.at]
        if not symbol or symbol not in symbols:
            return ""
        self.at += 1
        return symbol

    def sum(self, depth: int) -> int | None:
        value = self.product(depth)
        while sign := self.accept("+", "-"):
            value = self.joined(sign, value, self.product(depth))
        return value

    def product(self, depth: int) -> int | None:
        value = self.factor(depth)
        while sign := self.accept("*", "/"):
            value = self.joined(sign, value, self.factor(depth))
        return value

    def factor(self, depth: int) -> int | None:
        if depth > DEEPEST:
            raise self.refusal(f"at most {DEEPEST} levels")
        if sign := self.accept("+", "-"):
            return self.joined(sign, 0, self.factor(depth + 1))
        if self.accept("("):
            value = self.sum(depth + 1)
            if not self.accept(")"):
                raise self.refusal("')'")
            return value
        return self.operand()

    def operand(self) -> int | None:
        token = self.tokens[self.at]
        plain = parse_integer(token)
        prefix = token.partition("#")[0].upper()
        if plain is None and (not re.match(_NAME, token) or ("#" in token and prefix in ELEMENTARY)):
            raise self.refusal("a whole number or a constant")
        self.at += 1
        return self.look_up(plain_name(token)) if plain is None else plain

    def joined(self, sign: str, left: int | None, right: int | None) -> int | None:
        if left is None or right is None:
            return None
        if sign == "/":
            if right == 0:
                raise self.refusal("no division by zero")
            whole = abs(left) // abs(right)  # IEC 61131-3 cuts towards zero
            return whole if (left < 0) == (right < 0) else -whole
        value = left * right if sign == "*" else left + right if sign == "+" else left - right
        if abs(value) > LARGEST:
            raise self.refusal("a number of at most 64 bits")
        return value
