"""The view of a connection description: fields, bytes, what the bench puts in their place, what is wrong."""

from __future__ import annotations

import tomllib
from pathlib import Path

from trcvtui.project.connect_view import DescriptionView, description_view, initial_values
from trcvtui.project.file import read_project


def view(table: str, dialect: str = "s7-1500") -> DescriptionView | None:
    text = f'dialect = "{dialect}"\n[[connect]]\nname = "C1"\n{table}\n[[peer]]\nname = "P1"\n'
    return description_view(read_project(tomllib.loads(text), "b.toml", Path()).connects[0])


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
    assert seen.flaw == "two bytes begin with E0, not with 10"
    assert remarks(seen)["LocalTSelector"] == "! two bytes begin with E0, not with 10"
    assert remarks(seen)["ActiveEstablished"] == "port: a free one"


def test_bytes_of_no_description_are_shown_with_their_flaw() -> None:
    seen = view('bytes = "00 40 00"')
    assert seen is not None
    assert seen.flaw == "3 bytes are no connection description"
    assert seen.says == "no connection description"
    assert seen.rows[-1].remark == "! 3 bytes are no connection description"
    assert b"".join(row.data for row in seen.rows) == b"\x00\x40\x00"


def test_a_description_is_written_as_the_initial_values_of_a_db() -> None:
    text = """
dialect = "s7-1500"
[[connect]]
name = "C1"
type = "TCON_IP_RFC"
RemoteAddress = "10.0.0.9"
LocalTSelector = "16#E002"
"""
    config = read_project(tomllib.loads(text), "b.toml", Path()).connects[0]
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
    text = 'dialect = "s7-1500"\n[[connect]]\nname = "C1"\nListenPort = 0\n'
    config = read_project(tomllib.loads(text), "b.toml", Path()).connects[0]
    closed, open_ = description_view(config), description_view(config, "127.0.0.1:40001")
    assert closed is not None and open_ is not None
    assert closed.says == "TCP, passive on 127.0.0.1, a free port"
    assert open_.says == "TCP, passive on 127.0.0.1:40001, a free port"
