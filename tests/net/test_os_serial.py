"""A port by its name or URL: what is not there and what goes away is a Fault, and no call waits."""

from __future__ import annotations

import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from trcvtui.net.answers import Fault
from trcvtui.net.os_serial import OsSerialPort
from trcvtui.net.serial_line import SerialSettings

pytest.importorskip("serial")
MOST_LOOKS = 200_000


def until(holds: Callable[[], object]) -> None:
    """Look again and again: the local stack takes its time."""
    for _ in range(MOST_LOOKS):
        if holds():
            return
    raise AssertionError("never")


def test_a_device_that_is_not_there_is_named_by_its_errno(tmp_path: Path) -> None:
    assert OsSerialPort(SerialSettings(str(tmp_path / "ttyX"))).open() == Fault("open", "ENOENT")


def test_a_url_that_pyserial_does_not_know_is_a_fault() -> None:
    assert OsSerialPort(SerialSettings("pigeon://1")).open() == Fault("open", "EINVAL")


def test_a_file_is_no_port(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"")
    wrong = OsSerialPort(SerialSettings(str(file))).open()
    assert wrong is not None and wrong.call == "open"


def test_a_tcp_server_is_a_port_by_its_url() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = OsSerialPort(SerialSettings(f"socket://127.0.0.1:{server.getsockname()[1]}"))
        assert port.open() is None
        client, _ = server.accept()
        assert port.read(100) == b""
        client.sendall(b"hello")
        got = bytearray()

        def has_come() -> bool:
            piece = port.read(100)
            assert isinstance(piece, bytes)
            got.extend(piece)
            return len(got) == 5

        until(has_come)
        assert got == b"hello"
        assert port.write(b"thanks") == 6
        assert client.recv(10) == b"thanks"
        client.close()
        until(lambda: isinstance(port.read(100), Fault))
        port.close()


def test_a_partner_that_does_not_read_fills_the_line_and_a_write_still_does_not_wait() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = OsSerialPort(SerialSettings(f"socket://127.0.0.1:{server.getsockname()[1]}"))
        assert port.open() is None
        client, _ = server.accept()
        until(lambda: port.write(b"\x55" * 256) == 0)
        client.close()
        port.close()
