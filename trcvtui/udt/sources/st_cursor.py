"""ST text of any dialect as tokens, and a cursor in them, which recovers after a mistake.

Rule: every text can be split into tokens. An illegal character becomes a token that no grammar rule
accepts. Comments are left out, pragmas are kept apart, and positions do not change.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from enum import Enum
from typing import NamedTuple

from trcvtui.errors import Problem, UserError, mistake
from trcvtui.udt.ast import Formula, Number
from trcvtui.udt.constants import DEEPEST_FORMULA
from trcvtui.udt.literals import NAME_PATTERN, parse_integer


class SourceDialect(NamedTuple):
    """A dialect of ST: plain IEC 61131-3 unless a field says otherwise."""

    # B&R: an enumeration without a base is a C enum of 4 bytes.
    enum_base: str | None = None
    # TIA: `TYPE "n"`, lines such as VERSION : 0.1, then STRUCT; no colon after the name.
    has_header: bool = False
    # CODESYS 2.3: between the types are objects that are not in IEC 61131-3.
    has_objects: bool = False
    # Whether comments nest, `(* (* *) *)`; if the marks do not match, they do not (`comment_end`).
    nests_comments: bool = True
    # The layout of types in a source of this dialect, "" for none.
    layout: str = ""


IEC = SourceDialect()


class Shape(Enum):
    WORD = "word"
    NUMBER = "number"
    QUOTED = "quoted text"
    SYMBOL = "symbol"
    UNCLOSED = "unclosed"
    STRAY = "stray character"
    END = "end"


class StToken(NamedTuple):
    """One token: its text, where it begins, and `upper` to compare keywords and symbols with."""

    shape: Shape
    text: str
    place: int
    upper: str

    @property
    def name(self) -> str:
        """Return the text without the quotes of a quoted name."""
        return self.text[1:-1] if self.shape is Shape.QUOTED else self.text


CLOSING_MARKS = {"(*": "*)", "/*": "*/", "{": "}", "'": "'", '"': '"'}

# A quote in a pragma hides a brace if no letter is before it and it closes on its line: not in `{don't}`.
# A value after `:=` may have several lines.
_TOKEN = re.compile(
    r"""(?P<GAP>\s+|//[^\r\n]*|/\*.*?\*/|\{(?::=\s*+'[^']*+'(?=\s*[};,])
        |(?<!\w)'[^'\r\n]*'|(?<!\w)"[^"\r\n]*"|[^}])*+\})
    |(?P<NESTED>\(\*)
    |(?P<WORD>"""
    + NAME_PATTERN
    + r""")
    |(?P<NUMBER>\d[\d_]*(?:\#\w+|\.\d[\d_]*(?:[eE][+-]?\d+)?)?)
    |(?P<QUOTED>'(?:\$.|[^'$\r\n])*'|"(?:\$.|[^"$\r\n])*"|"[^"\r\n]*"|`[^`\r\n]*`)
    |(?P<UNCLOSED>/\*|[{'"])
    |(?P<SYMBOL>:=|\.\.|[;:,.()\[\]\#+\-*/=])
    |(?P<STRAY>.)""",
    re.VERBOSE | re.DOTALL,
)
# Between BEGIN and END_DATA_BLOCK are start values, up to 100,000 in a file; a layout does not need them.
_START_VALUES = re.compile(
    r"""//[^\r\n]*|/\*(?:.*?\*/|.*)|\(\*(?:.*?\*\)|.*)|'(?:\$.|[^'$\r\n])*'|"[^"\r\n]*"
        |(?P<END>\bEND_DATA_BLOCK\b)""",
    re.VERBOSE | re.DOTALL | re.IGNORECASE,
)
_TITLE_TEXT = re.compile(r"[ \t]*=[^\r\n]*")
_COMMENT_MARK = re.compile(r"\(\*|\*\)")
_LINE_END = re.compile(r"\r\n|\r|\n")


class Source:
    """A text with a name, and its tokens. The text may begin within a file, at line `first_line`."""

    def __init__(self, name: str, text: str, first_line: int = 1, nests_comments: bool = True) -> None:
        self.name, self.text, self.first_line = name, text, first_line
        self.nested = nests_comments
        # Each with the index of the token after it: its attributes belong to the next type.
        self.pragmas: list[tuple[int, str]] = []
        self.lines = [0, *(end.end() for end in _LINE_END.finditer(text))]
        self.tokens = self.tokenize()

    def where(self, place: int) -> str:
        """Return file, line and column of a place, both from 1, or only the file if `first_line` is 0."""
        if not self.first_line:
            return self.name
        line = self.line(place)
        column = place - self.lines[line - 1] + 1
        return f"{self.name}:{line + self.first_line - 1}:{column}"

    def line(self, place: int) -> int:
        """Return the line of a place in this text, from 1."""
        return bisect_right(self.lines, place)

    def refusal(self, token: StToken, expected: str) -> UserError:
        found = "the end of the text" if token.shape is Shape.END else f"'{token.text[:40]}'"
        if token.shape is Shape.UNCLOSED:
            found, expected = f"{found} without an end", f"'{CLOSING_MARKS[token.text]}'"
        return mistake(self.where(token.place), found, expected)

    def tokenize(self) -> list[StToken]:
        """Return all tokens, the last one an END."""
        tokens: list[StToken] = []
        place, end, is_data = 0, len(self.text), False
        while place < end:
            found = _TOKEN.match(self.text, place)
            assert found is not None and found.lastgroup is not None  # STRAY takes any character
            group, text, begin, place = found.lastgroup, found.group(), place, found.end()
            if group == "NESTED":
                place = self.comment_end(begin)
                group = "GAP" if place else "UNCLOSED"
            if text[0] == "{" and group == "GAP":
                self.pragmas.append((len(tokens), text))
            if group != "GAP":
                tokens.append(StToken(Shape[group], text, begin, word := text.upper()))
                is_data = word == "DATA_BLOCK" or (is_data and word != "END_DATA_BLOCK")
                if is_data and word == "BEGIN":
                    place = self.find_values_end(place)
                if is_data and word == "TITLE" and (title := _TITLE_TEXT.match(self.text, place)):
                    place = title.end()
            if group == "UNCLOSED":
                place = self.find_unclosed_end(text, begin)
        tokens.append(StToken(Shape.END, "", end, ""))
        return tokens

    def comment_end(self, place: int) -> int:
        """Return the end of the comment that begins here, or 0. Comments nest unless the marks mismatch."""
        depth = 0
        for mark in _COMMENT_MARK.finditer(self.text, place) if self.nested else ():
            depth += 1 if mark.group() == "(*" else -1
            if depth == 0:
                return mark.end()
        # Real files also have `(* a (* b *)`: from here on the first end closes a comment.
        self.nested = False
        first = self.text.find("*)", place + 2)
        return first + 2 if first >= 0 else 0

    def find_values_end(self, place: int) -> int:
        """Return the end of a data block if its start values begin at `place`, else `place`."""
        if self.text[place : place + 40].lstrip()[:1] in (":", ","):  # a member of that name
            return place
        found = _START_VALUES.finditer(self.text, place)
        return next((one.start() for one in found if one["END"]), place)

    def find_unclosed_end(self, text: str, place: int) -> int:
        """Return where reading resumes: the line's end after an open quote, else the text's end."""
        line_end = _LINE_END.search(self.text, place) if text in "'\"" else None
        return line_end.start() if line_end else len(self.text)


OPENERS = ("STRUCT", "UNION")
CLOSERS = ("END_STRUCT", "END_UNION")
BLOCK_ENDS = ("END_TYPE", "TYPE", "END_NAMESPACE", "END_DATA_BLOCK")
MEMBER_ENDS = (*CLOSERS, *BLOCK_ENDS)
# Not names: if a name is expected and one of these comes, something before it is missing.
RESERVED_WORDS = frozenset({*OPENERS, *MEMBER_ENDS, "ARRAY", "OF"})
NAMED_BY_NUMBER = ("UDT", "DB", "FB", "SFB")  # in an S7 source `UDT 5` and `UDT5` are the same name


class Cursor:
    """One pass over the tokens of a source, and the problems found."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.tokens = source.tokens
        self.at = 0
        self.problems: list[Problem] = []

    @property
    def token(self) -> StToken:
        """Return the token at the cursor; at the end of the text always an END."""
        return self.tokens[self.at]

    def at_end(self) -> bool:
        return self.token.shape is Shape.END

    def where(self, token: StToken) -> str:
        return self.source.where(token.place)

    def sees(self, *texts: str) -> bool:
        """Return whether the token is one of these keywords (upper case) or symbols."""
        return self.token.upper in texts

    def advance(self) -> StToken:
        token = self.token
        if token.shape is not Shape.END:
            self.at += 1
        return token

    def accept(self, text: str) -> bool:
        """Skip the token if it is this keyword or symbol; return whether it was."""
        if not self.sees(text):
            return False
        self.at += 1
        return True

    def expect(self, text: str) -> None:
        """Skip this keyword or symbol; raise UserError if it is not there."""
        if not self.accept(text):
            raise self.refusal(f"'{text}'")

    def expect_name(self, what: str) -> StToken:
        """Return the name at the cursor and skip it, or raise UserError that `what` is expected."""
        if not self.is_name() or (self.token.upper in RESERVED_WORDS and not self.is_keyword_member()):
            raise self.refusal(what)
        return self.advance()

    def expect_names(self, first: str, more: str) -> list[StToken]:
        """Return one or more comma-separated names. Raise UserError that `first` or `more` is expected."""
        names = [self.expect_name(first)]
        while self.accept(","):
            names.append(self.expect_name(more))
        return names

    def is_name(self, ahead: int = 0) -> bool:
        """Return whether the token at the cursor, or `ahead` tokens after it, is a word or quoted name."""
        token = self.tokens[min(self.at + ahead, len(self.tokens) - 1)]
        if token.shape is Shape.QUOTED:
            return token.text[0] != "'" and len(token.text) > 2
        return token.shape is Shape.WORD

    def expect_qualified_name(self, what: str) -> tuple[StToken, str]:
        """Skip a name such as `Lib.T` or `_."T"`, and return its first token and the name."""
        first, name = self.expect_numbered_name(what)
        parts = [name]
        while self.sees(".") and self.is_name(1):
            self.advance()
            parts.append(self.advance().name)
        return first, ".".join(parts)

    def expect_numbered_name(self, what: str) -> tuple[StToken, str]:
        """Return the first token of a name without dots, and the name; skip it."""
        token = self.expect_name(what)
        has_number = token.upper in NAMED_BY_NUMBER and self.token.shape is Shape.NUMBER
        return token, token.name + self.advance().text if has_number else token.name

    def is_keyword_member(self) -> bool:
        """Return whether this is a member called Type or Array. No block or type begins with `TYPE :`."""
        return self.sees("TYPE", "ARRAY") and self.tokens[self.at + 1].upper in (":", ",")

    def block_ends(self) -> bool:
        """Return whether the block of declarations is surely over."""
        return self.at_end() or (self.sees(*BLOCK_ENDS) and not self.is_keyword_member())

    def number(self) -> Number:
        """Return the number at the cursor, a formula unless it is a literal, and skip it."""
        first, depth = self.at, 0
        while True:
            while self.sees("+", "-") or (self.sees("(") and depth < DEEPEST_FORMULA):
                depth += self.advance().text == "("
            self.skip_operand()
            while depth and self.accept(")"):
                depth -= 1
            if not self.sees("+", "-", "*", "/"):
                break
            self.advance()
        if depth:
            raise self.refusal("')'")
        formula = self.formula(first)
        plain = parse_integer(formula.text)
        return formula if plain is None else plain

    def formula(self, first: int) -> Formula:
        """Return the tokens from `first` up to the cursor as a formula."""
        taken = self.tokens[first : self.at]
        return Formula("".join(token.text for token in taken), self.where(self.tokens[first]))

    def skip_operand(self) -> None:
        """Skip `5`, `16#FF`, `UINT#1`, `Limits#UPPER` or `GVL.MAX`."""
        if self.token.shape is Shape.NUMBER and parse_integer(self.token.text) is not None:
            self.advance()
            return
        if not self.accept("#"):  # TIA: a constant of the block itself
            self.accept(".")  # CODESYS: `.GVL.MAX` is global
        self.expect_qualified_name("a whole number")
        if self.accept("#"):
            if self.sees("+", "-"):
                self.advance()
            if self.token.shape is Shape.NUMBER:
                self.advance()
            else:
                self.expect_qualified_name("a value")

    def text_from(self, first: int) -> str:
        """Return the text from a token up to the cursor, formatted on one line."""
        text = " ".join(token.text for token in self.tokens[first : self.at])
        text = re.sub(r" ?(\.\.|[\[(.#]) ?", r"\1", text)
        return re.sub(r" ([\]),:])", r"\1", text)

    def refusal(self, expected: str, token: StToken | None = None) -> UserError:
        """Return the UserError for an unexpected token (default: the one at the cursor)."""
        return self.source.refusal(token or self.token, expected)

    def add_problems(self, refused: UserError) -> None:
        self.problems.extend(refused.problems)

    def skip_to(self, *texts: str) -> None:
        """Skip the tokens before the first of these keywords or symbols, or all if there is none."""
        while not self.at_end() and not self.sees(*texts):
            self.advance()

    def skip_statement(self) -> None:
        """Skip this statement with its semicolon or END_. Stop before a word that ends the block."""
        depth = 0
        while not self.block_ends():
            if depth == 0 and self.sees(*CLOSERS):
                return
            word = self.advance().upper
            depth += (word in OPENERS) - (word in CLOSERS)
            if depth == 0 and word in (";", *CLOSERS):
                self.accept(";")
                return
