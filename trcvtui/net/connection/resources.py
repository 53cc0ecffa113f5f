"""The limited resources of one PLC: work in a scan, claims on a connection, IDs, jobs, buffers, connections.

Jobs, buffers and connections fail like kernel calls (`queue`, `buffer`, `budget`). A fault plan can make jobs
and buffers fail, but nothing else here.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from itertools import takewhile
from typing import Final

from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.connection.description_check import read_spec
from trcvtui.net.events import EventKind
from trcvtui.net.received_ring import ReceivedRings
from trcvtui.net.results import Fault
from trcvtui.wording import format_ns

# -- work: a scan has a fixed number of units for what partners send --------------------------------------
#
# A unit is about 5 us of one core: one TPDU, one TLS record; dearer work has a price in units. A quarter of
# the interval is for such work. A party is one layer of one CONNECT: its stream, or the clients at its port.
# Rule 1: a step begins only while its party has units left: a party exceeds its share by one step at most.
# Rule 2: parties that had to wait get equal shares of the next scan, reserved for them, and nothing more.
# Each other party takes at most half of the rest, so that none gets nothing because of its place.
# Rule 3: waiting bytes and clients stay where they are, in the stack if they can. A wait is reported once an
# episode, not once a scan.
# Rule 4: TLS handshakes have, besides units, a tenth of the interval by the clock, and one step at least.

NS_PER_UNIT: Final = 20_000  # of the interval: 5 us of work, a quarter of it
LEAST_UNITS: Final = 32  # units of a scan, however short
DEFAULT_INTERVAL_NS: Final = 10_000_000  # ns
LEAST_SHARE_UNITS: Final = 16  # units; if so many parties wait that shares would be smaller, they take turns
EPISODE_REST_NS: Final = 10_000_000_000  # ns without a wait, after which the next wait is a new episode
HANDSHAKE_DIVISOR: Final = 10  # the part of the interval for handshakes
FADE_SHIFT: Final = 6  # the longest step is forgotten by 1 / 2**FADE_SHIFT a scan

# Prices in units. A read is a system call and a copy of up to 64 KiB. A TLS client costs an object of the
# library, and its end, besides the accept.
READ_UNITS: Final = 2
ACCEPT_UNITS: Final = 16
TURN_AWAY_UNITS: Final = 16
BEGIN_TLS_UNITS: Final = 48
HANDSHAKE_UNITS: Final = 64

OVER_BUDGET_TEXT: Final = "more than one scan has time for; the rest waits for the next scans"

WaitReport = Callable[[str, EventKind, str, str], None]  # CONNECT, kind, the partner or "", text


def ignore_wait(owner: str, what: EventKind, partner: str, why: str) -> None:
    """Do nothing."""


class BudgetShare:
    """The share of one party. `what` is the kind of event that is reported when the party must wait."""

    def __init__(self, work: ScanBudget, owner: str, what: EventKind) -> None:
        self.work, self.owner, self.what = work, owner, what
        self._granted_in = -1  # scan
        self._left = 0

    @property
    def units_left(self) -> int:
        """Return how many units the party may still use in this scan; 0 or less: the party has to wait."""
        if self._granted_in != self.work.scan:
            self._granted_in, self._left = self.work.scan, self.work.grant(self)
        return self._left

    def spend(self, units: int) -> None:
        self._left = self.units_left - units
        self.work.count_spent(self, units)

    def note_waiting(self, partner: str = "", what: EventKind | None = None) -> None:
        """Note that the party waits, so that a later scan reserves a share for the party."""
        self.work.note_waiting(self, partner, what or self.what)


class ScanBudget:
    """The work of one PLC's scans. `clock` returns ns. A simulated clock does not move within a scan.

    Call begin_scan() once a scan. `report_wait` is called once for a series of waits or long handshakes.
    """

    def __init__(self, clock: Callable[[], int] = int, interval_ns: int = DEFAULT_INTERVAL_NS) -> None:
        self.clock = clock
        self.report_wait: WaitReport = ignore_wait
        self.scan = 0
        self.set_interval(interval_ns)
        self._now = 0
        self._waiting: dict[BudgetShare, None] = {}  # in the order in which they will get their shares
        self._reserved: dict[BudgetShare, int] = {}  # the shares of this scan
        self._rest = self.units
        self._episodes: dict[tuple[str, EventKind], int] = {}  # when it last had to wait; the oldest first
        self._handshake_ns = 0  # ns of handshakes in this scan
        self._steps = 0
        self._longest_step_ns = 0  # ns of a step, fading

    def set_interval(self, interval_ns: int) -> None:
        self._interval = interval_ns
        self.units = max(LEAST_UNITS, interval_ns // NS_PER_UNIT)

    def begin_scan(self, now: int) -> None:
        """Begin a scan: reserve shares for the parties that had to wait in the last scan."""
        self.scan += 1
        self._now = now
        self._handshake_ns = self._steps = 0
        self._longest_step_ns -= self._longest_step_ns >> FADE_SHIFT
        self._reserved.clear()
        self._rest = self.units
        if self._waiting:
            turn = list(self._waiting)[: max(1, self.units // LEAST_SHARE_UNITS - 1)]
            share = self.units // (len(turn) + 1)  # Rule 2; one share more is the rest for all others
            self._rest -= share * len(turn)
            for party in turn:
                del self._waiting[party]
                self._reserved[party] = share
        if self._episodes:
            for key in list(takewhile(self._has_episode_ended, self._episodes)):
                del self._episodes[key]

    def _has_episode_ended(self, key: tuple[str, EventKind]) -> bool:
        return self._now - self._episodes[key] >= EPISODE_REST_NS

    def grant(self, party: BudgetShare) -> int:
        share = self._reserved.get(party)
        return (self._rest + 1) // 2 if share is None else share

    def count_spent(self, party: BudgetShare, units: int) -> None:
        """Take units from the unreserved rest, unless the party has a reserved share."""
        if party not in self._reserved:
            self._rest = max(0, self._rest - units)

    def note_waiting(self, party: BudgetShare, partner: str, what: EventKind) -> None:
        """Reserve a share of a later scan for a party; report its wait if this is the first of a series."""
        self._waiting[party] = None
        self._report_once(party.owner, what, partner, OVER_BUDGET_TEXT)

    def _report_once(self, owner: str, what: EventKind, partner: str, why: str) -> None:
        if self._episodes.pop((owner, what), None) is None:  # Rule 3: else an attacker fills the ledger
            self.report_wait(owner, what, partner, why)
        self._episodes[owner, what] = self._now  # last again: the oldest are first

    # -- handshakes ------------------------------------------------------------------------------------

    def may_handshake(self) -> bool:
        """Return whether a handshake step may begin: there is time, or it is the first step of the scan."""
        # Rule 4: it is assumed to take as long as the longest so far.
        until = self._handshake_ns + self._longest_step_ns
        return not self._steps or until <= self._interval // HANDSHAKE_DIVISOR

    def run_handshake_step(self, party: BudgetShare, partner: str, step: Callable[[], int]) -> int:
        """Call one step of a handshake, and measure its time. Return the step's units of work."""
        began = self.clock()
        units = step()
        took = self.clock() - began
        self._steps += 1
        self._handshake_ns += took
        self._longest_step_ns = max(self._longest_step_ns, took)
        if took > self._interval // HANDSHAKE_DIVISOR:
            part, interval = format_ns(self._interval // HANDSHAKE_DIVISOR), format_ns(self._interval)
            why = f"one step took {format_ns(took)}; handshakes have {part} of the {interval} of a scan"
            self._report_once(party.owner, EventKind.LONG_HANDSHAKE, partner, why)
        return units


# -- claims: which instances use one direction of a connection; the lock behind "CONNECT in use" ------------
#
# Rule 1: a claim belongs to one instance; it is given back, or ends with the connection.
# Rule 2: a claim whose instance is gone is an orphan: it keeps others out, but no instance works under it.
# Rule 3: tasks of one priority see each other's claims. A task of another priority can interrupt between
# check and take, so each sees its own (manual 7.15.1 and 7.15.2, notes: such tasks must not share a CONNECT).


class Claim:
    """The claim of an instance at its task's `priority`. Claims with the priority None exclude each other.

    If `has_frame`, the job has read a whole frame, and shows the frame in its next call. With `is_refused`,
    the last call could start no job. A refused instance reads nothing, but keeps other instances out.
    """

    __slots__ = ("has_frame", "instance", "is_orphan", "is_refused", "priority")

    def __init__(self, instance: str, priority: int | None = None) -> None:
        self.instance = instance
        self.priority = priority
        self.is_orphan = self.has_frame = self.is_refused = False


class DirectionClaims:
    """The claims on one direction of one connection. `try_take` allows one claim of each priority."""

    def __init__(self) -> None:
        self._claims: list[Claim] = []

    def try_take(self, claim: Claim) -> Claim | None:
        for held in self._claims:
            if held is claim:
                return None
            if held.priority == claim.priority:  # Rule 3
                return held
        self._claims.append(claim)
        return None

    def hold(self, claim: Claim) -> None:
        """Add a claim, even beside a claim of the same priority. Several blocks may build a connection."""
        if claim not in self._claims:
            self._claims.append(claim)

    def find_other_priority(self, claim: Claim) -> Claim | None:
        return next((held for held in self._claims if held.priority != claim.priority), None)

    def give_back(self, claim: Claim) -> None:
        """End a claim, if this direction has it."""
        if claim in self._claims:
            self._claims.remove(claim)

    def release_instance(self, instance: str) -> None:
        """End every claim of an instance, even after the instance is gone."""
        self._claims = [held for held in self._claims if held.instance != instance]

    def is_used_by_others(self, claim: Claim | None) -> bool:
        """Return whether this direction has a claim besides this one; orphans do not count."""
        # Two refused claims do not count for each other: else each would wait for the other.
        only_at_work = self.holds_refused(claim)
        return any(
            held is not claim and not held.is_orphan and not (only_at_work and held.is_refused)
            for held in self._claims
        )

    def holds_refused(self, claim: Claim | None) -> bool:
        """Return whether this direction has the claim, and the claim is refused."""
        return claim is not None and claim.is_refused and claim in self._claims

    def has_frame(self) -> bool:
        """Return whether an instance has a whole frame that it has not shown yet."""
        return any(held.has_frame for held in self._claims)

    def is_barred(self, claim: Claim, waits: bool) -> bool:
        """Return whether an orphan keeps this claim out. If `waits` is False, refused claims do so, too."""
        return any(
            held.priority == claim.priority
            and held is not claim
            and (held.is_orphan or (not waits and held.is_refused))
            for held in self._claims
        )

    def holds(self, claim: Claim | None) -> bool:
        return claim in self._claims

    def owners(self) -> tuple[str, ...]:
        """Return the instances that hold a claim. ` (gone)` follows the name of an orphan."""
        return tuple([held.instance + " (gone)" * held.is_orphan for held in self._claims])

    def end_all(self) -> None:
        self._claims.clear()


# -- IDs: one connection for an ID, as long as its endpoint exists ------------------------------------------
#
# A connection without a description has no ID, and no conflicts.


class IdConflict(StrEnum):  # the connection that has the ID, compared with the one that asks for it
    BUILDING = "being built"  # the same description, not established yet
    SAME = "same description"
    OTHER = "other description"


class IdHolder:
    """One CONNECT with its ID. `has_been_up`: the CONNECT has been connected since it took this ID."""

    def __init__(self, config: ConnectConfig) -> None:
        self.name = config.name
        self.description = config.description
        self.identity = read_spec(config.description).identity if config.description is not None else 0
        self.has_been_up = False


class ConnectionIds:
    def __init__(self) -> None:
        self._holders: dict[int, IdHolder] = {}

    def try_take(self, asking: IdHolder) -> tuple[IdConflict, str] | None:
        if asking.description is None:
            return None
        held = self._holders.setdefault(asking.identity, asking)
        if held is asking:
            return None
        if held.description != asking.description:
            return IdConflict.OTHER, held.name
        return (IdConflict.SAME if held.has_been_up else IdConflict.BUILDING), held.name

    def give_back(self, holder: IdHolder) -> None:
        """Free the ID, if the holder has it."""
        holder.has_been_up = False
        if self._holders.get(holder.identity) is holder:
            del self._holders[holder.identity]


TakeFault = Callable[[str, str], Fault | None]


def no_faults(call: str, owner: str) -> Fault | None:
    return None


class JobQueue:
    """The queue of asynchronous functions (80AC): at most `capacity` jobs, emptied in each scan."""

    def __init__(self, capacity: int, take: TakeFault = no_faults) -> None:
        self.capacity = capacity
        self._take = take
        self._waiting = 0

    def put(self, owner: str) -> Fault | None:
        fault = self._take("queue", owner)
        if fault is not None:
            return fault
        if self._waiting >= self.capacity:
            return Fault("queue", "EAGAIN")
        self._waiting += 1
        return None

    def clear(self) -> None:
        """Empty the queue; called in the communication phase of each scan."""
        self._waiting = 0


class BufferPool:
    """The pool of receive and send buffers (80A7): one for each running job."""

    def __init__(self, count: int, take: TakeFault = no_faults) -> None:
        self.count = count
        self._take = take
        self.used = 0

    def acquire(self, owner: str) -> Fault | None:
        fault = self._take("buffer", owner)
        if fault is not None:
            return fault
        if self.is_full:
            return Fault("buffer", "ENOBUFS")
        self.used += 1
        return None

    @property
    def is_full(self) -> bool:
        return self.used >= self.count

    def release(self) -> None:
        self.used -= 1


class ConnectionBudget:
    """How many CONNECTs may hold sockets at once: T3 8, T4 32 (Baosky library manual 7.15.4)."""

    def __init__(self, limit: int) -> None:
        self.limit = limit
        self._holders: dict[str, None] = {}

    def acquire(self, owner: str) -> Fault | None:
        """Count a CONNECT; return a Fault if too many are in use."""
        if owner in self._holders:  # it is counted already
            return None
        if len(self._holders) >= self.limit:
            return Fault("budget", f"{self.limit} connections in use")
        self._holders[owner] = None
        return None

    def release(self, owner: str) -> None:
        self._holders.pop(owner, None)

    @property
    def used(self) -> int:
        return len(self._holders)


class Resources:
    """All resources of one PLC, and its received bytes. `unsettled` CONNECTs have unacknowledged bytes."""

    def __init__(
        self, queue: JobQueue, buffers: BufferPool, budget: ConnectionBudget, work: ScanBudget | None = None
    ) -> None:
        self.queue, self.buffers, self.budget = queue, buffers, budget
        self.work = work or ScanBudget()
        self.connection_ids = ConnectionIds()
        self.received = ReceivedRings()
        self.unsettled: dict[str, None] = {}
