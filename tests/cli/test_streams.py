"""Streams that are closed or full, and too few descriptors: every command has its usual exit code."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_cli import ENVIRONMENT, process
from tests.recording.wire import capture, handshake
from trcvtui.cli.main import COMMANDS

ROOT = Path(__file__).parents[2]
PROJECT, TYPES = ROOT / "configs/passive.toml", ROOT / "configs/types/weight.st"
SCENARIO = ROOT / "configs/scenarios/baosky/0000-not-called.toml"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="no sh"),
]
LINES = {
    f"run {PROJECT}": 2,  # no terminal
    "examples": 0,
    "serve none.toml": 2,
    f"scenario {SCENARIO} --record run.pcapng --kernel live": 0,
    f"record {PROJECT} --out out --kernel sim --duration T#100ms": 0,
    "record bad.toml --out never": 2,
    "replay bad.toml --check": 2,
    "recording strip bad.toml none.pcapng --no-payload": 2,
    "watch -": 2,
    "watch c.pcapng": 0,
    "tap 192.0.2.1:1 127.0.0.1:9 --record never.pcapng": 2,
    "conversations c.pcapng": 0,
    "messages c.pcapng": 1,  # a handshake
    "doctor none.pcapng": 2,
    "report c.pcapng --out c.html": 0,
    "agent bad.toml --metrics 127.0.0.1:9 --record never": 2,
    "fleet mqtt://127.0.0.1:9": 2,
    "status XXXX": 2,
    f"st {PROJECT}": 0,
    f"udt types {TYPES}": 0,
    "udt show -": 2,
    "completion bash": 0,
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "bad.toml").write_text("x = [")
    (tmp_path / "c.pcapng").write_bytes(capture(handshake()))
    return tmp_path


def ended(line: str, folder: Path, before: str = "") -> subprocess.CompletedProcess[str]:
    """Run a line of a shell whose first words are the program's."""
    words, null = ["sh", "-c", f'{before}exec "$0" "$@" {line}', *process()], subprocess.DEVNULL
    return subprocess.run(words, stdin=null, capture_output=True, text=True, cwd=folder, env=ENVIRONMENT)


@pytest.mark.parametrize("streams", ["<&-", "<&- 2>&-"])
def test_a_closed_stream_changes_no_exit_code_of_any_command(streams: str, folder: Path) -> None:
    assert {line.split()[0] for line in LINES} == {*COMMANDS}
    found = {line: ended(f"{line} {streams}", folder) for line in LINES}
    assert {line: done.returncode for line, done in found.items()} == LINES
    said = "".join(done.stdout + done.stderr for done in found.values())
    assert "Traceback" not in said
    assert [*folder.glob("never*")] == [], "what failed leaves nothing"


@pytest.mark.parametrize("streams", ["2>&-", "2>/dev/full", "2</dev/null"])
def test_a_message_that_cannot_be_said_changes_no_exit_code(streams: str, tmp_path: Path) -> None:
    assert ended(f"status XXXX {streams}", tmp_path).returncode == 2


@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_a_closed_stdout_is_one_line(closed: str, tmp_path: Path) -> None:
    done = ended(f"status 80C5 {closed}", tmp_path)
    said = "stdout: found it closed, expected a terminal, a file or a pipe\n"
    assert (done.returncode, done.stderr) == (2, "" if "2>" in closed else said)


OPENS = """
import os, socket, subprocess, sys
from trcvtui.cli.streams import prepare_streams
prepare_streams()
sys.stderr.write("a message")
links = "import os; print(*(os.readlink(f'/proc/self/fd/{number}') for number in (0, 2)), flush=True)"
subprocess.run([sys.executable, "-c", links])
print(socket.socket().fileno() > 2, sys.stdin)
"""


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="no /proc")
def test_no_socket_gets_the_number_of_a_closed_stream_here_or_in_a_child(tmp_path: Path) -> None:
    (tmp_path / "opens.py").write_text(OPENS)
    words = ["sh", "-c", 'exec "$0" opens.py <&- 2>&-', sys.executable]
    done = subprocess.run(words, cwd=tmp_path, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True, check=True)
    assert done.stdout.split() == ["/dev/null", "/dev/null", "True", "None"]


@pytest.mark.live
@pytest.mark.parametrize("line", [f"record {PROJECT} --out never", f"doctor {PROJECT} --for T#10ms"])
def test_too_few_descriptors_are_one_line_and_leave_no_folder(line: str, folder: Path) -> None:
    done = ended(line, folder, "ulimit -n 8; ")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert "ulimit -n" in done.stderr and not (folder / "never").exists()
