"""Pane 4: every change of the outputs, newest first, straight from the ledger: no scan is missed."""

from __future__ import annotations

from typing import ClassVar, Final

from textual import events

from trcvtui.plc.ledger import Line, StatusEdge
from trcvtui.tui.formatting import ON, clip, moment, plain, status_word
from trcvtui.tui.messages import EdgeSelected, PaneActions
from trcvtui.tui.view_model.explain import why
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row

WORD: Final = 14  # at least; wider where a condition or a lamp is
LAMP: Final = 7
LEAST_CONDITION, MOST_CONDITION = 19, 32  # columns; `waiting for a frame` is never cut
CURSOR: Final = "▸"
LEAST_WHY: Final = 10  # characters; less would say nothing


class StatusHistory(LineView):
    """The STATUS edges of the selected instance. A chosen edge stays chosen while newer ones come in."""

    KEYS: ClassVar = (("↑↓", "explain an edge"), ("!", "ERROR"), ("/", "code"), ("esc", "now"))
    BINDINGS: ClassVar = [
        ("exclamation_mark", "error_before", "the ERROR before"),
        ("slash", "ask_code", "find a code"),
        ("escape", "now", "back to now"),
    ]

    def __init__(self, scene: ViewModel, actions: PaneActions, digit: int = 4) -> None:
        super().__init__(id="history")
        self._digit = digit
        self._scene = scene
        self._actions = actions
        self._edges: list[Line] = []
        self._chosen: int | None = None
        self._word, self._lamp = WORD, LAMP

    def show(self) -> None:
        """Repaint what changed; a view that is scrolled into the past stays on its edges."""
        before = self._edges[0].seq if self._edges else 0
        self._edges = list(reversed(self._scene.history.of(self._scene.selected)))
        self._measure(before)
        self.set_title(self._digit, "History", self._detail())
        if self.scroll_offset.y:
            fresh = sum(1 for line in self._edges[:64] if line.seq > before) if before else 0
            self.resize_rows()
            if fresh:
                self.scroll_to(y=self.scroll_offset.y + fresh, animate=False)
        super().show()

    def _measure(self, known: int) -> None:
        """Widen the columns for the edges that have come since this one."""
        for line in self._edges:
            if line.seq <= known:
                break
            if isinstance(line.event, StatusEdge):
                self._word = max(self._word, len(self._label(line.event)))
                self._lamp = max(self._lamp, len(_lamp(line.event)))

    def _detail(self) -> str:
        if not self._scene.history.skipped:
            return ""
        return f"{self._scene.history.skipped} lines came too fast for this list"

    def _label(self, edge: StatusEdge) -> str:
        condition = self._scene.project.dialect.label(edge.condition)
        return f"{status_word(edge.outputs.status)} {clip(condition, self._condition_width())}"

    def _condition_width(self) -> int:
        """Return how wide a condition may be: the reason has the greater part of the line."""
        return max(LEAST_CONDITION, min(MOST_CONDITION, self.line_width - 65))

    def row_count(self) -> int:
        """Return the number of edges and the head."""
        return len(self._edges) + 1

    def row_at(self, y: int) -> Row:
        """Return the head or one edge."""
        if y == 0:
            return self._head()
        line = self._edges[y - 1]
        if not isinstance(line.event, StatusEdge):
            return EMPTY
        style = "cursor" if line.seq == self._chosen else ""
        return row(*self._edge(line, line.event), style=style)

    def _widths(self) -> tuple[int, int]:
        """Return the widths of scan and time, as wide as the newest edge needs."""
        newest = self._edges[0] if self._edges else None
        if newest is None:
            return 5, 7
        return max(5, len(str(newest.scan))), max(7, len(moment(newest.t_ns)))

    def _head(self) -> Row:
        scan, time = self._widths()
        why = "why" if self._room() >= LEAST_WHY else ""
        outputs = f"{'STATUS':<{self._word}}  {'lamp':<{self._lamp}}"
        return row((f" {'scan':>{scan}}  {'t in s':>{time}}  {outputs}  {why}", "dim"))

    def _room(self) -> int:
        """Return how many characters the reason may have."""
        return self.line_width - sum(self._widths()) - self._word - self._lamp - 9

    def _edge(self, line: Line, edge: StatusEdge) -> list[Part]:
        scan, time = self._widths()
        style = edge.outputs.lit
        room = self._room()
        reason = clip(plain(why(edge)), room) if room >= LEAST_WHY else ""
        return [
            (CURSOR if line.seq == self._chosen else " ", "key"),
            (f"{line.scan:>{scan}}  {moment(line.t_ns):>{time}}  ", "dim"),
            (self._label(edge).ljust(self._word + 2), style),
            (_lamp(edge).ljust(self._lamp + 2), style),
            (reason, "warn" if edge.cause.injected else "dim"),
        ]

    # -- choosing -----------------------------------------------------------------------------------

    def action_move(self, rows: int) -> None:
        """Choose an older or a newer edge; above the newest stands the present."""
        here = next((y for y, line in enumerate(self._edges) if line.seq == self._chosen), -1)
        self._choose(min(len(self._edges) - 1, here + rows))

    def action_error_before(self) -> None:
        """Choose the next older ERROR; after the oldest comes the newest."""
        here = next((y for y, line in enumerate(self._edges) if line.seq == self._chosen), -1)
        errors = [
            y for y, e in enumerate(self._edges) if isinstance(e.event, StatusEdge) and e.event.outputs.error
        ]
        if errors:
            self._choose(next((y for y in errors if y > here), errors[0]))
        else:
            self._actions.complain(f"no ERROR in what is known of {plain(self._scene.selected)}")

    def action_ask_code(self) -> None:
        """Ask for the code to find; the timing pane looks for it, and this one follows."""
        self._actions.open_prompt("find ")

    def action_now(self) -> None:
        """Go back to the present."""
        self._choose(-1)

    def on_click(self, event: events.Click) -> None:
        """Choose the edge under the mouse."""
        place = self.place_of(event)
        if place is not None and place[1] <= len(self._edges):
            self._choose(place[1] - 1)

    def _choose(self, y: int) -> None:
        self._chosen = self._edges[y].seq if y >= 0 else None
        self.resize_rows()
        self.keep_in_view(y + 1 if y >= 0 else 0)
        self.post_message(EdgeSelected(self._chosen, self.chosen()))
        self.show()

    def point_at(self, seq: int | None) -> None:
        """Follow a choice that was made in another pane; an edge older than this list leaves it alone."""
        if seq == self._chosen:
            return
        y = next((y for y, line in enumerate(self._edges) if line.seq == seq), -1)
        self._chosen = seq if y >= 0 else None
        self.keep_in_view(y + 1 if y >= 0 else 0)
        self.show()

    def forget(self) -> None:
        """Another instance was selected: back to the present."""
        self._chosen = None
        self._edges, self._word, self._lamp = [], WORD, LAMP
        self.scroll_to(y=0, animate=False)

    def chosen(self) -> Line | None:
        """Return the chosen edge."""
        return next((line for line in self._edges if line.seq == self._chosen), None)


def _lamp(edge: StatusEdge) -> str:
    if edge.outputs.error and edge.outputs.done:  # a frame that had no end in its size
        return (
            f"{ON} DONE {edge.outputs.rcvd_len} B, ERROR"
            if edge.outputs.rcvd_len is not None
            else f"{ON} DONE, ERROR"
        )
    if edge.outputs.error:
        return f"{ON} ERROR"
    if edge.outputs.done:
        return f"{ON} DONE {edge.outputs.rcvd_len} B" if edge.outputs.rcvd_len is not None else f"{ON} DONE"
    return f"{ON} BUSY" if edge.outputs.busy else ""
