"""A declaration back to the keys of its table: read again they give the same declaration.

Rule: a key that would only say its default is left out, except where a reader of the file looks for it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from trcvtui.blocks.parameters import POINTERS, TIMES
from trcvtui.net.connection.config import ANY_ADDRESS, ConnectConfig
from trcvtui.net.connection.udp_config import AddrParam, UdpConfig
from trcvtui.net.layers.iso_on_tcp import IsoSettings
from trcvtui.project.description_keys import field_keys, keys_of_description, keys_of_iso, plain_keys
from trcvtui.project.parts import FREE_PORT, link_key
from trcvtui.project.project import (
    DEFAULT_EVERY_NS,
    SERIAL,
    SIMULATED,
    ComBufferDecl,
    DataDecl,
    Declaration,
    InstanceDecl,
    MessageDecl,
    PeerDecl,
    SequenceDecl,
)
from trcvtui.project.tls_words import CertificateDecl
from trcvtui.udt.layout.rules import LayoutChoice
from trcvtui.udt.literals import format_time

KeyValue = bool | int | float | str | list[str]
Keys = list[tuple[str, KeyValue]]

KIND_OF: Final[dict[type, str]] = {
    ConnectConfig: "connect",
    UdpConfig: "udp_config",
    AddrParam: "addr",
    ComBufferDecl: "combuffer",
    DataDecl: "data",
    InstanceDecl: "instance",
    PeerDecl: "peer",
    MessageDecl: "message",
    SequenceDecl: "sequence",
    CertificateDecl: "certificate",
}


def keys_of(decl: Declaration) -> Keys:
    """Return the keys behind `name` with their TOML values, in the order of the contract."""
    return _KEYS[type(decl)](decl)


def forms_of(decl: Declaration) -> list[Keys]:
    """Return the ways to write the keys of a declaration, the easiest to change first."""
    if isinstance(decl, ConnectConfig) and decl.description is not None:
        return [plain_keys(decl, decl.description), field_keys(decl, decl.description), keys_of(decl)]
    return [keys_of(decl)]


def entry_of(decl: Declaration) -> Keys:
    """Return the whole table of a declaration, with what it is called by."""
    called: tuple[str, KeyValue] = ("name", decl.name)
    if isinstance(decl, CertificateDecl):
        called = ("number", decl.number)
    return [called, *keys_of(decl)]


def _connect(c: ConnectConfig) -> Keys:
    if c.description is not None:
        return keys_of_description(c, c.description)
    keys: Keys = [("ActiveEstablished", c.active)]
    keys += _unless(ANY_ADDRESS, "LocalAddress", c.local.address)
    keys += [("LocalPort", c.local.port)] if c.local.port or not c.active else []
    keys += _unless(ANY_ADDRESS, "RemoteAddress", c.remote_address)
    keys += _unless(0, "RemotePort", c.remote_port)
    keys += _unless(False, "SendDelayOpt", c.send_delay_opt)
    return keys + _unless(0, "KeepAliveTimeInterval", c.keep_alive_interval_s)


def _udp_config(c: UdpConfig) -> Keys:
    return [*_unless(ANY_ADDRESS, "LocalAddress", c.local.address), ("LocalPort", c.local.port)]


def _addr(a: AddrParam) -> Keys:
    if a.description is not None:
        keys: Keys = [("type", a.description.structure.name), ("bytes", a.description.data.hex(" "))]
        return keys + ([("RemotePort", a.remote_port)] if isinstance(a.remote_port, str) else [])
    return [
        *_unless(ANY_ADDRESS, "RemoteAddress", a.remote_address),
        *_unless(0, "RemotePort", a.remote_port),
    ]


def _combuffer(b: ComBufferDecl) -> Keys:
    keys = _unless(SIMULATED, "source", b.source)
    s = b.serial
    if s is not None and b.source == SERIAL:
        keys += [("port", s.port), ("baud", s.baud), *_unless(8, "data_bits", s.data_bits)]
        keys += [*_unless("none", "parity", s.parity), *_unless(1, "stop_bits", _plain(s.stop_bits))]
        keys += _unless("none", "handshake", s.handshake)
    keys += [*_unless(0, "size", b.size), *_unless(0, "per_cycle", b.per_cycle)]
    return keys + _unless("", "line", b.line)


def _instance(i: InstanceDecl) -> Keys:
    link = "config" if i.on_config else link_key(i.block)
    keys: Keys = [("block", i.block), (link, i.connect)]
    keys += [("addr", i.addr)] if i.addr is not None else []
    keys += [("data", i.data)] if i.data is not None else []
    named = zip(POINTERS.get(i.block, ()), i.pointers, strict=False)
    keys += [(key, name) for key, name in named if name]
    return [*keys, ("task", i.task), *[(pin, _as_written(pin, value)) for pin, value in i.inputs]]


def _as_written(pin: str, value: bool | int) -> KeyValue:
    return format_time(value * 1_000_000) if pin in TIMES else value


def _peer(p: PeerDecl) -> Keys:
    keys: Keys = [("udp", True)] if p.udp else [("active", p.active)]
    if p.active:
        keys.append(("remote", str(p.end)))
        keys += [("local", str(p.source))] if p.source is not None else []
    else:
        keys += _unless(str(FREE_PORT), "local", str(p.end))
        keys += [("remote", str(p.remote))] if p.remote is not None else []
    keys += [("reconnect", format_time(p.reconnect_ns))] if p.reconnect_ns else []
    keys += [("says", list(p.says))] if p.says else []
    keys += [("every", format_time(p.every_ns))] if p.every_ns != DEFAULT_EVERY_NS else []
    keys += [("replies", list(p.replies))] if p.replies else []
    keys += _choice(p.choice)
    keys += keys_of_iso(p.session) if isinstance(p.session, IsoSettings) else []
    return keys + list(p.tls)


def _data(d: DataDecl) -> Keys:
    return [("type", d.type_name), *_unless(False, "optimized", d.optimized), *_choice(d.choice)]


def _choice(choice: LayoutChoice) -> Keys:
    given = zip(choice._fields, choice, strict=True)
    return [(name, value) for name, value in given if value is not None]


def _message(m: MessageDecl) -> Keys:
    return [("text", m.text), *_unless("", "peer", m.peer)]


def _plain(number: float) -> KeyValue:
    return int(number) if number == int(number) else number


def _unless(default: KeyValue, key: str, value: KeyValue) -> Keys:
    return [(key, value)] if value != default else []


_KEYS: Final[dict[type, Callable[[Any], Keys]]] = {
    ConnectConfig: _connect,
    UdpConfig: _udp_config,
    AddrParam: _addr,
    ComBufferDecl: _combuffer,
    DataDecl: lambda d: [
        ("type", d.type_name),
        *_unless(False, "optimized", d.optimized),
        *_choice(d.choice),
    ],
    InstanceDecl: _instance,
    PeerDecl: _peer,
    MessageDecl: _message,
    SequenceDecl: lambda s: [("steps", list(s.steps))],
    CertificateDecl: lambda c: [("file", c.file), *_unless("", "key", c.key)],
}
