"""Reads TYPE, DATA_BLOCK, NAMESPACE and constants in ST text of every dialect, and skips other blocks.

Rule: a mistake spoils only its declaration. The types themselves are parsed in `st_spec.py`.
"""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from contextlib import suppress
from itertools import pairwise

from trcvtui.errors import UserError, collect_problems, mistake
from trcvtui.udt import ast
from trcvtui.udt.layout.rules import S7
from trcvtui.udt.sources.st_cursor import CLOSERS, IEC, OPENERS, Shape, Source, SourceDialect, StToken
from trcvtui.udt.sources.st_spec import SpecParser, apply_encoding

ACCESS_WORDS = ("PUBLIC", "PRIVATE", "PROTECTED", "INTERNAL")
# TIA: the first words of lines between the name of a type and STRUCT.
HEADER_WORDS = ("TITLE", "AUTHOR", "FAMILY", "NAME", "VERSION", "KNOW_HOW_PROTECT")
RETENTION_WORDS = ("NON_RETAIN", "RETAIN", "READ_ONLY", "UNLINKED")  # of a data block, before its STRUCT
CONSTANT_BLOCKS = ("VAR", "VAR_GLOBAL")
VARIABLE_BLOCKS = (*CONSTANT_BLOCKS, "VAR_EXTERNAL", "VAR_CONFIG")
_BLOCK_WORDS = """FUNCTION FUNCTION_BLOCK PROGRAM DATA_BLOCK ORGANIZATION_BLOCK CONFIGURATION
CLASS INTERFACE METHOD PROPERTY ACTION"""
OTHER_BLOCKS = frozenset((*VARIABLE_BLOCKS, *_BLOCK_WORDS.split()))
# After something unknown, reading resumes at one of these.
RESTART_WORDS = ("TYPE", "END_TYPE", "NAMESPACE", "END_NAMESPACE", *OTHER_BLOCKS)
VARIABLES_NOTE = "these variables are laid out as one STRUCT; a PLC may place them differently"
OPTIMISED_NOTE = "with optimised access the CPU orders the members itself; shown with standard access"

# Patterns stay text: `re` compiles and caches those in use, so an import compiles none.
_PACK_MODE = r"""(?i)attribute\s+['"]pack_mode['"]\s*:=\s*['"]([^'"]*)['"]"""
_OPTIMISED_ACCESS = r"""(?i)S7_Optimized_Access\s*:=\s*['"](TRUE|FALSE)['"]"""


def read_st(text: str, name: str, first_line: int = 1, dialect: SourceDialect = IEC) -> ast.Declarations:
    """Return what ST text declares. Messages name the file `name` and count lines from `first_line`."""
    return Parser(Source(name, text, first_line, dialect.nests_comments), dialect).file()


def read_spec(text: str, where: str, first_line: int = 1, dialect: SourceDialect = IEC) -> ast.Spec:
    """Return the one type that a text names, such as `ARRAY[0..9] OF BYTE`; raise UserError."""
    parser = SpecParser(Source(where, text, first_line, dialect.nests_comments), dialect)
    spec = parser.spec()
    if parser.problems:
        raise UserError(parser.problems)
    if not parser.at_end():
        raise parser.refusal("the end of the type")
    return spec


