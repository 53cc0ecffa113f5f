"""What `trcvtui fleet` hears: subscribes step by step, hands messages to the fleet, tells what it refuses.

Rule: a broker drops what it cannot send at once (Mosquitto: past 1000 messages). So the states of all agents
are asked for first, then, agent by agent, what else is retained, a few at a time.
"""

from __future__ import annotations

from collections import deque
from fnmatch import fnmatchcase
from typing import Final

from trcvtui import clock
from trcvtui.errors import UserError
from trcvtui.fleet.broker import (
    BrokerConnection,
    BrokerRefusal,
    Connected,
    IncomingMessage,
    Lost,
    News,
    Subscribed,
)
from trcvtui.fleet.seen_fleet import FleetAgent, SeenFleet
from trcvtui.fleet.topics import ROOT, StateMessage, encoded, read, topic_of

NS: Final = 1_000_000_000
AT_ONCE: Final = 4  # agents whose subscriptions the broker has not taken yet
SETTLED_NS: Final = 2 * NS  # after its subscription: what is retained has come
MISS_NS: Final = 15 * NS  # after the broker came back: who has not come back, too, is offline
AGAIN_NS: Final = 30 * NS  # between two looks for agents of whom something is lacking
MOST_ASKED: Final = 4  # times that an agent is asked for: the broker may not have more
TOO_MANY: Final = "more messages come than can be looked at"
TELL_NS: Final = NS  # between two lines on what was refused
# What is asked for of each agent, with its QoS: a retained topic comes again by itself, an event does not.
ASKED: Final = (("+/figures", 0), ("+/+/status", 0), ("+/+/event", 1), ("+/+/recent", 0))


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
        self.refused = self._dropped = 0  # messages
        self.told = ""  # the newest line on one of them
        self._told_at = -TELL_NS
        self._is_behind = False  # messages wait
        self._miss_at: int | None = None
        self._again_at = AGAIN_NS
        self._asked: dict[tuple[str, str], int] = {}  # times that agents were asked for on this connection
        self._to_ask: deque[FleetAgent] = deque()
        self._underway: dict[int, FleetAgent] = {}  # subscriptions
        self._settling: deque[tuple[int, FleetAgent]] = deque()

    @property
    def is_complete(self) -> bool:
        """Return whether everything that the broker has retained was asked for and taken."""
        return self.is_up and not (self._to_ask or self._underway or self._is_behind)

    def turn(self, now: int, wall: float, most_ns: int) -> None:
        """Take what has come, for at most so long; ask for more."""
        until = clock.now_ns() + most_ns
        self._is_behind = False
        for news in self._connection.news():
            self._take(news, now, wall)
            if clock.now_ns() > until:
                self._is_behind = True
                break
        if self._connection.dropped > self._dropped:
            self.refused += self._connection.dropped - self._dropped
            self._dropped = self._connection.dropped
            self._tell(TOO_MANY, now)
        while self._settling and now >= self._settling[0][0] and not self._is_behind:
            self._settling.popleft()[1].begin()
        if self._miss_at is not None and now >= self._miss_at and not self._is_behind:
            self._miss_at = None
            self.fleet.miss(wall)
        if now >= self._again_at and self.is_complete:
            self._again_at = now + AGAIN_NS
            for agent in self.fleet.agents.values():
                if any(line.is_lacking for line in agent.lines.values()):
                    self._want(agent)
        self._ask()

    def _take(self, news: News, now: int, wall: float) -> None:
        match news:
            case IncomingMessage():
                try:
                    self._message(news, wall)
                except UserError as refused:
                    self.refused += 1
                    self._tell(refused.lines()[0], now)
            case Connected():
                self.is_up, self.why = True, ""
                self._miss_at = now + MISS_NS
                for agent in self.fleet.agents.values():
                    agent.is_heard = False  # what the broker knows of it comes now
            case Lost(why):
                self.is_up, self.why, self._miss_at = False, why, None
                for each in (self._asked, self._to_ask, self._underway, self._settling):
                    each.clear()
            case Subscribed(number) if number in self._underway:
                self._settling.append((now + SETTLED_NS, self._underway.pop(number)))
            case BrokerRefusal(why):
                self._tell(why, now)

    def _message(self, came: IncomingMessage, wall: float) -> None:
        topic = topic_of(came.topic)
        fits = fnmatchcase if _is_pattern(self._pattern) else str.__eq__
        if not fits(topic.site, self._pattern):
            return
        message = read(topic, came.payload)
        self.fleet.take(topic, message, wall, came.is_retained)
        if isinstance(message, StateMessage) and topic[:2] not in self._asked:
            self._want(self.fleet.agents[topic[:2]])

    def _tell(self, line: str, now: int) -> None:
        if now >= self._told_at + TELL_NS:
            self.told, self._told_at = line, now

    def _want(self, agent: FleetAgent) -> None:
        asked = self._asked.get((agent.site, agent.name), 0)
        if asked < MOST_ASKED:
            self._asked[agent.site, agent.name] = asked + 1
            self._to_ask.append(agent)

    def _ask(self) -> None:
        while self._to_ask and len(self._underway) < AT_ONCE and not self._is_behind:
            agent = self._to_ask[0]
            base = f"{ROOT}/{encoded(agent.site)}/{encoded(agent.name)}"
            number = self._connection.subscribe(tuple((f"{base}/{levels}", qos) for levels, qos in ASKED))
            if number is None:
                return
            self._underway[number] = self._to_ask.popleft()
