"""The lines on top of the lab: which type and bytes, and how either side lays it out; a click changes it."""

from __future__ import annotations

from typing import Final

from textual import events

from trcvtui.tui.formatting import clip, plain
from trcvtui.tui.lab_model.lab import OURS, THEIRS, Lab
from trcvtui.tui.messages import KeyClicked
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Row, row

MOST_COMPARED: Final = 256  # rows of a type whose differences are counted with each picture
ACTIONS: Final = ("type", "profile('ours')", "profile('theirs')")


class LabHead(LineView, can_focus=False):
    """Three lines."""

    DEFAULT_CSS = "LabHead { height: 3; background: $background; padding: 0 1; }"

    def __init__(self, lab: Lab) -> None:
        super().__init__(id="lab-head")
        self._lab = lab
        self._half = 40

    def row_count(self) -> int:
        """Return 3."""
        return 3

    def row_at(self, y: int) -> Row:
        """Return one of them."""
        if y == 0:
            return self._what()
        return self._side(OURS, "oES") if y == 1 else self._side(THEIRS, "pes") if y == 2 else EMPTY

    def _what(self) -> Row:
        lab = self._lab
        name = plain(lab.type_name) or "no type"
        text = f" {clip(name, 28)} of {clip(plain(lab.files.name), 24)}"
        self._half = len(text) + 10
        return row(
            ("t", "key"), (" type  ", "dim"), (text, "strong"), ("   ", ""),
            ("b", "key"), (" bytes ", "dim"), (lab.bytes.name, "strong"),
        )  # fmt: skip

    def _side(self, side: str, keys: str) -> Row:
        profile, layout = self._lab.profiles[side], self._lab.layout(side)
        size = f" · {layout.size} B" if layout is not None else " · cannot be laid out so"
        said = self._verdict() if side == THEIRS else ""
        return row(
            (keys[0], "key"), (f" {side:<7}", "dim"), (profile.layout, "strong"), (" · ", "dim"),
            (keys[1], "key"), (f" {profile.byte_order}-endian", "strong"), (" · ", "dim"),
            (keys[2], "key"), (f" STRING {profile.text}", "strong"), (size, "strong"),
            (f"  {said}", "warn" if said.startswith("≠") else "dim"),
        )  # fmt: skip

    def _verdict(self) -> str:
        comparison, tree = self._lab.comparison(), self._lab.tree
        if comparison is None or tree is None:
            return ""
        if comparison.row_count <= MOST_COMPARED:
            found = self._lab.summary()
            differing = found.differing if found is not None else 0
            sign = "≠" if differing else "="
            return f"{sign} {differing} of {comparison.row_count} differ" if differing else "= no difference"
        return "= the same places" if tree.root.is_same else "≠ places differ"

    def on_click(self, event: events.Click) -> None:
        """Open the list for what was clicked."""
        place = self.place_of(event)
        if place is not None and place[1] < len(ACTIONS):
            is_bytes = place[1] == 0 and place[0] > self._half
            self.post_message(KeyClicked("bytes" if is_bytes else ACTIONS[place[1]]))
