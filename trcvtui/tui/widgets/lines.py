"""The lines of a screen: buttons, outcome, keys, tabs, and a header with file, dialect, model and scans."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, Final, NamedTuple

from textual import events
from textual.widget import Widget
from textual.widgets import Input

from trcvtui.snapshots.conversations import ARMED_TAP, TAP
from trcvtui.tui.formatting import SECOND, clip, wrap_text
from trcvtui.tui.messages import ButtonPointed, KeyClicked
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import LineView, OneLine, Part, Row, row
from trcvtui.udt.literals import format_duration
from trcvtui.wording import count, format_ns


class ButtonLine(LineView):
    """`labels` returns (letter, label) pairs. `press` gets an index. `chosen` returns the chosen index."""

    DEFAULT_CSS = "ButtonLine { height: auto; }"
    KEYS: ClassVar = (("←→", "button"), ("enter", "press"))
    BINDINGS: ClassVar = [
        ("left", "move(-1)", "left"),
        ("right", "move(1)", "right"),
        ("enter", "press", "press"),
    ]

    def __init__(
        self,
        id: str,
        labels: Callable[[], Sequence[tuple[str, str]]],
        press: Callable[[int], None],
        chosen: Callable[[], int] | None = None,
    ) -> None:
        super().__init__(id=id)
        self._labels, self._press, self._chosen = labels, press, chosen
        self.cursor = 0
        self.hover: int | None = None
        self._pointed: int | None = None

    def show(self) -> None:
        if (pointed := self.pointed_index()) != self._pointed:
            self._pointed = pointed
            self.post_message(ButtonPointed())
        super().show()

    def row_count(self) -> int:
        return max((line for _, line, _, _ in self._button_places()), default=0) + 1

    def _button_places(self) -> list[tuple[int, int, int, int]]:
        places, line, left = [], 0, 0
        for index, (letter, label) in enumerate(self._labels()):
            width = len(letter) + len(label) + (3 if letter else 2)
            if left and left + width > self.line_width > 0:
                line, left = line + 1, 0
            places.append((index, line, left, width))
            left += width + 1
        return places

    def row_at(self, y: int) -> Row:
        labels = self._labels()
        parts: list[Part] = []
        for index, line, _, _ in self._button_places():
            if line != y:
                continue
            letter, label = labels[index]
            style = self._style(index)
            chosen = self._chosen is not None and index == self._chosen()
            edge = f"{'key' if chosen else 'faint'} {style}"
            parts += [("▸" if chosen else "[", edge), (letter, f"key {style}")]
            parts += [(f" {label}" if letter else label, style), ("◂" if chosen else "]", edge), (" ", "")]
        return row(*parts)

    def _style(self, index: int) -> str:
        if self._chosen is not None and index == self._chosen():
            return "cursor strong" if self.has_focus else "cursor-blurred strong"
        if self._chosen is None and self.has_focus and index == self.cursor:
            return "cursor"
        return "hover" if index == self.hover else ""

    def pointed_index(self) -> int | None:
        """Return the button under the mouse, else the button under the cursor of a focused line."""
        return self.hover if self.hover is not None else self.cursor if self.has_focus else None

    def action_move(self, count: int) -> None:
        """Move the cursor; in a line with a selected button, select the button that the cursor reaches."""
        here = self._chosen() if self._chosen else self.cursor
        self.cursor = (here + count) % len(self._labels())
        if self._chosen is not None:
            self._press(self.cursor)
        self.show()

    def action_press(self) -> None:
        self._press(min(self.cursor, len(self._labels()) - 1))
        self.show()

    def on_click(self, event: events.Click) -> None:
        index = self._index_at(event)
        if index is not None:
            self.cursor = index
            self.action_press()

    def on_mouse_move(self, event: events.MouseMove) -> None:
        self.hover = self._index_at(event)
        self.show()

    def on_leave(self) -> None:
        self.hover = None
        self.show()

    def _index_at(self, event: events.MouseEvent) -> int | None:
        place = self.place_of(event)
        if place is None:
            return None
        found = (
            index
            for index, line, left, width in self._button_places()
            if line == place[1] and left <= place[0] < left + width
        )
        return next(found, None)


MOST_OUTCOME_ROWS: Final = 3


class OutcomeLine(LineView, can_focus=False):
    """The outcome of a command: a sentence and its style."""

    DEFAULT_CSS = "OutcomeLine { height: 1; background: $background; padding: 0 1; }"

    def __init__(self) -> None:
        super().__init__(id="outcome")
        self._outcome = "", ""
        self._rows = 1

    def write(self, words: str, style: str = "dim") -> None:
        self._outcome = words, style
        self._fit_height()

    def _fit_height(self) -> None:
        rows = self.row_count()
        if rows != self._rows:
            self._rows = self.styles.height = rows
        self.show()

    def on_resize(self) -> None:
        self._fit_height()

    def _texts(self) -> tuple[str, ...]:
        return wrap_text(self._outcome[0], self.line_width or 80)[:MOST_OUTCOME_ROWS]

    def row_count(self) -> int:
        return len(self._texts())

    def row_at(self, y: int) -> Row:
        return row((self._texts()[y], self._outcome[1]))


Keys = tuple[tuple[str, str], ...]
GLOBAL_KEYS: Final = (
    (":", "command"), ("space", "hold"), (".", "one scan"), ("S", "scenarios"), ("L", "lab"), ("1-8", "pane"),
    ("M", "zoom"), ("ctrl+p", "palette"), ("?", "help"), ("q", "quit"),
)  # fmt: skip
# In a text field the other keys are typed.
FIELD_KEYS: Final = (("enter", "take"), ("tab", "next"), ("esc", "leave"))
TYPING_KEYS: Final = (("ctrl+p", "palette"), ("F1", "help"))
KEY_ACTIONS: Final = {
    ":": "prompt", "space": "hold", ".": "single_scan", "S": "scenarios", "L": "app.lab", "M": "zoom",
    "ctrl+p": "app.command_palette", "?": "help", "q": "app.quit", "esc": "calm",
    "l": "pin('l')", "F1": "help", "A": "app.add('instance')", "E": "change",
}  # fmt: skip


class KeyLine(OneLine):
    """Keys of the focused pane first, then the keys that work everywhere, as many as fit."""

    DEFAULT_CSS = "KeyLine { background: $panel; padding: 0 1; }"

    def __init__(self, everywhere: Keys = GLOBAL_KEYS, actions: Mapping[str, str] = KEY_ACTIONS) -> None:
        super().__init__(id="keys")
        self._everywhere = everywhere
        self._actions = actions
        self._local: Keys = ()
        self._holding = self._types = False
        self._names: Mapping[str, str] = {}  # of keys that the user has changed

    def show_keys_of(self, focused: Widget | None, holding: bool) -> None:
        """Show the keys of the focused widget; for a text field only keys that do not type a character."""
        self._types = isinstance(focused, Input)
        own = focused.keys() if isinstance(focused, LineView) else ()
        self.show_keys(getattr(focused, "KEYS", FIELD_KEYS) if self._types else own, holding)

    def show_keys(self, local: Keys, holding: bool) -> None:
        self._local, self._holding = local, holding
        if self._actions is KEY_ACTIONS:
            self._names = getattr(self.app, "key_names", {})
        self.show()

    def _fitting_keys(self) -> list[tuple[str, str]]:
        keys = list(self._local)
        for key, label in TYPING_KEYS if self._types else self._everywhere:
            keys.append((key, "go" if key == "space" and self._holding else label))
        keys = [(self._names.get(key, key), label) for key, label in keys]
        # The last ones, help and quit, stay; without room, those before them are dropped.
        while len(keys) > 3 and sum(len(k) + len(label) + 3 for k, label in keys) - 2 > self.line_width:
            del keys[-3]
        return keys

    def line(self) -> Row:
        parts: list[Part] = []
        for key, label in self._fitting_keys():
            parts += [(key, "key"), (f" {label}", "dim"), ("  ", "")]
        return row(*parts[:-1])

    def click(self, x: int, y: int) -> None:
        left = 0
        old = {name: key for key, name in self._names.items()}
        for key, label in self._fitting_keys():
            width = len(key) + len(label) + 3
            action = self._actions.get(old.get(key, key))
            if left <= x < left + width - 2 and action:
                self.post_message(KeyClicked(action))
            left += width


BENCH_TABS = (
    (2, "Block"), (3, "STATUS"), (4, "History"), (5, "Received"), (6, "Members"), (7, "Peer"), (8, "Timing"),
)  # fmt: skip


class TabLine(OneLine):
    DEFAULT_CSS = "TabLine { background: $background; padding: 0 1; }"

    def __init__(self, tabs: tuple[tuple[int, str], ...] = BENCH_TABS, opened: int = 3) -> None:
        super().__init__(id="tabs")
        self._tabs = tabs
        self._open = {opened}

    def set_tabs(self, tabs: tuple[tuple[int, str], ...]) -> None:
        self._tabs = tabs

    def mark_open(self, *digits: int) -> None:
        self._open = {*digits}
        self.show()

    def line(self) -> Row:
        parts: list[Part] = []
        for digit, name in self._fitting_tabs():
            style = "cursor strong" if digit in self._open else "dim"
            parts += [
                (f" {digit} ", f"key {style}" if digit in self._open else "key"),
                (f"{name} " if name else "", style),
                (" ", ""),
            ]
        return row(*parts)

    def _fitting_tabs(self) -> list[tuple[int, str]]:
        whole = sum(len(name) + 5 for _, name in self._tabs) - 1
        fits = whole <= self.line_width or not self.line_width
        return [(digit, name if fits or digit in self._open else "") for digit, name in self._tabs]

    def click(self, x: int, y: int) -> None:
        left = 0
        for digit, name in self._fitting_tabs():
            width = len(name) + (5 if name else 4)
            if left <= x < left + width - 1:
                self.post_message(KeyClicked(f"pane({digit})"))
            left += width


NO_CONNECTION_LIMIT: Final = 1 << 32  # connections: shadows of a capture have no limit
MOST_TRIGGER_WIDTH: Final = 36


class HeaderWord(NamedTuple):
    """One word of the header. On a narrow screen words with the highest `rank` are dropped first."""

    text: str
    style: str
    rank: int


class WordLine(OneLine):
    DEFAULT_CSS = "WordLine { background: $panel; padding: 0 1; }"

    def line(self) -> Row:
        pieces = self.header_words()
        while len(pieces) > 1 and sum(len(text) for text, _ in _spaced_parts(pieces)) > self.line_width:
            pieces.remove(max(pieces, key=lambda piece: piece.rank))
        return row(*_spaced_parts(pieces))

    def header_words(self) -> list[HeaderWord]:
        raise NotImplementedError


class HeaderLine(WordLine):
    def __init__(self, view_model: ViewModel) -> None:
        super().__init__(id="header")
        self._view_model = view_model
        self.ended = False
        self._kernel = ""

    def header_words(self) -> list[HeaderWord]:
        project, picture = self._view_model.project, self._view_model.picture
        pieces = [HeaderWord("trcvtui", "dim", 60), HeaderWord(project.path.name, "strong", 10)]
        pieces.append(HeaderWord(f"{project.dialect.name} {project.model}", "", 20))
        if self._view_model.unsaved_count:
            pieces.append(HeaderWord(f"+{self._view_model.unsaved_count} unsaved", "warn", 15))
        self._kernel = picture.kernel if picture is not None else self._kernel
        if self._kernel in (TAP, ARMED_TAP):  # also without a picture: bytes pass the tap
            pieces.append(HeaderWord(" IN THE LINE ", "hold", 0))
        if self.ended:
            return [*pieces, HeaderWord(" ENGINE ENDED ", "stop", 0)]
        if picture is None:
            return [*pieces, HeaderWord("the engine starts …", "dim", 5)]
        if picture.player is not None:
            count_of, at = len(picture.player.steps), picture.player.current + 1
            pieces.append(HeaderWord(f"scenario, step {min(at, count_of)} of {count_of}", "warn", 4))
        snapshot, timing = picture.snapshot, picture.timing
        pieces += self._frozen_words()
        now = self._view_model.live or picture
        pieces.append(_state(now.snapshot.running, now.holding))
        if getattr(self.app, "only_looks", False):
            pieces.append(HeaderWord(" READ-ONLY ", "stop", 0))
        pieces.append(HeaderWord(format_duration(snapshot.interval_ns), "", 30))
        live = "live at " if self._view_model.is_frozen else ""
        pieces.append(HeaderWord(f"{live}scan {now.snapshot.scan}", "", 2))
        if now.recorded:
            pieces.append(HeaderWord(f"recording: {clip(now.recorded, MOST_TRIGGER_WIDTH)}", "warn", 3))
        if now.armed:
            pieces.append(HeaderWord(f"trigger armed: {clip(now.armed, MOST_TRIGGER_WIDTH)}", "warn", 3))
        if timing.late_ns:
            pieces.append(HeaderWord(f"{format_ns(timing.late_ns)} late", "warn", 40))
        if timing.overruns:
            pieces.append(HeaderWord(count(timing.overruns, "overrun"), "warn", 35))
        pieces.append(HeaderWord(picture.kernel, "dim", 4))
        if 0 < snapshot.connections_limit < NO_CONNECTION_LIMIT:
            used = f"{snapshot.connections_used}/{snapshot.connections_limit} connections"
            pieces.append(HeaderWord(used, "dim", 70))
        if now.over:
            pieces.append(HeaderWord(f" {now.over.upper()} ", "stop", 0))
        held = [talk.held_ns for talk in now.talks if talk.held_ns is not None]
        if held:
            pieces.append(HeaderWord(f" HELD {max(held) // SECOND} s ", "stop", 0))
        if snapshot.faults:
            pieces.append(HeaderWord(f" {count(len(snapshot.faults), 'FAULT')} ARMED ".upper(), "hold", 3))
        return pieces

    def _frozen_words(self) -> list[HeaderWord]:
        view_model = self._view_model
        if not view_model.is_frozen or view_model.picture is None:
            return []
        chip = f" * FROZEN at scan {view_model.picture.snapshot.scan} *  F live "
        if view_model.fired is None:
            return [HeaderWord(chip, "stop", 0)]
        text = f" TRIGGER {clip(view_model.fired.text, MOST_TRIGGER_WIDTH)} "
        return [HeaderWord(text, "hold", 1), HeaderWord(chip, "stop", 0)]


def _state(running: bool, holding: bool) -> HeaderWord:
    if not running:
        return HeaderWord(" ■ STOP ", "stop", 0)
    return HeaderWord(" ‖ HOLD ", "hold", 0) if holding else HeaderWord(" ▶ RUN ", "run", 0)


def _spaced_parts(pieces: list[HeaderWord]) -> list[Part]:
    parts: list[Part] = []
    for before, piece in zip([None, *pieces], pieces, strict=False):
        if before is not None:
            # A chip has a background of its own, so it needs no dot beside it.
            chip = "ARMED" in piece.text or before.rank == 0 or piece.rank == 0
            parts.append(("  " if chip else " · ", "faint"))
        parts.append((piece.text, piece.style))
    return parts
