"""The history of received bytes: what is kept, what is forgotten, what is said of what is not kept."""

from __future__ import annotations

import random

import pytest

from tests.properties.test_history import Generator, all_of, history_bench, labels
from trcvtui.history import received_streams, stream_reader
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.records import HistoryRequest, HistoryWindow, SeekRequest
from trcvtui.history.stream_index import StreamIndex
from trcvtui.history.stream_reader import StreamReader
from trcvtui.net.events import ConnectionChanged, EventKind
from trcvtui.plc.ledger import PeerSent

ADDED_AGAIN = (
    "remove instance X",
    "remove peer P1",
    "remove connect C1",
    "add connect C1 LocalAddress=127.0.0.1 LocalPort=0",
    "add instance X block=TRCV_C connect=C1 data=rx",
    "add peer P1 active=true remote=@C1",
    "set X CONT=1 EN_R=1",
)


def talking() -> tuple[Generator, StreamReader]:
    bench = history_bench()
    ledger = LedgerReader(bench)
    told, reader = Generator(bench, ledger), StreamReader(bench, ledger)
    told.do("set X CONT=1 EN_R=1")
    told.scan(3)
    told.do("peer P1 connect")
    told.scan(4)
    return told, reader


def frames(told: Generator, count: int) -> bytes:
    """Let so many random frames arrive; return their bytes."""
    draw = random.Random(count)
    sent = b"".join(draw.randbytes(24) for _ in range(count))
    for place in range(0, len(sent), 24):
        told.send(sent[place : place + 24], [])
        told.scan(3)
    return sent


def sought(
    reader: StreamReader, seek: SeekRequest, beside: SeekRequest | None = None
) -> tuple[int | None, int]:
    """Return where something was found, and how many pictures that took."""
    for pictures in range(1, 1000):
        reader.read_window(HistoryRequest("C1", seek=beside))  # of another screen
        answer = reader.read_window(HistoryRequest("C1", seek=seek)).sought
        assert answer is not None
        if answer.share >= 1:
            return answer.position, pictures
    raise AssertionError("never found, never given up")


def test_the_oldest_bytes_are_forgotten_first_and_positions_stay() -> None:
    told, reader = talking()
    told.bench.runtime.received_ring("C1").most = 240  # type: ignore[union-attr]
    sent = frames(told, 50)
    windows = all_of(reader)
    assert (windows[0].begin, windows[0].end) == (40 * 24, 50 * 24)
    assert windows[0].lack == "older than the 240B that are kept"
    assert b"".join(window.content for window in windows) == sent[40 * 24 :]
    assert labels(windows)[0][2:4] == (41, 0), "the first byte that is kept is the first of message 41"


def test_what_a_connect_had_received_before_it_was_removed_keeps_its_jobs() -> None:
    told, reader = talking()
    for payload in (bytes(24), b"old", b"new"):
        told.send(payload, [])
        told.scan(3)
        if payload == b"old":
            for line in ADDED_AGAIN:
                told.do(line)
            told.scan(3)
            told.do("peer P1 connect")
            told.scan(4)
    told.do("set X EN_R=0")
    told.scan(2)
    window = reader.read_window(HistoryRequest("C1", 0, 64))
    assert [(job.position, job.size, job.first, job.done) for job in window.jobs] == [
        (0, 24, 0, True), (24, 3, 0, False), (27, 3, 0, False)
    ]  # fmt: skip


def test_jobs_and_recv_calls_are_bounded_too(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, size in (("MOST_SPANS_KEPT", 7), ("LEAST_SPANS_KEPT", 1), ("SLACK", 1)):
        monkeypatch.setattr(received_streams, name, size)
    told, reader = talking()
    frames(told, 20)
    window = reader.read_window(HistoryRequest("C1", 0, 8192))
    assert (window.begin, len(window.jobs), window.lack) == (11 * 24, 9, "older than the jobs that are kept")


def test_a_window_is_bounded_whatever_is_asked_for() -> None:
    told, reader = talking()
    told.do("set X LEN=1")
    told.send(bytes(700), [])
    told.scan(1500)
    window = reader.read_window(HistoryRequest("C1", 0, 1 << 30))
    assert window.end == 700
    assert len(window.jobs) == 512
    assert window.stop == 24 + 511, "the first job had begun before LEN was 1"
    assert reader.read_window(HistoryRequest("C1", 1 << 40, 10)).content == b""
    assert reader.read_window(HistoryRequest("nowhere", 5, 10)) == HistoryWindow("nowhere", 0, 0)


def test_bytes_are_found_forward_and_back_stretch_by_stretch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream_reader, "STRETCH_BYTES", 64)
    told, reader = talking()
    sent = frames(told, 40)
    pattern = sent[500:506]  # over the border of two jobs
    assert sought(
        reader, SeekRequest(1, 0, True, (pattern, b"\0" * 40)), SeekRequest(0, 0, True, (b"-",))
    ) == (500, 15)
    assert sought(reader, SeekRequest(2, 501, True, (pattern,)))[0] is None
    assert sought(reader, SeekRequest(3, 960, False, (pattern,)))[0] == 500
    assert sought(reader, SeekRequest(4, 500, False, (pattern,)))[0] is None


def test_the_same_two_ends_that_meet_again_begin_a_new_stream() -> None:
    index = StreamIndex()
    plc, peer = "127.0.0.1:2000", "127.0.0.1:5000"
    for incarnation in (1, 2):
        if incarnation == 1:
            index.dispatch_events(
                [(1, 0, ConnectionChanged("C1", incarnation, EventKind.CONNECTED, plc, peer))]
            )
        index.dispatch_events([(2, 0, PeerSent("P1", 2 * incarnation, peer, plc, 0, 10))])
        index.dispatch_events([(2, 0, PeerSent("P1", 2 * incarnation + 1, peer, plc, 10, 10))])
    index.dispatch_events([(3, 0, ConnectionChanged("C1", 2, EventKind.CONNECTED, plc, peer))])
    for incarnation, numbers in ((1, [2, 3]), (2, [4, 5])):
        found = index.find_messages_within(("C1", incarnation), 5, 10, 100)
        assert [span.number for span in found] == numbers
        assert [(span.position, span.size, span.first) for span in found] == [(100, 5, 5), (105, 5, 0)]
    assert index.find_messages_within(("C1", 3), 0, 10, 0) == []
