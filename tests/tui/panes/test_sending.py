"""TSEND_C on the screen: how far its bytes have come, its dead link, its call in Structured Text."""

from __future__ import annotations

import tomllib

import pytest
from msgspec.structs import replace

from tests.local_driver import LocalDriver
from tests.scenario.scenarios import CONFIGS
from tests.tui.fakes import bench_project, connections, peers, picture, receiving
from tests.tui.looking import BOTH, WIDE, looking
from trcvtui.bench.bench import Bench
from trcvtui.picture.bench_update import BenchUpdate
from trcvtui.project.file import read_project
from trcvtui.tui.panes.function_block import LATE_DETECTION_S


def sending(unacknowledged: int | None = 4000, have: int = 0, need: int = 0) -> BenchUpdate:
    block = replace(
        receiving(),
        block="TSEND_C",
        inputs=(("REQ", False), ("CONT", True), ("LEN", 0), ("COM_RST", False)),
        have=have,
        need=need,
    )
    up = replace(
        connections()[0], bytes_sent=12000, unacknowledged=unacknowledged, keep_alive_s=10, receivers=()
    )
    shown = picture(block)
    peer = replace(peers()[0], local=up.remote, remote=up.local, received_here=7777)
    return replace(shown, snapshot=replace(shown.snapshot, connections=(up,)), peers=(peer,))


@BOTH
async def test_it_shows_what_is_accepted_what_is_unacknowledged_and_what_the_peer_has_read(
    size: tuple[int, int],
) -> None:
    async with looking(size, sending()) as looker:
        await looker.press("5")
        assert "5 Sent" in looker.text
        assert "12000 B accepted · 4000 unacknowledged · 7777 read by P1" in looker.text


@BOTH
async def test_a_running_job_shows_what_the_stack_has_of_it(size: tuple[int, int]) -> None:
    async with looking(size, sending(have=300, need=1200)) as looker:
        await looker.press("5")
        assert "300 of 1200 B in the stack" in looker.text


async def test_what_the_system_does_not_say_is_left_out() -> None:
    async with looking(WIDE, sending(unacknowledged=None)) as looker:
        assert "12000 B accepted · 7777 read by P1" in looker.text


@pytest.mark.parametrize(
    ("interval", "unacknowledged", "words"),
    [
        (1, 0, "keep-alive 1 s: dead link in 2–3 s"),
        (10, 0, "keep-alive 10 s: dead link in 20–30 s"),
        (10, None, "keep-alive 10 s: dead link in 20–30 s"),
        (1, 4000, "unacknowledged: dead link in 3–5 s"),
        (10, 4000, "unacknowledged: dead link in 30–32 s"),
    ],
)
async def test_beside_the_wire_stands_when_a_dead_link_shows(
    interval: int, unacknowledged: int | None, words: str
) -> None:
    shown = sending(unacknowledged)
    up = replace(shown.snapshot.connections[0], keep_alive_s=interval)
    shown = replace(shown, snapshot=replace(shown.snapshot, connections=(up,)))
    async with looking(WIDE, shown) as looker:
        assert words in looker.text


async def test_without_the_limit_a_dead_link_takes_minutes_while_bytes_are_unacknowledged() -> None:
    project = bench_project()
    unlimited = replace(project, options={**project.options, "user_timeout": False})
    async with looking(WIDE, replace(sending(), project=unlimited)) as looker:
        assert "unacknowledged: dead link in minutes" in looker.text


@pytest.mark.parametrize("interval", [1, 5, 10])
def test_a_dead_link_shows_when_the_wire_line_says(interval: int) -> None:
    content = tomllib.loads((CONFIGS / "scenarios/baosky/80ab-tsend-link-down-sending.toml").read_text())
    del content["scenario"]
    content["connect"][0]["KeepAliveTimeInterval"] = interval
    bench = LocalDriver(Bench(read_project(content, "b.toml", CONFIGS), "sim"))

    up = "set TSEND_C_1 CONT=1", "run 3", "peer P1 connect", "run 3"
    bench.play(*up, "link C1 down", "pulse TSEND_C_1 REQ", "run 1")
    runtime = bench.bench.runtime
    began, last = runtime.scans, runtime.scans + 100 * (3 * interval + LATE_DETECTION_S)
    while not runtime.outputs("TSEND_C_1").error and runtime.scans < last:
        bench.scan(1)
    assert runtime.outputs("TSEND_C_1").error
    assert runtime.scans - began >= 100 * 3 * interval
    bench.close()
