"""The device of docs/guide/tests-and-ci.md in the place of the peer, on real sockets."""

from __future__ import annotations

import re
import shlex
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.guide_page import FOLDER
from trcvtui.cli.main import main

pytestmark = [pytest.mark.live, pytest.mark.slow]
ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("volume", "exit_code"), [("500.5", 0), ("499.5", 1)])
def test_the_scenario_of_the_guide_judges_a_program_of_ones_own(
    volume: str, exit_code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    (block,) = re.findall(r"```text\n(.*?)```", (FOLDER / "tests-and-ci.md").read_text("utf-8"), re.DOTALL)
    start, command, _ = block.replace("\\\n", "").splitlines()
    with socket.create_server(("127.0.0.1", 0)) as door:
        port = str(door.getsockname()[1])
    device = (ROOT / start.split()[1]).read_text("utf-8").replace("500.5", volume)
    (tmp_path / "device.py").write_text(device, encoding="utf-8")
    program = subprocess.Popen([sys.executable, str(tmp_path / "device.py"), port])
    try:
        assert main(shlex.split(command.replace("LocalPort=2000", f"LocalPort={port}"))[1:]) == exit_code
    finally:
        program.kill()
        program.wait()
