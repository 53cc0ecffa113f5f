"""Who is refused, who is dropped, and what the ledger is told of it; on both networks, in virtual time."""

from __future__ import annotations

import pytest

from tests.net.layers.iso_bench import (
    CAP,
    E001,
    E002,
    E003,
    REFUSED,
    SECOND,
    WAITS,
    IsoBench,
    answer_of,
    raw_client,
    raw_up,
)
from trcvtui.net.kernel import NewClient
from trcvtui.net.layers.iso_on_tcp import (
    Code,
    ConnectTpdu,
    DataTpdu,
    DisconnectTpdu,
    IsoSettings,
    encode_tpdu,
)
from trcvtui.net.layers.layered_stream import GAVE_WAY_TEXT, MOST_WAITING_CLIENTS, SESSION_ENDED, TPDU_IGNORED
from trcvtui.net.results import WOULD_BLOCK, Fault


def test_an_unknown_tsap_is_refused_and_told(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    caller = b.call(b.end(listener), IsoSettings(E001, E003, CAP))
    assert b.verdict(caller) == REFUSED
    assert b.net.told == [("C1", "no CONNECT has the TSAP e0 03")]
    assert not b.kernel.readable(listener)
    assert b.net.heard == [("P1", SESSION_ENDED, "DR, reason 03")]  # of our own call


EXPEDITED = b"\x03\0\0\x0b\x06\x10\0\1\0\1\x07"  # an ED, which class 0 does not have


@pytest.mark.parametrize(("called", "reason"), [(E003, 3), (E002, 2)])
def test_the_refusal_on_the_wire_is_a_dr_with_its_reason_and_then_the_end(
    b: IsoBench, called: bytes, reason: int
) -> None:
    listener = b.iso_listener(WAITS)
    client = raw_client(b, b.end(listener), encode_tpdu(ConnectTpdu(Code.CR, 0, 0x4431, E001, called, 10)))
    if called == E002:
        b.until(lambda: b.kernel.readable(listener))
        got = b.kernel.accept(listener)
        assert isinstance(got, NewClient)
        b.kernel.abort(got.handle)  # a second client is turned away
    assert answer_of(b, client, 11) == [DisconnectTpdu(0x4431, 0, reason)]
    assert b.answer(client) == 0


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"GET / HTTP/1.1\r\n\r\n", "TPKT version 71"),
        (b"\x16\x03\x01\x02\x00\x01", "TPKT version 22"),
        (b"\x03\x00\x00\x03", "a TPKT of 3 bytes"),
        (encode_tpdu(DataTpdu(b"abc", True)), "a DT out of turn"),
    ],
)
def test_garbage_is_dropped_and_told(b: IsoBench, data: bytes, why: str) -> None:
    listener = b.iso_listener(WAITS)
    client = raw_client(b, b.end(listener), data)
    b.until(lambda: b.net.told)
    assert b.net.told == [("C1", why)]
    assert b.answer(client) in (0, Fault("recv", "ECONNRESET"))


