"""Lines of inputs, the PLC, the wire, faults and time, read into frozen commands."""

from __future__ import annotations

import re
from typing import Final, Literal

from trcvtui.blocks.pins import Direction, Pin
from trcvtui.net.faults import DEFAULT_ERROR, KNOWN_ERRORS
from trcvtui.net.kernel import CALLS
from trcvtui.net.serial_line import SERIAL_CALLS
from trcvtui.project.names import expected_name
from trcvtui.project.project import SERIAL, SIMULATED, ComBufferDecl, InstanceDecl, Project
from trcvtui.project.tables import shown, whole
from trcvtui.rig.commands.edit import read_change
from trcvtui.rig.commands.read_conditions import read_instance
from trcvtui.rig.commands.read_payload import FORMS, is_payload, read_payload
from trcvtui.rig.commands.tokens import Words, duration, pin_value, value_of
from trcvtui.rig.commands.words import (
    FOREVER,
    Change,
    FaultClear,
    FaultOn,
    FeedLine,
    Link,
    PinValue,
    PlcRun,
    PlcStop,
    Pulse,
    RunFor,
    RunScans,
    Set,
)

BREAK: Final = "break"


def may_be_fed(buffer: ComBufferDecl) -> bool:
    """Return whether bench commands may let bytes arrive in a ComBuffer: a line of its own, no way out."""
    return buffer.source in (SIMULATED, SERIAL) and not buffer.line


def read_feed(words: Words, project: Project) -> FeedLine:
    """Return `feed RX hex 01 02`, `feed RX text "abc"` or `feed RX break`; raise UserError."""
    name = words.next("the name of a ComBuffer")
    lines = [buffer.name for buffer in project.combuffers if may_be_fed(buffer)]
    if name not in lines:
        raise words.wrong(shown(name), expected_name(name, lines, f'ComBuffer with source = "{SIMULATED}"'))
    if words.peek() == BREAK:
        words.next(BREAK)
        return FeedLine(name, None)
    form = words.peek()
    if form and not is_payload(form):
        expected = expected_name(form, (*FORMS, BREAK), "form of payload")
        raise words.wrong(shown(words.next(BREAK)), expected)
    payload = read_payload(words, project)
    return FeedLine(name, payload.content, payload.text)


SCANS: Final = whole(1, 1_000_000_000)
COUNT: Final = whole(1, 1_000_000_000)


# -- inputs ----------------------------------------------------------------------------------------------


def read_set(words: Words, project: Project) -> Set | Change:
    change = read_change(words, project)
    if change is not None:
        return change
    instance = read_instance(words, project)
    pins: list[tuple[str, PinValue | Literal["blink"]]] = []
    for word in words.rest() or [words.next("an input such as CONT=1")]:
        name, equals, text = word.partition("=")
        if not equals:
            raise words.wrong(shown(word), "PIN=VALUE such as CONT=1")
        pin = _input(name, instance, words, project)
        if text == "blink" and pin.is_bool:
            pins.append((pin.name, "blink"))
        else:
            pins.append((pin.name, pin_value(pin, text, words.where)))
    return Set(instance.name, tuple(pins))


def read_pulse(words: Words, project: Project) -> Pulse:
    instance = read_instance(words, project)
    pin = _input(words.next("an input such as EN_R"), instance, words, project)
    if not pin.is_bool:
        raise words.wrong(f"'{pin.name}', a {pin.iec_type}", "a BOOL input")
    return Pulse(instance.name, pin.name)


def _input(name: str, instance: InstanceDecl, words: Words, project: Project) -> Pin:
    pins = project.pins(instance.block)
    inputs = {pin.name: pin for pin in pins if pin.direction is not Direction.OUT}
    if name in inputs:
        return inputs[name]
    is_output = any(pin.name == name for pin in pins)
    found = f"{shown(name)}, an output" if is_output else shown(name)
    raise words.wrong(
        found, f"one of {', '.join(inputs)}" if is_output else expected_name(name, inputs, "input")
    )


# -- the PLC, the wire, faults ---------------------------------------------------------------------------


def read_plc(words: Words, project: Project) -> PlcStop | PlcRun:
    return PlcRun() if _one_of(words, "stop", "run") == "run" else PlcStop()


def read_link(words: Words, project: Project) -> Link:
    name = _connect(words, project)
    return Link(name, _one_of(words, "down", "up") == "up")


def _one_of(words: Words, *known: str) -> str:
    word = words.next(" or ".join(known))
    if word not in known:
        raise words.wrong(shown(word), " or ".join(known))
    return word


def _connect(words: Words, project: Project) -> str:
    name = words.next("the name of a CONNECT")
    names = project.links()
    if name not in names:
        raise words.wrong(shown(name), expected_name(name, names, "CONNECT"))
    return name


def read_fault(words: Words, project: Project) -> FaultOn | FaultClear:
    call = words.next("a kernel call such as bind, or clear")
    if call == "clear":
        return FaultClear()
    ports = tuple(buffer.name for buffer in project.combuffers if buffer.serial is not None)
    calls = (*CALLS, *SERIAL_CALLS) if ports else CALLS
    if call not in calls:
        raise words.wrong(shown(call), expected_name(call, (*calls, "clear"), "call"))
    error = _error(words, call)
    on, counts = None, {"nth": 1, "times": 1}
    while words:
        word = words.next("")
        key, equals, text = word.partition("=")
        if word == "on" and on is None:
            on = _port(words, ports) if call in SERIAL_CALLS else _connect(words, project)
        elif key in counts and equals:
            forever = key == "times" and text == "forever"
            counts[key] = FOREVER if forever else value_of(COUNT, text, f"{key}=", words.where)
        else:
            owner = "ComBuffer" if call in SERIAL_CALLS else "CONNECT"
            raise words.wrong(shown(word), f"on {owner}, nth=1, times=1 or times=forever")
    return FaultOn(call, error, on, counts["nth"], counts["times"])


def _port(words: Words, ports: tuple[str, ...]) -> str:
    name = words.next("the name of a ComBuffer")
    if name not in ports:
        raise words.wrong(shown(name), expected_name(name, ports, 'ComBuffer with source = "serial"'))
    return name


def _error(words: Words, call: str) -> str | None:
    if not re.match(r"[Ee]\w+$", words.peek()):
        return None
    error = words.next("")
    if error not in KNOWN_ERRORS:
        near = expected_name(error, sorted(KNOWN_ERRORS), "errno")
        raise words.wrong(
            shown(error), f"an errno name such as {DEFAULT_ERROR[call]}" if "," in near else near
        )
    return error


# -- time ------------------------------------------------------------------------------------------------


def read_run(words: Words, project: Project) -> RunScans | RunFor:
    text = words.next("a number of scans or a duration such as T#200ms")
    if "#" in text and not text.startswith(("2#", "8#", "16#")):
        return RunFor(duration(text, "", words.where))
    return RunScans(value_of(SCANS, text, "", words.where))
