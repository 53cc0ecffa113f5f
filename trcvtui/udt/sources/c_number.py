"""Whole numbers of C: a constant expression of the C parser's tree, worked out or written as a formula.

Rule: bounded in length, depth and size; a name that nobody knows makes the number unknown.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

LONGEST = 1000
DEEPEST = 64
LARGEST = 1 << 64

_SUFFIX = re.compile(r"[uUlL]+\Z")
_BINARY: dict[str, Callable[[int, int], int | None]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: _quotient(a, b),
    "%": lambda a, b: None if b == 0 else a - b * (_quotient(a, b) or 0),
    "<<": lambda a, b: a << b if 0 <= b < 64 else None,
    ">>": lambda a, b: a >> b if 0 <= b < 64 else None,
    "&": lambda a, b: a & b,
    "|": lambda a, b: a | b,
    "^": lambda a, b: a ^ b,
    "==": lambda a, b: int(a == b),
    "!=": lambda a, b: int(a != b),
    "<": lambda a, b: int(a < b),
    ">": lambda a, b: int(a > b),
    "<=": lambda a, b: int(a <= b),
    ">=": lambda a, b: int(a >= b),
    "&&": lambda a, b: int(bool(a and b)),
    "||": lambda a, b: int(bool(a or b)),
}
_UNARY: dict[str, Callable[[int], int]] = {
    "+": lambda a: a,
    "-": lambda a: -a,
    "~": lambda a: ~a,
    "!": lambda a: int(not a),
}


def fold(node: Any, look_up: Callable[[str], int | None], depth: int = 0) -> int | None:
    """Return the value of an expression, None if something in it is no known whole number."""
    if depth > DEEPEST:
        return None
    value: int | None = None
    match type(node).__name__:
        case "Constant":
            value = _constant(node.value)
        case "ID":
            value = look_up(node.name)
        case "Cast":
            value = fold(node.expr, look_up, depth + 1)
        case "UnaryOp" if node.op in _UNARY:
            inner = fold(node.expr, look_up, depth + 1)
            value = None if inner is None else _UNARY[node.op](inner)
        case "BinaryOp" if node.op in _BINARY:
            left = fold(node.left, look_up, depth + 1)
            right = fold(node.right, look_up, depth + 1)
            value = None if left is None or right is None else _BINARY[node.op](left, right)
        case "TernaryOp":
            asked = fold(node.cond, look_up, depth + 1)
            if asked is not None:
                value = fold(node.iftrue if asked else node.iffalse, look_up, depth + 1)
    return value if value is not None and abs(value) <= LARGEST else None


def formula(node: Any, depth: int = 0) -> str | None:
    """Return an expression as IEC 61131-3 writes it; None if it cannot."""
    match type(node).__name__ if depth <= DEEPEST else "":
        case "Constant":
            value = _constant(node.value)
            return None if value is None else str(value)
        case "ID":
            return str(node.name)
        case "Cast":
            return formula(node.expr, depth + 1)
        case "BinaryOp" if node.op in "+-*/":
            left, right = formula(node.left, depth + 1), formula(node.right, depth + 1)
            return None if left is None or right is None else f"({left} {node.op} {right})"
    return None


def is_short(text: str) -> bool:
    """Return whether an expression is one that a C parser may be asked to read: not long, not deep."""
    depth = deepest = 0
    for symbol in text if len(text) <= LONGEST else "":
        depth += (symbol in "([{") - (symbol in ")]}")
        deepest = max(deepest, depth)
    return len(text) <= LONGEST and deepest <= DEEPEST


def _constant(text: str) -> int | None:
    if re.fullmatch(r"'[ -~]'", text):
        return ord(text[1])
    digits = _SUFFIX.sub("", text).replace("'", "")
    try:
        return int(digits, 8) if re.fullmatch(r"0[0-7]+", digits) else int(digits, 0)
    except ValueError:
        return None


def _quotient(left: int, right: int) -> int | None:
    """Return the quotient, cut towards zero as C does."""
    if right == 0:
        return None
    whole = abs(left) // abs(right)
    return whole if (left < 0) == (right < 0) else -whole
