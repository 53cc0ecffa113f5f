"""The library of a project: its named messages and sequences; one is picked, and its command is sent."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import ClassVar, NamedTuple

from textual import events
from textual.binding import Binding
from textual.screen import ModalScreen
from textual.widget import Widget

from trcvtui.project.project import Project
from trcvtui.tui.formatting import clip, pad, plain
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Row, row
from trcvtui.tui.widgets.styles import COMPONENT_CLASSES

EMPTY_LIBRARY = "no [[message]] with name and text, no [[sequence]] with name and steps in this project"
KEYS_LINE = "↑↓ choose · enter send or play · esc close"
NAME = 18


class Entry(NamedTuple):
    """One line of the library and the command that it gives."""

    kind: str
    name: str
    text: str
    line: str


def entries_for(peer: str, project: Project) -> list[Entry]:
    """Return the messages that a peer may send, then the sequences."""
    messages = [
        Entry("message", m.name, m.text, f"peer {peer} send message {m.name}")
        for m in project.messages
        if m.peer in ("", peer)
    ]
    sequences = [
        Entry("sequence", s.name, " → ".join(s.steps), f"peer {peer} play {s.name}")
        for s in project.sequences
    ]
    return messages + sequences


class MessageList(LineView):
    """The entries; the cursor is the one that enter gives."""

    BINDINGS: ClassVar = [Binding("enter", "choose", show=False)]

    def __init__(self, entries: list[Entry], choose: Callable[[str], None]) -> None:
        super().__init__(id="messages")
        self._entries = entries
        self._choose = choose
        self.cursor = 0

    def row_count(self) -> int:
        """Return the number of entries."""
        return max(1, len(self._entries))

    def row_at(self, y: int) -> Row:
        """Return one entry."""
        if not self._entries:
            return row((EMPTY_LIBRARY, "dim")) if y == 0 else EMPTY
        entry, is_chosen = self._entries[y], y == self.cursor
        return row(
            ("▸ " if is_chosen else "  ", "key"),
            (f"{entry.kind:<10}", "label"),
            (pad(clip(plain(entry.name), NAME - 1), NAME), "strong"),
            (plain(entry.text), "dim"),
            style="cursor" if is_chosen else "",
        )

    def action_move(self, rows: int) -> None:
        """Go to another entry."""
        self.cursor = max(0, min(len(self._entries) - 1, self.cursor + rows))
        self.scroll_to(y=max(0, self.cursor - self.size.height + 1), animate=False)
        self.show()

    def on_click(self, event: events.Click) -> None:
        """Choose the entry under the mouse; a second click gives it."""
        place = self.place_of(event)
        if place is not None and place[1] < len(self._entries):
            again = place[1] == self.cursor
            self.action_move(place[1] - self.cursor)
            if again:
                self.action_choose()

    def action_choose(self) -> None:
        """Give the command of the entry."""
        if self._entries:
            self._choose(self._entries[self.cursor].line)


class MessagesScreen(ModalScreen[str]):
    """Ends with the command of the entry that was picked, "" where none was."""

    BINDINGS: ClassVar = [Binding("escape,q", "close", show=False)]
    COMPONENT_CLASSES: ClassVar[set[str]] = COMPONENT_CLASSES
    DEFAULT_CSS = """
    MessagesScreen { align: center middle; background: $background 60%; }
    MessagesScreen MessageList {
        width: 110; max-width: 100%; height: 60%; border: round $border; padding: 0 1;
        border-subtitle-color: $text-muted;
    }
    """

    def __init__(self, peer: str, project: Project) -> None:
        super().__init__()
        self._list = MessageList(entries_for(peer, project), self._chosen)
        self._list.set_title(None, f"Messages of {plain(peer)}", "")
        self._list.border_subtitle = KEYS_LINE

    def compose(self) -> Iterator[Widget]:
        """Compose the list."""
        yield self._list

    def _chosen(self, line: str) -> None:
        self.dismiss(line)

    def action_close(self) -> None:
        """Pick none."""
        self.dismiss("")
