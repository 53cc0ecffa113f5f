"""One engine, several tabs: each gets its own answers, all the same bench, and none of them stops it."""

from __future__ import annotations

import pickle
import socket
import struct
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from multiprocessing.connection import Client

import pytest
from msgspec.msgpack import encode

from tests.local_driver import wait_for
from tests.scenario.scenarios import CONFIGS
from trcvtui.engine.driver import AttachedDriver, EngineDriver, ProcessDriver
from trcvtui.engine.screens import MOST_ECHO_CHARS, MOST_MESSAGE_BYTES
from trcvtui.errors import UserError
from trcvtui.paths import demo_path
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.picture.protocol import MOST_TABS, READ_ONLY, EngineStopped
from trcvtui.snapshots.bench import LineAnswer

PASSIVE = CONFIGS / "passive.toml"


@pytest.fixture
def engine() -> Iterator[EngineDriver]:
    with closing(EngineDriver(PASSIVE, "live", is_shared=True)) as driver:
        driver.wait_for_project()
        yield driver


@contextmanager
def tabs_of(engine: EngineDriver, count: int) -> Iterator[list[AttachedDriver]]:
    tabs = [AttachedDriver(engine.door) for _ in range(count)]
    try:
        for tab in tabs:
            tab.wait_for_project()
        yield tabs
    finally:
        for tab in tabs:
            tab.close()


def answers(tab: ProcessDriver, most: int) -> list[LineAnswer]:
    """Return the answers that come until there are `most`, and those in two more pictures."""
    got: list[LineAnswer] = []
    later = 0
    while len(got) < most or later < 2:
        later += len(got) >= most
        got += wait_for(tab, lambda picture: True).answers
    return got


def asked(tab: AttachedDriver, request: UpdateRequest) -> BenchUpdate:
    tab.request(request)
    while (picture := tab.poll_picture()) is None:
        tab.wait_for_message(1)
    return picture


def test_an_answer_goes_to_the_tab_that_gave_the_line_and_its_effect_is_seen_in_all(
    engine: EngineDriver,
) -> None:
    with tabs_of(engine, 2) as (first, second):
        assert first.submit("set TRCV_C_1 EN_R=1") == second.submit("set TRCV_C_1 CUNT=1") == 1
        for tab, wrong in ((second, "CUNT"), (first, "")):
            [answer] = answers(tab, 1)
            assert answer.number == 1 and (wrong in answer.error if wrong else answer.error == "")
        for tab in (first, second):
            wait_for(tab, lambda picture: bool(picture.snapshot.instances[0].pin("EN_R")))


def test_the_later_answer_of_the_doctor_goes_to_the_tab_that_asked_it(engine: EngineDriver) -> None:
    with tabs_of(engine, 2) as (asks, other):
        asks.submit("doctor")
        other.submit("mark")
        looks, found = answers(asks, 2)
        assert looks.number == found.number == 1 and "looks" in looks.message and "looks" not in found.message
        assert [answer.line for answer in answers(other, 1)] == ["mark"]


def test_a_scenario_that_one_tab_loads_is_on_the_bench_of_all(engine: EngineDriver) -> None:
    scenario = sorted((CONFIGS / "scenarios" / "baosky").glob("80c5*.toml"))[0]
    with tabs_of(engine, 2) as (loads, other):
        loads.submit(f"scenario load {scenario} sim")
        picture = wait_for(other, lambda picture: picture.bench == 1)
        assert picture.player is not None and picture.holding and picture.answers == ()
        loads.submit("scenario stop")
        wait_for(other, lambda picture: picture.bench == 2 and picture.player is None)


def test_many_lines_of_many_tabs_are_all_answered(engine: EngineDriver) -> None:
    with tabs_of(engine, MOST_TABS) as tabs:
        for number in range(100):
            for tab in tabs:
                tab.submit(f"set TRCV_C_1 LEN={number % 8}")
        for tab in tabs:
            assert [answer.number for answer in answers(tab, 100)] == [*range(1, 101)]


def test_a_tab_that_comes_late_has_what_the_others_had() -> None:
    with closing(EngineDriver(demo_path(), "live", is_shared=True)) as engine:
        engine.wait_for_project()
        with tabs_of(engine, 1) as [early]:
            name = early.wait_for_project().instances[0].name
            seen = wait_for(early, lambda picture: picture.snapshot.instances[0].jobs_done >= 2)
        with tabs_of(engine, 1) as [late]:  # no tab was there meanwhile
            picture = asked(late, UpdateRequest(waves=((name, 0),), messages=(name, 0, 1 << 62)))
            after = asked(late, UpdateRequest(1 << 60, waves=((name, 1 << 60),)))  # that has not been
    assert picture.snapshot.scan > seen.snapshot.scan
    assert picture.lines[0].seq == 1 and picture.lines_skipped == 0
    assert picture.messages is not None and len(picture.messages.rows) >= 2
    assert after.lines == () and after.waves[0].changes == ()
    assert picture.waves[0].first == 1 and len(picture.waves[0].changes) > 2


