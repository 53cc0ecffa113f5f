"""C headers: `typedef struct {...} T;` prepared by `c_source.py` and parsed by pycparser (the extra `c`).

A type has the size that every compiler gives it. A type whose size differs between compilers (`long`,
`size_t`) and `_Alignas` are refused by name. A bit-field takes room but is not read. `int` and an enum
have 4 bytes.
Rules: a bad declaration never hides the others. A number is bounded in length, depth and size; a type that
uses an unknown name is unknown itself.
"""

from __future__ import annotations

import re
from collections import ChainMap
from collections.abc import Callable, Iterator, Mapping
from operator import add, and_, eq, ge, gt, inv, le, lt, mul, ne, neg, not_, or_, pos, sub, xor
from types import SimpleNamespace
from typing import Any

from trcvtui.errors import Problem, UserError, collect_problems, mistake, require
from trcvtui.udt import ast
from trcvtui.udt.ast import CPP_NOTE
from trcvtui.udt.constants import LARGEST_NUMBER, LONGEST_FORMULA, divide
from trcvtui.udt.sources.c_source import KEYWORDS, LONG_SIZE, OTHER_HEADERS, CSource
from trcvtui.udt.sources.cpp_source import CPP_MARKS, blank_quoted, match_end
from trcvtui.udt.types import ELEMENTARY, Pointer

PLC_TYPES = "plctypes.h"  # B&R: it defines INT, UINT and BOOL as in IEC 61131-3


def read_c_header(text: str, name: str) -> ast.Declarations:
    """Return what a C header declares; raise UserError if pycparser is not installed."""
    require("pycparser.c_parser", "c", name, "a C header, but no pycparser")
    source = CSource(text, name, lambda one, own: Macros(own).evaluate_text(one), OTHER_HEADERS.get())
    reader = _HeaderReader(source)
    for node in parse_header(source):
        reader.read_declaration(node)
    return ast.Declarations(
        tuple(reader.types),
        tuple(source.problems),
        tuple(ast.Constant(name, value) for name, value in reader.constants.items() if value is not None),
    )


_Inside = tuple[Mapping[str, int | None], Mapping[str, ast.Spec]]  # constants and types that a class declares


