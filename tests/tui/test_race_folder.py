"""The folder of a raced session does not outlive the program, however that ends."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from trcvtui.tui.race_folder import RaceFolder

WAITS = """
from trcvtui.tui.race_folder import RaceFolder
import signal
folder = RaceFolder()
folder.file.write_text("x")
print(folder.file, flush=True)
signal.pause()
"""


def test_closing_removes_the_file_and_hears_no_hang_up_any_more() -> None:
    before = signal.getsignal(signal.SIGHUP)
    folder = RaceFolder()
    folder.file.write_text("x")
    folder.close()
    folder.close()
    assert not folder.file.parent.exists() and signal.getsignal(signal.SIGHUP) == before


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no terminals that hang up here")
def test_a_terminal_that_is_closed_leaves_no_folder_behind() -> None:
    with subprocess.Popen([sys.executable, "-c", WAITS], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        file = Path(program.stdout.readline().strip())
        assert file.exists()
        program.send_signal(signal.SIGHUP)
        assert program.wait(timeout=20) == -signal.SIGHUP
    assert not file.parent.exists()
