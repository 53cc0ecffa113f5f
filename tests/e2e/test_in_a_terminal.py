"""The installed program in a pseudo-terminal: the demo, a bench with socat as the device, keys and prompt."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.terminal import LOOK_S, PATIENCE_S, TRCVTUI, Terminal, need
from tests.e2e.test_tap_screen import _below
from tests.recording.wire import answer, capture, handshake, tcp
from tests.scenario.scenarios import CONFIGS

PASSIVE = CONFIGS / "passive.toml"


def below(terminal: Terminal) -> Iterator[int]:
    return _below(int(terminal._call("display-message", "-p", "#{pane_pid}")))


@pytest.fixture
def terminals() -> Iterator[list[Terminal]]:
    opened: list[Terminal] = []
    yield opened
    for terminal in opened:
        terminal.close()


def open_terminal(opened: list[Terminal], columns: int, rows: int, *args: str) -> Terminal:
    command = " ".join([str(TRCVTUI), *args]) + "; echo ended with $?; exec cat"
    opened.append(Terminal(columns, rows, command))
    return opened[-1]


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (140, 45)])
def test_the_demo_is_alive_and_quits_on_q(terminals: list[Terminal], columns: int, rows: int) -> None:
    terminal = open_terminal(terminals, columns, rows)
    screen = terminal.wait(lambda text: len(re.findall("7006", text)) >= 2)
    assert "TRCV_C_1" in screen and "TRCV_C_2" in screen
    assert all(len(line) <= columns for line in screen.splitlines())
    terminal.keys("q")
    terminal.wait("ended with 0")


@pytest.mark.parametrize(
    ("name", "words", "code"),
    [("SIGTERM", "", 143), ("SIGHUP", "", 129), ("SIGQUIT", "", 131), ("SIGQUIT", "tap 127.0.0.1:0 9", 0)],
)
def test_a_signal_that_ends_it_gives_the_terminal_back(
    terminals: list[Terminal], tmp_path: Path, name: str, words: str, code: int
) -> None:
    number, pid = signal.Signals[name], tmp_path / "pid"
    script = f"sh -c 'echo $$ > {pid}; exec {TRCVTUI} {words}'; echo ended with $?; exec cat"
    terminals.append(Terminal(80, 24, script))
    terminal = terminals[-1]
    terminal.wait("IN THE LINE" if words else lambda text: len(re.findall("7006", text)) >= 2)
    assert terminal.modes == "alternate 1, mouse 1"
    os.kill(int(pid.read_text()), number)
    terminal.wait(f"ended with {code}")
    assert terminal.modes == "alternate 0, mouse 0"


def test_socat_as_the_device_five_bytes_then_three_then_twenty_five(terminals: list[Terminal]) -> None:
    socat = need("socat")
    terminal = open_terminal(terminals, 140, 45, "run", str(PASSIVE))
    terminal.wait("7000")
    terminal.keys(":")
    terminal.type("set TRCV_C_1 CONT=1 EN_R=1")
    terminal.keys("Enter")
    screen = terminal.wait(lambda text: re.search(r"127\.0\.0\.1:\d+", text) is not None and "7002" in text)
    found = re.search(r"127\.0\.0\.1:(\d+)", screen)
    assert found is not None
    with subprocess.Popen([socat, "-", f"TCP:127.0.0.1:{found[1]}"], stdin=subprocess.PIPE) as device:
        assert device.stdin is not None
        terminal.wait("7006")
        device.stdin.write(b"12345")
        device.stdin.flush()
        terminal.wait("5/8")
        device.stdin.write(b"678")
        device.stdin.flush()
        terminal.wait(lambda text: "31 32 33 34 35 36 37 38" in text and "0/8" in text)
        device.stdin.write(b"abcdefghABCDEFGHijklmnopZ")
        device.stdin.flush()
        screen = terminal.wait(lambda text: "69 6a 6b 6c 6d 6e 6f 70" in text and "1/8" in text)
        assert screen.count("7008") >= 1, "the history shows each DONE"
        device.stdin.close()
        device.wait()
    terminal.wait("80C5")
    terminal.keys("q")
    terminal.wait("ended with 0")


def test_the_program_ends_with_its_terminal_even_where_no_signal_comes(tmp_path: Path) -> None:
    project = tmp_path / "bench.toml"
    project.write_text(PASSIVE.read_text(encoding="utf-8"), encoding="utf-8")
    terminal = Terminal(100, 30, f"trap '' HUP; {TRCVTUI} run {project}; :")
    terminal.wait("7000")
    assert running(project)
    terminal.close()
    limit = time.monotonic() + PATIENCE_S
    while time.monotonic() < limit:
        if not running(project):
            return
        time.sleep(LOOK_S)
    raise AssertionError("still running without a terminal")


def running(project: Path) -> bool:
    return subprocess.run(["pgrep", "-f", str(project)], capture_output=True, check=False).returncode == 0


def test_a_capture_opens_on_the_screen_and_goes_to_its_edges(
    terminals: list[Terminal], tmp_path: Path
) -> None:
    file = tmp_path / "c.pcapng"
    said = [tcp(b"hello", 101, 501), answer(b"yes", 501, 106), tcp(seq=106, ack=504)]
    file.write_bytes(capture([*handshake(), *said], step_ns=60_000_000))
    terminal = open_terminal(terminals, 100, 30, "watch", str(file))
    terminal.wait(
        lambda text: "· capture" in text and "scan 1 of " in text and "2023-11-14T22:13:20.0" in text
    )
    terminal.type("!")
    terminal.wait(lambda text: "80A1" in text)
    terminal.type("q")
    terminal.wait(lambda text: "ended with 0" in text)


def test_after_kill_9_of_the_engine_r_brings_back_the_ports_that_keys_and_lines_had_opened(
    terminals: list[Terminal], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))
    with socket.create_server(("127.0.0.1", 0)) as door:
        port = door.getsockname()[1]
    project = tmp_path / "p.toml"
    project.write_text(PASSIVE.read_text())
    terminal = open_terminal(terminals, 100, 30, "run", str(project))
    terminal.wait("7000")
    for line in (f"add instance R2 block=TRCV_C LocalPort={port}", "set R2 CONT=1 EN_R=1"):
        terminal.keys(":")
        terminal.type(line)
        terminal.keys("Enter")
    terminal.wait(lambda text: f"127.0.0.1:{port}" in text and "7002" in text)
    [engine] = [pid for pid in below(terminal) if "spawn_main" in Path(f"/proc/{pid}/cmdline").read_text()]
    os.kill(engine, signal.SIGKILL)
    terminal.wait(lambda text: "ENGINE ENDED" in text and "was ended by SIGKILL; report" in text)
    [report] = (tmp_path / "state").glob("trcvtui-error-*.txt")
    told = report.read_text()
    assert "instance: name='R2' block='TRCV_C'" in told and "ConnectionChanged(connection='C2'" in told
    terminal.keys("R")
    terminal.wait(lambda text: "ENGINE ENDED" not in text and "7002" in text)
    with socket.create_connection(("127.0.0.1", port)) as device:
        terminal.wait("7006")
        device.sendall(b"x")
        terminal.wait(lambda text: "+3 unsaved" in text and "D◆" in text)
