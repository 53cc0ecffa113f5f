"""The last line: the few keys that matter where the focus is; each can be clicked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from textual import events
from textual.widget import Widget
from textual.widgets import Input

from trcvtui.tui.messages import KeyClicked
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row

Keys = tuple[tuple[str, str], ...]
GLOBAL: Final = (
    (":", "command"), ("space", "hold"), (".", "one scan"), ("S", "scenarios"), ("L", "lab"), ("1-8", "pane"),
    ("M", "zoom"), ("ctrl+p", "palette"), ("?", "help"), ("q", "quit"),
)  # fmt: skip
# In a text field the other keys are typed.
IN_A_FIELD: Final = (("enter", "take"), ("tab", "next"), ("esc", "leave"))
ANYWHERE: Final = (("ctrl+p", "palette"), ("F1", "help"))
ACTIONS: Final = {
    ":": "prompt", "space": "hold", ".": "single_scan", "S": "scenarios", "L": "app.lab", "M": "zoom",
    "ctrl+p": "app.command_palette", "?": "help", "q": "app.quit", "esc": "calm",
    "l": "pin('l')", "F1": "help", "A": "app.add('instance')", "E": "change",
}  # fmt: skip


class KeyLine(LineView, can_focus=False):
    """Keys of the focused pane first, then those that work everywhere, as far as they fit."""

    DEFAULT_CSS = "KeyLine { height: 1; background: $panel; padding: 0 1; }"

    def __init__(self, everywhere: Keys = GLOBAL, actions: Mapping[str, str] = ACTIONS) -> None:
        super().__init__(id="keys")
        self._everywhere = everywhere
        self._actions = actions
        self._local: Keys = ()
        self._holding = self._types = False
        self._names: Mapping[str, str] = {}  # of keys that the user has changed
        self.mouse_is_away = False

    def show_keys_of(self, focused: Widget | None, holding: bool) -> None:
        """Name the keys of what has the focus; in a text field those alone that are not typed."""
        self._types = isinstance(focused, Input)
        own = focused.keys() if isinstance(focused, LineView) else ()
        self.show_keys(getattr(focused, "KEYS", IN_A_FIELD) if self._types else own, holding)

    def show_keys(self, local: Keys, holding: bool) -> None:
        """Name these keys."""
        self._local, self._holding = local, holding
        if self._actions is ACTIONS:
            self._names = getattr(self.app, "key_names", {})
        self.show()

    def row_count(self) -> int:
        """Return 1."""
        return 1

    def _keys(self) -> list[tuple[str, str]]:
        keys = [("U", "mouse back"), *self._local] if self.mouse_is_away else list(self._local)
        for key, label in ANYWHERE if self._types else self._everywhere:
            keys.append((key, "go" if key == "space" and self._holding else label))
        keys = [(self._names.get(key, key), label) for key, label in keys]
        # The last ones, help and quit, stay; what does not fit goes from the middle.
        while len(keys) > 3 and sum(len(k) + len(label) + 3 for k, label in keys) - 2 > self.line_width:
            del keys[-3]
        return keys

    def row_at(self, y: int) -> Row:
        """Return the keys."""
        if y:
            return EMPTY
        parts: list[Part] = []
        for key, label in self._keys():
            parts += [(key, "key"), (f" {label}", "dim"), ("  ", "")]
        return row(*parts[:-1])

    def on_click(self, event: events.Click) -> None:
        """Act as if the key had been pressed."""
        place, left = self.place_of(event), 0
        old = {name: key for key, name in self._names.items()}
        for key, label in self._keys():
            width = len(key) + len(label) + 3
            action = self._actions.get(old.get(key, key))
            if place is not None and left <= place[0] < left + width - 2 and action:
                self.post_message(KeyClicked(action))
            left += width
