"""What can be added to a project, and changed in it, as the fields of a form, and the line that they make."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from trcvtui.plc.wired_pins import buffer_pin, data_pin, mark_pins
from trcvtui.project.edit import (
    FIELDS,
    SHARED_NAMES,
    entries_of,
    entry,
    keys_to_change,
    names_of,
    structures_of,
)
from trcvtui.project.keys import KeyValue
from trcvtui.project.project import SERIAL, SIMULATED, InstanceDecl, Project
from trcvtui.rig.commands.edit import words_of
from trcvtui.rig.commands.member_values import quoted
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.udt.layout.layout import LAYOUTS
from trcvtui.udt.layout.rules import BYTE_ORDERS

BOOLS: Final = ("false", "true")


@dataclass(frozen=True, slots=True)
class AddField:
    """One field: its key, what may stand there, what stands there first."""

    key: str
    hint: str
    choices: tuple[str, ...] = ()
    first: str = ""


def connect_fields(project: Project) -> Sequence[AddField]:
    """Return what most descriptions need; the line `add connect` takes every field of every structure."""
    ends = tuple(f"@{name}" for kind in ("peer", "connect") for name in names_of(kind, project))
    numbers = tuple(map(str, project.certificates))
    older = project.dialect.structures == ("TCON_Param",)
    taken = structures_of(project)
    first = [
        AddField("type", "none: plain TCP in what it takes", taken),
        AddField("bytes", "hex of the DB in place of the fields"),
        AddField("LocalAddress", "of the bench, for InterfaceId", first="127.0.0.1"),
        AddField("ListenPort", "of the bench, 0: a free one"),
    ]
    if older:
        return [*first, *_param(ends)]
    return [
        *first,
        AddField("ID", "1 to 4095"),
        AddField("ConnectionType", "11 TCP, 12 ISO, 13 by name, 19 UDP"),
        AddField("ActiveEstablished", "true: the PLC connects", BOOLS),
        AddField("RemoteAddress", "0.0.0.0: anybody"),
        AddField("RemoteQDN", "TCON_QDN: a name with a dot at its end"),
        AddField("RemotePort", "a port, or @NAME", ends),
        AddField("LocalPort", "passive: 1 to 49151"),
        AddField("LocalTSelector", "TCON_IP_RFC: 16#E002, E0.02 or TCP-1"),
        AddField("RemoteTSelector", "that of the partner"),
        AddField("IsoPort", "of the bench, in place of 102", ends),
        AddField("ActivateSecureConn", "SEC: true is TLS", BOOLS),
        AddField("TLSServerCertRef", "the number of a certificate", numbers),
        AddField("TLSClientCertRef", "the number of a certificate", numbers),
    ]


def _param(ends: tuple[str, ...]) -> list[AddField]:
    return [
        AddField("ActiveEstablished", "no type: true, the PLC connects", BOOLS, "false"),
        AddField("RemoteAddress", "no type: 0.0.0.0, anybody"),
        AddField("RemotePort", "no type: a port, or @NAME", ends),
        AddField("LocalPort", "no type: 0, a free one"),
        AddField("id", "TCON_Param: 1 to 4095"),
        AddField("connection_type", "TCON_Param: 17 TCP, 18 ISO, 19 UDP"),
        AddField("active_est", "TCON_Param: true, the PLC connects", BOOLS),
        AddField("rem_staddr", "TCON_Param: 4 bytes of the address"),
        AddField("local_tsap_id", "TCON_Param: port or TSAP in hex"),
        AddField("rem_tsap_id", "TCON_Param: port or TSAP in hex"),
    ]


def last_of(names: tuple[str, ...]) -> str:
    """Return the newest of these names, "" where there is none."""
    return names[-1] if names else ""


def block_field(project: Project, block: str) -> AddField:
    """Return the field of the block."""
    return AddField("block", "a block", project.dialect.blocks, block)


def buffered_fields(project: Project, block: str) -> Sequence[AddField]:
    """Return the fields of an instance on a ComBuffer, by the names of its pins."""
    buffers, data = names_of("combuffer", project), names_of("data", project)
    fields = [
        block_field(project, block),
        AddField(buffer_pin(block), "a ComBuffer", buffers, last_of(buffers)),
    ]
    if data_pin(block):
        fields.append(AddField("data", f"the variable of {data_pin(block)}", data, last_of(data)))
    fields += [AddField(pin, f"{mark}, none: 0", ("", *data)) for pin, mark in mark_pins(block).items()]
    return [
        *fields,
        AddField("task", "a task", tuple(task.name for task in project.tasks), project.tasks[0].name),
        AddField("inputs", _inputs_like(project, block)),
    ]


def _inputs_like(project: Project, block: str) -> str:
    names = [pin.name for pin in project.pins(block) if pin.direction != "out"]
    shown = [name for name in ("SizeReceiveData", "Length", "SendByte", "Timeout", "EN") if name in names]
    return f"such as {' '.join(f'{name}=1' for name in shown[:1])}" if shown else "none"


def combuffer_fields(project: Project) -> Sequence[AddField]:
    """Return the fields of a ComBuffer; an empty one is its default."""
    streams = {b: tuple(i.name for i in project.instances if i.block == b) for b in ("TRCV_C", "TSEND_C")}
    ports = tuple(buffer.name for buffer in project.combuffers if buffer.serial is not None)
    sources = (SIMULATED, SERIAL, *streams["TRCV_C"], *names_of("combuffer", project))
    return [
        AddField("source", "where bytes come from", sources, SIMULATED),
        AddField("port", "serial: a device, socket://"),
        AddField("baud", "serial: 9600"),
        AddField("parity", "serial: none", ("none", "even", "odd", "mark", "space")),
        AddField("stop_bits", "serial: 1", ("1", "1.5", "2")),
        AddField("data_bits", "serial: 8", ("8", "7", "6", "5")),
        AddField("handshake", "serial: none", ("none", "rts/cts", "dsr/dtr", "xon/xoff")),
        AddField("line", "what sends what is written", ("", *ports, *streams["TSEND_C"])),
        AddField("size", "bytes that have room, 300"),
        AddField("per_cycle", "bytes a scan, 0: all"),
    ]


TITLES: Final = {
    "instance": "an instance",
    "connect": "a connection (CONNECT)",
    "data": "a DATA variable",
    "peer": "a peer",
    "message": "a message of the library",
    "sequence": "a sequence of messages",
    "udp_config": "a UDP_CONFIG",
    "addr": "an ADDR of UDP",
    "certificate": "a certificate of TLS",
    "combuffer": "a ComBuffer",
}
KINDS: Final = tuple(TITLES)
RECEIVER: Final = "TRCV_C"
NAMES: Final = {"connect": "C", "combuffer": "B", "udp_config": "U", "addr": "A", "data": "rx", "peer": "P"}
BARE: Final = frozenset({"inputs", "type", "text", "steps"})  # they stand without a key
QUOTED: Final = frozenset({"says", "bytes", "local_tsap", "remote_tsap", "LocalTSelector", "RemoteTSelector"})


def kinds_of(project: Project) -> tuple[str, ...]:
    """Return what can be added: a ComBuffer where the dialect has blocks for it."""
    has_buffers = any(buffer_pin(block) for block in project.dialect.blocks)
    return KINDS if has_buffers else tuple(kind for kind in KINDS if kind != "combuffer")


def fields_of(kind: str, project: Project, block: str = "") -> tuple[AddField, ...]:
    """Return the fields of a kind behind its name; those of an instance are its block's."""
    chosen = block or first_block(project)
    if kind == "instance" and buffer_pin(chosen):
        return tuple(buffered_fields(project, chosen))
    return tuple(_FIELDS[kind](project))


