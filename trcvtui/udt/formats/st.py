"""IEC ST text: `TYPE name : STRUCT ... END_STRUCT; END_TYPE`, with enumerations, aliases and arrays.

A recursive descent, one method a rule of the grammar in udt.md section 5 as far as plain IEC 61131-3 goes.
Rule: a mistake ends its member or its declaration, never the file.
"""

from __future__ import annotations

from collections.abc import Callable

from trcvtui.errors import UserError
from trcvtui.udt.declared import (
    ArraySpec,
    Declaration,
    Declarations,
    EnumSpec,
    MemberSpec,
    Reference,
    Spec,
    StructSpec,
)
from trcvtui.udt.formats.st_cursor import BLOCK_ENDS, MEMBER_ENDS, Cursor
from trcvtui.udt.formats.st_tokens import Shape, Source, Token
from trcvtui.udt.type_set import MOST_NESTED
from trcvtui.udt.types import Text

MOST_DIMENSIONS = 8


def read_st(text: str, name: str) -> Declarations:
    """Return what a file of ST text declares; `name` is the file as messages call it."""
    return Parser(Source(name, text)).file()


def read_spec(text: str, where: str) -> Spec:
    """Return the one type that a text names, such as `ARRAY[0..9] OF BYTE`; raise UserError."""
    parser = Parser(Source(where, text))
    spec = parser.spec()
    if parser.problems:
        raise UserError(parser.problems)
    if not parser.at_end():
        raise parser.refusal("the end of the type")
    return spec