class _HeaderReader:
    def __init__(self, source: CSource) -> None:
        self.source = source
        self.types: list[ast.Declaration] = []
        self.tags: dict[str, str] = {}
        self.aliases: dict[str, ast.TypeName] = {}
        self.long_size = LONG_SIZE.get()
        macros = Macros(source)
        numbers = ((name, macros.number_of(name)) for name in source.numbers if name not in source.given)
        known: dict[str, int | None] = {name: value for name, value in numbers if value is not None}
        self.constants = ChainMap(known)  # those of a class first; None: only the name is known
        self.scope: ChainMap[str, ast.Spec] = ChainMap()  # the types declared in a class
        self.loose: set[str] = set()  # classes that are not packed
        self.classes: dict[str, _Inside] = {}
        self.inside: _Inside = {}, {}  # of the class that was read last
        self.problems: list[Problem] = []
        self.notes: dict[str, None] = {}

    def where(self, node: Any) -> str:
        """Return file, line and column of a node, both from 1."""
        place = getattr(node, "coord", None)
        return self.source.name if place is None else f"{self.source.name}:{place.line}:{place.column or 1}"

    # -- declarations ------------------------------------------------------------------------------------

    def read_declaration(self, node: Any) -> None:
        kind = type(node).__name__
        if isinstance(node, ast.Declaration):
            self.types.append(node)
            self.classes[node.name] = {}, {}
        elif kind == "Typedef":
            self.read_typedef(node)
        elif kind == "Decl":
            inner = node.type
            while type(inner).__name__ in ("ArrayDecl", "PtrDecl", "TypeDecl"):
                inner = inner.type
            self.read_tagged(inner, node.name or "")
            is_constant = node.init is not None and "const" in node.quals
            value = evaluate(node.init, self.constants.get) if is_constant else None
            if node.name and value is not None:
                self.constants[node.name] = value

    def read_typedef(self, node: Any) -> None:
        inner = node.type.type if type(node.type).__name__ == "TypeDecl" else None
        tag = getattr(inner, "name", None) if type(inner).__name__ in ("Struct", "Union", "Enum") else None
        if tag and _is_definition(inner):
            self.tags[tag] = node.name
        elif tag == node.name:
            return  # typedef struct T T;
        spec = self.declare(node.name, node, lambda: self.spec(node.type, 0), tag or "")
        if isinstance(spec, ast.TypeName) and spec.name.upper() in ELEMENTARY:
            self.aliases[node.name] = spec
        if node.name.upper() in ELEMENTARY and isinstance(spec, ast.TypeName):
            self.types.pop()  # `typedef unsigned short UINT;` only defines an elementary type

    def read_tagged(self, node: Any, variable: str) -> None:
        if type(node).__name__ not in ("Struct", "Union", "Enum") or not _is_definition(node):
            return
        if node.name:
            self.tags.setdefault(node.name, node.name)
            self.declare(node.name, node, lambda: self.read_core_type(node, 0), variable)
        elif type(node).__name__ == "Enum":
            self.enum(node)

    def declare(self, name: str, node: Any, read: Callable[[], ast.Spec], word: str) -> ast.Spec | None:
        self.problems, self.notes = [], {}
        if word.isupper() and "PACK" in word and word != name:
            self.notes[f"{word} is read as a name; if it is a macro, add --with HEADER"] = None
        spec: ast.Spec | None = None
        with collect_problems(self.problems):
            spec = read()
        where = self.where(node)
        if spec and self.is_unpacked(spec):
            self.loose.add(name)
        if not spec or isinstance(spec, ast.StructSpec):
            self.classes[name] = self.inside
        self.types.append(ast.Declaration(name, spec, where, tuple(self.problems), tuple(self.notes)))
        return spec

    # -- types -------------------------------------------------------------------------------------------

    def spec(self, node: Any, depth: int) -> ast.Spec:
        match type(node).__name__:
            case "TypeDecl":
                return self.read_core_type(node.type, depth)
            case "ArrayDecl":
                return self.array(node, depth)
            case "PtrDecl":
                return Pointer("POINTER TO " + _pointer_target(node.type))
        raise mistake(self.where(node), "a function", "a type with a size")

    def read_core_type(self, node: Any, depth: int) -> ast.Spec:
        if depth > ast.MOST_NESTED:
            raise mistake(self.where(node), "a type nested deeper", f"at most {ast.MOST_NESTED} levels")
        kind = type(node).__name__
        if kind == "IdentifierType":
            return self.read_named_type(node)
        if not _is_definition(node):
            name = self.tags.get(node.name, node.name)
            return self.scope.get(node.name, ast.TypeName(name, self.where(node)))
        spec = self.enum(node) if kind == "Enum" else self.struct(node, depth)
        if node.name and depth and self.source.cpp.is_cpp:
            self.scope[node.name] = spec
        return spec

    def read_named_type(self, node: Any) -> ast.Spec:
        words = sorted(word for word in node.names if word != "signed" or "char" in node.names)
        if len(words) > 1 and "int" in words and words != ["int", "unsigned"]:
            words.remove("int")
        if words == ["unsigned"]:
            words = ["int", "unsigned"]
        name = " ".join(words) or "int"
        if name in self.scope:
            return self.scope[name]
        if name in self.aliases:
            return self.aliases[name]._replace(where=self.where(node))
        if name in LONG_TYPES and self.long_size is not None:
            self.notes[f"long is taken as {self.long_size} bytes"] = None
            word = "int" if self.long_size == 4 else "long long"
            return ast.TypeName(C_TYPES[name.replace("long", word)], self.where(node))
        is_plc = name.isupper() and any(include.endswith(PLC_TYPES) for include in self.source.includes)
        if name in AMBIGUOUS_TYPES and not is_plc:
            raise mistake(self.where(node), f"'{' '.join(node.names)}'", AMBIGUOUS_TYPES[name])
        if name in FOUR_BYTE_TYPES:
            self.notes["int is taken as 4 bytes"] = None
        return ast.TypeName(C_TYPES.get(name, name), self.where(node))

    def struct(self, node: Any, depth: int) -> ast.StructSpec:
        members, count = list[ast.MemberSpec](), len(self.problems)
        is_union, cpp = type(node).__name__ == "Union", self.source.cpp
        outer, brace = (self.constants, self.scope), self.brace_place(node)
        base = self.base_class(node, brace)
        if cpp.is_cpp:  # names declared in a class are known in it and in classes derived from it
            constants, types = self.classes[base.name] if base else ({}, {})
            self.constants = self.constants.new_child({**constants})
            self.scope = self.scope.new_child({**types})
        for at, member in enumerate(node.decls or ()):
            if type(member).__name__ == "Decl":
                is_last = is_union or member is node.decls[-1]
                with collect_problems(self.problems):
                    members += self.member(member, at, depth + 1, is_last)
        self.inside = self.constants.maps[0], self.scope.maps[0]
        self.constants, self.scope = outer
        pack, by_pragma = self.source.packing_of(brace), self.source.pragma_packing(brace)
        tails = [one for one in members if one.width == ast.NO_LENGTH]
        has_bits = any(one.width is not None for one in members)
        has_members = base or any(one.name and one not in tails for one in members)
        is_packed = cpp.has_classes and brace in self.source.braces
        parts = [*(each.spec for each in members), *([base] if base else ())]
        wrong = {
            "without members" + CPP_NOTE * cpp.is_cpp: (tails or cpp.is_cpp) and not has_members,
            "with bit-fields packed differently by an attribute and a #pragma": has_bits
            and pack == 1 != (by_pragma or 1),
            f"packed by an attribute, but with an unpacked class in it{CPP_NOTE}": is_packed
            and any(map(self.is_unpacked, parts)),
        }
        for why in [why for why, holds in wrong.items() if holds and count == len(self.problems)][:1]:
            expected = "plain members; to pack them, use one #pragma pack"
            raise mistake(self.where(node), f"a class {why}", expected)
        for one in tails:
            self.notes[f"{one.name}[] is not a member: its elements come after the bytes of the type"] = None
        bits = [one.name for one in members if one.width is not None and one.name and one not in tails]
        if bits:
            names = ", ".join(bits[:8]) + ", ..." * (len(bits) > 8)
            note = f"bit-fields ({names}) are shown as padding, placed as by gcc on x86-64"
            self.notes[note] = None
        return ast.StructSpec(tuple(members), base, pack, is_union, base is not None)

    def base_class(self, node: Any, brace: int) -> ast.TypeName | None:
        """Return the base class, which this header must declare."""
        parent = self.source.cpp.parents.get(brace)
        if parent is None:
            return None
        name = self.tags.get(parent, parent)
        if parent in self.scope or name not in self.classes:
            raise mistake(self.where(node), f"base class '{parent}'{CPP_NOTE}", "a class of this header")
        return ast.TypeName(name, self.where(node))

    def brace_place(self, node: Any) -> int:
        """Return the place of the brace that a definition opens."""
        return self.source.text.find("{", self.place(node))

    def place(self, node: Any) -> int:
        return self.source.offset(node.coord.line, node.coord.column or 1)

    def is_unpacked(self, spec: ast.Spec) -> bool:
        """Return whether a type is an unpacked class, which g++ may leave aligned in a packed class."""
        while isinstance(spec, ast.ArraySpec):
            spec = spec.element
        return spec.pack != 1 if isinstance(spec, ast.StructSpec) else getattr(spec, "name", "") in self.loose

    def member(self, node: Any, at: int, depth: int, is_last: bool) -> Iterator[ast.MemberSpec]:
        """Yield a member; nothing for a type that a class declares."""
        name, where, width = node.name or "", self.where(node), None
        if node.bitsize is not None:
            width = evaluate(node.bitsize, self.constants.get)
            if width is None or width < 0:
                raise mistake(where, f"bit-field '{name}'", "a number of bits")
        elif node.align:
            raise mistake(where, f"_Alignas at '{node.name}'", "a member without it")
        elif not name:
            kind, is_cpp = type(node.type).__name__, self.source.cpp.is_cpp
            if is_cpp and (kind == "Enum" or (kind in ("Struct", "Union") and node.type.name)):
                self.read_core_type(node.type, depth)
                return
            if kind not in ("Struct", "Union") or node.type.name:
                raise mistake(where, "a member without a name", "a name")
            self.notes["a member without a name is called anonymous_N"] = None
            yield ast.MemberSpec(f"anonymous_{at}", self.read_core_type(node.type, depth), where)
            return
        elif "_Atomic" in node.quals and self.source.cpp.has_types:
            self.scope[name] = self.spec(node.type, depth)
            return
        elif type(node.type).__name__ == "ArrayDecl":
            dim = node.type.dim
            is_tail = dim is None or evaluate(dim, self.constants.get) == 0
            if is_tail and self.place(node) not in self.source.cpp.arrays:
                if not is_last:
                    raise mistake(
                        where, f"{name}[] before other members", f"a length, or {name}[] as the last member"
                    )
                node, width = node.type, ast.NO_LENGTH
        yield ast.MemberSpec(name, self.spec(node.type, depth), where, width)

    def array(self, node: Any, depth: int) -> ast.Spec:
        bounds: list[tuple[ast.Number, ast.Number]] = []
        where = self.where(node)
        while type(node).__name__ == "ArrayDecl":
            bounds.append((0, self.last_index(node)))
            node = node.type
        if len(bounds) > ast.MOST_DIMENSIONS:
            raise mistake(where, f"{len(bounds)} dimensions", f"at most {ast.MOST_DIMENSIONS}")
        element = self.spec(node, depth + 1)
        if isinstance(element, ast.TypeName) and element.name == "CHAR":
            self.notes["char[] is read as ARRAY OF CHAR: a text ends with its NUL"] = None
        return ast.ArraySpec(tuple(bounds), element)

    def last_index(self, node: Any) -> ast.Number:
        where = self.where(node)
        if node.dim is None:
            raise mistake(where, "an array without a length", "[N]")
        length = evaluate(node.dim, self.constants.get)
        if length is None:
            text = formula_text(node.dim)
            if text is None or any(self.constants.get(one, 0) is None for one in _WORD.findall(text)):
                expected = "a number, or + - * / of names and numbers"
                raise mistake(where, "a length that is not a number", expected)
            return ast.Formula(f"{text} - 1", where)
        if length < 1:
            raise mistake(where, f"[{length}]", "a length of 1 or more")
        return length - 1

    def enum(self, node: Any) -> ast.EnumSpec:
        base, is_scoped = self.source.cpp.bases.get(self.brace_place(node), ("", False))
        if not base:
            self.notes["an enum is taken as 4 bytes"] = None
        values: list[tuple[str, ast.Number | None]] = []
        number: int | None = -1
        for row in node.values.enumerators:
            given = evaluate(row.value, self.constants.get)
            number = given if row.value is not None else None if number is None else number + 1
            if not is_scoped and (number is not None or len(self.constants.maps) > 1):
                self.constants[row.name] = number
            values.append((row.name, number if number is not None else ast.Formula("?", self.where(row))))
        known = [value for _, value in values if isinstance(value, int)] or [0]
        if not base and (min(known) < -(1 << 31) or max(known) >= 1 << (31 if min(known) < 0 else 32)):
            raise mistake(self.where(node), "an enum of more than 32 bits", "values that 4 bytes hold")
        name = self.read_named_type(SimpleNamespace(names=base.split() or ["int"], coord=node.coord))
        if not isinstance(name, ast.TypeName):
            raise mistake(self.where(node), f"an enum of '{base}'", "an integer type")
        return ast.EnumSpec(name, tuple(values), is_scoped)


