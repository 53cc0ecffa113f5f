"""`trcvtui tap --record`: what passed stands in the file, whichever process is killed."""

from __future__ import annotations

import json
import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from tests.e2e.tapping import Tap, end_of, exactly, joined, listening, tapped
from tests.e2e.terminal import need
from tests.waiting import children_of, until

pytestmark = pytest.mark.live


def conversations(file: Path) -> list[dict[str, object]]:
    """Return what `trcvtui conversations` finds in a file."""
    command = [sys.executable, "-m", "trcvtui", "conversations", str(file), "--format", "json"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    rows: list[dict[str, object]] = json.loads(done.stdout)
    return rows


def bytes_in(row: dict[str, object]) -> tuple[object, object, object]:
    """Return how many bytes went to the PLC end and came from it, and how it ended."""
    to, back = row["to_plc"], row["from_plc"]
    assert isinstance(to, dict) and isinstance(back, dict)
    return to["bytes"], back["bytes"], row["end"]


def words_of(pid: int) -> str:
    return Path(f"/proc/{pid}/cmdline").read_text()


def test_what_passed_stands_in_the_file_and_in_it_alone(tmp_path: Path) -> None:
    file = tmp_path / "line.pcapng"
    door, port = listening()
    with door, Tap(str(port), "--record", str(file)) as tap:
        for size in (1, 5000):
            near, far = joined(door, tap.port)
            near.sendall(bytes(size))
            assert exactly(far, size) == bytes(size)
            far.sendall(b"answer")
            far.close()
            assert end_of(near) == (6, "FIN")
            near.close()
        assert tap.end() == (0, "", "")
    assert [bytes_in(row) for row in conversations(file)] == [(1, 6, "fin-plc"), (5000, 6, "fin-plc")]
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    again = subprocess.run(
        [sys.executable, "-m", "trcvtui", "tap", "127.0.0.1:0", "9", "--record", str(file)],
        capture_output=True,
        text=True,
    )
    assert again.returncode == 2
    assert "which is there already" in again.stderr


def test_wireshark_finds_nothing_wrong_in_it(tmp_path: Path) -> None:
    file = tmp_path / "line.pcapng"
    with tapped("--record", str(file)) as (tap, near, far):
        near.sendall(bytes(3001))
        assert exactly(far, 3001)
        near.close()
        assert end_of(far) == (0, "FIN")
        far.close()
        tap.end()
    wrong = "ip.checksum.status != 1 || tcp.checksum.status != 1 || tcp.analysis.flags || _ws.malformed"
    checks = ["-o", "ip.check_checksum:TRUE", "-o", "tcp.check_checksum:TRUE"]
    command = [need("tshark"), "-r", str(file), *checks]
    shown = subprocess.run(command, capture_output=True, text=True, check=True)
    assert len(shown.stdout.splitlines()) >= 7
    assert subprocess.run([*command, "-Y", wrong], capture_output=True, text=True).stdout == ""


def test_forwarding_goes_on_without_the_recording_which_is_good_up_to_its_end(tmp_path: Path) -> None:
    file = tmp_path / "line.pcapng"
    with tapped("--record", str(file)) as (tap, near, far):
        near.sendall(b"kept")
        assert exactly(far, 4) == b"kept"
        recorder = next(pid for pid in children_of(tap.process.pid) if "record_tap" in words_of(pid))
        until(lambda: b"kept" in file.read_bytes(), lambda: (tap.process.poll(), file.read_bytes()))
        os.kill(recorder, signal.SIGKILL)
        assert tap.process.stderr is not None
        assert tap.process.stderr.readline() == b"the recording has ended; forwarding continues\n"
        near.sendall(b"not kept")
        assert exactly(far, 8) == b"not kept"
        assert tap.end() == (0, "", "")
    assert [bytes_in(row) for row in conversations(file)] == [(4, 0, "open")]


def test_a_tap_that_is_killed_leaves_a_whole_recording(tmp_path: Path) -> None:
    file = tmp_path / "line.pcapng"
    with tapped("--record", str(file)) as (tap, near, far):
        near.sendall(bytes(100_000))
        assert exactly(far, 100_000)
        near.sendall(b"x")  # forwarded first, then told: what came before it has been told
        assert exactly(far, 1)
        tap.end(signal.SIGKILL)  # the recorder holds stderr open: it has ended, too
        assert {end_of(near)[1], end_of(far)[1]} <= {"FIN", "RST"}
    (row,) = conversations(file)
    assert bytes_in(row)[0] in (100_000, 100_001)
