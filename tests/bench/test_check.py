"""Self-checking traffic: what is lost, doubled or shifted is counted, in DATA and in what comes back."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.bench.bench_lines import do
from tests.scenario.scenarios import CONFIGS
from trcvtui.bench.bench import Bench
from trcvtui.commands.counters_and_checksums import FrameChecker, make_frame
from trcvtui.project.file import load_project
from trcvtui.snapshots.bench import TrafficCheckSnapshot, TrafficCheckTally

SIZE = 16


def judged(*pieces: bytes) -> TrafficCheckTally:
    checker = FrameChecker(SIZE)
    for piece in pieces:
        checker.check_bytes(piece)
    return checker.tally()


def test_frames_in_order_are_good_however_they_are_cut() -> None:
    stream = b"".join(make_frame(n, SIZE) for n in range(5))
    assert judged(stream) == TrafficCheckTally(5, 0, 0, 0, 0)
    assert judged(*[stream[at : at + 7] for at in range(0, len(stream), 7)]) == TrafficCheckTally(
        5, 0, 0, 0, 0
    )


@pytest.mark.parametrize(
    ("numbers", "lost", "doubled"),
    [([0, 1, 3], 1, 0), ([2], 2, 0), ([0, 0, 1], 0, 1), ([0, 1, 5, 3], 3, 1)],
)
def test_lost_and_doubled_frames_are_counted(numbers: list[int], lost: int, doubled: int) -> None:
    tally = judged(b"".join(make_frame(n, SIZE) for n in numbers))
    assert (tally.frames, tally.lost, tally.doubled, tally.shifts) == (len(numbers), lost, doubled, 0)


def test_a_byte_too_many_is_one_shift_and_no_frame_is_lost() -> None:
    stream = make_frame(0, SIZE) + b"\x00" + make_frame(1, SIZE)
    assert judged(*[bytes([byte]) for byte in stream]) == TrafficCheckTally(2, 0, 0, 1, 1)


def test_a_byte_too_few_costs_that_frame() -> None:
    tally = judged(make_frame(0, SIZE) + make_frame(1, SIZE)[1:] + make_frame(2, SIZE))
    assert (tally.frames, tally.lost, tally.shifts, tally.strange) == (2, 1, 1, SIZE - 1)


@given(st.lists(st.binary(max_size=200), max_size=20))
def test_whatever_arrives_less_than_a_frame_is_kept(pieces: list[bytes]) -> None:
    checker = FrameChecker(SIZE)
    for piece in pieces:
        checker.check_bytes(piece)
        assert len(checker._kept) < SIZE


def checking(bench: Bench) -> TrafficCheckSnapshot:
    found = bench.peer_snapshots()[0].check
    assert found is not None
    return found


@pytest.fixture
def bench() -> Bench:
    """Return TRCV_C_1 and TSEND_C_1 on one CONNECT, both with 8 bytes, and P1 connected."""
    bench = Bench(load_project(CONFIGS / "duplex.toml"), "sim")
    do(bench, "resize rx ARRAY[0..15] OF BYTE", "resize tx ARRAY[0..15] OF BYTE")
    do(bench, "set TRCV_C_1 CONT=1 EN_R=1", "set TSEND_C_1 CONT=1", scans=3)
    do(bench, "peer P1 connect", scans=3)
    return bench


def test_bytes_of_somebody_else_are_a_shift_in_data(bench: Bench) -> None:
    do(bench, "peer P1 check on size=16 every=T#20ms on TRCV_C_1", scans=10)
    do(bench, "peer P1 send hex 00 00 00", scans=40)
    data = checking(bench).data
    assert data is not None and (data.lost, data.doubled, data.shifts, data.strange) == (0, 0, 1, 3)
    bench.close()


def test_what_the_plc_sends_back_is_judged_too(bench: Bench) -> None:
    do(bench, "peer P1 check on size=16 every=T#10s")
    for number in (0, 1, 3):
        do(bench, f"write tx hex {make_frame(number, SIZE).hex()}", "pulse TSEND_C_1 REQ", scans=5)
    assert checking(bench).echo == TrafficCheckTally(3, 1, 0, 0, 0)
    do(bench, "peer P1 check off")
    assert bench.peer_snapshots()[0].check is None
    bench.close()