def _is_definition(node: Any) -> bool:
    return (node.values if type(node).__name__ == "Enum" else node.decls) is not None


def _pointer_target(node: Any) -> str:
    while type(node).__name__ in ("TypeDecl", "PtrDecl", "ArrayDecl"):
        node = node.type
    names = getattr(node, "names", None)
    return " ".join(names) if names else getattr(node, "name", None) or "a function"


# -- C text into nodes, and the whole numbers in it ----------------------------------------------------------

# The words of a C type in alphabetical order, without `signed` and a redundant `int`.
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
FOUR_BYTE_TYPES = ("int", "int unsigned")
LONG_TYPES = ("long", "long unsigned")
# Types without a fixed size; INT, UINT and BOOL have 2, 2 and 1 bytes in IEC 61131-3, and 4 on Windows.
AMBIGUOUS_TYPES = {
    **dict.fromkeys(LONG_TYPES, "int32_t or int64_t, or --long-size 4 or 8: compilers differ in its size"),
    **dict.fromkeys(
        ("size_t", "ssize_t", "ptrdiff_t", "intptr_t", "uintptr_t", "time_t"), "a type of fixed size"
    ),
    **dict.fromkeys(("wchar_t", "double long", "void", "int128"), "a type of fixed size, such as uint16_t"),
    **dict.fromkeys(("INT", "UINT", "BOOL"), "a typedef in this header: PLCs and Windows differ in its size"),
}
LANGUAGE_TYPES = ("char", "short", "int", "long", "float", "double", "void", "_Bool")
# Types that unread system headers declare, as they are no keywords of C.
NAMED_TYPES = frozenset(
    name for name in (*C_TYPES, *AMBIGUOUS_TYPES) if name.isidentifier() and name not in LANGUAGE_TYPES
)


