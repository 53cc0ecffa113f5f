"""The connection budget of a T4: 32 busy connections, and a 33rd that shows 8080 and disturbs nobody."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

import pytest

from tests.scenario.scenarios import Played, failures, play

T4: Final = 32
STATIC: Final = 4
ROUNDS: Final = 60  # of two scans: one DONE of each TRCV_C and of each TSEND_C

CONNECTION: Final = """
[[data]]
name = "rx{n}"
type = "ARRAY[1..{size}] OF BYTE"
[[connect]]
name = "C{n}"
LocalAddress = "127.0.0.1"
[[instance]]
name = "R{n}"
block = "TRCV_C"
connect = "C{n}"
data = "rx{n}"
CONT = true
EN_R = true
[[instance]]
name = "S{n}"
block = "TSEND_C"
connect = "C{n}"
data = "rx{n}"
CONT = true
[[peer]]
name = "P{n}"
active = true
remote = "@C{n}"
"""
ONE_TOO_MANY: Final = """
[[connect]]
name = "C33"
LocalAddress = "127.0.0.1"
[[instance]]
name = "T33"
block = "TRCV_C"
connect = "C33"
[[peer]]
name = "P33"
active = true
remote = "@C33"
"""


def t4(folder: Path, steps: str, head: str = "", more: str = "") -> Path:
    """Return a scenario of 32 connections, whose partners send a frame for each round and get frames back."""
    numbers = range(1, T4 + 1)
    busy = ["run 3", *(f"peer P{n} connect" for n in numbers), "wait S32 STATUS=7004"]
    busy += [f"set S{n} REQ=blink\npeer P{n} send random {ROUNDS * STATIC} seed={n}" for n in numbers]
    text = "\n".join([*busy, steps])
    file = folder / "t4.toml"
    file.write_text(
        'dialect = "baosky"\nmodel = "T4"\n'
        + head
        + "".join(CONNECTION.format(n=n, size=STATIC) for n in numbers)
        + more
        + f'[scenario]\nname = "T4"\nabout = ""\nsteps = """\n{text}\n"""\n'
    )
    return file


def of_the_others(played: Played) -> list[dict[str, Any]]:
    return [record for record in played.records() if record["instance"] != "T33"]


def done_of(played: Played, block: str) -> dict[str, int]:
    done: dict[str, int] = {}
    for record in played.records():
        if record["block"] == block and record["DONE"]:
            done[record["instance"]] = done.get(record["instance"], 0) + 1
    return done


@pytest.mark.slow
def test_thirty_two_connections_receive_and_send_in_every_second_scan_each(tmp_path: Path) -> None:
    played = play(t4(tmp_path, f"run {2 * ROUNDS}"), "sim")
    assert played.verdict.has_passed, failures(played.verdict)
    assert not any(record["ERROR"] for record in played.records())
    assert done_of(played, "TRCV_C") == {f"R{n}": ROUNDS for n in range(1, T4 + 1)}
    sent = done_of(played, "TSEND_C")
    assert len(sent) == T4
    assert all(done >= ROUNDS for done in sent.values())


@pytest.mark.slow
@pytest.mark.parametrize("retry", [10, 50])  # scans between two attempts
def test_the_thirty_third_shows_8080_at_each_attempt_and_the_others_do_not_notice(
    tmp_path: Path, retry: int
) -> None:
    head = f'[options]\nretry = "T#{10 * retry}ms"\n'
    scans, attempts = 2 * ROUNDS, (2 * ROUNDS - 2) // retry
    trace = f"7000+ 0001 {f'8080! 7002{{{retry - 1}}} ' * attempts}8080! 7002*"
    asks = f"set T33 CONT=1\nrun {scans}\nexpect T33 trace {trace}"
    beside = play(t4(tmp_path, asks, head, ONE_TOO_MANY), "sim")
    assert beside.verdict.has_passed, failures(beside.verdict)
    refused = [record for record in beside.records() if record["STATUS"] == "8080"]
    assert {record["instance"] for record in refused} == {"T33"}
    assert len(refused) == attempts + 1

    alone = play(t4(tmp_path, f"run {scans}", head), "sim")
    assert alone.verdict.has_passed
    assert of_the_others(beside) == of_the_others(alone)
    assert sum(done_of(alone, "TRCV_C").values()) == T4 * ROUNDS


@pytest.mark.slow
def test_the_thirty_third_takes_the_place_that_another_gives_up_and_that_one_gets_8080(
    tmp_path: Path,
) -> None:
    steps = """
        set T33 CONT=1
        run 4
        expect T33 STATUS=7002
        set R7 CONT=0 EN_R=0
        set S7 CONT=0
        run T#200ms
        peer P33 connect
        wait T33 STATUS=7004
        set R7 CONT=1
        run T#400ms
        expect R7 trace ... 7003+ 7007 7000+ 0001 8080! 7002{19} 8080! 7002{18}
        expect T33 STATUS=7004
    """
    head = '[options]\nretry = "T#200ms"\n'
    played = play(t4(tmp_path, steps, head, ONE_TOO_MANY), "sim")
    assert played.verdict.has_passed, failures(played.verdict)
    assert re.findall(r'"instance":"S8".*"ERROR":true', played.text) == []
