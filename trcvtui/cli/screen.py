"""The screen, and the process that sends its pictures.

Rule: start the picture process first; it reads the project while the screen library is being imported.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from trcvtui.cli.options import FAILED, WRONG_INPUT, load_bench_project
from trcvtui.cli.streams import has_terminal
from trcvtui.errors import mistake

if TYPE_CHECKING:
    from trcvtui.engine.driver import ProcessDriver
    from trcvtui.recording.files import RecordTarget


def open_screen(
    path: Path,
    kernel: str,
    netns: bool = False,
    theme: str | None = None,
    read_only: bool = False,
    record: RecordTarget | None = None,
) -> int:
    if netns:
        from trcvtui.bench.bench import enter_own_network

        enter_own_network(kernel)  # before the screen, so that you see the error
    if not has_terminal() and "WebDriver" not in os.environ.get("TEXTUAL_DRIVER", ""):  # of `serve`
        load_bench_project(path)
        raise mistake("trcvtui run", "no terminal", "a terminal; `trcvtui scenario` needs none")
    if not read_only and not _ensure_project(path):
        return WRONG_INPUT
    from trcvtui.engine.driver import EngineDriver

    return run_screen(
        lambda: EngineDriver(path, kernel, netns, read_only, record), theme, read_only, is_run=True
    )


def run_screen(
    start: Callable[[], ProcessDriver],
    theme: str | None = None,
    read_only: bool = False,
    is_replay: bool = False,
    is_run: bool = False,
) -> int:
    from trcvtui.picture.protocol import EngineStopped

    gc.disable()  # until the first frame: imported modules stay, to collect them only costs time
    driver = start()  # the rule: it reads the project while the next lines import the screen
    try:
        # Textual paints at the next tick of this clock, 60 Hz by default: a key would wait 8 ms for it.
        os.environ.setdefault("TEXTUAL_FPS", "200")
        from trcvtui.tui.app import run_app

        return run_app(driver, driver.wait_for_project(), theme, read_only, is_replay, is_run)
    except EngineStopped as stopped:  # it ended before there was a screen to say so
        sys.stderr.write(f"{str(stopped).rstrip()}\n")
        return FAILED
    finally:
        driver.close()


def _ensure_project(path: Path) -> bool:
    if "TEXTUAL_DRIVER" in os.environ:
        return True  # a browser tab has no terminal for the question
    try:
        if path.stat().st_size:
            return True
    except OSError:  # it does not exist
        pass
    from trcvtui.engine.project_edits import can_create_project, offer_project

    return offer_project(path, sys.stdin, sys.stderr) if can_create_project(path) else True