DEEPEST = 64

_NUMBER_SUFFIX = re.compile(r"[uUlL]+\Z")
_BINARY_OPERATORS: dict[str, Callable[[int, int], int | None]] = {
    "/": lambda a, b: None if b == 0 else divide(a, b),
    "%": lambda a, b: None if b == 0 else a - b * divide(a, b),
    "<<": lambda a, b: a << b if 0 <= b < 64 else None,
    ">>": lambda a, b: a >> b if 0 <= b < 64 else None,
    "&&": lambda a, b: bool(a and b),
    "||": lambda a, b: bool(a or b),
    **dict(zip("+-*&|^", (add, sub, mul, and_, or_, xor), strict=True)),
    **dict(zip(("==", "!=", "<", ">", "<=", ">="), (eq, ne, lt, gt, le, ge), strict=True)),
}
_UNARY_OPERATORS: dict[str, Callable[[int], int]] = {"+": pos, "-": neg, "~": inv, "!": not_}


def evaluate(node: Any, look_up: Callable[[str], int | None], depth: int = 0) -> int | None:
    """Return the value of an expression, None if something in it is not a known whole number."""
    if depth > DEEPEST:  # bounds the recursion
        return None
    value: int | None = None
    match type(node).__name__:
        case "Constant":
            value = _parse_constant(node.value)
        case "ID":
            value = look_up(node.name)
        case "Cast":
            value = evaluate(node.expr, look_up, depth + 1)
        case "UnaryOp" if node.op in _UNARY_OPERATORS:
            inner = evaluate(node.expr, look_up, depth + 1)
            value = None if inner is None else _UNARY_OPERATORS[node.op](inner)
        case "BinaryOp" if node.op in _BINARY_OPERATORS:
            left = evaluate(node.left, look_up, depth + 1)
            right = evaluate(node.right, look_up, depth + 1)
            value = None if left is None or right is None else _BINARY_OPERATORS[node.op](left, right)
        case "TernaryOp":
            condition = evaluate(node.cond, look_up, depth + 1)
            if condition is not None:
                value = evaluate(node.iftrue if condition else node.iffalse, look_up, depth + 1)
    return int(value) if value is not None and abs(value) <= LARGEST_NUMBER else None


