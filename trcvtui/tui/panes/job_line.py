"""The lines inside pane 5: how far the job is, and below the stream where the selected byte came from."""

from __future__ import annotations

from typing import Final

from trcvtui.plc.snapshot import FramerSnapshot, InstanceSnapshot
from trcvtui.tui.formatting import bar, clip, plain, wrapped
from trcvtui.tui.panes.gap_timer import gap_of, gap_parts
from trcvtui.tui.view_model.view_model import Scene
from trcvtui.tui.widgets.frame_marks import CLOSES, OPENS
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row, ruled

BAR: Final = 12
GAP_BESIDE: Final = 74  # columns in which the gap timer stands beside the unfinished frame
ROOMY: Final = 100


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
        if instance.framer is not None:
            return ruled(self.line_width, *self._framed(instance, instance.framer))
        if not instance.need:
            return ruled(self.line_width, ("── no job running ", "dim"))
        full, empty = bar(instance.have, instance.need, BAR)
        mode = "ad-hoc, at most" if instance.adhoc else "of"
        numbers = f" {instance.have} {mode} {instance.need} B "
        return ruled(
            self.line_width, ("── job ", "dim"), (full, "busy"), (empty, "faint"), (numbers, "strong"),
            ("not in DATA yet ", "dim"),
        )  # fmt: skip

    def _framed(self, instance: InstanceSnapshot, framer: FramerSnapshot) -> list[Part]:
        """Return how the frame stands that has no end yet; without one, what the newest frame is made of."""
        if instance.busy:
            full, empty = bar(instance.have, framer.size, BAR)
            told: list[Part] = [
                ("── unfinished ", "dim"), (full, "busy"), (empty, "faint"),
                (f" {instance.have} of ≤{framer.size} B ", "strong"),
            ]  # fmt: skip
            gap = gap_of(self._scene, instance)
            if gap is not None and gap.limit_ns and self.line_width >= GAP_BESIDE:
                told += [("· gap ", "dim"), *gap_parts(gap), (" ", "")]
            return told
        last = framer.last
        if last is None:
            return [("── no frame has begun ", "dim")]
        data = last.size - last.prefix - last.suffix
        marks = f"prefix {last.prefix} {OPENS} data {data} {CLOSES} suffix {last.suffix}"
        style = "dim" if last.is_good else "warn"
        return [("── ", "dim"), (f"frame of {last.size} B", "strong"), (f" · {marks} · ", "dim"),
                (f"ended by: {last.ending} ", style)]  # fmt: skip

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


class OriginLine(LineView, can_focus=False):
    """Below the stream: where the selected byte came from, or what has become of a search."""

    DEFAULT_CSS = "OriginLine { height: 1; display: none; }"

    def __init__(self) -> None:
        super().__init__(id="origin-line")
        self.text = ""

    def row_count(self) -> int:
        """Return 1, on a narrow pane 2."""
        return 1 if self.line_width >= ROOMY else 2

    def row_at(self, y: int) -> Row:
        """Return one line."""
        texts = wrapped(self.text, self.line_width) if self.row_count() > 1 else (self.text,)
        return row((clip(texts[y], self.line_width), "strong")) if y < len(texts) else EMPTY

    def on_resize(self) -> None:
        """Take the room that the words need."""
        self.styles.height = self.row_count()
        self.show()

    def say(self, text: str) -> None:
        """Show another text."""
        self.text = text
        self.show()
