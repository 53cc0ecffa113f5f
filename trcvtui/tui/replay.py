"""A recording on the main screen: the position line, and the keys that move through the recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import groupby
from typing import TYPE_CHECKING, ClassVar, Final

from textual.binding import Binding
from textual.widget import Widget
from textual.widgets import Input

from trcvtui.snapshots.replay import CANNOT_CHANGE_TEXT, ReplayPosition
from trcvtui.tui.main import ZOOM, MainScreen
from trcvtui.tui.messages import MessageChosen
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row
from trcvtui.tui.widgets.lines import KEY_ACTIONS, KeyLine, Keys
from trcvtui.udt.literals import format_duration
from trcvtui.wording import count, utc_text

if TYPE_CHECKING:
    from trcvtui.tui.doctor import DoctorTarget

REPLAY_KEYS: Final = (
    ("space", "stop"), ("←→", "scan"), ("shift", "edge"), ("!", "error"), ('"', "error before"),
    ("g", "go to"), ("W", "what if"), ("+-", "speed"),
    ("9", "time line"), (":", "command"), ("?", "help"), ("q", "quit"),
)  # fmt: skip
CLICK_ACTIONS: Final = {
    **KEY_ACTIONS,
    "!": "at('error +1')",
    '"': "at('error -1')",
    "g": "prompt('at ')",
    "W": "what_if",
    "9": "line",
}
PANE_KEYS: Final = {  # keys that a pane may use itself; the key line then leaves them out
    "←→": ("left", "right"), "shift": ("shift+left", "shift+right"), "!": ("exclamation_mark",),
    "+-": ("plus", "minus"), "space": ("space",), "g": ("g",),
}  # fmt: skip
CHANGES: Final = frozenset(("add", "change", "send"))  # keys of panes that change the bench
COMMAND_PANES: Final = frozenset(("block", "peer"))  # all keys of these panes change the bench
POSITION_ROWS: Final = 2
PRIORITY_ACTIONS: Final = frozenset((("at", "1"), ("at", "end"), ("prompt", "at ")))  # home, end and g
TIMING_PANE: Final = 8
MOST_WHAT_IF_LINES: Final = 6
HERE_SIGN, PARTING_SIGN, ERROR_SIGN, PAST_SIGN, COMING_SIGN = "█", "≠", "!", "━", "─"
STYLES: Final = {
    HERE_SIGN: "key",
    PARTING_SIGN: "warn",
    ERROR_SIGN: "error",
    PAST_SIGN: "key",
    COMING_SIGN: "faint",
}


def position_bar(position: ReplayPosition, width: int) -> str:
    """Return a bar of the whole recording: the shown scan, the scans before it, the ERRORs."""
    pieces, first = len(position.marks), position.first + 1
    scans = max(1, position.last_scan - position.first)
    here = max(0, position.scan - first) * width // scans

    def sign(column: int) -> str:
        if column == here:
            return HERE_SIGN
        begin = column * pieces // width
        if position.parts_at and column == (position.parts_at - first) * width // scans:
            return PARTING_SIGN
        has_error = 1 in position.marks[begin : max(begin + 1, (column + 1) * pieces // width)]
        return ERROR_SIGN if has_error else PAST_SIGN if column < here else COMING_SIGN

    return "".join(map(sign, range(width)))


class PositionLine(LineView, inherit_bindings=False):
    """The replay's position in words and as a bar over the whole width; a click chooses the scan there."""

    DEFAULT_CSS = f"PositionLine {{ height: {POSITION_ROWS}; background: $background; padding: 0 1; }}"

    def __init__(self, view_model: ViewModel) -> None:
        super().__init__(id="position")
        self._view_model = view_model

    def row_count(self) -> int:
        position = self._view_model.position
        return POSITION_ROWS + (len(_what_if_lines(position)) if position is not None else 0)

    def row_at(self, y: int) -> Row:
        picture = self._view_model.live
        if picture is None or picture.position is None:
            return EMPTY
        if y == 0:
            return row(*_position_parts(picture.position, picture.holding))
        if y >= POSITION_ROWS:
            shown = _what_if_lines(picture.position)[y - POSITION_ROWS : y - POSITION_ROWS + 1]
            return row(*((line, "warn" if y == POSITION_ROWS else "") for line in shown))
        signs = groupby(position_bar(picture.position, max(1, self.line_width)))
        return row(*((sign * len([*some]), STYLES[sign]) for sign, some in signs))

    def click(self, x: int, y: int) -> None:
        position = self._view_model.position
        if y == 1 and position is not None:
            first, last = position.first, position.last_scan
            scan = first + x * (last - first) // max(1, self.line_width) + 1
            self.screen.call_next(self.screen.run_action, f"at('{scan}')")


class ReplayKeyLine(KeyLine):
    """Keys of the pane that change nothing, then keys of the replay that the pane does not use."""

    _commands = False

    def show_keys_of(self, focused: Widget | None, holding: bool) -> None:
        panes = [*focused.ancestors_with_self] if focused is not None else []
        self._commands = not isinstance(focused, Input) and any(pane.id in COMMAND_PANES for pane in panes)
        acts = focused.screen.active_bindings if focused is not None else {}
        own = {
            key for key, active in acts.items() if active.node in panes[:-2]
        }  # not the screen's and the app's
        self._everywhere = tuple([pair for pair in REPLAY_KEYS if not own & {*PANE_KEYS.get(pair[0], ())}])
        self._names = getattr(self.app, "key_names", {})
        super().show_keys_of(focused, holding)

    def show_keys(self, local: Keys, holding: bool) -> None:
        some = [pair for pair in local if pair[1] not in CHANGES and (not self._commands or pair[0] == "C")]
        self._actions = {key: action for key, action in CLICK_ACTIONS.items() if key not in dict(some)}
        super().show_keys(tuple(some), holding)


