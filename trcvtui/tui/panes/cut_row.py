"""A message drawn as hex cells with its cuts: keys and mouse place a cut between two bytes, and its pause."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Final

from textual import events
from textual.binding import Binding

from trcvtui.tui.formatting import count
from trcvtui.tui.panes.splits import Cuts
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row

CELL: Final = 3  # two digits and the place before them
NO_MESSAGE: Final = "no message yet: its bytes and cuts stand here"
CUT, HERE, BOTH = "┃", "╎", "╂"


class CutRow(LineView):
    """`changed` is told the cuts after every change; `payload` and `cuts` are what is drawn."""

    DEFAULT_CSS = "CutRow { height: 1; }"
    KEYS: ClassVar = (("←→", "place"), ("space", "cut or join"), ("+ -", "pause"), ("del", "no cuts"))
    BINDINGS: ClassVar = [
        Binding("left", "place(-1)", show=False),
        Binding("right", "place(1)", show=False),
        Binding("home", "edge(-1)", show=False),
        Binding("end", "edge(1)", show=False),
        Binding("space", "cut", "cut the message here, or join it", show=False),
        Binding("plus,equals_sign", "pause(1)", "a longer pause at this cut", show=False),
        Binding("minus", "pause(-1)", "a shorter pause at this cut", show=False),
        Binding("delete,backspace", "join", "take all cuts away", show=False),
        Binding("enter", "send", "send the message as it is cut", show=False),
    ]

    def __init__(self, changed: Callable[[Cuts], None], send: Callable[[], None]) -> None:
        super().__init__(id="cuts")
        self._changed = changed
        self._send = send
        self.payload = b""
        self.cuts = Cuts()
        self.place = 1  # the cursor stands before this byte
        self._first = 0  # the first byte in view

    def draw(self, payload: bytes, cuts: Cuts) -> None:
        """Draw this message with these cuts."""
        self.payload, self.cuts = payload, cuts
        self.place = max(1, min(self.place, len(payload) - 1))
        self.show()

    # -- what stands there --------------------------------------------------------------------------

    def row_count(self) -> int:
        """Return 1."""
        return 1

    def row_at(self, y: int) -> Row:
        """Return the cells in view, and what the cut under the cursor is."""
        if y:
            return EMPTY
        if not self.payload:
            return row((NO_MESSAGE, "faint"))
        self._keep_in_view()
        parts: list[Part] = [("‥" if self._first else " ", "dim")]
        last = min(len(self.payload), self._first + self._room())
        for at in range(self._first, last):
            if at > self._first:
                parts.append(self._before(at))
            parts.append((f"{self.payload[at]:02X}", "" if self._in_even_chunk(at) else "strong"))
        parts.append(("‥" if last < len(self.payload) else " ", "dim"))
        return row(*parts, (f" {self._told()}", "dim"))

    def _before(self, at: int) -> Part:
        is_cut, is_here = at in self.cuts.places, self.has_focus and at == self.place
        sign = BOTH if is_cut and is_here else CUT if is_cut else HERE if is_here else " "
        return sign, "key cursor" if is_here else "key"

    def _in_even_chunk(self, at: int) -> bool:
        return sum(place <= at for place in self.cuts.places) % 2 == 0

    def _told(self) -> str:
        size = count(len(self.payload), "byte")
        if not self.has_focus:
            return f"{size} in {count(len(self.cuts.places) + 1, 'piece')}"
        if self.place not in self.cuts.places:
            return f"{size}, space cuts at {self.place}"
        return f"{size}, cut at {self.place}, pause {self.cuts.pause_text(self.place)}"

    def _room(self) -> int:
        return max(1, (self.line_width - 2 - len(f" {self._told()}") + 1) // CELL)

    def _keep_in_view(self) -> None:
        room = self._room()
        if self.place <= self._first:
            self._first = max(0, self.place - 1)
        elif self.place >= self._first + room:
            self._first = self.place - room + 1
        self._first = max(0, min(self._first, len(self.payload) - room))

    # -- what keys and mouse do ---------------------------------------------------------------------

    def action_place(self, step: int) -> None:
        """Go to the next place between two bytes."""
        self._go(self.place + step)

    def action_edge(self, side: int) -> None:
        """Go behind the first byte, or before the last."""
        self._go(1 if side < 0 else len(self.payload) - 1)

    def _go(self, place: int) -> None:
        self.place = max(1, min(place, len(self.payload) - 1))
        self.show()

    def action_cut(self) -> None:
        """Cut here, or join what is cut here."""
        if len(self.payload) > 1:
            self._changed(self.cuts.toggled(self.place))

    def action_pause(self, step: int) -> None:
        """Make the pause of this cut longer or shorter."""
        if self.place in self.cuts.places:
            self._changed(self.cuts.paused(self.place, step))

    def action_join(self) -> None:
        """Take all cuts away."""
        self._changed(Cuts())

    def action_send(self) -> None:
        """Send the message as it is drawn."""
        self._send()

    def on_click(self, event: events.Click) -> None:
        """Cut or join where the mouse points between two bytes; on a byte: before it."""
        found = self.place_of(event)
        if found is None or not self.payload:
            return
        place = self._first + found[0] // CELL
        if 0 < place < len(self.payload) and place < self._first + self._room():
            self.place = place
            self.action_cut()

    def on_focus(self) -> None:
        """Show the cursor."""
        self.show()

    def on_blur(self) -> None:
        """Hide the cursor."""
        self.show()
