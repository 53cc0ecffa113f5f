"""An exception in one part of a run takes that part out of service; all others go on.

Rule 1: the exception is an entry of the journal. A replay takes the part out of service in that scan because
the entry says so, whether or not the program still raises there.
Rule 2: the UserError of a replay is passed on, for it says where run and journal differ; so is a command's.
Rule 3: with TRCVTUI_EXCEPTIONS=raise nothing is contained: the tests run so.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Final, TypeVar

from trcvtui.errors import UserError
from trcvtui.plc.ledger import BenchNote

T = TypeVar("T")
INTERNAL_ERROR: Final = "internal error, please report"
EXCEPTION: Final = "exception"  # the call of its entry in the journal
RAISES: Final = "TRCVTUI_EXCEPTIONS"  # of the environment
COMMAND: Final = "command", "command"
Part = tuple[str, str]  # its kind and its name: ("instance", "TRCV_C_1")


class RecordedException(UserError):
    """An exception of the recorded run, at its place in the replay; it reads as a difference."""


class Containment:
    """The parts of one run that are out of service.

    `record(part, report)` keeps the exception and returns what it says; `is_due(part)`: a replay has one of
    this part next, None: no replay. `report` writes a report; it returns the error and the report's name.
    """

    def __init__(
        self,
        record: Callable[[Part, Callable[[], str]], str | None],
        report: Callable[[BaseException], str],
        tell: Callable[[BenchNote], None],
        is_due: Callable[[Part], bool] | None,
    ) -> None:
        self.out: set[Part] = set()
        self.is_due = is_due
        self._newest = ""
        self._record, self._report, self._tell = record, report, tell
        self._raises = os.environ.get(RAISES) == "raise"

    def check(self, part: Part) -> None:
        """Raise RecordedException where the journal says that this part has failed here."""
        if self.is_due is not None and self.is_due(part):
            raise RecordedException(())

    def note(self, part: Part, error: Exception) -> str:
        """Keep an exception and tell the ledger; return it in words."""
        if not isinstance(error, RecordedException):
            is_users = isinstance(error, UserError) and (self.is_due is not None or part == COMMAND)
            if is_users or self._raises:
                raise error
        why = self._record(part, lambda: self._report(error)) or self._report(error)
        self._tell(BenchNote(part[1], INTERNAL_ERROR, why))
        self._newest = f"an internal error of {' '.join(part)}: {why}"
        return why

    def take_newest(self) -> str:
        """Return what was noted last since this was asked, of whichever part; "" for nothing."""
        newest, self._newest = self._newest, ""
        return newest

    def attempt(self, part: Part, do: Callable[[], T]) -> T | None:
        """Do it and return what it answers; None where it has raised, or is recorded to have."""
        try:
            answer = do()
            self.check(part)
            return answer
        except Exception as error:
            self.note(part, error)
            self.out.add(part)
            return None

    def serve(self, part: Part, do: Callable[[], T]) -> T | None:
        return None if part in self.out else self.attempt(part, do)

    def forget(self, *parts: Part) -> None:
        """Put these parts into service again."""
        self.out.difference_update(parts)
