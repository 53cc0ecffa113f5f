"""Small counters of each CONNECT, which remain when the ledger overwrites its lines.

Rule 1: a screen gets only some lines. The statistics read every line, but their size does not grow.
Rule 2: lines that are overwritten before they are read are missing here. Nothing is guessed.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Sequence
from typing import Any, Final

from msgspec.structs import replace

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.environment import ReceiveEnded
from trcvtui.blocks.outcome import Cause, CauseKind, cause_of_fault
from trcvtui.history.records import (
    SETUP_CALLS,
    ConnectFacts,
    DroppedClient,
    DroppedJob,
    FailedAttempt,
    FailureCount,
    LastLoss,
    RejectedClients,
    ScanStamp,
    Sizes,
)
from trcvtui.history.stream_index import ENDING_EVENTS, KEPT_SIZES, StreamIndex
from trcvtui.net.events import BytesReceived, ConnectionChanged, EventKind
from trcvtui.net.layers.layered_stream import CLIENT_DROPPED
from trcvtui.net.layers.layered_stream import SESSION_ENDED as SESSION_ENDED
from trcvtui.plc.ledger import BenchNote, Line, StatusEdge

MOST_FAILURES: Final = 8
IDLE_CONDITIONS: Final = frozenset({Condition.NOT_CALLED, Condition.NO_JOB})  # no connection is wanted

TURNED_AWAY_KEYS: Final = {EventKind.WRONG_PARTNER: "wrong_partner", EventKind.SECOND_CLIENT: "second_client"}


class _LinkFacts:
    def __init__(self) -> None:
        self.incarnation = 0
        self.up_since: ScanStamp | None = None
        self.down_since: ScanStamp | None = None
        self.failures: dict[tuple[str, str], FailureCount] = {}
        self.listening = ""  # where it listens, shared or not
        self.attempt: FailedAttempt | None = None
        self.dropped: DroppedClient | None = None
        self.said: DroppedClient | None = None  # of the handshake whose failed attempt is next
        self.turned: dict[str, RejectedClients] = {}
        self.loss: LastLoss | None = None
        self.losses = 0
        self.datagrams: _DatagramCounts | None = None  # where the CONFIG is one of UDP
        self.drop: DroppedJob | None = None

    def forget_failures(self) -> None:
        self.failures.clear()
        self.attempt = self.dropped = self.said = None

    def forget_setup_failures(self) -> None:
        for key in [key for key in self.failures if key[0] in SETUP_CALLS]:
            del self.failures[key]
        if self.attempt is not None and self.attempt.cause.call in SETUP_CALLS:
            self.attempt = None


class _DatagramCounts:
    """What one UDP socket has received: each recv call is one datagram."""

    def __init__(self, at: ScanStamp) -> None:
        self.open_since = at
        self.count = 0
        self.last: deque[int] = deque(maxlen=KEPT_SIZES)


class LinkStatistics:
    """Listens to the ledger after the index; `facts` returns the facts of one instance."""

    def __init__(self, index: StreamIndex) -> None:
        self._index = index
        self._links: defaultdict[str, _LinkFacts] = defaultdict(_LinkFacts)
        self._refusals: dict[str, StatusEdge] = {}  # the last ERROR of each instance
        self._busy: set[str] = set()  # the instances that are not idle
        self._has_datagrams = False
        self._busy_since: dict[str, ScanStamp] = {}  # since when each instance is busy
        index.ends[False].append(self._handle_job_end)
        index.subscribe(
            {ConnectionChanged: self._on_link, StatusEdge: self._on_edge, BenchNote: self._on_note}
        )

    # -- from the ledger --------------------------------------------------------------------------------

    def _count_datagram(self, seq: int, scan: int, t_ns: int, event: Sequence[Any]) -> None:
        link = self._links.get(event[0])
        if link is not None and link.datagrams is not None:
            link.datagrams.count += 1
            link.datagrams.last.append(event[4])

    def _handle_job_end(self, seq: int, scan: int, t_ns: int, event: ReceiveEnded) -> None:
        if not event.size:
            return
        link, started = self._links[event.connection], self._index.find_newest_job(event.instance)
        is_adhoc = started is not None and started.adhoc
        if is_adhoc or event.incarnation != link.incarnation or link.up_since is None:
            return  # with ADHOC any size is whole; an old connection cuts no message of this one
        end = event.offset + event.size
        need = started.size if started is not None else 0
        link.drop = DroppedJob(ScanStamp(scan, t_ns), event.instance, event.reason, event.size, need, end)

    def _on_link(self, seq: int, scan: int, t_ns: int, event: ConnectionChanged) -> None:
        link, at = self._links[event.connection], ScanStamp(scan, t_ns)
        if event.what is EventKind.CONNECTED:
            link.incarnation = event.incarnation
            link.up_since, link.down_since = at, None
            link.forget_failures()
            link.turned.clear()
            link.drop = None
        elif event.what in ENDING_EVENTS:
            self._note_end(link, at, event)
        elif event.what in (EventKind.ATTEMPT_FAILED, EventKind.ACCEPT_FAILED):
            self._note_failure(link, at, event)
        elif event.what in TURNED_AWAY_KEYS:
            before = link.turned.get(TURNED_AWAY_KEYS[event.what])
            count = before.count + 1 if before else 1
            link.turned[TURNED_AWAY_KEYS[event.what]] = RejectedClients(count, event.peer, at)
        elif event.what is EventKind.LISTENING:  # a new endpoint: after a lost partner the listener stays
            link.forget_failures()
            link.listening, link.down_since = event.local, at
            if event.detail == "UDP":
                link.datagrams, link.down_since = _DatagramCounts(at), None
                if not self._has_datagrams:
                    self._has_datagrams = True
                    self._index.subscribe({BytesReceived: self._count_datagram})
        elif event.what is EventKind.CONNECTING:
            link.down_since = link.down_since or at
            link.forget_setup_failures()

    def _note_end(self, link: _LinkFacts, at: ScanStamp, event: ConnectionChanged) -> None:
        if event.what in (EventKind.DISCONNECTED, EventKind.STOPPED):
            link.down_since, link.listening = None, ""
        if link.up_since is None:
            return  # an attempt was given up
        fault = event.fault
        up_ns = at.t_ns - link.up_since.t_ns
        error, injected = (fault.error, fault.injected) if fault else ("", False)
        link.loss = LastLoss(at, str(event.what), event.peer, error, injected, up_ns)
        link.losses += 1
        is_wanted = event.what not in (EventKind.DISCONNECTED, EventKind.STOPPED)
        link.up_since, link.down_since = None, at if is_wanted else None

    def _note_failure(self, link: _LinkFacts, at: ScanStamp, event: ConnectionChanged) -> None:
        link.down_since = link.down_since or at
        fault = event.fault
        key = (fault.call, fault.error) if fault else ("", str(event.what))
        before = link.failures.pop(key, None)
        if len(link.failures) >= MOST_FAILURES:  # Rule 1; the oldest goes
            del link.failures[next(iter(link.failures))]
        count = before.count + 1 if before else 1
        injected = fault.injected if fault else False
        link.failures[key] = FailureCount(*key, count, at, injected, event.peer)
        said, link.said = link.said, None
        if fault is None or fault.call != "session":
            said = None  # another call has failed
        peer = event.peer or (said.peer if said else "")
        cause = cause_of_fault(fault, peer) if fault else Cause(CauseKind.WAITING, str(event.what), peer=peer)
        link.attempt = FailedAttempt(at, replace(cause, detail=event.detail), said=said.why if said else "")
        link.dropped = None

    def _on_note(self, seq: int, scan: int, t_ns: int, event: BenchNote) -> None:
        link = self._links.get(event.subject)
        if link is None or event.what not in (CLIENT_DROPPED, SESSION_ENDED):
            return
        said = DroppedClient(ScanStamp(scan, t_ns), event.end, event.detail)
        if event.what == SESSION_ENDED:
            link.said = said
            return
        for one in self._links.values() if event.for_all else (link,):  # all that share the listener
            if one is link or (one.listening and one.listening == link.listening):
                one.said = one.dropped = said

    def _on_edge(self, seq: int, scan: int, t_ns: int, event: StatusEdge) -> None:
        if event.outputs.error:
            self._refusals[event.instance] = event
        if event.condition in IDLE_CONDITIONS:
            self._busy.discard(event.instance)
        elif event.instance not in self._busy:
            self._busy.add(event.instance)
            self._busy_since[event.instance] = ScanStamp(scan, t_ns)

    def forget_all(self, seq: int, scan: int, t_ns: int) -> None:
        """Forget everything: lines were overwritten before they were read."""
        self._links.clear()
        self._refusals.clear()
        self._busy.clear()
        self._busy_since.clear()

    # -- for the screen ---------------------------------------------------------------------------------

    def facts(self, instance: str, connect: str) -> ConnectFacts:
        link = self._links.get(connect)
        if link is None:
            return ConnectFacts()
        bursts, datagrams = self._index.get_bursts(connect), link.datagrams
        place, job, drop = (connect, link.incarnation), self._index.find_newest_job(instance), link.drop
        job = job if job is not None and job.link[1] == link.incarnation else None
        sender, messages = self._index.find_sender(place)
        after = self._index.find_message(place, drop.end) if drop is not None else None
        return ConnectFacts(
            sender=sender,
            messages=messages,
            begins_in=self._index.find_message(place, job.offset) if job is not None else None,
            job_offset=job.offset if job is not None else None,
            job_began=job.began if job is not None else None,
            job_adhoc=job is not None and job.adhoc,
            datagrams=Sizes(datagrams.count, tuple(datagrams.last)) if datagrams is not None else Sizes(),
            open_since=datagrams.open_since if datagrams is not None else None,
            bursts=bursts.sizes,
            longest_gap_ns=max(bursts.gaps, default=0),
            received=self._index.next_offset(connect, link.incarnation),
            drop=drop,
            drop_cuts=bool(after and after.first) if drop is not None and messages.count else None,
            after_drop=after,
            up_since=link.up_since,
            down_since=_choose_later(link.down_since, self._busy_since.get(instance)),
            attempt=self._make_attempt(link, instance),
            dropped=link.dropped,
            failures=tuple(link.failures.values()),
            wrong_partner=link.turned.get("wrong_partner"),
            second_client=link.turned.get("second_client"),
            loss=link.loss,
            losses=link.losses,
        )

    def _make_attempt(self, link: _LinkFacts, instance: str) -> FailedAttempt | None:
        attempt, shown = link.attempt, self._refusals.get(instance)
        if attempt is None or link.up_since is not None:
            return None
        if shown is None or (shown.cause.call, shown.cause.error) != (
            attempt.cause.call,
            attempt.cause.error,
        ):
            return attempt
        cause = replace(attempt.cause, peer=attempt.cause.peer or shown.cause.peer)
        return replace(attempt, cause=cause, status=shown.outputs.status, condition=shown.condition)


def past_facts(
    lines: Iterable[Line], line: Line, edge: StatusEdge, connect: str
) -> tuple[ConnectFacts, ScanStamp]:
    """Return the facts of the lines before the instance's next edge, and the last scan of these lines."""
    kept = list(lines)
    following = next((known for known in kept if known.seq > line.seq and _is_edge_of(known, edge)), None)
    shown = [k for k in kept if k.seq <= line.seq or (following is None or k.scan < following.scan)]
    index = StreamIndex()
    statistics = LinkStatistics(index)
    index.dispatch_events((known.scan, known.t_ns, known.event) for known in shown)
    last = shown[-1] if shown and shown[-1].seq > line.seq else line
    return statistics.facts(edge.instance, connect), ScanStamp(last.scan, last.t_ns)


def _choose_later(one: ScanStamp | None, other: ScanStamp | None) -> ScanStamp | None:
    return other if one is not None and other is not None and other.scan > one.scan else one


def _is_edge_of(line: Line, edge: StatusEdge) -> bool:
    return isinstance(line.event, StatusEdge) and line.event.instance == edge.instance
