"""How much one scan does for partners: whatever they send, a scan has so many units of work, and no more.

A unit is about 5 us of one core: one TPDU, one TLS record; what costs more has a price. A quarter of the
interval is for such work. A party is one layer of one CONNECT: its stream, or the clients at its port.
Rule 1: a step is begun while its party has units left, so that a party oversteps by one step at most.
Rule 2: who had to wait gets an equal share in the next scan, put by for it, and nothing beside; all others
take from what is left over, at most half of the rest each: nobody comes to nothing because of his place.
Rule 3: what waits stays where it is, in the stack if it can. It is told once an episode, not once a scan.
Rule 4: TLS handshakes have, beside their units, a tenth of the interval by the clock, and one step at least.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.net.events import What

NS_A_UNIT: Final = 20_000  # of the interval
FEWEST: Final = 32  # units of a scan, however short
USUAL_INTERVAL: Final = 10_000_000  # ns
LEAST_SHARE: Final = 16  # units; where that many parties wait that nobody would get so much, they take turns
EPISODE_REST: Final = 10_000_000_000  # ns: who has not had to wait for so long, begins a new episode
HANDSHAKE_PART: Final = 10  # one part of the interval in so many
FADES: Final = 6  # the longest step is forgotten by 1 / 2**FADES a scan

# Prices in units. A read costs a system call and a copy of up to 64 KiB; with TLS a client costs an object of
# the library and its end beside the accept.
READ: Final = 2
ACCEPT: Final = 16
TURN_AWAY: Final = 16
BEGIN_TLS: Final = 48
HANDSHAKE: Final = 64

MORE_THAN_ITS_PART: Final = "more than one scan has time for; the rest waits for the next scans"

Said = Callable[[str, What, str, str], None]  # CONNECT, what, the partner or "", in words


def nobody_hears(owner: str, what: What, partner: str, why: str) -> None:
    """Say it to nobody."""


def no_clock() -> int:
    """Return 0: work costs no time where nobody measures it."""
    return 0


class Party:
    """One layer of one CONNECT. `what` is said of it when it has to wait."""

    def __init__(self, work: Work, owner: str, what: What) -> None:
        self.work = work
        self.owner = owner
        self.what = what
        self._granted_in = -1
        self._left = 0

    @property
    def left(self) -> int:
        """Return how many units it may still use in this scan; 0 or less: it has to wait."""
        if self._granted_in != self.work.scan:
            self._granted_in, self._left = self.work.scan, self.work.grant(self)
        return self._left

    def spend(self, units: int) -> None:
        """Note work that was done."""
        self._left = self.left - units
        self.work.spent(self, units)

    def wait(self, partner: str = "", what: What | None = None) -> None:
        """Note that something waits for the next scan: its share is put by."""
        self.work.wait(self, partner, what or self.what)


class Work:
    """The work of one PLC's scans. `clock` gives ns; a simulated one stands still within a scan.

    `said` hears when something has to wait, once an episode; begin() once a scan.
    """

    def __init__(self, clock: Callable[[], int] = no_clock, interval_ns: int = USUAL_INTERVAL) -> None:
        self.clock = clock
        self.said: Said = nobody_hears
        self.scan = 0
        self.set_interval(interval_ns)
        self._now = 0
        self._waiting: dict[Party, None] = {}  # in the order in which they will get their shares
        self._put_by: dict[Party, int] = {}
        self._rest = self._units
        self._episodes: dict[tuple[str, What], int] = {}  # when it last had to wait
        self._shaken = 0  # ns of handshakes in this scan
        self._steps = 0
        self._longest = 0  # ns of a step, fading

    def set_interval(self, interval_ns: int) -> None:
        """Take the interval of the fastest task."""
        self._interval = interval_ns
        self._units = max(FEWEST, interval_ns // NS_A_UNIT)

    @property
    def units(self) -> int:
        """Return the units of one scan."""
        return self._units

    def begin(self, now: int) -> None:
        """Begin a scan: put by the shares of those who had to wait in the last one."""
        self.scan += 1
        self._now = now
        self._shaken = self._steps = 0
        self._longest -= self._longest >> FADES
        self._put_by.clear()
        self._rest = self._units
        if self._waiting:
            turn = list(self._waiting)[: max(1, self._units // LEAST_SHARE - 1)]
            share = self._units // (len(turn) + 1)
            self._rest -= share * len(turn)
            for party in turn:
                del self._waiting[party]
                self._put_by[party] = share
        if self._episodes:
            over = [who for who, last in self._episodes.items() if now - last >= EPISODE_REST]
            for who in over:
                del self._episodes[who]

    def grant(self, party: Party) -> int:
        """Return what a party has in this scan."""
        share = self._put_by.get(party)
        return (self._rest + 1) // 2 if share is None else share

    def spent(self, party: Party, units: int) -> None:
        """Take units from what is left over, unless the party has a share of its own."""
        if party not in self._put_by:
            self._rest = max(0, self._rest - units)

    def wait(self, party: Party, partner: str, what: What) -> None:
        """Keep a share of the next scan for a party; say so when an episode begins."""
        self._waiting[party] = None
        self._say(party.owner, what, partner, MORE_THAN_ITS_PART)

    def _say(self, owner: str, what: What, partner: str, why: str) -> None:
        if (owner, what) not in self._episodes:
            self.said(owner, what, partner, why)
        self._episodes[owner, what] = self._now

    # -- handshakes ------------------------------------------------------------------------------------

    def may_shake(self) -> bool:
        """Return whether the next step of a handshake fits into the tenth, or is the first of the scan."""
        return not self._steps or self._shaken + self._longest <= self._interval // HANDSHAKE_PART

    def shake(self, party: Party, partner: str, step: Callable[[], int]) -> int:
        """Take one step of a handshake by the clock; return what `step` returns, its units."""
        began = self.clock()
        units = step()
        took = self.clock() - began
        self._steps += 1
        self._shaken += took
        self._longest = max(self._longest, took)
        if took > self._interval // HANDSHAKE_PART:
            part, interval = _ms(self._interval // HANDSHAKE_PART), _ms(self._interval)
            why = f"one step took {_ms(took)} ms; handshakes have {part} of the {interval} ms of a scan"
            self._say(party.owner, What.LONG_HANDSHAKE, partner, why)
        return units


def _ms(ns: int) -> str:
    return f"{ns / 1_000_000:.2g}" if ns < 100_000_000 else str(ns // 1_000_000)
