"""One row for each bench command: how its line is read, written and completed, and what it does.

Reading, writing, completing and carrying out a line all use these rows. No other list of commands exists.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, Final, Protocol

from msgspec import Struct, structs

from trcvtui.blocks.table import block_row, is_time_pin
from trcvtui.commands import completion, reader, words
from trcvtui.commands.conditions import parse_expect, parse_instance, parse_mark, parse_wait, parse_write
from trcvtui.commands.counters_and_checksums import DECIMAL_DIGITS, NUMBER_KINDS, Fill
from trcvtui.commands.edit import format_add, parse_add, parse_remove, parse_undo
from trcvtui.commands.peer import SIMPLE_VERBS, PeerActions, parse_peer_command
from trcvtui.commands.reader import parse_create, parse_resize, project_after
from trcvtui.commands.tokens import Words
from trcvtui.commands.words import BenchCommand, Contains, EditCommand, FieldIs, Match, StartsWith, Step
from trcvtui.errors import Problem, UserError, collect_problems, raise_all_problems
from trcvtui.plc import commands
from trcvtui.project.keys import link_key
from trcvtui.project.project import Project
from trcvtui.udt.layout.coding import Value
from trcvtui.udt.literals import format_duration, quote_text
from trcvtui.udt.resolve import KNOWN_TYPE

MILLISECOND: Final = 1_000_000
_LITERAL_PATTERN: Final = re.compile(r"[A-Z]+#[-\w.:]+", re.ASCII)  # T#5s and the like need no quotes


def _pins_text(pins: tuple[tuple[str, Any], ...]) -> str:
    return " ".join(f"{name}={pin_value_text(name, value)}" for name, value in pins)


def pin_value_text(name: str, value: bool | int | str) -> str:
    if isinstance(value, str):
        return value
    if is_time_pin(name):
        return format_duration(value * MILLISECOND)
    return f"{value:04X}" if name == "STATUS" else str(int(value))


def _data_bytes_text(data: str, offset: int, payload: bytes) -> str:
    return f"{data}{f'+{offset}' if offset else ''} hex {payload.hex(' ')}"


def format_create(c: words.CreateBlock) -> str:
    decl = c.decl
    parts = [f"create {decl.block} {decl.name} {link_key(decl.block)}={decl.connect}"]
    parts += [f"data={decl.data}"] if decl.data is not None else []
    named = zip(block_row(decl.block).pointers, decl.pointers, strict=False)
    parts += [f"{key}={name}" for key, name in named if name]
    parts += [f"task={decl.task}"] if decl.task else []
    return " ".join(parts + [_pins_text(decl.inputs)] * bool(decl.inputs))


def format_feed(c: words.FeedSerial) -> str:
    return f"feed {c.buffer} {'break' if c.payload is None else c.text or 'hex ' + c.payload.hex(' ')}"


def message_text(c: words.PeerSend) -> str:
    """Return the message as it is written after `peer P1 send`."""
    if c.text.startswith("message "):
        return c.text  # its options are in the library
    parts = [c.text or f"hex {c.payload.hex(' ')}"]
    parts += [_fill_text(fill) for fill in c.fills if not (fill.hole and c.text)]
    if c.split:
        parts.append(f"split={','.join(map(str, c.split))}")
    if c.gap_ns or c.gaps_ns:
        parts.append(f"gap={','.join(map(format_duration, c.gaps_ns or (c.gap_ns,)))}")
    if c.repeat != 1:
        parts.append(f"repeat={c.repeat}")
    if c.every_ns:
        parts.append(f"every={format_duration(c.every_ns)}")
    return " ".join(parts)


def _fill_text(fill: Fill) -> str:
    text = f"{fill.kind}={fill.offset}"
    if fill.kind in NUMBER_KINDS:
        text += f":{fill.width}"
    return text + (f":{fill.order}" if fill.width > 1 and fill.kind != DECIMAL_DIGITS else "")


def rule_text(c: words.AddReply) -> str:
    """Return a rule as it is written in `replies` of a project file."""
    return f"{match_text(c.match)} send {message_text(c.send)}"


def match_text(match: Match) -> str:
    match match:
        case Contains(payload, text):
            return f"contains {text or 'hex ' + payload.hex(' ')}"
        case StartsWith(payload, text):
            return f"starts {text or 'hex ' + payload.hex(' ')}"
        case FieldIs(type_name, path, value):
            return f"field {type_name}.{path} = {value_text(value)}"


def format_check(c: words.NumberedFramesOn) -> str:
    parts = [f"peer {c.peer} check on size={c.size} every={format_duration(c.every_ns)}"]
    return " ".join(parts + [f"on {c.instance}"] * bool(c.instance))


def format_try_splits(c: words.TrySplits) -> str:
    parts = [f"peer {c.peer} try-splits {c.text or 'hex ' + c.payload.hex(' ')} on {c.instance}"]
    if c.gap_ns:
        parts.append(f"gap={format_duration(c.gap_ns)}")
    if c.differ != 0:
        parts.append(f"differ={'any' if c.differ is None else c.differ}")
    return " ".join(parts)


def format_tap(c: words.TapAct) -> str:
    sizes = format_duration(c.sizes[0]) if c.verb == "delay" else ",".join(map(str, c.sizes))
    data = c.text or (f"hex {c.payload.hex(' ')}" if c.payload else "")
    newest = f"conversation {c.conversation}" if c.conversation else ""
    parts = "tap", c.tap, "to-plc" if c.to_plc else "from-plc", c.verb, sizes, data, newest
    return " ".join(filter(None, parts))


def format_fault(c: words.FaultOn) -> str:
    parts = ["fault", c.call]
    if c.error is not None:
        parts.append(c.error)
    if c.on is not None:
        parts += ["on", c.on]
    if c.nth != 1:
        parts.append(f"nth={c.nth}")
    if c.times != 1:
        parts.append(f"times={'forever' if c.times == words.TIMES_FOREVER else c.times}")
    return " ".join(parts)


def format_wait(c: words.Wait) -> str:
    limit = "" if c.within_ns == words.DEFAULT_LIMIT_NS else f" within {format_duration(c.within_ns)}"
    return f"wait {condition_text(c.condition)}{limit}"


def format_expect(c: words.Expect) -> str:
    limit = "" if c.within_ns is None else f" within {format_duration(c.within_ns)}"
    return f"expect {condition_text(c.condition)}{limit}"


def condition_text(condition: words.Condition) -> str:
    """Return the text of a condition, as in `wait` and `expect`."""
    match condition:
        case words.PinsAre(instance, pins):
            return f"{instance} {_pins_text(pins)}"
        case words.PeerIs(peer, state):
            return f"peer {peer} {state}"
        case words.PeerHasReceived(peer, payload, text):
            return f"peer {peer} received {text or ('hex ' + payload.hex(' ') if payload else 'nothing')}"
        case words.DataIs(data, offset, payload, text):
            return text or _data_bytes_text(data, offset, payload)
        case words.MemberIs(data, path, value):
            return f"{data}{'.' if path and not path.startswith('[') else ''}{path} {value_text(value)}"


def value_text(value: Value) -> str:
    match value:
        case bool():
            return str(value).upper()
        case float() if not math.isfinite(value):
            return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
        case str():
            return value if _LITERAL_PATTERN.fullmatch(value) else quote_text(value)
        case _:
            return repr(value)


LONGEST_LINE: Final = 1_000_000  # bounds the time that one line of a file takes
LONGEST_SHOWN: Final = 60
NO_UDT_FILE: Final = "no UDT file in this project: A adds one"


class BenchActions(Protocol):
    """The peers and methods of the bench that commands use. Each method returns an error text, or ""."""

    now: int

    @property
    def peers(self) -> Mapping[str, PeerActions]:
        """Return the peers by name."""

    def submit(self, *orders: commands.Command) -> str:
        """Queue orders for the PLC's next scan."""

    def apply_change(self, command: BenchCommand, order: commands.Command) -> str:
        """Change the project, and queue the order for the PLC."""

    def edit_project(self, command: EditCommand) -> str:
        """Edit the project, and apply the edit to the running bench."""

    def start_check(self, command: words.NumberedFramesOn) -> str:
        """Let a peer send self-checking traffic."""

    def stop_check(self, command: words.NumberedFramesOff) -> str:
        """End the self-checking traffic of a peer."""

    def set_link(self, command: words.SetLink) -> str:
        """Cut the wire, or mend it."""

    def order_tap(self, command: words.TapAct) -> str:
        """Let a tap act on the bytes of one direction."""

    def arm_fault(self, command: words.FaultOn) -> str:
        """Let a kernel call fail."""

    def clear_faults(self) -> str: ...