def formula_text(node: Any, depth: int = 0) -> str | None:
    """Return an expression as a formula of IEC 61131-3, None if there is none."""
    match type(node).__name__ if depth <= DEEPEST else "":
        case "Constant":
            value = _parse_constant(node.value)
            return None if value is None else str(value)
        case "ID":
            return str(node.name)
        case "Cast":
            return formula_text(node.expr, depth + 1)
        case "BinaryOp" if node.op in "+-*/":
            left, right = formula_text(node.left, depth + 1), formula_text(node.right, depth + 1)
            return None if left is None or right is None else f"({left} {node.op} {right})"
    return None


def _parse_constant(text: str) -> int | None:
    if re.fullmatch(r"'[ -~]'", text):
        return ord(text[1])
    digits = _NUMBER_SUFFIX.sub("", text).replace("'", "")
    try:
        return int(digits, 8) if re.fullmatch(r"0[0-7]+", digits) else int(digits, 0)
    except ValueError:
        return None


# A name in the place of a type that no typedef of this file declares: it comes from an #include.
_FOREIGN_TYPE = re.compile(
    r"(?:(?<=[;{}(,])|\A|\b(?:const|volatile|typedef|extern|static|_Atomic)\b)\s*([A-Za-z_]\w*)"
    r"(?=[\s*](?:[\s*]|const\b|volatile\b)*[A-Za-z_]\w*\s*[;,\[:=()])"
)
# What may declare a type or a constant; functions and variables are ignored.
_DECLARATION = re.compile(
    r"\btypedef\b|\b(?:struct|union|enum)\b[^;{}()]*\{|\bconst\b[^;{}()]*=|\bstruct\s+(?:alignas|__declspec)\b"
)
_WORD = re.compile(r"[A-Za-z_]\w*")
_PARSE_FAILURE = re.compile(r"(?:.*?):(\d+):(\d+): (.*)", re.DOTALL)


