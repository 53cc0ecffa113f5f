"""The lines of the prompt that the timing pane obeys by itself: `export timing vcd FILE` and `find 7008`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from trcvtui.errors import mistake

if TYPE_CHECKING:
    from trcvtui.tui.panes.timing import Timing

EXPORT, FIND = "export", "find"
EXPORT_LINES: Final = "export timing vcd|svg|text, perhaps a FILE"


def is_for_timing(line: str) -> bool:
    """Return whether a line is for the pane, not for the bench."""
    return line.split(maxsplit=1)[:1] in ([EXPORT], [FIND])


def obey_line(line: str, pane: Timing) -> str:
    """Carry out a line; return what to tell about it, which may be nothing; raise UserError."""
    words = line.split(maxsplit=3)
    if words[0] == FIND:
        return _find(words[1:], pane)
    if len(words) < 3 or words[1] != "timing":
        raise mistake("prompt", f"'{line}'", EXPORT_LINES)
    path = Path(words[3]).expanduser() if len(words) > 3 else None
    written, size = pane.write(words[2], path)
    return f"{size} bytes in {written.absolute()}"


def _find(words: list[str], pane: Timing) -> str:
    if len(words) != 1:
        raise mistake("prompt", f"'{' '.join([FIND, *words])}'", "find and a code such as 7008 or 16#80C5")
    text = words[0].upper().removeprefix("W#").removeprefix("16#").removeprefix("0X")
    if not 1 <= len(text) <= 4 or not all(digit in "0123456789ABCDEF" for digit in text):
        raise mistake("prompt", f"'{words[0]}'", "a code of four hexadecimal digits")
    pane.find(int(text, 16))
    return ""
