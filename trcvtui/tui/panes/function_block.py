"""Pane 2: the function block as it is drawn in a program. The input pins of the block are toggles."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Final, NamedTuple

from textual import events

from trcvtui.diagnosis.link import LISTENING
from trcvtui.plc.snapshot import FramerSnapshot, InstanceSnapshot, block_row, com_buffer_pins, is_time_pin
from trcvtui.project.connect_view import security_of
from trcvtui.project.project import Project
from trcvtui.tui.formatting import clip, lamp, measure, status_word
from trcvtui.tui.messages import ScreenCallbacks
from trcvtui.tui.panes.combuffer import data_parts, framer_lines
from trcvtui.tui.view_model.view_model import DONE, ERROR, Afterglow, ViewModel
from trcvtui.tui.widgets.help import PIN_LETTERS, letters_of
from trcvtui.tui.widgets.line_view import EMPTY, LineView, Part, Row, row
from trcvtui.udt.literals import format_duration
from trcvtui.wording import count


class DrawnPin(NamedTuple):
    """A pin of the drawing. `letter` toggles the pin, but an output has none. `label` is the drawn name."""

    name: str
    text: str
    is_bool: bool
    edge: bool
    letter: str
    label: str
    is_wired: bool = False  # by the project file: no scan writes it
    is_fixed: bool = False  # the project file sets its value, as for CONNECT


PINS_BELOW_BOX: Final = ("CONNECT", "DATA")  # drawn below the box: the project file names them
ID_PIN: Final = DrawnPin(
    "ID", "the ID of the connection, as its description has it", False, False, "", "ID", is_fixed=True
)
LAMP_STYLES: Final = {
    "ERROR": "error", "DONE": "done", "BUSY": "busy", "DataReceived": "done", "StringReceived": "done",
    "ByteReceived": "done", "busy": "busy", "Busy": "busy", "RxTimeout": "warn",
}  # fmt: skip
DONE_PINS: Final = ("DONE", "DataReceived", "StringReceived", "ByteReceived")


class BlockDrawing(NamedTuple):
    inputs: tuple[DrawnPin, ...] = ()
    outputs: tuple[DrawnPin, ...] = ()

    @property
    def name_width(self) -> int:
        return max((len(pin.name) for pin in self.inputs), default=4)

    @property
    def label_width(self) -> int:
        return max((len(pin.label) for pin in self.outputs), default=4)

    @property
    def height(self) -> int:
        return max(len(self.inputs), len(self.outputs))


MARK_LETTERS: Final = {"prefix": "f", "suffix": "u"}


def wired_pins(block: str) -> dict[str, DrawnPin]:
    of_block = block_row(block)
    if not of_block.has_com_buffer:
        return {}
    found = [
        (name, f"{mark}, as hex or text; its length follows", MARK_LETTERS[mark])
        for name, mark in of_block.affix_pins.items()
    ]
    if of_block.data_pin:
        found.append((of_block.data_pin, "the variable of the bytes; its type gives the size", "d"))
    found.append((of_block.buffer_pin, "the ComBuffer; a simulated line can be fed", "c"))
    return {name: DrawnPin(name, text, False, False, letter, name, True) for name, text, letter in found}


def order_inputs(block: str, pins: list[DrawnPin], wired: dict[str, DrawnPin]) -> tuple[DrawnPin, ...]:
    """Return the inputs in the manual's order. A pointer comes before its length, the ComBuffer last."""
    of_block = block_row(block)
    pointer_of = dict(zip(of_block.mark_lengths, of_block.pointers, strict=False))
    pointer_of |= {of_block.data_length: of_block.data_pin} if of_block.data_length else {}
    rest = dict(wired)
    found: list[DrawnPin] = []
    for pin in pins:
        found += [rest.pop(pointer_of[pin.name])] if pin.name in pointer_of else []
        found.append(pin)
    buffer = [rest.pop(of_block.buffer_pin)] if of_block.has_com_buffer else []
    return (*rest.values(), *found, *buffer)


