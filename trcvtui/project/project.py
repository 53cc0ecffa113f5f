"""A project as frozen values: the content of a project file, checked and typed.

Rule: any value that fits a pin or a TCP_CONNECTCONFIG is accepted here; the block judges it by STATUS.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from msgspec import Struct, field
from msgspec.structs import replace

from trcvtui.blocks.pins import Pin, PinValue
from trcvtui.blocks.rules import VendorRules
from trcvtui.blocks.table import block_row
from trcvtui.dialects.dialect import Dialect, SwitchValue
from trcvtui.net.connection.config import AddrParam, ConnectConfig, UdpConfig
from trcvtui.net.connection.description_check import read_spec
from trcvtui.net.layer import LayerSettings
from trcvtui.net.received_ring import DEFAULT_HISTORY
from trcvtui.net.results import Endpoint
from trcvtui.net.serial_line import SerialSettings
from trcvtui.udt.layout.layout import Layout
from trcvtui.udt.layout.rules import NO_CHOICE, LayoutChoice, LayoutRules
from trcvtui.udt.type_set import TypeSet
from trcvtui.udt.types import Type

DEFAULT_INTERVAL_NS: Final = 10_000_000
SIMULATED: Final = "sim"  # the source of a ComBuffer that bench commands feed
SERIAL: Final = "serial"  # a real port
DEFAULT_EVERY_NS: Final = 1_000_000_000


class Task(Struct, frozen=True):
    """One task. Its instances are called every `interval_ns`. The smallest `priority` runs first."""

    name: str = "MAIN"
    interval_ns: int = DEFAULT_INTERVAL_NS
    priority: int = 1


class DataDecl(Struct, frozen=True, eq=False):
    """One global variable, with its type as written and as laid out, and its size in bytes.

    With `optimized`, the variable is in a data block that the PLC arranges. Instructions then take the
    variable as a whole. `choice` is the layout chosen for this variable. For a field that is None, the
    PLC's layout counts.
    """

    name: str
    type_name: str
    type: Type
    layout: Layout
    size: int
    optimized: bool = False
    choice: LayoutChoice = NO_CHOICE


class InstanceDecl(Struct, frozen=True):
    """One block instance. If `data` is None, the DATA pin is open. `inputs` are initial values by pin name.

    If `on_config`, `connect` names a UDP_CONFIG. For a block on a ComBuffer, `connect` names the ComBuffer.
    `addr` is the target or source of datagrams. `pointers` are variables of prefix and suffix; "" is
    pointer 0.
    """

    name: str
    block: str
    connect: str
    data: str | None
    task: str
    inputs: tuple[tuple[str, PinValue], ...]
    addr: str | None = None
    on_config: bool = False
    pointers: tuple[str, ...] = ()


class ComBufferDecl(Struct, frozen=True):
    """One ComBuffer. `source` is `sim`, `serial`, a TRCV_C instance, or another ComBuffer, as over a cable.

    `serial` is the port of the source `serial`; in a simulated network, bench commands feed the ComBuffer.
    `line` sends its written bytes: a ComBuffer with a port, or a TSEND_C instance. `size` is in bytes; if
    it is 0, the source sets the size. At most `per_cycle` written bytes are sent in a scan; 0 means all. If
    `is_written`, a send block fills it; if `is_fed`, a TRCV_C. `history` bytes are kept.
    """

    name: str
    source: str = SIMULATED
    size: int = 0
    per_cycle: int = 0
    is_written: bool = False
    is_fed: bool = False
    serial: SerialSettings | None = None
    line: str = ""
    history: int = DEFAULT_HISTORY


class PeerDecl(Struct, frozen=True):
    """One partner. An active peer connects to `end`, a passive one listens there.

    `end` may be `@C1`, where the CONNECT C1 listens. `source` is the local end of an active peer, if the
    file gives one. The peer connects again `reconnect_ns` after a close (0: never). The peer sends the
    messages `says` in turn, one every `every_ns`, each written as after `peer P1 send`. `replies` are
    rules, written as after `peer P1 reply on`. A `udp` peer receives at `end` and sends to `remote`, or to
    the last sender if None. `choice` is the layout of the device that the peer plays; a field None is as in
    the PLC. `session` is ISO-on-TCP or TLS.
    """

    name: str
    active: bool
    end: Endpoint | str
    source: Endpoint | None = None
    reconnect_ns: int = 0
    says: tuple[str, ...] = ()
    every_ns: int = DEFAULT_EVERY_NS
    udp: bool = False
    remote: Endpoint | str | None = None
    replies: tuple[str, ...] = ()
    choice: LayoutChoice = NO_CHOICE
    session: LayerSettings | None = None
    tls: tuple[tuple[str, bool | int | str], ...] = ()  # the TLS keys of its table, certificates by number


class MessageDecl(Struct, frozen=True):
    """A named message, written as after `peer P1 send`. If `peer` is set, only that peer may send it."""

    name: str
    text: str
    peer: str = ""


class SequenceDecl(Struct, frozen=True):
    """Messages over one connection: names of messages, and pauses such as T#100ms between them."""

    name: str
    steps: tuple[str, ...]


