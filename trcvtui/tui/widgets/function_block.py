"""Pane 2: the function block as it is drawn in a program; its input pins are the toggles.

Built from the pins that the project names for the block: another block needs nothing here.
"""

from __future__ import annotations

from typing import ClassVar, Final, NamedTuple

from textual import events

from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.tui.afterglow import DONE, ERROR
from trcvtui.tui.formatting import clip, count, lamp, plain, status_word
from trcvtui.tui.keys import letters_of
from trcvtui.tui.messages import LineSubmitted, PromptWanted
from trcvtui.tui.scene import Scene
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row

IN_BOX: Final = 8
OUT_BOX: Final = 8
ROOMY: Final = 72  # room for what each output means
UNNAMED: Final = ("CONNECT", "DATA")  # drawn below the box: the project file names them


class DrawnPin(NamedTuple):
    """A pin as the drawing needs it."""

    name: str
    text: str
    is_bool: bool
    edge: bool
    letter: str


class Drawing(NamedTuple):
    """Both sides of a block."""

    inputs: tuple[DrawnPin, ...]
    outputs: tuple[DrawnPin, ...]

    @property
    def width(self) -> int:
        """Return the width of the longest input name."""
        return max((len(pin.name) for pin in self.inputs), default=4)


class FunctionBlock(LineView):
    """The selected instance. A toggle is shown as pending until a scan has taken it over."""

    KEYS: ClassVar = (("n t a x", "toggle"), ("l", "LEN"), ("enter", "toggle ▸"))
    BINDINGS: ClassVar = [("enter", "toggle_pin", "toggle")]

    def __init__(self, scene: Scene) -> None:
        super().__init__(id="block")
        self._scene = scene
        self._drawings: dict[str, Drawing] = {}
        self._pending: dict[tuple[str, str], tuple[bool | int, int]] = {}
        self._cursor = 0
        self._hover: int | None = None

    # -- what is drawn ------------------------------------------------------------------------------

    def drawing(self) -> Drawing:
        """Return the pins of the selected instance's block."""
        instance = self._scene.instance
        block = instance.block if instance else self._block_of_project()
        if block not in self._drawings:
            self._drawings[block] = self._draw(block)
        return self._drawings[block]

    def _block_of_project(self) -> str:
        declared = self._scene.project.instance(self._scene.selected)
        return declared.block if declared else ""

    def _draw(self, block: str) -> Drawing:
        pins = [p for p in self._scene.project.pins(block) if p.name not in UNNAMED] if block else []
        letters = letters_of(p.name for p in pins if p.direction != "out")
        drawn = [
            (p.direction == "out", DrawnPin(p.name, p.text, p.is_bool, p.edge, letters.get(p.name, "")))
            for p in pins
        ]
        return Drawing(tuple(p for out, p in drawn if not out), tuple(p for out, p in drawn if out))

    def show(self) -> None:
        """Repaint what changed."""
        instance = self._scene.instance
        self.set_title(2, plain(self._scene.selected) or "Block", instance.block if instance else "")
        self._settle()
        super().show()

    def _settle(self) -> None:
        snapshot, instance = self._scene.snapshot, self._scene.instance
        if snapshot is None or instance is None:
            return
        for (name, pin), (value, scan) in list(self._pending.items()):
            taken = name == instance.name and instance.pin(pin) == value
            if taken or snapshot.scan > scan + 1:
                del self._pending[name, pin]

    def row_count(self) -> int:
        """Return the lines of the box, and those that name CONNECT, DATA and the pin under the cursor."""
        return self._rows_of_pins() + 7

    def _box(self) -> int:
        """Return the width of the left half: no value is ever cut."""
        values = (len(str(self.value_of(pin)[0])) for pin in self.drawing().inputs if not pin.is_bool)
        return max(IN_BOX, max(values, default=0) + 3)

    def _rows_of_pins(self) -> int:
        drawing = self.drawing()
        return max(len(drawing.inputs), len(drawing.outputs))

    def row_at(self, y: int) -> Row:
        """Return one line of the drawing."""
        drawing, rows = self.drawing(), self._rows_of_pins()
        left = " " * (drawing.width + 6)
        if y == 0:
            instance = self._scene.instance
            name = f" {instance.block} " if instance else ""
            return row((f"{left}┌", "dim"), (name.center(self._box() + OUT_BOX, "─"), "dim"), ("┐", "dim"))
        if y <= rows:
            return self._pin_row(drawing, y - 1)
        if y == rows + 1:
            return row((f"{left}└{'─' * (self._box() + OUT_BOX)}┘", "dim"))
        return self._below(y - rows - 2)

    def _pin_row(self, drawing: Drawing, y: int) -> Row:
        parts: list[Part] = []
        style = ""
        if y < len(drawing.inputs):
            if y == self._cursor and self.has_focus:
                style = "cursor"
            elif y == self._hover:
                style = "hover"
            parts += [(text, f"{names} {style}") for text, names in self._input(drawing, drawing.inputs[y])]
        else:
            parts.append((" " * (drawing.width + 6) + "│" + " " * self._box(), "dim"))
        if y < len(drawing.outputs):
            parts += self._output(drawing.outputs[y])
        else:
            parts.append((" " * OUT_BOX + "│", "dim"))
        return row(*parts)

    def _input(self, drawing: Drawing, pin: DrawnPin) -> list[Part]:
        value, pending = self.value_of(pin)
        wire = " ▷┤" if pin.edge else " ─┤"
        text = f"{lamp(bool(value))} {int(value)}" if pin.is_bool else f"{value}"
        text = f" {text}{'…' if pending else ''}".ljust(self._box())
        return [
            (f" {pin.letter or ' '} ", "key"),
            (pin.name.rjust(drawing.width), "strong" if value else ""),
            (f"{wire}", "dim"),
            (text, "warn" if pending else "on" if pin.is_bool and value else ""),
        ]

    def _output(self, pin: DrawnPin) -> list[Part]:
        instance = self._scene.instance
        value = instance.pin(pin.name) if instance else None
        if pin.is_bool:
            text = f"{int(value or 0)} {lamp(bool(value), self._glow(pin.name) != '')}"
            style = {"ERROR": "error", "DONE": "done", "BUSY": "busy"}.get(pin.name, "on") if value else ""
        else:
            text = status_word(value or 0) if pin.name == "STATUS" else str(value or 0)
            style = _status_style(instance) if pin.name == "STATUS" else ""
        glow = self._glow(pin.name)
        style = style or ("glow" if glow else "")
        return [
            (text.rjust(OUT_BOX - 1) + " ", style),
            ("├─", "dim"),
            (f" {pin.name}", style),
            (glow, "glow"),
        ]

    def _about(self, pin: DrawnPin, glow: str) -> list[Part]:
        text = "" if glow or self.line_width < ROOMY else f"{'':<{12 - len(pin.name)}}{pin.text}"
        return [(text, "faint")]

    def _glow(self, pin: str) -> str:
        """Return what an output was a moment ago: its value and scan."""
        instance, now = self._scene.instance, self._scene.t_ns
        if instance is None:
            return ""
        glow = self._scene.afterglow.glow
        if pin == "DONE" and not instance.done and (done := glow(instance.name, DONE, now)):
            return f" ◂{done.scan}"
        if pin == "ERROR" and not instance.error and (error := glow(instance.name, ERROR, now)):
            return f" ◂{error.scan}"
        if pin == "STATUS" and not instance.error and (error := glow(instance.name, ERROR, now)):
            return f" ◂{error.status:04X}" if error.status else ""
        if pin == "RCVD_LEN" and not instance.done and (done := glow(instance.name, DONE, now)):
            return f" ◂{done.rcvd_len}" if done.rcvd_len is not None else ""
        return ""

    def _below(self, y: int) -> Row:
        instance, connection = self._scene.instance, self._scene.connection
        if instance is None:
            return EMPTY
        if y == 0:
            role = "" if connection is None else "active" if connection.active else "passive"
            state = connection.state if connection else ""
            name = plain(instance.connect)
            return row((" CONNECT ", "dim"), (name, "strong"), (f"  {role}, {state}", "dim"))
        if y == 1:
            return row((" DATA    ", "dim"), *self._data_parts())
        if y == 2:
            errors = f"  {count(instance.errors, 'error')}"
            return row((" jobs    ", "dim"), (f"{instance.jobs_done} done", "strong"), (errors, "dim"))
        if y == 3:
            return row((" last    ", "dim"), (_last(instance), "dim"))
        return self._hint()

    def _data_parts(self) -> list[Part]:
        declared = self._scene.declaration
        if declared is None:
            return [("not wired", "warn")]
        size = f"  {clip(plain(declared.type_name), 24)}, {declared.size} B"
        return [(plain(declared.name), "strong"), (size, "dim")]

    def _hint(self) -> Row:
        pin = self._pin_under_cursor()
        return row((f" {clip(pin.text, self.line_width - 1)}", "dim")) if pin and self.has_focus else EMPTY

    # -- toggling -----------------------------------------------------------------------------------

    def value_of(self, pin: DrawnPin) -> tuple[bool | int, bool]:
        """Return the value of an input, and whether it still waits for the next scan."""
        instance = self._scene.instance
        if instance is None:
            return 0, False
        waiting = self._pending.get((instance.name, pin.name))
        return (instance.pin(pin.name) or 0, False) if waiting is None else (waiting[0], True)

    def press(self, letter: str) -> bool:
        """Toggle the pin of this letter; return whether there is one."""
        pin = next((p for p in self.drawing().inputs if p.letter == letter), None)
        if pin is not None:
            self._toggle(pin)
        return pin is not None

    def _toggle(self, pin: DrawnPin) -> None:
        instance, snapshot = self._scene.instance, self._scene.snapshot
        if instance is None or snapshot is None:
            return
        value, _ = self.value_of(pin)
        if not pin.is_bool:
            self.post_message(PromptWanted(f"set {instance.name} {pin.name}="))
        elif pin.edge:
            self.post_message(LineSubmitted(f"pulse {instance.name} {pin.name}"))
        else:
            self._pending[instance.name, pin.name] = (not value, snapshot.scan)
            self.post_message(LineSubmitted(f"set {instance.name} {pin.name}={int(not value)}"))
        self.show()

    def _pin_under_cursor(self) -> DrawnPin | None:
        inputs = self.drawing().inputs
        return inputs[min(self._cursor, len(inputs) - 1)] if inputs else None

    def action_toggle_pin(self) -> None:
        """Toggle the pin under the cursor."""
        pin = self._pin_under_cursor()
        if pin is not None:
            self._toggle(pin)

    def action_move(self, rows: int) -> None:
        """Move the cursor from pin to pin."""
        last = len(self.drawing().inputs) - 1
        self._cursor = max(0, min(last, self._cursor + rows))
        self.keep_in_view(self._cursor + 1)
        self.show()

    def on_click(self, event: events.Click) -> None:
        """Toggle the input pin under the mouse."""
        pin = self._pin_under_mouse(event)
        if pin is not None:
            self._cursor = pin
            self._toggle(self.drawing().inputs[pin])

    def on_mouse_move(self, event: events.MouseMove) -> None:
        """Show which pin a click would toggle."""
        self._hover = self._pin_under_mouse(event)
        self.show()

    def on_leave(self) -> None:
        """The mouse has gone."""
        self._hover = None
        self.show()

    def _pin_under_mouse(self, event: events.MouseEvent) -> int | None:
        place, drawing = self.place_of(event), self.drawing()
        if place is None or not 1 <= place[1] <= len(drawing.inputs):
            return None
        return place[1] - 1 if place[0] < drawing.width + 7 + self._box() else None

    def on_focus(self) -> None:
        """Show the cursor."""
        self.show()

    def on_blur(self) -> None:
        """Hide the cursor."""
        self.show()


def _last(instance: InstanceSnapshot) -> str:
    if instance.last_done_scan is None:
        return "no DONE yet"
    size = f"{instance.last_rcvd_len} B " if instance.last_rcvd_len is not None else ""
    return f"DONE {size}in scan {instance.last_done_scan}"


def _status_style(instance: InstanceSnapshot | None) -> str:
    if instance is None:
        return ""
    return "error" if instance.error else "done" if instance.done else "strong"
