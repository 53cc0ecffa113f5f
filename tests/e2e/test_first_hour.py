"""docs/guide/first-hour.md as it is printed, typed into a true terminal: it shows what the page says."""

from __future__ import annotations

import re
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.terminal import TRCVTUI, Terminal, need
from tests.e2e.test_readme_stories import PORT, SIZES
from tests.guide_page import FOLDER, HOUR_ENDS

pytestmark = [pytest.mark.live, pytest.mark.slow]
PAGE = (FOLDER / "first-hour.md").read_text(encoding="utf-8").partition(HOUR_ENDS)[0]
STEPS = re.findall(r"```sh\n(.*?)\n```|`([^`]+)`|\*([^*]+)\*", PAGE.partition("\n## ")[2], re.DOTALL)
KEYS = {"enter": "Enter", "ctrl+s": "C-s"}
MOST, MOST_LINES = 30, 6
RUN = "trcvtui run"


class FirstHour:
    """The bench in a terminal, and what runs beside it; `ports` are those of the page and of this run."""

    def __init__(self, folder: Path, size: tuple[int, int], listener: int) -> None:
        self.folder, self.size, self.ports = folder, size, {"2040": str(listener)}
        self.terminals: list[Terminal] = []
        self.beside: list[subprocess.Popen[bytes]] = []

    def play(self, outside: str, typed: str, shown: str) -> None:
        if outside.startswith(RUN):
            command = outside.replace("trcvtui", str(TRCVTUI), 1)
            self.terminals.append(Terminal(*self.size, f"cd {self.folder}; exec {command}"))
        elif outside:
            line = re.sub(r"2000|2040", lambda port: self.ports[port[0]], outside)
            self.beside.append(subprocess.Popen(["sh", "-c", line], cwd=self.folder))
            if "socat" not in outside:
                self.beside[-1].wait()
        elif typed.startswith(":"):
            self.terminals[-1].type(typed.replace("2040", self.ports["2040"]))
            self.terminals[-1].keys("Enter")
        elif typed:
            self.terminals[-1].keys(KEYS.get(typed, typed))
        else:
            screen = self.terminals[-1].wait(shown)
            assert " : ✗" not in screen
            if found := PORT.search(screen):
                self.ports["2000"] = found[1]  # the form proposes one, the bench takes the next that is free

    def close(self) -> None:
        for terminal in self.terminals:
            terminal.close()
        for process in self.beside:
            process.kill()
            process.wait()


@pytest.fixture
def hour(tmp_path: Path, columns: int, rows: int) -> Iterator[FirstHour]:
    need("socat")
    with socket.create_server(("127.0.0.1", 0)) as door:
        free = door.getsockname()[1]
    first_hour = FirstHour(tmp_path, (columns, rows), free)
    yield first_hour
    first_hour.close()


@SIZES
def test_the_first_hour_is_played_as_the_page_prints_it(hour: FirstHour) -> None:
    for step in STEPS:
        hour.play(*step)
    saved = (hour.folder / "line.toml").read_text(encoding="utf-8")
    assert saved.count("[[instance]]") == 2 and len(hour.terminals) == 2


def test_the_first_hour_is_short() -> None:
    keys_and_lines = [outside or typed for outside, typed, _ in STEPS if outside or typed]
    assert len(keys_and_lines) <= MOST
    assert sum(line.startswith(":") for line in keys_and_lines) <= MOST_LINES