class WatchDecl(Struct, frozen=True):
    """One watched line. Instances on `connect` are shadows that receive what comes to the PLC end `plc`.

    Ends are ADDR or ADDR:PORT. Empty `partner`: any partner. `back` may be a CONNECT for bytes from `plc`.
    """

    name: str
    plc: str
    connect: str
    partner: str = ""
    back: str = ""


class TapDecl(Struct, frozen=True):
    """One tap, with places as for `trcvtui tap`. Instances on a CONNECT are shadows of one direction."""

    name: str
    listen: str
    to: str
    connect: str
    back: str = ""


class SimDecl(Struct, frozen=True):
    """The simulated network: the PLC's addresses besides loopback, and which of them are no Ethernet ports.

    `names` has the names that the DNS server knows, with addresses. None means no DNS server.
    """

    addresses: tuple[str, ...] = ()
    not_ethernet: tuple[str, ...] = ()
    seed: int = 0
    latency_ns: int = 0
    fragment: bool = False
    names: tuple[tuple[str, str], ...] | None = None


class CertificateDecl(Struct, frozen=True):
    """One PEM certificate of the CPU's certificate manager. A certificate without a key is only trusted."""

    number: int
    file: str
    key: str = ""

    @property
    def name(self) -> str:
        return str(self.number)


Certificates = Mapping[int, CertificateDecl]


class UdtFile(Struct, frozen=True):
    """One file of UDTs as it was read. `name` is the file's path from the project's folder."""

    name: str
    content: bytes


Declaration = (
    ConnectConfig
    | UdpConfig
    | AddrParam
    | ComBufferDecl
    | DataDecl
    | InstanceDecl
    | PeerDecl
    | MessageDecl
    | SequenceDecl
    | CertificateDecl
    | WatchDecl
    | TapDecl
    | UdtFile
)


class Edit(Struct, frozen=True, eq=False):
    """One entry before and after an edit (None: no entry). `place` is the entry's index among its kind."""

    kind: str
    before: Declaration | None
    after: Declaration | None
    place: int

    @property
    def inverse(self) -> Edit:
        return Edit(self.kind, self.after, self.before, self.place)

    @property
    def name(self) -> str:
        decl = self.before or self.after
        return decl.name if decl else ""


Edits = tuple[Edit, ...]