def parse_header(source: CSource) -> Iterator[Any]:
    """Yield the outer declarations of a header as nodes, an unreadable one as a bad `Declaration`."""
    types = {found.group(1) for found in _FOREIGN_TYPE.finditer(source.text)} - KEYWORDS
    types |= NAMED_TYPES
    for begin, end in _split_statements(blank_quoted(source.text)):
        text = source.text[begin:end]
        if not _DECLARATION.search(text):
            continue
        used = sorted(types & set(_WORD.findall(text)))
        try:
            if not _is_shallow(text):  # pycparser is recursive
                raise mistake(source.where(begin), "brackets nested deeper", f"at most {DEEPEST} levels")
            nodes = _parse_statement(text, used, source, begin)
            source.raise_move_problems(begin, end)
        except UserError as failed:
            name = _find_declared_name(text)
            if name is None:
                source.problems.extend(failed.problems)
                continue
            nodes = [ast.Declaration(name, None, source.where(begin), failed.problems)]
        types |= {node.name for node in nodes if type(node).__name__ in ("Typedef", "Declaration")}
        yield from nodes


def _parse_statement(text: str, types: list[str], source: CSource, begin: int) -> list[Any]:
    """Return the nodes of a part of a header; raise UserError."""
    from pycparser.c_parser import CParser, ParseError  # type: ignore[import-untyped]

    line, column = source.line_and_column(begin)
    known = f"typedef int {', '.join(types)};" if types else ""
    try:
        tree = CParser().parse(f'{known}\n#line {line} "h"\n{" " * (column - 1)}{text}', "h")
        nodes = list(tree.ext)[len(types) :]
        if not any(type(node).__name__ == "FuncDef" for node in nodes):
            return nodes
        where, what = source.where(begin), "a word before the brace"
    except ParseError as failed:
        found = _PARSE_FAILURE.fullmatch(str(failed))
        where = f"{source.name}:{found[1]}:{found[2]}" if found else source.where(begin)
        what = found[3].replace("before: ", "error before ") if found else str(failed).rpartition(": ")[2]
    except (RecursionError, AssertionError, AttributeError, IndexError, KeyError, TypeError, ValueError):
        # pycparser fails with these for text that is not C.
        where, what = source.where(begin), "unknown to the C parser"
    mark = CPP_MARKS.search(text)
    if mark or source.cpp.is_cpp:
        where = source.where(begin + mark.start()) if mark else where
        shown = f"'{' '.join(mark[0].split())[:60]}'{CPP_NOTE}" if mark else f"unreadable C++ ({what[:60]})"
        expected = "a class with only plain members: all else may change its size"
        raise mistake(where, shown, expected)
    expected = "C declarations; if it uses a macro of another header, add --with HEADER"
    raise mistake(where, f"C that cannot be read ({what[:60]})", expected)


