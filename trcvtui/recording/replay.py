"""A seam that answers from a journal: it compares each call of a bench with the recorded one.

Rule: a difference raises an error that names scan, owner and call.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Final, NoReturn, TypeVar, cast

from trcvtui.errors import UserError, mistake
from trcvtui.files import FilesRead
from trcvtui.net.kernel import Handle
from trcvtui.net.results import Fault
from trcvtui.plc.containment import EXCEPTION, INTERNAL_ERROR, RecordedException, RunPart
from trcvtui.plc.ledger import BenchNote
from trcvtui.recording.journal import (
    ENDED_HERE,
    FILE_READ,
    IN_GAP,
    STEP,
    CallRecord,
    Entry,
    LedgerNote,
    LostEntries,
    NonJournalEntry,
    RunHeader,
)

T = TypeVar("T")
ADDED_CALL: Final = "set_broadcast"  # older versions did not make it: they had no broadcasts
COMPARED_ARGS: Final = {"set_options": 1, "set_user_timeout": 1}  # so many; later ones change with defaults


class ReplaySeam:
    """Answers from entries that passed is_valid_answer. `write_note` writes recorded notes into the ledger.

    `begins` is the RunHeader of the journal, if there is one. `files` has the files known so far.
    """

    has_answers = True
    is_busy = True
    is_off = False

    def __init__(self, entries: Iterator[Entry], where: str) -> None:
        self.entries = entries
        self.where = where
        self.scan = self._now = 0
        self.write_note: Callable[[LedgerNote], None] = _drop_note
        self._known: dict[tuple[str, str, tuple[object, ...]], object] = {}  # answers of gaps
        self.front = next(entries, None)  # None: the journal is at its end
        self.begins: RunHeader | None = None
        self.files = FilesRead()
        if isinstance(self.front, RunHeader):
            self.begins = self.front
            self.files = FilesRead(self.begins.folder, self.begins.files, self.begins.digests)
            self.front = next(entries, None)

    def __getstate__(self) -> dict[str, object]:
        """Return the state for a keyframe, without file name and entries: a keyframe has the position."""
        return self.__dict__ | {"entries": None, "where": ""}

    def ask(self, owner: str, call: str, args: tuple[object, ...], do: Callable[[], T]) -> T:
        """Return the recorded answer; raise UserError if the record has another call here."""
        if not self.is_busy:
            return cast(T, self._answer_in_gap(owner, call, args))
        if call == STEP:
            self.scan += 1
        entry = self.front
        if type(entry) is not CallRecord or entry[1] != call or entry[0] != owner or entry[2] != args:
            coming = self.peek_call() if call == ADDED_CALL else None
            if call == ADDED_CALL and (coming is None or coming.call != ADDED_CALL):
                return cast(T, Fault(ADDED_CALL, "ENOSYS"))
            entry = self._find_entry(owner, call, args)
        answer = entry[3]
        if call == STEP:
            if cast(int, answer) < self._now:  # of a changed file
                raise self._make_error(_describe_call(owner, call, args), "a time that does not go back")
            self._now = cast(int, answer)
        self.front = next(self.entries, None)
        return cast(T, answer)

    def bind_call(
        self, name: str, do: Callable[..., T] | None, owners: Mapping[Handle, str], label: str
    ) -> Callable[..., T]:
        """Return a function that answers this call: from the next entry if it fits, else by `ask`."""
        nothing = cast(Callable[[], T], None)

        def answer_call(handle: Handle, *args: object) -> T:
            owner, given, entry = owners.get(handle, label), (handle, *args), self.front
            if (
                not self.is_busy
                or type(entry) is not CallRecord
                or entry[1] != name
                or entry[0] != owner
                or entry[2] != given
            ):
                return self.ask(owner, name, given, nothing)
            self.front = next(self.entries, None)
            return cast(T, entry[3])

        return answer_call

    def _find_entry(self, owner: str, call: str, args: tuple[object, ...]) -> CallRecord:
        """Skip notes and gaps, and return the entry of this call. Raise UserError if another entry is next.

        If the recorded run had an exception at this call, raise RecordedException.
        """
        entry = self.front
        while not isinstance(entry, CallRecord) or entry.call.startswith(IN_GAP):
            if entry is None or isinstance(entry, RunHeader | LostEntries):
                self._raise_difference(entry, _describe_call(owner, call, args))
            self._skip_entry(entry)
            entry = self.front
        if entry.call == EXCEPTION != call:
            was = f"an internal error of {entry.owner}, which was recorded"
            raise RecordedException(self._make_error(_describe_call(owner, call, args), was).problems)
        most = COMPARED_ARGS.get(call)
        if entry[:2] != (owner, call) or entry.args[:most] != args[:most]:
            self._raise_difference(entry, _describe_call(owner, call, args))
        return entry

    def _skip_entry(self, entry: CallRecord | LedgerNote | NonJournalEntry) -> None:
        self.front = next(self.entries, None)
        if isinstance(entry, NonJournalEntry):
            return
        if not isinstance(entry, CallRecord):
            self.write_note(entry)
            return
        owner, call, args, answer = entry
        if call == FILE_READ:
            self.files.store(cast(str, args[0]), cast(bytes | str, answer))
        elif call == IN_GAP + EXCEPTION:
            self.write_note(BenchNote(owner, INTERNAL_ERROR, cast(tuple[str, bool], answer)[0]))
        elif call == IN_GAP + "path" and [*map(type, args)] == [int]:  # a screen asks it at any time
            self._known[owner, "path", args] = answer

    def _answer_in_gap(self, owner: str, call: str, args: tuple[object, ...]) -> object:
        """Return the answer from this gap, else the newest answer from an earlier gap, else None."""
        while isinstance(self.front, CallRecord) and self.front.call.startswith(IN_GAP):
            found = self.front[:3] == (owner, IN_GAP + call, args)
            self._skip_entry(self.front)
            if found:
                break
        return self._known.get((owner, call, args))

    def fails_next(self, part: RunPart) -> bool:
        return type(self.front) is CallRecord and self.front[:3] == (part[1], EXCEPTION, part[:1])

    def handle_ledger_note(self, note: LedgerNote) -> None:
        """Do nothing: a replay keeps no notes."""

    def note_call(
        self, owner: str, call: str, handle: int, args: tuple[object, ...], answer: object, data: bytes
    ) -> None:
        """Do nothing: a replay has no wire."""

    def peek_call(self) -> CallRecord | None:
        """Return the next call that is not in a gap, or None if the journal ends or lacks entries here."""
        while (entry := self.front) is not None and not isinstance(entry, RunHeader | LostEntries):
            if isinstance(entry, CallRecord) and not entry.call.startswith(IN_GAP):
                return entry
            self._skip_entry(entry)
        return None

    @property
    def gap_text(self) -> str:
        """Return which entries are missing here; the text is empty if none are missing."""
        return str(self.front) if isinstance(self.front, LostEntries) else ""

    @property
    def has_lost_entries(self) -> bool:
        """Return whether entries before the next one were not recorded."""
        return isinstance(self.front, LostEntries) and self.front.number > 0

    @property
    def is_ended(self) -> bool:
        """Return whether the recording was ended here while the run continued."""
        return isinstance(self.front, LostEntries) and self.front.why == ENDED_HERE

    def count_scans_left(self) -> int:
        """Return how many scans after a gap cannot run. This reads all entries that are left."""
        return sum([type(entry) is CallRecord and entry.call == STEP for entry in self.entries])

    def check_end(self) -> None:
        entry = self.peek_call() or self.front
        if entry is not None:
            self._raise_difference(entry, "nothing more")

    def _raise_difference(self, recorded: Entry | None, now: str) -> NoReturn:
        match recorded:
            case CallRecord():
                was = f"{_describe_call(*recorded[:3])}, which was recorded"
            case LostEntries(number, why):
                was = f"{number} entries that were not recorded: {why}"
            case _:
                was = "the end of the journal, which was recorded"
        raise self._make_error(now, was)

    def _make_error(self, now: str, was: str) -> UserError:
        return mistake(f"{self.where}: scan {self.scan}", now, was)


def make_early_end_error(where: str, lost: str, scan: int, left: int = 0) -> UserError:
    """Return the error of a journal that ends before its run, or has a gap. `left` scans follow the gap."""
    # Keyframes are made from the journal: after a gap there are none.
    more = f" (later scans that cannot run again: {left})" if left else ""
    return mistake(
        where, f"{lost or 'the end of the journal'} after {scan} scans{more}", "the end of the run"
    )


def _drop_note(note: LedgerNote) -> None:
    """Do nothing: the bench has no ledger yet."""


def _describe_call(owner: str, call: str, args: tuple[object, ...]) -> str:
    return f"{call} {_format_args(args)} of {owner}"


def _format_args(args: tuple[object, ...]) -> str:
    return "(" + ", ".join(str(each) for each in args)[:200] + ")"
