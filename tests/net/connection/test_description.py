"""Connection descriptions: offsets and sizes, bytes both ways, and the view byte for byte."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from trcvtui.net.connection.description import (
    ADDRESSES,
    CONNECTIONS,
    LONGEST_NAME,
    LONGEST_SELECTOR,
    Description,
    DescriptionField,
    DescriptionRow,
    FieldType,
    FieldValue,
    Structure,
    find_structure,
    pack,
    rows,
)
from trcvtui.net.connection.description_check import DescribedConnect, Flaw, Transport, find_flaw, read_spec

STRUCTURES = CONNECTIONS | ADDRESSES
EXAMPLE = "00 40 00 01 0b 01 c0 a8 00 0a 07 d0 00 00"
IP_V4 = CONNECTIONS["TCON_IP_v4"]


def test_the_sizes_are_those_of_the_manual() -> None:
    assert {name: structure.size for name, structure in STRUCTURES.items()} == {
        "TCON_IP_v4": 14,
        "TCON_IP_RFC": 80,
        "TCON_QDN": 266,
        "TCON_IP_V4_SEC": 26,
        "TCON_QDN_SEC": 278,
        "TCON_Param": 64,
        "TCON_Configured": 6,
        "TADDR_Param": 8,
        "TADDR_SEND_QDN": 260,
        "TADDR_RCV_IP": 20,
    }


@pytest.mark.parametrize("name", STRUCTURES)
def test_fields_follow_each_other_and_stay_inside(name: str) -> None:
    structure = STRUCTURES[name]
    end = 0
    for field in structure.fields:
        assert field.offset >= end
        end = field.offset + field.size
    assert end <= structure.size


def value_of(field: DescriptionField) -> st.SearchStrategy[FieldValue]:
    match field.type:
        case FieldType.NUMBER:
            return st.integers(0, (1 << 8 * field.size) - 1)
        case FieldType.TRUTH:
            return st.booleans()
        case FieldType.ADDRESS:
            return st.ip_addresses(v=4).map(str)
        case FieldType.SELECTOR:
            return st.binary(max_size=LONGEST_SELECTOR)
        case FieldType.NAME:
            return st.text(st.characters(max_codepoint=127), max_size=LONGEST_NAME)
        case FieldType.BYTES:
            return st.binary(min_size=field.size, max_size=field.size)


@pytest.mark.slow
@given(st.data())
def test_what_is_packed_is_read_again(data: st.DataObject) -> None:
    structure = data.draw(st.sampled_from(list(STRUCTURES.values())))
    values = {field.name: data.draw(value_of(field)) for field in structure.fields}
    packed = pack(structure, values)
    assert len(packed) == structure.size
    assert Description(structure, packed).values() == values


@given(st.sampled_from(list(CONNECTIONS.values())), st.binary(max_size=300))
def test_no_bytes_are_beyond_reading_judging_and_showing(structure: Structure, data: bytes) -> None:
    description = Description(structure, data)
    says = read_spec(description)
    found = find_flaw(DescribedConnect(description, says, "127.0.0.1"))
    if not structure.size - structure.spare <= len(data) <= structure.size:
        assert found is not None
        assert found.flaw is Flaw.LENGTH
    shown = rows(description, {found.field: found.text} if found else {})
    assert b"".join(row.data for row in shown) == data
    assert not found or [row.remark for row in shown if row.remark] == [found.text]
    assert all(row.value.isprintable() for row in shown)


def test_a_size_names_its_structure() -> None:
    assert find_structure(bytes(80)) is CONNECTIONS["TCON_IP_RFC"]
    assert find_structure(bytes(15)) is None


def test_the_view_shows_each_field_with_its_bytes_and_a_remark() -> None:
    description = Description(IP_V4, bytes.fromhex(EXAMPLE))
    shown = rows(description, {"LocalPort": "0 takes any port"})
    assert shown[0] == DescriptionRow(0, "InterfaceId", b"\x00\x40", "64 (16#40)")
    assert shown[3] == DescriptionRow(5, "ActiveEstablished", b"\x01", "TRUE")
    assert shown[4] == DescriptionRow(6, "RemoteAddress", b"\xc0\xa8\x00\x0a", "192.168.0.10")
    assert shown[6] == DescriptionRow(12, "LocalPort", b"\x00\x00", "0", "0 takes any port")


def test_the_view_shows_what_lies_between_the_fields_and_what_is_missing() -> None:
    rfc = CONNECTIONS["TCON_IP_RFC"]
    shown = rows(Description(rfc, pack(rfc, {"LocalTSelector": b"TCP-1"})), {})
    assert shown[4] == DescriptionRow(6, "", b"\0\0", "")
    assert (shown[6].value, shown[7].value) == ("", "TCP-1 (54 43 50 2D 31)")
    short = rows(Description(rfc, b"\x00\x40\x00"), {"": "3 bytes"})
    assert short[1] == DescriptionRow(2, "ID", b"\x00", "(not there)")
    assert short[-1] == DescriptionRow(3, "", b"", "", "3 bytes")


# -- what it means -------------------------------------------------------------------------------------------


def test_a_tcon_param_of_tcp_has_its_ports_in_the_tsaps() -> None:
    param = CONNECTIONS["TCON_Param"]
    data = pack(
        param,
        {
            "block_length": 64,
            "id": 7,
            "connection_type": 17,
            "active_est": True,
            "local_device_id": 1,
            "rem_staddr_len": 4,
            "rem_tsap_id_len": 2,
            "rem_staddr": bytes([192, 168, 0, 10]),
            "rem_tsap_id": b"\x07\xd0",
        },
    )
    description = Description(param, data)
    says = read_spec(description)
    assert (says.protocol, says.identity, says.is_active) == (Transport.TCP, 7, True)
    assert (says.remote_address, says.remote_port, says.local_port) == ("192.168.0.10", 2000, 0)
    assert find_flaw(DescribedConnect(description, says, "127.0.0.1")) is None


def test_a_tcon_param_of_iso_has_tsaps() -> None:
    param = CONNECTIONS["TCON_Param"]
    values: dict[str, FieldValue] = {
        "block_length": 64,
        "id": 1,
        "connection_type": 18,
        "local_device_id": 1,
        "local_tsap_id_len": 3,
        "local_tsap_id": b"\xe0\x02A",
    }
    description = Description(param, pack(param, values))
    says = read_spec(description)
    assert (says.protocol, says.local_tsap, says.remote_tsap) == (Transport.ISO, b"\xe0\x02A", b"")
    assert find_flaw(DescribedConnect(description, says, "127.0.0.1")) is None
    wrong = Description(param, pack(param, values | {"local_tsap_id": b"\x10\x02A"}))
    found = find_flaw(DescribedConnect(wrong, read_spec(wrong), "127.0.0.1"))
    assert found == (Flaw.TSAP, "local_tsap_id", "10 02 41, expected two bytes or more that begin with E0")


def asked(**values: FieldValue) -> DescribedConnect:
    usual: dict[str, FieldValue] = {"InterfaceId": 64, "ID": 1, "ConnectionType": 11, "LocalPort": 2000}
    description = Description(IP_V4, pack(IP_V4, usual | values))
    return DescribedConnect(description, read_spec(description), "10.0.0.1")


def flaw_of(question: DescribedConnect) -> Flaw | None:
    found = find_flaw(question)
    return found.flaw if found else None


RESERVED = (20, 21, 80, 102, 135, 161, 162, 443, 34962, 34964, 49152, 65535)
JUDGED: list[tuple[str, tuple[FieldValue, ...], Flaw | None]] = [
    ("RemoteAddress", ("0.0.0.0",), None),  # anybody, for a passive end
    ("ID", (1, 4095), None),
    ("ID", (0, 4096, 65535), Flaw.ID),
    ("LocalPort", RESERVED, Flaw.PORT_RESERVED),
    ("LocalPort", (1, 19, 2000, 5000, 34961, 49151), None),
    ("ConnectionType", (19,), None),  # UDP
]


def test_what_a_tcon_ip_v4_may_ask_for() -> None:
    cases = [(field, value, flaw) for field, values, flaw in JUDGED for value in values]
    assert [case for case in cases if flaw_of(asked(**{case[0]: case[1]})) is not case[2]] == []
    assert flaw_of(asked(ConnectionType=19, LocalPort=0)) is Flaw.PARAMETER  # UDP needs a port of its own


@pytest.mark.parametrize(
    ("is_active", "size", "is_right"), [(False, 1, False), (True, 1, True), (False, 2, True)]
)
def test_a_passive_end_needs_two_bytes_of_a_local_tsap(is_active: bool, size: int, is_right: bool) -> None:
    values: dict[str, FieldValue] = {"InterfaceId": 64, "ID": 1, "ConnectionType": 12}
    values |= {"ActiveEstablished": is_active, "LocalTSelector": b"\xe0\1"[:size]}
    values |= {"RemoteAddress": "10.0.0.7"}
    structure = CONNECTIONS["TCON_IP_RFC"]
    description = Description(structure, pack(structure, values))
    found = flaw_of(DescribedConnect(description, read_spec(description), "10.0.0.1"))
    assert found is (None if is_right else Flaw.TSAP)


@pytest.mark.parametrize(
    ("tsap", "wide", "narrow"),
    [
        (b"\xe0\1", True, True),
        (b"\xe0\0", True, True),
        (b"\xe0\2", True, False),
        (b"\xe1\1", False, True),
        (b"\x10\1", False, False),
        (b"\xe0\1AB", True, True),
        (b"\xe0\1A\7", True, False),
        (b"TCP-1", True, True),
    ],
)
def test_an_s7_1200_takes_other_tsaps_than_an_s7_1500(tsap: bytes, wide: bool, narrow: bool) -> None:
    values: dict[str, FieldValue] = {"InterfaceId": 64, "ID": 1, "ConnectionType": 12, "LocalTSelector": tsap}
    structure = CONNECTIONS["TCON_IP_RFC"]
    description = Description(structure, pack(structure, values))
    question = DescribedConnect(description, read_spec(description), "10.0.0.1")
    assert (flaw_of(question) is None) is wide
    assert (flaw_of(replace(question, narrow_tsaps=True)) is None) is narrow
