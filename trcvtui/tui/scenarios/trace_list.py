"""What each instance has shown since the scenario began: its inputs now, and its STATUS scan by scan."""

from __future__ import annotations

from typing import Final

from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.rig.snapshots import PlayerSnapshot
from trcvtui.tui.formatting import clip, lamp, plain, wrapped
from trcvtui.tui.view_model.view_model import Scene
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row

INDENT: Final = 2


class TraceList(LineView):
    """The inputs and the newest of the trace of each instance; `tail` lines of it."""

    DEFAULT_CSS = "TraceList { height: auto; min-height: 3; }"

    def __init__(self, scene: Scene) -> None:
        super().__init__(id="traces")
        self._scene = scene
        self._rows: list[Row] = []
        self.tail = 4

    def draw(self, player: PlayerSnapshot) -> None:
        """Show the instances of the scenario that is played."""
        self.set_title(4, "STATUS, scan by scan")
        pins = {instance.name: _inputs(instance) for instance in self._scene.instances}
        self._rows = []
        for name, trace in player.traces:
            self._rows.append(row((f"{clip(plain(name), 24)}  ", "strong"), *pins.get(name, [])))
            self._rows += self._trace(trace)
        self.show()

    def _trace(self, trace: str) -> list[Row]:
        lines = wrapped(trace, max(20, self.line_width - INDENT - 4)) if trace else ("no scan yet",)
        cut = len(lines) > self.tail
        return [
            row(
                (" " * INDENT, ""),
                ("… " if cut and number == 0 else "", "faint"),
                (line, "" if trace else "dim"),
            )
            for number, line in enumerate(lines[-self.tail :])
        ]

    def row_count(self) -> int:
        """Return the number of lines."""
        return len(self._rows)

    def row_at(self, y: int) -> Row:
        """Return one line."""
        return self._rows[y] if y < len(self._rows) else EMPTY


def _inputs(instance: InstanceSnapshot) -> list[Part]:
    parts: list[Part] = []
    for pin, value in instance.inputs:
        if isinstance(value, bool):
            parts.append((f"{pin} {lamp(value)}  ", "on" if value else "faint"))
        else:
            parts.append((f"{pin} {value}  ", "dim"))
    return parts
