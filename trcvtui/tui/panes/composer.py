"""What the peer shall send: hex, text or udt, where it is cut and how often; judged while typed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import ClassVar, Final

from textual.binding import Binding
from textual.containers import Horizontal, Vertical
from textual.widget import Widget
from textual.widgets import Input, Static

from trcvtui.tui.messages import Voice
from trcvtui.tui.panes.cut_row import CutRow
from trcvtui.tui.panes.splits import Cuts, cuts_of
from trcvtui.tui.peer_commands import HEX, MODES, TEXT, UDT, send_line, try_line
from trcvtui.tui.view_model.validity import fault_of
from trcvtui.tui.view_model.view_model import Scene
from trcvtui.tui.widgets.button_line import ButtonLine
from trcvtui.tui.widgets.keystrokes import TypedField

OPTIONS: Final = (("split", "3,7"), ("gap", "T#20ms"), ("repeat", "10"), ("every", "T#50ms"))
EXAMPLES: Final = {HEX: "01 02 0A ff", TEXT: "a line of text", UDT: "Telegram {speed=1.5}"}


class Field(TypedField):
    """One line of input without a frame; enter sends, escape gives the focus back to the pane."""

    KEYS: ClassVar = (("enter", "send"), ("tab", "next"), ("shift+tab", "mode"), ("esc", "leave"))
    BINDINGS: ClassVar = [Binding("escape", "leave", show=False)]

    def __init__(self, send: Callable[[], None], id: str, placeholder: str, classes: str = "") -> None:
        super().__init__(id=id, placeholder=placeholder, classes=classes)
        self._send = send

    async def action_submit(self) -> None:
        """Send what stands there now: a key typed after enter is not part of it."""
        self._send()

    def action_leave(self) -> None:
        """Give the focus back to the pane."""
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
    Composer Field { background: $panel; padding: 0 1; }
    Composer Field:focus { background: $panel; background-tint: $primary 18%; }
    Composer Field.-bad { color: $error; text-style: underline; }
    Composer:ansi Field { text-style: underline; }
    """

    def __init__(self, scene: Scene, voice: Voice) -> None:
        super().__init__(id="composer")
        self._scene = scene
        self._voice = voice
        self.mode = HEX
        self._texts = dict.fromkeys(MODES, "")
        self._seen = ""
        self.fault = ""
        self._above, self._below = Horizontal(), Horizontal()
        self._modes = ButtonLine(
            "mode", lambda: [("", mode) for mode in MODES], self._to_mode, self._mode_now
        )
        self._payload = Field(self.send, "payload", EXAMPLES[HEX])
        self.cut_row = CutRow(self._cut, self.send)
        self._options = [Field(self.send, f"option-{name}", example, "option") for name, example in OPTIONS]

    def compose(self) -> Iterator[Widget]:
        """Compose three lines; what can be typed into comes right after the first frame."""
        with self._above:
            yield self._modes
        yield self._below
        yield self.cut_row

    async def prepare(self) -> None:
        """Put the payload above, its options below."""
        await self._above.mount(self._payload)
        named = zip(OPTIONS, self._options, strict=True)
        await self._below.mount_all(
            widget for (name, _), field in named for widget in (Static(name, markup=False), field)
        )

    # -- the command --------------------------------------------------------------------------------

    @property
    def line(self) -> str:
        """Return the command as it stands, "" without a payload."""
        if not self._payload.value.strip() or not self._scene.peer:
            return ""
        options = tuple((name, field.value) for (name, _), field in zip(OPTIONS, self._options, strict=True))
        return send_line(self._scene.peer, self.mode, self._payload.value, options)

    def judge(self) -> None:
        """Ask whether the command would be taken, and show it in the fields."""
        line = self.line
        if line == self._seen:
            return
        self._seen = line
        self.fault = fault_of(line, self._scene.project) if line else ""
        bad_options = bool(self.fault) and not fault_of(self._without_options(), self._scene.project)
        self._draw(line if not self.fault else self._without_options() if bad_options else "")
        self._payload.set_class(bool(self.fault) and not bad_options, "-bad")
        for field in self._options:
            field.set_class(bad_options and bool(field.value.strip()) and self._is_bad(field), "-bad")

    def _draw(self, line: str) -> None:
        from trcvtui.rig.commands.reader import (
            parse_line,  # read at the first line, not before the first screen
        )
        from trcvtui.rig.commands.words import PeerSend

        send = parse_line(line, self._scene.project, "message") if line else None
        if isinstance(send, PeerSend):
            self.cut_row.draw(send.payload, cuts_of(send))
        else:
            self.cut_row.draw(b"", Cuts())

    def _cut(self, cuts: Cuts) -> None:
        """Write the cuts into the fields, which are what is sent."""
        for (name, _), field in zip(OPTIONS, self._options, strict=True):
            if name in ("split", "gap"):
                field.value = cuts.split if name == "split" else cuts.gap
        self.judge()

    def cut_at(self, place: int) -> None:
        """Cut the message there alone, and go to it."""
        self.cut_row.place = place
        self._cut(Cuts().toggled(place))
        self.screen.set_focus(self.cut_row)

    def try_line(self, instance: str) -> str:
        """Return the command that tries every split of the message, "" without one."""
        if not self._payload.value.strip():
            return ""
        gap = next(
            field.value for (name, _), field in zip(OPTIONS, self._options, strict=True) if name == "gap"
        )
        return try_line(self._scene.peer, self.mode, self._payload.value, instance, gap)

    def put(self, mode: str, text: str) -> None:
        """Put a payload in the place of the present one."""
        self._to_mode(MODES.index(mode))
        self._payload.value = text
        self.judge()

    @property
    def text(self) -> str:
        """Return the payload as it stands."""
        return self._payload.value

    def _without_options(self) -> str:
        return send_line(self._scene.peer, self.mode, self._payload.value, ())

    def _is_bad(self, field: Field) -> bool:
        name = (field.id or "").removeprefix("option-")
        alone = send_line(self._scene.peer, self.mode, self._payload.value, ((name, field.value),))
        return bool(fault_of(alone, self._scene.project))

    def send(self) -> None:
        """Send the command, or go to the payload while there is none."""
        self.judge()
        if not self.line:
            self.ask_for_payload("send")
        elif self.fault:
            self._voice.complain(self.fault)
        else:
            self._voice.submit(self.line)

    def ask_for_payload(self, what: str) -> None:
        """Say that there is nothing yet, and go to where it is typed."""
        self._voice.complain(f"the payload is empty, there is nothing to {what}: type it, enter sends it")
        self.edit()

    def on_input_changed(self, event: Input.Changed) -> None:
        """Judge while typing; the pane shows the command as it grows."""
        self.judge()

    def edit(self) -> None:
        """Go to the payload."""
        self.screen.set_focus(self._payload)

    # -- the mode -----------------------------------------------------------------------------------

    def _mode_now(self) -> int:
        return MODES.index(self.mode)

    def next_mode(self) -> None:
        """Go to the next way of writing a payload."""
        self._to_mode((self._mode_now() + 1) % len(MODES))

    def _to_mode(self, index: int) -> None:
        self._texts[self.mode] = self._payload.value
        self.mode = MODES[index]
        text = self._texts[self.mode]
        if self.mode == UDT and not text:
            declared = self._scene.declaration
            text = f"{declared.type_name} {{}}" if declared else ""
        self._payload.placeholder = EXAMPLES[self.mode]
        self._payload.value = text
        self._payload.cursor_position = len(text) - 1 if text.endswith("}") else len(text)
        self._modes.show()
        self.judge()
