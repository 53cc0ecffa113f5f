"""The engine's process, from its first line to its last words. Importing this costs the screen nothing."""

from __future__ import annotations

import gc
import signal
from collections.abc import Sequence
from multiprocessing.connection import Connection as Channel
from pathlib import Path

from trcvtui.errors import UserError
from trcvtui.files import close_files


def engine_main(
    channel: Channel,
    path: Path,
    kernel: str,
    overrides: Sequence[str],
    netns: bool = False,
    read_only: bool = False,
) -> None:
    """Run the engine until the screen closes the channel; a crash is told before the process ends."""
    gc.disable()  # the engine collects at the beginning of each bench only
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C belongs to the screen
    try:
        _run(channel, path, kernel, overrides, netns, read_only)
    except UserError as wrong:
        _tell(channel, wrong)
    except Exception:
        _tell(channel, _traceback())


def _run(
    channel: Channel, path: Path, kernel: str, overrides: Sequence[str], netns: bool, read_only: bool
) -> None:
    from trcvtui.rig.scenario.scenario import load_bench

    project = load_bench(path, overrides)
    channel.send(project)  # at once: the screen reads no file, it has its own library to import meanwhile
    from trcvtui.rig.engine.controller import fresh_bench
    from trcvtui.rig.engine.engine import Engine

    if netns:
        from trcvtui.rig.bench.cable import enter_own_network

        enter_own_network(kernel, project.sim)
    bench = fresh_bench(project, kernel)
    if read_only:
        close_files("this bench is read-only")  # `expect .. file X` would tell what X holds
    Engine(channel, bench).run()


def _traceback() -> str:
    import traceback

    return traceback.format_exc()


def _tell(channel: Channel, last_words: str | UserError) -> None:
    try:
        channel.send(last_words)
    except OSError:
        return  # the screen is gone, and that was the reason
