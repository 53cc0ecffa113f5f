"""M9: how long a person waits: for the first full screen, and for an answer without a screen.

Through the console script as pip installs it. A screen is timed by the clock; a command by its processor
time, so that a busy machine does not count.
"""

from __future__ import annotations

import compileall
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final

from benchmarks.figures import Effort, Figure, Pairs, against, alternate, ratios
from benchmarks.terminal import TRCVTUI, Terminal

HERE: Final = Path(__file__).parent
SOURCE: Final = HERE.parent / "trcvtui"
FULL_SCREEN: Final = ("Instances", "TRCV_C_1", "RCVD_LEN", "16#70", "Received", "Peer")
EMPTY_SCREEN: Final = ("ready",)
EMPTY_APP: Final = (sys.executable, str(HERE / "empty_app.py"))
PYTHON: Final = (sys.executable, "-c", "pass")
TYPES: Final = str(SOURCE / "demo" / "telegram.st")
SCENARIOS: Final = HERE.parent / "configs" / "scenarios" / "baosky"
FIRST: Final = str(min(SCENARIOS.glob("*.toml")))
TALKS: Final = str(SCENARIOS / "80aa-receive-fails.toml")
COMMANDS: Final = (
    ("status", ("status", "80C5")),
    ("udt show", ("udt", "show", TYPES, "--type", "Telegram")),
    ("scenario", ("scenario", FIRST)),
)


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the first full screen and the headless commands, each beside its reference, warm."""
    # As pip leaves an installed program. Under PYTHONDONTWRITEBYTECODE, as containers set it, the source
    # would be compiled at every start, while the reference's libraries are not.
    compileall.compile_dir(SOURCE, quiet=2)
    try:
        _first_screen([str(TRCVTUI)], FULL_SCREEN), _first_screen(EMPTY_APP, EMPTY_SCREEN)  # warm
        figures = alternate(
            lambda: _first_screen([str(TRCVTUI)], FULL_SCREEN),
            lambda: _first_screen(EMPTY_APP, EMPTY_SCREEN),
            effort.starts,
        )
        yield _compared("first full screen / empty Textual app", figures)
    except TimeoutError as failed:
        yield Figure.missing("first full screen", f"the screen did not open: {failed}")
    with tempfile.TemporaryDirectory() as folder:
        capture = Path(folder) / "run.pcapng"
        given = [str(TRCVTUI), "scenario", TALKS, "--record", str(capture)]
        subprocess.run(given, stdout=subprocess.DEVNULL, check=True)
        yield from _commands(effort, (*COMMANDS, ("conversations", ("conversations", str(capture)))))


def _commands(effort: Effort, commands: Iterable[tuple[str, Sequence[str]]]) -> Iterator[Figure]:
    for name, words in commands:
        command = [str(TRCVTUI), *words]
        _used_s(command), _used_s(PYTHON)  # warm: both have been read from the disk once
        pairs = alternate(lambda: _used_s(command), lambda: _used_s(PYTHON), 2 * effort.starts)  # noqa: B023
        yield _compared(f"trcvtui {name} / python -c pass", pairs)


def _first_screen(command: Sequence[str], texts: Sequence[str]) -> float:
    with Terminal(command) as terminal:
        seen = terminal.wait_for(texts)
        terminal.end("q")
    return seen


def _used_s(command: Sequence[str]) -> float:
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{' '.join(command)}: exit {process.returncode}")
    return used.ru_utime + used.ru_stime


def _compared(case: str, figures: Pairs) -> Figure:
    return Figure.of(case, ratios(figures), note=against(figures, 0, " ms", 1000))