def test_a_client_that_leaves_before_its_cr_is_told(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    client = raw_client(b, b.end(listener), b"\x03\x00")
    b.kernel.close(client)
    b.until(lambda: b.net.told)
    assert b.net.told == [("C1", "closed before the handshake")]


def test_a_client_that_speaks_too_slowly_is_dropped_after_5_s(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    client = raw_client(b, b.end(listener))
    b.until(lambda: b.kernel.poll_add(client) or True)
    for byte in encode_tpdu(ConnectTpdu(Code.CR, 0, 1, E001, E002, 10))[:5]:
        b.net.now += SECOND
        assert b.net.told == []
        b.send(client, bytes([byte]))
        b.settle()
    b.net.now += SECOND
    b.until(lambda: b.net.told)
    assert b.net.told == [("C1", "no handshake in 5 s")]


def test_forty_silent_clients_do_not_delay_a_good_one(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    end = b.end(listener)
    for _ in range(40):
        raw_client(b, end)
    last = b.call(end)
    b.taken(listener, caller=last)
    assert b.verdict(last) is None
    assert b.net.now == 0  # nobody had to wait for a time limit
    assert b.net.told == [("C1", GAVE_WAY_TEXT)] * len(b.net.told)
    assert len(b.net.told) in (40 - MOST_WAITING_CLIENTS, 41 - MOST_WAITING_CLIENTS)


def test_a_client_in_the_middle_of_its_cr_keeps_its_place_before_silent_ones(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    end = b.end(listener)
    request = encode_tpdu(ConnectTpdu(Code.CR, 0, 9, E001, E002, 10))
    slow = raw_client(b, end, request[:5])
    b.settle()
    for _ in range(2 * MOST_WAITING_CLIENTS):
        raw_client(b, end)
    b.settle()
    assert b.net.told
    b.send(slow, request[5:])
    b.until(lambda: b.kernel.readable(listener))


def test_clients_that_nobody_takes_are_refused_from_a_number_on(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    end = b.end(listener)
    request = encode_tpdu(ConnectTpdu(Code.CR, 0, 9, E001, E002, 10))
    clients = []
    for _ in range(MOST_WAITING_CLIENTS):
        clients.append(raw_client(b, end, request))
        b.settle()
    assert b.net.told == []
    one_more = raw_client(b, end, request)
    b.until(lambda: b.net.told)
    assert b.net.told == [("C1", "the queue is full: 16 clients wait to be accepted")]
    assert answer_of(b, one_more, 11) == [DisconnectTpdu(9, 0, 2)]


def test_a_dt_larger_than_agreed_ends_an_established_connection(b: IsoBench) -> None:
    client, called = raw_up(b)
    assert answer_of(b, client, 22) == [ConnectTpdu(Code.CC, 1, 1, E001, E002, 7)]
    b.send(client, encode_tpdu(DataTpdu(bytes(126), True)))
    assert b.loss(called).fault == Fault("session", "EPROTO")
    assert b.net.heard == [("C1", SESSION_ENDED, "a DT of 129 bytes, but 128 are agreed")]


@pytest.mark.parametrize(
    ("begins", "why"),
    [
        (b"\x03\0\x9c\x40", "a TPKT of 40000 bytes, but TPDUs of 128 are agreed"),
        (b"\x03\0\0\x86\x02\xf0", "a DT of 130 bytes, but 128 are agreed"),
    ],
)
def test_a_tpkt_announced_larger_than_agreed_is_refused_when_its_header_is_there(
    b: IsoBench, begins: bytes, why: str
) -> None:
    client, called = raw_up(b)
    b.send(client, begins[:-1])
    b.settle()
    assert b.net.heard == []
    b.send(client, begins[-1:])
    assert b.loss(called).fault == Fault("session", "EPROTO")
    assert b.net.heard == [("C1", SESSION_ENDED, why)]


def test_a_tpdu_without_data_may_be_longer_than_a_small_agreed_size(b: IsoBench) -> None:
    client, called = raw_up(b, size_code=4)
    long = b"\x03\0\0\x1e\x19\x10" + bytes(24)  # an ED with parameters
    b.send(client, long + encode_tpdu(DataTpdu(b"abc", True)))
    assert b.message(called) == (b"abc", 3)


def test_a_tpdu_that_class_0_does_not_know_is_told_and_the_connection_goes_on(b: IsoBench) -> None:
    client, called = raw_up(b)
    for _ in range(20):
        b.send(client, EXPEDITED)
    b.send(client, encode_tpdu(DataTpdu(b"abc", True)))
    assert b.message(called) == (b"abc", 3)
    b.until(lambda: len(b.net.heard) == 5)
    assert b.net.heard == [("C1", TPDU_IGNORED, "a TPDU of code 10")] * 4 + [
        ("C1", TPDU_IGNORED, "more of them are not shown")
    ]


def test_such_a_tpdu_before_the_cr_is_told_as_well(b: IsoBench) -> None:
    listener = b.iso_listener(WAITS)
    request = encode_tpdu(ConnectTpdu(Code.CR, 0, 1, E001, E002, 7))
    raw_client(b, b.end(listener), EXPEDITED, request)
    b.taken(listener)
    assert b.net.heard == [("C1", TPDU_IGNORED, "a TPDU of code 10")]


@pytest.mark.parametrize(
    ("bad", "why"),
    [
        (b"GET / HTTP/1.1", "TPKT version 71"),
        (b"\x03\0\0\x07\xfe\xf0\x80", "length indicator 254 in a TPDU of 3 bytes"),
        (encode_tpdu(DisconnectTpdu(1, 1, 0x80)), "DR, reason 80"),
        (encode_tpdu(ConnectTpdu(Code.CR, 0, 1, E001, E002, 7)), "a CR out of turn"),
        (encode_tpdu(ConnectTpdu(Code.CC, 0, 1, E001, E002, 7)), "a CC out of turn"),
        (bytes.fromhex("03 00 00 09 04 70 00 05 02"), "ER, cause 02"),
    ],
)
def test_garbage_after_the_handshake_ends_the_connection_and_is_told(
    b: IsoBench, bad: bytes, why: str
) -> None:
    client, called = raw_up(b)
    b.send(client, bad)
    assert b.loss(called).fault is not None
    assert b.net.heard == [("C1", SESSION_ENDED, why)]


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        (ConnectTpdu(Code.CR, 0, 1, E001, E002, 1), "the TPDU size code 01 leaves no room for data"),
        (ConnectTpdu(Code.CR, 0, 1, E001, E002, other_class=2), "class 2 in a CR"),
    ],
)
def test_a_cr_that_nobody_can_agree_to_gets_a_dr_and_is_told(
    b: IsoBench, asked: ConnectTpdu, why: str
) -> None:
    listener = b.iso_listener(WAITS)
    client = raw_client(b, b.end(listener), encode_tpdu(asked))
    assert answer_of(b, client, 11) == [DisconnectTpdu(1, 0, 0x82)]
    assert b.answer(client) == 0
    assert b.net.told == [("C1", why)]


def test_who_does_not_read_makes_the_partner_wait_and_holds_little(b: IsoBench) -> None:
    caller, called = b.up()
    message, sent = memoryview(bytes(30_000)), 0

    def full() -> bool:
        nonlocal sent
        got = b.kernel.send(caller, message[sent % 30_000 :])
        sent += got if isinstance(got, int) else 0
        return got is WOULD_BLOCK

    b.until(full, most=20_000)
    b.settle()
    inside = b.kernel.unread(called) - b.net.faulty.unread(called)
    assert inside <= 2 * CAP + 65535 + 65536
