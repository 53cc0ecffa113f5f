"""Shadows at a tap, and lines that intervene: what they show is what `watch` shows on the recording."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.tapping import Tap, calling, end_of, exactly, joined, listening, tapped
from tests.line.test_without_connection import SERIAL
from tests.waiting import children_of
from trcvtui.bench.bench import Bench
from trcvtui.project.file import load_project
from trcvtui.scenario.command import LivePace

pytestmark = pytest.mark.live

PROJECT = """
dialect = "baosky"
[[connect]]
name = "C1"
ActiveEstablished = false
LocalAddress = "127.0.0.1"
LocalPort = 2000
[[connect]]
name = "C2"
ActiveEstablished = true
RemoteAddress = "127.0.0.1"
RemotePort = 2001
[[data]]
name = "rx"
type = "ARRAY[0..3] OF BYTE"
[[data]]
name = "answers"
type = "ARRAY[0..1] OF BYTE"
[[instance]]
name = "REQUESTS"
block = "TRCV_C"
connect = "C1"
data = "rx"
[[instance]]
name = "ANSWERS"
block = "TRCV_C"
connect = "C2"
data = "answers"
"""


def records(tap: Tap, count: int, **wanted: object) -> list[dict[str, Any]]:
    assert tap.process.stdout is not None
    found: list[dict[str, Any]] = []
    while len(found) < count:
        line = tap.process.stdout.readline()
        assert line, found
        record = json.loads(line)
        if all(record.get(key) == value for key, value in wanted.items()):
            found.append(record)
    return found


def test_shadows_show_at_once_what_watch_shows_on_the_recording(tmp_path: Path) -> None:
    file = tmp_path / "line.pcapng"
    door, port = listening()
    with door, Tap(str(port), "--format", "jsonl", "--record", str(file)) as tap:
        lines: list[bytes] = []

        def shown(text: bytes) -> None:
            assert tap.process.stdout is not None
            while text not in (line := tap.process.stdout.readline()):
                lines.append(line)
            lines.append(line)

        for size in (7, 3000):
            near, far = joined(door, tap.port)
            near.sendall(bytes(size))
            shown(b'"RCVD_LEN":%d' % size)
            far.sendall(b"answer")
            shown(b'"RCVD_LEN":6')
            assert exactly(near, 6) == b"answer"
            near.close()
            shown(b'"ERROR":true')
            assert exactly(far, size + 1) == bytes(size)
            far.close()
            shown(b'"C1_TO_PLC","block":"TRCV_C","STATUS":"7002"')
        code, out, errors = tap.end()
    assert (code, errors) == (0, "")
    command = [sys.executable, "-m", "trcvtui", "watch", str(file), "--format", "jsonl"]
    again = subprocess.run(command, capture_output=True, text=True)
    assert (b"".join(lines).decode() + out).splitlines() == again.stdout.splitlines()


def test_a_frame_is_held_edited_and_let_go_and_each_act_is_marked_as_ours(tmp_path: Path) -> None:
    file = tmp_path / "line.pcapng"
    with tapped("--format", "jsonl", "--record", str(file)) as (tap, near, far):
        tap.order("tap T to-plc hold")
        records(tap, 1, note="ours: to-plc hold")
        near.sendall(b"\x01\x02\x03\x04")
        far.setblocking(False)
        assert tap.process.stderr is not None
        while True:  # until it has come to the tap
            tap.order("tap T to-plc edit 2 hex FF")
            tap.order("tap T to-plc drop 9")
            if b"4 of 9 bytes held" in tap.process.stderr.readline():
                break
            assert tap.process.stderr.readline() == b"T: nothing is held in this direction\n"
        with pytest.raises(BlockingIOError):
            far.recv(1)
        tap.order("tap T to-plc go")
        records(tap, 1, note="ours: to-plc go")
        far.setblocking(True)
        assert exactly(far, 4) == b"\x01\x02\xff\x04"
        tap.order("tap T from-plc rst")
        records(tap, 1, note="ours: from-plc rst")
        assert (end_of(near), end_of(far)) == ((0, "RST"), (0, "RST"))
        assert tap.end()[0] == 0
    content = file.read_bytes()
    assert all(act in content for act in (b"trcvtui: hold", b"trcvtui: edit byte 2 ff", b"trcvtui: rst"))


def test_a_wrong_line_is_told_and_all_is_let_go_when_stdin_ends() -> None:
    door, port = listening()
    with door, Tap(str(port), "--format", "jsonl") as tap:
        assert tap.process.stderr is not None and tap.process.stdin is not None
        for line, said in (
            ("tap X to-plc hold", b"stdin: found 'X', expected T\n"),
            ("tap T to-plc hold", b"T: a conversation is not there\n"),
        ):
            tap.order(line)
            assert tap.process.stderr.readline() == said
        near, far = joined(door, tap.port)
        with near, far:
            tap.order("tap T to-plc hold")
            records(tap, 1, note="ours: to-plc hold")
            near.sendall(b"held")
            tap.process.stdin.close()
            assert exactly(far, 4) == b"held"
        tap.process.stdin = None
        assert tap.end()[0] == 0


def test_a_stdin_that_is_never_empty_keeps_no_shadow_waiting() -> None:
    with (
        tapped("--format", "jsonl") as (tap, near, _),
        subprocess.Popen(["yes", ""], stdout=tap.process.stdin) as lines,
    ):
        near.sendall(b"seen")
        records(tap, 1, DONE=True, RCVD_LEN=4)
        lines.kill()


def test_shadows_go_on_when_the_process_that_serves_observers_is_killed() -> None:
    with tapped("--format", "jsonl") as (tap, near, _):
        near.sendall(b"before")
        records(tap, 1, DONE=True, RCVD_LEN=6)
        (server,) = [
            pid
            for pid in children_of(tap.process.pid)
            if b"serve_observers" in Path(f"/proc/{pid}/cmdline").read_bytes()
        ]
        os.kill(server, signal.SIGKILL)
        assert tap.process.stderr is not None
        assert b"no observers: their process has ended" in tap.process.stderr.readline()
        near.sendall(b"afterwards")
        records(tap, 1, DONE=True)
        tap.order("tap T from-plc rst")
        records(tap, 1, note="ours: from-plc rst")


def test_instances_of_a_project_look_on_in_both_directions(tmp_path: Path) -> None:
    door, port = listening()
    project = tmp_path / "line.toml"
    table = f'[[tap]]\nname = "L1"\nlisten = "127.0.0.1:0"\nto = "{port}"\nconnect = "C1"\nback = "C2"\n'
    project.write_text(PROJECT + table)
    with door, Tap.of_project(project, "--format", "jsonl") as tap:
        near, far = joined(door, tap.port)
        with near, far:
            near.sendall(b"four")
            (one,) = records(tap, 1, DONE=True)
            far.sendall(b"ok")
            (other,) = records(tap, 1, DONE=True)
            assert [(r["instance"], r["RCVD_LEN"]) for r in (one, other)] == [("REQUESTS", 4), ("ANSWERS", 2)]
        assert tap.end()[1].splitlines()[-1].startswith('{"assigned":[{"id":"C1","shadows":["C1","C2"]}]')


def test_a_plc_that_calls_is_named_by_its_address(tmp_path: Path) -> None:
    with tapped("--format", "jsonl", "--plc", "127.0.0.2", source="127.0.0.2") as (tap, near, _):
        near.sendall(b"from the PLC")
        (record,) = records(tap, 1, DONE=True)
        assert record["instance"] == "C1_FROM_PLC"


def test_a_shadow_shows_what_a_live_block_shows_on_the_same_bytes(tmp_path: Path) -> None:
    door, port = listening()
    door.close()
    project = tmp_path / "line.toml"
    switched = """data = "rx"
