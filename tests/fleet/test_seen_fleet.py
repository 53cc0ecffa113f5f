"""What a reader knows of all lines: each event once, gaps told, the worst first, hostile messages bounded."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.fleet.fakes import NOW, OFF, ONLINE, SECOND, FakeBroker, event, figures, recent, status
from trcvtui.cli.main import main
from trcvtui.errors import UserError
from trcvtui.fleet import seen_fleet
from trcvtui.fleet.broker import (
    ConnAck,
    ConnectionLost,
    IncomingMessage,
    SubscribeRefusal,
)
from trcvtui.fleet.event_log import EventLog
from trcvtui.fleet.reader import (
    LACK_CHECK_NS,
    MOST_PENDING_AGENTS,
    MOST_REQUESTS,
    REPORT_PAUSE_NS,
    RETURN_TIMEOUT_NS,
    SETTLE_NS,
    TOO_MANY_TEXT,
    state_topics,
)
from trcvtui.fleet.seen_fleet import (
    AWAY,
    ERROR,
    FINDING,
    GOOD,
    HAD,
    OFFLINE,
    STALE,
    STUCK,
    STUCK_S,
    FleetModel,
)
from trcvtui.fleet.topics import (
    AnyMessage,
    Topic,
)

# -- events of an instance -------------------------------------------------------------------------------


def test_what_was_before_we_looked_is_not_missing_but_a_new_run_of_the_agent_begins_at_1() -> None:
    log = EventLog()
    log.add_events(recent(100, 101).events)
    assert log.missing == 0
    log.count_from_one()
    log.add_events([event(3, "c")])
    assert log.missing == 2
    log.add_events(recent(1, 2, 3, boot="c").events)
    assert log.missing == 0


def test_an_instance_without_an_event_so_far_misses_those_that_recent_has_no_more() -> None:
    log = EventLog()
    log.count_from_one()
    log.add_events(recent(*range(37, 101)).events)
    assert log.missing == 36


def test_history_comes_once_even_where_its_numbers_are_known_no_more() -> None:
    log = EventLog()
    log.add_events([event(5000)])
    assert len(log.add_events([event(seq) for seq in range(1, 3000)])) == 2999
    assert log.add_events([event(1), event(5000)]) == []
    assert len(log.kept) == 64 and log.missing == 0


@given(st.lists(st.integers(1, 200), min_size=1, max_size=120), st.booleans())
def test_whatever_comes_in_whatever_order_nothing_stands_twice_and_the_rest_is_missing(
    seqs: list[int], has_begun: bool
) -> None:
    log = EventLog()
    if has_begun:
        log.count_from_one()
    fresh = [kept.seq for seq in seqs for kept in log.add_events([event(seq)])]
    assert len(set(fresh)) == len(fresh)
    first = 1 if has_begun else seqs[0]
    wanted = set(range(first, max(seqs) + 1)) - set(seqs)
    assert log.missing == len(wanted)
    assert [each.seq for each in log.kept] == sorted(fresh)[-64:]


# -- the lines -------------------------------------------------------------------------------------------


class Fleet:
    """A fleet, told by short words."""

    def __init__(self) -> None:
        self.seen = FleetModel()

    def tell(self, place: str, message: AnyMessage | None, kind: str = "") -> None:
        site, agent, line, instance = [*place.split("/"), "", "", ""][:4]
        topic = Topic(site, agent, line, instance, kind or (message.KIND if message else ""))
        self.seen.apply(topic, message, NOW)

    def line(self, place: str, code: str = "7006", error: bool = False, errors: int = 0) -> None:
        site, agent, _ = place.split("/")
        self.tell(f"{site}/{agent}", ONLINE)
        self.tell(place, figures(errors=errors))
        self.tell(f"{place}/T", status(code, error))

    def names(self, wall: float = NOW) -> list[str]:
        return [line.name for line in self.seen.sort_lines(wall)]


def test_the_worst_stands_first_offline_then_error_then_the_most_errors_an_hour() -> None:
    fleet = Fleet()
    for place, error, errors in (("s/a/good", False, 0), ("s/a/many", False, 9), ("s/a/bad", True, 1)):
        fleet.line(place, "80A6" if error else "7006", error, errors)
    fleet.line("s/b/gone")
    fleet.line("s/a/away")
    fleet.tell("s/a/away", figures("listening"))
    assert fleet.names() == ["bad", "away", "many", "good", "gone"]
    fleet.tell("s/b", OFF)
    assert fleet.names() == ["gone", "bad", "away", "many", "good"]
    lines = fleet.seen.sort_lines(NOW)
    assert [line.shows for line in lines] == [OFFLINE, ERROR, AWAY, HAD, GOOD]
    assert lines[0].shown_since(NOW) == NOW
    fleet.seen.apply(Topic("s", "b", "", "", "state"), OFF, NOW + 9, is_retained=True)
    assert lines[0].shown_since(NOW + 9) == NOW + 5


def test_a_finding_and_a_stuck_job_are_no_good_lines_and_the_oldest_of_a_kind_comes_first() -> None:
    fleet = Fleet()
    for number, (name, finding) in enumerate((("new", "byte order"), ("old", "byte order"), ("stuck", ""))):
        fleet.line(f"s/a/{name}")
        shown = replace(status(), finding=finding, here=0 if finding else 12, t=NOW - number / 10)
        fleet.tell(f"s/a/{name}/T", shown)
    fleet.line("s/a/good")
    fleet.tell("s/a/good/T", replace(status(), here=0))
    assert fleet.names(NOW + STUCK_S - 1) == ["old", "new", "good", "stuck"]
    lines = fleet.seen.sort_lines(NOW + STUCK_S + 11)
    assert [(line.name, line.shows) for line in lines] == [
        ("old", FINDING), ("new", FINDING), ("stuck", STUCK), ("good", GOOD),
    ]  # fmt: skip
    assert lines[0].cause == "byte order" and lines[2].shown_since(NOW + 21) == NOW - 0.2
    fleet.tell("s/a", replace(ONLINE, state="stale", t=NOW))
    assert {line.shows for line in fleet.seen.sort_lines(NOW)} == {STALE}


def test_events_that_waited_for_the_broker_are_dated_when_they_were() -> None:
    fleet = Fleet()
    fleet.line("s/a/L")
    for seq in range(1, 91):
        fleet.tell("s/a/L/T", event(seq, t=NOW - 1800 + 20 * seq), "event")
    [line] = fleet.seen.sort_lines(NOW)
    assert line.agent.skew_s == 0 and max(line.sparkline(NOW)) <= 16


@pytest.mark.parametrize("wrong", [-7200.0, 7200.0, float(1 << 53)])
def test_a_clock_that_is_wrong_hides_no_error_keeps_none_for_ever_and_is_told(wrong: float) -> None:
    fleet = Fleet()
    seen, at = fleet.seen, NOW + wrong
    seen.apply(Topic("s", "a", "", "", "state"), replace(ONLINE, state="online", t=at), NOW)
    seen.apply(Topic("s", "a", "L", "", "figures"), figures(errors=3, t=at), NOW)
    seen.apply(Topic("s", "a", "L", "T", "status"), replace(status(), t=at), NOW)
    seen.apply(Topic("s", "a", "L", "T", "event"), event(1, t=at), NOW)
    [line] = seen.sort_lines(NOW)
    assert line.errors_hour == 3 and sum(line.sparkline(NOW)) == 1
    assert line.agent.skew_s == (0 if wrong > 1e9 else -wrong)
    assert abs((line.shown_since(NOW) or 0) - (NOW - 60)) < 1
    assert seen.sort_lines(NOW + 7300)[0].errors_hour == 0


def test_an_agent_has_a_row_without_lines_and_offline_it_makes_all_of_them_offline_at_once() -> None:
    fleet = Fleet()
    fleet.tell("s/a", ONLINE)
    [line] = fleet.seen.sort_lines(NOW)
    assert (line.name, line.shows, line.cause) == ("", AWAY, "the agent has sent no line")
    for number in range(50):
        fleet.line(f"s/a/L{number}")
    fleet.tell("s/a", OFF)
    assert [line.shows for line in fleet.seen.sort_lines(NOW)] == [OFFLINE] * 50
    fleet.tell("s/a", ONLINE)
    assert {line.shows for line in fleet.seen.sort_lines(NOW)} == {GOOD}


def test_errors_of_an_hour_are_drawn_by_their_times_and_grow_old() -> None:
    fleet = Fleet()
    fleet.line("s/a/L")
    for seq, ago in ((1, 4000), (2, 1800), (3, 1800), (4, 0)):
        fleet.tell("s/a/L/T", event(seq, t=NOW - ago), "event")
    fleet.tell("s/a/L/T", event(5, kind="note"), "event")
    [line] = fleet.seen.sort_lines(NOW)
    assert line.errors_an_hour(NOW) == 3
    assert line.sparkline(NOW)[-1] == 1 and sum(line.sparkline(NOW)) == 3
    assert line.cause == "16#80A6 recv ECONNRESET"
    fleet.tell("s/a/L/T", replace(status(), here=0))
    fleet.names(NOW + 7200)
    assert line.errors_an_hour(NOW + 7200) == 0 and line.cause == "no error in the last hour"


def test_a_cleared_topic_takes_what_it_told_of_away() -> None:
    fleet = Fleet()
    for place in ("s/a/L", "s/a/M", "s/b/N"):
        fleet.line(place)
    fleet.tell("s/a/L", None, "figures")
    assert len(fleet.names()) == 3
    fleet.tell("s/a/L/T", None, "status")
    assert fleet.names() == ["M", "N"]
    fleet.tell("s/a", None, "state")
    assert fleet.names() == ["N"] and fleet.seen.names == 3


def test_what_has_no_room_is_refused_and_memory_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seen_fleet, "MOST_NAMES", 8)
    fleet = Fleet()
    for place in ("s/a/L", "s/a/M", "s/b/N"):
        fleet.line(place)
    for place, message in (("s/c", ONLINE), ("s/a/O", figures()), ("s/a/L/U", status())):
        with pytest.raises(UserError, match="at most 8 names"):
            fleet.tell(place, message)
    fleet.tell("s/a/L/T", recent(*range(1, 101)), "recent")
    assert len(fleet.seen.agents["s", "a"].lines["L"].instances["T"].log.kept) == 64
    fleet.tell("s/b", None, "state")
    fleet.line("s/a/O")
    assert fleet.names() == ["L", "M", "O"]


# -- from a broker ---------------------------------------------------------------------------------------


def test_agents_are_asked_for_a_few_at_a_time() -> None:
    broker = FakeBroker()
    broker.tell(ConnAck(), *(broker.message(f"s/a{n}/state", ONLINE) for n in range(20)))
    assert len(broker.asked) == MOST_PENDING_AGENTS
    assert broker.asked[0] == ("s/a0/+/figures", "s/a0/+/+/status", "s/a0/+/+/event", "s/a0/+/+/recent")
    assert not broker.reader.has_caught_up
    broker.take_subscriptions()
    assert [topics[0] for topics in broker.asked] == [f"s/a{n}/+/figures" for n in range(20)]
    assert broker.reader.has_caught_up


@pytest.mark.parametrize(
    ("pattern", "subscribed", "sites"),
    [
        ("*", "trcvtui/v1/+/+/state", {"plant1", "plant2", "mill"}),
        ("plant*", "trcvtui/v1/+/+/state", {"plant1", "plant2"}),
        ("mill", "trcvtui/v1/mill/+/state", {"mill"}),
        ("a/b", "trcvtui/v1/a%2Fb/+/state", set()),
    ],
)
def test_only_the_sites_that_fit_are_asked_for(pattern: str, subscribed: str, sites: set[str]) -> None:
    broker = FakeBroker(pattern)
    assert state_topics(pattern) == (subscribed,)
    broker.tell(ConnAck(), *(broker.message(f"{s}/a/state", ONLINE) for s in ("plant1", "plant2", "mill")))
    assert {topics[0].partition("/")[0] for topics in broker.asked} == sites
    assert broker.reader.refused == 0


def test_a_broker_that_has_forgotten_all_brings_nothing_twice_and_says_what_is_missing() -> None:
    broker = FakeBroker()
    broker.tell(ConnAck(), broker.message("s/a/state", ONLINE), broker.message("s/a/L/T/status", status()))
    broker.take_subscriptions()
    broker.tell(seconds=SETTLE_NS / SECOND)
    broker.tell(*(broker.message("s/a/L/T/event", event(n)) for n in (1, 2)))
    broker.tell(ConnectionLost("away"))
    assert broker.reader.why == "away" and not broker.reader.is_up
    broker.tell(ConnAck(), broker.message("s/a/state", ONLINE), seconds=60)
    broker.tell(broker.message("s/a/L/T/recent", recent(*range(1, 51))))
    broker.tell(*(broker.message("s/a/L/T/event", event(n)) for n in range(3, 51)))
    [line] = broker.reader.fleet.sort_lines(NOW)
    assert [each.seq for each in line.instances["T"].log.kept] == [*range(1, 51)]
    assert line.missing == 0 and line.errors_an_hour(NOW) == 50
    broker.tell(broker.message("s/a/L/T/recent", recent(*range(87, 151))))
    assert line.missing == 36


def test_what_a_broker_has_dropped_of_an_agent_is_asked_for_again_but_not_for_ever() -> None:
    broker = FakeBroker()
    broker.tell(ConnAck(), broker.message("s/a/state", ONLINE), broker.message("s/b/state", ONLINE))
    broker.tell(*(broker.message(f"s/{name}/L/figures", figures()) for name in "ab"))
    broker.tell(broker.message("s/b/L/T/status", status()))
    broker.take_subscriptions()
    assert len(broker.asked) == 2
    for _ in range(10):
        broker.tell(seconds=LACK_CHECK_NS / SECOND)
        broker.take_subscriptions()
    assert len(broker.asked) == 1 + MOST_REQUESTS
    assert {topics[0] for topics in broker.asked[2:]} == {"s/a/+/figures"}


def test_an_agent_that_does_not_come_back_with_its_broker_is_offline() -> None:
    broker = FakeBroker()
    both = [broker.message(f"s/{name}/state", ONLINE) for name in "ab"]
    lines = [broker.message(f"s/{name}/{name}/figures", figures()) for name in "ab"]
    broker.tell(ConnAck(), *both, *lines)
    broker.tell(ConnectionLost("away"))
    broker.tell(ConnAck(), both[1])
    broker.tell(seconds=RETURN_TIMEOUT_NS / SECOND - 1)
    assert [line.shows for line in broker.reader.fleet.sort_lines(NOW)] == [GOOD, GOOD]
    broker.tell(seconds=1)
    assert [line.shows for line in broker.reader.fleet.sort_lines(NOW)] == [OFFLINE, GOOD]
    assert broker.names == ["a", "b"]
    broker.tell(both[0])
    assert [line.shows for line in broker.reader.fleet.sort_lines(NOW)] == [GOOD, GOOD]


def test_each_refused_message_is_counted_and_one_line_a_second_is_told() -> None:
    broker = FakeBroker()
    wrong = IncomingMessage("trcvtui/v1/s/a/L/figures", b"{", False)
    broker.tell(ConnAck(), broker.message("s/a/state", ONLINE), wrong)
    assert broker.reader.last_refusal.startswith(
        "broker, trcvtui/v1/s/a/L/figures: found 'Input data was truncated'"
    )
    broker.tell(*(IncomingMessage(f"trcvtui/v1/\x1b[2J{n}/x", b"", False) for n in range(1000)))
    assert broker.reader.refused == 1001 and "truncated" in broker.reader.last_refusal
    broker.tell(SubscribeRefusal("it lets us not read"), seconds=REPORT_PAUSE_NS / SECOND)
    assert broker.reader.refused == 1001 and broker.reader.last_refusal == "it lets us not read"


def test_what_comes_faster_than_it_is_looked_at_is_counted() -> None:
    broker = FakeBroker()
    broker.dropped = 7  # before the reader had them
    broker.tell(broker.message("s/a/L/figures", figures()))
    assert broker.reader.refused == 7 and broker.reader.last_refusal == TOO_MANY_TEXT


def test_what_a_turn_has_no_time_for_waits_for_the_next_one() -> None:
    broker = FakeBroker()
    lines = [broker.message(f"s/a/L{n}/figures", figures()) for n in range(3)]
    broker.tell(ConnAck(), broker.message("s/a/state", ONLINE))
    broker.take_subscriptions()
    broker.waiting += lines
    broker.reader.advance(0, NOW, -1)
    assert broker.names == ["L0"] and not broker.reader.has_caught_up
    broker.tell()
    assert broker.names == ["L0", "L1", "L2"] and broker.reader.has_caught_up


texts = st.text(max_size=30)
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | texts,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(texts, inner, max_size=3),
    max_leaves=8,
)
hostile = st.binary(max_size=60) | values.map(lambda value: json.dumps(value).encode())
kinds = st.sampled_from(
    ["state", "figures", "L/figures", "L/T/status", "L/T/event", "L/T/recent", "L/T/request"]
)


@given(st.lists(st.tuples(texts, kinds, hostile), max_size=12))
def test_whatever_a_broker_sends_the_lines_go_on_and_what_is_told_is_one_plain_line(
    came: list[tuple[str, str, bytes]],
) -> None:
    broker = FakeBroker()
    broker.tell(ConnAck(), broker.message("s/a/state", ONLINE), broker.message("s/a/good/figures", figures()))
    topics = [f"trcvtui/v1/s/{name}/{kind}" for name, kind, _ in came]
    for names in (topics, [name for name, _, _ in came]):
        some = zip(names, came, strict=True)
        broker.tell(*(IncomingMessage(name, payload, False) for name, (_, _, payload) in some), seconds=2)
    assert "good" in broker.names
    assert broker.reader.last_refusal.isprintable() and len(broker.reader.last_refusal) < 900


# -- bad input -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("agent X", "found no output, expected --mqtt mqtts://HOST or --metrics ADDR:PORT"),
        ("agent X --metrics here", "--metrics: found 'here', expected ADDR:PORT"),
        ("agent X --mqtt mqtts://a:b@c", "a user or password in the URL"),
        ("agent X --mqtt mqtts://c --mqtt-ca nowhere", "--mqtt-ca: found no file 'nowhere'"),
        (
            "fleet http://x",
            "trcvtui fleet: found 'http://x', expected mqtts://HOST[:8883] or mqtt://HOST[:1883]",
        ),
        ("fleet mqtts://a:b@c", "trcvtui fleet: found a user or password in the URL"),
        ("fleet mqtts://c --mqtt-ca nowhere", "--mqtt-ca: found no file 'nowhere'"),
        ("fleet mqtts://c", "trcvtui fleet: found no terminal, expected a terminal"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(words: str, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words.replace("X", "configs/active.toml").split()) == 2
    said = capsys.readouterr()
    assert told in said.err and said.err.count("\n") == 1 and not said.out
