"""What `trcvtui fleet` hears: subscribes step by step, hands messages to the fleet, tells what it refuses.

Rule 1: a broker drops what it cannot send at once (Mosquitto: past 1000 messages). So the states of all
agents are asked for first, then, agent by agent, what else is retained, a few at a time; past events last.
Rule 2: what waits of a retained topic is its newest message alone; memory and time of a turn are bounded.
"""

from __future__ import annotations

from collections import deque
from fnmatch import fnmatchcase
from typing import Final

from trcvtui import clock
from trcvtui.errors import UserError
from trcvtui.fleet.broker import (
    BrokerConnection,
    Connected,
    IncomingMessage,
    Lost,
    Subscribed,
    SubscriptionRefused,
)
from trcvtui.fleet.seen_fleet import FleetAgent, SeenFleet
from trcvtui.fleet.topics import ROOT, StateMessage, Topic, encoded, read, topic_of

NS: Final = 1_000_000_000
AT_ONCE: Final = 8  # subscriptions that the broker has not taken yet
MOST_WAITING: Final = 100_000  # messages, and bytes of them, that were not looked at yet
MOST_WAITING_BYTES: Final = 1 << 26
BUSY: Final = 5_000  # with so many waiting nothing more is asked for
SETTLED_NS: Final = 2 * NS  # after the last subscription: what is retained has come
MISS_NS: Final = 15 * NS  # after the broker came back: who has not come back, too, is offline
AGAIN_NS: Final = 30 * NS  # between two looks for agents of whom something is lacking
MOST_AGAIN: Final = 3  # times that an agent is asked for again: the broker may not have more
MOST_TOPICS: Final = 300_000  # that are known by heart
TOO_MANY: Final = "more messages come than can be looked at"
TELL_NS: Final = NS  # between two lines on what was refused
# What is asked for of each agent, with its QoS: a retained topic comes again by itself, an event does not.
FIRST: Final = (("+/figures", 0), ("+/+/status", 0), ("+/+/event", 1))
LAST: Final = (("+/+/recent", 0),)


def topics_of(pattern: str) -> tuple[str, ...]:
    """Return what to subscribe to first: the states of all agents of the sites that fit."""
    return (f"{ROOT}/{'+' if _is_pattern(pattern) else encoded(pattern)}/+/state",)


def _is_pattern(pattern: str) -> bool:
    return any(sign in pattern for sign in "*?[")