class Project(Struct, frozen=True, eq=False):
    """Everything that a project file says. Instances are in call order."""

    path: Path
    base: Path  # relative file names start here
    dialect: Dialect
    model: str
    connection_limit: int
    options: Mapping[str, SwitchValue]
    rules: VendorRules
    layout: LayoutRules
    types: TypeSet
    tasks: tuple[Task, ...] = (Task(),)
    data: tuple[DataDecl, ...] = ()
    connects: tuple[ConnectConfig, ...] = ()
    instances: tuple[InstanceDecl, ...] = ()
    peers: tuple[PeerDecl, ...] = ()
    start: str = ""
    program: str = ""  # what the PLC's program writes by itself, scan by scan
    sim: SimDecl = SimDecl()
    udp_configs: tuple[UdpConfig, ...] = ()
    addrs: tuple[AddrParam, ...] = ()
    messages: tuple[MessageDecl, ...] = ()
    sequences: tuple[SequenceDecl, ...] = ()
    constants: Mapping[str, int] = field(default_factory=dict)  # of the UDTs; the user's own
    udts: tuple[UdtFile, ...] = ()
    certificates: Certificates = field(default_factory=dict)
    combuffers: tuple[ComBufferDecl, ...] = ()
    watches: tuple[WatchDecl, ...] = ()
    taps: tuple[TapDecl, ...] = ()
    black_box: bool = True  # whether a run on the screen keeps its newest for a recording
    undoable: tuple[Edits, ...] = ()  # the newest steps since it was read, each with all of its edits

    @property
    def udt_files(self) -> tuple[Path, ...]:
        return tuple([self.base / each.name for each in self.udts])

    def pins(self, block: str) -> tuple[Pin, ...]:
        """Return the pins of a block in the order of the manual."""
        labels = self.rules.labels.get(block, {})
        done = labels.get("DONE", "DONE")
        return tuple(
            [
                replace(pin, label=labels.get(pin.name, pin.label), text=pin.text.replace("DONE", done))
                for pin in map(self.rules.with_iec_type, block_row(block).pins)
                if pin.name not in self.rules.lacks
            ]
        )

    def adhoc_inputs(self, block: str) -> dict[str, PinValue]:
        """Return the inputs with which a block receives ad hoc, none if it cannot."""
        if any(pin.name == "ADHOC" for pin in self.pins(block)):
            return {"ADHOC": True}
        lens = self.rules.area.adhoc_lens if block_row(block).receives_stream else ()
        return {"LEN": max(lens)} if lens else {}

    def instance(self, name: str) -> InstanceDecl | None:
        return next((i for i in self.instances if i.name == name), None)

    def data_decl(self, name: str) -> DataDecl | None:
        return next((d for d in self.data if d.name == name), None)

    def received_data(self, instance: str) -> DataDecl | None:
        """Return the DATA that an instance receives into, or None if it only sends or has no DATA."""
        decl = self.instance(instance)
        row = block_row(decl.block) if decl is not None else None
        if decl is None or row is None or not (row.receives_on_net or row.reads_rx_buffer):
            return None
        return self.data_decl(decl.data or "")

    def connect(self, name: str) -> ConnectConfig | None:
        return next((c for c in self.connects if c.name == name), None)

    def connection_id(self, block: str, connect: str) -> int | None:
        """Return the value of the pin ID, or None if the block has no ID or the CONNECT no description."""
        config = self.connect(connect)
        if not block_row(block).has_id or config is None or config.description is None:
            return None
        return read_spec(config.description).identity

    def udp_config(self, name: str) -> UdpConfig | None:
        return next((u for u in self.udp_configs if u.name == name), None)

    def combuffer(self, name: str) -> ComBufferDecl | None:
        return next((b for b in self.combuffers if b.name == name), None)

    def links(self) -> tuple[str, ...]:
        """Return the names that `link` and `fault on` take: CONNECTs and UDP_CONFIGs."""
        return tuple([c.name for c in self.connects] + [u.name for u in self.udp_configs])

    def peer(self, name: str) -> PeerDecl | None:
        return next((p for p in self.peers if p.name == name), None)

    def with_peer_layout(self, peer: str) -> Project:
        decl = self.peer(peer)
        if decl is None or decl.choice == NO_CHOICE:
            return self
        as_peer = tuple([replace(data, choice=NO_CHOICE) for data in self.data])
        return replace(self, layout=decl.choice.rules(self.layout), data=as_peer)

    def layout_rules_of(self, type_name: str) -> LayoutRules:
        """Return the layout for messages of a UDT: that which all its DATA share, else the PLC's."""
        choices = {d.choice for d in self.data if d.type_name.casefold() == type_name.casefold()}
        return choices.pop().rules(self.layout) if len(choices) == 1 else self.layout

    def task(self, name: str) -> Task | None:
        return next((t for t in self.tasks if t.name == name), None)