class RecordRow(Struct, frozen=True):
    """One frozen command. `write` returns its line, `act` does it (None: a runner does, scans may pass)."""

    record: type
    write: Callable[[Any], str]
    act: Callable[[BenchActions, Any], str] | None = None


class VerbRow(Struct, frozen=True):
    """All commands of one verb. `next_words` offers the words that may come next in a line."""

    verb: str
    read: Callable[[Words, Project], BenchCommand]
    next_words: completion.NextWords
    records: tuple[RecordRow, ...]
    at_prompt: bool = True


def _set_inputs(bench: BenchActions, c: words.SetInputs) -> str:
    orders = [
        commands.BlinkInput(c.instance, pin)
        if isinstance(value, str)
        else commands.SetInput(c.instance, pin, value)
        for pin, value in c.pins
    ]
    return bench.submit(*orders)


_EDIT_ROWS: Final = tuple(
    RecordRow(record, write, lambda bench, c: bench.edit_project(c))
    for record, write in (
        (words.Change, lambda c: f"set {c.kind} {c.name} {c.written}"),
        (words.AddEntry, format_add),
        (words.AddVariable, format_add),
        (words.Remove, lambda c: f"remove {c.kind} {c.name}"),
        (words.UndoEdit, lambda c: "undo"),
    )
)


