"""What an agent keeps for the broker: the newest of each retained topic, and a queue on disk for events.

Rule 1: after each connection the retained topics go first, `HOLD_NS` later what is queued, oldest first.
Rule 2: an event leaves the queue when the broker has acknowledged it; past the bound old figures go first.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Final

from trcvtui.errors import mistake, one_line
from trcvtui.fleet.broker import BrokerConnection, BrokerRefusal, Connected, Lost, Taken

HOLD_NS: Final = 2_000_000_000
LEAST_GAP_NS: Final = 1_000_000_000  # between two messages of one retained topic
MOST_QUEUED: Final = 20_000
MOST_UNDERWAY: Final = 200  # messages that the broker has not acknowledged
EVENT, FIGURES = 0, 1  # what stands in the queue
# No number comes twice, also after the queue was empty: what has been sent is known by its number.
_TABLE: Final = (
    "CREATE TABLE IF NOT EXISTS queue "
    "(n INTEGER PRIMARY KEY AUTOINCREMENT, kind INT, topic TEXT, payload BLOB)"
)


class DiskQueue:
    """Messages that wait for the broker, in a file that the next start of the agent reads again."""

    def __init__(self, path: Path | None, most: int = MOST_QUEUED) -> None:
        self._most = most
        self.dropped = {EVENT: 0, FIGURES: 0}
        try:
            self._base = sqlite3.connect(path or ":memory:", isolation_level=None)
            self._base.execute("PRAGMA journal_mode=WAL")
            self._base.execute("PRAGMA synchronous=OFF")
            self._base.execute(_TABLE)
            self._base.execute("CREATE INDEX IF NOT EXISTS oldest ON queue (kind DESC, n)")
            [(self.size,)] = self._base.execute("SELECT count(*) FROM queue")
        except sqlite3.Error as failed:
            raise mistake(str(path), f"'{failed}'", "a queue of ours, or none") from None

    def put(self, kind: int, topic: str, payload: bytes) -> None:
        """Append a message; past the bound an old one goes: figures first."""
        self._base.execute(
            "INSERT INTO queue (kind, topic, payload) VALUES (?, ?, ?)", (kind, topic, payload)
        )
        self.size += 1
        if self.size > self._most:
            [(oldest, gone)] = self._base.execute("SELECT n, kind FROM queue ORDER BY kind DESC, n LIMIT 1")
            self.take(oldest)
            self.dropped[gone] += 1

    def after(self, number: int, most: int) -> list[tuple[int, str, bytes]]:
        """Return the oldest messages after one, with their numbers."""
        asked = "SELECT n, topic, payload FROM queue WHERE n > ? ORDER BY n LIMIT ?"
        return self._base.execute(asked, (number, most)).fetchall()

    def take(self, number: int) -> None:
        self.size -= self._base.execute("DELETE FROM queue WHERE n = ?", (number,)).rowcount

    def close(self) -> None:
        self._base.close()


class _Retained:
    """The newest message of a topic, and when it was sent."""

    __slots__ = ("is_sent", "payload", "sent_at")

    def __init__(self, payload: bytes) -> None:
        self.payload, self.is_sent, self.sent_at = payload, False, -LEAST_GAP_NS


class Publisher:
    """Gives the broker what it shall have, as far as it is there. `say` tells the user, a line each."""

    def __init__(self, connection: BrokerConnection, queue: DiskQueue, say: Callable[[str], None]) -> None:
        self._connection, self._queue, self._say = connection, queue, say
        self._retained: dict[str, _Retained] = {}
        self._underway: dict[int, int] = {}  # number of the connection: number in the queue, 0: retained
        self._sent_up_to = 0
        self._up_at: int | None = None
        self._told = ""
        self.dropped_told = 0

    @property
    def is_up(self) -> bool:
        """Return whether the broker has taken us."""
        return self._up_at is not None

    @property
    def queue(self) -> DiskQueue:
        return self._queue

    def retain(self, topic: str, payload: bytes) -> None:
        """Let a topic have a new message; of several within LEAST_GAP_NS the newest goes out."""
        held = self._retained.get(topic)
        if held is None:
            self._retained[topic] = _Retained(payload)
        else:
            held.payload, held.is_sent = payload, False

    def event(self, topic: str, payload: bytes) -> None:
        """Send an event, now or later."""
        self._queue.put(EVENT, topic, payload)

    def figures(self, topic: str, payload: bytes) -> None:
        """Retain figures; while the broker is away they are queued, too."""
        self.retain(topic, payload)
        if not self.is_up:
            self._queue.put(FIGURES, topic, payload)

    def turn(self, now: int) -> None:
        """Hear what the broker says, and send what may be sent."""
        for news in self._connection.news():
            match news:
                case Connected():
                    self._begin(now)
                case Lost(why):
                    self._up_at = None
                    self._tell(f"{why}; what comes is kept, the next try follows")
                case BrokerRefusal(why):
                    self._tell(why)
                case Taken(number):
                    done = self._underway.pop(number, 0)
                    if done:
                        self._queue.take(done)
        if self._up_at is None:
            return
        self._send_retained(now)
        if now >= self._up_at + HOLD_NS:
            self._send_queued()

    def _begin(self, now: int) -> None:
        self._up_at, self._sent_up_to = now, 0
        self._underway.clear()
        for held in self._retained.values():
            held.is_sent, held.sent_at = False, now - LEAST_GAP_NS
        self._tell("the broker is there")
        dropped = self._queue.dropped
        if sum(dropped.values()) > self.dropped_told:
            self.dropped_told = sum(dropped.values())
            self._say(
                f"no room while the broker was away: {dropped[FIGURES]} figures, {dropped[EVENT]} events"
            )

    def _send_retained(self, now: int) -> None:
        for topic, held in self._retained.items():
            if held.is_sent or now < held.sent_at + LEAST_GAP_NS:
                continue
            if len(self._underway) >= MOST_UNDERWAY:
                return
            number = self._connection.publish(topic, held.payload, is_retained=True)
            if number is None:
                return
            self._underway[number] = 0
            held.is_sent, held.sent_at = True, now

    def _send_queued(self) -> None:
        room = MOST_UNDERWAY - len(self._underway)
        if not self._queue.size or room <= 0:
            return
        for n, topic, payload in self._queue.after(self._sent_up_to, room):
            number = self._connection.publish(topic, payload)
            if number is None:
                return
            self._underway[number], self._sent_up_to = n, n

    def _tell(self, line: str) -> None:
        if line != self._told:
            self._told = line
            self._say(one_line(line))
