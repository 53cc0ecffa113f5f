"""Sends an agent's messages to the broker: the newest of each retained topic, and a queue of events.

Rule 1: a new connection first sends retained topics and, `QUEUE_DELAY_NS` later, the queue, oldest first.
Rule 2: an event leaves the queue when the broker acknowledges it. A full queue drops old figures first.
Rule 3: a refused message is sent again after a growing pause, in which other messages are sent.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from trcvtui.errors import one_line
from trcvtui.fleet.broker import (
    BrokerConnection,
    ConnAck,
    ConnectionLost,
    PublishAck,
    PublishRefusal,
    SubscribeRefusal,
)
from trcvtui.fleet.disk_queue import EVENT, FIGURES, DiskQueue

QUEUE_DELAY_NS: Final = 2_000_000_000
LEAST_GAP_NS: Final = 1_000_000_000  # between two messages of one retained topic
RESEND_NS, MOST_RESEND_NS = 5_000_000_000, 300_000_000_000  # before a refused message is sent again
MOST_UNDERWAY: Final = 200  # messages that the broker has not acknowledged


class _PendingMessage(NamedTuple):
    """A sent message without an acknowledgement yet. `number` is its number in the queue, 0: not queued."""

    topic: str
    number: int


class _RetainedTopic:
    """The newest message of a topic, sent at `due_at` or later. `payload` makes the bytes then."""

    __slots__ = ("due_at", "gap", "is_sent", "payload")

    def __init__(self, payload: Callable[[], bytes], gap: int) -> None:
        self.payload, self.gap, self.is_sent, self.due_at = payload, gap, False, 0


class Publisher:
    """Sends retained and queued messages while the broker is connected. `say` prints lines for the user."""

    def __init__(self, connection: BrokerConnection, queue: DiskQueue, say: Callable[[str], None]) -> None:
        self._connection, self.queue, self._say = connection, queue, say
        self._retained: dict[str, _RetainedTopic] = {}
        self._underway: dict[int, _PendingMessage] = {}  # by the number of the connection
        self._sent_up_to = 0
        self._again_at, self._pause = 0, RESEND_NS  # time of the next resend, and the pause after it
        self._up_at: int | None = None
        self._last_report = ""
        self.reported_drops = 0

    @property
    def is_up(self) -> bool:
        return self._up_at is not None

    def retain(self, topic: str, payload: bytes | Callable[[], bytes], gap: int = LEAST_GAP_NS) -> None:
        """Set the message of a topic. Of several messages within `gap` ns only the newest is sent."""
        made = (lambda: payload) if isinstance(payload, bytes) else payload
        held = self._retained.get(topic)
        if held is None:
            self._retained[topic] = _RetainedTopic(made, gap)
            self.queue.remember_topic(topic)
        else:
            held.payload, held.is_sent = made, False

    def clear_all_but(self, is_used: Callable[[str], bool]) -> None:
        """Clear unused topics of earlier runs: otherwise the broker keeps them for ever."""
        for topic in self.queue.list_topics():
            if topic not in self._retained and not is_used(topic):
                self.retain(topic, b"")  # MQTT 5, 3.3.1.3: an empty payload clears the topic

    def send_event(self, topic: str, payload: bytes) -> None:
        self._queue_message(EVENT, topic, payload)

    def send_figures(self, topic: str, payload: bytes) -> None:
        """Retain figures. While the broker is not connected, also queue the figures."""
        self.retain(topic, payload)
        if not self.is_up:
            self._queue_message(FIGURES, topic, payload)

    def _queue_message(self, kind: int, topic: str, payload: bytes) -> None:
        if self.queue.put(kind, topic, payload):
            return
        number = self._connection.publish(topic, payload)  # the queue failed: send it at once or drop it
        if number is None:
            self.queue.dropped[kind] += 1
        else:
            self._underway[number] = _PendingMessage(topic, 0)

    def advance(self, now: int) -> None:
        for news in self._connection.take_events():
            match news:
                case ConnAck():
                    self._handle_connect(now)
                case ConnectionLost(why):
                    self._up_at = None
                    self._report(f"{why}; messages are queued until the next try succeeds")
                case SubscribeRefusal(why):
                    self._report(why)
                case PublishAck(number) if number in self._underway:
                    self._handle_ack(self._underway.pop(number))
                case PublishRefusal(number, why) if number in self._underway:
                    self._handle_refusal(self._underway.pop(number), why, now)
        if self._up_at is None:
            return
        if self._sent_up_to and now >= self._again_at > 0:
            self._sent_up_to = self._again_at = 0
        self._send_retained(now)
        if now >= self._up_at + QUEUE_DELAY_NS:  # rule 1
            self._send_queued()

    def _handle_ack(self, done: _PendingMessage) -> None:
        if done.number:  # rule 2
            self.queue.delete(done.number)
        held = self._retained.get(done.topic)
        if held is not None and held.is_sent and not held.payload():
            self.queue.forget_topic(done.topic)  # an acknowledged empty payload: the topic is cleared
            del self._retained[done.topic]

    def _handle_refusal(self, refused: _PendingMessage, why: str, now: int) -> None:
        if now >= self._again_at:  # rule 3: several refusals before then count as one
            self._again_at, self._pause = now + self._pause, min(2 * self._pause, MOST_RESEND_NS)
            seconds = (self._again_at - now) // 1_000_000_000
            self._say(one_line(f"the broker refuses '{refused.topic}': {why}; next try in {seconds} s"))
        if refused.topic in self._retained:
            held = self._retained[refused.topic]
            held.is_sent, held.due_at = False, self._again_at

    def _handle_connect(self, now: int) -> None:
        self._up_at, self._sent_up_to = now, 0
        self._again_at, self._pause = 0, RESEND_NS
        self._underway.clear()
        for held in self._retained.values():
            held.is_sent, held.due_at = False, 0
        self._report("connected to the broker")
        dropped = self.queue.dropped
        if sum(dropped.values()) > self.reported_drops:
            self.reported_drops = sum(dropped.values())
            self._say(
                f"dropped while the broker was away: {dropped[FIGURES]} figures, {dropped[EVENT]} events"
            )

    def _send_retained(self, now: int) -> None:
        for topic, held in self._retained.items():
            if held.is_sent or now < held.due_at:
                continue
            if len(self._underway) >= MOST_UNDERWAY:  # a slow broker
                return
            number = self._connection.publish(topic, held.payload(), is_retained=True)
            if number is None:
                return
            self._underway[number] = _PendingMessage(topic, 0)
            held.is_sent, held.due_at = True, now + held.gap

    def _send_queued(self) -> None:
        room = MOST_UNDERWAY - len(self._underway)
        if not self.queue.size or room <= 0:
            return
        underway = {each.number for each in self._underway.values()}
        for n, topic, payload in self.queue.list_after(self._sent_up_to, room):
            if n not in underway:
                number = self._connection.publish(topic, payload)
                if number is None:
                    return
                self._underway[number] = _PendingMessage(topic, n)
            self._sent_up_to = n

    def _report(self, line: str) -> None:
        if line != self._last_report:
            self._last_report = line
            self._say(one_line(line))