WRONG = {
    "half a message": struct.pack("!i", 100) + b"half",
    "no length": struct.pack("!i", -1) + b"x" * 9,
    "too long a message": struct.pack("!i", MOST_MESSAGE_BYTES + 1),
    "garbage": b"\xff" * 5000,
    "a pickle": struct.pack("!i", 40) + pickle.dumps(UpdateRequest()).ljust(40, b"."),
    "a number of no line": encode((0, b"hold")),
    "a line that is no text": encode((1, b"\xff\xfe")),
    "a request of wrong types": encode({"since_seq": "x"}),
    "a request for more than a picture holds": encode(UpdateRequest(data=("rx",) * 65)),
    "a deep one": encode({"unknown": 0})[:-1] + b"\x91" * 9999,
}


@pytest.mark.parametrize("said", WRONG.values(), ids=WRONG)
def test_a_tab_that_says_what_no_tab_says_or_dies_ends_alone(engine: EngineDriver, said: bytes) -> None:
    is_framed = said[:2] in (b"\0\0", b"\xff\xff") or len(said) < 5
    wrong = Client(str(engine.door))
    with socket.socket(fileno=wrong.fileno()) as raw, tabs_of(engine, 1) as [other]:
        raw.sendall(said if is_framed else struct.pack("!i", len(said)) + said)
        raw.shutdown(socket.SHUT_WR)
        while raw.recv(1 << 16):
            pass  # the project, then the end
        wait_for(other, lambda picture: True)
        raw.detach()
    wrong.close()


def test_a_tab_that_reads_nothing_stops_neither_the_bench_nor_the_others(engine: EngineDriver) -> None:
    with closing(Client(str(engine.door))) as deaf, tabs_of(engine, 1) as [other]:
        for number in range(1, 3000):
            deaf.send_bytes(encode((number, b"set TRCV_C_1 CUNT=1")))
            deaf.send_bytes(encode(UpdateRequest(data=("rx",))))
        other.submit("set TRCV_C_1 EN_R=1")
        assert [answer.error for answer in answers(other, 1)] == [""]
        scan = wait_for(other, lambda picture: True).snapshot.scan
        wait_for(other, lambda picture: picture.snapshot.scan > scan + 5)


def test_a_line_that_is_too_long_for_a_tab_is_refused_to_the_first_screen(engine: EngineDriver) -> None:
    engine.submit("x" * (MOST_MESSAGE_BYTES + 1))
    [answer] = answers(engine, 1)
    assert str(MOST_MESSAGE_BYTES + 1) in answer.error and len(answer.line) == MOST_ECHO_CHARS


def test_one_tab_too_many_is_turned_away(engine: EngineDriver) -> None:
    with tabs_of(engine, MOST_TABS) as tabs:
        with pytest.raises(EngineStopped), tabs_of(engine, 1):
            pass
        tabs[0].close()
        while True:  # the engine finds the end of that one at its next look
            with suppress(EngineStopped), tabs_of(engine, 1):
                break


def test_a_tab_that_looks_on_is_answered_and_nothing_is_carried_out() -> None:
    with closing(EngineDriver(PASSIVE, "live", read_only=True, is_shared=True)) as engine:
        engine.wait_for_project()
        with tabs_of(engine, 1) as [tab]:
            lines = ("hold", "set TRCV_C_1 EN_R=1", "scenario stop", "save project x.toml", "mark")
            for line in (*lines, "expect TRCV_C_1 EN_R=0"):
                tab.submit(line)
            assert [answer.error for answer in answers(tab, 6)] == [*[READ_ONLY] * len(lines), ""]
            wait_for(tab, lambda picture: picture.snapshot.scan > 5 and not picture.holding)


def test_the_scan_of_a_trigger_is_shown_to_each_tab_once(engine: EngineDriver) -> None:
    fired: dict[int, list[int]] = {0: [], 1: []}

    def note(number: int, picture: BenchUpdate) -> bool:
        fired[number] += [picture.fired.scan] if picture.fired is not None else []
        return bool(fired[number])

    with tabs_of(engine, 2) as tabs:
        for tab in tabs:
            wait_for(tab, lambda picture: True)
        tabs[0].submit("trigger TRCV_C_1 EN_R rises")
        tabs[0].submit("set TRCV_C_1 EN_R=1")
        for number, tab in enumerate(tabs):
            wait_for(tab, lambda picture, number=number: note(number, picture))  # type: ignore[misc]
        for number, tab in enumerate(tabs):
            for _ in range(3):
                wait_for(tab, lambda picture, number=number: note(number, picture) or True)  # type: ignore[misc]
        with tabs_of(engine, 1) as [late]:
            for _ in range(3):
                assert wait_for(late, lambda picture: True).fired is None
    assert fired[0] == fired[1] and len(fired[0]) == 1


def test_a_tab_without_an_engine_is_told_in_one_line(engine: EngineDriver) -> None:
    with tabs_of(engine, 1) as [tab]:
        engine.close()
        with pytest.raises(EngineStopped, match="has ended"):
            wait_for(tab, lambda picture: False)
    with pytest.raises(UserError) as refused:
        AttachedDriver(engine.door.with_name("nothing"))
    assert len(refused.value.lines()) == 1
