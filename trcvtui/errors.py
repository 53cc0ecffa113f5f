"""What the user can mend: a mistake in a file or an argument, and where it stands."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from msgspec import Struct

MOST_PROBLEMS_SHOWN = 10


class Problem(Struct, frozen=True):
    """One mistake: where it stands, what was found there, what was expected, and of which kind it is.

    `kind`: missing (nothing stands there), surplus (nothing should), unknown (no such name or key), taken
    (another has that name), file (it cannot be read); value: all else.
    """

    where: str
    found: str
    expected: str
    kind: str = "value"

    def __str__(self) -> str:
        return one_line(f"{self.where}: {self.message}")

    @property
    def message(self) -> str:
        """Return what is wrong, without where."""
        return one_line(f"found {self.found}, expected {self.expected}")


class UserError(Exception):
    """A mistake the user can mend; carries one or more problems, never a traceback."""

    def __init__(self, problems: Problem | Iterable[Problem]) -> None:
        self.problems: tuple[Problem, ...] = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(self.lines()))

    def __reduce__(self) -> tuple[type[UserError], tuple[tuple[Problem, ...]]]:
        """Let it cross to another process with its problems."""
        return UserError, (self.problems,)

    def lines(self) -> list[str]:
        """Return one line a problem, ten at most, and how many more there are."""
        lines = [str(problem) for problem in self.problems[:MOST_PROBLEMS_SHOWN]]
        more = len(self.problems) - MOST_PROBLEMS_SHOWN
        return [*lines, f"and {more} more"] if more > 0 else lines


def mistake(where: str, found: object, expected: str, kind: str = "value") -> UserError:
    return UserError(Problem(where, str(found), expected, kind))


def require(module: str, extra: str, where: str, found: str) -> Any:
    """Return a module of an extra; raise UserError where that is not installed."""
    try:
        return import_module(module)
    except ImportError:
        raise mistake(where, found, f"it: pip install 'trcvtui[{extra}]'") from None


@contextmanager
def collect_problems(problems: list[Problem]) -> Iterator[None]:
    """Note what is wrong and go on; what is read inside is given to a name there, never returned."""
    try:
        yield
    except UserError as wrong:
        problems += wrong.problems


@contextmanager
def raise_all_problems() -> Iterator[list[Problem]]:
    """Give a list for problems; raise UserError with all that are in it at the end."""
    problems: list[Problem] = []
    yield problems
    if problems:
        raise UserError(problems)


def one_line(text: str) -> str:
    """Return text with every control character made visible, so that a message stays one line."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)