def _is_shallow(text: str) -> bool:
    depth = 0
    for found in re.finditer(r"[(\[{}\])]", text):
        depth += 1 if found.group() in "([{" else -1
        if depth > DEEPEST:
            return False
    return True


def _split_statements(text: str) -> Iterator[tuple[int, int]]:
    depth, begin, is_function = 0, match_end(r"\s*", text, 0), False
    for found in re.finditer("[{};]", text):
        if found.group() == "{":
            if depth == 0:
                is_function = text[max(0, found.start() - 400) : found.start()].rstrip().endswith(")")
            depth += 1
            continue
        if depth == 0 and found.group() == "}":
            begin = match_end(r"\s*", text, found.end())  # the end of a `namespace {`
            continue
        depth -= found.group() == "}"
        if depth == 0 and (found.group() == ";" or is_function):
            if not is_function:
                yield begin, found.end()
            begin, is_function = match_end(r"\s*", text, found.end()), False
    if begin < len(text):
        yield begin, len(text)


def _find_declared_name(text: str) -> str | None:
    found = re.search(r"([A-Za-z_]\w*)\s*;\s*\Z", text) if re.search(r"\btypedef\b", text) else None
    extra = r"(?:(?:alignas|__declspec)\s*\([^;{}]*?\)\s*|\[\[[^;{}]*?\]\]\s*)*"
    found = found or re.search(rf"\b(?:struct|union|enum)\s+{extra}([A-Za-z_]\w*)", text)
    return found.group(1) if found and found.group(1) not in KEYWORDS else None


class Macros:
    """The numbers of macros, each evaluated once."""

    def __init__(self, source: CSource) -> None:
        self.source = source
        self.known: dict[str, int | None] = {}
        self.depth = 0

    def evaluate_text(self, text: str) -> int | None:
        """Return the value of an expression, None if it has no value."""
        if re.fullmatch(r"\d{1,18}", text) and not text.startswith("0"):
            return int(text)
        if len(text) > LONGEST_FORMULA or not _is_shallow(text):
            return None
        types = sorted(NAMED_TYPES & set(_WORD.findall(text)))
        try:
            nodes = _parse_statement(f"enum {{ x = ({text}) }};", types, self.source, 0)
            return (
                evaluate(nodes[0].type.values.enumerators[0].value, self.number_of)
                if len(nodes) == 1
                else None
            )
        except (UserError, AttributeError):  # not an expression
            return None

    def number_of(self, name: str) -> int | None:
        """Return the number of a macro, None if the macro has no number or refers to itself."""
        if name not in self.known:
            self.known[name] = None  # for a macro that refers to itself
            if name in self.source.numbers and self.depth < DEEPEST:
                self.depth += 1
                self.known[name] = self.evaluate_text(self.source.numbers[name])
                self.depth -= 1
        return self.known[name]
