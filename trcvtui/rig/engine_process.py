"""The engine's process, from its first line to its last words. Importing this costs the screen nothing."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from multiprocessing.connection import Connection as Channel
from pathlib import Path


def engine_main(channel: Channel, path: Path, kernel: str, overrides: Sequence[str]) -> None:
    """Run the engine until the screen closes the channel; a crash is told before the process ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C belongs to the screen
    try:
        _run(channel, path, kernel, overrides)
    except Exception:
        _tell_last_words(channel)


def _run(channel: Channel, path: Path, kernel: str, overrides: Sequence[str]) -> None:
    from trcvtui.plc.project_file import load_project
    from trcvtui.rig.assembly import Bench
    from trcvtui.rig.engine import Engine

    Engine(channel, Bench(load_project(path, overrides), kernel)).run()


def _tell_last_words(channel: Channel) -> None:
    import traceback

    try:
        channel.send(traceback.format_exc())
    except OSError:
        return  # the screen is gone, and that was the reason