EN_R = true
CONT = true"""
    listens = PROJECT.replace("2000", str(port)).replace('data = "rx"', switched)
    table = f'[[tap]]\nname = "L1"\nlisten = "127.0.0.1:0"\nto = "{port}"\nconnect = "C1"\n'
    project.write_text(listens)
    tapped = tmp_path / "tapped.toml"
    tapped.write_text(listens + table)
    bench, pace, seen = Bench(load_project(project), "live"), LivePace(), []

    def pass_scans(count: int) -> None:
        for _ in range(count):
            pace.next_scan(bench)
            edges = [edge for edge in bench.runtime.changed if edge.instance == "REQUESTS"]
            seen.extend([(f"{e.outputs.status:04X}", e.outputs.done, e.outputs.error) for e in edges])

    with Tap.of_project(tapped, "--format", "jsonl") as tap:
        pass_scans(3)  # it listens
        near = calling(tap.port)
        first = records(tap, 1)  # the far end has answered, so that both begin with a connection
        pass_scans(8)
        for jobs, piece in ((1, b"seven b"), (3, b"fives"), (4, b"four")):
            near.sendall(piece)
            while sum(done for _, done, _ in seen) < jobs:
                pass_scans(1)
            pass_scans(6)
        near.sendall(b"xy")
        pass_scans(6)
        near.close()
        while not seen[-1][2]:
            pass_scans(1)
        pass_scans(8)
        _, out, errors = tap.end()
    bench.close()
    assert errors == ""
    rows = first + [json.loads(line) for line in out.splitlines()[:-1]]
    shown = [(r["STATUS"], r["DONE"], r["ERROR"]) for r in rows if r["instance"] == "REQUESTS"]
    assert [status for status, done, _ in shown if done] == ["7008"] * 4
    assert shown == seen


def test_datagrams_through_a_tap_have_shadows_of_their_own() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far:
        far.bind(("127.0.0.1", 0))
        port = far.getsockname()[1]
        near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with near, Tap(f"udp:{port}", "--format", "jsonl", listen="udp:127.0.0.1:0") as tap:
            near.sendto(b"question", ("127.0.0.1", tap.port))
            data, came_from = far.recvfrom(100)
            far.sendto(data[:3], came_from)
            asked = records(tap, 1, instance="C1_TO_PLC", DONE=True)
            answered = records(tap, 1, instance="C1_FROM_PLC", DONE=True)
    assert [(one["block"], one["RCVD_LEN"]) for one in (*asked, *answered)] == [
        ("URECV_C", 8),
        ("URECV_C", 3),
    ]


def test_receive_data_looks_on_at_a_serial_line_with_a_tap_in_it(tmp_path: Path) -> None:
    device, near = os.openpty()
    plc, far = os.openpty()
    bench = tmp_path / "bench.toml"
    tap_row = f"""
[[tap]]
name = "T1"
listen = "serial:{os.ttyname(near)},9600,8N1"
to = "serial:{os.ttyname(far)},9600,8N1"
connect = "RX"
"""
    bench.write_text(SERIAL.format("RX", "RX") + tap_row, encoding="utf-8")
    with Tap.of_project(bench, "--format", "jsonl") as tap:
        os.write(device, b"12345\n")
        assert [one["RCVD_LEN"] for one in records(tap, 1, instance="RD", DONE=True)] == [6]
        got = b""
        while len(got) < 6:
            got += os.read(plc, 100)
        assert got == b"12345\n"
    for end in (device, near, plc, far):
        os.close(end)
