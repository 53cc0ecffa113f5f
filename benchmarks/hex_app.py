"""The program's own hex view over a file in memory (mmap), for M6: nothing else on the screen."""

from __future__ import annotations

import mmap
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar, Final

from textual.app import App
from textual.screen import Screen
from textual.widget import Widget
from textual.widgets import Static

import trcvtui.tui
from trcvtui.tui.widgets.hex_view import HexView
from trcvtui.tui.widgets.theme import COMPONENT_CLASSES

STYLES: Final = Path(trcvtui.tui.__file__).with_name("styles.tcss")


class HexScreen(Screen[None]):
    """One view, and one line that names the process and the rows of a page."""

    CSS: ClassVar[str] = "HexView { height: 1fr; } Static { height: 1; }"

    def __init__(self, content: mmap.mmap) -> None:
        super().__init__()
        self._view = HexView("data", shows_job=False)
        self._content = content
        self._about = Static("", markup=False)

    def compose(self) -> Iterator[Widget]:
        """Compose the view above the line."""
        yield self._view
        yield self._about

    def on_mount(self) -> None:
        """Show the bytes."""
        self._view.show_bytes(self._content, 0, frozenset())  # type: ignore[arg-type]
        self._view.focus()
        self._view.cursor = 0
        self.call_after_refresh(self._tell)

    def _tell(self) -> None:
        self._about.update(f"pid={os.getpid()} rows={max(1, self._view.size.height - 1)}")


class HexApp(App[None]):
    """The screen; q leaves."""

    CSS_PATH = STYLES
    COMPONENT_CLASSES: ClassVar[set[str]] = COMPONENT_CLASSES
    BINDINGS: ClassVar = [("q", "quit", "quit")]

    def __init__(self, content: mmap.mmap) -> None:
        super().__init__()
        self._content = content

    def get_default_screen(self) -> HexScreen:
        """Return the one screen."""
        return HexScreen(self._content)


if __name__ == "__main__":
    with open(sys.argv[1], "rb") as file:
        HexApp(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)).run()