def first_block(project: Project) -> str:
    """Return the block that the form begins with: on an empty bench one that receives from anybody."""
    if not project.instances and RECEIVER in project.dialect.blocks:
        return RECEIVER
    return project.dialect.blocks[0]


def first_name(kind: str, project: Project) -> str:
    """Return a name that is free."""
    if kind == "certificate":
        return str(max(project.certificates, default=0) + 1)
    sharing = next((kinds for kinds in SHARED_NAMES if kind in kinds), (kind,))
    taken = {name for each in sharing for name in names_of(each, project)}
    start = f"{first_block(project)}_" if kind == "instance" else NAMES.get(kind, kind)
    return next(name for n in range(1, len(taken) + 2) if (name := f"{start}{n}") not in taken)


def line_of(kind: str, name: str, texts: Mapping[str, str]) -> str:
    """Return the command that the fields make; an empty field says nothing."""
    from trcvtui.rig.commands.member_values import quoted  # read when first asked for

    words = ["add", kind, name.strip()]
    for key, text in texts.items():
        value = text.strip()
        if value:
            shown = quoted(value) if key in QUOTED else value
            words.append(shown if key in BARE else f"{key}={shown}")
    return " ".join(words)


def _instance(project: Project) -> Sequence[AddField]:
    connects, data = names_of("connect", project), names_of("data", project)
    blocks = (first_block(project), *project.dialect.blocks)
    fields = [
        block_field(project, next(block for block in blocks if not buffer_pin(block))),
        AddField("connect", *_or_made("a CONNECT", connects), last_of(connects)),
    ]
    if project.udp_configs:
        fields.append(AddField("config", "of a UDP block", names_of("udp_config", project)))
    if project.addrs:
        fields.append(AddField("addr", "of a UDP block", names_of("addr", project)))
    return [
        *fields,
        AddField("data", *_or_made("a DATA variable", data), last_of(data)),
        AddField("task", "a task", tuple(task.name for task in project.tasks), project.tasks[0].name),
        AddField("inputs", "such as CONT=1 EN_R=1"),
    ]


