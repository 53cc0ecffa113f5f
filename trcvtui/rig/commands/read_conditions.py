"""What `wait` and `expect` say: conditions on pins, peers and DATA, with or without a time limit."""

from __future__ import annotations

from typing import Final

from trcvtui.project.names import expected_name
from trcvtui.project.project import InstanceDecl, PeerDecl, Project
from trcvtui.project.tables import shown
from trcvtui.rig.commands.data import base_name, read_data_condition
from trcvtui.rig.commands.payload import KEPT_BYTES
from trcvtui.rig.commands.read_payload import read_payload
from trcvtui.rig.commands.tokens import Words, duration, pin_value
from trcvtui.rig.commands.trace_pattern import parse_pattern
from trcvtui.rig.commands.words import (
    DEFAULT_LIMIT_NS,
    PEER_STATES,
    Condition,
    Expect,
    ExpectTrace,
    PeerIs,
    PeerReceived,
    PinsAre,
    Wait,
)

UDP_STATES: Final = ("listening", "closed")
OF_UDP: Final = "listening, closed or received"
SUBJECT: Final = "an instance, a DATA variable or peer NAME"


def read_wait(words: Words, project: Project) -> Wait:
    """Return `wait CONDITION [within T#..]`; raise UserError."""
    within = _read_within(words)
    return Wait(_read_condition(words, project), DEFAULT_LIMIT_NS if within is None else within)


def read_expect(words: Words, project: Project) -> Expect | ExpectTrace:
    """Return `expect CONDITION [within T#..]` or `expect X trace PATTERN`; raise UserError."""
    if words.peek(1) == "trace" and words.peek() != "peer":
        instance = read_instance(words, project)
        words.next("trace")
        return ExpectTrace(instance.name, parse_pattern(" ".join(words.rest()), f"{words.where}: trace"))
    within = _read_within(words)
    return Expect(_read_condition(words, project), within)


def _read_within(words: Words) -> int | None:
    tail = words.cut(lambda word: word == "within")
    if not tail:
        return None
    if len(tail) != 2:
        raise words.wrong(shown(" ".join(tail)), "within and one duration, such as within T#2s")
    return duration(tail[1], "within ", words.where)


def _read_condition(words: Words, project: Project) -> Condition:
    word = words.peek()
    if word == "peer":
        words.next("peer")
        return _read_peer_condition(words, project)
    name = base_name(word)
    if project.data_decl(name) is not None:
        return read_data_condition(words, project)
    if project.instance(word) is None:
        names = [*(i.name for i in project.instances), *(d.name for d in project.data), "peer"]
        found = shown(name) if word else "nothing more"
        raise words.wrong(found, expected_name(name, names, SUBJECT) if word else SUBJECT)
    return _read_pins(words, project)


def _read_pins(words: Words, project: Project) -> PinsAre:
    instance = read_instance(words, project)
    pins = {pin.name: pin for pin in project.pins(instance.block)}
    found = []
    for word in words.rest() or [words.next("a pin such as STATUS=7006")]:
        name, equals, text = word.partition("=")
        if not equals:
            raise words.wrong(shown(word), "PIN=VALUE such as STATUS=7006")
        if name not in pins:
            raise words.wrong(shown(name), expected_name(name, pins, "pin"))
        found.append((name, pin_value(pins[name], text, words.where)))
    return PinsAre(instance.name, tuple(found))


def _read_peer_condition(words: Words, project: Project) -> Condition:
    peer = read_peer(words, project)
    state = words.next(f"received, or a state: {', '.join(PEER_STATES)}")
    if state == "received":
        payload = read_payload(words, project)
        if len(payload.content) > KEPT_BYTES:
            raise words.wrong(f"{len(payload.content)} bytes", f"at most {KEPT_BYTES}, which a peer keeps")
        return PeerReceived(peer.name, payload.content, payload.text)
    words.finish()
    if state not in PEER_STATES:
        raise words.wrong(shown(state), expected_name(state, (*PEER_STATES, "received"), "state"))
    if peer.udp and state not in UDP_STATES:
        raise words.wrong(f"'{state}' of the UDP peer '{peer.name}', which has no connection", OF_UDP)
    return PeerIs(peer.name, state)


def read_instance(words: Words, project: Project) -> InstanceDecl:
    """Return the instance that the next word names; raise UserError."""
    name = words.next("the name of an instance")
    instance = project.instance(name)
    if instance is None:
        names = [known.name for known in project.instances]
        raise words.wrong(shown(name), expected_name(name, names, "instance"))
    return instance


def read_peer(words: Words, project: Project) -> PeerDecl:
    """Return the peer that the next word names; raise UserError."""
    name = words.next("the name of a peer")
    peer = project.peer(name)
    if peer is None:
        names = [known.name for known in project.peers]
        raise words.wrong(shown(name), expected_name(name, names, "peer"))
    return peer
