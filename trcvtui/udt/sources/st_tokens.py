"""IEC ST text cut into tokens; comments are left out, pragmas set aside, positions kept.

Rule: every text can be cut; what is no token becomes one that no grammar rule takes.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from enum import Enum
from typing import NamedTuple

from trcvtui.errors import UserError, mistake
from trcvtui.udt.words import NAME


class Shape(Enum):
    """What a token is."""

    WORD = "word"
    NUMBER = "number"
    QUOTED = "quoted text"
    SYMBOL = "symbol"
    UNCLOSED = "unclosed"
    STRAY = "stray character"
    END = "end"


class Token(NamedTuple):
    """One token: its text, where it begins, and `upper` to compare keywords and symbols with."""

    shape: Shape
    text: str
    place: int
    upper: str

    @property
    def name(self) -> str:
        """Return the text without the quotes of a quoted name."""
        return self.text[1:-1] if self.shape is Shape.QUOTED else self.text


CLOSERS = {"(*": "*)", "/*": "*/", "{": "}", "'": "'", '"': '"'}

# A quote in a pragma hides a brace when it opens behind no letter and closes on its line: not in `{don't}`;
# a value behind `:=` may have several lines.
_TOKEN = re.compile(
    r"""(?P<GAP>\s+|//[^\r\n]*|/\*.*?\*/|\{(?::=\s*+'[^']*+'(?=\s*[};,])
        |(?<!\w)'[^'\r\n]*'|(?<!\w)"[^"\r\n]*"|[^}])*+\})
    |(?P<NESTED>\(\*)
    |(?P<WORD>"""
    + NAME
    + r""")
    |(?P<NUMBER>\d[\d_]*(?:\#\w+|\.\d[\d_]*(?:[eE][+-]?\d+)?)?)
    |(?P<QUOTED>'(?:\$.|[^'$\r\n])*'|"(?:\$.|[^"$\r\n])*"|"[^"\r\n]*"|`[^`\r\n]*`)
    |(?P<UNCLOSED>/\*|[{'"])
    |(?P<SYMBOL>:=|\.\.|[;:,.()\[\]\#+\-*/=])
    |(?P<STRAY>.)""",
    re.VERBOSE | re.DOTALL,
)
_COMMENT_MARK = re.compile(r"\(\*|\*\)")
_LINE_END = re.compile(r"\r\n|\r|\n")


class Source:
    """A text with a name, and the tokens in it; it may begin within a file, in its line `first_line`."""

    def __init__(self, name: str, text: str, first_line: int = 1, nests_comments: bool = True) -> None:
        self.name, self.text, self.first_line = name, text, first_line
        self.nested = nests_comments
        # Each with the index of the token behind it: attributes say how the next type is laid out.
        self.pragmas: list[tuple[int, str]] = []
        self.lines = [0, *(end.end() for end in _LINE_END.finditer(text))]
        self.tokens = self.cut()

    def where(self, place: int) -> str:
        """Return file, line and column of a place, both from 1."""
        line = self.line(place)
        column = place - self.lines[line - 1] + 1
        return f"{self.name}:{line + self.first_line - 1}:{column}"

    def line(self, place: int) -> int:
        """Return the line of a place in this text, from 1."""
        return bisect_right(self.lines, place)

    def refusal(self, token: Token, expected: str) -> UserError:
        """Return the UserError of a token that the grammar does not take."""
        found = "the end of the text" if token.shape is Shape.END else f"'{token.text[:40]}'"
        if token.shape is Shape.UNCLOSED:
            found, expected = f"{found} without an end", f"'{CLOSERS[token.text]}'"
        return mistake(self.where(token.place), found, expected)

    def cut(self) -> list[Token]:
        """Return all tokens, the last one an END."""
        tokens: list[Token] = []
        place, end = 0, len(self.text)
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
                tokens.append(Token(Shape[group], text, begin, text.upper()))
            if group == "UNCLOSED":
                place = self.after_unclosed(text, begin)
        tokens.append(Token(Shape.END, "", end, ""))
        return tokens

    def comment_end(self, place: int) -> int:
        """Return where the comment ends that begins here, 0 if nowhere; comments nest while that works."""
        depth = 0
        for mark in _COMMENT_MARK.finditer(self.text, place) if self.nested else ():
            depth += 1 if mark.group() == "(*" else -1
            if depth == 0:
                return mark.end()
        # Real files hold `(* a (* b *)` too (udt.md section 5): from here on the first end closes.
        self.nested = False
        first = self.text.find("*)", place + 2)
        return first + 2 if first >= 0 else 0

    def after_unclosed(self, text: str, place: int) -> int:
        """Return where to go on: text in quotes ends with its line, anything else with the file."""
        line_end = _LINE_END.search(self.text, place) if text in "'\"" else None
        return line_end.start() if line_end else len(self.text)
