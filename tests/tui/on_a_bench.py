"""The screen on a true bench in the same process: scans pass when the test says so, in virtual time."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TypeVar

from textual.pilot import Pilot

from tests.local_driver import LocalDriver
from tests.tui.fakes import FakeDriver, bench_project
from tests.tui.looking import WIDE, Looker
from trcvtui.engine.controller import fresh_bench
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.project.project import Project
from trcvtui.tui.app import BenchApp

MOST_PAUSES = 500


class BenchDriver(FakeDriver):
    """A driver of pictures whose pictures are those of a bench."""

    def __init__(self) -> None:
        super().__init__()
        self.local = LocalDriver(fresh_bench(bench_project(), "sim"))
        self._asked: UpdateRequest | None = None

    def submit(self, line: str) -> int:
        super().submit(line)
        return self.local.submit(line)

    def request(self, request: UpdateRequest) -> None:
        super().request(request)
        self._asked = request

    def poll_picture(self) -> BenchUpdate | None:
        """Return the bench as it is now, not as it was when a picture was asked for."""
        if self._asked is None:
            return None
        self.local.request(self._asked)
        self._asked = None
        return self.local.poll_picture()


class BenchLooker(Looker):
    def __init__(self, app: BenchApp, driver: BenchDriver, pilot: Pilot[None]) -> None:
        super().__init__(app, driver, pilot)
        self.bench = driver.local

    def connect(self) -> None:
        """Let P1 be connected and TRCV_C_1 receive: scan 12 is the next one."""
        self.bench.do("set TRCV_C_1 CONT=1 EN_R=1", scans=5)
        self.bench.do("peer P1 connect", scans=6)

    async def pictures(self, count: int = 3) -> None:
        wanted = len(self.driver.requests) + count
        for _ in range(MOST_PAUSES):
            if len(self.driver.requests) >= wanted:
                break
            self.app._refresh_picture()
            await self.pilot.pause()
        assert len(self.driver.requests) >= wanted, "the screen asks no more"
        await self.settle()


class LocalLooker(Looker):
    """The screen on a bench; each picture is the newest."""

    bench: LocalDriver

    async def see(self) -> None:
        for _ in range(2):
            before = self.app.view_model.live
            while self.app.view_model.live is before:
                self.app._refresh_picture()
                await self.pilot.pause()
        await self.settle()


OneLooker = TypeVar("OneLooker", bound=LocalLooker)


@asynccontextmanager
async def on_local(
    kind: type[OneLooker], project: Project, size: tuple[int, int]
) -> AsyncIterator[OneLooker]:
    driver = LocalDriver(fresh_bench(project, "sim"))
    app = BenchApp(driver, project)
    async with app.run_test(size=size) as pilot:
        looker = kind(app, FakeDriver(), pilot)
        looker.bench = driver
        yield looker
    driver.close()


@asynccontextmanager
async def on_a_bench(size: tuple[int, int] = WIDE) -> AsyncIterator[BenchLooker]:
    driver = BenchDriver()
    app = BenchApp(driver, bench_project())
    async with app.run_test(size=size) as pilot:
        looker = BenchLooker(app, driver, pilot)
        await looker.pictures()
        yield looker
    driver.local.close()
