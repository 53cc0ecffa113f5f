"""Mistakes that the user can correct: what is wrong in a file or an argument, and where."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from msgspec import Struct

MOST_PROBLEMS_SHOWN = 10


class Problem(Struct, frozen=True):
    """One mistake: its place, what was found there, what was expected, and its kind.

    `kind`: missing (nothing is there), surplus (something is there, nothing was expected), unknown (no such
    name or key), taken (the name is already used), file (it cannot be read), value (all else).
    """

    where: str
    found: str
    expected: str
    kind: str = "value"

    def __str__(self) -> str:
        return one_line(f"{self.where}: {self.message}")

    @property
    def message(self) -> str:
        """Return what is wrong, without the place."""
        return one_line(f"found {self.found}, expected {self.expected}")


class UserError(Exception):
    """One or more mistakes that the user can correct; shown as lines, never as a traceback."""

    def __init__(self, problems: Problem | Iterable[Problem]) -> None:
        self.problems: tuple[Problem, ...] = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(self.lines()))

    def __reduce__(self) -> tuple[type[UserError], tuple[tuple[Problem, ...]]]:
        # The default would pickle the text alone: another process needs the problems.
        return UserError, (self.problems,)

    def lines(self) -> list[str]:
        """Return one line for each problem, ten at most, then how many more there are."""
        lines = [str(problem) for problem in self.problems[:MOST_PROBLEMS_SHOWN]]
        more = len(self.problems) - MOST_PROBLEMS_SHOWN
        return [*lines, f"and {more} more"] if more > 0 else lines


def mistake(where: str, found: object, expected: str, kind: str = "value") -> UserError:
    return UserError(Problem(where, str(found), expected, kind))


def require(module: str, extra: str, where: str, found: str) -> Any:
    """Return a module of an optional extra; raise UserError if the extra is not installed."""
    try:
        return import_module(module)
    except ImportError:
        raise mistake(where, found, f"this package: pip install 'trcvtui[{extra}]'") from None


@contextmanager
def collect_problems(problems: list[Problem]) -> Iterator[None]:
    """Collect the problems of a UserError that the block raises, and continue after the block."""
    try:
        yield
    except UserError as wrong:
        problems += wrong.problems


@contextmanager
def raise_all_problems() -> Iterator[list[Problem]]:
    """Give a list for problems; after the block raise one UserError with all problems of the list."""
    problems: list[Problem] = []
    yield problems
    if problems:
        raise UserError(problems)


def one_line(text: str) -> str:
    """Return the text with each control character as an escape, so that a message stays one line."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)