def make_drawing(project: Project, block: str, connect: str) -> BlockDrawing:
    """Return the drawing of a block on a CONNECT. If the CONNECT has an ID, the ID is the second input."""
    pins = [pin for pin in project.pins(block) if pin.name not in PINS_BELOW_BOX]
    wired = wired_pins(block)
    names = [pin.name for pin in pins if pin.direction != "out"]
    letters = letters_of(names, {pin.letter for pin in wired.values()})
    sides: dict[bool, list[DrawnPin]] = {False: [], True: []}  # by "is an output"
    for pin in pins:
        letter, label = letters.get(pin.name, ""), pin.label or pin.name
        drawn = DrawnPin(pin.name, pin.text, pin.is_bool, pin.edge, letter, label)
        sides[pin.direction == "out"].append(drawn)
    inputs = order_inputs(block, sides[False], wired)
    if project.connection_id(block, connect) is not None:
        inputs = (*inputs[:1], ID_PIN, *inputs[1:])
    return BlockDrawing(inputs, tuple(sides[True]))


def output_text(pin: DrawnPin, instance: InstanceSnapshot | None, glowing: bool) -> tuple[str, str]:
    value = (instance.pin(pin.name) if instance else None) or 0
    if pin.is_bool:
        style = LAMP_STYLES.get(pin.name, "on") if value or glowing else ""
        return f"{int(value)} {lamp(bool(value), glowing)}", style
    if pin.name in ("STATUS", "Error"):
        return status_word(value) if pin.name == "STATUS" else str(int(value)), _status_style(instance)
    return str(int(value)), "done" if glowing else ""


def glow_text(pin: DrawnPin, instance: InstanceSnapshot | None, afterglow: Afterglow, t_ns: int) -> str:
    """Return the scan, RCVD_LEN or STATUS to draw beside an output after a DONE or ERROR has ended."""
    if instance is None:
        return ""
    done = None if instance.outputs.done else afterglow.find_pulse(instance.name, DONE, t_ns)
    error = None if instance.outputs.error else afterglow.find_pulse(instance.name, ERROR, t_ns)
    texts = {
        **dict.fromkeys(DONE_PINS, f" scan {done.scan}" if done else ""),
        "RCVD_LEN": f" {done.rcvd_len} B" if done and done.rcvd_len is not None else "",
        "ERROR": f" scan {error.scan}" if error else "",
        "STATUS": f" was {error.status:04X}" if error and error.status else "",
    }
    return texts.get(pin.name, "")


def _status_style(instance: InstanceSnapshot | None) -> str:
    if instance is None:
        return ""
    return "error" if instance.outputs.error else "done" if instance.outputs.done else "strong"


MARK_WIDTH: Final = 9  # columns of a mark inside the box
NULL_POINTER: Final = "0"
FEEDABLE_SOURCES: Final = ("sim", "serial")
ROWS, FRAMER_ROWS = 14, 20  # rows of a block with its border; of one with a framer


def rows_needed(project: Project) -> int:
    """Return how many rows are needed to show any block of a project completely."""
    return FRAMER_ROWS if any(block_row(each.block).affix_pins for each in project.instances) else ROWS


def wired_value(pin: str, instance: InstanceSnapshot) -> str:
    """Return what is wired to a pin: bytes of a mark, a variable, a ComBuffer."""
    if pin in com_buffer_pins():
        return clip(instance.connect, MARK_WIDTH)
    if pin == instance.data_pin:
        return clip(instance.data or NULL_POINTER, MARK_WIDTH)
    mark = find_affix(pin, instance.framer)
    if mark is None:
        return NULL_POINTER
    return clip(mark.hex(" ").upper(), MARK_WIDTH) if mark else "none"


def find_affix(pin: str, framer: FramerSnapshot | None) -> bytes | None:
    """Return the bytes that a prefix or suffix pin points to, None if the pointer is 0."""
    if framer is None:
        return None
    return framer.prefix if pin.endswith("Prefix") else framer.suffix


