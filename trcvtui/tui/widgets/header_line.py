"""The first line: which file, dialect and model; whether scans pass, and how punctually."""

from __future__ import annotations

from typing import Final, NamedTuple

from trcvtui.tui.formatting import clip, count, plain, short_time
from trcvtui.tui.view_model.view_model import Scene
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row
from trcvtui.udt.literals import format_time

MOST_TRIGGER: Final = 36


class Piece(NamedTuple):
    """One word of the header; those with the highest `rank` give way first on a narrow screen."""

    text: str
    style: str
    rank: int


class HeaderLine(LineView, can_focus=False):
    """One line that never scrolls."""

    DEFAULT_CSS = "HeaderLine { height: 1; background: $panel; padding: 0 1; }"

    def __init__(self, scene: Scene) -> None:
        super().__init__(id="header")
        self._scene = scene
        self.ended = False

    def row_count(self) -> int:
        """Return 1."""
        return 1

    def row_at(self, y: int) -> Row:
        """Return the line, with as many words as fit."""
        if y:
            return EMPTY
        pieces = self._pieces()
        while len(pieces) > 1 and _length(pieces) > self.line_width:
            pieces.remove(max(pieces, key=lambda piece: piece.rank))
        return row(*_spaced(pieces))

    def _pieces(self) -> list[Piece]:
        project, picture = self._scene.project, self._scene.picture
        name = plain(project.path.name)
        pieces = [Piece("trcvtui", "dim", 60), Piece(name, "strong", 10)]
        pieces.append(Piece(f"{project.dialect.name} {project.model}", "", 20))
        if self._scene.unsaved:
            pieces.append(Piece(f"+{self._scene.unsaved} unsaved", "warn", 15))
        if self.ended:
            return [*pieces, Piece(" ENGINE ENDED ", "stop", 0)]
        if picture is None:
            return [*pieces, Piece("the engine starts …", "dim", 5)]
        if picture.player is not None:
            count_of, at = len(picture.player.steps), picture.player.current + 1
            pieces.append(Piece(f"scenario, step {min(at, count_of)} of {count_of}", "warn", 4))
        snapshot, timing = picture.snapshot, picture.timing
        pieces += self._frozen()
        now = self._scene.live or picture
        pieces.append(_state(now.snapshot.running, now.holding))
        pieces.append(Piece(format_time(snapshot.interval_ns), "", 30))
        live = "live at " if self._scene.is_frozen else ""
        pieces.append(Piece(f"{live}scan {now.snapshot.scan}", "", 2))
        if now.armed:
            pieces.append(Piece(f"trigger armed: {clip(plain(now.armed), MOST_TRIGGER)}", "warn", 3))
        pieces.append(Piece(f"p99 late {short_time(timing.late_p99_ns)}", "dim", 40))
        style = "warn" if timing.overruns else "dim"
        pieces.append(Piece(count(timing.overruns, "overrun"), style, 35))
        pieces.append(Piece(picture.kernel, "dim", 4))
        if snapshot.connections_limit:
            used = f"{snapshot.connections_used}/{snapshot.connections_limit} connections"
            pieces.append(Piece(used, "dim", 70))
        if snapshot.faults:
            pieces.append(Piece(f" {count(len(snapshot.faults), 'FAULT')} ARMED ".upper(), "hold", 3))
        return pieces

    def _frozen(self) -> list[Piece]:
        """Say loudly that what is shown is not what is now."""
        scene = self._scene
        if not scene.is_frozen or scene.picture is None:
            return []
        chip = f" * FROZEN at scan {scene.picture.snapshot.scan} *  F live "
        if scene.fired is None:
            return [Piece(chip, "stop", 0)]
        text = f" TRIGGER {clip(plain(scene.fired.text), MOST_TRIGGER)} "
        return [Piece(text, "hold", 1), Piece(chip, "stop", 0)]


def _state(running: bool, holding: bool) -> Piece:
    if not running:
        return Piece(" ■ STOP ", "stop", 0)
    return Piece(" ‖ HOLD ", "hold", 0) if holding else Piece(" ▶ RUN ", "run", 0)


def _spaced(pieces: list[Piece]) -> list[Part]:
    parts: list[Part] = []
    for before, piece in zip([None, *pieces], pieces, strict=False):
        if before is not None:
            chip = "ARMED" in piece.text or before.rank == 0 or piece.rank == 0
            parts.append(("  " if chip else " · ", "faint"))
        parts.append((piece.text, piece.style))
    return parts


def _length(pieces: list[Piece]) -> int:
    return sum(len(text) for text, _ in _spaced(pieces))
