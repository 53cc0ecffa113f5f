"""A trigger fires once, when its condition becomes true. The condition is checked after each scan.

`trigger TRCV_C_1 STATUS=80C5`, `trigger TRCV_C_1 EN_R rises`, `trigger rx.speed > 100 hold`. RCVD_LEN is
compared only in scans with DONE. In every other scan RCVD_LEN is 0 and has no meaning.
When a trigger fires, the screen's next picture shows the bench in that scan, even if later scans have run.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from functools import partial
from operator import eq, ge, gt, le, lt, ne
from typing import Any, Final, NamedTuple

from msgspec import Struct

from trcvtui.bench.bench import Bench
from trcvtui.bench.conditions import pin_now
from trcvtui.blocks.pins import Pin, PinValue
from trcvtui.commands.conditions import base_name, parse_instance, parse_target
from trcvtui.commands.tokens import Words, leaf_bytes, parse_pin_value
from trcvtui.errors import UserError, mistake
from trcvtui.history.ledger_reader import LedgerReader
from trcvtui.history.link_statistics import LinkStatistics
from trcvtui.history.records import ConnectFacts
from trcvtui.plc.ledger import InputEdge, StampedEvent
from trcvtui.plc.snapshot import Snapshot
from trcvtui.project.project import Project
from trcvtui.project.tables import quote
from trcvtui.snapshots.bench import PeerSnapshot, TriggerEvent
from trcvtui.udt.layout.layout import BYTE_ORDERS, Layout, Leaf
from trcvtui.udt.layout.values import decode_leaf
from trcvtui.udt.types import StringType

OPERATORS: Final[dict[str, Callable[[Any, Any], bool]]] = {
    "=": eq, "!=": ne, "<": lt, ">": gt, "<=": le, ">=": ge,
}  # fmt: skip
RISES, OFF = "rises", "off"
PIN_WITH_DONE: Final = "RCVD_LEN"
TRIGGER_FORM: Final = "`X STATUS=80C5`, `X EN_R rises`, `X RCVD_LEN!=96`, `rx.speed > 100`, or `off`"
_COMPARISON: Final = re.compile(r'((?:"[^"]*"|"(?![^"]*")|[^=!<>"])+?)\s*(!=|<=|>=|=|<|>)\s*(.+)', re.DOTALL)
_EDGE: Final = re.compile(r"(\S+)(?:\s+(\S+))?\s+(rises|falls)")
_HOLD: Final = re.compile(r"(.*\S)\s+hold", re.DOTALL)


class PinCondition(Struct, frozen=True):
    """A comparison of a pin with a value."""

    instance: str
    pin: str
    operator: str
    value: PinValue

    def holds_now(self, bench: Bench) -> bool:
        if self.pin == PIN_WITH_DONE and not pin_now(bench, self.instance, "DONE"):
            return False
        return OPERATORS[self.operator](pin_now(bench, self.instance, self.pin), self.value)

    def fires_by(self, event: InputEdge) -> bool:
        """Return whether an input's edge makes the condition true, even if only for a part of the scan."""
        is_it = (event.instance, event.pin) == (self.instance, self.pin)
        return is_it and OPERATORS[self.operator](event.value, self.value)


class MemberCondition(Struct, frozen=True):
    """A comparison of a value in DATA with a given value; texts can only be equal or unequal."""

    data: str
    offset: int
    size: int
    operator: str
    value: Any
    read: Callable[[bytes], Any]

    def holds_now(self, bench: Bench) -> bool:
        return self._holds(bench.runtime.data_part(self.data, self.offset, self.offset + self.size))

    def holds_in(self, message: bytes) -> bool:
        """Return whether the condition is true in a message for DATA; False if the message is too short."""
        return self._holds(message[self.offset : self.offset + self.size])

    def _holds(self, part: bytes) -> bool:
        return len(part) == self.size and OPERATORS[self.operator](self.read(part), self.value)


TriggerCondition = PinCondition | MemberCondition


class Trigger(Struct, frozen=True):
    """A trigger as it was written. With `holds`, the scans stop when it fires."""

    text: str
    condition: TriggerCondition
    holds: bool = False


def read_trigger(text: str, project: Project, where: str) -> Trigger | None:
    """Return the trigger in the text after `trigger`, None for `off`. Raise UserError for a wrong text."""
    text = text.strip()
    if text == OFF:
        return None
    held = _HOLD.fullmatch(text)
    asked = held[1] if held else text
    return Trigger(text, _parse_condition(asked, project, where), held is not None)


