"""A port by its name or URL: what is not there and what goes away is a Fault, and no call waits."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from pathlib import Path

import pytest

from tests.waiting import until
from trcvtui.net.os.serial import OsSerialPort, fault_from_error
from trcvtui.net.results import Fault
from trcvtui.net.serial_line import OPENING, PortOpening, SerialSettings

pytest.importorskip("serial")


def opened(port: OsSerialPort) -> Fault | None:
    shown: Fault | PortOpening | None = OPENING

    def is_known() -> bool:
        nonlocal shown
        shown = port.open()
        return not isinstance(shown, PortOpening)

    until(is_known)
    assert not isinstance(shown, PortOpening)
    return shown


def test_a_device_that_is_not_there_is_named_by_its_errno(tmp_path: Path) -> None:
    assert opened(OsSerialPort(SerialSettings(str(tmp_path / "ttyX")))) == Fault("open", "ENOENT")


def test_a_url_that_pyserial_does_not_know_is_a_fault() -> None:
    assert opened(OsSerialPort(SerialSettings("pigeon://1"))) == Fault("open", "EINVAL")


def test_a_file_is_no_port(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"")
    wrong = opened(OsSerialPort(SerialSettings(str(file))))
    assert wrong == Fault("open", "ENOTTY")


def test_a_port_where_nobody_listens_is_refused_and_the_words_of_pyserial_are_kept() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"socket://127.0.0.1:{server.getsockname()[1]}"
    wrong = opened(OsSerialPort(SerialSettings(url)))
    assert wrong == Fault("open", "ECONNREFUSED") and url in wrong.words


def after(cause: Exception, words: str) -> Exception:
    """Return what pyserial raises after what the system has raised."""
    problem = OSError(words)
    problem.__context__ = cause
    return problem


@pytest.mark.parametrize(
    ("problem", "name"),
    [
        (after(socket.gaierror(socket.EAI_NONAME, "unknown"), "Could not open port"), "EAI_NONAME"),
        (after(socket.gaierror(-3, "try again"), "Could not open port"), "EAI_AGAIN"),
        (after(TimeoutError("timed out"), "Could not open port"), "ETIMEDOUT"),
        (after(PermissionError(13, "denied"), "could not open port"), "EACCES"),
        (OSError("Remote does not seem to support RFC2217 or BINARY mode"), "ETIMEDOUT"),
        (OSError("read failed: socket disconnected"), "EOF"),
        (OSError("connection failed (reader thread died)"), "EOF"),
        (OSError("device reports readiness to read but returned no data"), "EIO"),
    ],
)
def test_what_pyserial_says_in_words_alone_has_its_errno(problem: Exception, name: str) -> None:
    assert fault_from_error("open", problem) == Fault("open", name)


def test_the_words_of_a_problem_are_few_and_hold_no_escape() -> None:
    words = fault_from_error("open", OSError("\x1b[2J" + "x" * 10_000)).words
    assert words.startswith("[2Jxxx") and len(words) < 200


def test_a_tcp_server_is_a_port_by_its_url() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = OsSerialPort(SerialSettings(f"socket://127.0.0.1:{server.getsockname()[1]}"))
        assert opened(port) is None
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
        seen: list[bytes | Fault] = []

        def is_gone() -> bool:
            seen.append(port.read(100))
            return isinstance(seen[-1], Fault)

        until(is_gone)
        assert seen[-1] == Fault("read", "EOF")
        port.close()


def test_a_partner_that_does_not_read_fills_the_line_and_a_write_still_does_not_wait() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = OsSerialPort(SerialSettings(f"socket://127.0.0.1:{server.getsockname()[1]}"))
        assert opened(port) is None
        client, _ = server.accept()
        until(lambda: 0 in [port.write(b"\x55" * 256) for _ in range(1000)])
        client.close()
        port.close()


@pytest.mark.filterwarnings("ignore:setDaemon|setName:DeprecationWarning")  # pyserial 3.5's own
def test_a_port_of_a_far_host_is_opened_over_rfc_2217_and_carries_bytes_both_ways() -> None:
    import serial  # type: ignore[import-untyped]
    from serial.rfc2217 import PortManager  # type: ignore[import-untyped]

    class Wire:
        """What PortManager answers over."""

        def write(self, payload: bytes) -> None:
            client.sendall(payload)

    with socket.create_server(("127.0.0.1", 0)) as server, serial.serial_for_url("loop://") as device:
        port = OsSerialPort(SerialSettings(f"rfc2217://127.0.0.1:{server.getsockname()[1]}", 19200))
        assert port.open() is OPENING
        client, _ = server.accept()
        client.setblocking(False)
        far, heard = PortManager(device, Wire()), bytearray()

        def far_end() -> None:
            with suppress(BlockingIOError):
                heard.extend(b"".join(far.filter(client.recv(1000))))

        def is_open() -> bool:
            far_end()
            return port.open() is None

        until(is_open)
        assert device.baudrate == 19200
        assert port.write(b"hello") == 5

        def has_come() -> bool:
            far_end()
            return heard == b"hello"

        until(has_come)
        client.sendall(b"".join(far.escape(b"\xffthanks")))
        got = bytearray()

        def is_here() -> bool:
            got.extend(port.read(100))  # type: ignore[arg-type]
            return got == b"\xffthanks"

        until(is_here)
        port.close()
        client.close()


@pytest.mark.filterwarnings("ignore:setDaemon|setName:DeprecationWarning")
def test_a_host_that_does_not_answer_keeps_nobody_waiting_and_is_asked_once() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = OsSerialPort(SerialSettings(f"rfc2217://127.0.0.1:{server.getsockname()[1]}?timeout=0.1"))
        assert port.open() is OPENING
        client, _ = server.accept()  # and not a word of RFC 2217
        assert client.recv(1) == b"\xff"
        assert [port.open() for _ in range(50)] == [OPENING] * 50
        server.setblocking(False)
        with pytest.raises(BlockingIOError):
            server.accept()
        port.close()
        while client.recv(100):  # until pyserial has given up, too
            pass
        client.close()


def test_an_attempt_that_was_given_up_leaves_no_port_behind() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = OsSerialPort(SerialSettings(f"socket://127.0.0.1:{server.getsockname()[1]}"))
        port.open()
        port.close()
        first, _ = server.accept()
        assert opened(port) is None  # the second
        second, _ = server.accept()
        assert first.recv(1) == b""
        second.sendall(b"x")
        until(lambda: port.read(10) == b"x")
        port.close()
        assert second.recv(1) == b""
        first.close()
        second.close()


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="this system has no pseudo-terminals")
def test_a_driver_that_counts_no_errors_says_nothing() -> None:
    here, there = os.openpty()
    port = OsSerialPort(SerialSettings(os.ttyname(there)))
    assert port.line_errors() is None  # not open yet
    assert opened(port) is None
    assert port.line_errors() is None  # a pseudo-terminal has no UART
    port.close()
    for handle in (here, there):
        os.close(handle)