_PEER_ROWS: Final = (
    RecordRow(
        words.PeerSend,
        lambda c: f"peer {c.peer} send {message_text(c)}",
        lambda bench, c: bench.peers[c.peer].send(c, bench.now),
    ),
    RecordRow(
        words.PeerPlaySequence,
        lambda c: f"peer {c.peer} play {c.name}",
        lambda bench, c: bench.peers[c.peer].play(c, bench.now),
    ),
    RecordRow(
        words.PeerAction,
        lambda c: f"peer {c.peer} {c.verb}",
        lambda bench, c: SIMPLE_VERBS[c.verb](bench.peers[c.peer], bench.now),
    ),
    RecordRow(
        words.AddReply,
        lambda c: f"peer {c.peer} reply on {rule_text(c)}",
        lambda bench, c: bench.peers[c.peer].replies.add(c),
    ),
    RecordRow(
        words.RemoveReplies,
        lambda c: f"peer {c.peer} reply off{f' {c.number}' if c.number else ''}",
        lambda bench, c: bench.peers[c.peer].replies.remove(c.number, c.peer),
    ),
    RecordRow(words.NumberedFramesOn, format_check, lambda bench, c: bench.start_check(c)),
    RecordRow(
        words.NumberedFramesOff, lambda c: f"peer {c.peer} check off", lambda bench, c: bench.stop_check(c)
    ),
    RecordRow(words.TrySplits, format_try_splits),
    # a test of splits in a scenario has ended with its step
    RecordRow(words.StopTrySplits, lambda c: f"peer {c.peer} try-splits stop", lambda bench, c: ""),
)
_MARK_ROW: Final = RecordRow(
    words.SetFrameMark, lambda c: c.line(), lambda bench, c: bench.submit(*c.orders())
)


def _make_row(
    verb: str,
    read: Callable[[Words, Project], BenchCommand],
    next_words: completion.NextWords,
    *records: RecordRow,
    at_prompt: bool = True,
) -> VerbRow:
    return VerbRow(verb, read, next_words, records, at_prompt)


