"""The bench of a screen without an engine's process."""

from __future__ import annotations

from trcvtui.bench.bench import Bench
from trcvtui.commands.snapshots import EngineTiming
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.history.bench_update import BenchUpdate, UpdateRequest


class LocalDriver:
    """A driver whose bench is in this process; `scan` lets scans pass."""

    def __init__(self, bench: Bench) -> None:
        self.console = Controller(bench)
        self._number = 0
        self._picture: BenchUpdate | None = None

    def submit(self, line: str) -> int:
        self._number += 1
        self.console.take(self._number, line)
        return self._number

    def scan(self, scans: int = 1) -> None:
        for _ in range(scans):
            self.console.scan()

    def request(self, request: UpdateRequest) -> None:
        self._picture = self.console.picture(request, EngineTiming(mode="in process"), request.most_lines)

    def picture(self) -> BenchUpdate | None:
        picture, self._picture = self._picture, None
        return picture

    def restart(self) -> None:
        bench = self.console.bench
        bench.close()
        self.console = Controller(fresh_bench(bench.project, bench.kernel_name))

    def close(self) -> None:
        self.console.bench.close()
