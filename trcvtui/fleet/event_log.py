"""The newest events of one instance, each once, and how many are missing.

The id of an event is BOOT-SEQ. In each run of an agent (BOOT), SEQ counts from 1 without gaps. A skipped
number is missing until `recent` or a late message brings it. A run stores at most MOST_SEQS numbers. If
there are more, the lower half is dropped: numbers below the upper half are never new again.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterable
from typing import Final, NamedTuple

from trcvtui.fleet.topics import MOST_RECENT, EventMessage

MOST_RUNS: Final = 4  # of an agent; older ones only keep their number of missing events
MOST_SEQS: Final = 1024  # of a run


class KeptEvent(NamedTuple):
    t: float
    seq: int
    boot: str
    kind: str
    status: str
    title: str
    text: str
    file: str  # of the recording, on the machine of the agent
    scan: int | None


class _RunSeqs:
    """The received numbers of one run; a number before `first` never counts as missing."""

    def __init__(self, first: int) -> None:
        self._first, self._top = first, first - 1
        self._floor = 0  # this and all lower numbers count as received
        self._counted = 0  # received numbers from `first` on
        self._come: set[int] = set()

    def add(self, seq: int) -> bool:
        if seq <= self._floor or seq in self._come:
            return False
        self._come.add(seq)
        self._counted += seq >= self._first
        self._top = max(self._top, seq)
        if len(self._come) > MOST_SEQS:
            kept = sorted(self._come)[MOST_SEQS // 2 :]  # bounds the memory against a hostile agent
            self._floor, self._come = kept[0] - 1, set(kept)
        return True

    @property
    def missing(self) -> int:
        return self._top - self._first + 1 - self._counted


class EventLog:
    """The events of one instance. `kept` has the newest events in order of time."""

    def __init__(self) -> None:
        self.kept: list[KeptEvent] = []
        self._runs: dict[str, _RunSeqs] = {}
        self._lost = 0  # events missing in runs before the newest MOST_RUNS
        self._has_begun = False

    def count_from_one(self) -> None:
        """From now on a new run counts missing events from number 1, not from its first received event."""
        self._has_begun = True

    @property
    def missing(self) -> int:
        return self._lost + sum(run.missing for run in self._runs.values())

    def add_events(self, events: Iterable[EventMessage]) -> list[KeptEvent]:
        """Add events, given in order of time; return the new ones."""
        fresh = []
        for event in events:
            boot, _, number = event.id.partition("-")
            seq = int(number)
            run = self._runs.get(boot)
            if run is None:
                run = self._begin_run(boot, 1 if self._has_begun else seq)
            if not run.add(seq):
                continue
            kept = _make_kept_event(event, boot, seq)
            insort(self.kept, kept)
            fresh.append(kept)
        del self.kept[: max(0, len(self.kept) - MOST_RECENT)]
        return fresh

    def _begin_run(self, boot: str, first: int) -> _RunSeqs:
        if len(self._runs) >= MOST_RUNS:
            self._lost += self._runs.pop(next(iter(self._runs))).missing
        made = self._runs[boot] = _RunSeqs(first)
        return made


def _make_kept_event(event: EventMessage, boot: str, seq: int) -> KeptEvent:
    cause = event.cause
    text = str(cause.get("text") or cause.get("cause") or event.kind)
    names = (f"16#{event.status}" if event.status else "", cause.get("call"), cause.get("errno"))
    title = str(cause.get("cause") or " ".join(str(each) for each in names if each) or event.kind)
    peer = cause.get("peer")
    text = f"{text} ({peer})" if peer and str(peer) not in text else text
    scan = cause.get("scan")
    return KeptEvent(
        event.t, seq, boot, event.kind, event.status or "", title, text,
        str(cause.get("file") or ""), scan if isinstance(scan, int) else None,
    )  # fmt: skip
