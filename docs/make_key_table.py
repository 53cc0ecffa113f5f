"""Write `docs/keys.md`: the keys of the help (`?`), keys.toml and config.toml: `make atlas`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from textual.binding import Binding

from trcvtui.tui.app import BenchApp
from trcvtui.tui.main import MainScreen
from trcvtui.tui.widgets.help import HELP_SECTIONS, SIGNS, TIME_LINE_KEYS, KeyTable
from trcvtui.tui.widgets.theme import OWN_THEMES, THEMES

PAGE: Final = Path(__file__).parent / "keys.md"
HEAD: Final = """\
# Keys, keys.toml and config.toml

The help (`?`) shows these keys, those of the pane with the focus first. `make atlas` writes this page.
"""
KEYS: Final = """
## keys.toml

`keys.toml` gives actions other keys: `action = "key"`, or a list of keys. A key is one character, or a name
such as `f5`, `ctrl+k` or `pageup`. Lower-case letters, digits, tab, enter, esc and arrows belong to the pins
and the panes: no action can take one that it does not have below. The tables above say what an action does.

The file is in the folder of your settings (Linux: `~/.config/trcvtui`), beside `config.toml`. The prompt
shows a mistake in either file when the screen opens; the top of the help (`?`) lists all of them.

| action | key |
| --- | --- |
"""
NOTES: Final = """
- `add` proposes parts that are free, also a CONNECT of the other direction, else `new`, which makes one.
- `yank` offers what the pane shows, DATA, the running job or a job of the past; its title names it.
- `restart` after the end of the engine keeps the unsaved additions, the inputs (without a new edge) and what
  TCON had built.
"""
THEME: Final = """
## config.toml

It has one key, `theme`. `--theme` wins over it. With NO_COLOR in the environment the theme is `ansi`.

- Own themes: {own}. `ansi` has the 16 colours of the terminal, and is the default where it has no more.
- Themes of Textual: {others}.
"""


def page() -> str:
    """Return the page."""
    themes = {name: f"`{name}`" for name in THEMES}
    own = ", ".join(themes.pop(name) for name in OWN_THEMES)
    last = THEME.format(own=own, others=", ".join(themes.values()))
    return HEAD + "".join(line + "\n" for line in _tables()) + KEYS + "".join(_actions()) + NOTES + last


def _tables() -> Iterator[str]:
    sections = [
        *((title, table) for title, _, table in HELP_SECTIONS),
        ("Time line of a recording", TIME_LINE_KEYS),
    ]
    for title, table in sections:
        yield from _table(title, "key", table)
    yield from _table("Signs", "sign", SIGNS)


def _table(title: str, first: str, table: KeyTable) -> Iterator[str]:
    does = "does" if first == "key" else "means"
    yield from ("", f"## {title}", "", f"| {first} | {does} |", "| --- | --- |")
    yield from (f"| {_cell(shown)} | {_cell(what)} |" for shown, what in table)


def _actions() -> Iterator[str]:
    for binding in (*BenchApp.BINDINGS, *MainScreen.BINDINGS):
        if isinstance(binding, Binding) and binding.id:
            keys = ", ".join(f"`{key}`" for key in binding.key.split(","))
            yield f"| `{binding.id}` | {keys} |\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("*", "\\*")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
