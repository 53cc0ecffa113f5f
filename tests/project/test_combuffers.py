"""`[[combuffer]]` and the instances on it: what can be written, and each mistake in one line."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from tests import golden
from trcvtui.commands.table import format_command, parse_line
from trcvtui.errors import UserError
from trcvtui.net.serial_line import SerialSettings
from trcvtui.project.file import read_project
from trcvtui.project.keys import keys_of
from trcvtui.project.project import ComBufferDecl, Project

DATA = """
dialect = "twincat"
[[data]]
name = "rx"
type = "ARRAY[0..15] OF BYTE"
[[data]]
name = "etx"
type = "BYTE"
[[connect]]
name = "C1"
"""
STREAM = '[[instance]]\nname = "T"\nblock = "TRCV_C"\nconnect = "C1"\ndata = "rx"\n'
READER = '[[instance]]\nname = "RD"\nblock = "ReceiveData"\nRxBuffer = "RX"\ndata = "rx"\n'
RX = '[[combuffer]]\nname = "RX"\n'
PORT = 'source = "serial"\nport = "/dev/ttyS0"'


def tx(name: str, keys: str) -> str:
    return f'[[combuffer]]\nname = "{name}"\n{keys}\n'


def read(*parts: str) -> Project:
    return read_project(tomllib.loads("\n".join((DATA, *parts))), "b.toml", Path())


@pytest.mark.parametrize(
    ("lines", "decl"),
    [
        ("", ComBufferDecl("RX")),
        ("size = 500", ComBufferDecl("RX", size=500)),
        ('source = "T"', ComBufferDecl("RX", "T", is_fed=True)),
        (
            'source = "serial"\nport = "COM3"\nbaud = 19200\nparity = "even"\nstop_bits = 1.5',
            ComBufferDecl("RX", "serial", serial=SerialSettings("COM3", 19200, 8, "even", 1.5)),
        ),
        (
            'source = "serial"\nport = "socket://10.0.0.7:4001"\nhandshake = "rts/cts"\ndata_bits = 7',
            ComBufferDecl(
                "RX", "serial", serial=SerialSettings("socket://10.0.0.7:4001", 9600, 7, "none", 1, "rts/cts")
            ),
        ),
    ],
)
def test_a_combuffer_is_what_the_file_says(lines: str, decl: ComBufferDecl) -> None:
    assert read(STREAM, RX, lines).combuffers == (decl,)


def test_a_send_block_makes_a_combuffer_a_written_one() -> None:
    send = '[[instance]]\nname = "S"\nblock = "SendByte"\nTxBuffer = "RX"'
    (decl,) = read(RX, send).combuffers
    assert decl.is_written


def test_a_mistake_is_one_line() -> None:
    golden.mistakes("ComBuffers", lambda text: read(STREAM, text).path)


def test_an_instance_gives_its_keys_back() -> None:
    decl = read(RX, READER, 'pSuffix = "etx"\nTimeout = "T#50ms"\nLenSuffix = 1').instances[0]
    assert keys_of(decl) == [
        ("block", "ReceiveData"),
        ("RxBuffer", "RX"),
        ("data", "rx"),
        ("pSuffix", "etx"),
        ("task", "MAIN"),
        ("LenSuffix", 1),
        ("Timeout", "T#50ms"),
    ]


@pytest.mark.parametrize("written", ["50", '"50"', '"T#50ms"'])
def test_a_timeout_is_a_time_or_milliseconds(written: str) -> None:
    assert dict(read(RX, READER, f"Timeout = {written}").instances[0].inputs)["Timeout"] == 50


@pytest.mark.parametrize("written", ["true", "-1", "4294967296", "[50]"])
def test_a_timeout_is_nothing_else(written: str) -> None:
    with pytest.raises(UserError):
        read(RX, READER, f"Timeout = {written}")


@pytest.mark.parametrize(
    "line",
    [
        "create ReceiveData R2 RxBuffer=RX data=rx pSuffix=etx task=MAIN LenSuffix=1 Timeout=T#50ms",
        "create SendByte S2 TxBuffer=RX task=MAIN SendByte=13",
        "feed RX hex 01 02",
        'feed RX text "abc"',
        "add instance R2 block=ReceiveData RxBuffer=RX data=rx pSuffix=etx task=MAIN LenSuffix=1",
        "feed RX break",
        "set RD Timeout=T#1s Reset=1",
        "expect RD Timeout=T#1s Error=23",
    ],
)
def test_a_command_is_read_and_written_back(line: str) -> None:
    project = read(RX, READER)
    command = parse_line(line, project, "w")
    assert command is not None
    assert format_command(command) == line


def test_a_mistake_in_a_line_to_a_combuffer_is_one_line() -> None:
    project = read(RX, PORT, tx("TX", 'line = "RX"'))
    golden.mistakes("lines to a ComBuffer", lambda line: parse_line(line, project, "w"))


def test_without_a_port_a_fault_has_no_call_of_one() -> None:
    with pytest.raises(UserError) as caught:
        parse_line("fault open on RX", read(RX), "w")
    assert caught.value.lines()[0].startswith("w: found 'open', expected one of socket, set_reuse, bind")


def test_a_combuffer_goes_out_over_a_tsend_c() -> None:
    sender = '[[instance]]\nname = "S"\nblock = "TSEND_C"\nconnect = "C1"\ndata = "rx"'
    (decl,) = read(RX, 'line = "S"', sender).combuffers
    assert decl.line == "S"


def test_two_connections_to_one_url_are_two_lines() -> None:
    url = 'source = "serial"\nport = "socket://10.0.0.7:4001"'
    assert len(read(RX, url, tx("R2", url)).combuffers) == 2
