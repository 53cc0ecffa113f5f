"""A made-up plant for the pictures of `trcvtui fleet`: what its agents tell, at a time that stands still."""

from __future__ import annotations

import os
import random
import time
from collections.abc import Iterator, Sequence
from typing import Final, cast

from trcvtui import clock
from trcvtui.fleet.broker import BrokerAccess, BrokerConnection, BrokerEvent, ConnAck, IncomingMessage, SubAck
from trcvtui.fleet.reader import FleetReader
from trcvtui.fleet.seen_fleet import FleetModel
from trcvtui.fleet.topics import (
    EventMessage,
    FiguresMessage,
    FleetMessage,
    StateMessage,
    StatusMessage,
    Topic,
)
from trcvtui.tui.fleet import app as fleet_app

NOW: Final = 1_795_446_000.0
AGENTS, LINES = 24, 3
NAMES: Final = ("press", "oven", "saw", "checkweigher", "labeller", "palletizer")
OFFLINE: Final = (7,)  # which of the agents
# What a line may fail with: STATUS, its words, the call and its errno, what is told.
FAULTS: Final = (
    ("80AA", "the partner has reset", "recv", "ECONNRESET", "the partner reset, 7 of 12 bytes received"),
    ("80C4", "no connection", "connect", "ECONNREFUSED", "nobody listens at the partner"),
    ("80C5", "the partner has closed", "recv", None, "the partner closed (recv gave 0)"),
)


class PlantBroker:
    """Brings everything at once, and takes each subscription."""

    def __init__(self) -> None:
        self._news: list[BrokerEvent] = [ConnAck(), *_messages()]
        self._taken = self.dropped = 0

    def take_events(self) -> Iterator[BrokerEvent]:
        """Return what has come."""
        news, self._news = self._news, []
        return iter(news)

    def subscribe(self, topics: tuple[tuple[str, int], ...]) -> int:
        """Take it: all is there."""
        self._taken += 1
        self._news.append(SubAck(self._taken))
        return self._taken


def _messages() -> Iterator[IncomingMessage]:
    random.seed(4)
    for agent in range(AGENTS):
        site, name = f"plant{agent % 4 + 1}", f"{NAMES[agent % len(NAMES)]}-{agent + 1:02}"
        state = "offline" if agent in OFFLINE else "online"
        yield _told((site, name, "", ""), StateMessage(state, NOW - 420, "0.1.0", f"{site}-{name}"))
        for line in range(1, LINES + 1):
            yield from _line((site, name, f"C{line}", f"TRCV_C_{line}"))


def _line(place: tuple[str, str, str, str]) -> Iterator[IncomingMessage]:
    chance, (code, words, call, errno, text) = random.random(), random.choice(FAULTS)
    errors = 0 if chance < 0.6 else random.randint(1, 30)
    is_bad = bool(errors) and chance > 0.9
    state = "listening" if 0.5 < chance < 0.6 else "connected"
    rates = round(random.uniform(20, 900), 1), round(random.uniform(0, 90), 1), random.randint(12, 60)
    yield _told((*place[:3], ""), FiguresMessage(NOW - 8, state, *rates, errors))
    shown = (code, words, False) if is_bad else ("7006", "receiving", True)
    done, age = random.randint(100, 9000), random.uniform(2, 5000)
    yield _told(place, StatusMessage(NOW - 1, *shown, False, is_bad, done, errors, 7, 12, age))
    times = sorted(NOW - random.uniform(10, 3500) for _ in range(errors))
    cause = {"text": text, "call": call, "errno": errno, "peer": "10.0.4.17:2000"}
    for number, t in enumerate(times, 1):
        yield _told(place, EventMessage(f"b-{number}", t, "error", code, cause))


def _told(place: tuple[str, str, str, str], message: FleetMessage) -> IncomingMessage:
    return IncomingMessage(str(Topic(*place, message.KIND)), message.to_json(), True)


async def draw_fleet(size: tuple[int, int], keys: Sequence[str]) -> str:
    """Return the screen after some keys, as SVG."""
    os.environ["TZ"] = "UTC"
    time.tzset()
    clock.utc_ns = lambda: int(NOW) * fleet_app.NS_PER_S
    fleet_app.ORDER_INTERVAL_NS, fleet_app.FRAME_S = 0, 3600.0
    reader = FleetReader(cast(BrokerConnection, PlantBroker()), FleetModel(), "*")
    app = fleet_app.FleetApp(BrokerAccess("broker.example", 8883, True), "*", reader)
    async with app.run_test(size=size) as pilot:
        while not reader.has_caught_up:
            reader.advance(0, NOW, 1 << 62)
        app.read_broker(1 << 62)
        await pilot.press(*keys)
        await pilot.pause()
        return app.export_screenshot(title="trcvtui")