def _what_if_lines(position: ReplayPosition) -> tuple[str, ...]:
    return (position.what_if or position.beside)[:MOST_WHAT_IF_LINES]


def _position_parts(position: ReplayPosition, holding: bool) -> Iterator[Part]:
    more = "" if position.is_read else "+"
    yield f"scan {position.scan} of {position.last_scan}{more}", "strong"
    if position.first:
        yield f" from {position.first + 1} on", ""
    yield f" · {format_duration(position.t_ns)} of {format_duration(position.last_t_ns)}{more}", ""
    if position.first_ns is not None:
        yield f" · {utc_text(position.first_ns + position.t_ns)}", ""
    yield f" · {'‖' if holding else '▶'} {position.speed}", "" if holding else "done"
    if holding and position.wanted != position.scan:  # the run is replayed up to the wanted scan
        known = position.wanted <= position.last_scan
        yield f" · on the way{f' to {position.wanted}' if known else ''}", "warn"
    if position.note:
        yield f" · {position.note}", "warn"
    yield f" · {count(position.errors, 'ERROR')}{more}", "error" if position.errors else "dim"


class ReplayScreen(MainScreen):
    """All panes at one scan of a recording. A focused pane gets keys first; 9 and esc leave the pane."""

    BINDINGS: ClassVar = [
        Binding("left,comma", "at('-1')", "scan back", show=False),
        Binding("right", "at('+1')", "scan on", show=False),
        Binding("shift+left", "edge('-1')", "edge before", show=False),
        Binding("shift+right", "edge('+1')", "next edge", show=False),
        Binding("exclamation_mark", "at('error +1')", "next ERROR", show=False),
        Binding("quotation_mark,at", "at('error -1')", "ERROR before", show=False),
        # With priority: panes have the same keys for their rows.
        Binding("home", "at('1')", "first scan", show=False, priority=True),
        Binding("end", "at('end')", "last scan", show=False, priority=True),
        Binding("g", "prompt('at ')", "go to a scan or time", show=False, priority=True),
        Binding("plus", "speed('+')", "play faster", show=False),
        Binding("minus", "speed('-')", "play slower", show=False),
        Binding("W", "what_if", "another value", show=False),
        Binding("9", "line", "time line", show=False),
    ]

    def __init__(self, view_model: ViewModel, submit: Callable[[str], None]) -> None:
        super().__init__(view_model, submit)
        self.key_line = ReplayKeyLine(REPLAY_KEYS, CLICK_ACTIONS)
        self.position = PositionLine(view_model)
        self._position_rows = POSITION_ROWS
        self._is_beside = False  # the run of a what-if is shown beside the recorded one

    def compose(self) -> Iterator[Widget]:
        for widget in super().compose():
            if widget is self.prompt:
                yield self.position
            yield widget

    def _fit(self, width: int, height: int) -> None:
        super()._fit(width, height - self.position.row_count())

    async def mount_fields(self) -> None:
        await super().mount_fields()
        self.set_focus(self.position)

    def show(self) -> None:
        rows = self.position.row_count()
        if rows != self._position_rows:
            self._position_rows = rows
            self.position.styles.height = rows
            self._fit(*self.size)
            position = self._view_model.position
            is_beside = position is not None and bool(position.what_if)
            if is_beside != self._is_beside:  # timing alone for both runs, or all panes again
                self._is_beside = is_beside
                self._open_pane(TIMING_PANE)
                if is_beside != self.has_class(ZOOM):
                    self.action_zoom()
            self._arrange()
        super().show()
        self.position.show()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Leave the keys `g`, home and end to an input field and to the table of messages."""
        is_typed = action in ("at", "prompt") and isinstance(self.focused, Input)
        is_of_table = (action, *parameters) in PRIORITY_ACTIONS and self.focused is self.received.table.first
        return not (is_typed or is_of_table) and super().check_action(action, parameters)

    def _takes_pin_keys(self) -> bool:
        return True  # a pin key then gets the replay's refusal

    def action_at(self, where: str) -> None:
        self.received.table.messages.follow_newest()
        self._submit(f"at {where}")

    def go_to_place(self, place: DoctorTarget) -> None:
        if place.scan is not None:
            self.action_at(str(place.scan))
        super().go_to_place(place)

    def on_message_chosen(self, message: MessageChosen) -> None:
        message.prevent_default()  # in place of the main screen: the whole replay goes to that scan
        if message.row is not None:
            self._submit(f"at {message.row.scan}")

    def action_edge(self, step: str) -> None:
        self.received.table.messages.follow_newest()
        self._submit(f"at edge {step} {self._view_model.selected}")

    def action_speed(self, step: str) -> None:
        self._submit(f"speed {step}")

    def action_what_if(self) -> None:
        self.action_prompt(f"if instance.{self._view_model.selected}.")

    def action_line(self) -> None:
        self.set_focus(self.position)

    def action_calm(self) -> None:
        super().action_calm()
        self.action_line()

    def action_change(self) -> None:
        self.prompt.show_error(CANNOT_CHANGE_TEXT)

    action_undo = action_change
