"""Virtual time of the simulated network: its timer queue, and the two timers that can end a TCP connection.

The waits and limits were measured on Linux; all times are in ns.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from enum import Enum
from typing import Final

MS: Final = 1_000_000
SECOND: Final = 1000 * MS

KEEP_ALIVE_PROBES: Final = 2
# A lost tail is probed after 0.2 s; the retransmission timer proper follows at 0.42 s and then doubles.
FIRST_RETRY_WAITS: Final = (200 * MS, 220 * MS)
LONGEST_WAIT: Final = 120 * SECOND
MOST_UNANSWERED: Final = 16  # the tail probe and tcp_retries2 = 15
# tcp_syn_linear_timeouts = 4 and tcp_syn_retries = 6: 134 s in all.
SYN_WAITS: Final = (1024 * MS,) * 5 + tuple(1024 * MS << n for n in range(1, 7))


class Ticket:
    """One timer of the queue; `act` is None once the timer was called or cancelled."""

    __slots__ = ("act",)

    def __init__(self, act: Callable[[], None]) -> None:
        self.act: Callable[[], None] | None = act


class TimerQueue:
    """Timers by time; timers with the same time are in the order in which they were added."""

    def __init__(self) -> None:
        self.now = 0
        self._heap: list[tuple[int, int, Ticket]] = []
        self._entered = 0
        self._cancelled = 0

    def call_at(self, due: int, act: Callable[[], None]) -> Ticket:
        ticket = Ticket(act)
        self._entered += 1
        heapq.heappush(self._heap, (due, self._entered, ticket))
        return ticket

    def cancel(self, ticket: Ticket | None) -> None:
        if ticket is None or ticket.act is None:
            return
        ticket.act = None
        self._cancelled += 1
        # A heap cannot drop an entry cheaply: only when most of them are cancelled it is made anew.
        if self._cancelled > 64 and self._cancelled > len(self._heap) // 2:
            self._heap = [entry for entry in self._heap if entry[2].act is not None]
            heapq.heapify(self._heap)
            self._cancelled = 0

    def run_until(self, now: int) -> None:
        """Call each timer that is due up to `now`. During a call `self.now` is the timer's due time."""
        while self._heap and self._heap[0][0] <= now:
            due, _, ticket = heapq.heappop(self._heap)
            act, ticket.act = ticket.act, None
            if act is None:
                self._cancelled -= 1
            else:
                self.now = max(self.now, due)
                act()
        self.now = now

    @property
    def next_due(self) -> int | None:
        """Return the time of the next timer, None if there is none."""
        while self._heap and self._heap[0][2].act is None:
            heapq.heappop(self._heap)
            self._cancelled -= 1
        return self._heap[0][0] if self._heap else None


class TimerVerdict(Enum):
    """What to do when a timer is due."""

    WAIT = "wait"
    ASK = "ask"  # send a probe, or the data again
    DEAD = "dead"


class KeepAliveTimer:
    """Keep-alive, idle = interval = I, 2 probes. A connection is dead 3 x I after the last packet came."""

    __slots__ = ("_asked_at", "_probes", "due", "interval")

    def __init__(self, interval: int, heard: int) -> None:
        self.interval = interval
        self.due = heard + interval
        self._probes = 0
        self._asked_at = 0

    def decide_at_due(self, now: int, heard: int, busy: bool, user_timeout: int) -> TimerVerdict:
        """Return what to do, and set the next `due`. `busy` means that data is unsent or unacknowledged."""
        silent = now - heard
        if heard >= self._asked_at:  # the last probe was answered
            self._probes = 0
        self.due = now + self.interval
        if busy:  # Linux sends no keep-alive probe then: retransmission decides
            return TimerVerdict.WAIT
        if silent < self.interval:
            self.due = heard + self.interval
            return TimerVerdict.WAIT
        # A user timeout replaces the probe count (tcp_keepalive_timer), and can make the time longer, too.
        if silent >= user_timeout and self._probes > 0 if user_timeout else self._probes >= KEEP_ALIVE_PROBES:
            return TimerVerdict.DEAD
        self._probes += 1
        self._asked_at = now
        return TimerVerdict.ASK


class RetryTimer:
    """Retransmission and window probes with growing waits, until the user timeout or 16 tries in vain."""

    __slots__ = ("_since", "_tries", "_unanswered", "due")

    def __init__(self) -> None:
        self.due: int | None = None
        self.stop()

    def stop(self) -> None:
        self.due = None
        self._since: int | None = None
        self._tries = 0
        self._unanswered = 0

    def start(self, now: int) -> None:
        """Start to wait for an acknowledgement or an open window."""
        self.stop()
        self.due = now + FIRST_RETRY_WAITS[0]

    def note_answer(self) -> None:
        self._unanswered = 0  # a zero window that is confirmed can last for ever (RFC 9293 3.8.6.1)

    def decide_at_due(self, now: int, probing: bool, user_timeout: int, longest: int) -> TimerVerdict:
        """Return what to do, and set the next `due`. `probing` means zero window and nothing in flight."""
        if self._since is None and (probing or self._tries > 0):  # the tail probe does not start the limit
            self._since = now
        if self._is_exhausted(now, user_timeout):
            return TimerVerdict.DEAD
        self._tries += 1
        self._unanswered += 1
        self.due = now + self._next_wait(longest)
        if user_timeout and self._since is not None:
            self.due = min(self.due, self._since + user_timeout)
        return TimerVerdict.ASK

    def _is_exhausted(self, now: int, user_timeout: int) -> bool:
        if user_timeout:
            return self._since is not None and now - self._since >= user_timeout
        return self._unanswered >= MOST_UNANSWERED

    def _next_wait(self, longest: int) -> int:
        if self._tries < len(FIRST_RETRY_WAITS):
            return FIRST_RETRY_WAITS[self._tries]
        doublings = min(self._tries - len(FIRST_RETRY_WAITS) + 1, 10)
        return min(FIRST_RETRY_WAITS[-1] << doublings, longest)
