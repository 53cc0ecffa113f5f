"""Pane 7: the partner. Its state, what it shall send, the trouble it can make, the command for each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

from textual.containers import Vertical
from textual.widget import Widget
from textual.widgets import Input

from trcvtui.tui.formatting import clip, plain
from trcvtui.tui.peer_commands import SEND, Button, buttons_for
from trcvtui.tui.scene import Scene
from trcvtui.tui.voice import Voice
from trcvtui.tui.widgets.button_line import ButtonLine
from trcvtui.tui.widgets.composer import Composer
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Row, pane_title, row
from trcvtui.tui.widgets.peer_list import PeerList


class CommandPreview(LineView, can_focus=False):
    """The bench command that the button under the mouse, under the cursor, or Send would give."""

    DEFAULT_CSS = "CommandPreview { height: 1; }"

    def __init__(self) -> None:
        super().__init__(id="preview")
        self.line = ""
        self.fault = ""

    def row_count(self) -> int:
        """Return 1."""
        return 1

    def row_at(self, y: int) -> Row:
        """Return the command, or what is wrong with it."""
        if y:
            return EMPTY
        if self.fault:
            return row(("✗ ", "error"), (clip(plain(self.fault), self.line_width - 2), "error"))
        return row(("▸ ", "dim"), (clip(plain(self.line), self.line_width - 2), "dim"))


class PeerPanel(Vertical):
    """List, composer, buttons, preview."""

    DEFAULT_CSS = "PeerPanel { background: $surface; }"
    BINDINGS: ClassVar = [
        *[(letter, f"button('{letter}')", "") for letter in "scfrhzu"],
        ("m", "mode", "payload mode"),
        ("i", "payload", "edit the payload"),
    ]

    def __init__(self, scene: Scene, voice: Voice) -> None:
        super().__init__(id="peer")
        self._scene = scene
        self._voice = voice
        self._title = ""
        self.peers = PeerList(scene)
        self.composer = Composer(scene, voice)
        self._buttons = ButtonLine("buttons", self._labels, self._press)
        self._preview = CommandPreview()

    def compose(self) -> Iterator[Widget]:
        """Compose the pane."""
        yield self.peers
        if self._scene.project.peers:
            yield self.composer
            yield self._buttons
            yield self._preview

    async def prepare(self) -> None:
        """Make the fields of the composer."""
        if self._scene.project.peers:
            await self.composer.prepare()

    def show(self) -> None:
        """Show the peers and what the buttons would do."""
        name = plain(self._scene.peer)
        if name != self._title or not self.border_title:
            self._title = name
            self.border_title = pane_title(7, f"Peer {clip(name, 20)}")
        self.peers.show()
        if self._scene.project.peers:
            self._buttons.show()
            self._show_preview()

    def _show_preview(self) -> None:
        button, peer = self._pointed_at(), self._scene.peer_snapshot
        send = button is None or button.letter == SEND
        self._preview.fault = self.composer.fault if send else ""
        if peer is None:
            self._preview.line = ""
        elif send or button is None:
            self._preview.line = self.composer.line or f"peer {peer.name} send …"
        else:
            self._preview.line = button.line(peer)
        self._preview.show()

    def _buttons_now(self) -> tuple[Button, ...]:
        snapshot = self._scene.snapshot
        return buttons_for(bool(snapshot and snapshot.faults))

    def _pointed_at(self) -> Button | None:
        index = self._buttons.pointed_at()
        return None if index is None else self._buttons_now()[index]

    def _labels(self) -> list[tuple[str, str]]:
        peer = self._scene.peer_snapshot
        if peer is None:
            return []
        return [(button.letter, button.label(peer)) for button in self._buttons_now()]

    def _press(self, index: int) -> None:
        self._do(self._buttons_now()[index])

    def _do(self, button: Button) -> None:
        peer = self._scene.peer_snapshot
        if peer is None:
            return
        if button.letter == SEND:
            self.composer.send()
        elif button.edit:
            connection = self._scene.connection
            self._voice.open_prompt(button.line(peer) + (connection.name if connection else ""))
        else:
            self._voice.submit(button.line(peer))

    def on_input_changed(self, event: Input.Changed) -> None:
        """Show the command that the fields make now."""
        event.stop()
        self._show_preview()

    def on_button_pointed(self) -> None:
        """Show the command of that button."""
        self._show_preview()

    def action_button(self, letter: str) -> None:
        """Press the button of this letter."""
        button = next((b for b in self._buttons_now() if b.letter == letter), None)
        if button is not None:
            self._do(button)

    def action_mode(self) -> None:
        """Write the payload in another way."""
        self.composer.next_mode()

    def action_payload(self) -> None:
        """Edit the payload."""
        self.composer.edit()