class Parser(SpecParser):
    """The parser of everything around the types: blocks, headers, constants."""

    def __init__(self, source: Source, dialect: SourceDialect = IEC) -> None:
        super().__init__(source, dialect)
        self.types: list[ast.Declaration] = []
        self.constants: list[ast.Constant] = []
        self.layout = dialect.layout
        self.others: dict[str, None] = {}
        self.since = 0  # the token after the last declaration: pragmas from here on belong to the next
        self.ends: dict[str, list[int]] = {}
        for at, token in enumerate(source.tokens):
            if token.upper.startswith("END_"):
                self.ends.setdefault(token.upper, []).append(at)
        words = pairwise(source.tokens)
        self.function_blocks = {name.name for word, name in words if word.upper == "FUNCTION_BLOCK"}

    def file(self) -> ast.Declarations:
        """Return all declarations up to the end of the text."""
        if self.sees("VAR", *OPENERS):
            self.parse_bare_struct()
        while not self.at_end():
            if self.accept("TYPE"):
                self.parse_type_block()
            elif self.sees("DATA_BLOCK") and self.end_of_block() is not None:
                self.parse_data_block()
            elif self.accept("NAMESPACE"):
                with collect_problems(self.problems):
                    self.expect_qualified_name("the name of a namespace")
            elif self.sees("USING"):
                self.skip_to(";", *RESTART_WORDS)
            elif self.end_of_block() is not None or self.sees(*OTHER_BLOCKS):
                self.skip_other_block()
            elif self.dialect.has_objects:
                self.advance()
            elif not self.accept(";") and not self.accept("END_NAMESPACE"):
                self.add_problems(self.refusal("'TYPE'"))
                self.advance()
                self.skip_to(*RESTART_WORDS)
                self.accept("END_TYPE")
        found = ast.Declarations(tuple(self.types), tuple(self.problems), tuple(self.constants))
        return found._replace(sender=ast.SenderLayout(self.layout), others=tuple(self.others))

    def parse_type_block(self) -> None:
        """Read the declarations of one TYPE ... END_TYPE."""
        while not self.accept("END_TYPE"):
            # Another block begins with its keyword and a name; a type of that name has `:` or EXTENDS.
            is_other = self.sees(*OTHER_BLOCKS) and self.tokens[self.at + 1].upper not in (":", "EXTENDS")
            if self.block_ends() or is_other:
                self.add_problems(self.refusal("'END_TYPE'"))
                return
            if declaration := self.declaration():
                self.types.append(declaration)

    def parse_bare_struct(self) -> None:
        """Read a bare STRUCT ... END_STRUCT, as copied from an editor, or VAR with nothing after it."""
        is_variables = self.sees("VAR")
        declaration = self.declaration(os.path.splitext(os.path.basename(self.source.name))[0])
        if is_variables and not (self.at_end() and self.at):
            self.at = self.since = 0  # of a program: skipped like all other blocks
        elif declaration:
            notes = (*declaration.notes, *([VARIABLES_NOTE] if is_variables else ()))
            self.types.append(declaration._replace(notes=notes, is_data=is_variables))
            self.accept("END_TYPE")

    def parse_data_block(self) -> None:
        """Read a data block as a type with its name. Skip an instance of an FB, which declares nothing."""
        end = self.end_of_block()
        assert end is not None
        self.advance()
        declaration = self.declaration(is_block=True)
        self.at = self.since = end + 1
        of = declaration.spec.name if declaration and isinstance(declaration.spec, ast.TypeName) else ""
        if declaration and of not in self.function_blocks and not re.fullmatch("(?i)S?FB[0-9]+", of):
            self.types.append(declaration._replace(is_data=True))
            self.layout = S7.name

    def declaration(self, name: str = "", is_block: bool = False) -> ast.Declaration | None:
        """Return one declaration with its own problems, None if it has no name.

        If `name` is given, the text begins with the type itself, without a name.
        """
        others, self.problems = self.problems, []
        self.nested, self.notes = 0, []
        first = self.token
        spec: ast.Spec | None = None
        try:
            if self.sees(*ACCESS_WORDS) and self.is_name(1):
                self.advance()
            if name:
                spec = self.parse_with_pragmas(None)
            else:
                first, name = self.expect_numbered_name("the name of a type or 'END_TYPE'")
                spec = self.parse_after_name(is_block)
            if not is_block:
                self.skip_member_rest(spec, "END_TYPE")
            elif not (self.accept(";") or self.sees("BEGIN", "END_DATA_BLOCK")):
                raise self.refusal("'BEGIN'")
        except UserError as refused:
            self.add_problems(refused)
            self.skip_statement()
            if self.sees(*CLOSERS):
                self.advance()
                self.accept(";")
        self.since = self.at
        own, self.problems = self.problems, others
        if not name:
            self.problems += own
            return None
        return ast.Declaration(name, spec, self.where(first), tuple(own), tuple(dict.fromkeys(self.notes)))

    def parse_after_name(self, is_block: bool) -> ast.Spec:
        """Return the type after a declared name. EXTENDS and a colon or a header may come before it."""
        base = self.extends()
        self.skip_header(is_block)
        if base is None and (base := self.extends()):
            self.accept(":")
        return self.parse_with_pragmas(base)

    def parse_with_pragmas(self, base: ast.TypeName | None) -> ast.Spec:
        """Return the type at the cursor, changed by the pragmas before it."""
        pragmas = self.pragmas_between(self.since, self.at)
        first = self.token
        spec = apply_encoding(self.spec(), pragmas)
        if base is not None and not isinstance(spec, ast.StructSpec):
            raise self.refusal("STRUCT or UNION after EXTENDS", first)
        if isinstance(spec, ast.StructSpec):
            spec = spec._replace(base=base, pack=self.pack_mode(pragmas, first))
        access = [found[1].upper() for text in pragmas if (found := re.search(_OPTIMISED_ACCESS, text))]
        if access:
            self.layout = S7.name
        if "TRUE" in access:
            self.notes.append(OPTIMISED_NOTE)
        return spec

    def extends(self) -> ast.TypeName | None:
        """Return the name after EXTENDS, None without EXTENDS."""
        if not self.accept("EXTENDS"):
            return None
        token, name = self.expect_qualified_name("a type")
        return ast.TypeName(name, self.where(token))

    def skip_header(self, is_block: bool) -> None:
        """Skip the colon, or the header lines of a TIA source or a data block."""
        if self.accept(":"):
            return
        before = self.tokens[self.at - 1]
        has_header = is_block or self.dialect.has_header or before.shape is Shape.QUOTED
        if not (has_header or self.sees(*HEADER_WORDS)):
            raise self.refusal("':'")
        words = RETENTION_WORDS if is_block else ()
        while self.sees(*HEADER_WORDS, *words):
            first = self.advance()
            line = self.source.line(first.place) if first.upper in HEADER_WORDS else 0
            while not self.at_end() and self.source.line(self.token.place) == line:
                if self.sees("STRUCT", "VAR", *words) and first.upper != "TITLE":
                    break
                self.advance()
        if not (self.sees("STRUCT") or is_block):
            raise self.refusal("'STRUCT'")

    def pack_mode(self, pragmas: list[str], token: StToken) -> int | None:
        """Return the pack_mode among the pragmas of a type; raise UserError if no compiler accepts it."""
        found = next((mode for text in pragmas if (mode := re.search(_PACK_MODE, text))), None)
        if found is None:
            return None
        if found[1] not in map(str, ast.PACK_MODES):
            raise mistake(self.where(token), f"pack_mode '{found[1][:20]}'", "0, 1, 2, 4 or 8")
        return int(found[1])

    # -- other blocks ------------------------------------------------------------------------------------

    def end_of_block(self) -> int | None:
        """Return the index of the END_ word of the block that begins here, None if there is none."""
        places = [] if self.sees(*OPENERS) else self.ends.get(self.end_word(), [])
        after = bisect_right(places, self.at)
        return places[after] if after < len(places) else None

    def end_word(self) -> str:
        return "END_VAR" if self.sees(*VARIABLE_BLOCKS) else f"END_{self.token.upper}"

    def skip_other_block(self) -> None:
        """Skip a block that declares no types, but keep its constants."""
        end = self.end_of_block()
        self.others[self.token.upper] = None
        if end is None:
            self.add_problems(self.refusal(f"'{self.end_word()}' after it"))
            self.advance()
            self.skip_to(*RESTART_WORDS)
            return
        is_variables = self.advance().upper in CONSTANT_BLOCKS
        while self.sees("RETAIN", "PERSISTENT", *ACCESS_WORDS):
            self.advance()
        if is_variables and self.accept("CONSTANT"):
            while self.at < end:
                self.parse_constant(end)
        self.at = self.since = end + 1

    def parse_constant(self, end: int) -> None:
        """Keep a constant that is a whole number or a formula, as `MAX : INT := 5;`. Skip all else."""
        with suppress(UserError):  # TRUE, 'text' and 1.5 are constants too, but cannot be bounds
            names = self.expect_names("the name of a constant", "the name of a constant")
            self.skip_until(end, ":=", ";")
            if self.accept(":="):
                number = self.number()
                if self.sees(";") or self.at == end:
                    self.constants.extend(ast.Constant(name.name, number, self.where(name)) for name in names)
        self.skip_until(end, ";")
        self.at = min(self.at + 1, end)

    def skip_until(self, end: int, *texts: str) -> None:
        while self.at < end and not self.sees(*texts):
            self.advance()
