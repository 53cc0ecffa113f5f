"""Reads lines about inputs, the running program, PLC, wire, faults and time; returns frozen commands."""

from __future__ import annotations

import re
from typing import Final, Literal, NamedTuple

from msgspec.structs import replace

from trcvtui.blocks.pins import Direction, Pin, PinValue
from trcvtui.blocks.table import block_row, known_blocks
from trcvtui.commands.conditions import parse_instance
from trcvtui.commands.edit import make_edits, parse_change
from trcvtui.commands.tokens import (
    FORMS,
    Payload,
    Words,
    parse_delay,
    parse_payload,
    parse_pin_value,
    parse_value,
)
from trcvtui.commands.words import (
    TIMES_FOREVER,
    AddEntry,
    AddVariable,
    AskDoctor,
    BenchCommand,
    Change,
    CreateBlock,
    DeleteBlock,
    FaultClear,
    FaultOn,
    FeedSerial,
    PlcRun,
    PlcStop,
    PulsePin,
    Remove,
    Retype,
    RunFor,
    RunScans,
    SetInputs,
    SetLink,
    TapAct,
    UndoEdit,
)
from trcvtui.errors import UserError
from trcvtui.net.faults import DEFAULT_ERROR, KNOWN_ERRORS
from trcvtui.net.kernel import KERNEL_CALLS
from trcvtui.net.serial_line import SERIAL_CALLS
from trcvtui.project.edit import apply_as_step, undo_step
from trcvtui.project.file import RESERVED_NAMES
from trcvtui.project.keys import link_key
from trcvtui.project.project import SERIAL, SIMULATED, ComBufferDecl, DataDecl, InstanceDecl, Project
from trcvtui.project.tables import IDENTIFIER_TEXT, expected_name, integer, quote, with_article
from trcvtui.udt.layout.layout import lay_out
from trcvtui.udt.layout.rules import NO_CHOICE
from trcvtui.udt.sources import parse_type

# Later lines are read with the project as these commands leave it: see `project_after`.


def parse_create(words: Words, project: Project) -> CreateBlock:
    """Read `create BLOCK NAME connect=C1 data=rx [task=MAIN] [PIN=VALUE ...]`, or raise UserError."""
    blocks = known_blocks(project.dialect.blocks)
    block = words.next_known(blocks, "block", "a block such as TRCV_C")
    name = _read_new_name(words, project)
    given = _read_pairs(words)
    link = _read_link(given, block, words, project)
    data = None
    if block_row(block).data_pin:
        data = _read_name(given, "data", [d.name for d in project.data], "DATA", words)
    known = [d.name for d in project.data]
    pointers = [_read_name(given, key, known, "DATA", words) or "" for key in block_row(block).pointers]
    task = _read_name(given, "task", [t.name for t in project.tasks], "task", words)
    inputs = _read_inputs(given, block, words, project)
    task = task or project.tasks[0].name
    made = InstanceDecl(
        name, block, link.name, data, task, inputs, link.addr, link.is_config, tuple(pointers)
    )
    return CreateBlock(made)


class _Link(NamedTuple):
    """The CONNECT, UDP_CONFIG or ComBuffer of a block, and the ADDR if the block has one."""

    name: str
    addr: str | None = None
    is_config: bool = False


def _read_link(given: dict[str, str], block: str, words: Words, project: Project) -> _Link:
    row = block_row(block)
    if row.has_com_buffer:
        return _Link(_demand(given, row.buffer_pin, [b.name for b in project.combuffers], "ComBuffer", words))
    connects, addrs = [c.name for c in project.connects], [a.name for a in project.addrs]
    if row.speaks_udp and not (row.datagrams and "connect" in given):
        config = _demand(given, "config", [u.name for u in project.udp_configs], "UDP_CONFIG", words)
        return _Link(config, _demand(given, "addr", addrs, "ADDR", words), is_config=True)
    connect = _demand(given, "connect", connects, "CONNECT", words)
    if row.speaks_udp:
        return _Link(connect, _demand(given, "addr", addrs, "ADDR", words))
    takes_addr = row.owns_link and project.dialect.describes_connects
    return _Link(connect, _read_name(given, "addr", addrs, "ADDR", words) if takes_addr else None)