def _or_made(what: str, names: tuple[str, ...]) -> tuple[str, tuple[str, ...]]:
    """Return hint and choices of what is made on the way where nothing is chosen."""
    return f"{what}; empty: one is made", names


def _connect(project: Project) -> Sequence[AddField]:
    if project.dialect.describes_connects:
        return connect_fields(project)
    ends = tuple(f"@{name}" for kind in ("peer", "connect") for name in names_of(kind, project))
    return [
        AddField("ActiveEstablished", "true: the PLC connects", BOOLS, "false"),
        AddField("LocalAddress", "an address of this machine", first="127.0.0.1"),
        AddField("LocalPort", "0: a free one", first="0"),
        AddField("RemoteAddress", "0.0.0.0: anybody"),
        AddField("RemotePort", "a port, or @NAME", ends),
        AddField("SendDelayOpt", "true: Nagle off", BOOLS),
        AddField("KeepAliveTimeInterval", "seconds, 0: 10 s"),
    ]


def _sessions(project: Project) -> Sequence[AddField]:
    """Return what a peer may speak on its connection, where the PLC speaks more than plain TCP."""
    if not project.dialect.describes_connects:
        return ()
    return (
        AddField("iso", "true: it speaks ISO-on-TCP", BOOLS),
        AddField("local_tsap", "its own: 16#E001, E0.01 or TCP-1"),
        AddField("remote_tsap", "that of the PLC"),
        AddField("tls", "true: it speaks TLS", BOOLS),
        AddField("certificate", "the number of its own, with a key", _numbers(project, with_key=True)),
        AddField("authority", "the number of whom it trusts", _numbers(project)),
    )


def _peer(project: Project) -> Sequence[AddField]:
    links = tuple(f"@{name}" for kind in ("connect", "udp_config") for name in names_of(kind, project))
    return [
        AddField("active", "true: it connects to remote", BOOLS[::-1], "true" if links else "false"),
        AddField("remote", "address:port, or @NAME", links, last_of(links)),
        AddField("local", "where it listens, 127.0.0.1:0"),
        AddField("udp", "true: datagrams, no active", BOOLS),
        AddField("reconnect", "after so long, such as T#1s"),
        AddField("says", "a message, such as hex 01 02"),
        AddField("every", "T#1s"),
        *_sessions(project),
    ]


def _numbers(project: Project, with_key: bool = False) -> tuple[str, ...]:
    known = project.certificates.values()
    return tuple(str(each.number) for each in known if each.key or not with_key)


