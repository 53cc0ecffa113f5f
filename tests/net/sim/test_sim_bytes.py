"""Random traffic through the simulated network: no byte is lost, doubled or reordered."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.net.net_bench import Bench
from tests.net.sim.net_sim import MS, SimBench
from trcvtui.net.kernel import Handle, SocketOptions
from trcvtui.net.results import Fault
from trcvtui.net.sim.kernel import SimKernel

SIDES = st.sampled_from((0, 1))
SIZES = st.one_of(st.integers(1, 40), st.integers(1, 6000))
MOVES = st.one_of(
    st.tuples(st.just("send"), SIDES, SIZES),
    st.tuples(st.just("recv"), SIDES, SIZES),
    st.tuples(st.just("pass"), st.integers(0, 400), st.just(0)),
    st.tuples(st.just("cut"), SIDES, st.just(0)),
    st.tuples(st.just("mend"), SIDES, st.just(0)),
)
OWNERS = ("C1", "P1")


@dataclass
class Side:
    """One end: what it has sent and received, and how its connection ended."""

    handle: Handle
    sent: bytearray = field(default_factory=bytearray)
    received: bytearray = field(default_factory=bytearray)
    ended: object = None

    def send(self, b: Bench, size: int) -> None:
        """Send the next bytes of an endless pattern in which no two places look alike for long."""
        start = len(self.sent)
        data = bytes((n * 7 + n // 251) % 256 for n in range(start, start + size))
        got = b.try_send(self.handle, data)
        if isinstance(got, int):
            self.sent += data[:got]
        elif isinstance(got, Fault):
            self.ended = got

    def recv(self, b: Bench, size: int) -> None:
        got = b.try_recv(self.handle, size)
        if isinstance(got, bytes):
            self.received += got
        elif got == 0 or isinstance(got, Fault):
            self.ended = got


def play(b: SimBench, sides: tuple[Side, Side], moves: list[tuple[str, int, int]]) -> None:
    """Make the moves; a poll comes before each, as a scan does it."""
    for name, which, size in moves:
        b.sim.poll()
        match name:
            case "send":
                sides[which].send(b, size)
            case "recv":
                sides[which].recv(b, size)
            case "pass":
                b.time.pass_ms(which)
            case _:
                b.sim.set_link(OWNERS[which], up=name == "mend")


def drain(b: SimBench, sides: tuple[Side, Side]) -> None:
    """Mend all, and read until nothing has come for two seconds."""
    for owner in OWNERS:
        b.sim.set_link(owner, up=True)
    quiet = 0
    while quiet < 40:
        b.time.pass_ms(50)
        before = len(sides[0].received) + len(sides[1].received)
        for side in sides:
            side.recv(b, 100_000)
        quiet = 0 if len(sides[0].received) + len(sides[1].received) > before else quiet + 1


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(
    moves=st.lists(MOVES, min_size=20, max_size=60),
    small=st.booleans(),
    latency_ms=st.sampled_from((0, 3, 60, 150)),
    fragment=st.booleans(),
    seed=st.integers(0, 1000),
)
def test_random_sends_recvs_and_cuts_keep_every_byte_in_order(
    moves: list[tuple[str, int, int]], small: bool, latency_ms: int, fragment: bool, seed: int
) -> None:
    b = SimBench(SimKernel(seed=seed, latency_ns=latency_ms * MS, fragment=fragment))
    options = SocketOptions(keep_alive_s=3600, small_buffers=small)
    one = b.partners(options, options)
    sides = (Side(one.client), Side(one.server))
    play(b, sides, moves)
    drain(b, sides)
    for side, other in (sides, sides[::-1]):
        assert bytes(other.sent).startswith(side.received)
        if sides[0].ended is None and sides[1].ended is None:
            assert side.received == other.sent


@pytest.mark.slow
@settings(deadline=None, max_examples=100)
@given(
    moves=st.lists(MOVES, min_size=8, max_size=25),
    small=st.booleans(),
    abort=st.booleans(),
    latency_ms=st.sampled_from((0, 3)),
)
def test_what_an_orderly_close_leaves_after_arrives_and_an_abort_cuts_only_the_tail(
    moves: list[tuple[str, int, int]], small: bool, abort: bool, latency_ms: int
) -> None:
    b = SimBench(SimKernel(latency_ns=latency_ms * MS))
    options = SocketOptions(keep_alive_s=3600, small_buffers=small)
    one = b.partners(options, options)
    sides = (Side(one.client), Side(one.server))
    play(b, sides, [move for move in moves if move[0] != "cut"])
    b.sim.poll()
    sides[0].recv(b, 1 << 20)  # unread input would turn close into RST
    unread = b.sim.unread(one.client)
    b.sim.abort(one.client) if abort else b.sim.close(one.client)
    received = sides[1].received
    while sides[1].ended is None:
        b.time.pass_ms(50)
        sides[1].recv(b, 100_000)
    assert bytes(sides[0].sent).startswith(received)
    if not abort and not unread and sides[1].ended == 0:
        assert received == sides[0].sent


@settings(deadline=None, max_examples=60)
@given(
    moves=st.lists(st.tuples(SIDES, st.booleans(), st.integers(1, 3000)), max_size=60),
    seed=st.integers(0, 99),
)
def test_two_runs_of_one_seed_are_the_same_run(moves: list[tuple[int, bool, int]], seed: int) -> None:
    def run() -> list[object]:
        b = SimBench(SimKernel(seed=seed, fragment=True))
        one = b.partners()
        ends = (one.client, one.server)
        answers: list[object] = []
        for which, sends, size in moves:
            b.sim.poll()
            answers.append(b.try_send(ends[which], bytes(size)) if sends else b.try_recv(ends[which], size))
        return answers

    assert run() == run()