# In the order in which completion offers them.
COMMAND_ROWS: Final = (
    _make_row(
        "set",
        reader.parse_set,
        completion.after_set,
        RecordRow(words.SetInputs, lambda c: f"set {c.instance} {_pins_text(c.pins)}", _set_inputs),
        _EDIT_ROWS[0],
    ),
    _make_row(
        "pulse",
        reader.parse_pulse,
        completion.after_pulse,
        RecordRow(
            words.PulsePin,
            lambda c: f"pulse {c.instance} {c.pin}",
            lambda bench, c: bench.submit(commands.PulseInput(c.instance, c.pin)),
        ),
    ),
    _make_row("peer", parse_peer_command, completion.after_peer, *_PEER_ROWS),
    _make_row(
        "write",
        parse_write,
        completion.after_write,
        RecordRow(
            words.WriteBytes,
            lambda c: f"write {c.text or _data_bytes_text(c.data, c.offset, c.payload)}",
            lambda bench, c: bench.submit(commands.WriteData(c.data, c.offset, c.payload)),
        ),
    ),
    _make_row(
        "fault",
        reader.parse_fault,
        completion.after_fault,
        RecordRow(words.FaultOn, format_fault, lambda bench, c: bench.arm_fault(c)),
        RecordRow(words.FaultClear, lambda c: "fault clear", lambda bench, c: bench.clear_faults()),
    ),
    _make_row(
        "link",
        reader.parse_link,
        completion.after_link,
        RecordRow(
            words.SetLink,
            lambda c: f"link {c.connect} {'up' if c.up else 'down'}",
            lambda bench, c: bench.set_link(c),
        ),
    ),
    _make_row(
        "plc",
        reader.parse_plc_command,
        completion.offer_words("stop", "run"),
        RecordRow(words.PlcStop, lambda c: "plc stop", lambda bench, c: bench.submit(commands.StopPlc())),
        RecordRow(words.PlcRun, lambda c: "plc run", lambda bench, c: bench.submit(commands.RunPlc())),
    ),
    _make_row(
        "run",
        reader.parse_run,
        completion.offer_none,
        RecordRow(words.RunScans, lambda c: f"run {c.scans}"),
        RecordRow(words.RunFor, lambda c: f"run {format_duration(c.ns)}"),
    ),
    _make_row(
        "expect",
        parse_expect,
        completion.after_expect,
        RecordRow(words.Expect, format_expect),
        RecordRow(words.ExpectTrace, lambda c: f"expect {c.instance} trace {c.pattern}"),
    ),
    _make_row(
        "create",
        parse_create,
        completion.after_create,
        RecordRow(
            words.CreateBlock,
            format_create,
            lambda bench, c: bench.apply_change(c, commands.CreateInstance(c.decl)),
        ),
    ),
    _make_row(
        "delete",
        lambda line, project: words.DeleteBlock(parse_instance(line, project).name),
        completion.after_instance_verb,
        RecordRow(
            words.DeleteBlock,
            lambda c: f"delete {c.instance}",
            lambda bench, c: bench.apply_change(c, commands.DeleteInstance(c.instance)),
        ),
    ),
    _make_row(
        "download",
        lambda line, project: words.DownloadBlock(parse_instance(line, project).name),
        completion.after_instance_verb,
        RecordRow(
            words.DownloadBlock,
            lambda c: f"download {c.instance}",
            lambda bench, c: bench.apply_change(c, commands.DownloadInstance(c.instance)),
        ),
    ),
    _make_row(
        "resize",
        parse_resize,
        completion.after_resize,
        RecordRow(
            words.Retype,
            lambda c: f"resize {c.data} {c.type_name}",
            lambda bench, c: bench.apply_change(c, commands.ResizeData(c.decl)),
        ),
    ),
    _make_row("add", parse_add, completion.after_add, *_EDIT_ROWS[1:3]),
    _make_row("remove", parse_remove, completion.after_remove, _EDIT_ROWS[3]),
    _make_row("undo", parse_undo, completion.offer_none, _EDIT_ROWS[4]),
    _make_row(
        "feed",
        reader.parse_feed,
        completion.after_feed,
        RecordRow(
            words.FeedSerial,
            format_feed,
            lambda bench, c: bench.submit(commands.FeedBuffer(c.buffer, c.payload)),
        ),
    ),
    _make_row("prefix", partial(parse_mark, "prefix"), completion.after_mark, _MARK_ROW),
    _make_row("suffix", partial(parse_mark, "suffix"), completion.after_mark),
    _make_row(
        "doctor",
        reader.parse_doctor,
        completion.after_doctor,
        RecordRow(words.AskDoctor, lambda c: " ".join(filter(None, ("doctor", c.name, c.cause)))),
    ),
    _make_row("wait", parse_wait, completion.offer_none, RecordRow(words.Wait, format_wait), at_prompt=False),
    _make_row(
        "tap",
        reader.parse_tap,
        completion.after_tap,
        RecordRow(words.TapAct, format_tap, lambda bench, c: bench.order_tap(c)),
    ),
)
COMMANDS: Final = {row.verb: row for row in COMMAND_ROWS}


