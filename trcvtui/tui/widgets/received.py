"""Pane 5: the bytes of DATA, and below them how far the job is.

A receive job: what it has collected but not delivered yet. A send job: how far its bytes have come.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from textual.containers import Vertical
from textual.content import Content
from textual.widget import Widget

from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.tui.formatting import bar, clip, plain
from trcvtui.tui.scene import Scene
from trcvtui.tui.widgets.hex_view import HexView
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, pane_title, ruled

MOST_JOB_ROWS: Final = 4
BAR: Final = 12


class JobLine(LineView, can_focus=False):
    """One line between both views: how far the job is."""

    DEFAULT_CSS = "JobLine { height: 1; }"

    def __init__(self, scene: Scene) -> None:
        super().__init__(id="job-line")
        self._scene = scene

    def row_count(self) -> int:
        """Return 1."""
        return 1

    def row_at(self, y: int) -> Row:
        """Return the line."""
        instance = self._scene.instance
        if y or instance is None:
            return EMPTY
        if instance.sends:
            return ruled(self.line_width, *self._sent(instance))
        if not instance.need:
            return ruled(self.line_width, ("── no job running ", "dim"))
        full, empty = bar(instance.have, instance.need, BAR)
        mode = "ad-hoc, at most" if instance.adhoc else "of"
        numbers = f" {instance.have} {mode} {instance.need} B "
        return ruled(
            self.line_width, ("── job ", "dim"), (full, "busy"), (empty, "faint"), (numbers, "strong"),
            ("not in DATA yet ", "dim"),
        )  # fmt: skip

    def _sent(self, instance: InstanceSnapshot) -> list[Part]:
        """Return how far the bytes of this connection have come: DONE tells of the local stack only."""
        parts: list[Part] = [("── ", "dim")]
        if instance.need:
            full, empty = bar(instance.have, instance.need, BAR)
            numbers = f" {instance.have} of {instance.need} B in the stack  "
            parts += [("job ", "dim"), (full, "busy"), (empty, "faint"), (numbers, "strong")]
        connection = self._scene.connection
        if connection is None or connection.state != "connected" or connection.udp:
            return parts if instance.need else [*parts, ("no job running ", "dim")]
        parts.append((f"{connection.bytes_sent} B accepted", "strong"))
        if connection.unacknowledged is not None:
            style = "warn" if connection.unacknowledged else "dim"
            parts.append((f" · {connection.unacknowledged} unacknowledged", style))
        for peer in self._scene.peers:
            if (peer.local, peer.remote) == (connection.remote, connection.local):
                parts.append((f" · {peer.received_here} read by {plain(peer.name)}", "dim"))
        return [*parts, (" ", "dim")]


class Received(Vertical):
    """Both hex views in one frame."""

    DEFAULT_CSS = """
    Received { background: $surface; }
    Received #data { height: 1fr; min-height: 1; }
    Received.-roomy JobLine { margin: 1 0 0 0; }
    Received #job { height: 1; display: none; }
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(id="received")
        self._scene = scene
        self.data = HexView("data", of_job=False)
        self.job = HexView("job", of_job=True)
        self._line = JobLine(scene)
        self._title = ""
        self._subtitle = ""
        self._job_rows = 0
        self._data_rows: int | None = None

    def compose(self) -> Iterator[Widget]:
        """Compose DATA above, the job below."""
        yield self.data
        yield self._line
        yield self.job

    def show(self) -> None:
        """Show the bytes of the selected instance."""
        instance = self._scene.instance
        self._show_title(instance)
        if instance is None:
            self._show_nothing()
            return
        self.data.show_bytes(self._scene.data, 0, self._starts(False))
        self._line.show()
        self._size_job(instance)
        self._stand_together()
        grown = len(self._scene.partial) > len(self.job.content)
        self.job.show_bytes(self._scene.partial, instance.need, self._starts(True))
        self._show_origin()
        if grown and not self.job.has_focus:
            self.job.keep_in_view(max(0, len(self._scene.partial) - 1) // self.job.per_row)

    def _show_nothing(self) -> None:
        """No instance is left: its bytes go with it."""
        for view in (self.data, self.job):
            view.show_bytes(b"", 0, frozenset())
        self._line.show()
        self._show_origin()

    def _starts(self, of_job: bool) -> frozenset[int]:
        return self._scene.provenance.message_starts(self._scene.selected, of_job)

    def _show_origin(self) -> None:
        view = self.job if self.job.has_focus else self.data
        byte = view.cursor
        text = "" if byte is None or byte >= len(view.content) else self._origin(view, byte)
        if text != self._subtitle:
            self._subtitle = text
            self.border_subtitle = Content(text)

    def _origin(self, view: HexView, byte: int) -> str:
        value = view.content[byte]
        text = f"byte {byte} = 16#{value:02X} = {value}"
        origin = self._scene.provenance.origin(self._scene.selected, view.of_job, byte)
        if origin is None:
            return text
        text += f" · job {origin.job.number}"
        if origin.recv is not None:
            text += f" · recv {origin.recv.number}, scan {origin.recv.scan}"
        if origin.message is not None:
            text += f" · {plain(origin.message.peer)} #{origin.message.number} byte {origin.message_byte}"
        return text

    def on_resize(self) -> None:
        """Other widths hold other numbers of bytes in a line."""
        self.show()

    def _size_job(self, instance: InstanceSnapshot) -> None:
        # Between two jobs there is a scan without one: the room stays, or the screen would jump at each DONE.
        if not instance.need and instance.pin("EN_R") and self._connected():
            return
        need = 0 if instance.sends else instance.need
        rows = min(MOST_JOB_ROWS, -(-need // self.job.per_row))
        if rows != self._job_rows:
            self._job_rows = rows
            self.job.styles.height = max(1, rows)
            self.job.display = rows > 0

    def _stand_together(self) -> None:
        """Where both fit, the job stands right under DATA, one blank line between."""
        rows = max(1, self.data.row_count())
        wanted = rows if rows + 2 + self._job_rows <= self.size.height else None
        if wanted != self._data_rows:
            self._data_rows = wanted
            self.data.styles.height = "1fr" if wanted is None else wanted
            self.set_class(wanted is not None, "-roomy")

    def _connected(self) -> bool:
        connection = self._scene.connection
        return connection is not None and connection.state == "connected"

    def _show_title(self, instance: InstanceSnapshot | None) -> None:
        declared = self._scene.declaration
        detail = f"{plain(declared.name)}, {declared.size} B" if declared else "no DATA"
        if instance is None:
            detail = ""
        name = "Sent" if instance is not None and instance.sends else "Received"
        if f"{name} {detail}" != self._title or not self.border_title:
            self._title = f"{name} {detail}"
            self.border_title = pane_title(5, name, clip(detail, 60))