def _message(project: Project) -> Sequence[AddField]:
    return [
        AddField("peer", "one peer's alone, or nobody's", names_of("peer", project)),
        AddField("text", "as after `send`: hex 01 02 split=1"),
    ]


def _fixed(*fields: AddField) -> Callable[[Project], Sequence[AddField]]:
    return lambda project: fields


_LOCAL: Final = (
    AddField("LocalAddress", "0.0.0.0", first="127.0.0.1"),
    AddField("LocalPort", "0", first="0"),
)
_REMOTE: Final = (AddField("RemoteAddress", "0.0.0.0", first="127.0.0.1"), AddField("RemotePort", "or @NAME"))


def _addr(project: Project) -> Sequence[AddField]:
    if not project.dialect.describes_connects:
        return _REMOTE
    return (
        AddField("rem_ip_addr", "0.0.0.0: a receiver writes it", first="127.0.0.1"),
        AddField("rem_port_nr", "a port, or @NAME", tuple(f"@{name}" for name in names_of("peer", project))),
    )


_FIELDS: Final[dict[str, Callable[[Project], Sequence[AddField]]]] = {
    "instance": _instance,
    "connect": _connect,
    "data": _fixed(AddField("type", "an IEC type or a UDT", first="ARRAY[0..99] OF BYTE")),
    "peer": _peer,
    "message": _message,
    "sequence": _fixed(AddField("steps", "message names and pauses: hello T#100ms bye")),
    "udp_config": _fixed(*_LOCAL),
    "addr": _addr,
    "combuffer": combuffer_fields,
    "certificate": _fixed(AddField("file", "a PEM file"), AddField("key", "of one's own: its PEM file")),
}


OF_THE_BENCH: Final = frozenset(("LocalAddress", "ListenPort"))  # beside the fields of a structure
LAYOUT: Final = (
    AddField("layout", "none: the PLC's own", tuple(LAYOUTS)),
    AddField("byte_order", "none: that of the layout", tuple(BYTE_ORDERS)),
)


class ProjectPart(NamedTuple):
    """One entry of the project."""

    kind: str
    name: str

    def __str__(self) -> str:
        """Return what the screen calls it: `CONNECT C1`."""
        return f"{words_of(self.kind)} {self.name}"


def parts_at_hand(scene: ViewModel, peer_first: bool) -> list[ProjectPart]:
    """Return the parts of the selected instance and the selected peer, what is mended most often first."""
    instance = scene.project.instance(scene.selected)
    own = list(_parts_of(instance)) if instance is not None else []
    peer = scene.peer_snapshot
    talks = [ProjectPart("peer", peer.name), ProjectPart("connect", peer.link)] if peer is not None else []
    found = dict.fromkeys([*talks, *own] if peer_first else [*own, *talks])
    return [part for part in found if entry(*part, scene.project) is not None]


def _parts_of(instance: InstanceDecl) -> Iterator[ProjectPart]:
    link = "combuffer" if buffer_pin(instance.block) else "udp_config" if instance.on_config else "connect"
    yield ProjectPart(link, instance.connect)
    if instance.addr:
        yield ProjectPart("addr", instance.addr)
    for data in (instance.data, *instance.pointers):
        if data:
            yield ProjectPart("data", data)
    yield ProjectPart("instance", instance.name)


def all_parts(project: Project) -> list[ProjectPart]:
    """Return every part of the project that can be changed or removed."""
    return [ProjectPart(kind, each.name) for kind in FIELDS for each in entries_of(kind, project)]


def values_of(part: ProjectPart, project: Project) -> dict[str, KeyValue]:
    """Return the keys that a part has now."""
    decl = entry(*part, project)
    return keys_to_change(decl, project) if decl is not None else {}


def text_of(value: KeyValue) -> str:
    """Return a value as it stands in a field."""
    if isinstance(value, list):
        return " ".join(value)
    return str(value).lower() if isinstance(value, bool) else str(value)


def fields_to_change(
    part: ProjectPart, now: Mapping[str, KeyValue], project: Project, block: str
) -> list[AddField]:
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


def set_line(
    part: ProjectPart, now: Mapping[str, KeyValue], texts: Mapping[str, str], project: Project
) -> str:
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
