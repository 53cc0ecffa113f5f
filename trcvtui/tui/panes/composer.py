"""The message that the peer will send: hex, text or udt, its cuts and repeats, checked as you type."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, ClassVar, Final

from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.widget import Widget
from textual.widgets import Input, Static

from trcvtui.tui.formatting import MS
from trcvtui.tui.messages import ScreenCallbacks
from trcvtui.tui.peer_commands import HEX, PAYLOAD_MODES, TEXT, UDT, make_send_line, make_try_splits_line
from trcvtui.tui.view_model.validity import find_mistake
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import OneLine, Part, Row, hidden_bindings, row
from trcvtui.tui.widgets.lines import ButtonLine
from trcvtui.tui.widgets.typed_lines import EntryField
from trcvtui.udt.literals import format_duration
from trcvtui.wording import count

if TYPE_CHECKING:  # imported late: a screen seldom parses a line
    from trcvtui.commands.words import PeerSend

PAUSES_MS: Final = (0, 1, 2, 5, 10, 20, 30, 50, 100, 200, 500, 1000, 2000, 5000)  # ms
FIRST_PAUSE_NS: Final = 20 * MS


@dataclass(frozen=True, slots=True)
class Splits:
    """The cuts of a message, each with its pause in ns. A cut at 3 is before the byte at offset 3."""

    pauses: Mapping[int, int] = field(default_factory=dict)

    @property
    def places(self) -> tuple[int, ...]:
        return tuple(sorted(self.pauses))

    def toggle_at(self, place: int) -> Splits:
        """Return a copy with this cut added or removed; a new cut takes the pause of the cut next to it."""
        if place in self.pauses:
            return Splits({at: ns for at, ns in self.pauses.items() if at != place})
        near = [at for at in self.places if at < place][-1:] or list(self.places[:1])
        return Splits({**self.pauses, place: self.pauses[near[0]] if near else FIRST_PAUSE_NS})

    def step_pause(self, place: int, step: int) -> Splits:
        """Return a copy with the next longer or shorter pause at a cut."""
        now = self.pauses[place]
        longer = [ms * MS for ms in PAUSES_MS if ms * MS > now]
        shorter = [ms * MS for ms in PAUSES_MS if ms * MS < now]
        then = longer[:1] if step > 0 else shorter[-1:]
        return Splits({**self.pauses, place: then[0] if then else now})

    @property
    def split_option(self) -> str:
        return ",".join(str(b - a) for a, b in pairwise((0, *self.places)))

    @property
    def gap_option(self) -> str:
        """Return the value of `gap=`, or "" if there are no pauses."""
        pauses = [self.pauses[at] for at in self.places]
        if not any(pauses):
            return ""
        return ",".join(map(format_duration, pauses[:1] if len(set(pauses)) == 1 else pauses))


def read_splits(send: PeerSend) -> Splits:
    """Return the cuts of a send command, without cuts at or after the end of its message."""
    gaps = send.gaps_ns or (send.gap_ns,)
    places = [at for at in accumulate(send.split) if at < len(send.payload)]
    return Splits({at: gaps[min(n, len(gaps) - 1)] for n, at in enumerate(places)})


BYTE_WIDTH: Final = 3  # two digits and the column before them
NO_MESSAGE: Final = "no message yet: its bytes and cuts appear here"
CUT, CURSOR_SIGN, CUT_CURSOR = "┃", "╎", "╂"


class SplitsLine(OneLine, can_focus=True):
    """Draws `payload` with its `cuts`, and calls `changed` with the cuts after every change."""

    KEYS: ClassVar = (("←→", "place"), ("space", "cut or join"), ("+ -", "pause"), ("del", "no cuts"))
    BINDINGS: ClassVar = [
        *hidden_bindings({"left": "place(-1)", "right": "place(1)", "home": "edge(-1)", "end": "edge(1)"}),
        Binding("space", "cut", "cut the message here, or join it", show=False),
        Binding("plus,equals_sign", "pause(1)", "a longer pause at this cut", show=False),
        Binding("minus", "pause(-1)", "a shorter pause at this cut", show=False),
        Binding("delete,backspace", "join", "remove all cuts", show=False),
        Binding("enter", "send", "send the message as it is cut", show=False),
    ]

    def __init__(self, changed: Callable[[Splits], None], send: Callable[[], None]) -> None:
        super().__init__(id="cuts")
        self._changed = changed
        self._send = send
        self.payload = b""
        self.cuts = Splits()
        self.place = 1  # the cursor is before this byte
        self._first = 0  # the first byte in view

    def draw(self, payload: bytes, cuts: Splits) -> None:
        self.payload, self.cuts = payload, cuts
        self.place = max(1, min(self.place, len(payload) - 1))
        self.show()

    # -- drawing ------------------------------------------------------------------------------------

    def line(self) -> Row:
        if not self.payload:
            return row((NO_MESSAGE, "faint"))
        self._keep_in_view()
        parts: list[Part] = [("‥" if self._first else " ", "dim")]
        last = min(len(self.payload), self._first + self._count_in_view())
        for at in range(self._first, last):
            if at > self._first:
                parts.append(self._cut_part(at))
            # Pieces alternate between plain and strong, so that a cut shows without its stroke.
            is_even = sum(place <= at for place in self.cuts.places) % 2 == 0
            parts.append((f"{self.payload[at]:02X}", "" if is_even else "strong"))
        parts.append(("‥" if last < len(self.payload) else " ", "dim"))
        return row(*parts, (f" {self._describe_place()}", "dim"))

    def _cut_part(self, at: int) -> Part:
        is_cut, is_here = at in self.cuts.places, self.has_focus and at == self.place
        sign = CUT_CURSOR if is_cut and is_here else CUT if is_cut else CURSOR_SIGN if is_here else " "
        return sign, "key cursor" if is_here else "key"

    def _describe_place(self) -> str:
        size = count(len(self.payload), "byte")
        if not self.has_focus:
            return f"{size} in {count(len(self.cuts.places) + 1, 'piece')}"
        if self.place not in self.cuts.places:
            return f"{size}, space cuts at {self.place}"
        return f"{size}, cut at {self.place}, pause {format_duration(self.cuts.pauses[self.place])}"

    def _count_in_view(self) -> int:
        return max(1, (self.line_width - 2 - len(f" {self._describe_place()}") + 1) // BYTE_WIDTH)

    def _keep_in_view(self) -> None:
        room = self._count_in_view()
        if self.place <= self._first:
            self._first = max(0, self.place - 1)
        elif self.place >= self._first + room:
            self._first = self.place - room + 1
        self._first = max(0, min(self._first, len(self.payload) - room))

    # -- keys and mouse -----------------------------------------------------------------------------

    def action_place(self, step: int) -> None:
        self._go(self.place + step)

    def action_edge(self, side: int) -> None:
        self._go(1 if side < 0 else len(self.payload) - 1)

    def _go(self, place: int) -> None:
        self.place = max(1, min(place, len(self.payload) - 1))
        self.show()

    def action_cut(self) -> None:
        if len(self.payload) > 1:
            self._changed(self.cuts.toggle_at(self.place))

    def action_pause(self, step: int) -> None:
        if self.place in self.cuts.places:
            self._changed(self.cuts.step_pause(self.place, step))

    def action_join(self) -> None:
        self._changed(Splits())

    def action_send(self) -> None:
        self._send()

    def click(self, x: int, y: int) -> None:
        """Add or remove the cut before the byte under the mouse."""
        place = self._first + x // BYTE_WIDTH
        if 0 < place < len(self.payload) and place < self._first + self._count_in_view():
            self.place = place
            self.action_cut()


OPTIONS: Final = (("split", "3,7"), ("gap", "T#20ms"), ("repeat", "10"), ("every", "T#50ms"))
PAYLOAD_EXAMPLES: Final = {HEX: "01 02 0A ff", TEXT: "a line of text", UDT: "Telegram {speed=1.5}"}


class PayloadField(EntryField):
    """One line of input without a frame; enter sends, escape gives the focus back to the pane."""

    KEYS: ClassVar = (("enter", "send"), ("tab", "next"), ("shift+tab", "mode"), ("esc", "leave"))
    BINDINGS: ClassVar = [Binding("escape", "leave", show=False)]

    def __init__(self, send: Callable[[], None], id: str, placeholder: str, classes: str = "") -> None:
        super().__init__(id=id, placeholder=placeholder, classes=classes)
        self._send = send

    async def action_submit(self) -> None:
        self._send()

    def convert_paste(self, text: str) -> str:
        """Return the first line; for a STRUCT, clear the field and return all lines without comments."""
        if not text.lstrip().upper().startswith("STRUCT"):
            return super().convert_paste(text)
        self.clear()
        return " ".join(line.partition("//")[0].strip() for line in text.strip().splitlines())

    def action_leave(self) -> None:
        self.screen.set_focus(self.screen.query_one("#peers"))


class Composer(Vertical):
    """The fields of `peer P send`; `line` is the command that they make."""

    DEFAULT_CSS = """
    Composer { height: 3; background: $surface; }
    Composer Horizontal { height: 1; }
    Composer #mode { width: 19; }
    Composer #payload { width: 1fr; }
    Composer Static { width: auto; color: $text-muted; padding: 0 1 0 0; }
    Composer .option { width: 10; margin: 0 2 0 0; }
    Composer PayloadField { background: $panel; padding: 0 1; }
    Composer PayloadField:focus { background: $panel; background-tint: $primary 18%; }
    Composer PayloadField.-bad { color: $error; text-style: underline; }
    Composer:ansi PayloadField { text-style: underline; }
    """

    def __init__(self, view_model: ViewModel, actions: ScreenCallbacks) -> None:
        super().__init__(id="composer")
        self._view_model = view_model
        self._actions = actions
        self.mode = HEX
        self._texts = dict.fromkeys(PAYLOAD_MODES, "")
        self._checked_line = ""
        self.fault = ""
        self._above, self._below = Horizontal(), Horizontal()
        self._modes = ButtonLine(
            "mode", lambda: [("", mode) for mode in PAYLOAD_MODES], self._to_mode, self._mode_now
        )
        self._payload = PayloadField(self.send, "payload", PAYLOAD_EXAMPLES[HEX])
        self.split_row = SplitsLine(self._apply_splits, self.send)
        self._options = {
            name: PayloadField(self.send, f"option-{name}", example, "option") for name, example in OPTIONS
        }

    def compose(self) -> Iterator[Widget]:
        """Compose three lines; the text fields are mounted right after the first frame."""
        with self._above:
            yield self._modes
        yield self._below
        yield self.split_row

    async def mount_fields(self) -> None:
        await self._above.mount(self._payload)
        named = self._options.items()
        await self._below.mount_all(
            widget for name, field in named for widget in (Static(name, markup=False), field)
        )

    # -- the command --------------------------------------------------------------------------------

    @property
    def line(self) -> str:
        """Return the command of the fields, "" without a payload."""
        if not self._payload.value.strip() or not self._view_model.peer:
            return ""
        options = tuple((name, option.value) for name, option in self._options.items())
        return make_send_line(self._view_model.peer, self.mode, self._payload.value, options)

    def check_line(self) -> None:
        line = self.line
        if line == self._checked_line:
            return
        self._checked_line = line
        self.fault = find_mistake(line, self._view_model.project) if line else ""
        bad_options = bool(self.fault) and not find_mistake(self._base_line(), self._view_model.project)
        self._draw(line if not self.fault else self._base_line() if bad_options else "")
        self._payload.set_class(bool(self.fault) and not bad_options, "-bad")
        for name, option in self._options.items():
            is_bad = bad_options and bool(option.value.strip()) and self._is_bad(name, option.value)
            option.set_class(is_bad, "-bad")

    def _draw(self, line: str) -> None:
        from trcvtui.commands.table import parse_line  # with the first line, not before the first screen
        from trcvtui.commands.words import PeerSend

        send = parse_line(line, self._view_model.project, "message") if line else None
        drawn = (send.payload, read_splits(send)) if isinstance(send, PeerSend) else (b"", Splits())
        self.split_row.draw(*drawn)

    def _apply_splits(self, cuts: Splits) -> None:
        self._options["split"].value, self._options["gap"].value = cuts.split_option, cuts.gap_option
        self.check_line()

    def make_try_line(self, instance: str) -> str:
        """Return the command that tries every split of the message, "" without a message."""
        if not self._payload.value.strip():
            return ""
        gap = self._options["gap"].value
        return make_try_splits_line(self._view_model.peer, self.mode, self._payload.value, instance, gap)

    def set_payload(self, mode: str, text: str) -> None:
        self._to_mode(PAYLOAD_MODES.index(mode))
        self._payload.value = text
        self.check_line()

    @property
    def text(self) -> str:
        return self._payload.value

    def _base_line(self) -> str:
        return make_send_line(self._view_model.peer, self.mode, self._payload.value, ())

    def _is_bad(self, name: str, value: str) -> bool:
        alone = make_send_line(self._view_model.peer, self.mode, self._payload.value, ((name, value),))
        return bool(find_mistake(alone, self._view_model.project))

    def send(self) -> None:
        self.check_line()
        if not self.line:
            self.ask_for_payload("send")
        elif self.fault:
            self._actions.complain(self.fault)
        else:
            self._actions.submit(self.line)

    def ask_for_payload(self, what: str) -> None:
        self._actions.complain(f"the payload is empty, there is nothing to {what}: type it, enter sends it")
        self.focus_payload()

    def on_input_changed(self, event: Input.Changed) -> None:
        self.check_line()

    def focus_payload(self) -> None:
        self.screen.set_focus(self._payload)

    # -- the mode -----------------------------------------------------------------------------------

    def _mode_now(self) -> int:
        return PAYLOAD_MODES.index(self.mode)

    def next_mode(self) -> None:
        self._to_mode((self._mode_now() + 1) % len(PAYLOAD_MODES))

    def _to_mode(self, index: int) -> None:
        self._texts[self.mode] = self._payload.value
        self.mode = PAYLOAD_MODES[index]
        text = self._texts[self.mode]
        if self.mode == UDT and not text:
            declared = self._view_model.declaration
            text = f"{declared.type_name} {{}}" if declared else ""
        self._payload.placeholder = PAYLOAD_EXAMPLES[self.mode]
        self._payload.value = text
        self._payload.cursor_position = len(text) - 1 if text.endswith("}") else len(text)
        self._modes.show()
        self.check_line()
