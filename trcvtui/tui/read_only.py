"""What a read-only screen may do: this list, and nothing else.

Rule: closed by default. A command or a screen that is not named here is refused; a new one too.
The files of the screen's process and of its engine are closed beside that (`files.close_files`).
"""

from __future__ import annotations

from typing import Final

LINES: Final = frozenset(("expect", "find"))  # first words: they compare what is shown, and go to an edge
REFUSED: Final = "this screen is read-only; `trcvtui serve --write`, or `run` without --read-only, commands"


def may_say(line: str) -> bool:
    """Return whether a line of the prompt, of a key or of a button is allowed."""
    return line.strip().partition(" ")[0] in LINES


def may_open(screen: object) -> bool:
    """Return whether a screen may be opened above the panes: it shows, and opens no file."""
    from textual.command import CommandPalette

    from trcvtui.tui.forms.description import DescriptionScreen
    from trcvtui.tui.main import MainScreen
    from trcvtui.tui.widgets.help import HelpScreen

    return isinstance(screen, MainScreen | HelpScreen | DescriptionScreen | CommandPalette)
