"""`[[combuffer]]` and the instances on it: what can be written, and each mistake in one line."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from trcvtui.commands.table import parse_line, to_line
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
    """Return one more ComBuffer."""
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


MISTAKES = [
    ((RX, 'source = "X"'), "b.toml: combuffer RX: source: found 'X', expected one of sim, serial, T"),
    ((RX, 'source = "RX"'), "b.toml: combuffer RX: source: found 'RX', expected one of sim, serial, T"),
    ((RX, "size = 0"), "b.toml: combuffer RX: size: found 0, expected a whole number from 1 to 65536"),
    (
        (RX, 'source = "serial"'),
        "b.toml: combuffer RX: port: found nothing, expected the name of a port, such as /dev/ttyUSB0",
    ),
    (
        (RX, "baud = 9600"),
        'b.toml: combuffer RX: baud: found a word of serial ports, expected source = "serial" beside it',
    ),
    (
        (RX, 'source = "serial"\nport = "x"\nparity = "odd-ish"'),
        "b.toml: combuffer RX: parity: found 'odd-ish', expected none or even or odd or mark or space",
    ),
    (
        (RX, 'source = "serial"\nport = "x"\nstop_bits = 3'),
        "b.toml: combuffer RX: stop_bits: found 3, expected 1, 1.5 or 2",
    ),
    (
        (RX, 'source = "serial"\nport = ""'),
        "b.toml: combuffer RX: port: found '', expected the name of a port, such as /dev/ttyUSB0",
    ),
    (
        (RX, PORT, tx("TX", 'line = "RX"'), tx("TX2", 'line = "RX"')),
        "b.toml: combuffer TX2: line: found 'RX', over which TX goes out, "
        "expected a line of its own: one ComBuffer goes out over it",
    ),
    (
        (RX, tx("RA", 'source = "RX"'), tx("RB", 'source = "RX"')),
        "b.toml: combuffer RB: source: found 'RX', whose bytes go to RA, "
        "expected a source of its own: each byte goes to one ComBuffer",
    ),
    (
        (RX, 'source = "T"', tx("R2", 'source = "T"')),
        "b.toml: combuffer R2: source: found 'T', whose bytes go to RX, "
        "expected a source of its own: each byte goes to one ComBuffer",
    ),
    (
        (RX, PORT, tx("R2", PORT)),
        "b.toml: combuffer R2: port: found '/dev/ttyS0', the port of RX, expected a port of its own",
    ),
    (
        (RX, PORT, tx("TX", 'line = "RX"'), tx("RA", 'source = "TX"')),
        "b.toml: combuffer RA: source: found 'TX', which goes out over RX, "
        "expected a ComBuffer without a line",
    ),
    (
        (RX, 'line = "RX"'),
        "b.toml: combuffer RX: line: found 'RX', "
        'expected the name of a TSEND_C, or ComBuffer with source = "serial", but there is none',
    ),
    (
        (READER,),
        "b.toml: instance RD: RxBuffer: found 'RX', expected the name of a ComBuffer, but there is none",
    ),
    ((RX, READER, 'pPrefix = "stx"'), "b.toml: instance RD: pPrefix: found 'stx', expected one of rx, etx"),
    (
        (RX, READER, "Timeout = 1.5"),
        "b.toml: instance RD: Timeout: found 1.5, expected a TIME of whole milliseconds such as T#50ms or 50",
    ),
    (
        (RX, READER, "LenPrefix = 256"),
        "b.toml: instance RD: LenPrefix: found 256, expected a whole number from 0 to 255",
    ),
]


@pytest.mark.parametrize(("parts", "line"), MISTAKES, ids=[line for _, line in MISTAKES])
def test_a_mistake_is_one_line(parts: tuple[str, ...], line: str) -> None:
    with pytest.raises(UserError) as caught:
        read(STREAM, *parts)
    assert caught.value.lines() == [line]


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
    assert to_line(command) == line


def test_a_connect_that_is_added_has_no_name_of_a_combuffer() -> None:
    with pytest.raises(UserError) as caught:
        parse_line("add connect RX", read(RX, READER), "w")
    assert caught.value.lines() == [
        "w: connect RX: name: found 'RX', the name of another combuffer, expected a name of its own"
    ]


@pytest.mark.parametrize(
    "line",
    [
        "fault open",
        "fault open ENOENT on RX",
        "fault read EIO on RX nth=3",
        "fault write on RX times=forever",
    ],
)
def test_a_fault_of_a_port_is_read_and_written_back(line: str) -> None:
    command = parse_line(line, read(RX, PORT), "w")
    assert command is not None
    assert to_line(command) == line


FAULT_MISTAKES = [
    ("fault open on C1", "w: found 'C1', expected RX"),
    ("fault open of RX", "w: found 'of', expected on ComBuffer, nth=1, times=1 or times=forever"),
    ("fault bind on RX", "w: found 'RX', expected C1"),
]


@pytest.mark.parametrize(("line", "wrong"), FAULT_MISTAKES, ids=[line for line, _ in FAULT_MISTAKES])
def test_a_mistake_in_a_fault_of_a_port_is_one_line(line: str, wrong: str) -> None:
    with pytest.raises(UserError) as caught:
        parse_line(line, read(RX, PORT), "w")
    assert caught.value.lines() == [wrong]


def test_without_a_port_a_fault_has_no_call_of_one() -> None:
    with pytest.raises(UserError) as caught:
        parse_line("fault open on RX", read(RX), "w")
    assert caught.value.lines()[0].startswith("w: found 'open', expected one of socket, set_reuse, bind")


def test_a_combuffer_goes_out_over_a_tsend_c() -> None:
    sender = '[[instance]]\nname = "S"\nblock = "TSEND_C"\nconnect = "C1"\ndata = "rx"'
    (decl,) = read(RX, 'line = "S"', sender).combuffers
    assert decl.line == "S"


@pytest.mark.parametrize(
    ("line", "wrong"),
    [
        ("add combuffer TX2 line=RX", "w: combuffer TX2: line: found 'RX', over which TX goes out, "),
        (
            "add combuffer R2 source=serial port=/dev/ttyS0",
            "w: combuffer R2: port: found '/dev/ttyS0', the port",
        ),
    ],
)
def test_a_combuffer_that_is_added_shares_no_end_either(line: str, wrong: str) -> None:
    with pytest.raises(UserError) as caught:
        parse_line(line, read(RX, PORT, tx("TX", 'line = "RX"')), "w")
    assert caught.value.lines()[0].startswith(wrong)


def test_two_connections_to_one_url_are_two_lines() -> None:
    url = 'source = "serial"\nport = "socket://10.0.0.7:4001"'
    assert len(read(RX, url, tx("R2", url)).combuffers) == 2
