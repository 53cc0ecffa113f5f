"""What a start does not import: each command has a list, and the failure names what crept in."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_cli import ENVIRONMENT

ROOT = Path(__file__).parents[2]
SCREEN = "textual rich asyncio"
LIBRARY = "ssl multiprocessing subprocess paho prometheus_client sqlite3"
RUN = "import sys; from trcvtui.cli.main import main; main(); "
SCENARIO = "configs/scenarios/baosky/0000-not-called.toml"
TYPES = "udt show trcvtui/demo/telegram.st --type Telegram"
LOAD = "import sys; from trcvtui.scenario.scenario import load_bench_project; from pathlib import Path; "
STARTS = {
    "status 7006": (
        RUN,
        "status 7006",
        f"{SCREEN} {LIBRARY} json socket trcvtui.net.os trcvtui.net.sim trcvtui.plc trcvtui.bench",
    ),
    "udt show": (
        RUN,
        TYPES,
        f"{SCREEN} {LIBRARY} json socket csv base64 trcvtui.udt.exports trcvtui.blocks trcvtui.net",
    ),
    "scenario": (
        RUN,
        f"scenario {SCENARIO}",
        f"{SCREEN} {LIBRARY} ctypes socket trcvtui.net.os trcvtui.diagnosis",
    ),
    "the engine": (
        "import sys, trcvtui.engine.engine; ",
        "",
        f"{SCREEN} argparse ssl",
    ),
    "a project without TLS": (LOAD + "load_bench_project(Path('configs/active.toml')); ", "", "ssl"),
    "the screen": (
        "import sys, trcvtui.tui.app; ",
        "",
        "argparse trcvtui.tui.lab.screen",
    ),
}


@pytest.mark.parametrize("name", STARTS)
def test_a_start_imports_nothing_that_it_does_not_use(name: str) -> None:
    code, words, unwanted = STARTS[name]
    said = f"print(*(name for name in {unwanted.split()} if name in sys.modules), file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", code + said, *words.split()],
        cwd=ROOT,
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        check=True,
    )
    crept_in = done.stderr.splitlines()[-1].split()
    assert crept_in == [], f"{name} imports {', '.join(crept_in)}: import it where it is used"
