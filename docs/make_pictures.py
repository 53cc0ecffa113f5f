"""Draw the pictures of the documentation: the real screen on a simulated bench, `make pictures`."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from textual.pilot import Pilot

from trcvtui.plc.project_file import load_project
from trcvtui.rig import demo_path
from trcvtui.rig.assembly import Bench
from trcvtui.rig.local_driver import LocalDriver
from trcvtui.tui.app import BenchApp

HERE: Final = Path(__file__).parent
CONFIGS: Final = HERE.parent / "configs"


class Key(NamedTuple):
    """A key to press once the screen shows what came before."""

    name: str


# A line is a bench command; a number lets so many scans pass.
Play = Sequence[str | int | Key]

CHECKWEIGHER: Final[Play] = (
    3,
    "peer Device connect",
    10,
    "peer Device send hex 01 00 00 00 20 40 64 00 00 00",
    137,
    Key("v"),
)
DEMO: Final[Play] = ("set TRCV_C_1 CONT=1 EN_R=1", "set TRCV_C_2 CONT=1 EN_R=1", 295)

PICTURES: Final[dict[str, tuple[Path, Play, tuple[int, int]]]] = {
    "checkweigher": (CONFIGS / "checkweigher.toml", CHECKWEIGHER, (140, 45)),
    "demo": (demo_path(), DEMO, (140, 45)),
    "demo-80x24": (demo_path(), DEMO, (80, 24)),
}


async def draw(project: Path, play: Play, size: tuple[int, int]) -> str:
    """Return the screen after the play, as SVG."""
    loaded = load_project(project)
    driver = LocalDriver(Bench(loaded, "sim"))
    app = BenchApp(driver, loaded)
    async with app.run_test(size=size) as pilot:
        for move in play:
            await do(move, driver, pilot)
        await caught_up(pilot)
        svg = app.export_screenshot(title="trcvtui")
    driver.close()
    return svg


async def do(move: str | int | Key, driver: LocalDriver, pilot: Pilot[None]) -> None:
    """Let scans pass, send a bench command, or press a key."""
    if isinstance(move, int):
        driver.scan(move)
    elif isinstance(move, str):
        driver.submit(move)
    else:
        await caught_up(pilot)
        await pilot.press(move.name)


async def caught_up(pilot: Pilot[None]) -> None:
    """Wait until the screen shows the bench as it is."""
    for _ in range(4):  # a picture is asked for in one frame and shown in the next
        await pilot.pause(0.1)


def main() -> None:
    """Draw them all."""
    for name, (project, play, size) in PICTURES.items():
        (HERE / "pictures" / f"{name}.svg").write_text(
            asyncio.run(draw(project, play, size)), encoding="utf-8"
        )


if __name__ == "__main__":
    main()
