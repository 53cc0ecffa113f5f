"""The smallest Textual program: what the first screen of trcvtui is compared with."""

from __future__ import annotations

from textual.app import App, ComposeResult
from textual.widgets import Static


class EmptyApp(App[None]):
    """One word; `q` ends it."""

    BINDINGS = [("q", "quit", "Quit")]  # noqa: RUF012

    def compose(self) -> ComposeResult:
        """Yield the word."""
        yield Static("ready")


if __name__ == "__main__":
    EmptyApp().run()
