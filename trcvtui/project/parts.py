"""The entries of a project file, one function a kind of table: task, connect, instance, peer, sim.

Rule: a reader checks what its own table says; whether a name exists is asked later (project_names.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from trcvtui.blocks.parameters import (
    ADDR_IF_UDP,
    BUFFER_PIN,
    HAS_DATA,
    ON_CONNECT,
    PINS,
    POINTERS,
    SPEAKS_UDP,
    Direction,
    Pin,
)
from trcvtui.blocks.rules import Rules
from trcvtui.errors import Problem
from trcvtui.net.connection.config import ANY_ADDRESS, ConnectConfig, parse_address
from trcvtui.net.connection.udp_config import AddrParam, UdpConfig
from trcvtui.net.layer import Settings
from trcvtui.net.results import Endpoint
from trcvtui.project.iso_words import read_iso
from trcvtui.project.names import IDENTIFIER_TEXT, expected_name, is_identifier, parse_reference
from trcvtui.project.project import (
    DEFAULT_EVERY_NS,
    DEFAULT_INTERVAL_NS,
    InstanceDecl,
    MessageDecl,
    PeerDecl,
    SequenceDecl,
    SimDecl,
    Task,
)
from trcvtui.project.tables import (
    ADDRESS,
    ADDRESSES,
    DELAY,
    ENDPOINT,
    INTERVAL,
    MESSAGES,
    MILLISECONDS,
    PORT,
    RULES,
    STEPS,
    TEXT,
    TRUTH,
    Kind,
    Table,
    of_text,
    one_of,
    parse_endpoint,
    shown,
    whole,
)
from trcvtui.project.tls_words import Certificates, read_peer_tls
from trcvtui.udt.layout.rules import (
    BYTE_ORDERS,
    LAYOUT_ALIASES,
    LAYOUTS,
    POINTER_SIZES,
    TEXT_FORMS,
    LayoutChoice,
)
from trcvtui.udt.types import ELEMENTARY

NAME: Final = of_text(IDENTIFIER_TEXT, lambda text: text if is_identifier(text) else None)
UINT: Final = whole(*ELEMENTARY["UINT"].limits)
PRIORITY: Final = whole(0, 255)
SEED: Final = whole(0, (1 << 63) - 1)
LINT: Final = whole(*ELEMENTARY["LINT"].limits)
DEEPEST_NAME: Final = 8  # Lib.Ns.GVL.MAX has 3 dots
FREE_PORT: Final = Endpoint("127.0.0.1", 0)


def names_of(value: Any) -> tuple[tuple[str, str], ...] | None:
    """Return the names of a table with their addresses, None where one is no address."""
    if not isinstance(value, Mapping):
        return None
    found = [(name, parse_address(address)) for name, address in value.items() if isinstance(address, str)]
    known = tuple((name, address) for name, address in found if address is not None)
    return known if len(known) == len(value) else None


NAMES: Final[Kind[tuple[tuple[str, str], ...]]] = Kind(
    'names and addresses such as { "plc2.line.local." = "10.0.0.7" }', names_of, lambda text: None
)


def _reference(text: str) -> str | None:
    return text if parse_reference(text) is not None else None


PORT_OR_NAME: Final[Kind[int | str]] = Kind(
    "a port from 0 to 65535, or @NAME of a peer or CONNECT",
    lambda value: _reference(value) if isinstance(value, str) else PORT.read(value),
    lambda text: _reference(text) or PORT.from_text(text),
)
UDP_PORT_OR_NAME: Final[Kind[int | str]] = Kind(
    "a port from 0 to 65535, or @NAME of a peer or UDP_CONFIG", PORT_OR_NAME.read, PORT_OR_NAME.from_text
)
END_OR_NAME: Final[Kind[Endpoint | str]] = of_text(
    "an IPv4 address and a port such as 127.0.0.1:2000, or @NAME of a CONNECT",
    lambda text: _reference(text) or parse_endpoint(text),
)
UDP_END_OR_NAME: Final[Kind[Endpoint | str]] = of_text(
    "an IPv4 address and a port such as 127.0.0.1:2000, or @NAME of a UDP_CONFIG",
    lambda text: _reference(text) or parse_endpoint(text),
)
LAYOUT: Final = of_text(
    "a layout: " + ", ".join(LAYOUTS),
    lambda text: text if text in LAYOUTS or text in LAYOUT_ALIASES else None,
)
BYTE_ORDER: Final = of_text("little or big", lambda text: text if text in BYTE_ORDERS else None)
TEXT_FORM: Final = of_text(
    "a form of STRING: " + ", ".join(TEXT_FORMS), lambda text: text if text in TEXT_FORMS else None
)
POINTER_SIZE: Final = one_of(*POINTER_SIZES)


def entries(document: Mapping[str, Any], key: str, where: str, problems: list[Problem]) -> list[Table]:
    """Return the tables of `[[key]]`; each is named in messages by its name, or by its number from 1."""
    content = document.get(key, [])
    if not isinstance(content, list) or not all(isinstance(entry, Mapping) for entry in content):
        problems.append(Problem(f"{where}: {key}", shown(content), f"tables that begin with [[{key}]]"))
        return []
    return [
        Table(entry, f"{where}: {key} {_label(entry, n)}", problems) for n, entry in enumerate(content, 1)
    ]


def _label(entry: Mapping[str, Any], number: int) -> str:
    name = entry.get("name")
    return name if isinstance(name, str) and is_identifier(name) else f"#{number}"


def read_task(table: Table) -> Task | None:
    """Return one task."""
    name = table.must("name", NAME)
    interval = table.get("interval", INTERVAL, DEFAULT_INTERVAL_NS)
    priority = table.get("priority", PRIORITY, 1)
    table.finish()
    return Task(name, interval, priority) if name is not None else None


def read_connect(table: Table) -> ConnectConfig | None:
    """Return one TCP_CONNECTCONFIG; what the file leaves out is 0, as in the record."""
    name = table.must("name", NAME)
    active = table.get("ActiveEstablished", TRUTH, False)
    address = table.get("LocalAddress", ADDRESS, ANY_ADDRESS)
    port = table.get("LocalPort", PORT, 0)
    remote_address = table.get("RemoteAddress", ADDRESS, ANY_ADDRESS)
    remote_port = table.get("RemotePort", PORT_OR_NAME, 0)
    send_delay = table.get("SendDelayOpt", TRUTH, False)
    keep_alive = table.get("KeepAliveTimeInterval", UINT, 0)
    table.finish()
    if name is None:
        return None
    local = Endpoint(address, port)
    return ConnectConfig(name, active, local, remote_address, remote_port, send_delay, keep_alive)


def read_udp_config(table: Table) -> UdpConfig | None:
    """Return one UDP_CONFIG; what the file leaves out is 0, as in the record."""
    name = table.must("name", NAME)
    address = table.get("LocalAddress", ADDRESS, ANY_ADDRESS)
    port = table.get("LocalPort", PORT, 0)
    table.finish()
    return UdpConfig(name, Endpoint(address, port)) if name is not None else None


def read_addr(table: Table) -> AddrParam | None:
    """Return one ADDR_PARAM; what the file leaves out is 0, as in the record."""
    name = table.must("name", NAME)
    address = table.get("RemoteAddress", ADDRESS, ANY_ADDRESS)
    port = table.get("RemotePort", UDP_PORT_OR_NAME, 0)
    table.finish()
    return AddrParam(name, address, port) if name is not None else None


def read_instance(
    table: Table, blocks: tuple[str, ...], first_task: str, rules: Rules
) -> InstanceDecl | None:
    """Return one instance; every key that is not its own is an input pin of its block."""
    name = table.must("name", NAME)
    block = table.must("block", TEXT)
    speaks_udp = block in SPEAKS_UDP
    on_config = speaks_udp and not (block in ON_CONNECT and table.has("connect"))
    connect = table.must("config" if on_config else link_key(block or ""), TEXT)
    if block in ON_CONNECT and not on_config and table.has("config"):
        table.know("config")
        table.wrong("config", "a UDP_CONFIG beside a CONNECT", "one of them")
    addr = table.must("addr", TEXT) if speaks_udp else _addr_if_udp(table, block, blocks)
    data = table.read("data", TEXT)
    pointers = tuple([table.get(key, TEXT, "") for key in POINTERS.get(block or "", ())])
    task = table.get("task", TEXT, first_task)
    if data is not None and block in blocks and block not in HAS_DATA:
        table.wrong("data", shown(data), f"nothing: {block} has no DATA")
    if block is not None and block not in blocks:
        table.wrong("block", shown(block), expected_name(block, blocks, "block"))
    # Without its block nobody knows which pins it has: the other names are checked all the same.
    inputs = _read_inputs(table, tuple(map(rules.typed, PINS[block]))) if block in blocks else ()
    if name is None or block is None or connect is None or (speaks_udp and addr is None):
        return None
    return InstanceDecl(name, block, connect, data, task, inputs, addr, on_config, pointers)


def link_key(block: str) -> str:
    """Return the key of what a block works on: a ComBuffer or a CONNECT."""
    return BUFFER_PIN.get(block, "connect")


def _addr_if_udp(table: Table, block: str | None, blocks: tuple[str, ...]) -> str | None:
    """Return ADDR of a _C block; only where there is TUSEND can a CONNECT be of UDP."""
    return table.read("addr", TEXT) if block in ADDR_IF_UDP and set(blocks) >= ON_CONNECT else None


def _read_inputs(table: Table, pins: tuple[Pin, ...]) -> tuple[tuple[str, bool | int], ...]:
    inputs = [pin for pin in pins if pin.direction is not Direction.OUT]
    outputs = [pin.name for pin in pins if pin.direction is Direction.OUT]
    for key in table.rest():
        if key in outputs:
            table.know(key)
            table.wrong(key, "an output", "an input: " + ", ".join(pin.name for pin in inputs))
    found = [(pin.name, table.read(pin.name, kind_of(pin))) for pin in inputs]
    table.finish("key or input pin")
    return tuple((name, value) for name, value in found if value is not None)


def kind_of(pin: Pin) -> Kind[Any]:
    """Return what a pin can hold: true and false, or the range of its IEC type."""
    if pin.iec_type == "TIME":
        return MILLISECONDS
    return TRUTH if pin.is_bool else whole(*ELEMENTARY[pin.iec_type].limits)


def read_peer(table: Table, certificates: Certificates) -> PeerDecl | None:
    """Return one peer; without `active` it is active when it has a `remote`."""
    name = table.must("name", NAME)
    if table.get("udp", TRUTH, False):
        return _read_udp_peer(table, name)
    active = table.get("active", TRUTH, table.has("remote"))
    end: Endpoint | str | None
    source = None
    if active:
        end = table.must("remote", END_OR_NAME)
        source = table.read("local", ENDPOINT)
    else:
        end = table.get("local", ENDPOINT, FREE_PORT)
        if table.has("remote"):
            table.know("remote")
            table.wrong("remote", "an address to connect to", "active = true, or local alone")
    reconnect = table.get("reconnect", DELAY, 0) if active else 0
    says = table.get("says", MESSAGES, ())
    every = table.get("every", INTERVAL, DEFAULT_EVERY_NS)
    replies = table.get("replies", RULES, ())
    choice = read_choice(table)
    session, tls = _read_session(table, certificates)
    table.finish()
    if name is None or end is None:
        return None
    decl = PeerDecl(
        name, active, end, source, reconnect, says, every, replies=replies, session=session, tls=tls
    )
    return replace(decl, choice=choice)


def _read_session(
    table: Table, certificates: Certificates
) -> tuple[Settings | None, tuple[tuple[str, bool | int | str], ...]]:
    iso, secure = read_iso(table), read_peer_tls(table, certificates)
    if iso is not None and secure is not None:
        table.wrong("tls", "true beside iso = true", "one of them")
    return (iso, ()) if secure is None else (secure.settings, secure.keys)


def _read_udp_peer(table: Table, name: str | None) -> PeerDecl | None:
    end = table.get("local", ENDPOINT, FREE_PORT)
    remote = table.read("remote", UDP_END_OR_NAME)
    says = table.get("says", MESSAGES, ())
    every = table.get("every", INTERVAL, DEFAULT_EVERY_NS)
    replies = table.get("replies", RULES, ())
    choice = read_choice(table)
    for key in ("active", "reconnect"):
        if table.has(key):
            table.know(key)
            table.wrong(key, "a word of connections", "local and remote alone: UDP has no connection")
    table.finish()
    if name is None:
        return None
    decl = PeerDecl(name, False, end, says=says, every_ns=every, udp=True, remote=remote, replies=replies)
    return replace(decl, choice=choice)


def read_choice(table: Table) -> LayoutChoice:
    """Return the layout that a table names, as far as it names one."""
    return LayoutChoice(
        table.read("layout", LAYOUT),
        table.read("byte_order", BYTE_ORDER),
        table.read("text", TEXT_FORM),
        table.read("pointer_size", POINTER_SIZE),
        table.read("string_even", TRUTH),
    )


def read_message(table: Table) -> MessageDecl | None:
    """Return one named message."""
    name = table.must("name", NAME)
    text = table.must("text", TEXT)
    peer = table.get("peer", TEXT, "")
    table.finish()
    return MessageDecl(name, text, peer) if name is not None and text is not None else None


def read_sequence(table: Table) -> SequenceDecl | None:
    """Return one sequence of messages."""
    name = table.must("name", NAME)
    steps = table.must("steps", STEPS)
    table.finish()
    return SequenceDecl(name, steps) if name is not None and steps is not None else None


def read_constants(content: Mapping[str, Any], where: str, problems: list[Problem]) -> dict[str, int]:
    """Return the constants of the UDTs: `"GVL.MAX" = 10`; without the quotes TOML makes a table GVL."""
    flat: dict[str, Any] = {}
    waiting = list(content.items())
    while waiting:
        name, value = waiting.pop(0)
        if isinstance(value, Mapping) and name.count(".") < DEEPEST_NAME:
            waiting += [(f"{name}.{key}", inner) for key, inner in value.items()]
        else:
            flat[name] = value
    table = Table(flat, where, problems)
    return {name: number for name in flat if (number := table.read(name, LINT)) is not None}


def read_sim(table: Table) -> SimDecl:
    """Return the simulated network."""
    sim = SimDecl(
        addresses=table.get("addresses", ADDRESSES, ()),
        not_ethernet=table.get("not_ethernet", ADDRESSES, ()),
        seed=table.get("seed", SEED, 0),
        latency_ns=table.get("latency", DELAY, 0),
        fragment=table.get("fragment", TRUTH, False),
        names=table.read("names", NAMES),
    )
    table.finish()
    return sim