class Parser(Cursor):
    """The grammar; each rule leaves the cursor behind what it has read."""

    nested = 0

    def file(self) -> Declarations:
        """Return all declarations up to the end of the text."""
        types: list[Declaration] = []
        while not self.at_end():
            if self.accept("TYPE"):
                self.block(types)
            elif not self.accept(";"):
                self.note(self.refusal("'TYPE'"))
                self.skip_to(*BLOCK_ENDS)
                self.accept("END_TYPE")
        return Declarations(tuple(types), tuple(self.problems))

    def block(self, types: list[Declaration]) -> None:
        """Read the declarations of one TYPE ... END_TYPE."""
        while not self.accept("END_TYPE"):
            if self.at_end() or self.sees("TYPE"):
                self.note(self.refusal("'END_TYPE'"))
                return
            declaration = self.declaration()
            if declaration:
                types.append(declaration)

    def declaration(self) -> Declaration | None:
        """Return one declaration with its own problems; None when it has not even a name."""
        others, self.problems = self.problems, []
        self.nested = 0
        name: Token | None = None
        spec: Spec | None = None
        try:
            name = self.name("the name of a type or 'END_TYPE'")
            self.expect(":")
            spec = self.spec()
            self.rest(spec, "END_TYPE")
        except UserError as refused:
            self.note(refused)
            self.skip_statement()
            if self.accept("END_STRUCT"):
                self.accept(";")
        own, self.problems = self.problems, others
        if name is None:
            self.problems += own
            return None
        return Declaration(name.text, spec, self.where(name), tuple(own))

    def rest(self, spec: Spec, end: str) -> None:
        """Skip initial value and semicolon, which may be missing behind END_STRUCT or before `end`."""
        if self.accept(":="):
            self.initial_value()
        elif isinstance(spec, StructSpec):
            self.accept(";")
            return
        if not self.sees(end):
            self.expect(";")

    def initial_value(self) -> None:
        """Skip a value: everything up to a semicolon or to what ends the STRUCT or TYPE."""
        if self.sees(";", *MEMBER_ENDS):
            raise self.refusal("a value")
        before = self.token
        while not self.at_end() and not self.sees(";", *MEMBER_ENDS):
            # A colon stands in TOD#12:30 only; behind a name it is the next member: the semicolon is missing.
            if self.token.shape is Shape.UNCLOSED or (self.sees(":") and before.shape is not Shape.NUMBER):
                raise self.refusal("';'")
            before = self.advance()

    def spec(self) -> Spec:
        """Return a type, whatever it is."""
        self.nested += 1
        if self.nested > MOST_NESTED:
            raise self.refusal(f"at most {MOST_NESTED} levels of STRUCT and ARRAY")
        spec = SPECS.get(self.token.upper, Parser.named)(self)
        self.nested -= 1
        return spec

    def struct(self) -> Spec:
        """Return STRUCT ... END_STRUCT; a bad member is noted and left out."""
        self.expect("STRUCT")
        members: list[MemberSpec] = []
        nested = self.nested
        while not self.accept("END_STRUCT"):
            if self.block_ends():
                raise self.refusal("a member or 'END_STRUCT'")
            try:
                members.extend(self.member())
            except UserError as refused:
                self.note(refused)
                self.skip_statement()
                self.nested = nested
        return StructSpec(tuple(members))

    def member(self) -> list[MemberSpec]:
        """Return the members of one line: `A, B : LREAL := 1.0;`."""
        names = [self.name("a member or 'END_STRUCT'")]
        while self.accept(","):
            names.append(self.name("the name of a member"))
        self.expect(":")
        spec = self.spec()
        self.rest(spec, "END_STRUCT")
        return [MemberSpec(name.text, spec, self.where(name)) for name in names]

    def array(self) -> Spec:
        """Return ARRAY[..] OF a type."""
        self.expect("ARRAY")
        self.expect("[")
        bounds = [self.bounds()]
        while self.sees(",") and len(bounds) < MOST_DIMENSIONS:
            self.advance()
            bounds.append(self.bounds())
        self.expect("]")
        self.expect("OF")
        return ArraySpec(tuple(bounds), self.spec())

    def bounds(self) -> tuple[int, int]:
        """Return `low..high`."""
        low = self.integer()
        self.expect("..")
        token, high = self.token, self.integer()
        if high < low:
            raise self.refusal(f"a number from {low} upwards", token)
        return low, high

    def text(self) -> Spec:
        """Return STRING or WSTRING, with a length as `[n]` or `(n)` or without."""
        wide = self.advance().upper == "WSTRING"
        closer = {"[": "]", "(": ")"}.get(self.token.upper)
        if closer is None:
            return Text(None, wide)
        self.advance()
        token, length = self.token, self.integer()
        if length < 1:
            raise self.refusal("a length of 1 or more", token)
        self.expect(closer)
        return Text(length, wide)

    def named(self) -> Spec:
        """Return a type by name; with brackets a subrange or an enumeration."""
        name = self.name("a type")
        reference = Reference(name.text, self.where(name))
        if not self.sees("("):
            return reference
        ahead = self.tokens[self.at + 1]
        if ahead.shape is Shape.WORD and self.tokens[self.at + 2].text != "#":
            return EnumSpec(reference, self.enumerators())
        # A subrange is stored as its base type (udt.md 2.2); what comes over the wire may lie outside of it.
        self.advance()
        self.bounds()
        self.expect(")")
        return reference

    def enumeration(self) -> Spec:
        """Return `(a, b := 5)`, with a base type behind it or without."""
        values = self.enumerators()
        if self.token.shape is not Shape.WORD or self.sees(*MEMBER_ENDS):
            return EnumSpec(None, values)
        base = self.name("a type")
        return EnumSpec(Reference(base.text, self.where(base)), values)

    def enumerators(self) -> tuple[tuple[str, int | None], ...]:
        """Return names and numbers of an enumeration; a comma may stand behind the last."""
        self.expect("(")
        values: dict[str, tuple[str, int | None]] = {}
        number: int | None = -1
        while not values or not self.sees(")"):
            name = self.name("the name of a value")
            if name.upper in values:
                raise self.refusal("each name once in an enumeration", name)
            number = self.number() if self.accept(":=") else None if number is None else number + 1
            values[name.upper] = (name.text, number)
            if not self.accept(",") and not self.sees(")"):
                raise self.refusal("',' or ')'")
        self.expect(")")
        return tuple(values.values())

    def number(self) -> int | None:
        """Return the number of a value; None for an expression: only the size is known (udt.md U8)."""
        start = self.at
        try:
            number = self.integer()
            if self.sees(",", ")"):
                return number
        except UserError:
            self.at = start
        if self.sees(",", ")"):
            raise self.refusal("a number")
        depth = 0
        while not self.at_end() and not self.sees(";", *MEMBER_ENDS):
            if depth == 0 and self.sees(",", ")"):
                break
            symbol = self.advance().upper
            depth += (symbol == "(") - (symbol == ")")
        return None


SPECS: dict[str, Callable[[Parser], Spec]] = {
    "STRUCT": Parser.struct,
    "ARRAY": Parser.array,
    "STRING": Parser.text,
    "WSTRING": Parser.text,
    "(": Parser.enumeration,
}
