"""What a peer still has to send: when each chunk is due, and in which order."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from trcvtui.bench.peers.queues import Outbox
from trcvtui.commands.words import PeerSend


def play(outbox: Outbox, until: int, step: int = 10, stack: int = 1 << 30) -> list[tuple[int, bytes]]:
    """Return what goes out, and when; the stack takes at most `stack` bytes a step."""
    gone: list[tuple[int, bytes]] = []
    for now in range(0, until + 1, step):
        room = stack
        while room and (chunk := outbox.due_bytes(now)) is not None:
            taken = bytes(chunk[:room])
            gone.append((now, taken))
            room -= len(taken)
            outbox.count_sent(len(taken), now)
    return gone


def box(*sends: PeerSend) -> Outbox:
    outbox = Outbox()
    for send in sends:
        outbox.put(send, 0)
    return outbox


def test_without_a_gap_all_chunks_go_at_once() -> None:
    assert play(box(PeerSend("P", b"abcdef", (1, 2))), 0) == [(0, b"a"), (0, b"bc"), (0, b"def")]


def test_a_gap_stands_between_the_chunks_and_between_the_messages() -> None:
    send = PeerSend("P", b"abc", (1,), gap_ns=20, repeat=2)
    assert play(box(send), 100) == [(0, b"a"), (20, b"bc"), (40, b"a"), (60, b"bc")]


def test_every_counts_from_the_beginning_of_a_message() -> None:
    send = PeerSend("P", b"abc", (1,), gap_ns=20, repeat=3, every_ns=50)
    assert [now for now, _ in play(box(send), 200)] == [0, 20, 50, 70, 100, 120]


def test_a_message_longer_than_its_period_delays_the_next() -> None:
    send = PeerSend("P", b"abc", (1,), gap_ns=80, repeat=2, every_ns=50)
    assert [now for now, _ in play(box(send), 300)] == [0, 80, 80, 160]


def test_scans_that_do_not_fit_the_period_cause_no_drift() -> None:
    send = PeerSend("P", b"a", repeat=5, every_ns=15)
    assert [now for now, _ in play(box(send), 100)] == [0, 20, 30, 50, 60]


def test_a_second_send_waits_for_the_first() -> None:
    outbox = box(PeerSend("P", b"ab", (1,), gap_ns=30), PeerSend("P", b"cd", (1,), gap_ns=10))
    assert play(outbox, 100) == [(0, b"a"), (30, b"b"), (30, b"c"), (40, b"d")]


def test_what_the_stack_does_not_take_stays_first() -> None:
    outbox = box(PeerSend("P", b"abcde"), PeerSend("P", b"f"))
    assert play(outbox, 30, stack=2) == [(0, b"ab"), (10, b"cd"), (20, b"e"), (20, b"f")]


def test_a_message_is_announced_once() -> None:
    outbox = box(PeerSend("P", b"abc", (1,), repeat=2))
    announced = []
    while (chunk := outbox.due_bytes(0)) is not None:
        announced.append(outbox.message_start)
        outbox.count_sent(len(chunk), 0)
    assert announced == [(3, b"abc"), (0, b""), (3, b"abc"), (0, b"")]


def test_dropping_tells_how_much() -> None:
    outbox = box(PeerSend("P", b"abc", (1,), gap_ns=10, repeat=3), PeerSend("P", b"de"))
    outbox.count_sent(1, 0)
    assert (outbox.unsent, outbox.clear(), outbox.unsent, outbox.due_bytes(1000)) == (10, 10, 0, None)


SENDS = st.builds(
    PeerSend,
    st.just("P"),
    st.binary(min_size=1, max_size=12),
    st.lists(st.integers(1, 5), max_size=3).map(tuple),
    st.integers(0, 25),
    st.integers(1, 3),
    st.integers(0, 40),
)


@given(st.lists(SENDS, min_size=1, max_size=3), st.integers(1, 20))
def test_every_byte_goes_out_once_and_in_order(sends: list[PeerSend], stack: int) -> None:
    gone = play(box(*sends), 5000, stack=stack)
    assert b"".join(chunk for _, chunk in gone) == b"".join(s.payload * s.repeat for s in sends)
