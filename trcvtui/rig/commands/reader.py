"""The bench commands (contract 4.3): one line of text to one frozen command, a script to numbered steps."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final, Literal

from trcvtui.blocks.pins import Direction, Pin
from trcvtui.errors import Problem, UserError
from trcvtui.net.faults import DEFAULT_ERROR, KNOWN_ERRORS
from trcvtui.net.kernel import CALLS
from trcvtui.net.serial_line import SERIAL_CALLS
from trcvtui.project.names import expected_name
from trcvtui.project.project import SERIAL, SIMULATED, ComBufferDecl, InstanceDecl, Project
from trcvtui.project.tables import shown, whole
from trcvtui.rig.commands.data import read_write
from trcvtui.rig.commands.edit import read_add, read_change, read_remove, read_undo
from trcvtui.rig.commands.instances import after, read_create, read_delete, read_download, read_resize
from trcvtui.rig.commands.marks import read_prefix, read_suffix
from trcvtui.rig.commands.peer import read_peer_command
from trcvtui.rig.commands.read_conditions import read_expect, read_instance, read_wait
from trcvtui.rig.commands.read_payload import FORMS, is_payload, read_payload
from trcvtui.rig.commands.tokens import Words, duration, pin_value, value_of
from trcvtui.rig.commands.words import (
    FOREVER,
    BenchCommand,
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
    Step,
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
LONGEST_LINE: Final = 1_000_000
LONGEST_SHOWN: Final = 60


def parse_line(text: str, project: Project, where: str) -> BenchCommand | None:
    """Return the command of one line, None for a blank line or a comment; raise UserError.

    `where` stands at the beginning of each message.
    """
    if len(text) > LONGEST_LINE:
        raise UserError(Problem(where, f"{len(text)} characters", f"at most {LONGEST_LINE} in a line"))
    words = Words(text, where)
    if not words:
        return None
    verb = words.next("a command")
    if verb not in VERBS:
        raise words.wrong(shown(verb), expected_name(verb, VERBS, "command"))
    command = VERBS[verb](words, project)
    words.finish()
    return command


def parse_script(text: str, project: Project, where: str) -> list[Step]:
    """Return the commands of a script, numbered from 1; raise UserError with the mistakes of all lines."""
    steps: list[Step] = []
    problems: list[Problem] = []
    number = 0
    for line in map(str.strip, text.split("\n")):  # \r\n too; U+2028 and the like stand inside a command
        if not line or line.startswith("#"):
            continue
        number += 1
        try:
            command = parse_line(line, project, f"{where}: step {number} ({_short(line)})")
        except UserError as wrong:
            problems += wrong.problems
            continue
        if command is not None:
            steps.append(Step(number, line, command))
            project = after(command, project)
    if problems:
        raise UserError(problems)
    return steps


def _short(line: str) -> str:
    return line if len(line) <= LONGEST_SHOWN else line[: LONGEST_SHOWN - 3] + "..."


# -- inputs ----------------------------------------------------------------------------------------------


def _set(words: Words, project: Project) -> Set | Change:
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


def _pulse(words: Words, project: Project) -> Pulse:
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


def _plc(words: Words, project: Project) -> PlcStop | PlcRun:
    return PlcRun() if _one_of(words, "stop", "run") == "run" else PlcStop()


def _link(words: Words, project: Project) -> Link:
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


def _fault(words: Words, project: Project) -> FaultOn | FaultClear:
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


def _run(words: Words, project: Project) -> RunScans | RunFor:
    text = words.next("a number of scans or a duration such as T#200ms")
    if "#" in text and not text.startswith(("2#", "8#", "16#")):
        return RunFor(duration(text, "", words.where))
    return RunScans(value_of(SCANS, text, "", words.where))


VERBS: Final[dict[str, Callable[[Words, Project], BenchCommand]]] = {
    "set": _set,
    "pulse": _pulse,
    "write": read_write,
    "resize": read_resize,
    "create": read_create,
    "add": read_add,
    "delete": read_delete,
    "download": read_download,
    "plc": _plc,
    "peer": read_peer_command,
    "feed": read_feed,
    "prefix": read_prefix,
    "suffix": read_suffix,
    "link": _link,
    "fault": _fault,
    "run": _run,
    "wait": read_wait,
    "expect": read_expect,
    "remove": read_remove,
    "undo": read_undo,
}
