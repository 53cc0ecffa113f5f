"""How commands with many words are written: `parse_line(to_line(command))` is the command again."""

from __future__ import annotations

import math
import re
from typing import Any, Final

from trcvtui.blocks.table import block_row, is_time
from trcvtui.project.keys import link_key
from trcvtui.rig.commands import words as words
from trcvtui.rig.commands.counters_and_checksums import DIGITS, NUMBERS, Fill
from trcvtui.rig.commands.member_values import quoted
from trcvtui.rig.commands.words import Contains, FieldIs, Match, Matches, Starts
from trcvtui.udt.layout.coding import Value
from trcvtui.udt.literals import format_time

MILLISECOND: Final = 1_000_000
_LITERAL: Final = re.compile(r"[A-Z]+#[-\w.:]+", re.ASCII)  # T#5s and the like need no quotes


def set_line(c: words.Set) -> str:
    return f"set {c.instance} {_pins(c.pins)}"


def _pins(pins: tuple[tuple[str, Any], ...]) -> str:
    return " ".join(f"{name}={_pin_text(name, value)}" for name, value in pins)


def _pin_text(name: str, value: bool | int | str) -> str:
    if isinstance(value, str):
        return value
    if is_time(name):
        return format_time(value * MILLISECOND)
    return f"{value:04X}" if name == "STATUS" else str(int(value))


def write(c: words.Write) -> str:
    return f"write {c.text or _bytes_of(c.data, c.offset, c.payload)}"


def _bytes_of(data: str, offset: int, payload: bytes) -> str:
    return f"{data}{f'+{offset}' if offset else ''} hex {payload.hex(' ')}"


def create(c: words.Create) -> str:
    decl = c.decl
    parts = [f"create {decl.block} {decl.name} {link_key(decl.block)}={decl.connect}"]
    parts += [f"data={decl.data}"] if decl.data is not None else []
    named = zip(block_row(decl.block).pointers, decl.pointers, strict=False)
    parts += [f"{key}={name}" for key, name in named if name]
    parts += [f"task={decl.task}"] if decl.task else []
    return " ".join(parts + [_pins(decl.inputs)] * bool(decl.inputs))


def feed(c: words.FeedLine) -> str:
    """Return `feed RX hex 01`."""
    return f"feed {c.buffer} {_fed(c)}"


def _fed(c: words.FeedLine) -> str:
    return "break" if c.payload is None else c.text or f"hex {c.payload.hex(' ')}"


def send(c: words.PeerSend) -> str:
    return f"peer {c.peer} send {message_text(c)}"


def message_text(c: words.PeerSend) -> str:
    """Return what stands behind `peer P1 send`."""
    if c.text.startswith("message "):
        return c.text  # the library has the rest
    parts = [c.text or f"hex {c.payload.hex(' ')}"]
    parts += [_fill(fill) for fill in c.fills if not (fill.hole and c.text)]
    if c.split:
        parts.append(f"split={','.join(map(str, c.split))}")
    if c.gap_ns or c.gaps_ns:
        parts.append(f"gap={','.join(map(format_time, c.gaps_ns or (c.gap_ns,)))}")
    if c.repeat != 1:
        parts.append(f"repeat={c.repeat}")
    if c.every_ns:
        parts.append(f"every={format_time(c.every_ns)}")
    return " ".join(parts)


def _fill(fill: Fill) -> str:
    text = f"{fill.kind}={fill.offset}"
    if fill.kind in NUMBERS:
        text += f":{fill.width}"
    return text + (f":{fill.order}" if fill.width > 1 and fill.kind != DIGITS else "")


def rule_text(c: words.ReplyOn) -> str:
    """Return a rule as a project file has it in `replies`."""
    return f"{match_text(c.match)} send {message_text(c.send)}"


def match_text(match: Match) -> str:
    """Return what a rule looks for."""
    match match:
        case Contains(payload, text):
            return f"contains {text or 'hex ' + payload.hex(' ')}"
        case Starts(payload, text):
            return f"starts {text or 'hex ' + payload.hex(' ')}"
        case Matches(pattern):
            return f'regex "{pattern}"'
        case FieldIs(type_name, path, value):
            return f"field {type_name}.{path} = {value_text(value)}"


def check(c: words.CheckOn) -> str:
    parts = [f"peer {c.peer} check on size={c.size} every={format_time(c.every_ns)}"]
    return " ".join(parts + [f"on {c.instance}"] * bool(c.instance))


def try_splits(c: words.TrySplits) -> str:
    parts = [f"peer {c.peer} try-splits {c.text or 'hex ' + c.payload.hex(' ')} on {c.instance}"]
    if c.gap_ns:
        parts.append(f"gap={format_time(c.gap_ns)}")
    if c.differ != 0:
        parts.append(f"differ={'any' if c.differ is None else c.differ}")
    return " ".join(parts)


def fault(c: words.FaultOn) -> str:
    parts = ["fault", c.call]
    if c.error is not None:
        parts.append(c.error)
    if c.on is not None:
        parts += ["on", c.on]
    if c.nth != 1:
        parts.append(f"nth={c.nth}")
    if c.times != 1:
        parts.append(f"times={'forever' if c.times == words.FOREVER else c.times}")
    return " ".join(parts)


def wait(c: words.Wait) -> str:
    limit = "" if c.within_ns == words.DEFAULT_LIMIT_NS else f" within {format_time(c.within_ns)}"
    return f"wait {condition_text(c.condition)}{limit}"


def expect(c: words.Expect) -> str:
    limit = "" if c.within_ns is None else f" within {format_time(c.within_ns)}"
    return f"expect {condition_text(c.condition)}{limit}"


def condition_text(condition: words.Condition) -> str:
    """Return a condition as `wait` and `expect` write it."""
    match condition:
        case words.PinsAre(instance, pins):
            return f"{instance} {_pins(pins)}"
        case words.PeerIs(peer, state):
            return f"peer {peer} {state}"
        case words.PeerReceived(peer, payload, text):
            return f"peer {peer} received {text or 'hex ' + payload.hex(' ')}"
        case words.DataIs(data, offset, payload, text):
            return text or _bytes_of(data, offset, payload)
        case words.MemberIs(data, path, value):
            return f"{data}{'.' if path and not path.startswith('[') else ''}{path} {value_text(value)}"


def value_text(value: Value) -> str:
    """Return a member's value as the commands write it."""
    match value:
        case bool():
            return str(value).upper()
        case float() if not math.isfinite(value):
            return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
        case str():
            return value if _LITERAL.fullmatch(value) else quoted(value)
        case _:
            return repr(value)
