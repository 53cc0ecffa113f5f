"""The screens of docs/guide in a true terminal, on real sockets: `make soak`."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.e2e.terminal import TRCVTUI, Terminal
from tests.e2e.test_in_a_terminal import terminals
from tests.guide_page import Step, joined, opens_screen, played_text, steps
from tests.test_guide import PAGES, SIZE, folder, output_of

__all__ = ["folder", "terminals"]
pytestmark = [
    pytest.mark.live,
    pytest.mark.slow,
    pytest.mark.skipif("TRCVTUI_SOAK" not in os.environ, reason="a minute or two: make soak"),
]
TMUX_NAMES = {
    "ctrl+s": "C-s",
    "pageup": "PageUp",
    "pagedown": "PageDown",
    "backspace": "BSpace",
    "delete": "DC",
}


def play(terminal: Terminal, step: Step) -> None:
    if step.kind == "words":
        terminal.wait(lambda screen: step.text in joined(screen))
    elif step.kind == "key" and len(step.text) > 1:
        terminal.keys(TMUX_NAMES.get(step.text, step.text.title()))
    else:
        terminal.type(f":{step.text}" if step.kind == "line" else step.text)
        if step.kind == "line":
            terminal.keys("Enter")


@pytest.mark.parametrize("page", PAGES)
def test_a_page_is_played_in_a_terminal(
    page: str, folder: Path, terminals: list[Terminal], capsys: pytest.CaptureFixture[str]
) -> None:
    for step in steps(played_text(page)):
        if step.kind != "command":
            if terminals:
                play(terminals[-1], step)
        elif opens_screen(step.text):
            command = step.text.replace("trcvtui", str(TRCVTUI), 1)
            terminals.append(Terminal(*SIZE, f"cd {folder}; exec {command}"))
            terminals[-1].wait(lambda screen: "q quit" in screen)
        else:
            output_of(step.text, capsys)
            for terminal in terminals:
                terminal.close()
            terminals.clear()
