"""The types of the ST grammar: STRUCT, UNION, ARRAY, STRING, enumeration, subrange, pointer, FB instance.

Rule: a mistake spoils only its member, never the STRUCT around it.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable

from trcvtui.errors import UserError
from trcvtui.udt import ast
from trcvtui.udt.sources.st_cursor import CLOSERS, IEC, MEMBER_ENDS, Cursor, Shape, Source, SourceDialect
from trcvtui.udt.types import ELEMENTARY, FB_INSTANCE, WHOLE_KINDS, Pointer, RawType, StringType, ValueKind

STRUCT_QUALIFIERS = ("OVERLAP", "PERSISTENT", "RETAIN", "NON_RETAIN")
OVERLAP_NOTE = "OVERLAP: its relative addresses are ignored, and the members placed one after another"
_UTF8_ATTRIBUTE = r"""(?i)attribute\s+['"]TcEncoding['"]\s*:=\s*['"]UTF-?8['"]"""


class SpecParser(Cursor):
    """One method for each rule of the grammar. A method leaves the cursor after the text that it read."""

    def __init__(self, source: Source, dialect: SourceDialect = IEC) -> None:
        super().__init__(source)
        self.dialect = dialect
        self.nested = 0
        self.notes: list[str] = []  # of the current declaration

    def spec(self) -> ast.Spec:
        self.nested += 1
        if self.nested > ast.MOST_NESTED:  # bounds the recursion, too
            raise self.refusal(f"at most {ast.MOST_NESTED} levels of STRUCT and ARRAY")
        rule = SPEC_RULES.get(self.token.upper, SpecParser.parse_named_type)
        if self.sees("POINTER", "REFERENCE") and self.tokens[self.at + 1].upper != "TO":
            rule = SpecParser.parse_named_type  # in S7 POINTER alone is a type
        spec = rule(self)
        self.nested -= 1
        return spec

    def variables(self) -> ast.Spec:
        """Return one or more blocks VAR ... END_VAR as one structure."""
        members: list[ast.MemberSpec] = []
        while self.sees("VAR") and self.tokens[self.at + 1].upper != "CONSTANT":
            members += self.struct().members
        return ast.StructSpec(tuple(members))

    def struct(self) -> ast.StructSpec:
        """Return STRUCT, UNION or VAR up to its END_; a bad member is left out, with a problem."""
        word = self.advance().upper
        if self.sees(*STRUCT_QUALIFIERS) and self.tokens[self.at + 1].upper not in (":", ","):
            self.notes += [OVERLAP_NOTE] if self.sees("OVERLAP") else []
            self.advance()
        members: list[ast.MemberSpec] = []
        nested = self.nested
        while not self.accept(f"END_{word}"):
            if self.block_ends() or self.sees(*CLOSERS):
                raise self.refusal(f"a member or 'END_{word}'")
            if self.accept(";"):
                continue
            try:
                members.extend(self.member(f"END_{word}"))
            except UserError as refused:
                self.add_problems(refused)
                self.skip_statement()
                self.nested = nested  # the mistake may be deeper inside
        return ast.StructSpec(tuple(members), is_union=word == "UNION")

    def member(self, end: str) -> list[ast.MemberSpec]:
        """Return the members of one line: `A, B : LREAL := 1.0;`."""
        first = self.at
        names = self.expect_names(f"a member or '{end}'", "the name of a member")
        if self.sees("AT"):
            self.skip_to(":", ";", *MEMBER_ENDS)
        self.expect(":")
        pragmas = self.pragmas_between(first, self.at)
        spec = apply_encoding(self.spec(), pragmas)
        self.skip_member_rest(spec, end)
        return [ast.MemberSpec(name.name, spec, self.where(name)) for name in names]

    def pragmas_between(self, first: int, last: int) -> list[str]:
        """Return the pragmas in front of tokens `first` to `last`."""
        pragmas = self.source.pragmas
        start, stop = bisect_left(pragmas, (first, "")), bisect_left(pragmas, (last + 1, ""))
        return [text for _, text in pragmas[start:stop]]

    def skip_member_rest(self, spec: ast.Spec, end: str) -> None:
        """Skip an initial value and `;`. The `;` may be missing after END_STRUCT or before `end`."""
        if self.accept(":="):
            self.skip_initial_value()
        elif isinstance(spec, ast.StructSpec):
            self.accept(";")
            return
        if not self.sees(end):
            self.expect(";")

    def skip_initial_value(self) -> None:
        """Skip a value, which ends before a semicolon or before a word that ends the STRUCT or TYPE."""
        if self.sees(";", *MEMBER_ENDS):
            raise self.refusal("a value")
        before = self.token
        while not self.at_end() and not self.sees(";", *MEMBER_ENDS):
            # A value has a colon only in TOD#12:30; after a name it is the next member: ';' is missing.
            if self.token.shape is Shape.UNCLOSED or (self.sees(":") and before.shape is not Shape.NUMBER):
                raise self.refusal("';'")
            before = self.advance()

    def array(self) -> ast.Spec:
        self.expect("ARRAY")
        self.expect("[")
        bounds = [self.bounds()]
        while self.sees(",") and len(bounds) < ast.MOST_DIMENSIONS:
            self.advance()
            bounds.append(self.bounds())
        self.expect("]")
        self.expect("OF")
        return ast.ArraySpec(tuple(bounds), self.spec())

    def bounds(self) -> tuple[ast.Number, ast.Number]:
        low = self.number()
        self.expect("..")
        token, high = self.token, self.number()
        if isinstance(low, int) and isinstance(high, int) and high < low:
            raise self.refusal(f"a number from {low} upwards", token)
        return low, high

    def text_type(self) -> ast.Spec:
        """Return STRING or WSTRING, with the length `[n]` or `(n)` if there is one."""
        wide = self.advance().upper == "WSTRING"
        closer = {"[": "]", "(": ")"}.get(self.token.upper)
        if closer is None:
            return StringType(None, wide)
        self.advance()
        token, length = self.token, self.number()
        if isinstance(length, int) and length < 1:
            raise self.refusal("a length of 1 or more", token)
        self.expect(closer)
        return StringType(length, wide) if isinstance(length, int) else ast.TextSpec(length, wide)

    def pointer(self) -> ast.Spec:
        """Return POINTER TO, REFERENCE TO or REF_TO; its target may be unknown."""
        first = self.at
        if self.advance().upper != "REF_TO":
            self.expect("TO")
        self.spec()
        return Pointer(self.text_from(first))

    def parse_named_type(self) -> ast.Spec:
        """Return a type by name; with brackets a subrange, an enumeration or an FB instance."""
        first, name = self.expect_qualified_name("a type")
        reference = ast.TypeName(name, self.where(first))
        if not self.sees("("):
            return reference
        row = ELEMENTARY.get(name.upper())
        if self.has_range():
            return self.subrange(reference)
        if row is None and not (self.nested == 1 and self.has_values()):
            self.skip_brackets()
            return RawType(name, FB_INSTANCE)
        if self.has_values():
            if row is not None and row.kind not in WHOLE_KINDS:  # AX: named values of a REAL, a STRING
                self.skip_brackets()
                return reference
            return ast.EnumSpec(reference, self.enumerators())
        return self.subrange(reference)

    def has_range(self) -> bool:
        """Return whether the brackets that open here contain `..` at their level."""
        depth, at = 0, self.at
        while self.tokens[at].shape is not Shape.END:
            symbol = self.tokens[at].upper
            if symbol in (";", *MEMBER_ENDS):
                return False
            depth += (symbol == "(") - (symbol == ")")
            if depth == 0 or (depth == 1 and symbol == ".."):
                return depth == 1
            at += 1
        return False

    def has_values(self) -> bool:
        """Return whether the brackets that open here begin with the name of a value."""
        return self.is_name(1) and self.tokens[self.at + 2].text != "#"

    def skip_brackets(self) -> None:
        depth = 0
        while not self.at_end() and not self.sees(";", *MEMBER_ENDS):
            symbol = self.advance().text
            depth += (symbol == "(") - (symbol == ")")
            if depth == 0:
                return
        raise self.refusal("')'")

    def subrange(self, base: ast.TypeName) -> ast.Spec:
        """Return `INT(0..10)`. For a REAL return only the base, since its limits are not whole numbers."""
        row = ELEMENTARY.get(base.name.upper())
        if row is not None and row.kind is ValueKind.REAL:
            self.skip_brackets()
            return base
        self.expect("(")
        low, high = self.bounds()
        self.expect(")")
        return ast.RangeSpec(base, low, high)

    def enumeration(self) -> ast.Spec:
        """Return `(a, b := 5)`, with or without a base type after it."""
        first = self.token
        values = self.enumerators()
        if self.is_name() and not self.sees(*MEMBER_ENDS):
            token, base = self.expect_qualified_name("a type")
            return ast.EnumSpec(ast.TypeName(base, self.where(token)), values)
        own = self.dialect.enum_base
        return ast.EnumSpec(ast.TypeName(own, self.where(first)) if own else None, values)

    def enumerators(self) -> tuple[tuple[str, ast.Number | None], ...]:
        """Return names and numbers of an enumeration; a comma is allowed after the last name or number."""
        self.expect("(")
        values: dict[str, tuple[str, ast.Number | None]] = {}
        while not values or not self.sees(")"):
            name = self.expect_name("the name of a value")
            key = name.name.casefold()
            if key in values:
                raise self.refusal("each name once in an enumeration", name)
            values[key] = (name.name, self.enumerator_number() if self.accept(":=") else None)
            if not self.accept(",") and not self.sees(")"):
                raise self.refusal("',' or ')'")
        self.expect(")")
        return tuple(values.values())

    def enumerator_number(self) -> ast.Number:
        """Return the number of a value; any other expression becomes a formula without a known value."""
        start = self.at
        try:
            number = self.number()
            if self.sees(",", ")"):
                return number
        except UserError:
            pass
        self.at = start
        if self.sees(",", ")"):
            raise self.refusal("a number")
        depth = 0
        while not self.at_end() and not self.sees(";", *MEMBER_ENDS):
            if depth == 0 and self.sees(",", ")"):
                break
            symbol = self.advance().text
            depth += (symbol == "(") - (symbol == ")")
        return self.formula(start)


def apply_encoding(spec: ast.Spec, pragmas: list[str]) -> ast.Spec:
    """Return the type, with STRING in UTF-8 if a pragma has the attribute TcEncoding."""
    if not any(re.search(_UTF8_ATTRIBUTE, text) for text in pragmas):
        return spec
    match spec:
        case ast.ArraySpec(bounds, element):
            return ast.ArraySpec(bounds, apply_encoding(element, pragmas))
        case StringType(length=length, wide=False):
            return StringType(length, utf8=True)
        case ast.TextSpec(wide=False):
            return spec._replace(utf8=True)
    return spec


SPEC_RULES: dict[str, Callable[[SpecParser], ast.Spec]] = {
    "STRUCT": SpecParser.struct,
    "UNION": SpecParser.struct,
    "VAR": SpecParser.variables,
    "ARRAY": SpecParser.array,
    "STRING": SpecParser.text_type,
    "WSTRING": SpecParser.text_type,
    "POINTER": SpecParser.pointer,
    "REFERENCE": SpecParser.pointer,
    "REF_TO": SpecParser.pointer,
    "(": SpecParser.enumeration,
}
