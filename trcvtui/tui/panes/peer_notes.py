"""What the selected peer does by itself: its reply rules with their hits, and how the last trial ended."""

from __future__ import annotations

from trcvtui.rig.snapshots import PeerSnapshot
from trcvtui.tui.formatting import clip, plain
from trcvtui.tui.panes.peer_list import check_text
from trcvtui.tui.view_model.view_model import Scene
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Row, row

NO_RULES = "no reply rules; a: add one, such as on contains hex 05 send hex 06 {n}"


class PeerNotes(LineView, can_focus=False):
    """One line each, where the pane has room below the buttons."""

    DEFAULT_CSS = "PeerNotes { height: 1fr; }"

    def __init__(self, scene: Scene) -> None:
        super().__init__(id="peer-notes")
        self._scene = scene

    def row_count(self) -> int:
        """Return the number of lines."""
        return len(self._rows())

    def row_at(self, y: int) -> Row:
        """Return one line."""
        rows = self._rows()
        return rows[y] if y < len(rows) else EMPTY

    def _rows(self) -> list[Row]:
        peer = self._scene.peer_snapshot
        if peer is None:
            return []
        return [*self._check(peer), *self._trial(peer), *self._replies(peer)]

    def _check(self, peer: PeerSnapshot) -> list[Row]:
        return [row(check_text(peer.check))] if peer.check is not None else []

    def _trial(self, peer: PeerSnapshot) -> list[Row]:
        trial = self._scene.picture.trial if self._scene.picture else None
        if trial is None or trial.peer != peer.name:
            return []
        text = clip(plain(trial.summary()), self.line_width - 15)
        return [
            row(("every split: ", "label"), (text, "warn" if trial.differing or trial.problem else "done"))
        ]

    def _replies(self, peer: PeerSnapshot) -> list[Row]:
        if not peer.replies:
            return [row((NO_RULES, "faint"))]
        rows = []
        for number, reply in enumerate(peer.replies, 1):
            missed = f" missed {reply.missed}" if reply.missed else ""
            head, hits = f"reply {number} ", f"{reply.hits:>6}×{missed}  "
            text = clip(plain(reply.rule), self.line_width - len(head) - len(hits))
            rows.append(row((head, "label"), (hits, "on" if reply.hits else "dim"), (text, "")))
        return rows
