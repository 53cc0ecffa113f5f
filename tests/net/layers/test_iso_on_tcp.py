"""ISO-on-TCP sessions against each other and against bytes: handshake, sizes, messages, refusals, trouble."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trcvtui.net.layer import LayerMessage, SessionEnd
from trcvtui.net.layers.iso_on_tcp import (
    MOST_WAITING_MESSAGES,
    Code,
    ConnectTpdu,
    DataTpdu,
    DisconnectTpdu,
    IsoSession,
    IsoSettings,
    TpktReader,
    encode_tpdu,
)

E001, E002, E003 = b"\xe0\x01", b"\xe0\x02", b"\xe0\x03"
CALLER = IsoSettings(local=E001, remote=E002, cap=8192)
CALLED = IsoSettings(local=E002, remote=E001, cap=8192)
CR = bytes.fromhex("03 00 00 16 11 e0 00 00 00 01 00 c1 02 e0 01 c2 02 e0 02 c0 01 0a")
CC = bytes.fromhex("03 00 00 16 11 d0 00 01 00 01 00 c1 02 e0 01 c2 02 e0 02 c0 01 0a")
ABC = bytes.fromhex("03 00 00 0a 02 f0 80 61 62 63")
AB_AND_C = bytes.fromhex("03 00 00 09 02 f0 00 61 62 03 00 00 08 02 f0 80 63")
LARGEST_TPKT = 65535


def fed(session: IsoSession, data: bytes) -> None:
    session.feed(memoryview(data))


def read(session: IsoSession, room: int = 65536) -> LayerMessage | None:
    return session.read(memoryview(bytearray(room)))


def pair(caller: IsoSettings = CALLER, called: IsoSettings = CALLED) -> tuple[IsoSession, IsoSession]:
    active, passive = caller.make_session(is_active=True), called.make_session(is_active=False)
    fed(passive, active.take_output())
    assert passive.find_mismatch(called) == ""
    passive.accept_for(called)
    fed(active, passive.take_output())
    assert active.is_up
    assert passive.is_up
    return active, passive


# -- the handshake -----------------------------------------------------------------------------------------


def test_the_active_end_begins_with_the_cr_of_the_vectors() -> None:
    active = CALLER.make_session(is_active=True)
    assert active.take_output() == CR
    assert active.take_output() == b""
    assert not active.is_up


def test_the_passive_end_answers_with_a_cc_only_when_somebody_takes_the_cr() -> None:
    passive = CALLED.make_session(is_active=False)
    fed(passive, CR)
    assert passive.has_asked
    assert (passive.take_output(), passive.is_up, passive.wants_more) == (b"", False, False)
    passive.accept_for(CALLED)
    assert (passive.take_output(), passive.is_up) == (CC, True)


@pytest.mark.parametrize(
    ("proposed", "taken", "agreed"),
    [(10, 10, 1024), (7, 10, 128), (13, 10, 1024), (10, 7, 128), (8, 13, 256)],
)
def test_both_ends_keep_to_the_smaller_size(proposed: int, taken: int, agreed: int) -> None:
    ends = pair(IsoSettings(E001, E002, 8192, proposed), IsoSettings(E002, E001, 8192, taken))
    for end in ends:
        pieces = TpktReader().feed(end.encode(bytes(3000)))
        sizes = [len(piece.payload) + 3 for piece in pieces if isinstance(piece, DataTpdu)]
        assert len(sizes) == len(pieces)
        assert max(sizes) == agreed
        assert sum(sizes) == 3000 + 3 * len(pieces)


@pytest.mark.parametrize(("told", "sent"), [(128, 128), (512, 512), (65531, 1024)])
def test_a_partner_who_tells_no_size_gets_the_default_but_no_more_than_our_own(told: int, sent: int) -> None:
    own = IsoSettings(E002, E001, 8192, default_dt_bytes=told)
    passive = own.make_session(is_active=False)
    fed(passive, encode_tpdu(ConnectTpdu(Code.CR, 0, 7, E001, E002)))
    passive.accept_for(own)
    active = IsoSettings(E001, E002, 8192, default_dt_bytes=told).make_session(is_active=True)
    fed(active, encode_tpdu(ConnectTpdu(Code.CC, 1, 5, E001, E002)))
    for end in (passive, active):
        end.take_output()
        first = TpktReader().feed(end.encode(bytes(3000)))[0]
        assert isinstance(first, DataTpdu) and len(first.payload) + 3 == sent


@pytest.mark.parametrize("proposed", [2, 3, 6, 7])
def test_a_cc_never_enlarges_what_the_cr_proposed(proposed: int) -> None:
    passive = CALLED.make_session(is_active=False)
    fed(passive, encode_tpdu(ConnectTpdu(Code.CR, 0, 7, E001, E002, proposed)))
    passive.accept_for(CALLED)
    assert TpktReader().feed(passive.take_output()) == [ConnectTpdu(Code.CC, 7, 1, E001, E002, proposed)]
    first = TpktReader().feed(passive.encode(bytes(3000)))[0]
    assert isinstance(first, DataTpdu) and len(first.payload) + 3 == 1 << proposed


@pytest.mark.parametrize("size", [0, 1])
@pytest.mark.parametrize("is_active", [False, True])
def test_a_size_without_room_for_data_ends_the_connection(size: int, is_active: bool) -> None:
    session = CALLED.make_session(is_active)
    fed(session, encode_tpdu(ConnectTpdu(Code.CC if is_active else Code.CR, 0, 7, E001, E002, size)))
    assert session.ended == SessionEnd("EPROTO", f"the TPDU size code {size:02X} leaves no room for data")


@pytest.mark.parametrize(
    "cc", [ConnectTpdu(Code.CC, 1, 7, other_class=2), ConnectTpdu(Code.CC, 1, 7, E001, E002, size_code=0)]
)
def test_a_cc_that_cannot_be_agreed_to_ends_the_connection_without_a_word(cc: ConnectTpdu) -> None:
    active = CALLER.make_session(is_active=True)
    active.take_output()
    fed(active, encode_tpdu(cc))
    assert (active.take_output(), active.ended is not None) == (b"", True)


def test_a_cc_cannot_raise_what_was_proposed() -> None:
    active = IsoSettings(E001, E002, 8192, 7).make_session(is_active=True)
    fed(active, encode_tpdu(ConnectTpdu(Code.CC, 1, 5, E001, E002, 13)))
    first = TpktReader().feed(active.encode(bytes(3000)))[0]
    assert isinstance(first, DataTpdu)
    assert len(first.payload) == 125


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
    passive = called.make_session(is_active=False)
    fed(passive, CR)
    assert passive.find_mismatch(called) == why


def test_a_stream_that_ends_before_the_cc_is_a_refusal() -> None:
    active = CALLER.make_session(is_active=True)
    active.note_partner_end()
    assert active.ended == SessionEnd("ECONNREFUSED", "closed instead of a CC")


# -- messages ----------------------------------------------------------------------------------------------


def test_who_reads_nothing_stops_the_partner() -> None:
    active, passive = pair()
    for number in range(MOST_WAITING_MESSAGES):
        assert passive.wants_more, number
        fed(passive, active.encode(b"message"))
    assert not passive.wants_more
    assert read(passive) == LayerMessage(b"message", 7)
    assert passive.wants_more


def test_a_dr_after_messages_leaves_them_readable() -> None:
    active, passive = pair()
    fed(passive, active.encode(b"last") + encode_tpdu(DisconnectTpdu(1, 1, 0x80)))
    assert passive.ended == SessionEnd("ECONNRESET", "DR, reason 80")
    assert read(passive) == LayerMessage(b"last", 4)


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
    st.builds(lambda data, last: encode_tpdu(DataTpdu(data, last)), st.binary(max_size=900), st.booleans()),
    st.just(CR),
    st.just(CC),
    st.builds(lambda reason: encode_tpdu(DisconnectTpdu(1, 1, reason)), st.integers(0, 255)),
    st.builds(lambda size: b"\x03\0" + size.to_bytes(2, "big") + b"\x02\xf0\0", st.integers(0, 65535)),
)


@pytest.mark.slow
@given(st.booleans(), st.booleans(), st.lists(TPDUS, max_size=30), CUTS)
@settings(max_examples=150)
def test_no_input_crashes_a_session_or_makes_it_hold_more_than_its_cap_and_one_tpkt(
    is_active: bool, is_up: bool, parts: list[bytes], cuts: list[int]
) -> None:
    small = IsoSettings(E002, E001, cap=100)
    session = small.make_session(is_active)
    if is_up:
        fed(session, CC if is_active else CR)
        if session.has_asked:
            session.accept_for(small)
    for piece in pieces(b"".join(parts), cuts):
        if session.wants_more:
            fed(session, piece)
        # One message that is not complete, those that wait, those that this piece completed, one TPKT.
        assert session.held_bytes <= 100 + 100 + len(piece) + LARGEST_TPKT
        assert len(session.take_output()) < 200
