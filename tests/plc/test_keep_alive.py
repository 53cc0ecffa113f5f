"""KeepAliveTimeInterval beyond what the stack takes: the nearest value is in force, and it is told."""

from __future__ import annotations

import os
import socket

import pytest

from tests.bench.bench_lines import do
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.net.events import ConnectionChanged, EventKind
from trcvtui.project.file import load_project


def connected(kernel: str, seconds: int) -> Bench:
    bench = Bench(
        load_project(CONFIGS / "passive.toml", (f"connect.C1.KeepAliveTimeInterval={seconds}",)), kernel
    )
    for line in ("set TRCV_C_1 CONT=1", "peer P1 connect"):
        do(bench, line, scans=4)
    assert bench.runtime.outputs("TRCV_C_1").status == 0x7004
    return bench


def told(bench: Bench) -> list[str]:
    events = [line.event for line in bench.runtime.ledger if isinstance(line.event, ConnectionChanged)]
    assert EventKind.OPTION_REFUSED not in [event.what for event in events]
    return [event.detail for event in events if event.what is EventKind.OPTION_LIMITED]


@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_a_longer_interval_than_the_stack_takes_is_the_longest_that_it_takes(kernel: str) -> None:
    bench = connected(kernel, 65535)
    limited = "KeepAliveTimeInterval 65535 s: 32767 s is in force, the most that the stack takes"
    assert told(bench) == [limited], "once, not for each socket"
    connection = bench.runtime.snapshot().connection("C1")
    assert connection is not None and connection.keep_alive_s == 32767
    handle = bench.runtime._connections["C1"].handle
    if kernel == "live" and handle is not None:
        with socket.socket(fileno=os.dup(handle)) as seen:
            assert seen.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE) == 32767
            assert seen.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL) == 32767
    bench.close()


@pytest.mark.parametrize("seconds", [0, 1, 32767])
def test_an_interval_that_the_stack_takes_is_no_news(seconds: int) -> None:
    bench = connected("live", seconds)
    assert told(bench) == []
    bench.close()


@pytest.mark.parametrize(
    ("project", "overrides", "seconds"),
    [("passive", (), 10), ("s7-receiver", (), 30), ("s7-receiver", ("options.keep_alive=7",), 7)],
)
def test_each_vendor_has_an_interval_of_its_own_where_none_is_given(
    project: str, overrides: tuple[str, ...], seconds: int
) -> None:
    bench = Bench(load_project(CONFIGS / f"{project}.toml", overrides), "live")
    for line in ("set TRCV_C_1 CONT=1", "peer P1 connect"):
        do(bench, line, scans=4)
    connection, handle = bench.runtime.snapshot().connection("C1"), bench.runtime._connections["C1"].handle
    assert connection is not None and connection.keep_alive_s == seconds and handle is not None
    with socket.socket(fileno=os.dup(handle)) as seen:
        assert seen.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE) == seconds
    bench.close()
