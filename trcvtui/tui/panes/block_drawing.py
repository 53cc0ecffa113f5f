"""A function block as a drawing: its pins on both sides, as the project names them for the block."""

from __future__ import annotations

from typing import Final, NamedTuple

from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.plc.wired_pins import BUFFER_PINS, buffer_pin, data_pin, mark_pins
from trcvtui.project.project import Project
from trcvtui.tui.formatting import lamp, status_word
from trcvtui.tui.view_model.afterglow import DONE, ERROR, Afterglow
from trcvtui.tui.widgets.keys import letters_of


class DrawnPin(NamedTuple):
    """A pin as the drawing needs it; `letter` toggles it, "" on an output. `label` is drawn as its name.

    `is_fixed`: the project file says what stands there, as it does at CONNECT.
    """

    name: str
    text: str
    is_bool: bool
    edge: bool
    letter: str
    label: str
    is_wired: bool = False  # by the project file: no scan writes it
    is_fixed: bool = False


UNNAMED: Final = ("CONNECT", "DATA")  # drawn below the box: the project file names them
ID: Final = DrawnPin(
    "ID", "the ID of the connection, as its description has it", False, False, "", "ID", is_fixed=True
)
LAMP_STYLES: Final = {
    "ERROR": "error", "DONE": "done", "BUSY": "busy", "DataReceived": "done", "StringReceived": "done",
    "ByteReceived": "done", "busy": "busy", "Busy": "busy", "RxTimeout": "warn",
}  # fmt: skip
DONE_PINS: Final = ("DONE", "DataReceived", "StringReceived", "ByteReceived")


class Drawing(NamedTuple):
    """Both sides of a block."""

    inputs: tuple[DrawnPin, ...] = ()
    outputs: tuple[DrawnPin, ...] = ()

    @property
    def name_width(self) -> int:
        """Return the width of the longest input name."""
        return max((len(pin.name) for pin in self.inputs), default=4)

    @property
    def label_width(self) -> int:
        """Return the width of the longest output, as it is drawn."""
        return max((len(pin.label) for pin in self.outputs), default=4)

    @property
    def height(self) -> int:
        """Return the lines of the longer side."""
        return max(len(self.inputs), len(self.outputs))


WIRED_LETTERS: Final = {
    "pPrefix": "f", "Prefix": "f", "pSuffix": "u", "Suffix": "u", "pReceiveData": "d", "ReceivedString": "d",
    "pSendData": "d", "SendString": "d", "RxBuffer": "c", "TxBuffer": "c", "Buffer": "c",
}  # fmt: skip
BEFORE: Final = {"pPrefix": "LenPrefix", "pSuffix": "LenSuffix", "pReceiveData": "SizeReceiveData"}


def wired_pins(block: str) -> dict[str, DrawnPin]:
    """Return the pins of a block on a ComBuffer that the project file wires, by name."""
    if not buffer_pin(block):
        return {}
    marks = mark_pins(block)
    found = {name: f"{mark}, as hex or text; its length follows" for name, mark in marks.items()}
    if data_pin(block):
        found[data_pin(block)] = "the variable of the bytes; its type is its size"
    found[buffer_pin(block)] = "the ComBuffer; a simulated line can be fed"
    return {
        name: DrawnPin(name, text, False, False, WIRED_LETTERS[name], name, True)
        for name, text in found.items()
    }


def placed(pins: list[DrawnPin], wired: dict[str, DrawnPin]) -> tuple[DrawnPin, ...]:
    """Return the inputs as the manual draws them: a pointer before its length, the ComBuffer at the end."""
    rest = dict(wired)
    found: list[DrawnPin] = []
    for pin in pins:
        found += [rest.pop(name) for name, before in BEFORE.items() if before == pin.name and name in rest]
        found.append(pin)
    buffer = [rest.pop(name) for name in BUFFER_PINS if name in rest]
    return (*rest.values(), *found, *buffer)


def drawing_of(project: Project, block: str, connect: str) -> Drawing:
    """Return the drawing of a block that works on a CONNECT; its ID stands behind the first pin."""
    pins = [pin for pin in project.pins(block) if pin.name not in UNNAMED]
    wired = wired_pins(block)
    letters = letters_of(
        [pin.name for pin in pins if pin.direction != "out"], {pin.letter for pin in wired.values()}
    )
    drawn = [
        (
            pin.direction,
            DrawnPin(
                pin.name,
                pin.text,
                pin.is_bool,
                pin.edge,
                letters.get(pin.name, ""),
                pin.label or pin.name,
            ),
        )
        for pin in pins
    ]
    inputs = placed([pin for direction, pin in drawn if direction != "out"], wired)
    if project.identity(block, connect) is not None:
        inputs = (*inputs[:1], ID, *inputs[1:])
    return Drawing(inputs, tuple(pin for direction, pin in drawn if direction == "out"))


def output_text(pin: DrawnPin, instance: InstanceSnapshot | None, glowing: bool) -> tuple[str, str]:
    """Return the value of an output inside the box, and its style."""
    value = (instance.pin(pin.name) if instance else None) or 0
    if pin.is_bool:
        style = LAMP_STYLES.get(pin.name, "on") if value else "glow" if glowing else ""
        return f"{int(value)} {lamp(bool(value), glowing)}", style
    if pin.name == "STATUS":
        return status_word(value), _status_style(instance)
    if pin.name == "Error":
        return str(int(value)), _status_style(instance)
    return str(int(value)), "glow" if glowing else ""


def glow_text(pin: DrawnPin, instance: InstanceSnapshot | None, afterglow: Afterglow, t_ns: int) -> str:
    """Return what an output was for one scan a moment ago: its scan, RCVD_LEN, or STATUS."""
    if instance is None:
        return ""
    done = None if instance.done else afterglow.glow(instance.name, DONE, t_ns)
    error = None if instance.error else afterglow.glow(instance.name, ERROR, t_ns)
    texts = {
        **dict.fromkeys(DONE_PINS, f"{done.scan}" if done else ""),
        "RCVD_LEN": f"{done.rcvd_len}" if done and done.rcvd_len is not None else "",
        "ERROR": f"{error.scan}" if error else "",
        "STATUS": f"{error.status:04X}" if error and error.status else "",
    }
    text = texts.get(pin.name, "")
    blank = "" if pin.name == "RCVD_LEN" and len(text) > 4 else " "  # the frame has no room for both
    return f"{blank}◂{text}" if text else ""


def _status_style(instance: InstanceSnapshot | None) -> str:
    if instance is None:
        return ""
    return "error" if instance.error else "done" if instance.done else "strong"
