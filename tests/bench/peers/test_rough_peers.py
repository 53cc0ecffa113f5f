"""Peers that misbehave: the bench stays up, memory stays bounded, the ledger says what happened."""

from __future__ import annotations

import tomllib
import tracemalloc
from collections.abc import Iterator

import pytest

from tests.bench.bench_lines import do
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.net.events import ConnectionChanged, EventKind
from trcvtui.plc.ledger import KEPT_LINES
from trcvtui.project.file import load_project, read_project

KERNELS = ("sim", "live")
INSTANCE = "TRCV_C_1"


@pytest.fixture(params=KERNELS)
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    bench = Bench(load_project(CONFIGS / "passive.toml"), request.param)
    do(bench, f"set {INSTANCE} CONT=1 EN_R=1", scans=3)
    do(bench, "peer P1 connect", scans=3)
    assert status(bench) == 0x7006
    yield bench
    bench.close()
    assert bench.leaks() == ()


def status(bench: Bench) -> int:
    return bench.runtime.outputs(INSTANCE).status


def happened(bench: Bench) -> list[EventKind]:
    return [line.event.what for line in bench.runtime.ledger if isinstance(line.event, ConnectionChanged)]


def connect_again(bench: Bench) -> None:
    do(bench, "peer P1 connect", scans=6)


def test_a_reset_after_any_byte_ends_the_job_and_the_next_partner_is_welcome(bench: Bench) -> None:
    for size in range(1, 20):
        do(bench, f"peer P1 send random {size} seed={size}", scans=6)
        do(bench, "peer P1 rst", scans=2)
        assert status(bench) == 0x7002
        connect_again(bench)
        assert status(bench) == 0x7006
    assert happened(bench).count(EventKind.LOST) == 19


def test_a_fin_after_any_byte_gives_whole_frames_and_then_the_loss(bench: Bench) -> None:
    for size in range(1, 20):
        done = bench.runtime.snapshot().instances[0].jobs_done
        do(bench, f"peer P1 send random {size} seed={size}")
        do(bench, "peer P1 close", scans=10)
        assert bench.runtime.snapshot().instances[0].jobs_done == done + size // 8
        connect_again(bench)
    assert happened(bench).count(EventKind.PARTNER_CLOSED) == 19


@pytest.mark.slow
def test_a_flood_costs_bounded_memory_and_one_frame_a_scan(bench: Bench) -> None:
    do(bench, "peer P1 send random 1000000 seed=1 repeat=1000000", scans=50)
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    for _ in range(3000):
        bench.step()
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert status(bench) in (0x7006, 0x7008)
    assert len(list(bench.runtime.ledger)) <= KEPT_LINES
    # 20,000 lines of ledger and what the stack itself queues; a leak of one line a scan would be far more
    # than the flood's own megabytes.
    assert after - before < 16_000_000


def test_a_flood_that_nobody_receives_stays_in_the_stack(bench: Bench) -> None:
    do(bench, f"set {INSTANCE} EN_R=0", scans=2)
    do(bench, "peer P1 send random 1000000 seed=1 repeat=100", scans=50)
    assert status(bench) == 0x7004
    assert bench.runtime.data("rx") == bytes(8)
    do(bench, f"set {INSTANCE} EN_R=1", scans=4)
    assert bench.runtime.snapshot().instances[0].jobs_done >= 1


CROWD = [f"X{number}" for number in range(40)]


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_crowd_of_second_clients_is_reset_and_the_first_goes_on(kernel: str) -> None:
    passive = (CONFIGS / "passive.toml").read_text(encoding="utf-8")
    crowd = "".join(f'\n[[peer]]\nname = "{name}"\nactive = true\nremote = "@C1"\n' for name in CROWD)
    bench = Bench(read_project(tomllib.loads(passive + crowd), "crowd", CONFIGS), kernel)
    do(bench, f"set {INSTANCE} CONT=1 EN_R=1", scans=3)
    do(bench, "peer P1 connect", scans=3)
    for name in CROWD:
        do(bench, f"peer {name} connect")
        if bench.peers[name].state == "connected":
            do(bench, f"peer {name} send hex ff ff")
        bench.step()
    for _ in range(10):
        bench.step()
    assert happened(bench).count(EventKind.SECOND_CLIENT) == len(CROWD)
    assert status(bench) == 0x7006
    do(bench, "peer P1 send hex 01 02 03 04 05 06 07 08", scans=2)
    assert bench.runtime.data("rx") == bytes(range(1, 9)), "no byte of the crowd has reached DATA"
    bench.close()
    assert bench.leaks() == ()
