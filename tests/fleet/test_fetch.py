"""A recording over the broker: asked for, sent in pieces, checked, kept; anything else is refused."""

from __future__ import annotations

import json
import os
from collections import deque
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trcvtui.fleet.fetch import AHEAD, PATIENCE_NS, PIECE, Fetch, FetchDesk, request_topic

BIG = os.urandom(2 * PIECE + 100)


class Wire:
    """A broker between a desk and who asks; it takes each message when it is told to."""

    def __init__(self) -> None:
        self.sent: deque[tuple[str, bytes]] = deque()
        self.count = 0

    def publish(self, topic: str, payload: bytes) -> int:
        self.sent.append((topic, payload))
        self.count += 1
        return self.count


def desk_on(folder: Path) -> tuple[FetchDesk, list[str]]:
    said: list[str] = []
    return FetchDesk(folder, "s", "n", said.append), said


def carried(desk: FetchDesk, fetch: Fetch, wire: Wire) -> None:
    """Let everything come that the desk has to send."""
    number = 0
    while True:
        desk.turn(wire.publish)
        assert len(wire.sent) <= AHEAD
        if not wire.sent:
            return
        topic, payload = wire.sent.popleft()
        assert topic == fetch.topic
        fetch.take(payload, 0)
        number += 1
        desk.acknowledged(number)


def test_the_newest_files_come_in_pieces_and_are_kept_under_their_names(tmp_path: Path) -> None:
    ring, here = tmp_path / "ring", tmp_path / "here"
    ring.mkdir()
    here.mkdir()
    for n, (data, age) in enumerate([(b"old", 9000), (b"recent", 60), (BIG, 0)]):
        (ring / f"line-000{n}.pcapng").write_bytes(data)
        then = os.path.getmtime(ring / f"line-000{n}.pcapng") - age
        os.utime(ring / f"line-000{n}.pcapng", (then, then))
    desk, said = desk_on(ring)
    fetch = Fetch("s", "n", here, 0)
    desk.hear(request_topic("s", "n"), fetch.request(10), is_retained=False)
    carried(desk, fetch, Wire())
    assert fetch.is_over and fetch.path is not None and fetch.path.read_bytes() == BIG
    kept = sorted(path.name.removeprefix(f"fetched-{fetch.nonce[:8]}-") for path in here.iterdir())
    assert kept == ["line-0001.pcapng", "line-0002.pcapng"]
    assert said == ["a recording is asked for over the broker: line-0001.pcapng, line-0002.pcapng"]


def test_one_request_at_a_time_and_no_retained_one(tmp_path: Path) -> None:
    (tmp_path / "line-0001.pcapng").write_bytes(BIG)
    desk, said = desk_on(tmp_path)
    first, second, wire = Fetch("s", "n", tmp_path, 0), Fetch("s", "n", tmp_path, 0), Wire()
    topic = request_topic("s", "n")
    desk.hear(topic, first.request(10), is_retained=True)
    desk.turn(wire.publish)
    assert not wire.sent
    desk.hear(topic, first.request(10), is_retained=False)
    desk.hear(topic, second.request(10), is_retained=False)
    assert said[-1] == "a recording was asked for while another one is on its way: not answered"
    carried(desk, first, wire)
    assert first.path is not None and not second.is_over


def test_an_agent_that_has_nothing_or_does_not_answer_is_told(tmp_path: Path) -> None:
    desk, _ = desk_on(tmp_path)
    fetch = Fetch("s", "n", tmp_path, 0)
    desk.hear(request_topic("s", "n"), fetch.request(10), is_retained=False)
    carried(desk, fetch, Wire())
    assert (fetch.is_over, fetch.told) == (True, "n: found nothing is recorded yet, expected a recording")
    silent = Fetch("s", "n", tmp_path, 0)
    silent.look(PATIENCE_NS)
    assert not silent.is_over
    silent.look(PATIENCE_NS + 1)
    assert silent.told == "n does not answer: expected one with --record and --allow-fetch"


@pytest.mark.parametrize(
    "payload",
    [b"", b"{}", b"[]", b'{"nonce": "../../etc", "minutes": 1}',
     b'{"nonce": "0123456789abcdef", "minutes": -1}',
     b'{"nonce": "0123456789abcdef", "minutes": 1e99}', b'{"nonce": 7, "minutes": 1}', b"{" * 999],
)  # fmt: skip
def test_what_is_no_request_is_not_answered(payload: bytes, tmp_path: Path) -> None:
    (tmp_path / "line-0001.pcapng").write_bytes(b"x")
    desk, said = desk_on(tmp_path)
    desk.hear(request_topic("s", "n"), payload, is_retained=False)
    wire = Wire()
    desk.turn(wire.publish)
    assert not wire.sent and not said


def head(**changed: object) -> bytes:
    told: dict[str, object] = {"n": 0, "of": 1, "files": [["a.pcapng", 1]], "sha256": "0" * 64}
    return json.dumps(told | changed).encode() + b"\nx"


@pytest.mark.parametrize(
    "payload",
    [head(), head(n=1), head(of=9), head(files=[]), head(files=[["../a.pcapng", 1]]),
     head(files=[["a.sh", 1]]),
     head(files=[["a.pcapng", 1 << 40]]), head(files=[["a.pcapng", -1]]),
     head() + bytes(PIECE), b"\n", b"{}\n",
     head(files=[["\x1b[2J.pcapng", 1]]),
     b"[" * 999],
)  # fmt: skip
def test_a_hostile_piece_ends_it_and_nothing_is_kept(payload: bytes, tmp_path: Path) -> None:
    fetch = Fetch("s", "n", tmp_path, 0)
    fetch.take(payload, 0)
    assert fetch.is_over and fetch.path is None and "\x1b" not in fetch.told
    assert not [*tmp_path.iterdir()]


@given(
    st.lists(
        st.binary(max_size=200) | st.builds(head, n=st.integers(-1, 3), of=st.integers(-1, 3)), max_size=6
    )
)
def test_whatever_comes_nothing_breaks(payloads: list[bytes]) -> None:
    fetch = Fetch("s", "n", Path("/nonexistent"), 0)
    for payload in payloads:
        fetch.take(payload, 0)
    assert fetch.path is None
