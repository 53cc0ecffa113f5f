"""The live engine: absolute deadlines, and the screen served in the gaps.

Rule 1: a scan is never caught up in a burst: deadlines that have passed are skipped and counted.
Rule 2: what the screen asks is answered between two scans, and costs at most what the gap allows.
"""

from __future__ import annotations

import os
from multiprocessing.connection import Connection as Channel
from pathlib import Path
from typing import Final

from trcvtui.rig import clock
from trcvtui.rig.assembly import Bench
from trcvtui.rig.bench import parse_script
from trcvtui.rig.console import Console
from trcvtui.rig.picture import PictureRequest
from trcvtui.rig.scheduling import be_punctual, quiet_collector
from trcvtui.rig.timing import Punctuality

NS_PER_MS: Final = 1_000_000
NS_PER_LINE: Final = 12_000  # what one ledger line costs to put into a picture, generously
LEAST_LINES: Final = 50
TIMING_FILE: Final = "TRCVTUI_TIMING_FILE"  # names a file that gets every scan's lateness at the end


class Engine:
    """The bench, its console, and the channel to the screen."""

    def __init__(self, channel: Channel, bench: Bench) -> None:
        self._channel = channel
        self._bench = bench
        self._console = Console(bench)
        self._timing = Punctuality(be_punctual())
        self._timing_file = os.environ.get(TIMING_FILE)
        if self._timing_file:
            self._timing.keep_every()
        self._interval = bench.runtime.interval_ns
        for step in parse_script(bench.project.start, bench.project, str(bench.project.path)):
            bench.do(step.command)

    def run(self) -> None:
        """Scan at every deadline; serve the screen in between."""
        quiet_collector()
        start = due = clock.now_ns()
        try:
            while True:
                self._serve(due)
                clock.sleep_until(due)
                due = self._scan(start, due)
        finally:
            self._bench.close()
            if self._timing_file:
                self._timing.write_to(Path(self._timing_file))

    def _scan(self, start: int, due: int) -> int:
        began = clock.now_ns()
        if self._console.may_scan():
            self._bench.step(began - start if self._bench.kernel_name == "live" else None)
            ended = clock.now_ns()
            self._timing.scanned(due, began, ended, self._interval)
        else:
            self._bench.step_peers()
            ended = clock.now_ns()
        due += self._interval
        if ended > due:
            due += (ended - due + self._interval - 1) // self._interval * self._interval
        return due

    def _serve(self, due: int) -> None:
        while True:
            left = due - clock.now_ns()
            # The poll's timeout is whole milliseconds, rounded up: leave one for the sleep that is exact.
            wait_ms = max(0, left // NS_PER_MS - 1)
            if not self._channel.poll(wait_ms / 1000):
                return
            self._answer(self._channel.recv(), due)
            if due - clock.now_ns() < NS_PER_MS:
                return

    def _answer(self, message: object, due: int) -> None:
        match message:
            case (int() as number, str() as line):
                self._console.take(number, line)
            case PictureRequest() as request:
                room = max(0, due - clock.now_ns() - NS_PER_MS) // NS_PER_LINE
                lines = max(LEAST_LINES, room)
                self._channel.send(self._console.picture(request, self._timing.summary(), lines))
