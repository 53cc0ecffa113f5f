"""The bench of a screen without an engine's process, and what waits for a picture of an engine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.bench.bench import Bench
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.engine.driver import ProcessDriver
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.snapshots.bench import EngineTiming

MOST_PICTURES: Final = 3000


def wait_for(driver: ProcessDriver, seen: Callable[[BenchUpdate], bool]) -> BenchUpdate:
    """Pull pictures, as the screen does, until one shows it."""
    request = UpdateRequest()
    for _ in range(MOST_PICTURES):
        driver.request(request)
        driver.wait_for_message(1.0)
        picture = driver.poll_picture()
        if picture is not None:
            if seen(picture):
                return picture
            request = UpdateRequest(bench=picture.bench, project=picture.project_number)
    raise AssertionError("never seen")


class LocalDriver:
    """A driver whose bench is in this process; `scan` lets scans pass, `do` some after each line."""

    is_shared = False

    def __init__(self, bench: Bench, pause: int = 0) -> None:
        self.console = Controller(bench)
        self._pause = pause
        self._number = 0
        self._picture: BenchUpdate | None = None

    def submit(self, line: str) -> int:
        self._number += 1
        self.console.handle_line(self._number, line)
        return self._number

    @property
    def bench(self) -> Bench:
        return self.console.bench

    def answer(self, line: str) -> str:
        """Return what is said to a line: what it did, or ✗ and what is wrong with it."""
        self.submit(line)
        answer = self.console._answers[-1]
        return f"✗ {answer.error}" if answer.error else answer.message

    def do(self, *lines: str, scans: int = 0) -> str:
        """Carry lines out, then let scans pass; return what the last line did."""
        told = ""
        for line in lines:
            told = self.answer(line)
            assert not told.startswith("✗"), told
            self.scan(self._pause)
        self.scan(scans)
        return told

    def play(self, *lines: str) -> None:
        """Submit lines; `run` of some scans lets them pass."""
        for line in lines:
            if line.startswith("run "):
                self.scan(int(line.removeprefix("run ")))
            else:
                self.submit(line)

    def scan(self, scans: int = 1) -> None:
        for _ in range(scans):
            self.console.scan()

    def request(self, request: UpdateRequest) -> None:
        self._picture = self.console.picture(request, EngineTiming(mode="in process"), request.most_lines)

    def poll_picture(self) -> BenchUpdate | None:
        picture, self._picture = self._picture, None
        return picture

    def shown(self, request: UpdateRequest | None = None) -> BenchUpdate:
        self.request(request or UpdateRequest())
        picture = self.poll_picture()
        assert picture is not None
        return picture

    def describe_quit_cuts(self) -> str:
        return ""

    def restart(self) -> None:
        bench = self.bench
        bench.close()
        self.console = Controller(fresh_bench(bench.project, bench.kernel_name))

    def close(self) -> None:
        self.bench.close()
