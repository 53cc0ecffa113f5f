"""What a new instance gets on the way: `add instance R1 block=TRCV_C` alone makes its CONNECT and its DATA.

Rule: only what the line leaves out is made. CONNECT: passive, 127.0.0.1, the first port from 2000 on that no
part of the project has; keys of a CONNECT in the line (LocalPort=2500) are its. DATA: 1024 bytes to receive
into, 16 to send. A receiver with an ADHOC pin gets ADHOC = 1, so that the first bytes of anybody are a DONE.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from trcvtui.blocks.table import block_row
from trcvtui.net.connection.config import ConnectConfig, UdpConfig
from trcvtui.net.results import Endpoint
from trcvtui.project.edit import read_entry, with_entry
from trcvtui.project.keys import free_name
from trcvtui.project.project import Declaration, Project
from trcvtui.project.tables import Given

FIRST_PORT: Final = 2000
LAST_PORT: Final = 49_151  # behind them the system's own, for active ends
HOST: Final = "127.0.0.1"
OF_CONNECT: Final = ("ActiveEstablished", "LocalAddress", "LocalPort", "RemoteAddress", "RemotePort")
RECEIVED: Final = "ARRAY[0..1023] OF BYTE"
SENT: Final = "ARRAY[0..15] OF BYTE"
ADHOC: Final = "ADHOC"
LISTEN: Final = ("connect", "udp_config")
STARTS: Final = {"connect": "C", "udp_config": "U", "addr": "A", "combuffer": "B"}


def free_port(project: Project, after: int = FIRST_PORT - 1) -> int:
    """Return the first port from 2000 on, behind `after`, that no part has."""
    ends = [each.local for each in project.connects] + [each.local for each in project.udp_configs]
    taken = {end.port for end in ends} | {
        getattr(end, "port", 0) for peer in project.peers for end in (peer.end, peer.source)
    }
    return next(port for port in range(after + 1, LAST_PORT + 1) if port not in taken)


def link_of_block(block: str, content: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Return the keys of what a block works on, each with its kind."""
    row = block_row(block)
    if row.on_buffer:
        return ((row.buffer_pin, "combuffer"),)
    if row.speaks_udp and not (row.datagrams and "connect" in content):
        return (("config", "udp_config"), ("addr", "addr"))
    return (("connect", "connect"),)


def complete(
    content: Mapping[str, Any], project: Project, where: str
) -> tuple[dict[str, Any], tuple[Declaration, ...]]:
    """Return the keys of an instance with those that were left out, and what is made for them."""
    whole, made = dict(content), list[Declaration]()
    block = _text(content.get("block"))
    keys = link_of_block(block, content) if block in project.dialect.blocks else ()
    missing = [(key, kind) for key, kind in keys if key not in content]
    if not missing:
        return whole, ()
    own: dict[str, Any] = {key: whole.pop(key) for key in OF_CONNECT if key in whole}
    parts = [(key, kind, STARTS[kind], own if kind in LISTEN else {}) for key, kind in missing]
    row = block_row(block)
    if row.data_pin and "data" not in content:
        receives = row.receives or row.reads_buffer
        type_ = {"type": RECEIVED if receives else SENT}
        parts.append(("data", "data", "rx" if receives else "tx", type_))
    for key, kind, start, given_keys in parts:
        name = free_name(kind, start, project)
        decl = read_entry(kind, {"name": name, **_usual(kind, project), **given_keys}, project, where)
        project = with_entry(project, decl)
        made.append(decl)
        whole[key] = name
    pins = {pin.name for pin in project.pins(block)}
    if row.receives and ADHOC in pins and not whole.keys() & {ADHOC, "LEN"}:
        whole[ADHOC] = True
    return whole, tuple(made)


def _usual(kind: str, project: Project) -> dict[str, Any]:
    if kind in LISTEN:
        return {"LocalAddress": HOST, "LocalPort": free_port(project)}
    return {}


def _text(value: object) -> str:
    return value.text if isinstance(value, Given) else str(value or "")


def ends_of(made: tuple[Declaration, ...]) -> tuple[Endpoint, ...]:
    """Return the ends at which what was made will listen."""
    listening = [decl.local for decl in made if isinstance(decl, ConnectConfig | UdpConfig)]
    return tuple([end for end in listening if end.port])
