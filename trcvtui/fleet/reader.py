"""The reader of `trcvtui fleet`: it subscribes step by step and passes messages to the fleet.

Rule: a broker drops messages that it cannot send at once (Mosquitto: beyond 1000). So the reader subscribes
to the states of all agents first, then to the other topics of a few agents at a time.
"""

from __future__ import annotations

from collections import deque
from fnmatch import fnmatchcase
from typing import Final

from trcvtui import clock
from trcvtui.errors import UserError
from trcvtui.fleet.broker import (
    BrokerConnection,
    BrokerEvent,
    ConnAck,
    ConnectionLost,
    IncomingMessage,
    SubAck,
    SubscribeRefusal,
)
from trcvtui.fleet.seen_fleet import FleetAgent, FleetModel
from trcvtui.fleet.topics import ROOT, StateMessage, encode_level, parse_message, parse_topic

NS: Final = 1_000_000_000
MOST_PENDING_AGENTS: Final = 4  # agents whose subscriptions the broker has not answered
SETTLE_NS: Final = 2 * NS  # after a subscription: then the retained messages have come
RETURN_TIMEOUT_NS: Final = 15 * NS  # after the broker is back: an agent without a state is then offline
LACK_CHECK_NS: Final = 30 * NS  # between two checks for agents with missing messages
MOST_REQUESTS: Final = 4  # subscriptions to one agent in a connection: the broker may not have more
TOO_MANY_TEXT: Final = "messages come faster than they can be read"
REPORT_PAUSE_NS: Final = NS  # between two lines about refused messages
# Topics of each agent with their QoS: a retained message comes again with its next value, an event does not.
TOPIC_QOS: Final = (("+/figures", 0), ("+/+/status", 0), ("+/+/event", 1), ("+/+/recent", 0))


def state_topics(pattern: str) -> tuple[str, ...]:
    """Return the first topics to subscribe to: the states of all agents, or of the agents of one site."""
    return (f"{ROOT}/{'+' if _is_pattern(pattern) else encode_level(pattern)}/+/state",)


def _is_pattern(pattern: str) -> bool:
    return any(sign in pattern for sign in "*?[")


class FleetReader:
    """The reader of one broker. `why` says why there is no connection, and is "" while there is one."""

    def __init__(self, connection: BrokerConnection, fleet: FleetModel, pattern: str) -> None:
        self._connection, self.fleet, self._pattern = connection, fleet, pattern
        self.why = "no connection yet"
        self.is_up = False
        self.refused = self._dropped = 0  # messages
        self.last_refusal = ""  # the newest line about a refused message
        self._told_at = -REPORT_PAUSE_NS
        self._is_behind = False  # messages are still unread
        self._miss_at: int | None = None  # end of RETURN_TIMEOUT_NS
        self._again_at = LACK_CHECK_NS
        self._requests: dict[tuple[str, str], int] = {}  # by agent, on this connection
        self._to_ask: deque[FleetAgent] = deque()
        self._underway: dict[int, FleetAgent] = {}  # subscriptions without an answer
        self._settling: deque[tuple[int, FleetAgent]] = deque()

    @property
    def has_caught_up(self) -> bool:
        """Return whether all subscriptions were made and answered, and no message is unread."""
        return self.is_up and not (self._to_ask or self._underway or self._is_behind)

    def advance(self, now: int, wall: float, most_ns: int) -> None:
        """Read messages for at most `most_ns`, then subscribe to more."""
        until = clock.now_ns() + most_ns
        self._is_behind = False
        for news in self._connection.take_events():
            self._handle_event(news, now, wall)
            if clock.now_ns() > until:
                self._is_behind = True
                break
        if self._connection.dropped > self._dropped:
            self.refused += self._connection.dropped - self._dropped
            self._dropped = self._connection.dropped
            self._show_refusal(TOO_MANY_TEXT, now)
        while self._settling and now >= self._settling[0][0] and not self._is_behind:
            self._settling.popleft()[1].count_from_one()
        if self._miss_at is not None and now >= self._miss_at and not self._is_behind:
            self._miss_at = None
            self.fleet.mark_offline_agents(wall)
        if now >= self._again_at and self.has_caught_up:
            self._again_at = now + LACK_CHECK_NS
            for agent in self.fleet.agents.values():
                if any(line.lacks_messages for line in agent.lines.values()):
                    self._queue_agent(agent)
        self._subscribe_queued()

    def _handle_event(self, news: BrokerEvent, now: int, wall: float) -> None:
        match news:
            case IncomingMessage():
                try:
                    self._handle_message(news, wall)
                except UserError as refused:
                    self.refused += 1
                    self._show_refusal(refused.lines()[0], now)
            case ConnAck():
                self.is_up, self.why = True, ""
                self._miss_at = now + RETURN_TIMEOUT_NS
                for agent in self.fleet.agents.values():
                    agent.is_heard = False  # its retained state comes again
            case ConnectionLost(why):
                self.is_up, self.why, self._miss_at = False, why, None
                for each in (self._requests, self._to_ask, self._underway, self._settling):
                    each.clear()
            case SubAck(number) if number in self._underway:
                self._settling.append((now + SETTLE_NS, self._underway.pop(number)))
            case SubscribeRefusal(why):
                self._show_refusal(why, now)

    def _handle_message(self, came: IncomingMessage, wall: float) -> None:
        topic = parse_topic(came.topic)
        fits = fnmatchcase if _is_pattern(self._pattern) else str.__eq__  # MQTT wildcards match whole levels
        if not fits(topic.site, self._pattern):
            return
        message = parse_message(topic, came.payload)
        self.fleet.apply(topic, message, wall, came.is_retained)
        if isinstance(message, StateMessage) and topic[:2] not in self._requests:
            self._queue_agent(self.fleet.agents[topic[:2]])

    def _show_refusal(self, line: str, now: int) -> None:
        if now >= self._told_at + REPORT_PAUSE_NS:
            self.last_refusal, self._told_at = line, now

    def _queue_agent(self, agent: FleetAgent) -> None:
        requests = self._requests.get((agent.site, agent.name), 0)
        if requests < MOST_REQUESTS:
            self._requests[agent.site, agent.name] = requests + 1
            self._to_ask.append(agent)

    def _subscribe_queued(self) -> None:
        # The rule: few agents at a time.
        while self._to_ask and len(self._underway) < MOST_PENDING_AGENTS and not self._is_behind:
            agent = self._to_ask[0]
            base = f"{ROOT}/{encode_level(agent.site)}/{encode_level(agent.name)}"
            number = self._connection.subscribe(tuple((f"{base}/{levels}", qos) for levels, qos in TOPIC_QOS))
            if number is None:
                return
            self._underway[number] = self._to_ask.popleft()
