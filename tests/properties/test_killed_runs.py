"""A run on real sockets, or who writes it down, is killed at random moments: the file runs again to its end.

TRCVTUI_SOAK kills 200 times; the suite a few.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from tests.cli.test_cli import ENVIRONMENT
from tests.recording.test_black_box import PROJECT as OF_EIGHT_BYTES
from tests.waiting import children_of, until, until_size
from trcvtui.recording.journal import STEP, CallRecord, RunHeader
from trcvtui.recording.recording import Recording
from trcvtui.replay.command import find_difference
from trcvtui.replay.run_again import ReplayRun

KILLS = 200 if os.environ.get("TRCVTUI_SOAK") else 3
VICTIMS = ("engine", "writer", "both")
MOST_MISSING_NS = 1_000_000_000
PROJECT = OF_EIGHT_BYTES.replace("0..7", "0..63").replace("01 02 03 04 05 06 07 08", "5a " * 64)


def waited_ns(process: int) -> int:
    """Return how long a process has waited for a processor: what it could not write then it did not lose."""
    return int(Path(f"/proc/{process}/schedstat").read_text().split()[1])


def killed(folder: Path, victim: str, chance: random.Random) -> tuple[Path, int, int | None]:
    """Record a run and kill; return the file, when (UTC less what was waited), how a spared run ended."""
    (folder / "P.toml").write_text(PROJECT)
    path = folder / "out" / "P-0001.pcapng"
    words = [sys.executable, "-m", "trcvtui", "record", "P.toml", "--out", "out"]
    pipe = subprocess.PIPE
    with subprocess.Popen(words, cwd=folder, env=ENVIRONMENT, stdout=pipe, stderr=pipe) as engine:
        least = chance.randint(1, 30_000)  # bytes
        until_size(engine, path, least)
        with suppress(subprocess.TimeoutExpired):  # somewhere between two blocks
            engine.wait(chance.random() / 2)
        (writer,) = children_of(engine.pid)
        at = time.time_ns() - waited_ns(engine.pid) - waited_ns(writer)
        if victim != "writer":
            engine.kill()
        if victim != "engine":
            os.kill(writer, signal.SIGKILL)
        told = None
        if victim == "writer":
            told = engine.wait()
            assert engine.stderr is not None and b"the writer has ended" in engine.stderr.read()
        until(lambda: not is_running(writer))  # he writes what he had
    return path, at, told


def is_running(process: int) -> bool:
    with suppress(OSError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


@pytest.mark.slow
@pytest.mark.live
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")
@pytest.mark.parametrize("number", range(KILLS))
def test_a_killed_run_lacks_a_second_at_most_and_runs_again_up_to_there(tmp_path: Path, number: int) -> None:
    victim = VICTIMS[number % len(VICTIMS)]
    path, at, told = killed(tmp_path, victim, random.Random(number))
    recording = Recording(path)
    found = list(recording.read_entries())
    steps = [one.answer for one in found if isinstance(one, CallRecord) and one.call == STEP]
    if not steps:  # killed before the first block
        assert at - path.stat().st_mtime_ns < MOST_MISSING_NS
        return
    begins = found[0]
    assert isinstance(begins, RunHeader) and isinstance(steps[-1], int)
    assert at - (begins.wall_ns + steps[-1]) < MOST_MISSING_NS
    said = find_difference(ReplayRun(recording.read_entries(), "R"))
    assert said == "" or said.startswith("R: found the end of the journal after ")
    assert told in (None, 1)
    tshark = shutil.which("tshark")
    if tshark is not None:
        seen = subprocess.run(
            [tshark, "-r", path, "-Y", "_ws.malformed || tcp.checksum.status == Bad"], capture_output=True
        )
        assert seen.stdout == b""
        assert seen.returncode == 0 or b"cut short" in seen.stderr
