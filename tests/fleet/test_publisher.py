"""What an agent gives the broker, and when: each event once, retained topics first, within its bound."""

from __future__ import annotations

from pathlib import Path
from typing import cast

from trcvtui.fleet.broker import BrokerConnection, Connected, Lost, News, Taken
from trcvtui.fleet.publisher import EVENT, HOLD_NS, LEAST_GAP_NS, DiskQueue, Publisher

SECOND = 1_000_000_000


class Line:
    """A broker that is there or not, and acknowledges what it gets when it is told to."""

    def __init__(self) -> None:
        self.got: list[tuple[str, bytes]] = []
        self.said: list[str] = []
        self._news: list[News] = []
        self._unacknowledged: list[int] = []
        self._is_there = False
        self.queue = DiskQueue(None, 5)
        self.publisher = Publisher(cast(BrokerConnection, self), self.queue, self.said.append)
        self.now = 0

    def come(self) -> None:
        self._is_there = True
        self._news.append(Connected())

    def go(self) -> None:
        self._is_there = False
        self._unacknowledged.clear()
        self._news.append(Lost("the broker is away"))

    def acknowledge(self) -> None:
        self._news += [Taken(number) for number in self._unacknowledged]
        self._unacknowledged.clear()

    def news(self) -> list[News]:
        news, self._news = self._news, []
        return news

    def publish(self, topic: str, payload: bytes, is_retained: bool = False) -> int | None:
        if not self._is_there:
            return None
        self.got.append((topic, payload))
        self._unacknowledged.append(len(self.got))
        return len(self.got)

    def pass_time(self, seconds: float = 1) -> None:
        self.now += int(seconds * SECOND)
        self.publisher.turn(self.now)


def test_an_event_after_the_queue_was_empty_is_sent_too() -> None:
    line = Line()
    line.come()
    line.pass_time(3)
    line.pass_time(3)
    for number in range(4):
        line.publisher.event("e", b"%d" % number)
        line.pass_time()
        line.acknowledge()
        line.pass_time()
        assert not line.queue.size
    assert line.got == [("e", b"%d" % number) for number in range(4)]


def test_after_a_reconnect_retained_topics_go_first_and_no_event_is_lost() -> None:
    line = Line()
    line.come()
    line.pass_time(3)
    line.publisher.retain("r", b"old")
    line.publisher.event("e", b"1")
    line.pass_time(3)
    line.go()  # it has not acknowledged the event
    line.pass_time()
    line.publisher.retain("r", b"new")
    line.publisher.event("e", b"2")
    line.got.clear()
    line.come()
    line.pass_time()
    assert line.got == [("r", b"new")]
    line.pass_time(HOLD_NS / SECOND)
    assert line.got[1:] == [("e", b"1"), ("e", b"2")]
    line.acknowledge()
    line.pass_time()
    assert not line.queue.size


def test_a_topic_that_changes_fast_costs_one_message_a_second_with_the_newest() -> None:
    line = Line()
    line.come()
    for tenth in range(21):
        line.publisher.retain("s", b"%d" % tenth)
        line.pass_time(LEAST_GAP_NS / SECOND / 10 if tenth else 0)
    assert [payload for _, payload in line.got] == [b"0", b"10", b"20"]


def test_past_the_bound_the_oldest_figures_go_first_and_it_is_said() -> None:
    line = Line()
    line.publisher.figures("f", b"figures")
    for number in range(6):
        line.publisher.event("e", b"%d" % number)
    assert line.queue.size == 5
    line.come()
    line.pass_time()
    assert "no room while the broker was away: 1 figures, 1 events" in line.said
    line.pass_time(3)
    assert [payload for topic, payload in line.got if topic == "e"] == [b"1", b"2", b"3", b"4", b"5"]


def test_what_waits_is_there_when_the_agent_starts_anew(tmp_path: Path) -> None:
    queue = DiskQueue(tmp_path / "queue.sqlite")
    queue.put(EVENT, "e", b"kept")
    queue.close()
    again = DiskQueue(tmp_path / "queue.sqlite")
    assert [(topic, payload) for _, topic, payload in again.after(0, 9)] == [("e", b"kept")]
    again.close()