def _parse_condition(text: str, project: Project, where: str) -> TriggerCondition:
    edge = _EDGE.fullmatch(text)
    if edge is not None:
        subject, value = " ".join(filter(None, edge.groups()[:2])), "1" if edge[3] == RISES else "0"
        comparison = ConditionText(subject, "=", value, where)
    else:
        comparison = read_comparison(text, where, TRIGGER_FORM)
    words = Words(comparison.subject, where)
    word = words.peek()
    if project.instance(word) is not None:
        return _pin_condition(words, comparison, project, edge is not None)
    if project.data_decl(base_name(word)) is None:
        names = [*(i.name for i in project.instances), *(d.name for d in project.data)]
        raise words.make_unknown_error(word, names, "an instance or a DATA variable")
    return _on_member(words, comparison, project, edge is not None)


class ConditionText(NamedTuple):
    """A comparison as it was written. `value` is parsed later, when the pin or the member is known."""

    subject: str
    operator: str
    value: str
    where: str

    def make_pin_condition(self, instance: str, pin: Pin) -> PinCondition:
        self._refuse_order(f"'{pin.name}', a {pin.iec_type}", pin.is_bool or pin.iec_type == "WORD")
        return PinCondition(instance, pin.name, self.operator, parse_pin_value(pin, self.value, self.where))

    def make_leaf_condition(self, data: str, layout: Layout, leaf: Leaf) -> MemberCondition:
        self._refuse_order("a text", isinstance(leaf.type, StringType))
        if isinstance(leaf.type, StringType) or leaf.bit is not None:
            read: Callable[[bytes], Any] = partial(decode_leaf, layout, leaf)
        else:
            code = struct.Struct(BYTE_ORDERS[layout.rules.byte_order] + leaf.coding.code)
            read = lambda part: code.unpack(part)[0]  # noqa: E731
        value = read(leaf_bytes(layout, leaf, self.value, self.where))
        if value != value and self.operator in ("=", "!="):  # NaN is equal to nothing: test for any NaN
            number, value = read, True
            read = lambda part: (now := number(part)) != now  # noqa: E731
        return MemberCondition(data, leaf.offset, leaf.size, self.operator, value, read)

    def _refuse_order(self, what: str, has_none: bool) -> None:
        if has_none and self.operator not in ("=", "!="):
            raise mistake(self.where, f"'{self.operator}' for {what}", "= or !=")


def read_comparison(text: str, where: str, form: str) -> ConditionText:
    """Return the parts of a comparison like `weight > 3`. A UserError shows the expected form."""
    found = _COMPARISON.fullmatch(text)
    if found is None:
        raise mistake(where, quote(text) if text else "no further word", form)
    return ConditionText(found[1], found[2], found[3], where)


def _pin_condition(words: Words, comparison: ConditionText, project: Project, is_edge: bool) -> PinCondition:
    instance = parse_instance(words, project)
    pins: dict[str, Pin] = {pin.name: pin for pin in project.pins(instance.block)}
    name = words.next("a pin such as STATUS")
    words.expect_end()
    if name not in pins:
        raise words.make_unknown_error(name, pins, "pin")
    pin = pins[name]
    if is_edge and not pin.is_bool:
        raise words.error(f"'{name}', a {pin.iec_type}", "a BOOL pin, which can rise and fall")
    return comparison.make_pin_condition(instance.name, pin)


def _on_member(words: Words, comparison: ConditionText, project: Project, is_edge: bool) -> MemberCondition:
    target = parse_target(words, project)
    words.expect_end()
    leaf, layout = target.leaf(words), target.decl.layout
    if is_edge and leaf.coding.code != "?":
        name = leaf.path or target.decl.name
        raise words.error(f"'{name}', which is no BOOL", "a BOOL, which can rise and fall")
    return comparison.make_leaf_condition(target.decl.name, layout, leaf)


MOST_LEDGER_LINES: Final = 2000  # lines of the ledger in the picture of a trigger
MOST_DATA_BYTES: Final = 262_144  # of all DATA in it: they cross in one piece
MOST_INSTANCES: Final = 64

NamedBytes = tuple[tuple[str, bytes], ...]


