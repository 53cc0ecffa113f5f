"""Blocks that share a CONNECT: who may work, who ends what the partner has ended, whose bytes are whose."""

from __future__ import annotations

from pathlib import Path

from tests.bench.bench_lines import do
from trcvtui.bench.bench import Bench
from trcvtui.net.events import BytesDropped, BytesReceived
from trcvtui.project.file import read_project


def bench_with(*instances: tuple[str, str, str], active: bool = False, **options: str) -> Bench:
    """Return a bench with these instances (block, name, task) on C1; task SLOW has a priority of its own."""
    connect = {"name": "C1", "LocalAddress": "127.0.0.1"}
    far = {"ActiveEstablished": True, "RemoteAddress": "127.0.0.1", "RemotePort": "@P1"}
    moves = [{"data": "data"} if "RCV" in block or "SEND" in block else {} for block, _, _ in instances]
    document = {
        "dialect": "baosky",
        "options": options,
        "task": [{"name": "MAIN"}, {"name": "SLOW", "interval": "T#20ms", "priority": 2}],
        "data": [{"name": "data", "type": "ARRAY[1..8] OF BYTE"}],
        "connect": [connect | far if active else connect],
        "instance": [
            {"block": block, "name": name, "task": task, "connect": "C1", **data}
            for (block, name, task), data in zip(instances, moves, strict=True)
        ],
        "peer": [
            {"name": name, "active": False} if active else {"name": name, "active": True, "remote": "@C1"}
            for name in ("P1", "P2", "P3")
        ],
    }
    return Bench(read_project(document, "shared", Path()), "sim")


def status(bench: Bench, name: str) -> int:
    return bench.runtime.outputs(name).status


def test_a_sender_without_a_buffer_gives_its_lock_back() -> None:
    bench = bench_with(("TSEND_C", "S1", "MAIN"), ("TSEND_C", "S2", "MAIN"))
    do(bench, "set S1 CONT=1", "set S2 CONT=1", "run 4", "peer P1 connect", "run 3")
    do(bench, "fault buffer", "pulse S1 REQ", "run 1")
    assert status(bench, "S1") == 0x80A7
    do(bench, "pulse S2 REQ", "run 1")
    assert status(bench, "S2") == 0x7005
    bench.close()


def test_the_last_reader_of_a_lost_connection_ends_it_also_when_he_gets_no_buffer() -> None:
    bench = bench_with(("TSEND_C", "S", "MAIN"), ("TRCV_C", "R", "SLOW"))
    do(bench, "set S CONT=1", "set R CONT=1 EN_R=1", "run 5", "peer P1 connect", "run 8")
    do(bench, "peer P1 send hex 01 02 03 04 05 06 07 08 09", "peer P1 rst", "pulse S REQ", "run 1")
    assert (status(bench, "S"), status(bench, "R")) == (0x80A9, 0x7006)
    do(bench, "run 1")
    assert status(bench, "R") == 0x7008
    do(bench, "fault buffer", "run 3")
    do(bench, "peer P1 connect", "run 4")
    assert (status(bench, "S"), status(bench, "R")) == (0x7004, 0x7006)
    bench.close()


def test_a_reader_that_stops_leaves_no_lost_connection_behind() -> None:
    bench = bench_with(("TCON", "B", "MAIN"), ("TSEND", "S", "MAIN"), ("TRCV", "R", "MAIN"))
    do(bench, "pulse B REQ", "set R EN_R=1", "run 4", "peer P1 connect", "run 3", "delete B")
    do(bench, "peer P1 send hex 01 02", "peer P1 shutdown", "pulse S REQ", "run 1")
    assert (status(bench, "S"), status(bench, "R")) == (0x80C5, 0x7006)
    do(bench, "set R EN_R=0", "run 2")
    assert (status(bench, "S"), status(bench, "R")) == (0x7000, 0x7000)
    assert bench.peers["P1"].state == "closed"
    bench.close()


