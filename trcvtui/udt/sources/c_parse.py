"""C text into the nodes of pycparser, one outer declaration at a time: a bad one never hides the others."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any

from trcvtui.errors import UserError, mistake
from trcvtui.udt.ast import Declaration
from trcvtui.udt.sources.c_number import DEEPEST, fold, is_short
from trcvtui.udt.sources.c_source import KEYWORDS, CSource
from trcvtui.udt.sources.c_types import NAMED_TYPES

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
    raise mistake(where, f"C that cannot be read ({what[:60]})", "C declarations")


def _is_flat(text: str) -> bool:
    depth = 0
    for found in re.finditer(r"[(\[{}\])]", text):
        depth += 1 if found.group() in "([{" else -1
        if depth > DEEPEST:
            return False
    return True


def _statements(text: str) -> Iterator[tuple[int, int]]:
    """Yield where each outer declaration begins and ends; functions are left out."""
    depth, begin, is_function = 0, _begin(text, 0), False
    for found in re.finditer("[{};]", text):
        if found.group() == "{":
            is_function = (
                text[max(0, found.start() - 400) : found.start()].rstrip().endswith(")")
                if depth == 0
                else is_function
            )
            depth += 1
            continue
        depth = max(0, depth - 1) if found.group() == "}" else depth
        if depth == 0 and (found.group() == ";" or is_function):
            if not is_function:
                yield begin, found.end()
            begin, is_function = _begin(text, found.end()), False
    if begin < len(text):
        yield begin, len(text)


def _begin(text: str, place: int) -> int:
    """Return where the next word or sign stands."""
    found = re.compile(r"\S").search(text, place)
    return found.start() if found else len(text)


def _name_of(text: str) -> str | None:
    """Return the name that a declaration gives its type, as far as one can see it."""
    found = re.search(r"([A-Za-z_]\w*)\s*;\s*\Z", text) if re.match(r"\s*typedef\b", text) else None
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
        from pycparser.c_parser import CParser

        if not is_short(text):
            return None
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
