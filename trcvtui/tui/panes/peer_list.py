"""The peers, one line each: state, both ends, what was sent and received."""

from __future__ import annotations

from typing import ClassVar

from textual import events
from textual.binding import Binding

from trcvtui.rig.snapshots import CheckSnapshot, PeerSnapshot, Tally
from trcvtui.tui.formatting import cells, clip, count, pad, plain
from trcvtui.tui.messages import PeerSelected
from trcvtui.tui.view_model.view_model import Scene
from trcvtui.tui.widgets.line_view import LineView, Part, Row, row

ROOMY = 110
STYLES = {"connected": "on", "reset": "warn", "refused": "warn"}


class PeerList(LineView):
    """The cursor is the peer that the composer and the buttons speak for."""

    KEYS: ClassVar = (
        ("tab", "payload"), ("m", "mode"), ("x", "cuts"), ("e", "every split"), ("o", "form"), ("w", "keep"),
        ("p", "library"), ("E", "change"),
    )  # fmt: skip
    BINDINGS: ClassVar = [Binding("tab", "edit", "edit the payload", show=False)]
    DEFAULT_CSS = "PeerList { height: auto; max-height: 3; min-height: 1; }"

    def __init__(self, scene: Scene) -> None:
        super().__init__(id="peers")
        self._scene = scene

    def row_count(self) -> int:
        """Return the number of peers."""
        return max(1, len(self._scene.project.peers))

    def row_at(self, y: int) -> Row:
        """Return one peer."""
        peers = self._scene.peers
        if not self._scene.project.peers:
            return row(("no peer in this project: the partner is a real device", "dim"))
        if y >= len(peers):
            return row((f"  {plain(self._scene.project.peers[y].name)}", "dim"))
        return self._row(peers[y])

    def _row(self, peer: PeerSnapshot) -> Row:
        selected = peer.name == self._scene.peer
        style = "" if not selected else "cursor" if self.has_focus else "cursor-blurred"
        parts: list[Part] = [
            ("▸ " if selected else "  ", "key"),
            (pad(clip(plain(peer.name), 12), self._name_width()) + " ", "strong"),
            (f"{'UDP' if peer.udp else 'active' if peer.active else 'passive':<8}", "dim"),
            (f"{peer.state:<10} ", STYLES.get(peer.state, "")),
            (self._ends(peer), "dim"),
            *self._counters(peer),
        ]
        if peer.check is not None:
            text, style = check_text(peer.check)
            parts.append((f"  {text}", style))
        if peer.stalled:
            parts += [(" ", ""), (" STALLED ", "hold")]
        if peer.silent:
            parts += [(" ", ""), (" SILENT ", "stop")]
        return row(*parts, style=style)

    def _ends(self, peer: PeerSnapshot) -> str:
        roomy = self._roomy()
        width = max((cells(_ends(each, roomy)) for each in self._scene.peers), default=0)
        return pad(plain(_ends(peer, roomy)), width) + "  "

    def _name_width(self) -> int:
        return min(12, max((cells(peer.name) for peer in self._scene.peers), default=4))

    def _roomy(self) -> bool:
        return self.line_width >= ROOMY

    def _counters(self, peer: PeerSnapshot) -> list[Part]:
        if not self._roomy() or peer.check is not None:
            return [(f"sent {peer.bytes_sent}, got {peer.bytes_received} B", "")]
        parts: list[Part] = [
            (f"sent {count(peer.messages_sent, 'message')}, {peer.bytes_sent} B", ""),
            (f"  received {peer.bytes_received} B", ""),
        ]
        if peer.pending:
            parts.append((f"  {peer.pending} B on their way", "warn"))
        return parts

    def action_edit(self) -> None:
        """Go to the payload, which is what is wanted first; the way of writing it stands before it."""
        field = self.screen.query("#payload")
        self.screen.set_focus(field.first()) if field else self.screen.focus_next()

    def action_move(self, rows: int) -> None:
        """Select another peer."""
        names = [peer.name for peer in self._scene.peers]
        if self._scene.peer in names:
            self._choose(max(0, min(len(names) - 1, names.index(self._scene.peer) + rows)))

    def on_click(self, event: events.Click) -> None:
        """Select the peer under the mouse."""
        place = self.place_of(event)
        if place is not None and place[1] < len(self._scene.peers):
            self._choose(place[1])

    def _choose(self, y: int) -> None:
        self._scene.peer = self._scene.peers[y].name
        self.post_message(PeerSelected())
        self.keep_in_view(y)
        self.show()


def _ends(peer: PeerSnapshot, roomy: bool) -> str:
    if peer.state != "connected":
        return f"→ {peer.remote}" if peer.active else f"at {peer.local}"
    local = f"{peer.local} " if roomy else ""
    return f"{local}→ {peer.remote}" if peer.active else f"{local}← {peer.remote}"


def check_text(check: CheckSnapshot) -> Part:
    """Return how the self-checking traffic stands: in DATA, and what came back of it."""
    tallies = [("DATA", check.data)] if check.data is not None else []
    tallies += [("echo", check.echo)] if check.echo.frames or check.echo.shifts or not tallies else []
    is_good = all(tally.is_good for _, tally in tallies)
    told = ", ".join(f"{name} {_tally(tally)}" for name, tally in tallies)
    return f"{'✓' if is_good else '✗'} check {check.sent}: {told}", "done" if is_good else "error"


def _tally(tally: Tally) -> str:
    wrong = (("lost", tally.lost), ("double", tally.doubled), ("shift", tally.shifts))
    return " ".join([str(tally.frames), *(f"{word} {number}" for word, number in wrong if number)])
