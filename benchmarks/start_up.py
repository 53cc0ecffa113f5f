"""M9: how long a person waits: for the first full screen, and for an answer without a screen."""

from __future__ import annotations

import compileall
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final

from benchmarks.figures import Effort, Figure
from benchmarks.paired import alternate, ratios, spread
from benchmarks.terminal import Terminal

HERE: Final = Path(__file__).parent
SOURCE: Final = HERE.parent / "trcvtui"
PROGRAM: Final = str(Path(sys.executable).with_name("trcvtui"))
SCREEN_AIM: Final = 1.3
HEADLESS_AIM: Final = 3.0
FULL_SCREEN: Final = ("Instances", "TRCV_C_1", "RCVD_LEN", "16#70", "Received", "Peer")
EMPTY_SCREEN: Final = ("ready",)


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the first full screen and the headless commands, each beside its reference, warm."""
    # As pip leaves an installed program. Under PYTHONDONTWRITEBYTECODE, as containers set it, the source
    # would be compiled at every start, while the reference's libraries are not.
    compileall.compile_dir(SOURCE, quiet=2)
    yield _screen(effort.starts)
    types = str(SOURCE / "rig" / "telegram.st")
    yield _headless("trcvtui status 7006", ["status", "7006"], effort.starts)
    yield _headless("trcvtui udt show", ["udt", "show", types, "--type", "Telegram"], effort.starts)


def _screen(starts: int) -> Figure:
    def ours() -> float:
        return _until([PROGRAM], FULL_SCREEN)

    def empty() -> float:
        return _until([sys.executable, str(HERE / "empty_app.py")], EMPTY_SCREEN)

    try:
        return _compare("first full screen / empty Textual app", ours, empty, starts, SCREEN_AIM)
    except TimeoutError as failed:
        return Figure("first full screen", "not measured", note=f"the screen did not open: {failed}")


def _until(command: Sequence[str], texts: Sequence[str]) -> float:
    with Terminal(command) as terminal:
        seen = terminal.wait_for(texts)
        terminal.end("q")
    return seen


def _headless(case: str, arguments: Sequence[str], starts: int) -> Figure:
    def ours() -> float:
        return _run([PROGRAM, *arguments])

    def python() -> float:
        return _run([sys.executable, "-c", "pass"])

    return _compare(f"{case} / python -c pass", ours, python, starts, HEADLESS_AIM)


def _run(command: Sequence[str]) -> float:
    began = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


def _compare(
    case: str, ours: Callable[[], float], reference: Callable[[], float], starts: int, aim: float
) -> Figure:
    ours(), reference()  # warm: both have been read from the disk once
    figures = alternate(ours, reference, starts)
    share = ratios(figures)
    mine, theirs = (spread([1000 * seconds for seconds in column]) for column in zip(*figures, strict=True))
    note = f"{mine.text(0, ' ms')} against {theirs.text(0, ' ms')}"
    return Figure(case, share.text(), f"<= {aim}", share.median <= aim, note)