def _demand(given: dict[str, str], key: str, names: list[str], what: str, words: Words) -> str:
    name = _read_name(given, key, names, what, words)
    if name is None:
        raise words.error(f"no {key}=", f"{key}= and the name of {with_article(what)}")
    return name


def _read_new_name(words: Words, project: Project) -> str:
    name = words.next("a name for the new instance")
    if not name.isidentifier() or name in RESERVED_NAMES:
        raise words.error(quote(name), IDENTIFIER_TEXT)
    if project.instance(name) is not None or project.data_decl(name) is not None:
        raise words.error(f"{quote(name)}, which is there already", "an unused name", "taken")
    return name


def _read_pairs(words: Words) -> dict[str, str]:
    pairs: dict[str, str] = {}
    for word in words.take_rest():
        key, equals, text = word.partition("=")
        if not equals or key in pairs:
            found = quote(word) + f", the second {key}=" * bool(equals)
            raise words.error(found, "KEY=VALUE, each key once, such as connect=C1 data=rx CONT=1")
        pairs[key] = text
    return pairs


def _read_name(given: dict[str, str], key: str, names: list[str], what: str, words: Words) -> str | None:
    name = given.pop(key, None)
    if name is not None and name not in names:
        raise words.error(f"{key}={name}", expected_name(name, names, what), "unknown")
    return name


def _read_inputs(
    given: dict[str, str], block: str, words: Words, project: Project
) -> tuple[tuple[str, PinValue], ...]:
    row = block_row(block)
    pins = {pin.name: pin for pin in project.pins(block) if pin.direction is not Direction.OUT}
    link = ("config", "addr") if row.speaks_udp else (link_key(block), *row.pointers)
    keys = (*link, "task", *pins)
    for key in given:
        if key == "data":
            raise words.error("'data'", f"no DATA: {block} has no such pin")
        if key not in pins:
            with_data = ("data", *keys) if row.data_pin else keys
            raise words.make_unknown_error(key, with_data, "key or input")
    return tuple((key, parse_pin_value(pins[key], text, words.where)) for key, text in given.items())


def parse_resize(words: Words, project: Project) -> Retype:
    """Read `resize rx ARRAY[0..9] OF BYTE`, or raise UserError."""
    name = words.next_known([decl.name for decl in project.data], "DATA variable")
    type_name = words.take_rest_text("an IEC type or a UDT")
    try:
        return Retype(name, type_name, declare_data(name, type_name, project, words.where))
    except UserError as refused:
        if all(wrong.where.startswith(words.where) for wrong in refused.problems):
            raise
        raise UserError(
            replace(wrong, where=f"{words.where}: {wrong.where}") for wrong in refused.problems
        ) from None


def declare_data(name: str, type_name: str, project: Project, where: str) -> DataDecl:
    """Return a variable, or raise UserError. A known one keeps its layout, a new one gets the project's."""
    type_ = parse_type(type_name, project.types, where)
    known = project.data_decl(name)
    choice = known.choice if known is not None else NO_CHOICE
    layout = lay_out(type_, choice.rules(project.layout), name)
    is_optimized = known is not None and known.optimized
    return DataDecl(name, type_name, type_, layout, layout.size, is_optimized, choice)


def project_after(command: BenchCommand, project: Project) -> Project:
    match command:
        case CreateBlock(decl):
            return replace(project, instances=(*project.instances, decl))
        case AddEntry() | AddVariable() | Change() | Remove():
            return apply_as_step(project, make_edits(command, project))
        case UndoEdit():
            return undo_step(project)
        case DeleteBlock(name):
            return replace(project, instances=tuple(i for i in project.instances if i.name != name))
        case Retype(_, _, decl):
            return replace(project, data=tuple(decl if d.name == decl.name else d for d in project.data))
        case _:
            return project


BREAK_WORD: Final = "break"


def can_be_fed(buffer: ComBufferDecl) -> bool:
    """Return whether `feed` may use a ComBuffer: its source is `sim` or `serial`, and it has no `line`."""
    return buffer.source in (SIMULATED, SERIAL) and not buffer.line


