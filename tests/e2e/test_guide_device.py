"""The device of docs/guide/tests-and-ci.md in the place of the peer, on real sockets."""

from __future__ import annotations

import os
import re
import shlex
import signal
import socket
import subprocess
from pathlib import Path

import pytest

from tests.e2e.terminal import need
from tests.guide_page import FOLDER
from trcvtui.cli.main import main

pytestmark = [pytest.mark.live, pytest.mark.slow]
ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("volume", "exit_code"), [(r"\103\372", 0), (r"\103\371", 1)])
def test_the_scenario_of_the_guide_judges_a_program_of_ones_own(
    volume: str, exit_code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    need("socat")
    monkeypatch.chdir(ROOT)
    (block,) = re.findall(r"```text\n(.*?)```", (FOLDER / "tests-and-ci.md").read_text("utf-8"), re.DOTALL)
    start, command, _ = block.replace("\\\n", "").splitlines()
    with socket.create_server(("127.0.0.1", 0)) as door:
        port = str(door.getsockname()[1])
    device = (ROOT / start.split()[1]).read_text("utf-8").replace(r"\103\372", volume)
    (tmp_path / "device.sh").write_text(device, encoding="utf-8")
    program = subprocess.Popen(["sh", str(tmp_path / "device.sh"), port], start_new_session=True)
    here = command.replace("LocalPort=2000", f"ListenPort={port}")  # an S7's LocalPort ends at 49151
    try:
        assert main(shlex.split(here)[1:]) == exit_code
    finally:
        os.killpg(program.pid, signal.SIGTERM)
        program.wait()