def make_pin_line(pin: str, instance: InstanceSnapshot, view_model: ViewModel) -> str:
    """Return the beginning of the command that changes a wired pin, or "" if no command does."""
    if pin in com_buffer_pins():
        decl = next((b for b in view_model.project.combuffers if b.name == instance.connect), None)
        return f"feed {instance.connect} hex " if decl is not None and decl.source in FEEDABLE_SOURCES else ""
    if pin == instance.data_pin:
        decl_data = view_model.project.data_decl(instance.data) if instance.data else None
        return f"resize {decl_data.name} {decl_data.type_name}" if decl_data is not None else ""
    mark = find_affix(pin, instance.framer)
    if mark is None:
        return ""
    written = f"hex {mark.hex(' ')}" if mark else "hex "
    return f"{'prefix' if pin.endswith('Prefix') else 'suffix'} {instance.name} {written}"


def pin_hint(pin: str, instance: InstanceSnapshot) -> str:
    if pin in com_buffer_pins():
        return f"{instance.connect} is not a simulated line: its bytes come from elsewhere"
    return f"{pin} of {instance.name} is 0: name its variable in the project, `{pin} = ...`"


IN_BOX: Final = 6
OUT_BOX: Final = 8
TIGHT_BOX_WIDTH: Final = 6  # where long names need the room
LEAST_BOX_WIDTH: Final = 4
JOINTS, TIGHT_JOINTS = (" ─┤", "├─ "), ("┤", "├")
LETTER_WIDTH: Final = 2  # the letter of an input
ROOMY: Final = 72  # room for what each output means
LATE_DETECTION_S: Final = 2  # a stack checks its limit at a retransmission only, so up to this later


