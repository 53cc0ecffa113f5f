"""Random messages, cut at random, into jobs that random EN_R drops interrupt: every byte keeps its label.

What is expected comes from the generator alone: what it has sent, and how far the PLC has read it.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from itertools import accumulate
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.bench.bench_lines import do
from trcvtui.bench.bench import Bench
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.records import HistoryRequest, HistoryWindow, JobSpan
from trcvtui.history.stream_reader import StreamReader
from trcvtui.project.file import read_project

DATA = 24


def history_bench(seed: int = 0, fragment: bool = False) -> Bench:
    document: dict[str, object] = {
        "dialect": "baosky",
        "sim": {"seed": seed, "fragment": fragment},
        "data": [{"name": "rx", "type": f"ARRAY[1..{DATA}] OF BYTE"}],
        "connect": [{"name": "C1", "LocalAddress": "127.0.0.1", "LocalPort": 0}],
        "instance": [{"name": "X", "block": "TRCV_C", "connect": "C1", "data": "rx"}],
        "peer": [{"name": "P1", "active": True, "remote": "@C1"}],
    }
    return Bench(read_project(document, "history.toml", Path()), "sim")


@dataclass
class Generator:
    """What was sent, and how far the PLC has taken it; no line of the ledger is read here."""

    bench: Bench
    ledger: LedgerReader
    said: bytearray = field(default_factory=bytearray)
    sizes: list[int] = field(default_factory=list)
    jobs: list[tuple[int, int, int]] = field(default_factory=list)  # scan, first byte, size
    dropped: list[tuple[int, int]] = field(default_factory=list)
    taken: int = 0

    def do(self, line: str) -> None:
        do(self.bench, line)

    def scan(self, times: int = 1) -> None:
        """Let scans pass; note what each of them has delivered or dropped."""
        for _ in range(times):
            collected = len(self.bench.runtime.job_bytes("X"))
            enabled = bool(self.bench.runtime.inputs("X")["EN_R"])
            self.bench.step()
            self.ledger.catch_up()
            outputs = self.bench.runtime.outputs("X")
            if outputs.done:
                size = outputs.rcvd_len or 0
                self.jobs.append((self.bench.runtime.scans, self.taken, size))
                self.taken += size
            elif collected and enabled and not self.bench.runtime.inputs("X")["EN_R"]:
                self.dropped.append((self.taken, collected))
                self.taken += collected

    def send(self, payload: bytes, cuts: list[int]) -> None:
        places = sorted({cut % len(payload) for cut in cuts} - {0})
        ends = [*places, len(payload)]
        sizes = [stop - start for start, stop in zip([0, *places], ends, strict=True)]
        split = f" split={','.join(map(str, sizes[:-1]))} gap=T#10ms" if len(sizes) > 1 else ""
        self.do(f"peer P1 send hex {payload.hex()}{split}")
        self.said += payload
        self.sizes.append(len(payload))

    def label(self, offset: int) -> tuple[int, int]:
        """Return the number of the message that holds a byte of the stream, and the byte's place in it."""
        ends = list(accumulate(self.sizes))
        number = next(n for n, end in enumerate(ends) if offset < end)
        return number + 1, offset - (ends[number] - self.sizes[number])


def all_of(reader: StreamReader, connect: str = "C1") -> list[HistoryWindow]:
    """Return the whole history in small windows, as somebody sees it who scrolls through it."""
    end = reader.read_window(HistoryRequest(connect)).end
    position = reader.read_window(HistoryRequest(connect)).begin
    windows: list[HistoryWindow] = []
    while position < end:
        windows.append(reader.read_window(HistoryRequest(connect, position, 37)))
        assert windows[-1].start == position
        position = windows[-1].stop
    return windows


def labels(windows: list[HistoryWindow]) -> list[tuple[JobSpan, int, int, int, int]]:
    """Return job, value, message, byte of the message and byte of the connection of each position."""
    found = []
    for window in windows:
        for position in range(window.start, window.stop):
            job = next(span for span in window.jobs if span.position <= position < span.stop)
            recv = next(span for span in window.recvs if span.position <= position < span.stop)
            message = next(span for span in window.messages if span.position <= position < span.stop)
            assert recv.scan <= job.scan
            value = window.content[position - window.start]
            byte = message.first + position - message.position
            found.append((job, value, message.number, byte, recv.offset + position - recv.position))
    return found


MOVES = st.lists(
    st.one_of(
        st.tuples(st.just("send"), st.integers(1, 60), st.lists(st.integers(0, 59), max_size=4)),
        st.tuples(st.just("scan"), st.integers(1, 12), st.just([])),
        st.tuples(st.just("drop"), st.integers(1, 4), st.just([])),
        st.tuples(st.just("len"), st.integers(1, DATA), st.just([])),
        st.tuples(st.just("adhoc"), st.integers(0, 1), st.just([])),
    ),
    min_size=4,
    max_size=40,
)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 1000), fragment=st.booleans(), moves=MOVES)
def test_every_byte_has_the_label_that_the_generator_gave_it(
    seed: int, fragment: bool, moves: list[tuple[str, int, list[int]]]
) -> None:
    bench = history_bench(seed, fragment)
    ledger = LedgerReader(bench)
    told, reader = Generator(bench, ledger), StreamReader(bench, ledger)
    draw = random.Random(seed)
    told.do("set X CONT=1 EN_R=1")
    told.scan(3)
    told.do("peer P1 connect")
    told.scan(4)
    for move, number, cuts in moves:
        if move == "send":
            told.send(draw.randbytes(number), cuts)
        elif move == "scan":
            told.scan(number)
        elif move == "len":
            told.do(f"set X LEN={number}")
        elif move == "adhoc":
            told.do(f"set X ADHOC={number}")
        else:
            told.do("set X EN_R=0")
            told.scan(number)
            told.do("set X EN_R=1")
    told.scan(30)

    found = labels(all_of(reader))
    taken = told.taken + len(bench.runtime.job_bytes("X"))
    assert [offset for *_, offset in found] == list(range(taken)), "no byte is missing, none is twice"
    for job, value, message, byte, offset in found:
        assert (message, byte) == told.label(offset)
        assert value == told.said[offset]
        assert job.is_open == (offset >= told.taken)
    jobs = dict.fromkeys(job for job, *_ in found)
    offsets = {job: offset for job, *_, offset in reversed(found)}
    assert [(job.scan, offsets[job], job.size) for job in jobs if job.done] == told.jobs
    assert [(offsets[job], job.whole) for job in jobs if not (job.done or job.is_open)] == told.dropped
    bench.close()
