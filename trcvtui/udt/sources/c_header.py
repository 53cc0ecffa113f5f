"""C headers: `typedef struct {...} T;` read by pycparser (the extra `c`), made ready by `c_source.py`.

A type has here the size that every compiler gives it; one that differs between compilers (`long`, `size_t`),
a bit-field and an alignment of its own are refused by name. `int` and enumerations count as 4 bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from trcvtui.errors import Problem, mistake, need, noting
from trcvtui.udt import ast
from trcvtui.udt.sources.c_parse import (
    C_TYPES,
    FOUR_BYTES,
    LONGS,
    NO_ONE_SIZE,
    Macros,
    evaluate,
    fold,
    formula,
    parsed,
)
from trcvtui.udt.sources.c_source import LONG_SIZE, OTHER_HEADERS, CSource
from trcvtui.udt.types import ELEMENTARY, Pointer

PLC_TYPES = "plctypes.h"  # B&R: there INT, UINT and BOOL are those of IEC 61131-3


def read_c_header(text: str, name: str) -> ast.Declarations:
    """Return what a C header declares; raise UserError where pycparser is not there."""
    parser = need("pycparser.c_parser", "c", name, "a C header, but no pycparser").CParser
    source = CSource(text, name, evaluate, OTHER_HEADERS.get())
    reader = _Reader(source)
    for node in parsed(parser, source):
        reader.outer(node)
    return ast.Declarations(
        tuple(reader.types),
        tuple(source.problems),
        tuple(map(ast.Constant, reader.constants, reader.constants.values())),
    )


class _Reader:
    """The walk over the declarations of a header."""

    def __init__(self, source: CSource) -> None:
        self.source = source
        self.types: list[ast.Declaration] = []
        self.tags: dict[str, str] = {}
        self.aliases: dict[str, ast.Reference] = {}
        self.long_size = LONG_SIZE.get()
        macros = Macros(source)
        numbers = ((name, macros.macro(name)) for name in source.numbers if name not in source.given)
        self.constants = {name: value for name, value in numbers if value is not None}
        self.problems: list[Problem] = []
        self.notes: dict[str, None] = {}

    def where(self, node: Any) -> str:
        """Return file, line and column of a node, both from 1."""
        place = getattr(node, "coord", None)
        return self.source.name if place is None else f"{self.source.name}:{place.line}:{place.column or 1}"

    # -- declarations ------------------------------------------------------------------------------------

    def outer(self, node: Any) -> None:
        kind = type(node).__name__
        if isinstance(node, ast.Declaration):
            self.types.append(node)
        elif kind == "Typedef":
            self.typedef(node)
        elif kind == "Decl":
            inner = node.type
            while type(inner).__name__ in ("ArrayDecl", "PtrDecl", "TypeDecl"):
                inner = inner.type
            self.tagged(inner, node.name or "")
            is_constant = node.init is not None and "const" in node.quals
            value = fold(node.init, self.constants.get) if is_constant else None
            if node.name and value is not None:
                self.constants[node.name] = value

    def typedef(self, node: Any) -> None:
        inner = node.type.type if type(node.type).__name__ == "TypeDecl" else None
        tag = getattr(inner, "name", None) if type(inner).__name__ in ("Struct", "Union", "Enum") else None
        if tag and _is_definition(inner):
            self.tags[tag] = node.name
        elif tag == node.name:
            return  # typedef struct T T;
        spec = self.declare(node.name, node, lambda: self.spec(node.type, 0), tag or "")
        if isinstance(spec, ast.Reference) and spec.name.upper() in ELEMENTARY:
            self.aliases[node.name] = spec
        if node.name.upper() in ELEMENTARY and isinstance(spec, ast.Reference):
            self.types.pop()  # `typedef unsigned short UINT;` says what UINT is: nothing new to declare

    def tagged(self, node: Any, variable: str) -> None:
        if type(node).__name__ not in ("Struct", "Union", "Enum") or not _is_definition(node):
            return
        if node.name:
            self.tags.setdefault(node.name, node.name)
            self.declare(node.name, node, lambda: self.inner(node, 0), variable)
        elif type(node).__name__ == "Enum":
            self.enum(node)

    def declare(self, name: str, node: Any, read: Callable[[], ast.Spec], word: str) -> ast.Spec | None:
        self.problems, self.notes = [], {}
        if word.isupper() and "PACK" in word and word != name:
            self.notes[f"{word} is read as a name: a macro needs --with its header"] = None
        spec: ast.Spec | None = None
        with noting(self.problems):
            spec = read()
        where = self.where(node)
        self.types.append(ast.Declaration(name, spec, where, tuple(self.problems), tuple(self.notes)))
        return spec

    # -- types -------------------------------------------------------------------------------------------

    def spec(self, node: Any, depth: int) -> ast.Spec:
        match type(node).__name__:
            case "TypeDecl":
                return self.inner(node.type, depth)
            case "ArrayDecl":
                return self.array(node, depth)
            case "PtrDecl":
                return Pointer("POINTER TO " + _target(node.type))
        raise mistake(self.where(node), "a function", "a type with a size")

    def inner(self, node: Any, depth: int) -> ast.Spec:
        if depth > ast.MOST_NESTED:
            raise mistake(self.where(node), "a type nested deeper", f"at most {ast.MOST_NESTED} levels")
        kind = type(node).__name__
        if kind == "IdentifierType":
            return self.named(node)
        if not _is_definition(node):
            return ast.Reference(self.tags.get(node.name, node.name), self.where(node))
        return self.enum(node) if kind == "Enum" else self.struct(node, depth)

    def named(self, node: Any) -> ast.Reference:
        words = sorted(word for word in node.names if word != "signed" or "char" in node.names)
        if len(words) > 1 and "int" in words and words != ["int", "unsigned"]:
            words.remove("int")
        if words == ["unsigned"]:
            words = ["int", "unsigned"]
        name = " ".join(words) or "int"
        if name in self.aliases:
            return self.aliases[name]._replace(where=self.where(node))
        if name in LONGS and self.long_size is not None:
            self.notes[f"long is taken as {self.long_size} bytes"] = None
            word = "int" if self.long_size == 4 else "long long"
            return ast.Reference(C_TYPES[name.replace("long", word)], self.where(node))
        is_plc = name.isupper() and any(include.endswith(PLC_TYPES) for include in self.source.includes)
        if name in NO_ONE_SIZE and not is_plc:
            raise mistake(self.where(node), f"'{' '.join(node.names)}'", NO_ONE_SIZE[name])
        if name in FOUR_BYTES:
            self.notes["int is taken as 4 bytes"] = None
        return ast.Reference(C_TYPES.get(name, name), self.where(node))

    def struct(self, node: Any, depth: int) -> ast.StructSpec:
        place = self.source.offset(node.coord.line, node.coord.column or 1) if node.coord else 0
        members: list[ast.MemberSpec] = []
        for at, member in enumerate(node.decls or ()):
            if type(member).__name__ == "Decl":
                with noting(self.problems):
                    members.append(self.member(member, at, depth + 1))
        bits = [one.name for one in members if one.width is not None and one.name]
        if bits:
            names = ", ".join(bits[:8]) + ", ..." * (len(bits) > 8)
            told = f"bit-fields are no members: {names}; their room is padding, as gcc has it on x86-64"
            self.notes[told] = None
        is_union = type(node).__name__ == "Union"
        return ast.StructSpec(tuple(members), pack=self.source.pack(place), is_union=is_union)

    def member(self, node: Any, at: int, depth: int) -> ast.MemberSpec:
        name, where, width = node.name or "", self.where(node), None
        if node.bitsize is not None:
            width = fold(node.bitsize, self.constants.get)
            if width is None or width < 0:
                raise mistake(where, f"bit-field '{name}'", "a number of bits")
        elif node.align:
            raise mistake(where, f"_Alignas at '{node.name}'", "a member without it")
        elif not name:
            if type(node.type).__name__ not in ("Struct", "Union") or node.type.name:
                raise mistake(where, "a member without a name", "a name")
            self.notes["a member without a name is called anonymous_N"] = None
            return ast.MemberSpec(f"anonymous_{at}", self.inner(node.type, depth), where)
        return ast.MemberSpec(name, self.spec(node.type, depth), where, width)

    def array(self, node: Any, depth: int) -> ast.Spec:
        bounds: list[tuple[ast.Number, ast.Number]] = []
        where = self.where(node)
        while type(node).__name__ == "ArrayDecl":
            bounds.append((0, self.last_index(node)))
            node = node.type
        if len(bounds) > ast.MOST_DIMENSIONS:
            raise mistake(where, f"{len(bounds)} dimensions", f"at most {ast.MOST_DIMENSIONS}")
        element = self.spec(node, depth + 1)
        if isinstance(element, ast.Reference) and element.name == "CHAR":
            self.notes["char[] is read as ARRAY OF CHAR: a text ends with its NUL"] = None
        return ast.ArraySpec(tuple(bounds), element)

    def last_index(self, node: Any) -> ast.Number:
        where = self.where(node)
        if node.dim is None:
            raise mistake(where, "an array without a length", "[N]")
        length = fold(node.dim, self.constants.get)
        if length is None:
            text = formula(node.dim)
            if text is None:
                expected = "a number, or + - * / of names and numbers"
                raise mistake(where, "a length that is no number", expected)
            return ast.Formula(f"{text} - 1", where)
        if length < 1:
            raise mistake(where, f"[{length}]", "a length of 1 or more")
        return length - 1

    def enum(self, node: Any) -> ast.EnumSpec:
        self.notes["an enum is taken as 4 bytes"] = None
        values: list[tuple[str, ast.Number | None]] = []
        number: int | None = -1
        for row in node.values.enumerators:
            given = fold(row.value, self.constants.get)
            number = given if row.value is not None else None if number is None else number + 1
            if number is not None:
                self.constants[row.name] = number
            values.append((row.name, number if number is not None else ast.Formula("?", self.where(row))))
        return ast.EnumSpec(ast.Reference("DINT", self.where(node)), tuple(values))


def _is_definition(node: Any) -> bool:
    return (node.values if type(node).__name__ == "Enum" else node.decls) is not None


def _target(node: Any) -> str:
    while type(node).__name__ in ("TypeDecl", "PtrDecl", "ArrayDecl"):
        node = node.type
    names = getattr(node, "names", None)
    return " ".join(names) if names else getattr(node, "name", None) or "a function"
