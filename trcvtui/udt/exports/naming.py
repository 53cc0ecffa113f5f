"""Names that another language can carry: ASCII, no keyword, each once; the own name is kept where it fits."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Collection


def ascii_word(name: str) -> str:
    """Return the name in ASCII letters, digits and `_`: `Größe` is `Gro_e`, `é` loses its accent."""
    plain = unicodedata.normalize("NFKD", name)
    plain = "".join(c for c in plain if not unicodedata.combining(c))
    return re.sub(r"\W", "_", plain, flags=re.ASCII)


def escaper(reserved: Collection[str], first: str = "_") -> Callable[[str], str]:
    """Return how a language escapes a name: `first` before a digit, `_` behind a reserved word."""

    def escaped(name: str) -> str:
        word = ascii_word(name)
        if not word or word[0].isdigit():
            word = first + word
        return word + "_" if word in reserved else word

    return escaped


class Taken:
    """The names given so far in one scope; the second of its kind gets a number.

    `fold` makes the form in which two names are compared: a language may know no case.
    """

    def __init__(self, escaped: Callable[[str], str], fold: Callable[[str], str] = str) -> None:
        self._escaped, self._fold = escaped, fold
        self._names: set[str] = set()

    def __call__(self, name: str) -> str:
        """Return a name that nobody else in this scope has."""
        word = start = self._escaped(name)
        number = 2
        while self._fold(word) in self._names:
            word = f"{start}_{number}"
            number += 1
        self._names.add(self._fold(word))
        return word
