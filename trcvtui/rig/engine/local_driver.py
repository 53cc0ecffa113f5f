"""The bench in this process, driven as a screen drives the engine: for simulation, pictures and tests."""

from __future__ import annotations

from trcvtui.rig.bench.bench import Bench
from trcvtui.rig.engine.controller import Console, fresh_bench
from trcvtui.rig.picture import Picture, PictureRequest
from trcvtui.rig.snapshots import EngineTiming


class LocalDriver:
    """The bench in this process, for simulation and tests; `scan` lets scans pass."""

    def __init__(self, bench: Bench) -> None:
        self.console = Console(bench)
        self._number = 0
        self._picture: Picture | None = None

    def submit(self, line: str) -> int:
        """Carry out one bench command line."""
        self._number += 1
        self.console.take(self._number, line)
        return self._number

    def scan(self, scans: int = 1) -> None:
        """Let scans pass, as far as they are not held."""
        for _ in range(scans):
            self.console.scan()

    def request(self, request: PictureRequest) -> None:
        """Take a picture now."""
        self._picture = self.console.picture(request, EngineTiming(mode="in process"), request.most_lines)

    def picture(self) -> Picture | None:
        """Return the picture taken since the last call."""
        picture, self._picture = self._picture, None
        return picture

    def restart(self) -> None:
        """Begin anew with the project as it is now."""
        bench = self.console.bench
        bench.close()
        self.console = Console(fresh_bench(bench.project, bench.kernel_name))

    def close(self) -> None:
        """End the bench."""
        self.console.bench.close()
