"""A message that begins and does not end: it holds no more than its cap, and is ended and told of in time."""

from __future__ import annotations

import pytest

from tests.net.layers.iso_bench import CAP, E001, E002, SECOND, IsoBench, raw_up
from trcvtui.net.layers.iso_on_tcp import MOST_CAPS, DataTpdu, IsoSettings, encode_tpdu
from trcvtui.net.layers.layered_stream import SESSION_ENDED
from trcvtui.net.results import WOULD_BLOCK, Fault

BEGUN = encode_tpdu(DataTpdu(b"begun", False))
SMALL = IsoSettings(E002, E001, 1000)
TOO_SLOW = ("C1", SESSION_ENDED, "a message that has not ended in 30 s")
ENDED_BY_US = Fault("session", "EPROTO")


@pytest.mark.parametrize(
    "half",
    [BEGUN, BEGUN[:9], b"\x03", encode_tpdu(DataTpdu(b"", False))],
    ids=["no EOT", "cut", "a byte", "empty"],
)
def test_half_a_message_ends_the_connection_after_30_s(b: IsoBench, half: bytes) -> None:
    client, called = raw_up(b, SMALL, 10)
    b.send(client, half)
    b.settle()
    b.net.now += 29 * SECOND
    b.settle()
    assert b.kernel.loss(called) is None
    b.net.now += SECOND
    assert b.loss(called).fault == ENDED_BY_US
    assert "C1" in (b.kernel.ready_handles() or {}).values()  # type: ignore[attr-defined]
    assert b.net.heard == [TOO_SLOW]


def test_a_byte_now_and_then_is_no_way_round_the_limit(b: IsoBench) -> None:
    client, called = raw_up(b, SMALL, 10)
    b.send(client, BEGUN)
    for byte in encode_tpdu(DataTpdu(bytes(100), True))[:30]:
        b.settle()
        b.net.now += SECOND
        b.send(client, bytes([byte]))
    assert b.loss(called).fault == ENDED_BY_US
    assert b.net.heard == [TOO_SLOW]


def test_each_message_has_30_s_of_its_own(b: IsoBench) -> None:
    client, called = raw_up(b, SMALL, 10)
    whole = encode_tpdu(DataTpdu(b"abc", True))
    b.send(client, whole[:5])
    for _ in range(5):
        b.settle()
        b.net.now += 20 * SECOND
        b.send(client, whole[5:] + whole[:5])
        assert b.message(called) == (b"abc", 3)
    assert b.net.heard == []


def test_a_connection_that_is_silent_between_messages_stays(b: IsoBench) -> None:
    client, called = raw_up(b, SMALL, 10)
    b.send(client, encode_tpdu(DataTpdu(b"abc", True)))
    assert b.message(called) == (b"abc", 3)
    b.net.now += 1000 * SECOND
    b.settle()
    assert b.kernel.loss(called) is None


def test_a_partner_does_not_pay_for_a_block_that_takes_nothing(b: IsoBench) -> None:
    client, called = raw_up(b, SMALL, 10)
    b.send(client, encode_tpdu(DataTpdu(bytes(600), True)) * 2 + BEGUN)  # 1200 bytes wait, more than the cap
    b.until(lambda: b.kernel.unread(called) > 1200)
    b.net.now += 1000 * SECOND
    b.settle()
    assert b.kernel.loss(called) is None
    assert b.message(called) == (bytes(600), 600)
    assert b.message(called) == (bytes(600), 600)
    b.send(client, encode_tpdu(DataTpdu(b"!", True)))
    assert b.message(called) == (b"begun!", 6)


def test_dts_without_an_end_hold_the_cap_and_end_the_connection_at_16_of_it(b: IsoBench) -> None:
    client, called = raw_up(b, SMALL, 10)
    endless, most, sent = memoryview(encode_tpdu(DataTpdu(bytes(1000), False)) * 64), 0, 0

    def is_over() -> bool:
        nonlocal most, sent
        got = b.kernel.send(client, endless[sent % len(endless) :])
        sent += got if isinstance(got, int) else 0
        most = max(most, b.net.inside(called))
        return b.kernel.loss(called) is not None

    b.until(is_over)
    assert most <= 1000 + 1007  # the cap, and a TPKT that is not complete
    assert b.net.heard == [("C1", SESSION_ENDED, f"a message of more than {MOST_CAPS * 1000} bytes")]


def test_a_message_longer_than_the_cap_that_ends_is_counted_and_the_next_is_clean(b: IsoBench) -> None:
    client, called = raw_up(b, SMALL, 10)
    b.send(client, encode_tpdu(DataTpdu(bytes(1000), False)) * 3 + encode_tpdu(DataTpdu(b"", True)))
    b.send(client, encode_tpdu(DataTpdu(b"next", True)))
    assert b.message(called, CAP) == (bytes(1000), 3000)
    assert b.message(called, CAP) == (b"next", 4)
    assert b.kernel.recv_from(called, memoryview(bytearray(1))) is WOULD_BLOCK
