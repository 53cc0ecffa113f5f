"""Messages of agents, and a broker that brings them when a test says so."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

from msgspec.structs import replace

from trcvtui.fleet.broker import BrokerConnection, BrokerEvent, IncomingMessage, SubAck
from trcvtui.fleet.reader import FleetReader
from trcvtui.fleet.seen_fleet import FleetModel
from trcvtui.fleet.topics import (
    EventMessage,
    FiguresMessage,
    FleetMessage,
    RecentMessage,
    StateMessage,
    StatusMessage,
)

NOW = 1_795_000_000.0
SECOND = 1_000_000_000


def event(seq: int, boot: str = "b", kind: str = "error", t: float = NOW) -> EventMessage:
    return EventMessage(
        f"{boot}-{seq}",
        t + seq / 1000,
        kind,
        "80A6",
        {"text": "recv gave ECONNRESET", "call": "recv", "errno": "ECONNRESET"},
    )


def recent(*seqs: int, boot: str = "b") -> RecentMessage:
    return RecentMessage(NOW, max(seqs), tuple(event(seq, boot) for seq in seqs))


def status(code: str = "7006", error: bool = False, errors: int = 0) -> StatusMessage:
    return StatusMessage(NOW, code, "receiving", not error, False, error, 7, errors, 12, 24, 60.0)


def figures(state: str = "connected", errors: int = 0, t: float = NOW) -> FiguresMessage:
    return FiguresMessage(t, state, 120.5, 0, 60, errors)


ONLINE = StateMessage("online", NOW, "0.1.0", "pc-7")
OFF = replace(ONLINE, state="offline", t=NOW + 5)


class FakeBroker:
    """A broker that takes subscriptions when it is told to."""

    def __init__(self, pattern: str = "*") -> None:
        self.dropped = 0
        self.asked: list[tuple[str, ...]] = []
        self.waiting: list[BrokerEvent] = []
        self._taken = 0
        self.reader = FleetReader(cast(BrokerConnection, self), FleetModel(), pattern)
        self.now, self.wall = 0, NOW

    def take_events(self) -> Iterator[BrokerEvent]:
        while self.waiting:
            yield self.waiting.pop(0)

    def subscribe(self, topics: tuple[tuple[str, int], ...]) -> int:
        self.asked.append(tuple(topic.removeprefix("trcvtui/v1/") for topic, _ in topics))
        return len(self.asked)

    def tell(self, *news: BrokerEvent, seconds: float = 0.0) -> None:
        self.waiting += news
        self.now, self.wall = self.now + int(seconds * SECOND), self.wall + seconds
        self.reader.advance(self.now, self.wall, 1 << 62)

    def message(self, topic: str, message: FleetMessage) -> IncomingMessage:
        return IncomingMessage(f"trcvtui/v1/{topic}", message.to_json(), True)

    def take_subscriptions(self) -> None:
        while self._taken < len(self.asked):
            self._taken += 1
            self.tell(SubAck(self._taken))

    @property
    def names(self) -> list[str]:
        return [line.name for line in self.reader.fleet.sort_lines(self.wall)]
