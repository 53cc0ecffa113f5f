"""The update pipe brings whole pictures in pieces, stops when the time is up, never waits for the screen."""

from __future__ import annotations

import multiprocessing
import os
import random
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection as Channel
from pathlib import Path

import pytest
from msgspec.structs import replace

from trcvtui import clock
from trcvtui.bench.bench import Bench
from trcvtui.engine.controller import Controller
from trcvtui.history.records import HistoryRequest
from trcvtui.picture.bench_update import BareUpdate, BenchUpdate, UpdateRequest
from trcvtui.picture.protocol import MessageReader
from trcvtui.picture.update_pipe import PARTS_A_PIECE, UpdatePipe
from trcvtui.project.file import read_project
from trcvtui.snapshots.bench import EngineTiming

FAR_AWAY = 10_000_000_000
BIG = 60_000
DOCUMENT = {
    "dialect": "baosky",
    "data": [{"name": f"rx{n}", "type": f"ARRAY[1..{BIG}] OF BYTE"} for n in range(8)],
    "connect": [{"name": f"C{n}", "LocalAddress": "127.0.0.1", "LocalPort": 0} for n in range(8)],
    "instance": [
        {"name": f"T{n}", "block": "TRCV_C", "connect": f"C{n}", "data": f"rx{n}", "CONT": n < 3}
        for n in range(8)
    ],
    "peer": [{"name": "P1", "active": True, "remote": "@C1"}],
}


@contextmanager
def two_ends() -> Iterator[tuple[Channel, Channel]]:
    ours, theirs = multiprocessing.Pipe()
    with ours, theirs:
        yield ours, theirs


def picture(console: Controller, *data: str) -> tuple[BareUpdate, BenchUpdate]:
    """Return the bench after one more scan, with the bytes of some variables; and the picture of it."""
    console.bench.step()
    bare = console.collect(UpdateRequest(data=data), EngineTiming(mode="test"), 2000)
    return bare, bare.whole(console.bench.runtime.whole(bare.snapshot))


def console() -> Controller:
    return Controller(Bench(read_project(DOCUMENT, "pipe", Path()), "sim"))


def test_packing_stops_when_the_time_is_up_and_goes_on_later() -> None:
    bench = console()
    with two_ends() as (engine, screen):
        pipe = UpdatePipe(engine)
        bare, sent = picture(bench)
        pipe.begin(bare)
        gaps = 0
        while pipe.is_busy():
            assert not screen.poll()
            pipe.go_on(clock.now_ns())  # no time at all: one piece
            gaps += 1
        assert gaps > len(sent.snapshot.instances) // PARTS_A_PIECE
        assert screen.recv() == sent


def test_a_screen_that_does_not_read_does_not_stop_the_engine() -> None:
    bench = console()
    with two_ends() as (engine, screen):
        pipe = UpdatePipe(engine)
        bare, sent = picture(bench, *(f"rx{n}" for n in range(8)))  # more than the channel holds
        pipe.begin(bare)
        pipe.go_on(clock.now_ns() + FAR_AWAY)
        assert pipe.is_busy(), "it has come back although the channel is full"
        with ThreadPoolExecutor(1) as pool:
            arrived = pool.submit(screen.recv)
            while pipe.is_busy():
                pipe.go_on(clock.now_ns() + FAR_AWAY)
            assert arrived.result(timeout=10) == sent


def test_what_has_not_changed_is_the_same_object_on_both_sides() -> None:
    bench = console()
    with two_ends() as (engine, screen):
        pipe = UpdatePipe(engine)
        arrived = []
        for _ in range(8):
            pipe.begin(picture(bench)[0])
            pipe.go_on(clock.now_ns() + FAR_AWAY)
            arrived.append(screen.recv())
        before, after = (each.snapshot.instance("T5") for each in arrived[-2:])
        assert before is after
        assert arrived[-1].snapshot.scan == arrived[-2].snapshot.scan + 1


@pytest.mark.parametrize("seed", range(6))
def test_a_picture_in_pieces_is_that_of_one_scan_whatever_passes_meanwhile(seed: int) -> None:
    draw, bench = random.Random(seed), console()
    bench.take(0, "set T1 EN_R=1 LEN=8")
    for line in ("fault clear",) * 3 + ("peer P1 connect",):
        bench.take(0, line)
        bench.scan()
    request = UpdateRequest(partial_of=("T1",), waves=(("T1", 0),), history=HistoryRequest("C1", 0, 64))
    with two_ends() as (engine, screen):
        pipe, expected, arrived, done = UpdatePipe(engine), [], [], set()
        for scan in range(200):
            if draw.random() < 0.7:
                bench.take(scan, f"peer P1 send random {draw.choice((3, 8, 13))} seed={scan}")
            bench.scan() if draw.random() < 0.5 else bench.step()
            if not pipe.is_busy():
                bare = bench.collect(request, EngineTiming(), 2000)
                expected.append(bare.whole(bench.bench.runtime.whole(bare.snapshot)))
                pipe.begin(bare)
            for _ in range(draw.randrange(4)):
                pipe.go_on(clock.now_ns())  # one piece
            while screen.poll():
                arrived.append(screen.recv())
        for found, known in zip(arrived, expected, strict=False):
            assert replace(found, history=None) == replace(known, history=None)
            done.add(found.snapshot.instances[1].jobs_done)
            assert found.history is not None and known.history is not None
            assert found.history.content.startswith(known.history.content.rstrip(b"\0"))
    assert len(done) > 5, "the pictures were of different scans, with jobs in between"


@pytest.mark.skipif(os.name != "posix", reason="pipes of Windows lose nothing")
def test_the_last_words_of_a_process_that_has_not_read_a_request_are_heard() -> None:
    here, there = multiprocessing.Pipe()
    here.send("a request")
    there.send_bytes(b"last words")
    there.close()  # with the request unread: the system tells this end of a reset
    with here:
        reader = MessageReader(here)
        assert reader.next() == b"last words"
        with pytest.raises(EOFError):
            reader.next()
