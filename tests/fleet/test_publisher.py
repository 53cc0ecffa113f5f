"""What an agent gives the broker, and when: each event once, retained topics first, within its bound."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import pytest

from trcvtui.errors import UserError
from trcvtui.fleet.broker import (
    BrokerConnection,
    BrokerEvent,
    ConnAck,
    ConnectionLost,
    PublishAck,
    PublishRefusal,
)
from trcvtui.fleet.disk_queue import EVENT, DiskQueue
from trcvtui.fleet.publisher import LEAST_GAP_NS, QUEUE_DELAY_NS, RESEND_NS, Publisher

SECOND = 1_000_000_000


class Line:
    """A broker that is there or not, and acknowledges what it gets when it is told to."""

    def __init__(self) -> None:
        self.got: list[tuple[str, bytes]] = []
        self.said: list[str] = []
        self._news: list[BrokerEvent] = []
        self._unacknowledged: list[int] = []
        self._is_there = False
        self.queue = DiskQueue(None, self.said.append, 5)
        self.publisher = Publisher(cast(BrokerConnection, self), self.queue, self.said.append)
        self.now = 0

    def come(self) -> None:
        self._is_there = True
        self._news.append(ConnAck())

    def go(self) -> None:
        self._is_there = False
        self._unacknowledged.clear()
        self._news.append(ConnectionLost("the broker is away"))

    def acknowledge(self) -> None:
        self._news += [PublishAck(number) for number in self._unacknowledged]
        self._unacknowledged.clear()

    def refuse(self) -> None:
        self._news += [PublishRefusal(number, "Not authorized") for number in self._unacknowledged]
        self._unacknowledged.clear()

    def take_events(self) -> list[BrokerEvent]:
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
        self.publisher.advance(self.now)


def test_an_event_after_the_queue_was_empty_is_sent_too() -> None:
    line = Line()
    line.come()
    line.pass_time(3)
    line.pass_time(3)
    for number in range(4):
        line.publisher.send_event("e", b"%d" % number)
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
    line.publisher.send_event("e", b"1")
    line.pass_time(3)
    line.go()  # it has not acknowledged the event
    line.pass_time()
    line.publisher.retain("r", b"new")
    line.publisher.send_event("e", b"2")
    line.got.clear()
    line.come()
    line.pass_time()
    assert line.got == [("r", b"new")]
    line.pass_time(QUEUE_DELAY_NS / SECOND)
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


def test_recent_goes_out_at_once_and_then_once_a_minute_with_what_there_is_by_then() -> None:
    line = Line()
    line.come()
    events: list[int] = []
    for number in range(121):
        events.append(number)
        line.publisher.retain("recent", lambda: b"%d" % len(events), 60 * SECOND)
        line.pass_time(1 if number else 0)
    assert [payload for _, payload in line.got] == [b"1", b"61", b"121"]


def test_past_the_bound_the_oldest_figures_go_first_and_it_is_said() -> None:
    line = Line()
    line.publisher.send_figures("f", b"figures")
    for number in range(6):
        line.publisher.send_event("e", b"%d" % number)
    assert line.queue.size == 5
    line.come()
    line.pass_time()
    assert "dropped while the broker was away: 1 figures, 1 events" in line.said
    line.pass_time(3)
    assert [payload for topic, payload in line.got if topic == "e"] == [b"1", b"2", b"3", b"4", b"5"]


def test_what_the_broker_refuses_stays_and_is_sent_again_after_a_pause_that_grows() -> None:
    line = Line()
    line.come()
    line.pass_time(3)
    line.pass_time(3)
    line.publisher.retain("state", b"online")
    line.publisher.send_event("e", b"1")
    line.pass_time()
    line.refuse()
    line.publisher.send_event("other", b"2")
    line.pass_time()
    line.acknowledge()
    line.pass_time()
    assert line.got[2:] == [("other", b"2")] and line.queue.size == 1
    line.pass_time(RESEND_NS / SECOND)
    assert sorted(line.got[3:]) == [("e", b"1"), ("state", b"online")]
    line.refuse()
    line.pass_time(RESEND_NS / SECOND + 1)
    assert len(line.got) == 5  # the second pause is twice as long
    line.pass_time(2 * RESEND_NS / SECOND)
    line.acknowledge()
    line.pass_time()
    assert len(line.got) == 7 and not line.queue.size
    refusals = [said for said in line.said if "refuses" in said]
    assert len(refusals) == 2 and "'state': Not authorized" in refusals[0]


def test_a_topic_of_an_instance_that_is_gone_is_cleared_once(tmp_path: Path) -> None:
    path = tmp_path / "queue.sqlite"
    before = Publisher(cast(BrokerConnection, Line()), DiskQueue(path, print), print)
    before.retain("gone", b"1")
    before.retain("stays", b"1")
    before.queue.close()
    line = Line()
    line.queue = DiskQueue(path, line.said.append)
    line.publisher = Publisher(cast(BrokerConnection, line), line.queue, line.said.append)
    line.come()
    line.publisher.clear_all_but(lambda topic: topic == "stays")
    line.pass_time()
    assert line.got == [("gone", b"")]
    line.acknowledge()
    line.pass_time()
    assert line.queue.list_topics() == ["stays"]
    line.queue.close()


# -- the file of the queue -------------------------------------------------------------------------------


def test_what_waits_is_there_when_the_agent_starts_anew_and_no_other_user_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "queue.sqlite"
    path.touch(0o644)
    queue = DiskQueue(path, print)
    queue.put(EVENT, "e", b"kept")
    assert {file.stat().st_mode & 0o777 for file in tmp_path.iterdir()} == {0o600}
    with pytest.raises(UserError, match="another running agent with both"):
        DiskQueue(path, print)
    queue.close()
    again = DiskQueue(path, print)
    assert [(topic, payload) for _, topic, payload in again.list_after(0, 9)] == [("e", b"kept")]
    again.close()


def test_a_damaged_file_is_set_aside_and_a_new_queue_begins(tmp_path: Path) -> None:
    path, said = tmp_path / "queue.sqlite", list[str]()
    path.write_bytes(b"no database" * 100)
    queue = DiskQueue(path, said.append)
    assert queue.put(EVENT, "e", b"1") and len(queue.list_after(0, 9)) == 1
    assert len([*tmp_path.glob("queue.damaged-*")]) == 1 and "damaged" in said[-1]
    queue.close()


def test_a_file_that_is_damaged_while_it_is_used_ends_nothing(tmp_path: Path) -> None:
    path, said = tmp_path / "queue.sqlite", list[str]()
    queue = DiskQueue(path, said.append)
    for number in range(200):
        queue.put(EVENT, "e", b"%d" % number * 100)
    queue.close()
    content = bytearray(path.read_bytes())
    content[4096:] = b"\xaa" * (len(content) - 4096)
    path.write_bytes(content)
    queue = DiskQueue(path, said.append)
    queue.list_after(0, 9)
    queue.put(EVENT, "e", b"1")
    assert queue.put(EVENT, "e", b"2") and any("damaged" in line for line in said)
    assert [payload for _, _, payload in queue.list_after(200, 9)][
        -1
    ] == b"2"  # after all that was sent before
    queue.close()


def test_what_a_full_disk_does_not_delete_waits_no_more_when_there_is_room_again(tmp_path: Path) -> None:
    queue = DiskQueue(tmp_path / "queue.sqlite", print)
    for payload in (b"1", b"2"):
        queue.put(EVENT, "e", payload)
    first, last = [number for number, _, _ in queue.list_after(0, 9)]
    queue._base.execute("PRAGMA query_only=1")  # as a full disk answers
    queue.delete(first)
    assert queue.size == 2
    queue._base.execute("PRAGMA query_only=0")
    queue.delete(last)
    assert queue.size == 0 and queue.list_after(0, 9) == []
    queue.close()


def test_without_room_on_the_disk_an_event_goes_at_once_or_is_counted(tmp_path: Path) -> None:
    line = Line()
    line.queue = DiskQueue(tmp_path / "queue.sqlite", line.said.append)
    line.publisher = Publisher(cast(BrokerConnection, line), line.queue, line.said.append)
    line.queue._base.execute("PRAGMA max_page_count=1")  # as a full disk answers
    line.publisher.send_event("e", b"0" * 5000)
    assert sum(line.queue.dropped.values()) == 1
    line.come()
    line.pass_time()
    line.publisher.send_event("e", b"1" * 5000)
    assert line.got[-1] == ("e", b"1" * 5000) and sum(line.queue.dropped.values()) == 1
    assert len([said for said in line.said if "full" in said]) == 1
    line.queue.close()
