"""Who makes or writes a recording is killed at random moments: what the file holds is read to its end.

TRCVTUI_SOAK kills 200 times; the suite a few.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_cli import ENVIRONMENT
from tests.waiting import until
from trcvtui.recording.journal import Answered, RunBegins
from trcvtui.recording.recording import Recording

KILLS = 200 if os.environ.get("TRCVTUI_SOAK") else 3
VICTIMS = ("engine", "writer", "both")
MOST_ROUNDS = 60
A_ROUND = 50  # entries
NS_AN_ENTRY = 6_000_000  # of the run: a block is written each second of it
ENGINE = f"""
import sys
from pathlib import Path
from trcvtui.recording.journal import Answered, RunBegins
from trcvtui.recording.files import RecordTo
from trcvtui.recording.writer import WriterProcess
path = Path(sys.argv[1])
sink = WriterProcess(path, RecordTo(path))
sink.take([RunBegins("0", "sim", 0, 0, True, "x.toml", (), "/", (), ())])
print(sink.pid, flush=True)
count = 0
while not sink.trouble:
    new = range(count, count + {A_ROUND})
    sink.take([Answered("C1", "recv", (7, 9), (9, number.to_bytes(9, "big"))) for number in new])
    count += {A_ROUND}
    sink.take([Answered("bench", "step", (), count * {NS_AN_ENTRY})])
    sink.post()
    while sink.is_behind and not sink.trouble:
        sink.go_on()
    print(count, flush=True)
"""


def killed(path: Path, victim: str, rounds: int) -> int:
    """Record until so many rounds have crossed the pipe, then kill; return how many entries had crossed."""
    words = [sys.executable, "-c", ENGINE, str(path)]
    with subprocess.Popen(words, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True) as engine:
        assert engine.stdout is not None
        writer = int(engine.stdout.readline())
        crossed = 0
        for _ in range(rounds):
            crossed = int(engine.stdout.readline())
        if victim != "writer":
            engine.kill()
        if victim != "engine":
            os.kill(writer, signal.SIGKILL)
        engine.stdout.read()  # of the engine, and of nobody else
    until(lambda: not is_there(writer))  # he writes what he had, up to the end of his pipe
    return crossed


def is_there(process: int) -> bool:
    """Return whether a process is there and has not ended."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")
@pytest.mark.parametrize("number", range(KILLS))
def test_who_is_killed_while_he_records_leaves_all_that_was_written(tmp_path: Path, number: int) -> None:
    path, victim = tmp_path / "R.pcapng", VICTIMS[number % len(VICTIMS)]
    crossed = killed(path, victim, random.Random(number).randint(1, MOST_ROUNDS))
    found = list(Recording(path).entries())
    got = [one.answer for one in found if isinstance(one, Answered) and one.call == "recv"]
    assert got == [(9, each.to_bytes(9, "big")) for each in range(len(got))]
    assert not found or isinstance(found[0], RunBegins)
    if victim == "engine":
        assert len(got) >= crossed
