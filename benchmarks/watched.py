"""`python watched.py FILE WORD...`: trcvtui; FILE gets the collector's pauses: began, seconds."""

from __future__ import annotations

import gc
import sys
import time
from typing import TextIO


def watch(file: TextIO) -> None:
    """Write a line for each pause of this process; the engine is another one and has no collector."""
    began = 0.0

    def told(phase: str, info: dict[str, int]) -> None:
        nonlocal began
        now = time.perf_counter()
        if phase == "start":
            began = now
        else:
            file.write(f"{began} {now - began}\n")

    gc.callbacks.append(told)


if __name__ == "__main__":
    from trcvtui.cli.main import main

    with open(sys.argv.pop(1), "w", buffering=1) as file:
        watch(file)
        sys.exit(main())
