"""An exception in one part of a run takes that part out of service; all others continue.

Rule 1: the journal records the exception. That entry alone makes a replay take the part out of service in
the same scan. The program need not raise there again.
Rule 2: a UserError of a command is raised again. So is any UserError of a replay: run and journal differ.
Rule 3: with TRCVTUI_EXCEPTIONS=raise nothing is contained, as in the tests.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Final, NamedTuple, TypeVar

from trcvtui.errors import UserError
from trcvtui.plc.ledger import BenchNote

T = TypeVar("T")
INTERNAL_ERROR: Final = "internal error, please report"
EXCEPTION: Final = "exception"  # the call of its entry in the journal
EXCEPTIONS_VARIABLE: Final = "TRCVTUI_EXCEPTIONS"  # of the environment
MOST_REPORTED: Final = 8  # messages until they are taken
COMMAND: Final = "command", "command"
RunPart = tuple[str, str]  # its kind and its name: ("instance", "TRCV_C_1")


class ExceptionNote(NamedTuple):
    """An exception and its report's name. If `in_connection`, a connection is in an unknown state."""

    why: str
    in_connection: bool


class RecordedException(UserError):
    """Raised in a replay where the recorded run had an exception; it is shown as a difference."""


class Containment:
    """The parts of one run that are out of service.

    `report` writes a report and returns its ExceptionNote. `record(part, report)` records and returns this
    note. `is_due(part)` returns whether the next entry of a replay is an exception of this part. Without a
    replay, `is_due` is None. `off_record` runs calls that a replay does not repeat.
    """

    def __init__(
        self,
        record: Callable[[RunPart, Callable[[], ExceptionNote]], ExceptionNote | None],
        report: Callable[[BaseException], ExceptionNote],
        write: Callable[[BenchNote], None],
        is_due: Callable[[RunPart], bool] | None,
        off_record: Callable[[Callable[[], object]], object],
    ) -> None:
        self.out: set[RunPart] = set()
        self.is_due = is_due
        self._newest: list[str] = []
        self._record, self._report, self._write, self._off_record = record, report, write, off_record
        self._raises = os.environ.get(EXCEPTIONS_VARIABLE) == "raise"

    def raise_recorded(self, part: RunPart) -> None:
        """Raise RecordedException if the journal says that this part has failed at this place."""
        if self.is_due is not None and self.is_due(part):
            raise RecordedException(())

    def record_error(self, part: RunPart, error: Exception) -> ExceptionNote:
        if not isinstance(error, RecordedException):
            is_users = isinstance(error, UserError) and (self.is_due is not None or part == COMMAND)
            if is_users or self._raises:  # rules 2 and 3
                raise error
        try:
            raised = self._record(part, lambda: self._report(error)) or self._report(error)
        except UserError as differs:  # the recorded run has not raised here
            raise differs from RuntimeError(self._report(error).why)
        self._write(BenchNote(part[1], INTERNAL_ERROR, raised[0]))
        self.add_message(f"{' '.join(part)}: {raised[0]}")
        return ExceptionNote(*raised)

    def add_message(self, what: str) -> None:
        """Store a message about an internal error, at most MOST_REPORTED until `take_messages`."""
        if len(self._newest) < MOST_REPORTED:
            self._newest.append(f"an internal error of {what}")

    def take_messages(self) -> str:
        """Return all messages since the last call in one line, or "" if there are none."""
        newest, self._newest = self._newest, []
        return "; ".join(newest)

    def clean_up(self, part: RunPart, do: Callable[[], object]) -> None:
        """Clean up after an exception; a recording does not have these calls."""
        self._off_record(lambda: self.attempt(part, do))

    def attempt(self, part: RunPart, do: Callable[[], T]) -> T | None:
        """Return what `do` returns, or None if it raises or the journal has an exception here (rule 1)."""
        try:
            self.raise_recorded(part)  # recorded before any call of `do`: it was not carried out
            answer = do()
            self.raise_recorded(part)
            return answer
        except Exception as error:
            self.record_error(part, error)
            self.out.add(part)
            return None

    def attempt_unless_out(self, part: RunPart, do: Callable[[], T]) -> T | None:
        return None if part in self.out else self.attempt(part, do)

    def restore_parts(self, *parts: RunPart) -> None:
        """Put these parts into service again."""
        self.out.difference_update(parts)