def format_command(command: BenchCommand) -> str:
    """Return the line that `parse_line` reads as this command."""
    return find_record_row(type(command)).write(command)


def find_record_row(record: type) -> RecordRow:
    return next(known for row in COMMANDS.values() for known in row.records if known.record is record)


def parse_line(text: str, project: Project, where: str) -> BenchCommand | None:
    """Return the command of one line, None for a blank line or a comment; raise UserError.

    Each message of the UserError begins with `where`.
    """
    if len(text) > LONGEST_LINE:
        raise UserError(Problem(where, f"{len(text)} characters", f"at most {LONGEST_LINE} in a line"))
    return parse_unbounded_line(text, project, where)


def parse_unbounded_line(text: str, project: Project, where: str) -> BenchCommand | None:
    """Return the command of a line of any length, such as one that `format_command` wrote."""
    tokens = Words(text, where)
    if not tokens:
        return None
    verb = tokens.next("a command")
    if verb not in COMMANDS:
        raise tokens.make_unknown_error(verb, COMMANDS, "command")
    try:
        command = COMMANDS[verb].read(tokens, project)
    except UserError as refused:
        hint = "" if project.udts or text.split(None, 2)[:2] == ["add", "udt"] else f"; {NO_UDT_FILE}"
        raise UserError(
            structs.replace(each, expected=each.expected + hint * (each.expected == KNOWN_TYPE))
            for each in refused.problems
        ) from None
    tokens.expect_end()
    return command


def parse_script(text: str, project: Project, where: str) -> list[Step]:
    """Return the commands of a script, numbered from 1; raise UserError with the mistakes of all lines."""
    steps: list[Step] = []
    number = 0
    with raise_all_problems() as problems:
        for line in map(str.strip, text.split("\n")):  # \r\n too; U+2028 and the like do not end a command
            if not line or line.startswith("#"):
                continue
            number += 1
            command = None
            with collect_problems(problems):
                command = parse_line(line, project, f"{where}: step {number} ({_shorten(line)})")
            if command is not None:
                steps.append(Step(number, line, command))
                project = project_after(command, project)
    return steps


def collect_written_data(steps: Iterable[Step], project: Project) -> dict[str, bytes]:
    """Return the variables that `write` commands change, each with its bytes after all steps."""
    found = {decl.name: bytearray(decl.size) for decl in project.data}
    writes = [
        write for step in steps if isinstance(write := step.command, words.WriteBytes) and write.data in found
    ]
    for write in writes:
        found[write.data][write.offset : write.offset + len(write.payload)] = write.payload
    return {write.data: bytes(found[write.data]) for write in writes}


def _shorten(line: str) -> str:
    return line if len(line) <= LONGEST_SHOWN else line[: LONGEST_SHOWN - 3] + "..."