class FrozenScan(Struct, frozen=True):
    """The bench in the scan in which a trigger fired. `events` were then the newest ledger events."""

    fired: TriggerEvent
    snapshot: Snapshot
    events: list[StampedEvent]
    data: NamedBytes
    partial: NamedBytes
    peers: tuple[PeerSnapshot, ...]
    facts: tuple[tuple[str, ConnectFacts], ...]


class TriggerWatch:
    """At most one trigger on a bench, and the state of the bench when it fires."""

    def __init__(self, bench: Bench, reader: LedgerReader) -> None:
        self._trigger: Trigger | None = None
        self._bench = bench
        self._project = bench.project  # for which the trigger was read
        self._held = False  # its condition, after the last scan
        self._count = 0
        self._catch_up = reader.catch_up
        self._statistics = LinkStatistics(reader.index)
        reader.on_loss.append(self._statistics.forget_all)
        self._seq = 0  # of the last line that was read while a trigger is armed
        self.kept: FrozenScan | None = None

    def arm(self, text: str, where: str) -> str:
        """Arm a trigger, or disarm it with `off`. Return the message for the user, or raise UserError.

        If the condition is already true, the trigger fires only when it next changes from false to true.
        """
        trigger = read_trigger(text, self._bench.project, where)
        self._trigger, self._project = trigger, self._bench.project
        self._held = trigger is not None and trigger.condition.holds_now(self._bench)
        self._seq = self._bench.runtime.ledger.last_seq
        if trigger is None:
            return "no trigger is armed"
        return f"armed{'; it is already true: it fires when it becomes true again' if self._held else ''}"

    def check_scan(self) -> TriggerEvent | None:
        """Read the events of the last scan; return the trigger's event if it fired then, else None."""
        ledger = self._bench.runtime.ledger
        written = ledger.events_since(self._seq)
        self._seq = ledger.last_seq
        trigger = self._reread_trigger()
        if trigger is None:
            return None
        condition, before = trigger.condition, self._held
        self._held = condition.holds_now(self._bench)
        inputs = (event for _, _, event in written if isinstance(event, InputEdge))
        fires = self._held and not before
        if not self._held and isinstance(condition, PinCondition):  # DATA has one value a scan
            fires = any(map(condition.fires_by, inputs))
        if not fires:
            return None
        self._count += 1
        self._trigger = None
        scans = self._bench.runtime.scans
        fired = TriggerEvent(self._count, trigger.text, scans, ledger.t_ns, trigger.holds)
        self.kept = self._freeze_scan(fired)
        return fired

    def _reread_trigger(self) -> Trigger | None:
        if self._trigger is not None and self._project is not self._bench.project:
            self._project = self._bench.project
            try:
                self._trigger = read_trigger(self._trigger.text, self._project, "trigger")
            except UserError:
                self._trigger = None  # an edit has removed its name
        return self._trigger

    def _freeze_scan(self, fired: TriggerEvent) -> FrozenScan:
        bench, runtime = self._bench, self._bench.runtime
        names = [instance.name for instance in bench.project.instances[:MOST_INSTANCES]]
        return FrozenScan(
            fired,
            runtime.snapshot(bench.faults()),
            runtime.ledger.events_since(0, MOST_LEDGER_LINES),
            self._collect_data(),
            tuple((name, runtime.job_bytes(name)) for name in names),
            tuple(peer.snapshot() for peer in bench.peers.values()),
            self.facts(tuple(names)),
        )

    def _collect_data(self) -> NamedBytes:
        room, chosen = MOST_DATA_BYTES, []
        for decl in self._bench.project.data:
            if decl.size <= room:
                chosen.append((decl.name, self._bench.runtime.data(decl.name)))
                room -= decl.size
        return tuple(chosen)

    def facts(self, instances: tuple[str, ...]) -> tuple[tuple[str, ConnectFacts], ...]:
        self._catch_up()
        declared = map(self._bench.project.instance, instances)
        return tuple((i.name, self._statistics.facts(i.name, i.connect)) for i in declared if i is not None)

    @property
    def armed_text(self) -> str:
        """Return the text of the armed trigger, "" for none."""
        return self._trigger.text if self._trigger is not None else ""

    def take_frozen(self) -> FrozenScan | None:
        """Return the bench as it was when a trigger fired; None if none has fired since the last call."""
        kept, self.kept = self.kept, None
        return kept
