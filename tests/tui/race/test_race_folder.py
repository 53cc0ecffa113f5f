"""The folder of a raced session does not outlive the program, however that ends."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from trcvtui.tui.race.screen import RaceFolder

WAITS = """
from trcvtui.tui.race.screen import RaceFolder
import signal, sys
signal.signal(signal.SIGHUP, getattr(signal, sys.argv[1]))  # whatever the shell of these tests has set
folder = RaceFolder()
folder.file.write_text("x")
print(folder.file, flush=True)
if sys.argv[1] == "SIG_IGN":
    sys.stdin.readline()
    print(folder.file.exists(), flush=True)
    folder.close()
else:
    signal.pause()
"""


def started(before: str) -> subprocess.Popen[str]:
    """Return the program, started where a hang-up does that."""
    words = [sys.executable, "-c", WAITS, before]
    return subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def test_closing_removes_the_file_and_hears_no_hang_up_any_more() -> None:
    before = signal.getsignal(signal.SIGHUP)
    folder = RaceFolder()
    folder.file.write_text("x")
    folder.close()
    folder.close()
    assert not folder.file.parent.exists() and signal.getsignal(signal.SIGHUP) == before


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no terminals that hang up here")
def test_a_terminal_that_is_closed_leaves_no_folder_behind() -> None:
    with started("SIG_DFL") as program:
        assert program.stdout is not None
        file = Path(program.stdout.readline().strip())
        assert file.exists()
        program.send_signal(signal.SIGHUP)
        assert program.wait() == -signal.SIGHUP
    assert not file.parent.exists()


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no terminals that hang up here")
def test_a_program_that_a_hang_up_does_not_end_keeps_its_folder() -> None:
    with started("SIG_IGN") as program:
        assert program.stdout is not None and program.stdin is not None
        file = Path(program.stdout.readline().strip())
        program.send_signal(signal.SIGHUP)
        program.stdin.write("\n")
        program.stdin.flush()
        assert program.stdout.readline() == "True\n"
        assert program.wait() == 0
    assert not file.parent.exists()
