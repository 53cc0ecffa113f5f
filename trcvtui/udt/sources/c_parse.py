"""C text into the nodes of pycparser, one outer declaration at a time, and the whole numbers in it.

Rules: a bad declaration never hides the others. A number is bounded in length, depth and size; a name that
nobody knows makes it unknown.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from operator import add, and_, eq, ge, gt, inv, le, lt, mul, ne, neg, not_, or_, pos, sub, xor
from typing import Any

from trcvtui.errors import UserError, mistake
from trcvtui.udt.ast import Declaration
from trcvtui.udt.constants import LARGEST, LONGEST, quotient
from trcvtui.udt.sources.c_source import KEYWORDS, CSource

# The words of a C type are sorted, `signed` and a needless `int` left out.
_IEC_TYPES = {
    "BOOL": ("bool", "_Bool"),
    "SINT": ("int8_t", "char signed"),
    "INT": ("int16_t", "short"),
    "DINT": ("int32_t", "int"),
    "LINT": ("int64_t", "long long"),
    "USINT": ("uint8_t", "char unsigned"),
    "UINT": ("uint16_t", "short unsigned"),
    "UDINT": ("uint32_t", "int unsigned"),
    "ULINT": ("uint64_t", "long long unsigned"),
    "CHAR": ("char", "char8_t"),
    "WCHAR": ("char16_t",),
    "REAL": ("float", "float32_t"),
    "LREAL": ("double", "float64_t"),
}
C_TYPES = {word: name for name, words in _IEC_TYPES.items() for word in words}
FOUR_BYTES = ("int", "int unsigned")
LONGS = ("long", "long unsigned")
# No size of their own in C; INT, UINT and BOOL have two bytes or one in IEC 61131-3, and four on Windows.
NO_ONE_SIZE = {
    **dict.fromkeys(LONGS, "int32_t or int64_t, or --long-size 4 or 8: compilers differ about it"),
    **dict.fromkeys(
        ("size_t", "ssize_t", "ptrdiff_t", "intptr_t", "uintptr_t", "time_t"), "a type of one size"
    ),
    **dict.fromkeys(("wchar_t", "double long", "void", "int128"), "a type of one size, such as uint16_t"),
    **dict.fromkeys(("INT", "UINT", "BOOL"), "its typedef in this header: PLCs and Windows differ about it"),
}
LANGUAGE = ("char", "short", "int", "long", "float", "double", "void", "_Bool")
# What is declared in headers that are not read, and no word of the language.
NAMED_TYPES = frozenset(
    name for name in (*C_TYPES, *NO_ONE_SIZE) if name.isidentifier() and name not in LANGUAGE
)


DEEPEST = 64

_SUFFIX = re.compile(r"[uUlL]+\Z")
_BINARY: dict[str, Callable[[int, int], int | None]] = {
    "/": lambda a, b: None if b == 0 else quotient(a, b),
    "%": lambda a, b: None if b == 0 else a - b * quotient(a, b),
    "<<": lambda a, b: a << b if 0 <= b < 64 else None,
    ">>": lambda a, b: a >> b if 0 <= b < 64 else None,
    "&&": lambda a, b: bool(a and b),
    "||": lambda a, b: bool(a or b),
    **dict(zip("+-*&|^", (add, sub, mul, and_, or_, xor), strict=True)),
    **dict(zip(("==", "!=", "<", ">", "<=", ">="), (eq, ne, lt, gt, le, ge), strict=True)),
}
_UNARY: dict[str, Callable[[int], int]] = {"+": pos, "-": neg, "~": inv, "!": not_}


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
    return int(value) if value is not None and abs(value) <= LARGEST else None


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


def _constant(text: str) -> int | None:
    if re.fullmatch(r"'[ -~]'", text):
        return ord(text[1])
    digits = _SUFFIX.sub("", text).replace("'", "")
    try:
        return int(digits, 8) if re.fullmatch(r"0[0-7]+", digits) else int(digits, 0)
    except ValueError:
        return None


# A name that no typedef of this file declares, where only a type can stand: it comes from an #include.
_FOREIGN = re.compile(
    r"(?:(?<=[;{}(,])|\A|\b(?:const|volatile|typedef|extern|static)\b)\s*([A-Za-z_]\w*)"
    r"(?=[\s*](?:[\s*]|const\b|volatile\b)*[A-Za-z_]\w*\s*[;,\[:=()])"
)
# What may declare a type or a constant; functions and variables are passed over.
_DECLARES = re.compile(r"\btypedef\b|\b(?:struct|union|enum)\b[^;{}()]*\{|\bconst\b[^;{}()]*=")
_WORD = re.compile(r"[A-Za-z_]\w*")
_FAILED = re.compile(r"(?:.*?):(\d+):(\d+): (.*)", re.DOTALL)


def parsed(parser: Callable[[], Any], source: CSource) -> Iterator[Any]:
    """Yield the outer declarations of a header as nodes; one that cannot be read as a bad `Declaration`."""
    types = {found.group(1) for found in _FOREIGN.finditer(source.text)} - KEYWORDS
    types |= NAMED_TYPES
    for begin, end in _statements(source.text):
        text = source.text[begin:end]
        if not _DECLARES.search(text):
            continue
        used = sorted(types & set(_WORD.findall(text)))
        try:
            if not _is_flat(text):
                raise mistake(source.where(begin), "brackets nested deeper", f"at most {DEEPEST} levels")
            nodes = _parse(parser, text, used, source, begin)
            source.check(begin, end)
        except UserError as failed:
            name = _name_of(text)
            if name is None:
                source.problems.extend(failed.problems)
                continue
            nodes = [Declaration(name, None, source.where(begin), failed.problems)]
        types |= {node.name for node in nodes if type(node).__name__ in ("Typedef", "Declaration")}
        yield from nodes


def _parse(parser: Callable[[], Any], text: str, types: list[str], source: CSource, begin: int) -> list[Any]:
    """Return the nodes of a part of a header; raise UserError."""
    from pycparser.c_parser import ParseError  # type: ignore[import-untyped]

    line, column = source.place(begin)
    known = f"typedef int {', '.join(types)};" if types else ""
    try:
        tree = parser().parse(f'{known}\n#line {line} "h"\n{" " * (column - 1)}{text}', "h")
        return list(tree.ext)[len(types) :]
    except ParseError as failed:
        found = _FAILED.fullmatch(str(failed))
        where = f"{source.name}:{found[1]}:{found[2]}" if found else source.where(begin)
        what = found[3] if found else str(failed).rpartition(": ")[2]
    except (RecursionError, AssertionError, AttributeError, IndexError, KeyError, TypeError, ValueError):
        where, what = source.where(begin), "unknown to the C parser"
    expected = "C declarations; of a macro that another header defines, --with that header"
    raise mistake(where, f"C that cannot be read ({what[:60]})", expected)


def _is_flat(text: str) -> bool:
    depth = 0
    for found in re.finditer(r"[(\[{}\])]", text):
        depth += 1 if found.group() in "([{" else -1
        if depth > DEEPEST:
            return False
    return True


def _statements(text: str) -> Iterator[tuple[int, int]]:
    depth, begin, is_function = 0, _begin(text, 0), False
    for found in re.finditer("[{};]", text):
        if found.group() == "{":
            if depth == 0:
                is_function = text[max(0, found.start() - 400) : found.start()].rstrip().endswith(")")
            depth += 1
            continue
        if depth == 0 and found.group() == "}":
            begin = _begin(text, found.end())  # of a `namespace {`
            continue
        depth -= found.group() == "}"
        if depth == 0 and (found.group() == ";" or is_function):
            if not is_function:
                yield begin, found.end()
            begin, is_function = _begin(text, found.end()), False
    if begin < len(text):
        yield begin, len(text)


def _begin(text: str, place: int) -> int:
    found = re.compile(r"\S").search(text, place)
    return found.start() if found else len(text)


def _name_of(text: str) -> str | None:
    found = re.search(r"([A-Za-z_]\w*)\s*;\s*\Z", text) if re.search(r"\btypedef\b", text) else None
    found = found or re.search(r"\b(?:struct|union|enum)\s+([A-Za-z_]\w*)", text)
    return found.group(1) if found and found.group(1) not in KEYWORDS else None


def evaluate(text: str, source: CSource) -> int | None:
    """Return the value of an expression with the macros of a header, None if it has none."""
    return Macros(source).value(text)


class Macros:
    """The numbers of macros, each worked out once."""

    def __init__(self, source: CSource) -> None:
        self.source = source
        self.known: dict[str, int | None] = {}
        self.depth = 0

    def value(self, text: str) -> int | None:
        """Return the value of an expression, None if it has none."""
        if re.fullmatch(r"\d{1,18}", text) and not text.startswith("0"):
            return int(text)
        if len(text) > LONGEST or not _is_flat(text):
            return None
        from pycparser.c_parser import CParser

        types = sorted(NAMED_TYPES & set(_WORD.findall(text)))
        try:
            nodes = _parse(CParser, f"enum {{ x = ({text}) }};", types, self.source, 0)
            return fold(nodes[0].type.values.enumerators[0].value, self.macro) if len(nodes) == 1 else None
        except (UserError, AttributeError):  # no expression at all
            return None

    def macro(self, name: str) -> int | None:
        """Return the number of a macro; one that needs itself has none."""
        if name not in self.known:
            self.known[name] = None
            if name in self.source.numbers and self.depth < DEEPEST:
                self.depth += 1
                self.known[name] = self.value(self.source.numbers[name])
                self.depth -= 1
        return self.known[name]
