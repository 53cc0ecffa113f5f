"""Every key of a project file is one row here: how it is read and written, what a form asks, what it means.

To add a key, add its value to the declaration (`project.py`) and its row to the table.
Rule 1: a row checks only its own table; `file.py` checks whether names exist in other tables.
Rule 2: a key with its default value is not written, unless readers expect the key in the file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final

from msgspec.structs import replace

from trcvtui.blocks.pins import Direction, Pin
from trcvtui.blocks.table import affix_pin_names, block_row, com_buffer_pins, is_time_pin
from trcvtui.dialects.dialect import Dialect
from trcvtui.errors import UserError, collect_problems
from trcvtui.net.connection.config import AddrParam, ConnectConfig, UdpConfig
from trcvtui.net.connection.description import CONNECTIONS
from trcvtui.net.layers.iso_on_tcp import OWN_SIZE_CODE, IsoSettings
from trcvtui.net.received_ring import DEFAULT_HISTORY
from trcvtui.net.results import ANY_ADDRESS, Endpoint
from trcvtui.project import descriptions
from trcvtui.project.descriptions import (
    CERTIFICATE_NUMBER,
    HOST,
    LONGEST_MESSAGE,
    LOOPBACK,
    TPDU,
    TSAP,
    VERIFY,
    make_certificate,
    tls_of_peer,
)
from trcvtui.project.key_rows import (
    Hint,
    Key,
    KeyPairs,
    KeyValue,
    NameRef,
    Offer,
    ReadContext,
    Refusal,
    TableRow,
    TableValues,
    offer_fixed,
    offer_none,
)
from trcvtui.project.project import (
    DEFAULT_EVERY_NS,
    DEFAULT_INTERVAL_NS,
    SERIAL,
    SIMULATED,
    CertificateDecl,
    ComBufferDecl,
    DataDecl,
    Declaration,
    InstanceDecl,
    MessageDecl,
    PeerDecl,
    Project,
    SequenceDecl,
    SimDecl,
    TapDecl,
    Task,
    UdtFile,
    WatchDecl,
)
from trcvtui.project.proposals import NEW, propose_part
from trcvtui.project.tables import (
    ADDRESS,
    ADDRESSES,
    BAUD,
    BYTE_ORDER,
    DATA_BITS,
    DELAY,
    END_OR_NAME,
    ENDPOINT,
    FAR_END,
    FILE,
    HANDSHAKE,
    HISTORY_SIZE,
    HOST_NAMES,
    INTERVAL,
    LAYOUT,
    MESSAGE_LIST,
    MILLISECONDS,
    NAME,
    PARITY,
    POINTER_SIZE,
    PORT,
    PORT_NAME,
    PORT_OR_NAME,
    PRIORITY,
    QUEUE_SIZE,
    RULE_LIST,
    SEED,
    STEP_LIST,
    STOP_BITS,
    TAP_PLACE,
    TEXT,
    TEXT_FORM,
    TRUTH,
    UDP_END_OR_NAME,
    UDP_PORT_OR_NAME,
    UINT,
    Kind,
    Table,
    integer,
    quote,
)
from trcvtui.udt.layout.layout import Layout, lay_out
from trcvtui.udt.layout.rules import BYTE_ORDERS, LAYOUTS, LayoutChoice, LayoutRules
from trcvtui.udt.sources import content_of, parse_type
from trcvtui.udt.type_set import NO_TYPES
from trcvtui.udt.types import ELEMENTARY, Type

FREE_PORT: Final = Endpoint(LOOPBACK, 0)
BOOLS: Final = ("false", "true")


def _name_key(what: str) -> Key:
    return Key("name", NAME, f"The name of the {what}.", "name", is_needed=True)


_HISTORY: Final = Key(
    "history", HISTORY_SIZE,
    "Bytes kept of what was received, and of what was sent; default 1MiB each, at most 64MiB in all.",
    "history", DEFAULT_HISTORY, is_played=True,
)  # fmt: skip


# -- what a form offers ----------------------------------------------------------------------------------


def names_of(kind: str, project: Project) -> tuple[str, ...]:
    return tuple([entry.name for entry in entries_of(kind, project)])


def entries_of(kind: str, project: Project) -> tuple[Any, ...]:
    found = getattr(project, TABLES[kind].field)
    return tuple(found.values()) if isinstance(found, Mapping) else found


def kinds_sharing_names(kind: str) -> tuple[str, ...]:
    return tuple([each for each in TABLES if each == kind or each in TABLES[kind].shares])


def free_name(kind: str, start: str, project: Project) -> str:
    """Return the first of `start`1, `start`2 .. that no entry has."""
    taken = {name for each in kinds_sharing_names(kind) for name in names_of(each, project)}
    return next(name for n in range(1, len(taken) + 2) if (name := f"{start}{n}") not in taken)


def _offer_names(*kinds: str, before: tuple[str, ...] = ()) -> Offer:
    return lambda project, block: (*before, *(name for kind in kinds for name in names_of(kind, project)))


def _offer_new_or(kind: str) -> Offer:
    return _offer_names(kind, before=(NEW,))


def _offer_refs(*kinds: str) -> Offer:
    offer = _offer_names(*kinds)
    return lambda project, block: tuple([f"@{name}" for name in offer(project, block)])


def _propose_last(offer: Offer) -> Callable[[Project, str], str]:
    """Return a function that proposes the last name returned by `offer`, or "" if there is none."""
    return lambda project, block: next(reversed(offer(project, block)), "")


def _truth_hint(hint: str, first: str = "", **more: Any) -> Hint:
    return Hint(hint, offer_fixed(*BOOLS), first, **more)


def _offer_certs(with_key: bool = False) -> Offer:
    return lambda project, block: tuple(
        [str(each.number) for each in project.certificates.values() if each.key or not with_key]
    )


# -- TCP and UDP -----------------------------------------------------------------------------------------

_PEER_OR_CONNECT: Final = NameRef("peer or CONNECT", ("peer", "connect"), by_at=True)
_PEER_OR_UDP: Final = NameRef("peer or UDP_CONFIG", ("peer", "udp_end"), by_at=True)


def _local_port(config: ConnectConfig) -> int | None:
    return config.local.port if config.local.port or not config.active else None


_CONNECT: Final = TableRow(
    "connect", "connects", ConnectConfig,
    "A connection: one TCP_CONNECTCONFIG. A key that is left out is 0, as in that structure.",
    (
        _name_key("CONNECT"),
        Key("ActiveEstablished", TRUTH, "Whether the PLC connects, or waits for a partner.", "active", False,
            Hint("true: the PLC connects", offer_fixed(*BOOLS), "false"), is_said=True),
        Key("LocalAddress", ADDRESS, "The address of this machine to use.", "local.address",
            ANY_ADDRESS, Hint("an address of this machine", first=LOOPBACK)),
        Key("LocalPort", PORT, "The port on this side; 0 takes a free one.", "local.port", 0,
            Hint("0: a free one", first="0"), writes=_local_port, is_said=True),
        Key("RemoteAddress", ADDRESS, "The partner's address; 0.0.0.0 accepts any.", "remote_address",
            ANY_ADDRESS, Hint("0.0.0.0: any")),
        Key("RemotePort", PORT_OR_NAME, "The partner's port; @NAME: where that peer or CONNECT listens.",
            "remote_port", 0, Hint("a port, or @NAME", _offer_refs("peer", "connect")), _PEER_OR_CONNECT),
        Key("SendDelayOpt", TRUTH, "true: small pieces are sent at once (Nagle off).", "send_delay_opt",
            False, _truth_hint("true: Nagle off")),
        Key("KeepAliveTimeInterval", UINT, "Seconds between probes of a silent partner; 0 means 10.",
            "keep_alive_interval_s", 0, Hint("seconds, 0: 10 s")),
        _HISTORY,
    ),
    "CONNECT", "a connection (CONNECT)", "C", shares=("udp_config", "peer", "combuffer"),
)  # fmt: skip

_UDP_CONFIG: Final = TableRow(
    "udp_config", "udp_configs", UdpConfig, "An address and port where a PLC receives datagrams.",
    (
        _name_key("UDP_CONFIG"),
        Key("LocalAddress", ADDRESS, "The address of this machine to use.", "local.address",
            ANY_ADDRESS, Hint("0.0.0.0", first=LOOPBACK)),
        Key("LocalPort", PORT, "The port that it receives on; 0 takes a free one.", "local.port", 0,
            Hint("0", first="0"), is_said=True),
        _HISTORY,
    ),
    "UDP_CONFIG", "a UDP_CONFIG", "U", shares=("connect", "peer", "combuffer"),
)  # fmt: skip

_ADDR: Final = TableRow(
    "addr", "addrs", AddrParam, "An ADDR_PARAM: the address to which datagrams go, or from which they came.",
    (
        _name_key("ADDR"),
        Key("RemoteAddress", ADDRESS, "The partner's address.", "remote_address", ANY_ADDRESS,
            Hint("0.0.0.0", first=LOOPBACK)),
        Key("RemotePort", UDP_PORT_OR_NAME, "The partner's port, or @NAME.", "remote_port", 0,
            Hint("or @NAME"), _PEER_OR_UDP),
    ),
    "ADDR", "an ADDR of UDP", "A",
)  # fmt: skip


# -- connection descriptions -----------------------------------------------------------------------------


def _has_tcon_param_alone(project: Project, block: str) -> bool:
    return project.dialect.structures == ("TCON_Param",)


def _has_newer(project: Project, block: str) -> bool:
    return not _has_tcon_param_alone(project, block)


def _field_keys() -> Iterable[Key]:
    ends, numbers = _offer_refs("peer", "connect"), _offer_certs()
    refers = {"RemotePort": _PEER_OR_CONNECT}

    def newer_key(name: str, hint: str, choices: Offer = offer_none, is_quoted: bool = False) -> Key:
        ask = Hint(hint, choices, where=_has_newer, is_quoted=is_quoted)
        return Key(name, None, hint, ask=ask, refers=refers.get(name))

    def older_key(name: str, hint: str, choices: Offer = offer_none, first: str = "") -> Key:
        ask = Hint(hint, choices, first, where=_has_tcon_param_alone)
        return Key(name, None, hint, ask=ask, refers=refers.get(name))

    yield newer_key("ID", "1 to 4095")
    yield newer_key("ConnectionType", "11 TCP, 12 ISO, 13 by name, 19 UDP")
    yield newer_key("ActiveEstablished", "true: the PLC connects", offer_fixed(*BOOLS))
    yield newer_key("RemoteAddress", "0.0.0.0: any")
    yield newer_key("RemoteQDN", "TCON_QDN: a name that ends with a dot")
    yield newer_key("RemotePort", "a port, or @NAME", ends)
    yield newer_key("LocalPort", "passive: 1 to 49151")
    yield newer_key("LocalTSelector", "TCON_IP_RFC: 16#E002, E0.02 or TCP-1", is_quoted=True)
    yield newer_key("RemoteTSelector", "the partner's, as for LocalTSelector", is_quoted=True)
    yield Key("IsoPort", PORT_OR_NAME, "A port to use instead of 102, which needs rights.",
              default=descriptions.ISO_PORT, ask=Hint("on the bench, not 102", ends, where=_has_newer),
              refers=_PEER_OR_CONNECT, writes=descriptions.iso_port_of, is_said=True)  # fmt: skip
    yield newer_key("ActivateSecureConn", "SEC: true is TLS", offer_fixed(*BOOLS))
    yield newer_key("TLSServerCertRef", "the number of a certificate", numbers)
    yield newer_key("TLSClientCertRef", "the number of a certificate", numbers)
    yield older_key("ActiveEstablished", "no type: true, the PLC connects", offer_fixed(*BOOLS), "false")
    yield older_key("RemoteAddress", "no type: 0.0.0.0, any")
    yield older_key("RemotePort", "no type: a port, or @NAME", ends)
    yield older_key("LocalPort", "no type: 0, a free one")
    yield older_key("id", "TCON_Param: 1 to 4095")
    yield older_key("connection_type", "TCON_Param: 17 TCP, 18 ISO, 19 UDP")
    yield older_key("active_est", "TCON_Param: true, the PLC connects", offer_fixed(*BOOLS))
    yield older_key("rem_staddr", "TCON_Param: 4 bytes of the address")
    yield older_key("local_tsap_id", "TCON_Param: port or TSAP in hex")
    yield older_key("rem_tsap_id", "TCON_Param: port or TSAP in hex")


def _read_description(values: TableValues) -> None:
    table, structures = values.table, values.around.dialect.structures
    values["description"] = descriptions.read_description(table, values.number, structures)


def _make_described_fields(values: TableValues) -> dict[str, Any] | None:
    around, written = values.around, values["description"]
    if written is None or values["name"] is None:
        return None
    bench = descriptions.BenchKeys(
        address=values["LocalAddress"],
        listen_port=values["ListenPort"],
        iso_port=values["IsoPort"],
        dns_answer=values["DnsAnswer"],
        keep_alive=values["KeepAliveTimeInterval"],
        is_unverified=values["verify"] is not None,
    )
    descriptions.check_bench_keys(values.table, written.description)
    return descriptions.make_config_fields(
        written, bench, around.rules, around.certificates, around.dialect.structures
    )


_DESCRIBED_CONNECT: Final = replace(
    _CONNECT,
    help="A connection description, as fields or as the bytes of the DB. Some keys are for the bench alone.",
    keys=(
        _name_key("CONNECT"),
        Key("type", None, "The structure, such as TCON_IP_v4.", reads=_read_description,
            ask=Hint("none: plain TCP",
                     lambda project, block: project.dialect.structures or tuple(CONNECTIONS))),
        Key("bytes", None, "The bytes of the DB in hex, instead of the fields.",
            ask=Hint("hex of the DB in place of the fields", is_quoted=True)),
        Key("LocalAddress", ADDRESS, "The address of the interface with the number InterfaceId.",
            ask=Hint("on the bench, for InterfaceId", first=LOOPBACK),
            writes=lambda c: None if c.any_local else c.local.address),
        Key("ListenPort", PORT, "The port to listen on, instead of LocalPort.",
            ask=Hint("on the bench, 0: a free one"), writes=descriptions.listen_port_of),
        *_field_keys(),
        Key("DnsAnswer", descriptions.DNS_ANSWER, "The address that the name in RemoteQDN stands for.",
            writes=descriptions.dns_answer_of),
        Key("verify", VERIFY, "Switches the check of the partner's certificate off.",
            writes=descriptions.verify_value_of),
        Key("KeepAliveTimeInterval", UINT, "Seconds between probes of a silent partner; 0: as keep_alive.",
            default=0, writes=lambda c: c.keep_alive_interval_s),
        _HISTORY,
    ),
    also=_make_described_fields, head=lambda c: descriptions.bytes_keys(c),
)  # fmt: skip


_DESCRIBED_ADDR: Final = replace(
    _ADDR, help="A TADDR_Param, as fields or as bytes.",
    keys=(
        _name_key("ADDR"),
        Key("type", None, "The structure; default TADDR_Param.",
            reads=lambda values: values.update(structure=descriptions.read_addr_structure(values.table))),
        Key("bytes", None, "The bytes of the DB in hex, instead of the fields."),
        Key("rem_ip_addr", None, "The partner's address; a receiving block writes it.",
            ask=Hint("0.0.0.0: the receiver writes it", first=LOOPBACK)),
        Key("rem_port_nr", None, "The partner's port, or @NAME.",
            ask=Hint("a port, or @NAME", _offer_refs("peer")), refers=_PEER_OR_UDP),
        Key("reserved", None, "The two bytes after rem_port_nr."),
        Key("RemotePort", None, "@NAME for the partner's port, if `bytes` is given.", refers=_PEER_OR_UDP),
    ),
    also=lambda values: values["structure"], head=lambda a: descriptions.addr_keys(a),
)  # fmt: skip


# -- ComBuffers ------------------------------------------------------------------------------------------


def _is_serial(table: Table, around: ReadContext) -> bool | Refusal:
    return table.text("source") == SERIAL or ("a key of serial ports", 'source = "serial" beside it')


def _source_choices(project: Project, block: str) -> tuple[str, ...]:
    rows = [(each.name, block_row(each.block)) for each in project.instances]
    streams = [name for name, row in rows if row.owns_link and row.receives_on_net]
    return (SIMULATED, SERIAL, *streams, *names_of("combuffer", project))


def _line_choices(project: Project, block: str) -> tuple[str, ...]:
    ports = [each.name for each in project.combuffers if each.serial is not None]
    rows = [(each.name, block_row(each.block)) for each in project.instances]
    return ("", *ports, *(name for name, row in rows if row.owns_link and row.sends_on_net))


_COMBUFFER: Final = TableRow(
    "combuffer", "combuffers", ComBufferDecl, "A ComBuffer of TwinCAT, between a line and the blocks.",
    (
        _name_key("ComBuffer"),
        Key("source", TEXT, "Where its bytes come from: sim, serial, a TRCV_C instance or another ComBuffer.",
            "source", SIMULATED, Hint("where bytes come from", _source_choices, SIMULATED),
            NameRef("source", ("stream_in", "combuffer"), words=(SIMULATED, SERIAL))),
        Key("port", PORT_NAME, "Its serial port: a device, socket:// or rfc2217://.", "serial.port",
            ask=Hint("serial: a device, socket://"), only=_is_serial, is_needed=True),
        Key("baud", BAUD, "Bits per second.", "serial.baud", 9600, Hint("serial: 9600"),
            only=_is_serial, is_said=True),
        Key("parity", PARITY, "The parity bit of each byte.", "serial.parity", "none",
            Hint("serial: none", offer_fixed("none", "even", "odd", "mark", "space")), only=_is_serial),
        Key("stop_bits", STOP_BITS, "The number of stop bits of a byte.", "serial.stop_bits", 1.0,
            Hint("serial: 1", offer_fixed("1", "1.5", "2")), only=_is_serial),
        Key("data_bits", DATA_BITS, "The number of data bits of a byte.", "serial.data_bits", 8,
            Hint("serial: 8", offer_fixed("8", "7", "6", "5")), only=_is_serial),
        Key("handshake", HANDSHAKE, "The flow control.", "serial.handshake", "none",
            Hint("serial: none", offer_fixed("none", "rts/cts", "dsr/dtr", "xon/xoff")), only=_is_serial),
        Key("line", TEXT, "What sends its bytes: a ComBuffer with a port, or a TSEND_C.",
            "line", "", Hint("what sends its bytes", _line_choices),
            NameRef('TSEND_C, or of a ComBuffer with source = "serial"', ("port", "stream_out"))),
        Key("size", QUEUE_SIZE, "Its size in bytes; the default depends on source.", "size", 0,
            Hint("its size in bytes: 300"), is_played=True),
        Key("per_cycle", QUEUE_SIZE, "The most bytes that leave it in a scan; default: all.", "per_cycle", 0,
            Hint("bytes a scan, 0: all")),
        _HISTORY,
    ),
    "ComBuffer", "a ComBuffer", "B", shares=("connect", "udp_config", "peer"),
)  # fmt: skip


# -- DATA ------------------------------------------------------------------------------------------------


def _layout_choice_key(name: str, kind: Kind[Any], help_: str, ask: Hint | None = None) -> Key:
    return Key(name, kind, help_, f"choice.{name}", ask=ask, is_played=True)


_LAYOUT_CHOICE_KEYS: Final = (
    _layout_choice_key(
        "layout", LAYOUT, "Its layout; default: the PLC's.",
        Hint("none: the PLC's own", offer_fixed(*LAYOUTS), is_of_change=True),
    ),
    _layout_choice_key(
        "byte_order", BYTE_ORDER, "Its byte order; default: that of the layout.",
        Hint("none: that of the layout", offer_fixed(*BYTE_ORDERS), is_of_change=True),
    ),
    _layout_choice_key("text", TEXT_FORM, "How a STRING is stored."),
    _layout_choice_key("pointer_size", POINTER_SIZE, "The size of a pointer in bytes."),
    _layout_choice_key("string_even", TRUTH, "Whether a STRING begins at an even byte."),
)  # fmt: skip


def _lay_out_data(values: TableValues) -> dict[str, Any] | None:
    """Return type, layout and size of a variable, None if its type is missing or wrong."""
    table, around, text = values.table, values.around, values["type"]
    if text is None:
        return None
    choice = LayoutChoice(*[values[key.name] for key in _LAYOUT_CHOICE_KEYS])
    place = table.location_of("type")
    try:
        type_ = parse_type(text, around.types or NO_TYPES, place)
        layout = _lay_out_type(type_, choice.rules(around.layout), values["name"] or "?", place)
    except UserError as refused:
        if around.types is not None:  # else the file that cannot be read may declare the type
            table.problems.extend(refused.problems)
        return None
    return {"type": type_, "layout": layout, "size": layout.size}


def _lay_out_type(type_: Type, rules: LayoutRules, name: str, place: str) -> Layout:
    try:
        return lay_out(type_, rules, name)
    except UserError as refused:
        raise UserError(
            replace(wrong, where=place + wrong.where[len(name) :]) for wrong in refused.problems
        ) from None


_DATA: Final = TableRow(
    "data", "data", DataDecl, "A global variable for the DATA pin of blocks.",
    (
        _name_key("variable"),
        Key("type", TEXT, "An IEC type, or a UDT of a [[udt]] file.", "type_name",
            ask=Hint("an IEC type or a UDT", lambda project, block: tuple(project.types.names()),
                    "ARRAY[0..99] OF BYTE", is_bare=True), is_needed=True, is_played=True),
        Key("optimized", TRUTH, "Whether the variable is in an optimized data block.", "optimized",
            False, is_played=True, only=lambda table, around: around.rules.area.symbolic_alone),
        *_LAYOUT_CHOICE_KEYS,
    ),
    "DATA variable", "a DATA variable", "rx", also=_lay_out_data, shares=("instance",),
)  # fmt: skip


# -- instances -------------------------------------------------------------------------------------------


def pin_kind(pin: Pin) -> Kind[Any]:
    """Return the values that a pin can have: true and false, or the range of its IEC type."""
    if pin.iec_type == "TIME":
        return MILLISECONDS
    return TRUTH if pin.is_bool else integer(*ELEMENTARY[pin.iec_type].limits)


def link_key(block: str) -> str:
    """Return the key that names the ComBuffer or CONNECT of a block."""
    return block_row(block).buffer_pin or "connect"


def _may_use_config(table: Table, around: ReadContext) -> bool | Refusal:
    row = block_row(table.text("block"))
    if row.datagrams and table.has("connect"):
        return "both a UDP_CONFIG and a CONNECT", "one of them"
    return row.speaks_udp


def _may_link(key: str) -> Callable[[Table, ReadContext], bool]:
    def may_have(table: Table, around: ReadContext) -> bool:
        block = table.text("block") or ""
        if block not in around.block_types and not table.has(key):
            return False  # an unknown block: what it needs is unknown, too
        return _may_use_config(table, around) is not True and link_key(block) == key

    return may_have


def _may_have_addr(table: Table, around: ReadContext) -> bool:
    has_datagrams = any(block_row(block).datagrams for block in around.block_types)
    row = block_row(table.text("block"))  # TSEND and TRCV have the pin ADDR, though it does nothing for TCP
    return (row.sends_stream or row.receives_stream) and has_datagrams


def _link_writer(key: str) -> Callable[[InstanceDecl], str | None]:
    return lambda i: i.connect if key == ("config" if i.on_config else link_key(i.block)) else None


def _buffer_key(pin: str) -> Key:
    return Key(pin, TEXT, "The ComBuffer of a TwinCAT block.", "connect",
               ask=Hint("a ComBuffer", _offer_new_or("combuffer"), propose_part("combuffer"),
                        lambda project, block: block_row(block).buffer_pin == pin),
               refers=NameRef("ComBuffer", ("combuffer",)), writes=_link_writer(pin), is_needed=True,
               only=_may_link(pin))  # fmt: skip


def _asks_for_connect(project: Project, block: str) -> bool:
    row = block_row(block)
    return not row.has_com_buffer and (bool(row.datagrams) or not row.speaks_udp)


def _connect_choices(project: Project, block: str) -> tuple[str, ...]:
    own = () if block_row(block).speaks_udp else (NEW,)  # a new CONNECT is TCP; UDP needs a description
    return (*own, *names_of("connect", project))


def _pointer_key(pin: str) -> Key:
    mark = pin.removeprefix("p").lower()
    return Key(pin, TEXT, f"The variable with the {mark}; default: none, the pointer is 0.", default="",
               ask=Hint(f"{mark}, none: 0", _offer_names("data", before=("",)),
                        where=lambda project, block: pin in block_row(block).pointers),
               refers=NameRef("DATA", ("data",)),
               writes=lambda i: dict(zip(block_row(i.block).pointers, i.pointers, strict=False)).get(pin),
               only=lambda table, around: pin in block_row(table.text("block")).pointers)  # fmt: skip


def _inputs_hint(project: Project, block: str) -> str:
    if not block_row(block).has_com_buffer:
        return "such as CONT=1 EN_R=1"
    names = [pin.name for pin in project.pins(block) if pin.direction is not Direction.OUT]
    shown = [name for name in ("SizeReceiveData", "Length", "SendByte", "Timeout", "EN") if name in names]
    return f"such as {shown[0]}=1" if shown else "none"


def _read_inputs(values: TableValues) -> None:
    table, around, block = values.table, values.around, values["block"]
    for lacking in around.rules.lacks:
        if table.has(lacking):
            expected = f"another one: blocks of {around.dialect.name} have no pin of that name"
            table.report(lacking, "a pin", expected)
    data, row = values.get("data"), block_row(block)
    if data is not None and block in around.block_types and not row.data_pin:
        table.report("data", quote(data), f"no DATA: {block} has no such pin")
    if block is not None and block not in around.block_types:
        table.report_unknown_name("block", block, around.block_types, "block")
    # Without a known block its pins are unknown; the other keys are checked all the same.
    pins = tuple(map(around.rules.with_iec_type, row.pins)) if block in around.block_types else ()
    inputs = [pin for pin in pins if pin.direction is not Direction.OUT]
    outputs = [pin.name for pin in pins if pin.direction is Direction.OUT]
    for key in table.unread_keys():
        if key in outputs:
            table.mark_known(key)
            table.report(key, "an output", "an input: " + ", ".join(pin.name for pin in inputs))
    found = [(pin.name, table.read(pin.name, pin_kind(pin))) for pin in inputs]
    table.report_unread_keys("key or input pin")
    values["inputs"] = tuple((name, value) for name, value in found if value is not None)


def _make_instance_fields(values: TableValues) -> dict[str, Any] | None:
    if values["block"] not in values.around.block_types:
        return None
    pointers = block_row(values["block"]).pointers
    return {
        "inputs": values["inputs"],
        "on_config": values.get("config") is not None,
        "pointers": tuple([values[pin] for pin in pointers]),
        "task": values["task"] or values.around.first_task,
    }


_INSTANCE_ADDR_KEY: Final = Key(
    "addr", TEXT, "The ADDR of a UDP block.", "addr", refers=NameRef("ADDR", ("addr",)),
    only=_may_have_addr,
)  # fmt: skip
_INSTANCE: Final = TableRow(
    "instance", "instances", InstanceDecl,
    "A block instance. Any key besides these is an input pin of its block.",
    (
        _name_key("instance"),
        Key("block", TEXT, "The type of the block, such as TRCV_C.", "block", is_needed=True,
            ask=Hint("a block", lambda project, block: project.dialect.blocks, lambda project, block: block)),
        Key("connect", TEXT, "The CONNECT that the instance uses.", "connect", is_needed=True,
            ask=Hint("of a UDP description", _connect_choices, propose_part("connect"), _asks_for_connect),
            refers=NameRef("CONNECT", ("connect",)), writes=_link_writer("connect"),
            only=_may_link("connect")),
        Key("config", TEXT, "The UDP_CONFIG of a UDP block.", "connect", is_needed=True, only=_may_use_config,
            ask=Hint("of a UDP block", _offer_new_or("udp_config"), propose_part("udp_config"),
                    lambda project, block: block_row(block).speaks_udp),
            refers=NameRef("UDP_CONFIG", ("udp_config",)), writes=_link_writer("config")),
        *map(_buffer_key, com_buffer_pins()),
        replace(_INSTANCE_ADDR_KEY, is_needed=True,
                only=lambda table, around: block_row(table.text("block")).speaks_udp),
        replace(_INSTANCE_ADDR_KEY, writes=lambda i: None, ask=Hint(
            "of a UDP block", _offer_new_or("addr"), propose_part("addr"), lambda project, block:
            block_row(block).speaks_udp or (block_row(block).owns_link and bool(project.addrs)))),
        Key("data", TEXT, "The variable at its DATA pin; without this key the pin is open.", "data",
            ask=Hint("a DATA variable", _offer_new_or("data"), propose_part("data"),
                    lambda project, block: bool(block_row(block).data_pin)),
            refers=NameRef("DATA", ("data",))),
        *map(_pointer_key, affix_pin_names()),
        Key("task", TEXT, "The task that calls it; default: the first one.", is_said=True,
            ask=Hint("a task", lambda project, block: tuple([task.name for task in project.tasks]),
                    lambda project, block: project.tasks[0].name),
            refers=NameRef("task", ("task",)), writes=lambda i: i.task),
        Key("inputs", None, "Initial values of input pins, by the pin's name.",
            ask=Hint(_inputs_hint, is_bare=True)),
    ),
    "instance", "an instance", also=_make_instance_fields, finish=_read_inputs, shares=("data",),
    tail=lambda i: [(pin, MILLISECONDS.write(v) if is_time_pin(pin) else v) for pin, v in i.inputs],
)  # fmt: skip


# -- peers and what they say -----------------------------------------------------------------------------

_OFFER_ENDS: Final = _offer_refs("connect", "udp_config")
_NO_CONNECTION: Final = "a key of TCP peers", "only local and remote: UDP has no connection"


def _is_tcp(table: Table, around: ReadContext) -> bool:
    return not table.is_true("udp")


def _is_active(table: Table) -> bool:
    """Return whether a peer connects. Without the key `active`, a peer connects if it has `remote`."""
    return table.is_true("active", table.has("remote"))


def _may_have_remote(table: Table, around: ReadContext) -> bool | Refusal:
    if table.is_true("udp"):
        return False
    return _is_active(table) or ("an address to connect to", "active = true, or local instead of remote")


def _is_active_tcp(table: Table, around: ReadContext) -> bool:
    return not table.is_true("udp") and _is_active(table)


def _allowed_with(key: str, found: str) -> Callable[[Table, ReadContext], bool | Refusal]:
    def is_allowed(table: Table, around: ReadContext) -> bool | Refusal:
        return not table.is_true("udp") and (table.is_true(key) or (found, f"{key} = true beside it"))

    return is_allowed


_ISO, _TLS = _allowed_with("iso", "a key of ISO-on-TCP"), _allowed_with("tls", "a key of TLS")


def _iso_writer(name: str) -> Callable[[PeerDecl], Any]:
    return lambda p: getattr(p.session, name) if isinstance(p.session, IsoSettings) else None


def _tls_writer(name: str) -> Callable[[PeerDecl], Any]:
    return lambda p: dict(p.tls).get(name)


def _describes_connects(project: Project, block: str) -> bool:
    """Return whether the PLC can speak more than plain TCP, so that a peer can speak more, too."""
    return project.dialect.describes_connects


def _make_peer_fields(values: TableValues) -> dict[str, Any]:
    table = values.table
    if table.is_true("udp"):
        return {"active": False}
    iso: IsoSettings | None = None
    if values["iso"]:
        size = values["tpdu"]
        iso = IsoSettings(values["local_tsap"], values["remote_tsap"], LONGEST_MESSAGE, size_code=size)
    tls, keys = tls_of_peer(values, table, values.around.certificates) if values["tls"] else (None, ())
    if iso is not None and tls is not None:
        table.report("tls", "true beside iso = true", "one of them")
    return {"active": _is_active(table), "session": iso or tls, "tls": keys}


_PEER: Final = TableRow(
    "peer", "peers", PeerDecl, "A partner that the bench plays, and what it does by itself.",
    (
        _name_key("peer"),
        Key("udp", TRUTH, "Whether it sends and receives datagrams.", "udp", False,
            _truth_hint("true: datagrams, no active")),
        Key("active", TRUTH, "Whether it connects; default: true if it has a remote.", is_said=True,
            only=lambda table, around: _NO_CONNECTION if table.is_true("udp") else True,
            ask=Hint("true: it connects to remote", offer_fixed(*BOOLS[::-1]),
                    lambda project, block: "true" if project.links() else "false"),
            writes=lambda p: None if p.udp else p.active),
        Key("remote", END_OR_NAME, "The end to connect to; @C1: where C1 listens.", "end", is_needed=True,
            ask=Hint("address:port, or @NAME", _OFFER_ENDS, _propose_last(_OFFER_ENDS)),
            refers=NameRef("CONNECT", ("connect",), by_at=True), only=_may_have_remote,
            writes=lambda p: p.end if p.active else None),
        Key("local", ENDPOINT, "The end from which it connects.", "source",
            ask=Hint("where it listens, 127.0.0.1:0"), only=_is_active_tcp),
        Key("local", ENDPOINT, "The end at which it listens, also for UDP.", "end", FREE_PORT,
            only=lambda table, around: not _is_active_tcp(table, around),
            writes=lambda p: None if p.active else p.end),
        Key("remote", UDP_END_OR_NAME, "UDP: the end to which it sends; default: the last sender.", "remote",
            refers=NameRef("UDP_CONFIG", ("udp_end",), by_at=True),
            only=lambda table, around: table.is_true("udp")),
        Key("reconnect", DELAY, "How long after a close it reconnects; default: never.", "reconnect_ns", 0,
            Hint("this long after a close: T#1s"),
            only=lambda table, around: _NO_CONNECTION if table.is_true("udp") else _is_active(table)),
        Key("says", MESSAGE_LIST, "Messages to send in turn, written as in `peer P1 send`.", "says", (),
            Hint("a message, such as hex 01 02", is_quoted=True)),
        Key("every", INTERVAL, "The time between two messages.", "every_ns", DEFAULT_EVERY_NS, Hint("T#1s")),
        Key("replies", RULE_LIST, "Rules by which it answers, as in `peer P1 reply on`.", "replies", ()),
        *[replace(key, ask=None) for key in _LAYOUT_CHOICE_KEYS],
        Key("iso", TRUTH, "Whether it speaks ISO-on-TCP.", default=False, only=_is_tcp,
            ask=_truth_hint("true: it speaks ISO-on-TCP", where=_describes_connects),
            writes=lambda p: isinstance(p.session, IsoSettings)),
        Key("local_tsap", TSAP, "Its TSAP.", default=b"", only=_ISO, writes=_iso_writer("local"),
            ask=Hint("its own: 16#E001, E0.01 or TCP-1", where=_describes_connects, is_quoted=True)),
        Key("remote_tsap", TSAP, "The TSAP of the PLC.", default=b"", only=_ISO, writes=_iso_writer("remote"),
            ask=Hint("that of the PLC", where=_describes_connects, is_quoted=True)),
        Key("tpdu", TPDU, "The TPDU size that it proposes.", default=OWN_SIZE_CODE, only=_ISO,
            writes=_iso_writer("size_code")),
        Key("tls", TRUTH, "Whether it speaks TLS.", default=False, only=_is_tcp, writes=_tls_writer("tls"),
            ask=_truth_hint("true: it speaks TLS", where=_describes_connects)),
        Key("certificate", CERTIFICATE_NUMBER, "The number of its certificate; that needs a key.", only=_TLS,
            ask=Hint("number of its own, with a key", _offer_certs(with_key=True), where=_describes_connects),
            writes=_tls_writer("certificate")),
        Key("authority", CERTIFICATE_NUMBER, "The number of the certificate that it trusts.", only=_TLS,
            ask=Hint("number of the one to trust", _offer_certs(), where=_describes_connects),
            writes=_tls_writer("authority")),
        Key("client_certificate", TRUTH, "Whether it asks the client for a certificate.", default=False,
            only=_TLS, writes=_tls_writer("client_certificate")),
        Key("server_name", HOST, "The name that the partner's certificate must have.", only=_TLS,
            writes=_tls_writer("server_name")),
        Key("verify", VERIFY, "Switches the check of the partner's certificate off.", only=_TLS,
            writes=_tls_writer("verify")),
    ),
    "peer", "a peer", "P", also=_make_peer_fields, asks_first=("active", "remote", "local"),
    shares=("connect", "udp_config", "combuffer"),
)  # fmt: skip

_MESSAGE: Final = TableRow(
    "message", "messages", MessageDecl, "A message of the library: `peer P1 send message NAME`.",
    (
        _name_key("message"),
        Key("text", TEXT, "What is sent, written as in `peer P1 send`.", "text", is_needed=True,
            ask=Hint("as after `send`: hex 01 02 split=1", is_bare=True)),
        Key("peer", TEXT, "The only peer that may send it; default: any peer may.", "peer", "",
            Hint("one peer; none: all", _offer_names("peer")), NameRef("peer", ("peer",), or_none=True)),
    ),
    "message", "a message of the library", "message", asks_first=("peer",),
)  # fmt: skip

_SEQUENCE: Final = TableRow(
    "sequence", "sequences", SequenceDecl,
    "Messages that follow one another over one connection: `peer P1 play NAME`.",
    (
        _name_key("sequence"),
        Key("steps", STEP_LIST, "Names of messages, and pauses such as T#100ms between them.", "steps",
            ask=Hint("message names and pauses: hello T#100ms bye", is_bare=True), is_needed=True),
    ),
    "sequence", "a sequence of messages", "sequence",
)  # fmt: skip


# -- lines of others -------------------------------------------------------------------------------------

_WATCH: Final = TableRow(
    "watch", "watches", WatchDecl,
    "A line to watch: the instances of a CONNECT or UDP_CONFIG receive its traffic as shadows.",
    (
        _name_key("line"),
        Key("plc", FAR_END, "The end of the PLC: 10.0.0.5:2000; if the PLC connects, 10.0.0.5.", "plc",
            ask=Hint("the PLC end: 10.0.0.5:2000"), is_needed=True),
        Key("connect", TEXT, "The CONNECT or UDP_CONFIG whose instances are the shadows.", "connect",
            ask=Hint("a CONNECT", _offer_names("connect"), _propose_last(_offer_names("connect"))),
            refers=NameRef("CONNECT or UDP_CONFIG", ("connect", "udp_config")), is_needed=True),
        Key("partner", FAR_END, "The end of the partner; default: any.", "partner", "",
            Hint("the other end; none: any")),
    ),
    "watched line", "a line that is watched", "watch",
)  # fmt: skip


_OBSERVED_NAMES: Final = NameRef("CONNECT, UDP_CONFIG or ComBuffer", ("connect", "udp_config", "combuffer"))
_TAP: Final = TableRow(
    "tap", "taps", TapDecl,
    "A tap (`trcvtui tap`): forwards bytes between two ends. Instances of a CONNECT are its shadows.",
    (
        _name_key("tap"),
        Key("listen", TAP_PLACE, "Where it listens: 2000, 0.0.0.0:2000, udp:2000 or serial:/dev/ttyS0.",
            "listen", ask=Hint("where it listens: 2000"), is_needed=True),
        Key("to", TAP_PLACE, "Where it forwards to: the end of the PLC, such as 10.0.0.5:2000.", "to",
            ask=Hint("the PLC end: 10.0.0.5:2000"), is_needed=True),
        Key("connect", TEXT, "The CONNECT whose instances receive the bytes to the PLC.", "connect",
            ask=Hint("a CONNECT", _offer_names("connect"), _propose_last(_offer_names("connect"))),
            refers=_OBSERVED_NAMES, is_needed=True),
        Key("back", TEXT, "The CONNECT whose instances receive the bytes from the PLC.", "back", "",
            Hint("CONNECT for bytes from the PLC, or none", _offer_names("connect")),
            refers=_OBSERVED_NAMES._replace(or_none=True)),
    ),
    "tap", "a tap", "tap",
)  # fmt: skip


# -- the rest --------------------------------------------------------------------------------------------

_TASK: Final = TableRow(
    "task", "tasks", Task, "A task calls its instances. Default: one task MAIN, every 10 ms.",
    (
        _name_key("task"),
        Key("interval", INTERVAL, "The time from one call to the next.", "interval_ns", DEFAULT_INTERVAL_NS,
            is_played=True),
        Key("priority", PRIORITY, "The smallest number runs first.", "priority", 1, is_played=True),
    ),
    "task",
)  # fmt: skip


def _finish_certificate(values: TableValues) -> None:
    values.table.mark_known("name")  # it has a number instead
    values.table.report_unread_keys()


_CERTIFICATE: Final = TableRow(
    "certificate", "certificates", make_certificate,
    "A certificate of the CPU's certificate manager. A certificate without a key is a trusted authority.",
    (
        Key("number", CERTIFICATE_NUMBER, "The number that other keys refer to.", "number", is_needed=True),
        Key("file", FILE, "Its PEM file.", "file", ask=Hint("a PEM file"), is_needed=True),
        Key("key", TEXT, "The PEM file of its key.", "key", "", Hint("of your own: its PEM file")),
    ),
    "certificate", "a certificate of TLS", called="number",
    also=lambda values: {"table": values.table, "base": values.around.base}, finish=_finish_certificate,
)  # fmt: skip

SIM_ROW: Final = TableRow(
    "sim", "sim", SimDecl, "The simulated network.",
    (
        Key("addresses", ADDRESSES, "Addresses of the PLC, in addition to loopback.", "addresses", ()),
        Key("not_ethernet", ADDRESSES, "Those of `addresses` not on an Ethernet port.", "not_ethernet", ()),
        Key("seed", SEED, "The seed for random faults and random pieces.", "seed", 0),
        Key("latency", DELAY, "The time that bytes travel from end to end.", "latency_ns", 0),
        Key("fragment", TRUTH, "Whether bytes arrive in random pieces.", "fragment", False),
        Key("names", HOST_NAMES, "Names that the DNS server knows; default: no DNS server.", "names"),
    ),
)  # fmt: skip
TOP_ROW: Final = TableRow(
    "", "", dict, "Keys before the first table.",
    (
        Key("dialect", None, "The dialect: the kind of the PLC."),
        Key("model", None, "The model of the PLC; it limits the number of connections."),
        Key("start", TEXT, "Bench commands that run before scan 1.", "start", ""),
        Key("program", TEXT, "Bench commands that run as the PLC's program while scans pass.", "program", ""),
    ),
)  # fmt: skip


def _udt_content(values: TableValues) -> dict[str, Any] | None:
    """Return the content of a UDT file, None if it cannot be read."""
    found: dict[str, Any] | None = None
    if values["file"] is not None:
        with collect_problems(values.table.problems):
            found = {"content": content_of(values.around.base / values["file"])}
    return found


UDT: Final = TableRow(
    "udt", "udts", UdtFile, "A file with UDTs.",
    (Key("file", FILE, "The file, by its path from the project's folder.", "name", is_needed=True),),
    "UDT file", "a UDT file", called="file", also=_udt_content,
)  # fmt: skip

# In the order in which a file's kinds are listed in messages.
TABLES: Final[dict[str, TableRow]] = {
    row.kind: row
    for row in (
        _TASK, UDT, _DATA, _CONNECT, _UDP_CONFIG, _ADDR, _INSTANCE, _PEER, _MESSAGE, _SEQUENCE, _CERTIFICATE,
        _COMBUFFER, _WATCH, _TAP,
    )
}  # fmt: skip
DESCRIBED_TABLES: Final[dict[str, TableRow]] = {"connect": _DESCRIBED_CONNECT, "addr": _DESCRIBED_ADDR}
# The kinds that can be added, in the order of messages; OFFERED_KINDS: the most usual ones first, for forms.
EDITED: Final = (
    "udt", "connect", "udp_config", "addr", "data", "instance", "peer", "message", "sequence", "combuffer",
    "certificate", "watch", "tap",
)  # fmt: skip
OFFERED_KINDS: Final = (
    "instance", "connect", "data", "udt", "peer", "message", "sequence", "udp_config", "addr", "certificate",
    "combuffer", "watch", "tap",
)  # fmt: skip


def table_row(kind: str, dialect: Dialect) -> TableRow:
    """Return the row of a kind in a dialect. A dialect with connection descriptions has its own rows."""
    return (DESCRIBED_TABLES if dialect.describes_connects else {}).get(kind, TABLES[kind])


def read_table(kind: str, table: Table, around: ReadContext, number: int = 1) -> Any:
    """Return the declaration of a table; a plain ADDR is allowed in any dialect."""
    row = table_row(kind, around.dialect)
    plain = kind == "addr" and not descriptions.has_structure_keys(table)
    return (TABLES[kind] if plain else row).read(table, around, number)


def is_replayable(path: Sequence[str]) -> bool:
    """Return whether a replay with another value at this path gives a true answer (`Key.is_played`).

    An instance's key without a row is an input pin. Unknown names are reported when the file is read.
    """
    kind, key = path[0], path[-1]
    if kind not in TABLES:
        return kind not in {SIM_ROW.kind, *(row.name for row in TOP_ROW.keys)}
    rows = [row for row in TABLES[kind].keys if row.name == key]
    return rows[0].is_played if rows else kind == _INSTANCE.kind


def array_keys() -> frozenset[str]:
    """Return the keys whose value is a list of texts."""
    rows = [row for table in TABLES.values() for row in table.keys]
    return frozenset(row.name for row in rows if row.kind is not None and row.kind.write is list)


# -- a declaration back to its keys ----------------------------------------------------------------------


def kind_name(decl: Declaration) -> str:
    """Return the kind of table that a declaration belongs to, such as `connect` or `data`."""
    if isinstance(decl, CertificateDecl):
        return _CERTIFICATE.kind
    return next(
        row.kind for row in TABLES.values() if isinstance(row.makes, type) and isinstance(decl, row.makes)
    )


def keys_of(decl: Declaration) -> KeyPairs:
    """Return the keys of a declaration except the name, with their TOML values."""
    kind = kind_name(decl)
    is_described = getattr(decl, "description", None) is not None
    return (DESCRIBED_TABLES if is_described else TABLES)[kind].toml_keys(decl)


def forms_of(decl: Declaration) -> list[KeyPairs]:
    """Return all forms in which a declaration's keys can be written, the easiest to change first."""
    if isinstance(decl, ConnectConfig) and decl.description is not None:
        bench = replace(_DESCRIBED_CONNECT, head=lambda c: descriptions.field_keys(c))
        return [descriptions.plain_keys(decl), bench.toml_keys(decl), keys_of(decl)]
    return [keys_of(decl)]


def entry_of(decl: Declaration) -> KeyPairs:
    """Return all keys of a declaration. The name comes first; for a certificate, the number."""
    called: KeyValue = decl.number if isinstance(decl, CertificateDecl) else decl.name
    return [(TABLES[kind_name(decl)].called, called), *keys_of(decl)]
