"""The screen on a true bench in the same process: scans pass when the test says so, in virtual time."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from textual.pilot import Pilot

from tests.tui.fakes import FakeDriver, bench_project
from tests.tui.looking import WIDE, Looker
from trcvtui.commands.snapshots import EngineTiming
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.history.bench_update import BenchUpdate, UpdateRequest
from trcvtui.tui.app import BenchApp

MOST_PAUSES = 500


class BenchDriver(FakeDriver):
    def __init__(self) -> None:
        super().__init__()
        self.console = Controller(fresh_bench(bench_project(), "sim"))
        self._request: UpdateRequest | None = None

    def do(self, *lines: str) -> None:
        for number, line in enumerate(lines):
            self.console.take(number, line)
            answer = self.console._answers[-1]
            assert answer.error == "", answer

    def scan(self, times: int = 1) -> None:
        for _ in range(times):
            assert self.console.scan()

    def submit(self, line: str) -> int:
        number = super().submit(line)
        self.console.take(number, line)
        return number

    def request(self, request: UpdateRequest) -> None:
        super().request(request)
        self._request = request

    def picture(self) -> BenchUpdate | None:
        if self._request is None:
            return None
        request, self._request = self._request, None
        return self.console.picture(request, EngineTiming(), request.most_lines)


class BenchLooker(Looker):
    def __init__(self, app: BenchApp, driver: BenchDriver, pilot: Pilot[None]) -> None:
        super().__init__(app, driver, pilot)
        self.bench = driver

    def connect(self) -> None:
        """Let P1 be connected and TRCV_C_1 receive: scan 12 is the next one."""
        self.bench.do("set TRCV_C_1 CONT=1 EN_R=1")
        self.bench.scan(5)
        self.bench.do("peer P1 connect")
        self.bench.scan(6)

    async def pictures(self, count: int = 3) -> None:
        wanted = len(self.driver.requests) + count
        for _ in range(MOST_PAUSES):
            if len(self.driver.requests) >= wanted:
                break
            self.app._frame()
            await self.pilot.pause()
        assert len(self.driver.requests) >= wanted, "the screen asks no more"
        await self.settle()


@asynccontextmanager
async def on_a_bench(size: tuple[int, int] = WIDE) -> AsyncIterator[BenchLooker]:
    driver = BenchDriver()
    app = BenchApp(driver, bench_project())
    async with app.run_test(size=size) as pilot:
        looker = BenchLooker(app, driver, pilot)
        await looker.pictures()
        yield looker
    driver.console.bench.close()
