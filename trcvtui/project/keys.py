"""A declaration back to the keys of its table: read again they give the same declaration.

Rule: a key that would only say its default is left out, except where a reader of the file looks for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
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
    TIMES,
    Direction,
    Pin,
)
from trcvtui.blocks.rules import Rules
from trcvtui.errors import Problem
from trcvtui.net.connection.config import ANY_ADDRESS, ConnectConfig
from trcvtui.net.connection.udp_config import AddrParam, UdpConfig
from trcvtui.net.layer import Settings
from trcvtui.net.layers.iso_on_tcp import IsoSettings
from trcvtui.net.results import Endpoint
from trcvtui.net.serial_line import SerialSettings
from trcvtui.project.descriptions import field_keys, keys_of_description, keys_of_iso, plain_keys
from trcvtui.project.layers import read_iso, read_peer_tls
from trcvtui.project.names import expected_name, is_identifier
from trcvtui.project.project import (
    DEFAULT_EVERY_NS,
    DEFAULT_INTERVAL_NS,
    SERIAL,
    SIMULATED,
    CertificateDecl,
    Certificates,
    ComBufferDecl,
    DataDecl,
    Declaration,
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
    BYTE_ORDER,
    DELAY,
    END_OR_NAME,
    ENDPOINT,
    INTERVAL,
    LAYOUT,
    LINT,
    MESSAGES,
    MILLISECONDS,
    NAME,
    NAMES,
    POINTER_SIZE,
    PORT,
    PORT_OR_NAME,
    PRIORITY,
    RULES,
    SEED,
    STEPS,
    TEXT,
    TEXT_FORM,
    TRUTH,
    UDP_END_OR_NAME,
    UDP_PORT_OR_NAME,
    UINT,
    Kind,
    Table,
    of_text,
    shown,
    whole,
)
from trcvtui.udt.layout.rules import (
    LayoutChoice,
)
from trcvtui.udt.literals import format_time
from trcvtui.udt.types import ELEMENTARY

# Rule: a reader checks what its own table says; whether a name exists is asked later (project_names.py).

QUEUE_SIZE: Final = whole(1, 65_536)
BAUD: Final = whole(50, 4_000_000)
DATA_BITS: Final = whole(5, 8)
PORT_KEYS: Final = ("port", "baud", "data_bits", "parity", "stop_bits", "handshake")


def _one_of(*words: str) -> Kind[str]:
    return of_text(" or ".join(words), lambda text: text if text in words else None)


def _stop_bits(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and value in (1, 1.5, 2) else None


STOP_BITS: Final = Kind("1, 1.5 or 2", _stop_bits, lambda text: {"1": 1.0, "1.5": 1.5, "2": 2.0}.get(text))
PARITY: Final = _one_of("none", "even", "odd", "mark", "space")
HANDSHAKE: Final = _one_of("none", "rts/cts", "dsr/dtr", "xon/xoff")
PORT_NAME: Final = of_text("the name of a port, such as /dev/ttyUSB0", lambda text: text.strip() or None)

# What one ComBuffer alone may name: what the one has in it, and what the other has to name.
ENDS: Final = (
    ("source", "whose bytes go to {}", "a source of its own: each byte goes to one ComBuffer"),
    ("line", "over which {} goes out", "a line of its own: one ComBuffer goes out over it"),
    ("port", "the port of {}", "a port of its own"),
)


def read_combuffer(table: Table) -> ComBufferDecl | None:
    """Return one ComBuffer."""
    name = table.must("name", NAME)
    source = table.get("source", TEXT, SIMULATED)
    size = table.get("size", QUEUE_SIZE, 0)
    per_cycle = table.get("per_cycle", QUEUE_SIZE, 0)
    line = table.get("line", TEXT, "")
    serial = None
    if source == SERIAL:
        serial = _read_serial(table)
    else:
        _refuse_port_keys(table)
    table.finish()
    if name is None:
        return None
    return ComBufferDecl(name, source, size, per_cycle, serial=serial, line=line)


def _read_serial(table: Table) -> SerialSettings | None:
    settings = SerialSettings(
        table.must("port", PORT_NAME) or "",
        table.get("baud", BAUD, 9600),
        table.get("data_bits", DATA_BITS, 8),
        table.get("parity", PARITY, "none"),
        table.get("stop_bits", STOP_BITS, 1.0),
        table.get("handshake", HANDSHAKE, "none"),
    )
    return settings if settings.port else None


def _refuse_port_keys(table: Table) -> None:
    for key in PORT_KEYS:
        if table.has(key):
            table.know(key)
            table.wrong(key, "a word of serial ports", 'source = "serial" beside it')


def find_shared_ends(tables: Sequence[Table]) -> None:
    """Record every source, line and port that an earlier ComBuffer has, and a cable from one with a line.

    Of a URL each opening is a connection of its own.
    """
    for key, has, expected in ENDS:
        seen: dict[str, str] = {}
        for table in tables:
            end, name = table.text(key), table.text("name")
            if not end or not name or end in (SIMULATED, SERIAL) or (key == "port" and "://" in end):
                continue
            if end in seen:
                table.wrong(key, f"{shown(end)}, {has.format(seen[end])}", expected)
            seen.setdefault(end, name)
    lines = {table.text("name"): table.text("line") for table in tables}
    for table in tables:
        source = table.text("source")
        if source and lines.get(source):
            found = f"{shown(source)}, which goes out over {lines[source]}"
            table.wrong("source", found, "a ComBuffer without a line")


def joined_up(
    buffers: Iterable[ComBufferDecl], instances: tuple[InstanceDecl, ...]
) -> tuple[ComBufferDecl, ...]:
    """Return the ComBuffers with what the instances make of them."""
    written = {i.connect for i in instances if BUFFER_PIN.get(i.block) == "TxBuffer"}
    names = {i.name for i in instances}
    return tuple([replace(b, is_written=b.name in written, is_fed=b.source in names) for b in buffers])


DEEPEST_NAME: Final = 8  # Lib.Ns.GVL.MAX has 3 dots
FREE_PORT: Final = Endpoint("127.0.0.1", 0)


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