def test_what_two_priorities_read_in_turns_is_told_stretch_by_stretch() -> None:
    bench = bench_with(("TRCV_C", "FAST", "MAIN"), ("TRCV_C", "LATE", "SLOW"))
    do(bench, "set FAST CONT=1 EN_R=1", "set LATE CONT=1 EN_R=1", "run 4", "peer P1 connect", "run 4")
    seq = bench.runtime.ledger.last_seq
    do(bench, "peer P1 send hex 01 02 03 04 05 06 07 08 21 22", "run 2")  # FAST has its 8, LATE the rest
    do(bench, "peer P1 send hex 11 12 13 14 15 16 17 18 23", "run 2", "set LATE EN_R=0", "run 2")
    events = [line.event for line in bench.runtime.ledger.lines_since(seq)]
    taken = [(e.instance, e.offset, e.size) for e in events if isinstance(e, BytesReceived)]
    assert taken == [("FAST", 0, 8), ("LATE", 8, 2), ("FAST", 10, 8), ("LATE", 18, 1)]
    dropped = [(e.offset, e.size, e.reason) for e in events if isinstance(e, BytesDropped)]
    assert dropped == [(8, 2, "EN_R fell"), (18, 1, "EN_R fell")]
    bench.close()


def test_the_picture_shows_a_connect_on_which_nobody_is_left() -> None:
    bench = bench_with(("TRCV_C", "R", "MAIN"))
    do(bench, "set R CONT=1", "run 4", "peer P1 connect", "run 2", "delete R", "run 1", "plc stop", "run 1")
    connection = bench.runtime.snapshot().connection("C1")
    assert connection is not None and connection.state == "closed"
    bench.close()


def test_the_time_to_an_attempt_that_nobody_will_make_runs_on() -> None:
    bench = bench_with(("TRCV_C", "R", "MAIN"), active=True)
    do(bench, "peer P1 close", "set R CONT=1", "run 5", "delete R", "run 1")
    first = bench.runtime.snapshot().connection("C1")
    do(bench, "run 1")
    second = bench.runtime.snapshot().connection("C1")
    assert first is not None and second is not None
    assert first.retry_in_ns is not None and second.retry_in_ns == first.retry_in_ns - 10_000_000
    bench.close()


def test_80a1_of_a_trcv_is_one_error_as_long_as_it_stands() -> None:
    for calls_all in (False, True):
        bench = bench_with(("TRCV", "R", "MAIN"))
        bench.runtime.calls_all = calls_all
        do(bench, "set R EN_R=1", "run 5")
        instance = bench.runtime.snapshot().instance("R")
        assert instance is not None and (instance.outputs.status, instance.errors) == (0x80A1, 1)
        bench.close()


def test_two_clients_come_to_replace_the_first_and_one_cannot_be_taken_over() -> None:
    bench = bench_with(("TRCV_C", "R", "MAIN"), second_client="replace")
    do(bench, "set R CONT=1", "run 4", "peer P1 connect", "run 3")
    do(bench, "fault poll_add", "peer P2 connect", "peer P3 connect", "run 5")
    assert status(bench, "R") == 0x7004
    assert [bench.peers[name].state for name in ("P1", "P2", "P3")] == ["closed", "reset", "connected"]
    bench.close()
    assert bench.leaks() == ()


def test_a_trcv_whose_connection_nobody_builds_any_more_complains_in_each_scan() -> None:
    bench = bench_with(("TRCV_C", "R", "MAIN"), ("TRCV", "IDLE", "MAIN"), ("TRCV", "T", "MAIN"))
    do(bench, "set R CONT=1", "run 3", "peer P1 connect", "run 3", "delete R", "peer P1 close")
    do(bench, "set T EN_R=1", "run 1")
    assert status(bench, "T") == 0x80C5, "the call order does not decide: IDLE leaves the loss to T's job"
    for _ in range(3):
        do(bench, "run 1")
        assert bench.runtime.outputs("T").status == 0x80A1
