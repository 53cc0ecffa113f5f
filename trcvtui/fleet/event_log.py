"""Events of one instance as a reader keeps them: the newest, each once, and how many are missing.

An event is BOOT-SEQ; in each run of an agent (BOOT) SEQ counts from 1 without gaps. What lies between two
numbers is missing until `recent` or a late message brings it.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterable
from typing import Final

from trcvtui.fleet.topics import MOST_RECENT, EventMessage
from trcvtui.records import NamedTuple

MOST_RUNS: Final = 4  # of an agent, that are told apart
MOST_GAPS: Final = 32  # of a run


class KeptEvent(NamedTuple):
    """One event, in the order of time."""

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
    """Which numbers of one run have come: all up to `top` but those in `gaps`, and those `before` we looked.

    `lost`: so many were in gaps without room.
    """

    __slots__ = ("before", "gaps", "lost", "top")

    def __init__(self, top: int) -> None:
        self.top = top
        self.before: list[tuple[int, int]] = [(1, top)] if top else []
        self.gaps: list[tuple[int, int]] = []
        self.lost = 0

    def take(self, seq: int) -> bool:
        if seq <= self.top:
            return _filled(self.gaps, seq) or _filled(self.before, seq)
        if seq > self.top + 1:
            self.gaps.append((self.top + 1, seq - 1))
        self.top = seq
        if len(self.gaps) > MOST_GAPS:
            low, high = self.gaps.pop(0)
            self.lost += high - low + 1
        return True

    @property
    def missing(self) -> int:
        return self.lost + sum(high - low + 1 for low, high in self.gaps)


def _filled(gaps: list[tuple[int, int]], seq: int) -> bool:
    for at, (low, high) in enumerate(gaps):
        if low <= seq <= high:
            left = [gap for gap in ((low, seq - 1), (seq + 1, high)) if gap[0] <= gap[1]]
            gaps[at : at + 1] = left if len(gaps) < MOST_GAPS else left[-1:]
            return True
    return False


class EventLog:
    """What is known of the events of one instance. `kept`: the newest, the oldest first."""

    __slots__ = ("_has_begun", "_lost", "_runs", "kept")

    def __init__(self) -> None:
        self.kept: list[KeptEvent] = []
        self._runs: dict[str, _RunSeqs] = {}
        self._lost = 0  # in runs that are no longer told apart
        self._has_begun = False

    def begin(self) -> None:
        """What came before we looked has come: from now on nothing may be missing, a new run begins at 1."""
        self._has_begun = True

    @property
    def missing(self) -> int:
        """Return how many events there were that have not come."""
        return self._lost + sum(run.missing for run in self._runs.values())

    def take(self, events: Iterable[EventMessage], most: int = MOST_RECENT) -> list[KeptEvent]:
        """Take events, the oldest first; return those that are new."""
        fresh = []
        for event in events:
            boot, _, number = event.id.partition("-")
            seq = int(number)
            run = self._runs.get(boot)
            if run is None:
                run = self._begin_run(boot, 0 if self._has_begun else seq - 1)
            if not run.take(seq):
                continue
            kept = _kept(event, boot, seq)
            insort(self.kept, kept)
            fresh.append(kept)
        del self.kept[: max(0, len(self.kept) - most)]
        return fresh

    def _begin_run(self, boot: str, top: int) -> _RunSeqs:
        if len(self._runs) >= MOST_RUNS:
            self._lost += self._runs.pop(next(iter(self._runs))).missing
        made = self._runs[boot] = _RunSeqs(top)
        return made


def _kept(event: EventMessage, boot: str, seq: int) -> KeptEvent:
    cause = event.cause
    text = str(cause.get("text") or cause.get("cause") or event.kind)
    names = (f"16#{event.status}" if event.status else "", cause.get("call"), cause.get("errno"))
    title = str(cause.get("cause") or " ".join(str(each) for each in names if each) or event.kind)
    peer = cause.get("peer")
    told = f"{text} ({peer})" if peer and str(peer) not in text else text
    scan = cause.get("scan")
    return KeptEvent(
        event.t, seq, boot, event.kind, event.status or "", title, told,
        str(cause.get("file") or ""), scan if isinstance(scan, int) else None,
    )  # fmt: skip
