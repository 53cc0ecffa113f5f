"""A reader of the fleet on a real broker that is killed and comes back, and on agents that end."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from tests.fleet.fakes import status
from tests.fleet.mosquitto import Mosquitto, needs_mosquitto
from tests.waiting import until
from trcvtui import clock
from trcvtui.fleet import publisher, reader
from trcvtui.fleet.broker import BrokerAccess, BrokerConnection, LastWill
from trcvtui.fleet.disk_queue import DiskQueue
from trcvtui.fleet.lines import AgentInstance
from trcvtui.fleet.publisher import Publisher
from trcvtui.fleet.reader import FleetReader, state_topics
from trcvtui.fleet.seen_fleet import FleetLine, FleetModel
from trcvtui.fleet.topics import StateMessage, Topic

pytestmark = [needs_mosquitto, pytest.mark.live, pytest.mark.slow]
SECOND = 1_000_000_000


@pytest.fixture(autouse=True)
def short_times(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait for tenths where the programs wait for seconds."""
    monkeypatch.setattr(publisher, "QUEUE_DELAY_NS", SECOND // 5)
    monkeypatch.setattr(publisher, "LEAST_GAP_NS", SECOND // 20)
    monkeypatch.setattr(reader, "SETTLE_NS", SECOND // 10)


class OneLine:
    """An agent with one instance, its own code from the event to the broker; and a reader of the fleet."""

    def __init__(self, broker: Mosquitto) -> None:
        place = BrokerAccess("127.0.0.1", broker.port, False)
        self.connection = BrokerConnection(place, "s/a", LastWill(self.topic("state"), self.state("offline")))
        self.publisher = Publisher(self.connection, DiskQueue(None, print), print)
        self.instance = AgentInstance("L", "T")
        self.publisher.retain(self.topic("state"), self.state("online"))
        self.publisher.retain(self.topic("status", "L", "T"), status().to_json())
        self.heard = BrokerConnection(place, "fleet", topics=state_topics("*"))
        self.reader = FleetReader(self.heard, FleetModel(), "*")
        self.connection.start()
        self.heard.start()

    def topic(self, kind: str, line: str = "", instance: str = "") -> str:
        return str(Topic("s", "a", line, instance, kind))

    def state(self, state: str) -> bytes:
        return StateMessage(state, time.time(), "0", "pc-7").to_json()

    def fail(self, times: int) -> None:
        for _ in range(times):
            event = self.instance.add_event("b0", time.time(), "error", "80A6", {"text": "reset"})
            self.publisher.send_event(self.topic("event", "L", "T"), event.to_json())
            message = self.instance.recent_message(time.time())
            self.publisher.retain(self.topic("recent", "L", "T"), message.to_json())

    def turn(self) -> None:
        self.publisher.advance(clock.now_ns())
        self.reader.advance(clock.now_ns(), time.time(), SECOND)

    @property
    def line(self) -> FleetLine | None:
        self.turn()
        return next(iter(self.reader.fleet.sort_lines(time.time())), None)

    @property
    def seqs(self) -> list[int]:
        line = self.line
        return [] if line is None or not line.instances else [e.seq for e in line.instances["T"].log.kept]

    def has_settled(self) -> bool:
        """Return whether the reader knows that what comes from now on is new."""
        self.turn()
        agents = self.reader.fleet.agents.values()
        return self.reader.has_caught_up and bool(agents) and all(agent.has_begun for agent in agents)

    def is_alone(self) -> bool:
        self.turn()
        return not (self.reader.is_up or self.publisher.is_up)

    def close(self) -> None:
        self.connection.close()
        self.heard.close()


@pytest.fixture
def line(broker: Mosquitto) -> Iterator[OneLine]:
    made = OneLine(broker)
    yield made
    made.close()


def test_after_a_killed_broker_came_back_no_event_is_missing_and_none_stands_twice(
    line: OneLine, broker: Mosquitto
) -> None:
    until(line.has_settled)
    line.fail(3)
    until(lambda: line.seqs == [1, 2, 3])
    broker.kill()
    until(line.is_alone)
    line.fail(60)
    assert "refused" in line.reader.why or "ended" in line.reader.why
    assert broker.start()
    until(lambda: len(line.seqs) == 63 and not line.publisher.queue.size)
    found = line.line
    assert found is not None and found.missing == 0 and found.errors_an_hour(time.time()) == 63
    assert line.seqs == [*range(1, 64)]


def test_an_agent_that_dies_without_a_word_makes_its_line_offline_at_once(
    line: OneLine, broker: Mosquitto
) -> None:
    until(line.has_settled)
    line.connection._ends.set()
    line.connection._close_socket()  # as the system does for a process that was killed
    until(lambda: (found := line.line) is not None and found.agent.is_offline)
