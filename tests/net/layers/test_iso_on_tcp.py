"""ISO-on-TCP sessions against each other and against bytes: handshake, sizes, messages, refusals, trouble."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trcvtui.net.layer import Ended, LayerMessage
from trcvtui.net.layers.iso_on_tcp import (
    MESSAGES_WAITING,
    Code,
    Connect,
    Data,
    Disconnect,
    IsoOnTcp,
    IsoSettings,
    TpktReader,
    encode,
    segments,
)

E001, E002, E003 = b"\xe0\x01", b"\xe0\x02", b"\xe0\x03"
CALLER = IsoSettings(local=E001, remote=E002, cap=8192)
CALLED = IsoSettings(local=E002, remote=E001, cap=8192)
CR = bytes.fromhex("03 00 00 16 11 e0 00 00 00 01 00 c1 02 e0 01 c2 02 e0 02 c0 01 0a")
CC = bytes.fromhex("03 00 00 16 11 d0 00 01 00 01 00 c1 02 e0 01 c2 02 e0 02 c0 01 0a")
ABC = bytes.fromhex("03 00 00 0a 02 f0 80 61 62 63")
AB_AND_C = bytes.fromhex("03 00 00 09 02 f0 00 61 62 03 00 00 08 02 f0 80 63")
LARGEST_TPKT = 65535


def fed(session: IsoOnTcp, data: bytes) -> None:
    session.feed(memoryview(data))


def read(session: IsoOnTcp, room: int = 65536) -> LayerMessage | None:
    return session.read(memoryview(bytearray(room)))


def pair(caller: IsoSettings = CALLER, called: IsoSettings = CALLED) -> tuple[IsoOnTcp, IsoOnTcp]:
    """Return two ends whose handshake is over."""
    active, passive = caller.new(is_active=True), called.new(is_active=False)
    fed(passive, active.take_output())
    assert passive.is_for(called) == ""
    passive.give_to(called)
    fed(active, passive.take_output())
    assert active.is_up
    assert passive.is_up
    return active, passive


# -- the handshake -----------------------------------------------------------------------------------------


def test_the_active_end_begins_with_the_cr_of_the_vectors() -> None:
    active = CALLER.new(is_active=True)
    assert active.take_output() == CR
    assert active.take_output() == b""
    assert not active.is_up


def test_the_passive_end_answers_with_a_cc_only_when_somebody_takes_the_cr() -> None:
    passive = CALLED.new(is_active=False)
    fed(passive, CR)
    assert passive.has_asked
    assert (passive.take_output(), passive.is_up, passive.wants_more) == (b"", False, False)
    passive.give_to(CALLED)
    assert (passive.take_output(), passive.is_up) == (CC, True)


@pytest.mark.parametrize("cut", range(1, len(CR)))
def test_a_cr_that_comes_in_two_pieces_is_one(cut: int) -> None:
    passive = CALLED.new(is_active=False)
    fed(passive, CR[:cut])
    assert not passive.has_asked
    fed(passive, CR[cut:])
    assert passive.has_asked


@pytest.mark.parametrize("cut", range(1, len(CC)))
def test_a_cc_that_comes_in_two_pieces_is_one(cut: int) -> None:
    active = CALLER.new(is_active=True)
    fed(active, CC[:cut])
    assert not active.is_up
    fed(active, CC[cut:])
    assert active.is_up


@pytest.mark.parametrize("cut", range(1, len(ABC + AB_AND_C)))
def test_messages_are_the_same_wherever_the_stream_is_cut(cut: int) -> None:
    _, passive = pair()
    stream = ABC + AB_AND_C
    fed(passive, stream[:cut])
    fed(passive, stream[cut:])
    assert [read(passive), read(passive), read(passive)] == [
        LayerMessage(b"abc", 3),
        LayerMessage(b"abc", 3),
        None,
    ]


@pytest.mark.parametrize(
    ("proposed", "taken", "agreed"),
    [(10, 10, 1024), (7, 10, 128), (13, 10, 1024), (10, 7, 128), (8, 13, 256)],
)
def test_both_ends_keep_to_the_smaller_size(proposed: int, taken: int, agreed: int) -> None:
    ends = pair(IsoSettings(E001, E002, 8192, proposed), IsoSettings(E002, E001, 8192, taken))
    for end in ends:
        pieces = TpktReader().feed(end.encode(bytes(3000)))
        sizes = [len(piece.payload) + 3 for piece in pieces if isinstance(piece, Data)]
        assert len(sizes) == len(pieces)
        assert max(sizes) == agreed
        assert sum(sizes) == 3000 + 3 * len(pieces)


def test_who_tells_no_size_gets_none_and_is_sent_pieces_of_1024() -> None:
    passive = CALLED.new(is_active=False)
    fed(passive, encode(Connect(Code.CR, 0, 7, E001, E002)))
    passive.give_to(CALLED)
    assert TpktReader().feed(passive.take_output()) == [Connect(Code.CC, 7, 1, E001, E002)]
    first = TpktReader().feed(passive.encode(bytes(3000)))[0]
    assert isinstance(first, Data)
    assert len(first.payload) == 1021
    fed(passive, segments(bytes(8000), 65000))  # and may send what it likes
    assert read(passive) == LayerMessage(bytes(8000), 8000)


@pytest.mark.parametrize(("told", "sent"), [(128, 128), (512, 512), (65531, 1024)])
def test_a_partner_who_tells_no_size_gets_the_default_but_no_more_than_our_own(told: int, sent: int) -> None:
    own = IsoSettings(E002, E001, 8192, not_told=told)
    passive = own.new(is_active=False)
    fed(passive, encode(Connect(Code.CR, 0, 7, E001, E002)))
    passive.give_to(own)
    active = IsoSettings(E001, E002, 8192, not_told=told).new(is_active=True)
    fed(active, encode(Connect(Code.CC, 1, 5, E001, E002)))
    for end in (passive, active):
        end.take_output()
        first = TpktReader().feed(end.encode(bytes(3000)))[0]
        assert isinstance(first, Data) and len(first.payload) + 3 == sent


@pytest.mark.parametrize("proposed", [2, 3, 6, 7])
def test_a_cc_never_enlarges_what_the_cr_proposed(proposed: int) -> None:
    passive = CALLED.new(is_active=False)
    fed(passive, encode(Connect(Code.CR, 0, 7, E001, E002, proposed)))
    passive.give_to(CALLED)
    assert TpktReader().feed(passive.take_output()) == [Connect(Code.CC, 7, 1, E001, E002, proposed)]
    first = TpktReader().feed(passive.encode(bytes(3000)))[0]
    assert isinstance(first, Data) and len(first.payload) + 3 == 1 << proposed


@pytest.mark.parametrize("size", [0, 1])
@pytest.mark.parametrize("is_active", [False, True])
def test_a_size_without_room_for_data_ends_the_connection(size: int, is_active: bool) -> None:
    session = CALLED.new(is_active)
    fed(session, encode(Connect(Code.CC if is_active else Code.CR, 0, 7, E001, E002, size)))
    assert session.ended == Ended("EPROTO", f"the TPDU size code {size:02X} leaves no room for data")


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        (Connect(Code.CR, 0, 7, E001, E002, other_class=2), "class 2 in a CR"),
        (Connect(Code.CR, 0, 7, E001, E002, 0), "the TPDU size code 00 leaves no room for data"),
    ],
)
def test_a_cr_that_cannot_be_agreed_to_is_answered_with_a_dr_before_the_end(
    request_: Connect, why: str
) -> None:
    passive = CALLED.new(is_active=False)
    fed(passive, encode(request_))
    assert TpktReader().feed(passive.take_output()) == [Disconnect(7, 0, 0x82)]
    assert passive.ended == Ended("EPROTO", why)


@pytest.mark.parametrize(
    "cc", [Connect(Code.CC, 1, 7, other_class=2), Connect(Code.CC, 1, 7, E001, E002, size_code=0)]
)
def test_a_cc_that_cannot_be_agreed_to_ends_the_connection_without_a_word(cc: Connect) -> None:
    active = CALLER.new(is_active=True)
    active.take_output()
    fed(active, encode(cc))
    assert (active.take_output(), active.ended is not None) == (b"", True)


def test_a_cc_cannot_raise_what_was_proposed() -> None:
    active = IsoSettings(E001, E002, 8192, 7).new(is_active=True)
    fed(active, encode(Connect(Code.CC, 1, 5, E001, E002, 13)))
    first = TpktReader().feed(active.encode(bytes(3000)))[0]
    assert isinstance(first, Data)
    assert len(first.payload) == 125


def test_a_dt_larger_than_agreed_ends_the_connection_as_on_a_cpu() -> None:
    _, passive = pair()
    fed(passive, encode(Data(bytes(1022), True)))
    assert passive.ended == Ended("EPROTO", "a DT of 1025 bytes, 1024 are agreed")
    assert read(passive) is None


# -- who is asked for --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("called", "why"),
    [
        (IsoSettings(E003, E001, 8192), "no CONNECT has the TSAP e0 02"),
        (IsoSettings(E002, E003, 8192), "the TSAP e0 01 is not the partner's"),
        (IsoSettings(E002, b"", 8192), ""),
    ],
)
def test_a_cr_is_for_the_connect_with_both_tsaps(called: IsoSettings, why: str) -> None:
    passive = called.new(is_active=False)
    fed(passive, CR)
    assert passive.is_for(called) == why


@pytest.mark.parametrize(("is_known", "reason"), [(False, 3), (True, 2)])
def test_a_refusal_is_a_dr_with_its_reason_and_the_caller_ends_refused(is_known: bool, reason: int) -> None:
    active, passive = CALLER.new(is_active=True), CALLED.new(is_active=False)
    fed(passive, active.take_output())
    passive.refuse(is_known)
    said = passive.take_output()
    assert TpktReader().feed(said) == [Disconnect(1, 0, reason)]
    fed(active, said)
    assert active.ended == Ended("ECONNREFUSED", f"DR, reason {reason:02X}")


def test_a_stream_that_ends_before_the_cc_is_a_refusal() -> None:
    active = CALLER.new(is_active=True)
    active.partner_closed()
    assert active.ended == Ended("ECONNREFUSED", "closed instead of a CC")


# -- messages ----------------------------------------------------------------------------------------------


def test_a_message_longer_than_the_room_loses_its_rest_and_the_next_is_clean() -> None:
    active, passive = pair()
    fed(passive, active.encode(b"0123456789") + active.encode(b"next"))
    assert read(passive, room=4) == LayerMessage(b"0123", 10)
    assert read(passive, room=4) == LayerMessage(b"next", 4)


def test_a_message_longer_than_the_cap_keeps_the_cap_and_counts_the_rest() -> None:
    active, passive = pair()
    fed(passive, active.encode(bytes(20_000)))
    assert read(passive) == LayerMessage(bytes(8192), 20_000)


def test_an_empty_message_is_none() -> None:
    active, passive = pair()
    fed(passive, active.encode(b"") + active.encode(b"x"))
    assert read(passive) == LayerMessage(b"x", 1)


def test_who_reads_nothing_stops_the_partner() -> None:
    active, passive = pair()
    for number in range(MESSAGES_WAITING):
        assert passive.wants_more, number
        fed(passive, active.encode(b"message"))
    assert not passive.wants_more
    assert read(passive) == LayerMessage(b"message", 7)
    assert passive.wants_more


def test_what_waits_can_be_dropped() -> None:
    active, passive = pair()
    fed(passive, active.encode(b"one") + active.encode(b"three"))
    assert passive.drop_data() == 8
    assert (passive.has_data, passive.held) == (False, 0)


def test_a_dr_after_messages_leaves_them_readable() -> None:
    active, passive = pair()
    fed(passive, active.encode(b"last") + encode(Disconnect(1, 1, 0x80)))
    assert passive.ended == Ended("ECONNRESET", "DR, reason 80")
    assert read(passive) == LayerMessage(b"last", 4)


@pytest.mark.parametrize(
    ("sent", "detail"),
    [
        (CR, "a CR out of turn"),
        (CC, "a CC out of turn"),
        (b"\x04\0\0\x07", "TPKT version 4"),
        (bytes.fromhex("03 00 00 09 04 70 00 05 02"), "ER, cause 02"),
    ],
)
def test_what_cannot_be_right_ends_a_connection_with_its_reason(sent: bytes, detail: str) -> None:
    _, passive = pair()
    fed(passive, sent)
    assert passive.ended == Ended("EPROTO", detail)


def test_data_before_the_handshake_is_out_of_turn() -> None:
    passive = CALLED.new(is_active=False)
    fed(passive, ABC)
    assert passive.ended == Ended("EPROTO", "a DT out of turn")


# -- whatever comes ----------------------------------------------------------------------------------------

SIZES = st.integers(7, 13)
MESSAGES = st.lists(st.integers(1, 5000), min_size=1, max_size=3)
CUTS = st.lists(st.integers(1, 4000), max_size=12)


def pieces(stream: bytes, sizes: list[int]) -> list[bytes]:
    marks = [0, *itertools.accumulate(sizes), len(stream)]
    return [
        stream[begin:end] for begin, end in itertools.pairwise(sorted(min(m, len(stream)) for m in marks))
    ]


@given(SIZES, SIZES, MESSAGES, CUTS)
@settings(max_examples=60)
def test_what_one_end_sends_the_other_receives(
    own: int, other: int, lengths: list[int], cuts: list[int]
) -> None:
    active, passive = pair(IsoSettings(E001, E002, 8192, own), IsoSettings(E002, E001, 8192, other))
    messages = [bytes(n % 251 for n in range(size)) for size in lengths]
    got: list[LayerMessage | None] = []
    for piece in pieces(b"".join(active.encode(message) for message in messages), cuts):
        fed(passive, piece)
        while passive.has_data:
            got.append(read(passive))
    assert got == [LayerMessage(message, len(message)) for message in messages]


TPDUS = st.one_of(
    st.binary(max_size=60),
    st.builds(lambda data, last: encode(Data(data, last)), st.binary(max_size=900), st.booleans()),
    st.just(CR),
    st.just(CC),
    st.builds(lambda reason: encode(Disconnect(1, 1, reason)), st.integers(0, 255)),
    st.builds(lambda size: b"\x03\0" + size.to_bytes(2, "big") + b"\x02\xf0\0", st.integers(0, 65535)),
)


@pytest.mark.slow
@given(st.booleans(), st.booleans(), st.lists(TPDUS, max_size=30), CUTS)
@settings(max_examples=150)
def test_no_input_crashes_a_session_or_makes_it_hold_more_than_its_cap_and_one_tpkt(
    is_active: bool, is_up: bool, parts: list[bytes], cuts: list[int]
) -> None:
    small = IsoSettings(E002, E001, cap=100)
    session = small.new(is_active)
    if is_up:
        fed(session, CC if is_active else CR)
        if session.has_asked:
            session.give_to(small)
    for piece in pieces(b"".join(parts), cuts):
        if session.wants_more:
            fed(session, piece)
        # One message that is not complete, those that wait, those that this piece completed, one TPKT.
        assert session.held <= 100 + 100 + len(piece) + LARGEST_TPKT
        assert len(session.take_output()) < 200
