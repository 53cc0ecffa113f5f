"""Whatever a partner sends: nothing raises, little is held, an end by itself is told once, nothing leaks."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.net.layers.iso_bench import E001, E002, SECOND, IsoBench, Net
from tests.net.layers.test_iso_on_tcp import TPDUS
from tests.net.sim.net_sim import SimNetwork
from trcvtui.net.kernel import NewClient, SocketOptions
from trcvtui.net.layers.iso_on_tcp import MOST_REMARKS, Code, ConnectTpdu, IsoSettings, encode_tpdu
from trcvtui.net.layers.layered_stream import READ_BYTES, SESSION_ENDED, TPDU_IGNORED
from trcvtui.net.sim.kernel import SimKernel

CAP = 1000
LARGEST_TPKT = 65535
WAITS = IsoSettings(E002, E001, CAP)
CR = encode_tpdu(ConnectTpdu(Code.CR, 0, 1, E001, E002, 10))
# What a session may hold: two messages' worth, one TPKT, and what one read has completed.
MOST = 2 * CAP + LARGEST_TPKT + READ_BYTES
PAUSES = st.integers(0, 40 * SECOND)


@given(st.booleans(), st.lists(st.tuples(TPDUS, PAUSES), max_size=12), st.booleans())
@settings(max_examples=80, deadline=None)
def test_noise_is_held_in_bounds_and_its_end_is_told_once(
    is_up: bool, sent: list[tuple[bytes, int]], reads: bool
) -> None:
    sim = SimKernel()
    b = IsoBench(Net(SimNetwork(sim)))
    listener = b.iso_listener(WAITS)
    client = b.connect(b.end(listener))
    if is_up:
        b.send(client, CR)
    called = None
    for data, pause in sent:
        b.kernel.send(client, memoryview(data))
        b.net.now += pause
        b.settle()
        got = b.kernel.accept(listener)
        if isinstance(got, NewClient):
            called = got.handle
            b.kernel.set_options(called, SocketOptions(session=WAITS))
        if called is not None:
            assert b.net.inside(called) <= MOST
            if reads:
                b.kernel.recv_from(called, memoryview(bytearray(CAP)))
    b.close_all(client, *([called] if called is not None else []), listener)
    whats = [what for _, what, _ in b.net.heard]
    assert whats.count(SESSION_ENDED) <= 1
    assert whats.count(TPDU_IGNORED) <= MOST_REMARKS + 1
    assert len(b.net.told) <= 1
    assert sim.leaks() == ()