def parse_feed(words: Words, project: Project) -> FeedSerial:
    """Read `feed RX hex 01 02`, `feed RX text "abc"` or `feed RX break`, or raise UserError."""
    lines = [buffer.name for buffer in project.combuffers if can_be_fed(buffer)]
    name = words.next_known(lines, f'ComBuffer with source = "{SIMULATED}"')
    if words.peek() == BREAK_WORD:
        words.next(BREAK_WORD)
        return FeedSerial(name, None)
    form = words.peek()
    if form and form not in FORMS:
        expected = expected_name(form, (*FORMS, BREAK_WORD), "form of payload")
        raise words.error(quote(words.next(BREAK_WORD)), expected)
    payload = parse_payload(words, project)
    return FeedSerial(name, payload.content, payload.text)


SCAN_COUNT_KIND: Final = integer(1, 1_000_000_000)
COUNT_KIND: Final = integer(1, 1_000_000_000)


# -- inputs ----------------------------------------------------------------------------------------------


def parse_set(words: Words, project: Project) -> SetInputs | Change:
    change = parse_change(words, project)
    if change is not None:
        return change
    instance = parse_instance(words, project)
    pins: list[tuple[str, PinValue | Literal["blink"]]] = []
    for word in words.take_rest() or [words.next("an input such as CONT=1")]:
        name, equals, text = word.partition("=")
        if not equals:
            raise words.error(quote(word), "PIN=VALUE such as CONT=1")
        pin = _find_input(name, instance, words, project)
        if text == "blink" and pin.is_bool:
            pins.append((pin.name, "blink"))
        else:
            pins.append((pin.name, parse_pin_value(pin, text, words.where)))
    return SetInputs(instance.name, tuple(pins))


def parse_pulse(words: Words, project: Project) -> PulsePin:
    instance = parse_instance(words, project)
    pin = _find_input(words.next("an input such as EN_R"), instance, words, project)
    if not pin.is_bool:
        raise words.error(f"'{pin.name}', a {pin.iec_type}", "a BOOL input")
    return PulsePin(instance.name, pin.name)


def _find_input(name: str, instance: InstanceDecl, words: Words, project: Project) -> Pin:
    pins = project.pins(instance.block)
    inputs = {pin.name: pin for pin in pins if pin.direction is not Direction.OUT}
    if name in inputs:
        return inputs[name]
    if any(pin.name == name for pin in pins):
        raise words.error(f"{quote(name)}, an output", f"one of {', '.join(inputs)}")
    raise words.make_unknown_error(name, inputs, "input")


# -- the PLC, the wire, faults ---------------------------------------------------------------------------


def parse_plc_command(words: Words, project: Project) -> PlcStop | PlcRun:
    return PlcRun() if words.next_choice("stop", "run") == "run" else PlcStop()


def parse_link(words: Words, project: Project) -> SetLink:
    name = words.next_known(project.links(), "CONNECT")
    return SetLink(name, words.next_choice("down", "up") == "up")


def parse_doctor(words: Words, project: Project) -> AskDoctor:
    """Read `doctor [NAME] [CAUSE]`. A word that names no instance and no CONNECT is a cause."""
    names = {each.name for each in project.instances} | set(project.links())
    name = words.next("") if words and words.peek() in names else ""
    cause = words.next("") if words else ""
    if not _CAUSE_PATTERN.fullmatch(cause):
        raise words.error(quote(cause), "an instance, a CONNECT, a cause such as frame-short, or healthy")
    return AskDoctor(name, cause)


_CAUSE_PATTERN: Final = re.compile("[a-z-]*")
MOST_INSERTED: Final = 1 << 20  # bytes: a tap holds no more
HELD_OFFSET_KIND: Final = integer(0, MOST_INSERTED)
CONVERSATION_KIND: Final = integer(1, (1 << 32) - 1)
# What follows each verb: sizes in this form, and "bytes" for a payload.
TAP_VERBS: Final[dict[str, tuple[str, str]]] = {
    "hold": ("", ""),
    "go": ("", ""),
    "drop": ("N", ""),
    "insert": ("", "bytes"),
    "edit": ("OFFSET", "bytes"),
    "delay": ("T#..", ""),
    "split": ("3,7", ""),
    "rst": ("", ""),
    "fin": ("", ""),
}


