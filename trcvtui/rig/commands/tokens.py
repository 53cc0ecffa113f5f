"""A bench command cut into words.

Rule: quotes and braces keep a word together; `#` behind a blank begins a comment (in T#1s it does not).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import Final

from trcvtui.blocks.pins import Pin
from trcvtui.errors import UserError, mistake
from trcvtui.project.keys import kind_of
from trcvtui.project.tables import DELAY, TRUTH_WORDS, Kind, T, shown

_WORD: Final = re.compile(r"(?:(?:W#|WORD#)?16#|0x)?([0-9A-F]{1,4})", re.IGNORECASE)


def pin_value(pin: Pin, text: str, where: str) -> bool | int:
    """Return the value of a pin: 0 1 TRUE FALSE, a number, or a STATUS word in hex."""
    if pin.is_bool:
        truth = TRUTH_WORDS.get(text.upper())
        if truth is None:
            raise mistake(where, f"{pin.name}={shown(text)}", f"{pin.name}=0 or {pin.name}=1")
        return truth
    if pin.iec_type == "WORD":
        found = _WORD.fullmatch(text)
        if found is None:
            raise mistake(where, f"{pin.name}={shown(text)}", "four hex digits such as 7006")
        return int(found[1], 16)
    number: int = value_of(kind_of(pin), text, f"{pin.name}=", where)
    return number


def value_of(kind: Kind[T], text: str, before: str, where: str) -> T:
    """Return a text read as a kind; `before` is what stands in front of it, such as `gap=`."""
    found = kind.from_text(text)
    if found is None:
        raise mistake(where, f"{before}{shown(text)}", kind.wanted(text))
    return found


def duration(text: str, before: str, where: str) -> int:
    """Return the ns of a duration such as T#20ms, not negative."""
    return value_of(DELAY, text, before, where)


CLOSING: Final = {'"': '"', "'": "'", "{": "}"}
ESCAPE: Final = {'"': "\\", "'": "$"}
MOST_NESTED: Final = 32


@dataclass(frozen=True, slots=True)
class Token:
    """One word and where it stands in the line."""

    text: str
    start: int
    end: int


def tokens_of(line: str, where: str) -> list[Token]:
    """Return the words of a line; raise UserError for a quote or brace that nobody closes."""
    found: list[Token] = []
    at = 0
    while at < len(line):
        if line[at].isspace():
            at += 1
        elif line[at] == "#":
            break
        else:
            end = _word_end(line, at, where)
            found.append(Token(line[at:end], at, end))
            at = end
    return found


def _word_end(line: str, at: int, where: str) -> int:
    while at < len(line) and not line[at].isspace():
        at = _closed(line, at, where) if line[at] in CLOSING else at + 1
    return at


def _closed(line: str, start: int, where: str, depth: int = 1) -> int:
    """Return the place behind the quote or brace that opens at start."""
    opening, at = line[start], start + 1
    if depth > MOST_NESTED:
        raise mistake(where, "braces nested too deeply", f"at most {MOST_NESTED} levels")
    while at < len(line):
        if line[at] == CLOSING[opening]:
            return at + 1
        if opening == "{" and line[at] in CLOSING:
            at = _closed(line, at, where, depth + 1)
        else:
            at += 2 if line[at] == ESCAPE.get(opening) else 1
    raise mistake(where, shown(line[start:]), f"a closing {CLOSING[opening]}")


class Words:
    """The words of one command, read from left to right."""

    def __init__(self, line: str, where: str) -> None:
        self.where = where
        self._line = line
        self._tokens = tokens_of(line, where)
        self._at = 0

    def __bool__(self) -> bool:
        """Return whether words are left."""
        return self._at < len(self._tokens)

    def next(self, expected: str) -> str:
        """Take the next word; raise UserError when there is none."""
        if not self:
            raise self.wrong("nothing more", expected)
        self._at += 1
        return self._tokens[self._at - 1].text

    def peek(self, ahead: int = 0) -> str:
        """Return a word further on without taking it, "" where there is none."""
        at = self._at + ahead
        return self._tokens[at].text if at < len(self._tokens) else ""

    def ahead(self) -> list[str]:
        """Return all words that are left, without taking them."""
        return [token.text for token in self._tokens[self._at :]]

    @property
    def verb(self) -> str:
        """Return the first word of the line."""
        return self._tokens[0].text if self._tokens else ""

    def rest(self) -> list[str]:
        """Take all words that are left."""
        left = [token.text for token in self._tokens[self._at :]]
        self._at = len(self._tokens)
        return left

    def rest_text(self, expected: str) -> str:
        """Take what is left, as it is written; raise UserError when there is nothing."""
        start = self._at
        self.next(expected)
        self.rest()
        return self.written(start)

    def to_come(self) -> str:
        """Return what is left as it is written, without taking it."""
        left = self._tokens[self._at :]
        return self._line[left[0].start : left[-1].end] if left else ""

    @property
    def place(self) -> int:
        """Return how many words have been taken."""
        return self._at

    def written(self, start: int) -> str:
        """Return the taken words from number `start` on, as they are written."""
        return self._line[self._tokens[start].start : self._tokens[self._at - 1].end]

    def cut(self, begins: Callable[[str], bool]) -> list[str]:
        """Take the words from the first one to come that `begins` away from the end, and return them."""
        for number in range(self._at, len(self._tokens)):
            if begins(self._tokens[number].text):
                tail = [token.text for token in self._tokens[number:]]
                del self._tokens[number:]
                return tail
        return []

    def apart(self, begins: Callable[[str], bool]) -> Words:
        """Take the words from the first one to come that `begins` away from the end, as words apart."""
        after = range(self._at, len(self._tokens))
        number = next((n for n in after if begins(self._tokens[n].text)), len(self._tokens))
        tail = copy(self)
        tail._at = number
        self._tokens = self._tokens[:number]
        return tail

    def finish(self) -> None:
        """Raise UserError when words are left."""
        if self:
            raise self.wrong(shown(self.peek()), "the end of the command")

    def wrong(self, found: str, expected: str) -> UserError:
        """Return a mistake in this command."""
        return mistake(self.where, found, expected)
