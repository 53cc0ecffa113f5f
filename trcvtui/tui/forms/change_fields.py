"""What can be changed of a project: its parts, the keys of one as fields, and the `set` that these make."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final, NamedTuple

from trcvtui.plc.wired_pins import buffer_pin
from trcvtui.project.edit import FIELDS, entries_of, entry, keys_to_change
from trcvtui.project.keys import KeyValue
from trcvtui.project.project import InstanceDecl, Project
from trcvtui.rig.commands.edit import words_of
from trcvtui.rig.commands.member_values import quoted
from trcvtui.tui.forms.add_fields import BARE, BOOLS, QUOTED, AddField, fields_of
from trcvtui.tui.view_model.view_model import Scene
from trcvtui.udt.layout.layout import LAYOUTS
from trcvtui.udt.layout.rules import BYTE_ORDERS

OF_THE_BENCH: Final = frozenset(("LocalAddress", "ListenPort"))  # beside the fields of a structure
LAYOUT: Final = (
    AddField("layout", "none: the PLC's own", tuple(LAYOUTS)),
    AddField("byte_order", "none: that of the layout", tuple(BYTE_ORDERS)),
)


class Part(NamedTuple):
    """One entry of the project."""

    kind: str
    name: str

    def __str__(self) -> str:
        """Return what the screen calls it: `CONNECT C1`."""
        return f"{words_of(self.kind)} {self.name}"


def parts_at_hand(scene: Scene, peer_first: bool) -> list[Part]:
    """Return the parts of the selected instance and the selected peer, what is mended most often first."""
    instance = scene.project.instance(scene.selected)
    own = list(_parts_of(instance)) if instance is not None else []
    peer = scene.peer_snapshot
    talks = [Part("peer", peer.name), Part("connect", peer.link)] if peer is not None else []
    found = dict.fromkeys([*talks, *own] if peer_first else [*own, *talks])
    return [part for part in found if entry(*part, scene.project) is not None]


def _parts_of(instance: InstanceDecl) -> Iterator[Part]:
    link = "combuffer" if buffer_pin(instance.block) else "udp_config" if instance.on_config else "connect"
    yield Part(link, instance.connect)
    if instance.addr:
        yield Part("addr", instance.addr)
    for data in (instance.data, *instance.pointers):
        if data:
            yield Part("data", data)
    yield Part("instance", instance.name)


def all_parts(project: Project) -> list[Part]:
    """Return every part of the project that can be changed or removed."""
    return [Part(kind, each.name) for kind in FIELDS for each in entries_of(kind, project)]


def values_of(part: Part, project: Project) -> dict[str, KeyValue]:
    """Return the keys that a part has now."""
    decl = entry(*part, project)
    return keys_to_change(decl, project) if decl is not None else {}


def text_of(value: KeyValue) -> str:
    """Return a value as it stands in a field."""
    if isinstance(value, list):
        return " ".join(value)
    return str(value).lower() if isinstance(value, bool) else str(value)


def fields_to_change(part: Part, now: Mapping[str, KeyValue], project: Project, block: str) -> list[AddField]:
    """Return the fields of a part, empty where it has no such key; those of an instance are its block's.

    A key that has several texts now, such as `replies`, has no field: the line changes it.
    """
    known = [*fields_of(part.kind, project, block), *(LAYOUT if part.kind == "data" else ())]
    if part.kind != "instance":
        keys = {each.key for each in known}
        known += [AddField(key, "", BOOLS * isinstance(now[key], bool)) for key in now if key not in keys]
    away = {
        key for key, value in now.items() if isinstance(value, list) and len(value) > 1 and key not in BARE
    }
    if part.kind == "connect":
        away.add("type")  # the structure stays
    elif part.kind == "instance":
        away.add("inputs")
    if part.kind in ("connect", "addr") and project.dialect.describes_connects and now:
        away |= {each.key for each in known} - now.keys() - OF_THE_BENCH  # of other structures
    other = part.kind == "instance" and block != now.get("block")  # what it lacks then is proposed
    first = {each.key: each.first if other else "" for each in known} | {
        k: text_of(v) for k, v in now.items()
    }
    kept = [each for each in known if each.key not in away]
    return [replace(each, first=block if each.key == "block" else first[each.key]) for each in kept]


def set_line(part: Part, now: Mapping[str, KeyValue], texts: Mapping[str, str], project: Project) -> str:
    """Return the `set` that makes of the keys of now what stands in the fields; "" where nothing changes.

    What a block has neither a field nor a pin for goes when an instance gets that block.
    """
    gone: dict[str, str] = {}
    if part.kind == "instance" and texts["block"] in project.dialect.blocks:
        pins = {pin.name for pin in project.pins(texts["block"])}
        gone = {key: "" for key in now if key not in pins}
    after = {key: text.strip() for key, text in (gone | dict(texts)).items()}
    changed = {key: text for key, text in after.items() if text != text_of(now.get(key, ""))}
    if not changed:
        return ""
    words = [f"set {part.kind} {part.name}"]
    if part.kind == "message":  # its text is the end of the line
        words += [f"peer={changed['peer']}"] if "peer" in changed else []
        return " ".join([*words, after["text"]])
    words += [changed.pop(key) for key in BARE & changed.keys()]
    return " ".join([*words, *(f"{key}={_worded(key, text)}" for key, text in changed.items())])


def _worded(key: str, text: str) -> str:
    return quoted(text) if text and (key in QUOTED or " " in text) else text