class FleetReader:
    """One broker. `why`: the connection is lost, "" while it stands."""

    def __init__(self, connection: BrokerConnection, fleet: SeenFleet, pattern: str) -> None:
        self._connection, self.fleet, self._pattern = connection, fleet, pattern
        self.why = "no connection yet"
        self.is_up = False
        self.refused = 0  # messages
        self.told = ""  # the newest line on one of them
        self._told_at = -TELL_NS
        self._waiting: dict[object, IncomingMessage] = {}
        self._waiting_bytes = self._numbers = self._dropped = 0
        self._topics: dict[str, Topic] = {}
        self._connections = 0  # so far
        self._miss_at: int | None = None
        self._again_at = AGAIN_NS
        self._first: deque[FleetAgent] = deque()
        self._last: deque[FleetAgent] = deque()
        self._underway: dict[int, FleetAgent | None] = {}  # subscriptions; None: the first of two of an agent
        self._settling: deque[tuple[int, FleetAgent]] = deque()

    @property
    def is_complete(self) -> bool:
        """Return whether everything that the broker has retained was asked for and taken."""
        asked = self._first or self._last or self._underway or self._waiting
        return self.is_up and not asked

    def turn(self, now: int, wall: float, most_ns: int) -> None:
        """Hear what has come, and look at it for at most so long."""
        for news in self._connection.news():
            match news:
                case IncomingMessage():
                    self._wait(news, now)
                case Connected():
                    self.is_up, self.why = True, ""
                    self._connections += 1
                    self._miss_at = now + MISS_NS
                    self.fleet.begin_connection()
                case Lost(why):
                    self._lost(why)
                case Subscribed(number):
                    agent = self._underway.pop(number, None)
                    if agent is not None:
                        self._settling.append((now + SETTLED_NS, agent))
                case SubscriptionRefused(why):
                    self._tell(why, now)
        if self._connection.dropped > self._dropped:
            self.refused += self._connection.dropped - self._dropped
            self._dropped = self._connection.dropped
            self._tell(TOO_MANY, now)
        self._look(now, wall, now + most_ns)
        self._ask()
        while self._settling and now >= self._settling[0][0] and not self._waiting:
            self._settling.popleft()[1].begin()
        if self._miss_at is not None and now >= self._miss_at and not self._waiting:
            self._miss_at = None
            self.fleet.miss(wall)

        if now >= self._again_at and self.is_complete:
            self._again_at = now + AGAIN_NS
            self._ask_again()

    def _lost(self, why: str) -> None:
        self.is_up, self.why, self._miss_at = False, why, None
        for each in (self._first, self._last, self._underway, self._settling):
            each.clear()

    # -- messages ----------------------------------------------------------------------------------------

    def _wait(self, came: IncomingMessage, now: int) -> None:
        key: object = came.topic
        if came.topic.endswith("/event"):
            self._numbers += 1
            key = self._numbers
        before = self._waiting.get(key)
        is_full = len(self._waiting) >= MOST_WAITING or self._waiting_bytes > MOST_WAITING_BYTES
        if before is None and is_full:
            self._refuse(TOO_MANY, now)
            return
        self._waiting_bytes += len(came.payload) - (len(before.payload) if before is not None else 0)
        self._waiting[key] = came

    def _look(self, now: int, wall: float, until: int) -> None:
        while self._waiting:
            key = next(iter(self._waiting))
            came = self._waiting.pop(key)
            self._waiting_bytes -= len(came.payload)
            try:
                self._take(came, wall)
            except UserError as refused:
                self._refuse(refused.lines()[0], now)
            if clock.now_ns() > until:
                return

    def _take(self, came: IncomingMessage, wall: float) -> None:
        topic = self._topics.get(came.topic)
        if topic is None:
            topic = topic_of(came.topic)
            if not self._fits(topic.site):
                return
        message = read(topic, came.payload)
        self.fleet.take(topic, message, wall, came.is_retained)
        if len(self._topics) >= MOST_TOPICS:
            self._topics.clear()
        self._topics[came.topic] = topic
        if isinstance(message, StateMessage):
            agent = self.fleet.agents[topic[:2]]
            if agent.asked != self._connections:
                agent.asked = self._connections
                self._first.append(agent)

    def _fits(self, site: str) -> bool:
        return fnmatchcase(site, self._pattern) if _is_pattern(self._pattern) else site == self._pattern

    def _refuse(self, why: str, now: int) -> None:
        self.refused += 1
        self._tell(why, now)

    def _tell(self, line: str, now: int) -> None:
        if now >= self._told_at + TELL_NS:
            self.told, self._told_at = line, now

    # -- subscriptions -----------------------------------------------------------------------------------

    def _ask_again(self) -> None:
        for agent in self.fleet.agents.values():
            if agent.asked_again < MOST_AGAIN and any(line.is_lacking for line in agent.lines.values()):
                agent.asked_again += 1
                self._first.append(agent)

    def _ask(self) -> None:
        while self.is_up and len(self._underway) < AT_ONCE and len(self._waiting) < BUSY:
            is_first = bool(self._first)
            if not is_first and (not self._last or self._waiting):
                return
            agent = (self._first if is_first else self._last)[0]
            base = f"{ROOT}/{encoded(agent.site)}/{encoded(agent.name)}"
            number = self._connection.subscribe(
                tuple((f"{base}/{levels}", qos) for levels, qos in (FIRST if is_first else LAST))
            )
            if number is None:
                return
            self._underway[number] = None if is_first else agent
            if is_first:
                self._last.append(self._first.popleft())
            else:
                self._last.popleft()
