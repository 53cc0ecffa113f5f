"""In pane 7, for simulated lines: what arrives on them, typed, again, byte by byte; and the cable pulled."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Final

from textual.binding import Binding

from trcvtui.errors import UserError
from trcvtui.plc.snapshot import ComBufferSnapshot
from trcvtui.project.project import SERIAL, SIMULATED
from trcvtui.rig.commands.words import FeedLine
from trcvtui.tui.formatting import bar, clip, pad, plain
from trcvtui.tui.messages import PaneActions
from trcvtui.tui.panes.framer import source_words
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row

FEED: Final = "feed"
BAR: Final = 10
LONGEST: Final = 65_536  # bytes that are kept to be fed again
GONE: Final = "›"  # after the bytes of a message that have been fed


class LineFeed(LineView):
    """One line a ComBuffer; below them the last bytes that were fed to the one under the cursor."""

    KEYS: ClassVar = (
        ("enter", "type bytes"), ("s", "again"), ("→", "next byte"), ("b", "break"), ("↑↓", "line"),
    )  # fmt: skip
    BINDINGS: ClassVar = [
        Binding("enter,i", "type", show=False),
        Binding("s", "again", show=False),
        Binding("right", "piece", show=False),
        Binding("left", "back", show=False),
        Binding("b", "break", show=False),
    ]
    DEFAULT_CSS = "LineFeed { height: auto; max-height: 8; min-height: 1; }"

    def __init__(self, scene: ViewModel, actions: PaneActions) -> None:
        super().__init__(id="lines")
        self._scene = scene
        self._actions = actions
        self._cursor = 0
        self._fed: dict[str, tuple[bytes, int]] = {}  # by ComBuffer: the message, how much of it went in

    @property
    def names(self) -> list[str]:
        """Return the lines that can be fed."""
        return [
            b.name for b in self._scene.project.combuffers if b.source in (SIMULATED, SERIAL) and not b.line
        ]

    @property
    def chosen(self) -> str:
        """Return the line under the cursor."""
        names = self.names
        return names[min(self._cursor, len(names) - 1)] if names else ""

    def row_count(self) -> int:
        """Return the lines, the message and what the keys do."""
        return len(self.names) + 2 if self.names else 0

    def row_at(self, y: int) -> Row:
        """Return one line."""
        names = self.names
        if y < len(names):
            return self._line(names[y])
        if y == len(names):
            return self._message()
        if y == len(names) + 1:
            keys = "enter: type bytes · s: again · →: byte by byte · b: the cable is pulled"
            return row((clip(keys, self.line_width), "dim"))
        return EMPTY

    def _line(self, name: str) -> Row:
        chosen = name == self.chosen
        parts: list[Part] = [("▸ " if chosen else "  ", "key"), (pad(clip(plain(name), 12), 13), "strong")]
        snapshot = self._scene.snapshot
        buffer = snapshot.combuffer(name) if snapshot is not None else None
        if buffer is not None:
            parts += _filled(buffer)
        style = self.cursor_style(chosen)
        return row(*parts, style=style)

    def _message(self) -> Row:
        payload, gone = self._fed.get(self.chosen, (b"", 0))
        if not payload:
            return row(("  nothing was fed yet", "dim"))
        room = max(4, (self.line_width - 26) // 3)
        first = max(0, min(gone - room // 2, len(payload) - room))
        before, after = payload[first:gone].hex(" "), payload[gone : first + room].hex(" ")
        lead, tail = "…" * (first > 0), "…" * (first + room < len(payload))
        told = f"  {gone} of {len(payload)} B fed"
        parts: list[Part] = [("  last  ", "dim"), (lead + before, ""), (GONE, "key")]
        return row(*parts, (after + tail, "ghost"), (told, "dim"))

    # -- what is fed -------------------------------------------------------------------------------------

    def heard(self, submit: Callable[[str], None]) -> Callable[[str], None]:
        """Return `submit`, listening for bytes that are fed from the prompt."""

        def say(line: str) -> None:
            self._hear(line)
            submit(line)

        return say

    def _hear(self, line: str) -> None:
        if not line.startswith(f"{FEED} "):
            return
        from trcvtui.rig.commands.table import parse_line  # read when the first line is fed

        try:
            command = parse_line(line, self._scene.project, FEED)
        except UserError:
            return  # the engine says what is wrong
        if isinstance(command, FeedLine) and command.payload and len(command.payload) <= LONGEST:
            self._fed[command.buffer] = command.payload, len(command.payload)
            self.show()

    def action_type(self) -> None:
        """Open the prompt for the bytes."""
        if self.chosen:
            self._actions.open_prompt(f"{FEED} {self.chosen} hex ")

    def action_again(self) -> None:
        """Feed the last message once more."""
        payload, _ = self._fed.get(self.chosen, (b"", 0))
        self._feed(payload, len(payload))

    def action_piece(self) -> None:
        """Feed the next byte of the message; after its end it begins anew."""
        payload, gone = self._fed.get(self.chosen, (b"", 0))
        place = gone % len(payload) if payload else 0
        self._feed(payload, place + 1, place)

    def action_back(self) -> None:
        """Begin anew with the first byte."""
        payload, _ = self._fed.get(self.chosen, (b"", 0))
        self._fed[self.chosen] = payload, 0
        self.show()

    def _feed(self, payload: bytes, stop: int, start: int = 0) -> None:
        if not payload:
            self.action_type()
            return
        self._fed[self.chosen] = payload, stop
        self._actions.submit(f"{FEED} {self.chosen} hex {payload[start:stop].hex(' ')}")
        self.show()

    def action_break(self) -> None:
        """Pull the cable: a frame that is half here has no end."""
        if self.chosen:
            self._actions.submit(f"{FEED} {self.chosen} break")

    def action_move(self, rows: int) -> None:
        """Choose another line."""
        self._cursor = max(0, min(len(self.names) - 1, self._cursor + rows))
        self.show()


def _filled(buffer: ComBufferSnapshot) -> list[Part]:
    full, empty = bar(buffer.count, buffer.size, BAR)
    return [
        (f"{source_words(buffer)}  ", "dim"), (full, "busy"), (empty, "faint"),
        (f" {buffer.count}/{buffer.size} B", ""), (f"  {buffer.arrived} B arrived", "dim"),
        (f"  {buffer.lost} lost" if buffer.lost else "", "error"),
    ]  # fmt: skip
