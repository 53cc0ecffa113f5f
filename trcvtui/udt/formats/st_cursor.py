"""A place in the tokens of an ST text: look, take, refuse, and go on behind a mistake."""

from __future__ import annotations

from trcvtui.errors import Problem, UserError
from trcvtui.udt.formats.st_tokens import Shape, Source, Token
from trcvtui.udt.literals import parse_integer

# No names: one of these where a name should be means that something before it is missing.
RESERVED = frozenset({"TYPE", "END_TYPE", "STRUCT", "END_STRUCT", "ARRAY", "OF"})
BLOCK_ENDS = ("END_TYPE", "TYPE")
MEMBER_ENDS = ("END_STRUCT", *BLOCK_ENDS)


class Cursor:
    """One pass over the tokens of a source, and the problems met on the way."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.tokens = source.tokens
        self.at = 0
        self.problems: list[Problem] = []

    @property
    def token(self) -> Token:
        """Return the token at the cursor; at the end of the text an END, again and again."""
        return self.tokens[self.at]

    def at_end(self) -> bool:
        """Return whether the text is used up."""
        return self.token.shape is Shape.END

    def where(self, token: Token) -> str:
        """Return file, line and column of a token."""
        return self.source.where(token.place)

    def sees(self, *texts: str) -> bool:
        """Return whether the token is one of these keywords (upper case) or symbols."""
        return self.token.upper in texts

    def advance(self) -> Token:
        """Return the token and go behind it."""
        token = self.token
        if token.shape is not Shape.END:
            self.at += 1
        return token

    def accept(self, text: str) -> bool:
        """Go behind the token if it is this keyword or symbol; return whether it was."""
        if not self.sees(text):
            return False
        self.at += 1
        return True

    def expect(self, text: str) -> None:
        """Go behind this keyword or symbol; raise UserError when it is not there."""
        if not self.accept(text):
            raise self.refusal(f"'{text}'")

    def name(self, what: str) -> Token:
        """Return the name at the cursor and go behind it; raise UserError, naming what was expected."""
        if self.token.shape is not Shape.WORD or (self.token.upper in RESERVED and not self.is_member_type()):
            raise self.refusal(what)
        return self.advance()

    def is_member_type(self) -> bool:
        """Return whether this is a member called Type, as real files have it: no block begins `TYPE :`."""
        return self.sees("TYPE") and self.tokens[self.at + 1].upper in (":", ",")

    def block_ends(self) -> bool:
        """Return whether the block of declarations is surely over."""
        return self.at_end() or (self.sees(*BLOCK_ENDS) and not self.is_member_type())

    def integer(self) -> int:
        """Return the whole number at the cursor (`-5`, `16#FF`, `UINT#1`) and go behind it."""
        start = self.at
        text = self.advance().text if self.sees("-", "+") else ""
        if self.token.shape is Shape.WORD and self.tokens[self.at + 1].text == "#":
            text += self.advance().text + self.advance().text
            text += self.advance().text if self.sees("-", "+") else ""
        number = parse_integer(text + self.token.text) if self.token.shape is Shape.NUMBER else None
        if number is None:
            self.at = start
            raise self.refusal("a whole number")
        self.advance()
        return number

    def refusal(self, expected: str, token: Token | None = None) -> UserError:
        """Return the UserError of a token (default: the one at the cursor) that the grammar does not take."""
        return self.source.refusal(token or self.token, expected)

    def note(self, refused: UserError) -> None:
        """Keep what is wrong, to go on and find more."""
        self.problems.extend(refused.problems)

    def skip_to(self, *texts: str) -> None:
        """Go in front of the first of these keywords or symbols, or to the end."""
        while not self.at_end() and not self.sees(*texts):
            self.advance()

    def skip_statement(self) -> None:
        """Go behind the semicolon or STRUCT that ends this statement, or before what surely follows."""
        depth = 0
        while not self.block_ends():
            if depth == 0 and self.sees("END_STRUCT"):
                return
            word = self.advance().upper
            depth += (word == "STRUCT") - (word == "END_STRUCT")
            if depth == 0 and word in (";", "END_STRUCT"):
                self.accept(";")
                return
