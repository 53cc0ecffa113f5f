"""Checks whether a condition of `wait` or `expect` holds now, and names the current values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from trcvtui.bench.peers.peer import Peer
from trcvtui.blocks.pins import PinValue
from trcvtui.blocks.table import outcome_field
from trcvtui.commands import words
from trcvtui.commands.table import pin_value_text
from trcvtui.plc.port_hints import describe_port_fault
from trcvtui.plc.runtime import Runtime
from trcvtui.project.project import Project
from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.values import decode_leaves


class WatchedBench(Protocol):
    """The parts of a bench that a condition needs."""

    @property
    def project(self) -> Project: ...

    @property
    def runtime(self) -> Runtime: ...

    @property
    def peers(self) -> Mapping[str, Peer]: ...


def holds(bench: WatchedBench, condition: words.Condition) -> bool:
    """Return whether a condition holds after the last finished scan."""
    match condition:
        case words.PinsAre(instance, pins):
            return all(pin_now(bench, instance, pin) == value for pin, value in pins)
        case words.PeerIs(peer, state):
            return bench.peers[peer].is_in(state)
        case words.PeerHasReceived(peer, payload):
            return bench.peers[peer].has_received(payload)
        case words.DataIs(data, offset, payload):
            return bench.runtime.data(data)[offset : offset + len(payload)] == payload
        case words.MemberIs(data, path, value):
            return _is_equal(_member(bench, data, path), value)


def describe_now(bench: WatchedBench, condition: words.Condition) -> str:
    match condition:
        case words.PinsAre(instance, pins):
            shown = " ".join(f"{pin}={pin_value_text(pin, pin_now(bench, instance, pin))}" for pin, _ in pins)
            return "; ".join(part for part in (shown, _describe_port_fault(bench, instance)) if part)
        case words.PeerIs(peer, _):
            return bench.peers[peer].snapshot().state
        case words.PeerHasReceived(peer, _):
            return _hex(bytes(bench.peers[peer].snapshot().last_received)) or "nothing"
        case words.DataIs(data, offset, payload):
            return _hex(bench.runtime.data(data)[offset : offset + len(payload)])
        case words.MemberIs(data, path, _):
            return str(_member(bench, data, path))


def _describe_port_fault(bench: WatchedBench, instance: str) -> str:
    decl = bench.project.instance(instance)
    return describe_port_fault(bench.runtime.snapshot().combuffer(decl.connect)) if decl is not None else ""


def pin_now(bench: WatchedBench, instance: str, pin: str) -> PinValue:
    """Return the value of a pin, an input or an output, after the last finished scan."""
    if outcome_field(pin):
        return bench.runtime.outputs(instance).pin(pin)
    # An instance has its pins before the scan that creates it; they are 0.
    return bench.runtime.inputs(instance).get(pin, 0)


def _hex(payload: bytes) -> str:
    return payload.hex(" ") if len(payload) <= 32 else f"{payload[:32].hex(' ')} ... {len(payload)} bytes"


def _is_equal(found: Value | None, expected: Value) -> bool:
    # NaN equals nothing, not even itself, but `expect` can ask for it.
    return bool(found == expected) or (found != found and expected != expected)


def _member(bench: WatchedBench, data: str, path: str) -> Value | None:
    decl = bench.project.data_decl(data)
    assert decl is not None
    number = decl.layout.leaf_number(path)
    # A resize takes effect in the next scan: until then there may be fewer bytes than members.
    return decode_leaves(decl.layout, bench.runtime.data(data), number, number + 1)[0]
