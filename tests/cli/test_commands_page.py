"""docs/commands.md names every bench command, every word of a peer and every action of keys.toml."""

from __future__ import annotations

import re
from pathlib import Path

from textual.binding import Binding

from trcvtui.commands.peer import VERBS as PEER_VERBS
from trcvtui.tui.app import BenchApp
from trcvtui.tui.completion import verbs
from trcvtui.tui.main import MainScreen
from trcvtui.tui.widgets.theme import THEMES

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
QUOTED = re.findall(r"`([^`]+)`", PAGE)


def not_in_the_page() -> list[str]:
    return [verb for verb in verbs() if not any(text.startswith(verb) for text in QUOTED)]


def test_every_command_stands_in_the_page() -> None:
    assert not_in_the_page() == []


def test_every_word_of_a_peer_stands_in_the_page() -> None:
    said = {word for text in QUOTED for word in text.split()[:3]}
    assert [verb for verb in PEER_VERBS if verb not in said] == []


def test_every_action_with_its_key_and_every_theme_stands_in_the_page() -> None:
    for binding in (*BenchApp.BINDINGS, *MainScreen.BINDINGS):
        if isinstance(binding, Binding) and binding.id:
            keys = ", ".join(f"`{key}`" for key in binding.key.split(","))
            assert f"| `{binding.id}` | {keys} |" in PAGE
    assert all(f"`{name}`" in PAGE for name in THEMES)
