"""A picture crosses whole, of one scan, with what has changed; the engine never waits for the screen."""

from __future__ import annotations

import multiprocessing
import os
import random
from collections.abc import Iterator
from contextlib import contextmanager
from operator import is_
from pathlib import Path

import pytest
from msgspec.structs import replace

from trcvtui import clock
from trcvtui.bench.bench import Bench
from trcvtui.engine.controller import Controller
from trcvtui.history.records import HistoryRequest
from trcvtui.picture import update_pipe as module
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.picture.update_pipe import UpdatePipe, UpdateReader
from trcvtui.plc.ledger import StatusEdge
from trcvtui.project.file import read_project
from trcvtui.snapshots.bench import EngineTiming

FAR_AWAY = 10_000_000_000
DOCUMENT = {
    "dialect": "baosky",
    "data": [{"name": f"rx{n}", "type": "ARRAY[1..60000] OF BYTE"} for n in range(8)],
    "connect": [{"name": f"C{n}", "LocalAddress": "127.0.0.1", "LocalPort": 0} for n in range(8)],
    "instance": [
        {"name": f"T{n}", "block": "TRCV_C", "connect": f"C{n}", "data": f"rx{n}", "CONT": n < 3}
        for n in range(8)
    ],
    "peer": [{"name": "P1", "active": True, "remote": "@C1"}],
}


@contextmanager
def two_ends() -> Iterator[tuple[UpdatePipe, UpdateReader]]:
    ours, theirs = multiprocessing.Pipe()
    with ours, theirs:
        yield UpdatePipe(ours), UpdateReader(theirs)


def console() -> Controller:
    return Controller(Bench(read_project(DOCUMENT, "pipe", Path()), "sim"))


def picture(bench: Controller, request: UpdateRequest) -> BenchUpdate:
    return bench.picture(request, EngineTiming(mode="test"), 2000)


def test_a_screen_that_does_not_read_does_not_stop_the_engine() -> None:
    bench, request = console(), UpdateRequest(data=tuple(f"rx{n}" for n in range(8)))
    with two_ends() as (pipe, reader):
        sent = picture(bench, request)  # more than the channel holds
        pipe.begin(sent)
        for _ in range(100):
            bench.scan()
            pipe.advance(clock.now_ns() + FAR_AWAY)
            assert pipe.is_busy(), "it has come back although the channel is full"
        while pipe.is_busy():
            assert reader.next() is None
            pipe.advance(clock.now_ns() + FAR_AWAY)
        assert reader.next() == sent


def test_what_has_not_changed_does_not_cross_also_where_instances_come_and_go() -> None:
    bench, arrived = console(), []
    with two_ends() as (pipe, reader):
        for line in ("go", "delete T6", "create TRCV_C T9 connect=C1", "go", "go", "go"):
            bench.handle_line(0, line)
            bench.scan()
            made = picture(bench, UpdateRequest(project=bench._project_number))
            pipe.begin(made)
            pipe.advance(clock.now_ns() + FAR_AWAY)
            arrived.append(reader.next())
            assert arrived[-1].snapshot == made.snapshot
    before, after = (each.snapshot for each in arrived[-2:])
    assert after.scan == before.scan + 1 and after.instances == before.instances
    assert all(map(is_, before.instances, after.instances)), "what crosses is another object"


@pytest.mark.parametrize("seed", range(6))
def test_all_of_a_picture_is_of_one_scan_whatever_passes_until_it_is_sent(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "SLICE_ITEMS", 3)
    draw, bench = random.Random(seed), console()
    bench.handle_line(0, "set T1 EN_R=1 LEN=8")
    for line in ("fault clear",) * 3 + ("peer P1 connect",):
        bench.handle_line(0, line)
        bench.scan()
    edges: list[StatusEdge] = []
    done, asked = set(), UpdateRequest(project=picture(bench, UpdateRequest()).project_number)
    request = replace(asked, waves=(("T1", 0),), history=HistoryRequest("C1"))
    with two_ends() as (pipe, reader):
        for scan in range(200):
            made = picture(bench, request)
            pipe.begin(made)
            while pipe.is_busy():
                assert reader.next() is None
                if draw.random() < 0.3:
                    bench.handle_line(scan, f"peer P1 send random {draw.choice((3, 8, 13))} seed={scan}")
                bench.scan() if draw.random() < 0.5 else bench.step()
                pipe.advance(clock.now_ns())  # no time at all: one slice
            seen = reader.next()
            assert seen == made
            [wave], snapshot, instance = seen.waves, seen.snapshot, seen.snapshot.instances[1]
            assert seen.history.end == snapshot.connections[1].bytes_received
            assert bench.bench.runtime.scans > snapshot.scan + len(seen.lines) // 3
            assert len(seen.lines) == snapshot.ledger_seq - request.since_seq
            assert wave.until_scan == snapshot.scan
            edges += [each.event for each in wave.changes if isinstance(each.event, StatusEdge)]
            assert edges[-1].outputs == instance.outputs
            done.add(instance.jobs_done)
            known = ("T1", wave.first + len(wave.changes) - 1)
            request = replace(request, since_seq=snapshot.ledger_seq, waves=(known,))
    assert len(done) > 5, "the pictures were of different scans, with jobs in between"


@pytest.mark.skipif(os.name != "posix", reason="pipes of Windows lose nothing")
def test_the_last_words_of_a_process_that_has_not_read_a_request_are_heard() -> None:
    here, there = multiprocessing.Pipe()
    here.send("a request")
    there.send("last words")
    there.close()  # with the request unread: the system tells this end of a reset
    with here:
        reader = UpdateReader(here)
        assert reader.next() == "last words"
        with pytest.raises(EOFError):
            reader.next()