def parse_tap(words: Words, project: Project) -> TapAct:
    name = words.next_known([tap.name for tap in project.taps], "tap")
    to_plc = words.next_choice("to-plc", "from-plc") == "to-plc"
    conversation = 0
    if words.peek() == "conversation":
        words.next("conversation")
        conversation = parse_value(CONVERSATION_KIND, words.next("N"), "conversation ", words.where)
    verb = words.next_choice(*TAP_VERBS)
    tail = words.cut_tail_words(lambda word: word == "conversation")
    if tail:
        if len(tail) != 2:
            raise words.error(quote(" ".join(tail)), "conversation N at the end")
        conversation = parse_value(CONVERSATION_KIND, tail[1], "conversation ", words.where)
    mark, takes_bytes = TAP_VERBS[verb]
    sizes: tuple[int, ...] = ()
    if mark:
        text = words.next(mark)
        if verb == "delay":
            sizes = (parse_delay(text, "delay ", words.where),)
        else:
            kind = HELD_OFFSET_KIND if verb == "edit" else COUNT_KIND
            parts = text.split(",") if verb == "split" else [text]
            sizes = tuple([parse_value(kind, part, f"{verb} ", words.where) for part in parts])
    payload = parse_payload(words, project) if takes_bytes else Payload(b"", "")
    if len(payload.content) > MOST_INSERTED:
        raise words.error(f"{len(payload.content)} bytes", f"at most {MOST_INSERTED} bytes")
    words.expect_end()
    return TapAct(name, to_plc, verb, sizes, payload.content, payload.text, conversation)


SERIAL_BUFFER_TEXT: Final = 'ComBuffer with source = "serial"'


def parse_fault(words: Words, project: Project) -> FaultOn | FaultClear:
    call = words.next("a kernel call (such as bind) or `clear`")
    if call == "clear":
        return FaultClear()
    ports = tuple(buffer.name for buffer in project.combuffers if buffer.serial is not None)
    calls = (*KERNEL_CALLS, *SERIAL_CALLS) if ports else KERNEL_CALLS
    if call not in calls:
        raise words.make_unknown_error(call, (*calls, "clear"), "call")
    error = _read_error(words, call)
    on, counts = None, {"nth": 1, "times": 1}
    while words:
        word = words.next("")
        key, equals, text = word.partition("=")
        if word == "on" and on is None:
            on = words.next_known(
                *((ports, SERIAL_BUFFER_TEXT) if call in SERIAL_CALLS else (project.links(), "CONNECT"))
            )
        elif key in counts and equals:
            forever = key == "times" and text == "forever"
            counts[key] = TIMES_FOREVER if forever else parse_value(COUNT_KIND, text, f"{key}=", words.where)
        else:
            owner = "COMBUFFER" if call in SERIAL_CALLS else "CONNECT"
            raise words.error(quote(word), f"`on {owner}`, `nth=1`, `times=1` or `times=forever`")
    return FaultOn(call, error, on, counts["nth"], counts["times"])


def _read_error(words: Words, call: str) -> str | None:
    if not re.match(r"[Ee]\w+$", words.peek()):
        return None
    error = words.next("")
    if error not in KNOWN_ERRORS:
        near = expected_name(error, sorted(KNOWN_ERRORS), "errno")
        raise words.error(
            quote(error), f"an errno name such as {DEFAULT_ERROR[call]}" if "," in near else near
        )
    return error


# -- time ------------------------------------------------------------------------------------------------


def parse_run(words: Words, project: Project) -> RunScans | RunFor:
    text = words.next("a number of scans or a duration such as T#200ms")
    if "#" in text and not text.startswith(("2#", "8#", "16#")):
        return RunFor(parse_delay(text, "", words.where))
    return RunScans(parse_value(SCAN_COUNT_KIND, text, "", words.where))
