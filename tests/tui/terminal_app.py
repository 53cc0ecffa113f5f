"""The screen on pictures, to be started in a terminal of its own."""

from __future__ import annotations

import sys

from tests.tui.fakes import FakeDriver, bench_project, picture, story
from trcvtui.tui.app import run_app

if __name__ == "__main__":
    sys.exit(
        run_app(FakeDriver(picture(lines=story(), data=b"\x1b[31m\x1b]0;x\x07" + bytes(12))), bench_project())
    )
