"""`[[connect]]` of a dialect with connection descriptions: fields, bytes, mistakes, view, what is saved."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import golden
from trcvtui.errors import UserError
from trcvtui.net.connection.config import ConnectConfig
from trcvtui.net.connection.description_check import Flaw
from trcvtui.net.layers.iso_on_tcp import IsoSettings
from trcvtui.net.results import Endpoint
from trcvtui.project.connect_view import DescriptionView, description_view, initial_values
from trcvtui.project.descriptions import parse_db_bytes, parse_selector, unambiguous_spellings
from trcvtui.project.file import read_project
from trcvtui.project.keys import keys_of
from trcvtui.project.project import PeerDecl

EXAMPLE = "00 40 00 01 0b 01 c0 a8 00 0a 07 d0 00 00"


def read(*tables: str, dialect: str = "s7-1500") -> tuple[ConnectConfig, ...]:
    text = f'dialect = "{dialect}"\n'
    text += "".join(f'[[connect]]\nname = "C{n}"\n{table}\n' for n, table in enumerate(tables, 1))
    text += '[[peer]]\nname = "P1"\nactive = false\n'
    return read_project(tomllib.loads(text), "b.toml", Path()).connects


def packed(config: ConnectConfig) -> str:
    assert config.description is not None
    return config.description.data.hex(" ")


def flaw_of(config: ConnectConfig) -> Flaw | None:
    return config.flaw.flaw if config.flaw else None


def read_one(table: str) -> None:
    read(table)


def test_fields_become_the_bytes_of_the_example_and_bytes_the_same_connect() -> None:
    by_fields, by_bytes = read(
        'ID = 1\nActiveEstablished = true\nRemoteAddress = "192.168.0.10"\nRemotePort = 2000',
        f'bytes = "{EXAMPLE}"',
    )
    for config in (by_fields, by_bytes):
        assert packed(config) == EXAMPLE
        assert (config.active, config.remote_address, config.remote_port) == (True, "192.168.0.10", 2000)
        assert config.local == by_fields.local
        assert config.flaw is None


def test_without_a_type_it_is_a_tcon_ip_v4_with_an_id_of_its_own() -> None:
    first, second = read("", "")
    assert packed(first) == "00 40 00 01 0b 00 00 00 00 00 00 00 00 00"
    assert packed(second).startswith("00 40 00 02")


def test_without_a_type_local_port_0_takes_a_free_port_and_with_one_it_is_judged() -> None:
    plain, typed, bench = read(
        "", 'type = "TCON_IP_v4"', 'type = "TCON_IP_v4"\nLocalPort = 2000\nListenPort = 0'
    )
    assert (flaw_of(plain), flaw_of(typed), flaw_of(bench)) == (None, Flaw.PARAMETER, None)
    assert bench.local == Endpoint("127.0.0.1", 0)


def test_a_listener_is_on_loopback_and_an_active_end_to_another_machine_where_routing_says() -> None:
    assert [config.local.address for config in read("", 'LocalAddress = "10.0.0.1"')] == [
        "127.0.0.1",
        "10.0.0.1",
    ]
    near, far, named = read(
        'ActiveEstablished = true\nRemoteAddress = "127.0.0.1"\nRemotePort = "@P1"',
        'ActiveEstablished = true\nRemoteAddress = "192.168.0.10"\nRemotePort = 2000',
        'ActiveEstablished = true\nLocalAddress = "10.0.0.1"\n'
        'RemoteAddress = "192.168.0.10"\nRemotePort = 2000',
    )
    assert (near.any_local, near.local.address) == (False, "127.0.0.1")
    assert (far.any_local, far.local.address) == (True, "0.0.0.0")
    assert (named.any_local, named.local.address) == (False, "10.0.0.1")
    assert flaw_of(far) is None


# -- ISO-on-TCP ----------------------------------------------------------------------------------------------


def test_iso_port_beside_a_connection_type_that_is_wrong_is_the_flaw_of_the_type() -> None:
    (config,) = read('type = "TCON_IP_RFC"\nConnectionType = 11\nLocalTSelector = "16#E002"\nIsoPort = 0')
    assert flaw_of(config) is Flaw.TYPE


def test_iso_on_tcp_listens_on_102_or_where_the_bench_says() -> None:
    usual, free, called = read(
        'type = "TCON_IP_RFC"\nLocalTSelector = "16#E002"',
        'type = "TCON_IP_RFC"\nLocalTSelector = "16#E002"\nIsoPort = 0',
        'type = "TCON_IP_RFC"\nActiveEstablished = true\nRemoteAddress = "127.0.0.1"\n'
        'LocalTSelector = "TCP-1"\nRemoteTSelector = "TCP-2"\nIsoPort = "@P1"',
    )
    assert usual.local.port == 102
    assert free.local.port == 0
    assert (called.local.port, called.remote_port) == (0, "@P1")
    assert called.session == IsoSettings(b"TCP-1", b"TCP-2", cap=65536)


def test_a_tcon_param_of_iso_has_its_lengths_from_its_tsaps() -> None:
    (config,) = read(
        'type = "TCON_Param"\nconnection_type = 18\nactive_est = false\n'
        'local_tsap_id = "e0 02 41"\nrem_tsap_id = "e0 01"\nrem_staddr = "127.0.0.1"'
    )
    assert config.flaw is None
    assert config.session == IsoSettings(b"\xe0\x02A", b"\xe0\x01", cap=65536)
    assert config.remote_address == "127.0.0.1"


def test_the_port_in_a_tcon_param_may_be_known_only_when_the_partner_listens() -> None:
    (config,) = read(
        'type = "TCON_Param"\nrem_staddr = "127.0.0.1"\nrem_tsap_id = "00 00"\nRemotePort = "@P1"'
    )
    assert (config.active, config.flaw, config.remote_port) == (True, None, "@P1")


def test_instructions_before_3_have_a_plain_connect_in_a_tcon_param_and_refuse_another_structure() -> None:
    plain, named, wrong = read(
        'ActiveEstablished = true\nRemoteAddress = "127.0.0.1"\nRemotePort = 2000',
        'active_est = false\nlocal_tsap_id = "07 d0"\nblock_length = 60',
        'type = "TCON_IP_v4"\nLocalPort = 2000',
        dialect="s7-1200-legacy",
    )
    assert plain.description is not None and plain.flaw is None
    assert plain.description.data[:16].hex(" ") == "00 40 00 01 11 01 01 00 00 04 02 00 00 00 00 00"
    assert plain.description.data[34:42].hex(" ") == "7f 00 00 01 00 00 07 d0"
    assert named.flaw is not None and named.flaw.field == "block_length"
    assert wrong.flaw is not None and wrong.flaw.flaw is Flaw.STRUCTURE


def test_a_flaw_names_the_field_as_its_structure_has_it() -> None:
    (config,) = read('type = "TCON_Param"\nactive_est = false\nlocal_tsap_id = "00 00"')
    assert config.flaw is not None
    assert (config.flaw.flaw, config.flaw.field) == (Flaw.PARAMETER, "local_tsap_id")


@pytest.mark.parametrize(
    ("text", "tsap"),
    [
        ("16#E002", b"\xe0\x02"),
        ("16#e0 02", b"\xe0\x02"),
        ("E0.02", b"\xe0\x02"),
        ("02.00", b"\x02\x00"),
        ("hex e0 02", b"\xe0\x02"),
        ("TCP-1", b"TCP-1"),
        ("text:E002", b"E002"),
        ("text:16#E002", b"16#E002"),
        ("text E0 02", b"E0 02"),
        ("ISO-on-TCP-1", b"ISO-on-TCP-1"),
        ("E002", None),
        ("E0 02", None),
        ("AB", None),
        ("E0.02.01", None),
        ("7", None),
        ("...", None),
        ("16#E0G2", None),
        ("16#", None),
        ("", b""),
        ("x" * 33, None),
        ("hex zz", None),
        ("ä", None),
    ],
)
def test_a_tsap_is_written_in_hex_or_as_text(text: str, tsap: bytes | None) -> None:
    assert parse_selector(text) == tsap


@given(st.binary(min_size=1, max_size=32))
def test_a_tsap_of_any_bytes_is_written_so_that_it_reads_back_the_same(tsap: bytes) -> None:
    written = dict(keys_of(PeerDecl("P1", True, "@C1", session=IsoSettings(tsap, tsap, 8192))))
    assert parse_selector(str(written["local_tsap"])) == parse_selector(str(written["remote_tsap"])) == tsap


@given(st.text(alphabet="09afAF .x#", max_size=8))
def test_whatever_is_refused_as_a_tsap_can_be_written_in_each_of_the_two_ways(text: str) -> None:
    if parse_selector(text) is None and unambiguous_spellings(text):
        for way in re.findall('"([^"]*)"', unambiguous_spellings(text)):
            assert parse_selector(way)


# -- names ---------------------------------------------------------------------------------------------------

QDN = 'type = "TCON_QDN"\nActiveEstablished = true\nRemoteQDN = "plc2.line."\nRemotePort = 2000\n'


def test_a_name_is_where_the_dns_server_says() -> None:
    known, unknown, unasked = read(
        QDN + 'DnsAnswer = "10.0.0.9"', QDN + 'DnsAnswer = "0.0.0.0"', QDN + 'DnsAnswer = "none"'
    )
    assert (known.remote_address, known.flaw) == ("10.0.0.9", None)
    assert flaw_of(unknown) is Flaw.NAME_UNKNOWN
    assert flaw_of(unasked) is Flaw.NO_RESOLVER


def test_the_ends_of_a_secure_description_are_those_of_the_plain_one() -> None:
    (config,) = read(
        'type = "TCON_IP_V4_SEC"\nActiveEstablished = true\nRemoteAddress = "127.0.0.1"\nRemotePort = 2000'
    )
    assert packed(config) == "00 40 00 01 0b 01 7f 00 00 01 07 d0 00 00" + " 00" * 12
    assert (config.remote_port, config.flaw, config.session) == (2000, None, None)


# -- mistakes ------------------------------------------------------------------------------------------------


def test_a_mistake_names_its_place() -> None:
    golden.mistakes("connection descriptions", read_one)


# -- peers ---------------------------------------------------------------------------------------------------


def peer(table: str) -> object:
    text = f'dialect = "s7-1500"\n[[connect]]\nname = "C1"\n[[peer]]\nname = "P1"\nremote = "@C1"\n{table}'
    return read_project(tomllib.loads(text), "b.toml", Path()).peers[0].session


def test_a_peer_speaks_iso_on_tcp_with_its_tsaps_and_its_size() -> None:
    assert peer("") is None
    assert peer('iso = true\nlocal_tsap = "16#E001"\nremote_tsap = "TCP-2"\ntpdu = 128') == IsoSettings(
        b"\xe0\x01", b"TCP-2", cap=65536, size_code=7
    )


@pytest.mark.parametrize(
    "table", ["tpdu = 128", "iso = true\ntpdu = 100", 'iso = true\nlocal_tsap = "hex zz"']
)
def test_a_peer_that_is_no_partner_of_iso_is_refused(table: str) -> None:
    with pytest.raises(UserError):
        peer(table)


@pytest.mark.parametrize(
    "cut", ["00 40 00 01 0b 01 c0 a8 00 0a 07 d0 0 00", "00 40 00 01 0b 01 c0 a8 00 0a 07 d"]
)
def test_a_copy_of_a_db_that_was_cut_off_in_a_byte_is_refused(cut: str) -> None:
    with pytest.raises(UserError, match="two digits each"):
        read(f'bytes = "{cut}"')


def test_a_dump_with_marks_and_commas_is_read() -> None:
    assert parse_db_bytes("16#00, 16#40,0x00 01") == b"\x00\x40\x00\x01"


HEAD = 'dialect = "s7-1500"\n'
NAMED = 'type = "TCON_QDN"\nActiveEstablished = true\nRemoteQDN = "a.b."\nRemotePort = 2000'
WRITTEN = {
    "plain": "",
    "tcp": 'type = "TCON_IP_v4"\nLocalPort = 2000\nListenPort = 0',
    "its own port": 'type = "TCON_IP_v4"\nLocalPort = 2000',
    "a free port": 'type = "TCON_IP_v4"\nListenPort = 0',
    "no port": 'type = "TCON_IP_v4"',
    "active": 'type = "TCON_IP_v4"\nActiveEstablished = true\nRemoteAddress = "10.0.0.7"\nRemotePort = 2000',
    "peer": 'ActiveEstablished = true\nRemoteAddress = "127.0.0.1"\nRemotePort = "@P1"',
    "udp": 'type = "TCON_IP_v4"\nConnectionType = 19\nLocalPort = 2000\nKeepAliveTimeInterval = 3',
    "iso": 'type = "TCON_IP_RFC"\nLocalTSelector = "16#E002"\nIsoPort = 0',
    "iso active": (
        'type = "TCON_IP_RFC"\nActiveEstablished = true\nRemoteAddress = "127.0.0.1"\n'
        'LocalTSelector = "16#E002"\nRemoteTSelector = "TCP-1"\nIsoPort = "@P1"'
    ),
    "param": 'type = "TCON_Param"\nactive_est = false\nlocal_tsap_id = "07 d0"',
    "name": NAMED + '\nDnsAnswer = "127.0.0.1"',
    "no server": NAMED + '\nDnsAnswer = "none"',
    "unknown": NAMED + '\nDnsAnswer = "0.0.0.0"',
    "asked": NAMED,
    "unsafe": (
        'type = "TCON_IP_V4_SEC"\nActivateSecureConn = true\nActiveEstablished = true\n'
        'RemoteAddress = "127.0.0.1"\nRemotePort = 2000\nverify = "none, this is unsafe"'
    ),
    "bytes": 'bytes = "00 40 00 01 0b"',
    "wrong length": 'type = "TCON_IP_RFC"\nbytes = "00 40 00 01 0b 01 c0 a8 00 0a 07 d0 00 00"',
}


@pytest.mark.parametrize("what", WRITTEN)
def test_the_keys_of_a_description_are_read_as_that_connect_again(what: str) -> None:
    peer = '[[peer]]\nname = "P1"\n'
    [first] = read(WRITTEN[what])
    document = tomllib.loads(HEAD + peer) | {"connect": [{"name": "C1", **dict(keys_of(first))}]}
    [again] = read_project(document, "b.toml", Path(".")).connects
    assert again == first


def view(table: str, dialect: str = "s7-1500") -> DescriptionView | None:
    return description_view(read(table, dialect=dialect)[0])


def remarks(seen: DescriptionView) -> dict[str, str]:
    return {row.field: row.remark for row in seen.rows if row.remark}


def test_a_connect_without_a_description_has_no_view() -> None:
    assert view("", dialect="baosky") is None


def test_an_active_tcp_description_says_where_it_goes() -> None:
    seen = view('ActiveEstablished = true\nRemoteAddress = "127.0.0.1"\nRemotePort = "@P1"')
    assert seen is not None
    assert (seen.structure, seen.says, seen.flaw) == ("TCON_IP_v4", "TCP, active to 127.0.0.1:@P1", "")
    assert remarks(seen) == {
        "InterfaceId": "on the bench: 127.0.0.1",
        "ConnectionType": "TCP",
        "RemotePort": "on the bench: @P1",
    }


def test_the_field_that_is_wrong_says_why() -> None:
    seen = view('type = "TCON_IP_RFC"\nLocalTSelector = "16#1002"\nIsoPort = 0')
    assert seen is not None
    assert seen.flaw == "a selector of 2 bytes begins with E0, not 10"
    assert remarks(seen)["LocalTSelector"] == "! a selector of 2 bytes begins with E0, not 10"
    assert remarks(seen)["ActiveEstablished"] == "port: a free one"


def test_bytes_of_no_description_are_shown_with_their_flaw() -> None:
    seen = view('bytes = "00 40 00"')
    assert seen is not None
    assert seen.flaw == "3 bytes are no connection description"
    assert seen.says == "no connection description"
    assert seen.rows[-1].remark == "! 3 bytes are no connection description"
    assert b"".join(row.data for row in seen.rows) == b"\x00\x40\x00"


def test_a_description_is_written_as_the_initial_values_of_a_db() -> None:
    (config,) = read('type = "TCON_IP_RFC"\nRemoteAddress = "10.0.0.9"\nLocalTSelector = "16#E002"')
    assert config.description is not None
    assert tuple(each.text for each in initial_values(config.description, {})) == (
        "InterfaceId := 64",
        "ID := 1",
        "ConnectionType := 12",
        "ActiveEstablished := FALSE",
        "RemoteAddress := (ADDR := [10, 0, 0, 9])",
        "RemoteTSelector := (TSelLength := 0, TSel := [])",
        "LocalTSelector := (TSelLength := 2, TSel := [16#E0, 16#02])",
    )


def test_a_free_port_says_so_and_where_it_listens_now() -> None:
    (config,) = read("ListenPort = 0")
    closed, open_ = description_view(config), description_view(config, "127.0.0.1:40001")
    assert closed is not None and open_ is not None
    assert closed.says == "TCP, passive on 127.0.0.1, a free port"
    assert open_.says == "TCP, passive on 127.0.0.1:40001, a free port"
