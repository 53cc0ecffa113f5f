"""The pages of docs/guide: each command, key and line that they print shows what they say (virtual time)."""

from __future__ import annotations

import asyncio
import os
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.guide_page import FOLDER, Step, joined, opens_screen, played_text, steps
from tests.local_driver import LocalDriver
from tests.tui.fakes import FakeDriver
from tests.tui.looking import Looker
from trcvtui.cli.main import main
from trcvtui.engine import driver as engine_driver
from trcvtui.engine.controller import fresh_bench
from trcvtui.project.file import load_project
from trcvtui.project.project import Project
from trcvtui.tui.app import BenchApp

ROOT = Path(__file__).parents[1]
PAGES = sorted(path.name for path in FOLDER.glob("*.md"))
SIZE = (100, 30)
SCANS_A_LOOK, MOST_LOOKS, PATIENCE_S = 10, 500, 60.0
MOST_WORDS = 700


class VirtualEngine(LocalDriver):
    """The engine of `run` in this process; scans pass when the page is played."""

    def __init__(self, path: Path, *_: object) -> None:
        super().__init__(fresh_bench(load_project(path), "sim"))

    def wait_for_project(self) -> Project:
        return self.bench.project


class GuideLooker(Looker):
    """Plays steps on a screen."""

    async def play(self, step: Step) -> None:
        if step.kind == "key":
            await (self.type(step.text) if len(step.text) == 1 else self.press(step.text))
        elif step.kind == "text":
            await self.type(step.text)
        elif step.kind == "line":
            await self.type(f":{step.text}\r")
        else:
            await self.see(step.text)
        await self.pass_time()

    async def pass_time(self) -> None:
        if isinstance(self.app._engine, LocalDriver):
            self.app._engine.scan(SCANS_A_LOOK)
        for _ in range(3):
            self.app._refresh_picture()
            await self.pilot.pause()

    async def see(self, words: str) -> None:
        limit = time.monotonic() + PATIENCE_S
        for _ in range(MOST_LOOKS):
            if words in joined(self.text):
                return
            await self.pass_time()
            if not isinstance(self.app._engine, LocalDriver):
                await asyncio.sleep(0.02)  # another process is at work
            if time.monotonic() > limit:
                break
        raise AssertionError(f"never seen: {words}\n{self.text}")


def play_on(screen_steps: list[Step]) -> Callable[[BenchApp], None]:
    """Return what takes the place of BenchApp.run: it plays the steps, and ends."""

    async def play(app: BenchApp) -> None:
        async with app.run_test(size=SIZE) as pilot:
            looker = GuideLooker(app, FakeDriver(), pilot)
            await looker.pass_time()
            for step in screen_steps:
                await looker.play(step)

    return lambda app: asyncio.run(play(app))


def output_of(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    """Return what a command prints; a pipe or another program runs in a shell."""
    if command.startswith("trcvtui ") and not {*"|<>;&$"} & {*command}:
        assert main(shlex.split(command)[1:]) != 2, (command, capsys.readouterr())
        shown = capsys.readouterr()
        return shown.out + shown.err
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["sh", "-c", command], capture_output=True, text=True, check=False, env={**os.environ, "PATH": path}
    )
    assert done.returncode < 2, (command, done)
    return done.stdout + done.stderr


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder that a reader is in: with `configs/`, where a page may save."""
    shutil.copytree(ROOT / "configs", tmp_path / "configs")
    monkeypatch.chdir(tmp_path)
    for name in ("STATE", "CONFIG"):
        monkeypatch.setenv(f"XDG_{name}_HOME", str(tmp_path / name.lower()))
    return tmp_path


def play_page(text: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> int:
    """Play a page; return how many words of it were seen."""
    waiting, printed, seen = steps(text), "", 0
    while waiting:
        step = waiting.pop(0)
        if step.kind == "words":
            assert step.text in joined(printed), (step.text, printed)
            seen += 1
        elif not opens_screen(step.text):
            printed = ("" if step.begins_block else printed) + output_of(step.text, capsys)
        else:
            on_screen = [waiting.pop(0) for _ in range(next_command(waiting))]
            seen += sum(each.kind == "words" for each in on_screen)
            with monkeypatch.context() as patched:
                patched.setattr(os, "isatty", lambda _: True)
                patched.setattr(engine_driver, "EngineDriver", VirtualEngine)
                patched.setattr(BenchApp, "run", play_on(on_screen))
                assert main(shlex.split(step.text)[1:]) == 0, capsys.readouterr()
            capsys.readouterr()
    return seen


def next_command(waiting: list[Step]) -> int:
    return next((at for at, step in enumerate(waiting) if step.kind == "command"), len(waiting))


@pytest.mark.parametrize("page", PAGES)
def test_a_page_shows_what_it_says(
    page: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert play_page(played_text(page), monkeypatch, capsys) >= 3


@pytest.mark.parametrize("page", PAGES)
def test_a_page_is_short(page: str) -> None:
    assert len((FOLDER / page).read_text(encoding="utf-8").split()) <= MOST_WORDS