class FunctionBlock(LineView):
    """The selected instance. A toggle is shown as pending until a scan has used it."""

    BINDINGS: ClassVar = [
        ("enter", "toggle_pin", "toggle the pin under the cursor"),
        ("C", "app.description", "the connection description byte for byte"),
    ]

    def __init__(self, view_model: ViewModel, actions: ScreenCallbacks) -> None:
        super().__init__(id="block")
        self._view_model = view_model
        self._actions = actions
        self._drawings: dict[tuple[str, str], BlockDrawing] = {}
        self._pending: dict[tuple[str, str], tuple[int, int]] = {}
        self._cursor = 0
        self._buffer_rows: list[Row] = []  # below the box of a block with a ComBuffer
        self._hover: int | None = None
        self.propose_value: Callable[[str], str] = lambda pin: ""  # the value that a remedy proposes

    def keys(self) -> tuple[tuple[str, str], ...]:
        inputs = self.drawing().inputs
        levels = " ".join(pin.letter for pin in inputs if pin.is_bool and pin.letter)
        numbers = tuple((pin.letter, pin.name) for pin in inputs if not pin.is_bool and pin.letter)
        described = (("C", "description"),) if self._view_model.project.dialect.describes_connects else ()
        return (("enter", "toggle"), (levels, "pins"), *numbers, *described)

    def forget(self) -> None:
        """Forget the drawings: the dialect of another project may name pins differently."""
        self._drawings.clear()
        self._pending.clear()

    # -- what is drawn ------------------------------------------------------------------------------

    def drawing(self) -> BlockDrawing:
        instance = self._view_model.instance or self._view_model.project.instance(self._view_model.selected)
        if instance is None:
            return BlockDrawing()
        drawn = instance.block, instance.connect
        if drawn not in self._drawings:
            self._drawings[drawn] = make_drawing(self._view_model.project, *drawn)
        return self._drawings[drawn]

    def show(self) -> None:
        instance = self._view_model.instance
        about = f"{instance.block}{self._describe_task(instance)}" if instance else ""
        self.set_title(2, self._view_model.selected or "Block", about)
        self._clear_pending()
        self._buffer_rows = framer_lines(self._view_model, instance, self.line_width) if instance else []
        super().show()

    def _describe_task(self, instance: InstanceSnapshot) -> str:
        """Return the task of an instance if there are several, such as ` · SLOW T#40ms priority 2`."""
        task = self._view_model.project.task(instance.task)
        if task is None or len(self._view_model.project.tasks) < 2:
            return ""
        return f" · {task.name} {format_duration(task.interval_ns)} priority {task.priority}"

    def _clear_pending(self) -> None:
        snapshot, instance = self._view_model.snapshot, self._view_model.instance
        if snapshot is None or instance is None:
            return
        for (name, pin), (value, scan) in list(self._pending.items()):
            taken = name == instance.name and instance.pin(pin) == value
            if taken or snapshot.scan > scan + 1:  # not applied in two scans: it was refused
                del self._pending[name, pin]

    def row_count(self) -> int:
        return self.drawing().height + 2 + max(5, len(self._buffer_rows))

    def row_at(self, y: int) -> Row:
        drawing = self.drawing()
        left = " " * self._left_width()
        if y == 0:
            instance = self._view_model.instance
            width, name = self._in_box_width() + self._out_box_width(), instance.block if instance else ""
            name = f" {name} " if name and measure(name) + 2 <= width else name
            return row((f"{left}┌{name.center(width, '─')}┐", "dim"))
        if y <= drawing.height:
            return self._pin_row(drawing, y - 1)
        if y == drawing.height + 1:
            return row((f"{left}└{'─' * (self._in_box_width() + self._out_box_width())}┘", "dim"))
        return self._below(y - drawing.height - 2)

    def _in_box_width(self) -> int:
        values = (len(self._value_text(pin)) for pin in self.drawing().inputs if not pin.is_bool)
        tight = self._is_tight()
        return max(TIGHT_BOX_WIDTH if tight else IN_BOX, max(values, default=0) + (2 if tight else 3))

    def _out_box_width(self) -> int:
        if not self._is_tight():
            return OUT_BOX
        instance = self._view_model.instance
        shown = (len(output_text(pin, instance, False)[0]) for pin in self.drawing().outputs)
        if instance is None:
            return TIGHT_BOX_WIDTH
        return max(LEAST_BOX_WIDTH, max(shown, default=0) + 1, len(instance.block) - self._in_box_width())

    def _joints(self) -> tuple[str, str]:
        return TIGHT_JOINTS if self._is_tight() else JOINTS

    def _left_width(self) -> int:
        return self.drawing().name_width + LETTER_WIDTH + len(self._joints()[0])

    def _is_tight(self) -> bool:
        drawing = self.drawing()
        return 0 < self.line_width < drawing.name_width + drawing.label_width + IN_BOX + OUT_BOX + 9

    def _value_text(self, pin: DrawnPin) -> str:
        instance = self._view_model.instance
        if pin.is_wired:
            return wired_value(pin.name, instance) if instance is not None else ""
        return f"{self.read_pin(pin)[0]}{' ms' if is_time_pin(pin.name) else ''}"

    def _pin_row(self, drawing: BlockDrawing, y: int) -> Row:
        parts: list[Part] = []
        if y < len(drawing.inputs):
            pointed = y == self._cursor and self.has_focus
            style = "cursor" if pointed else "hover" if y == self._hover else ""
            parts += [(text, f"{names} {style}") for text, names in self._input(drawing, drawing.inputs[y])]
        else:
            parts.append((f"{' ' * (self._left_width() - 1)}│{'':<{self._in_box_width()}}", "dim"))
        if y < len(drawing.outputs):
            parts += self._output(drawing.outputs[y])
        else:
            parts.append((" " * self._out_box_width() + "│", "dim"))
        return row(*parts)

    def _input(self, drawing: BlockDrawing, pin: DrawnPin) -> list[Part]:
        value, pending = self.read_pin(pin)
        text = f"{lamp(bool(value))} {int(value)}" if pin.is_bool else self._value_text(pin)
        style = "busy" if pending else "on" if pin.is_bool and value else ""
        return [
            (f"{pin.letter or ' '} ", "key"),
            (pin.name.rjust(drawing.name_width), "strong" if value else ""),
            (" ▷┤" if pin.edge else self._joints()[0], "dim"),
            (f" {text}{'…' if pending else ''}".ljust(self._in_box_width()), style),
        ]

    def _output(self, pin: DrawnPin) -> list[Part]:
        view_model = self._view_model
        glow = glow_text(pin, view_model.instance, view_model.afterglow, view_model.t_ns)
        text, style = output_text(pin, view_model.instance, bool(glow))
        roomy = self.line_width >= ROOMY
        joint = self._joints()[1]
        name = pin.label if roomy or not glow else pin.label.partition(" ")[0]
        used = self._left_width() + self._in_box_width() + self._out_box_width() + len(joint)
        if used + measure(name + glow) > self.line_width:  # no room: pane 3 shows it in full
            name, glow = pin.label, ""
        gap = " " * (1 + self.drawing().label_width - measure(name))
        about = f"{gap}{pin.text}" if roomy and not glow else ""
        return [
            (text.rjust(self._out_box_width() - 1) + " ", style),
            (joint.rstrip(), "dim"),
            (" " * (len(joint) - len(joint.rstrip())) + name, style),
            (glow, "error" if pin.name in ("ERROR", "STATUS") else "done"),
            (about, "faint"),
        ]

    def _below(self, y: int) -> Row:
        instance = self._view_model.instance
        if instance is None:
            return EMPTY
        if self._buffer_rows:
            pin = self._pin_under_cursor() if self.has_focus else None
            if pin is not None and y == len(self._buffer_rows) - 1:
                return row((f" {clip(pin.text, self.line_width - 1)}", "dim"))
            return self._buffer_rows[y] if y < len(self._buffer_rows) else EMPTY
        if y == 0:
            link = " CONFIG  " if instance.on_config else " CONNECT "
            end = (instance.connect, "strong")
            return row((link, "dim"), end, *self._security_parts(instance), (self._connection(), "dim"))
        if y == 1:
            return row((f" {instance.data_pin or 'DATA':<8}", "dim"), *data_parts(self._view_model, instance))
        if y == 2:
            errors = f"  {count(instance.errors, 'error')}" + ", expected" * instance.last_is_expected
            return row((" jobs    ", "dim"), (f"{instance.jobs_done} done", "strong"), (errors, "dim"))
        if y == 3:
            return row((" last    ", "dim"), (_describe_last_done(instance), "dim"))
        pin = self._pin_under_cursor()
        if pin and self.has_focus:
            return row((f" {clip(pin.text, self.line_width - 1)}", "dim"))
        return row((" wire    ", "dim"), (self._dead_link(), "dim"))

    def _dead_link(self) -> str:
        """Return when a dead link is detected. Keep-alive needs 2 to 3 silent intervals (7.15.4)."""
        connection = self._view_model.connection
        if connection is None:
            return ""
        if connection.udp:
            return "UDP cannot detect a dead link"
        interval = connection.keep_alive_s
        if connection.unacknowledged:  # keep-alive rests meanwhile, and their own limit of 3 intervals counts
            limited = self._view_model.project.options.get("user_timeout", True)
            when = f"in {3 * interval}–{3 * interval + LATE_DETECTION_S} s" if limited else "in minutes"
            return f"unacknowledged: dead link {when}"
        return f"keep-alive {interval} s: dead link in {2 * interval}–{3 * interval} s"

    def _connection(self) -> str:
        connection = self._view_model.connection
        if connection is None:
            return ""
        if connection.udp:
            return self._address() or f"  UDP, {connection.state}"
        if connection.active:
            return f"  active, {connection.state}"
        listens = connection.state == "establishing" and connection.retry_in_ns is None
        return f"  passive, {LISTENING if listens else connection.state}"

    def _security_parts(self, instance: InstanceSnapshot) -> list[Part]:
        found = security_of(self._view_model.project.connect(instance.connect))
        return [(f"  {found.text}", "error strong" if found.is_unsafe else "dim")] if found else []

    def _address(self) -> str:
        """Return the ADDR variable and its value: `SOURCE 127.0.0.1:51322`."""
        instance, picture = self._view_model.instance, self._view_model.picture
        if instance is None or picture is None:
            return ""
        addr = picture.snapshot.addr(instance.addr)
        return f"  {addr.name} {addr.end}" if addr is not None else ""

    # -- toggling -----------------------------------------------------------------------------------

    def read_pin(self, pin: DrawnPin) -> tuple[int, bool]:
        instance = self._view_model.instance
        if instance is None:
            return 0, False
        if pin.is_fixed:
            return self._view_model.project.connection_id(instance.block, instance.connect) or 0, False
        waiting = self._pending.get((instance.name, pin.name))
        return (instance.pin(pin.name) or 0, False) if waiting is None else (waiting[0], True)

    def press(self, letter: str) -> str:
        """Toggle the pin of this letter. If the block has no such pin, return the reason."""
        pin = next((p for p in self.drawing().inputs if p.letter == letter), None)
        if pin is not None:
            self.toggle(pin)
            return ""
        instance = self._view_model.instance
        missing = next((name for name, key in PIN_LETTERS.items() if key == letter), "pin of this letter")
        return f"{instance.block} has no {missing}" if instance is not None else "there is no instance"

    def pin_key_hint(self, letter: str) -> str:
        """If a pin has this letter, return a hint that names the panes where the letter works."""
        pin = next((pin.name for pin in self.drawing().inputs if pin.letter == letter), "")
        return pin and f"{pin} is a key of panes 1 to 3: press 2, then {letter}"

    def letter_of(self, name: str) -> str:
        return next((pin.letter for pin in self.drawing().inputs if pin.name == name), "")

    def toggle(self, pin: DrawnPin) -> None:
        """Send the command that toggles or pulses a pin. For a number or a wired pin, open the prompt."""
        instance, snapshot = self._view_model.instance, self._view_model.snapshot
        if instance is None or snapshot is None:
            return
        value, _ = self.read_pin(pin)
        if pin.is_wired:
            line = make_pin_line(pin.name, instance, self._view_model)
            self._actions.open_prompt(line) if line else self._actions.complain(pin_hint(pin.name, instance))
        elif pin.is_fixed:
            why = f"{pin.name} is {value}: the description of {instance.connect} sets it (C)"
            self._actions.complain(why)
        elif not pin.is_bool:
            self._actions.open_prompt(f"set {instance.name} {pin.name}={self.propose_value(pin.name)}")
        elif pin.edge:
            self._actions.submit(f"pulse {instance.name} {pin.name}")
        else:
            self._pending[instance.name, pin.name] = (not value, snapshot.scan)
            self._actions.submit(f"set {instance.name} {pin.name}={int(not value)}")
        self.show()

    def _pin_under_cursor(self) -> DrawnPin | None:
        inputs = self.drawing().inputs
        return inputs[min(self._cursor, len(inputs) - 1)] if inputs else None

    def action_toggle_pin(self) -> None:
        pin = self._pin_under_cursor()
        if pin is not None:
            self.toggle(pin)

    def action_move(self, rows: int) -> None:
        last = len(self.drawing().inputs) - 1
        self._cursor = max(0, min(last, self._cursor + rows))
        shows_text = self._buffer_rows and self._cursor == last
        self.keep_in_view(self.row_count() - 1 if shows_text else self._cursor + 1)
        self.show()

    def on_click(self, event: events.Click) -> None:
        pin = self._index_under_mouse(event)
        if pin is not None:
            self._cursor = pin
            self.toggle(self.drawing().inputs[pin])

    def on_mouse_move(self, event: events.MouseMove) -> None:
        self._hover = self._index_under_mouse(event)
        self.show()

    def on_leave(self) -> None:
        self._hover = None
        self.show()

    def _index_under_mouse(self, event: events.MouseEvent) -> int | None:
        place, drawing = self.place_of(event), self.drawing()
        if place is None or not 1 <= place[1] <= len(drawing.inputs):
            return None
        return place[1] - 1 if place[0] < self._left_width() + 1 + self._in_box_width() else None


def _describe_last_done(instance: InstanceSnapshot) -> str:
    if instance.last_done_scan is None:
        return "no DONE yet"
    moved = instance.last_rcvd_len if block_row(instance.block).uses_network else None
    size = f"{moved} B " if moved is not None else ""
    return f"DONE {size}in scan {instance.last_done_scan}"
