"""TLS sessions against each other: handshakes in any pieces, data, ends, every way to fail."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.certificates import NEEDS_OPENSSL, Certificates
from trcvtui.net.layer import LayerSession, TlsError
from trcvtui.net.layers.tls import MOST_HELD_BYTES, TlsSession, TlsSettings, find_certificate_flaw

pytestmark = NEEDS_OPENSSL
LOOPBACK = "127.0.0.1"
FLIGHTS = 8  # more than any handshake has


def fed(session: LayerSession, data: bytes) -> None:
    if data:
        session.feed(memoryview(data))


def read(session: LayerSession, room: int = MOST_HELD_BYTES) -> bytes:
    got = session.read(memoryview(bytearray(room)))
    return got.data if got else b""


def meet(client: LayerSession, server: LayerSession) -> None:
    """Let everything flow that both have to say."""
    for _ in range(FLIGHTS):
        fed(server, client.take_output())
        fed(client, server.take_output())


def met(client: TlsSettings, server: TlsSettings) -> tuple[LayerSession, LayerSession]:
    ends = client.make_session(is_active=True), server.make_session(is_active=False)
    meet(*ends)
    return ends


def errors(ends: tuple[LayerSession, LayerSession]) -> list[str]:
    return [end.ended.error if end.ended else "" for end in ends]


@pytest.fixture
def up(certificates: Certificates) -> Iterator[tuple[LayerSession, LayerSession]]:
    client, server = met(certificates.settings(), certificates.settings("plc"))
    assert client.is_up
    assert server.is_up
    yield client, server


# -- in good order -----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_both_ends_come_up_and_bytes_go_both_ways(up: tuple[LayerSession, LayerSession]) -> None:
    client, server = up
    fed(server, client.encode(b"abc"))
    fed(client, server.encode(b"xyz"))
    assert (server.has_data, read(server), read(client)) == (True, b"abc", b"xyz")
    assert (server.held_bytes, client.held_bytes) == (0, 0)


@pytest.mark.slow
def test_bytes_are_read_in_any_portions_and_in_their_order(up: tuple[LayerSession, LayerSession]) -> None:
    client, server = up
    fed(server, client.encode(b"abc") + client.encode(b"defg"))
    assert [read(server, 2), read(server, 2), read(server, 9), read(server, 9)] == [b"ab", b"cd", b"efg", b""]


def test_a_close_notify_is_the_end_after_the_data(up: tuple[LayerSession, LayerSession]) -> None:
    client, server = up
    last = client.encode(b"last")
    client.say_goodbye()
    fed(server, last + client.take_output())
    server.note_partner_end()
    assert (server.partner_is_done, server.ended, read(server)) == (True, None, b"last")


def test_a_stream_that_ends_without_close_notify_was_truncated(up: tuple[LayerSession, LayerSession]) -> None:
    client, server = up
    fed(server, client.encode(b"abc"))
    server.note_partner_end()
    assert read(server) == b"abc"
    assert server.ended is not None
    assert server.ended.error == TlsError.TRUNCATED


def test_a_record_that_was_changed_on_its_way_ends_the_session(up: tuple[LayerSession, LayerSession]) -> None:
    client, server = up
    record = bytearray(client.encode(b"abcdef"))
    record[-1] ^= 1
    fed(server, bytes(record))
    assert errors((client, server)) == ["", TlsError.INTEGRITY]
    assert read(server) == b""
    assert server.encode(b"more") == b""


def test_a_partner_whom_nobody_reads_is_held_to_a_cap(up: tuple[LayerSession, LayerSession]) -> None:
    client, server = up
    piece = client.encode(bytes(16384))
    while server.wants_more:
        fed(server, piece)
        piece = client.encode(bytes(16384))
    assert server.held_bytes <= MOST_HELD_BYTES + 2 * len(piece)
    assert len(read(server)) >= MOST_HELD_BYTES - 16384


# -- every split -------------------------------------------------------------------------------------------


def flights(client: LayerSession, server: LayerSession) -> list[bytes]:
    said = []
    for _ in range(FLIGHTS):
        said.append(client.take_output())
        fed(server, said[-1])
        said.append(server.take_output())
        fed(client, said[-1])
    return [flight for flight in said if flight]


@pytest.mark.slow
@pytest.mark.parametrize("asks_client", [False, True])
def test_a_handshake_may_come_cut_at_every_byte(certificates: Certificates, asks_client: bool) -> None:
    shows = certificates.settings("partner"), certificates.settings("plc", asks_client=asks_client)
    longest = max(map(len, flights(shows[0].make_session(True), shows[1].make_session(False))))
    for cut in range(1, longest, 1 if not asks_client else 17):
        client, server = shows[0].make_session(is_active=True), shows[1].make_session(is_active=False)
        for _ in range(FLIGHTS):
            for speaker, hearer in ((client, server), (server, client)):
                flight = speaker.take_output()
                fed(hearer, flight[:cut])
                fed(hearer, flight[cut:])
        assert (client.is_up, server.is_up) == (True, True), cut


def test_data_may_come_cut_at_every_byte(up: tuple[LayerSession, LayerSession]) -> None:
    client, server = up
    for cut in range(1, 64):
        record = client.encode(b"abcdef")
        fed(server, record[:cut])
        assert read(server) == (b"" if cut < len(record) else b"abcdef")
        fed(server, record[cut:])
        assert read(server) == (b"abcdef" if cut < len(record) else b"")


# -- every way to fail ---------------------------------------------------------------------------------------


NAMED = {"server_name": LOOPBACK, "checks_name": True}
UNVERIFIED = NAMED | {"is_unverified": True}
LINE = {"server_name": "plc.line.local.", "checks_name": True}
ASKS = {"asks_client": True}
MEETINGS: list[tuple[str, dict[str, Any], str, dict[str, Any], tuple[str, str]]] = [
    ("", {}, "strange", {}, (TlsError.NO_CA, TlsError.REFUSED)),
    ("", {"trusts": ""}, "plc", {}, (TlsError.NO_CA, TlsError.REFUSED)),
    ("", {}, "expired", {}, (TlsError.EXPIRED, TlsError.REFUSED)),
    ("", {}, "early", {}, (TlsError.DISCARDED, TlsError.REFUSED)),
    ("", {}, "critical", {}, (TlsError.EXTENSION, TlsError.REFUSED)),
    ("", NAMED, "plc", {}, ("", "")),
    ("", LINE, "plc", {}, ("", "")),
    ("", LINE | {"server_name": "plc.line.local"}, "plc", {}, ("", "")),
    ("", NAMED, "elsewhere", {}, (TlsError.WRONG_NAME, TlsError.REFUSED)),
    ("", LINE, "elsewhere", {}, (TlsError.WRONG_NAME, TlsError.REFUSED)),
    ("", {"server_name": LOOPBACK}, "elsewhere", {}, ("", "")),
    *(("", UNVERIFIED, name, {}, ("", "")) for name in ("strange", "expired", "elsewhere")),
    ("", {}, "plc", ASKS, (TlsError.REFUSED, TlsError.NO_CERTIFICATE)),
    ("strange", {}, "plc", ASKS, (TlsError.REFUSED, TlsError.NO_CA)),
    ("", {}, "", {}, (TlsError.REFUSED, TlsError.HANDSHAKE)),
]


@pytest.mark.parametrize(("shown", "asks", "server", "wants", "told"), MEETINGS)
def test_what_each_end_says_of_the_other_s_certificate(
    certificates: Certificates,
    shown: str,
    asks: dict[str, Any],
    server: str,
    wants: dict[str, Any],
    told: tuple[str, str],
) -> None:
    ends = met(certificates.settings(shown, **asks), certificates.settings(server, **wants))
    assert errors(ends) == [*told]
    assert ends[1].is_up is (told[1] == "")


@pytest.mark.parametrize("first", [b"\x00", b"h", b"G", b"\x14", b"\x17", b"\x80"])
@pytest.mark.parametrize("is_active", [False, True])
def test_the_first_byte_is_enough_to_know_plain_tcp(
    certificates: Certificates, first: bytes, is_active: bool
) -> None:
    session = certificates.settings("plc").make_session(is_active)
    fed(session, first)
    assert session.ended is not None
    assert session.ended[:2] == (TlsError.PLAIN, f"no TLS: the data begins with {first[0]:02X}, not with 16")
    assert (session.is_up, session.wants_more, session.has_data) == (False, False, False)


def test_only_a_server_may_begin_with_an_alert(certificates: Certificates) -> None:
    refusal = b"\x15\x03\x03\x00\x02\x02\x28"
    client, server = (
        certificates.settings("plc").make_session(True),
        certificates.settings("plc").make_session(False),
    )
    fed(client, refusal[:1])
    assert client.ended is None
    fed(client, refusal[1:])
    fed(server, refusal[:1])
    assert errors((client, server)) == [TlsError.REFUSED, TlsError.PLAIN]


def test_with_tls_1_3_a_client_is_refused_when_it_is_up_already(certificates: Certificates) -> None:
    client = certificates.settings("strange").make_session(is_active=True)
    server = certificates.settings("plc", asks_client=True).make_session(is_active=False)
    fed(server, client.take_output())
    fed(client, server.take_output())
    assert client.is_up
    meet(client, server)
    assert errors((client, server)) == [TlsError.REFUSED, TlsError.NO_CA]


def test_a_partner_that_says_nothing(certificates: Certificates) -> None:
    session = certificates.settings("plc").make_session(is_active=False)
    session.time_out("too slow")
    assert session.ended is not None
    assert session.ended.error == TlsError.SILENT


def test_a_partner_that_goes_in_the_middle_of_the_handshake(certificates: Certificates) -> None:
    server = certificates.settings("plc").make_session(is_active=False)
    fed(server, certificates.settings().make_session(is_active=True).take_output()[:40])
    server.note_partner_end()
    assert server.ended is not None
    assert server.ended.error == TlsError.HANDSHAKE


def test_somebody_who_comes_and_goes_without_a_word_is_no_error(certificates: Certificates) -> None:
    server = certificates.settings("plc").make_session(is_active=False)
    server.note_partner_end()
    assert server.ended is None


def test_files_that_have_gone_end_the_session_and_raise_nothing() -> None:
    session = TlsSettings(certificate="/nowhere/plc.pem", key="/nowhere/plc.key").make_session(
        is_active=False
    )
    fed(session, b"\x16\x03\x01")
    assert session.ended is not None
    assert session.ended.error == TlsError.REFERENCE
    assert (session.take_output(), read(session), session.encode(b"x")) == (b"", b"", b"")


def test_what_is_wrong_with_pem_files(certificates: Certificates) -> None:
    pem, key = certificates.pem("plc"), certificates.key("plc")
    assert find_certificate_flaw(pem, key) == ""
    assert find_certificate_flaw(pem, "") == ""
    assert find_certificate_flaw(key, "") == f"{key}: no certificate in PEM"
    assert "not that of the certificate" in find_certificate_flaw(pem, certificates.key("ca"))
    locked = certificates.locked_key("plc")
    assert find_certificate_flaw(pem, locked).startswith(f"{locked}: no key in PEM without a password")
    assert find_certificate_flaw("/nowhere/x.pem", "") == "/nowhere/x.pem: No such file or directory"


@given(noise=st.binary(max_size=400), is_active=st.booleans())
def test_no_bytes_make_it_raise(certificates: Certificates, noise: bytes, is_active: bool) -> None:
    session = TlsSession(certificates.settings("plc"), is_active)
    fed(session, noise)
    session.note_partner_end()
    session.time_out("too slow")
    session.say_goodbye()
    assert not session.is_up
    assert (read(session), session.has_data) == (b"", False)


# -- the work of one scan ----------------------------------------------------------------------------------


def test_what_waits_after_a_full_buffer_is_read_when_there_is_room(
    up: tuple[LayerSession, LayerSession],
) -> None:
    client, server = up
    fed(server, b"".join(client.encode(bytes(16384)) for _ in range(MOST_HELD_BYTES // 16384 + 1)))
    assert (server.has_backlog, len(read(server, MOST_HELD_BYTES)), server.has_backlog) == (
        False,
        MOST_HELD_BYTES,
        True,
    )
    assert (server.feed(memoryview(b""), 9), len(read(server, MOST_HELD_BYTES))) == (2, 16384)


def test_the_end_stands_after_a_backlog(up: tuple[LayerSession, LayerSession]) -> None:
    client, server = up
    last = b"".join(client.encode(b"x") for _ in range(5))
    client.say_goodbye()
    seen = []
    for came in (last + client.take_output(), b""):
        server.feed(memoryview(came), 3)
        seen.append((read(server), server.partner_is_done))
    assert seen == [(b"xxx", False), (b"xx", True)]
