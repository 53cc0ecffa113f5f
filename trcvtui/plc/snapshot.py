"""The frozen state after a scan; other modules never get the objects themselves."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import Struct, field

from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.framing import FrameSummary, FrameTally, Framing
from trcvtui.blocks.outcome import Cause
from trcvtui.blocks.pins import PinValue
from trcvtui.blocks.serial.com_buffer import BufferBinding
from trcvtui.blocks.serial.receiving import MILLISECOND_NS, FrameReceiveJob, string_bytes
from trcvtui.blocks.table import block_row as block_row
from trcvtui.blocks.table import com_buffer_pins as com_buffer_pins
from trcvtui.blocks.table import is_time_pin as is_time_pin
from trcvtui.net.connection.connection import Connection, State
from trcvtui.net.connection.udp import UdpEndpoint
from trcvtui.net.results import Fault
from trcvtui.plc.ledger import Outputs


class ConnectionSnapshot(Struct, frozen=True):
    """One CONNECT. `state` is closed, queued, created, establishing or connected. Times in ns of the run.

    If `udp`, this is a CONNECT of UDP or a UDP_CONFIG. For a UDP_CONFIG, the state `created` means ready.
    """

    name: str
    active: bool
    state: str
    local: str
    remote: str
    incarnation: int
    bytes_received: int
    attempts: int
    retry_in_ns: int | None
    bytes_sent: int = 0
    unacknowledged: int | None = None  # bytes of ours that the partner's stack has not acknowledged
    receivers: tuple[str, ...] = ()
    senders: tuple[str, ...] = ()
    udp: bool = False
    keep_alive_s: int = 0  # the interval in force; 0: none (UDP)


class SentCount(Struct, frozen=True):
    """What a CONNECT's present connection has sent. `unacknowledged` None: the system gives no number."""

    local: str
    remote: str
    accepted: int
    unacknowledged: int | None


class FramerSnapshot(Struct, frozen=True):
    """Prefix and suffix as a receiving block would use them now. None means that the pointer is 0.

    `noise` has the last bytes of those `discarded` before a prefix. `last` describes the newest frame.
    """

    prefix: bytes | None
    suffix: bytes | None
    size: int
    timeout_ns: int
    is_text: bool
    discarded: int
    noise: bytes
    tally: FrameTally
    last: FrameSummary | None

    @property
    def last_ending_text(self) -> str:
        """Return in words what ended the newest frame."""
        framing = Framing(self.size, suffix=self.suffix or b"")
        return framing.ended_by(self.last.ending) if self.last is not None else ""


class InstanceSnapshot(Struct, frozen=True):
    """One instance. Its job has `have` of `need` bytes; if `need` is 0, no job runs. Sizes in bytes."""

    name: str
    block: str
    connect: str
    data: str | None
    inputs: tuple[tuple[str, PinValue], ...]
    outputs: Outputs
    condition: str
    cause: Cause
    since_scan: int
    have: int
    need: int
    adhoc: bool
    last_receive_ns: int | None
    jobs_done: int
    errors: int
    last_done_scan: int | None
    last_rcvd_len: int | None
    last_error_status: int | None
    last_error_scan: int | None
    task: str = ""
    addr: str | None = None
    framer: FramerSnapshot | None = None  # of a block that receives from a ComBuffer
    on_config: bool = False  # `connect` names a UDP_CONFIG
    last_is_expected: bool = False  # of the last error, see Cause

    @property
    def sends(self) -> bool:
        return block_row(self.block).sends_on_net

    @property
    def data_pin(self) -> str:
        """Return the name of the DATA pin in the manual, "" where the block has none."""
        return block_row(self.block).data_pin

    def pin(self, name: str) -> PinValue | None:
        """Return the value of the pin with this name in the manual, None if the block has no such pin."""
        for pin, value in self.inputs:
            if pin == name:
                return value
        is_output = any(pin.name == name for pin in block_row(self.block).outputs)
        return self.outputs.pin(name) if is_output else None


class DataSummary(Struct, frozen=True):
    """One global variable: its IEC type as text, its size in bytes, and how often it changed.

    The newest change wrote `newest` bytes; the longest one wrote `longest` bytes.
    """

    name: str
    type_name: str
    size: int
    generation: int
    newest: int = 0
    longest: int = 0


class AddrSnapshot(Struct, frozen=True):
    """One ADDR_PARAM: `end` is like `127.0.0.1:2000`; the port may be `@P1` until a datagram comes."""

    name: str
    end: str
    generation: int


class ComBufferSnapshot(Struct, frozen=True):
    """One ComBuffer. `count` of `size` bytes wait. `arrived` have come. `lost` had no room or no reader.

    `is_up` means that the port is not missing. `port` is its name. `fault` is why it is missing. A
    ComBuffer that sends over a `line` has the port of that line.
    """

    name: str
    source: str
    size: int
    count: int
    arrived: int
    lost: int
    is_up: bool = True
    line: str = ""
    port: str = ""
    fault: Fault | None = None


class Snapshot(Struct, frozen=True):
    """The PLC after scan `scan`, at `t_ns` from the start of the run. `scan` 0 means no scan yet."""

    scan: int
    t_ns: int
    running: bool
    dialect: str
    model: str
    interval_ns: int
    instances: tuple[InstanceSnapshot, ...]
    connections: tuple[ConnectionSnapshot, ...]
    data: tuple[DataSummary, ...]
    ledger_seq: int
    connections_used: int = 0
    connections_limit: int = 0
    faults: tuple[str, ...] = field(default=())
    addrs: tuple[AddrSnapshot, ...] = ()
    combuffers: tuple[ComBufferSnapshot, ...] = ()

    def instance(self, name: str) -> InstanceSnapshot | None:
        return next((i for i in self.instances if i.name == name), None)

    def combuffer(self, name: str) -> ComBufferSnapshot | None:
        return next((b for b in self.combuffers if b.name == name), None)

    def addr(self, name: str | None) -> AddrSnapshot | None:
        return next((a for a in self.addrs if a.name == name), None)

    def connection(self, name: str) -> ConnectionSnapshot | None:
        return next((c for c in self.connections if c.name == name), None)


# -- how they are taken -----------------------------------------------------------------------------------


def connection_snapshot(connection: Connection, now: int) -> ConnectionSnapshot:
    """Return a CONNECT or a UDP_CONFIG as it is at `now` (ns).

    For a UDP_CONFIG, the state created means ready, and `remote` is the other end of the last datagram.
    """
    retry, config = connection.retry_at, connection.config
    if isinstance(connection, UdpEndpoint) and connection.is_config:
        state = "created" if connection.is_open else "closed" if retry is None else "establishing"
        remote, unacknowledged, keep_alive_s = connection.peer, None, 0
    else:
        state, keep_alive_s = str(connection.state), config.keep_alive_s
        remote = connection.peer if connection.state is State.CONNECTED else connection.set_up.remote
        unacknowledged = connection.unacknowledged() if connection.bytes_sent else 0
    return ConnectionSnapshot(
        config.name,
        config.active,
        state,
        str(connection.local or ""),
        str(remote or ""),
        connection.incarnation,
        connection.bytes_received,
        connection.attempts,
        max(0, retry - now) if retry is not None else None,
        connection.bytes_sent,
        unacknowledged,
        connection.receiving.owners(),
        connection.sending.owners(),
        config.is_datagram,
        keep_alive_s,
    )


def data_snapshot(data: DataArea) -> DataSummary:
    return DataSummary(data.name, data.type_name, data.size, data.generation, data.newest, data.longest)


def framer_snapshot(
    block: str, bound: BufferBinding, job: FrameReceiveJob, inputs: Mapping[str, PinValue]
) -> FramerSnapshot:
    is_text = "SizeReceiveData" not in inputs
    if is_text:
        prefix, suffix = _read_string(bound.prefix), _read_string(bound.suffix)
        room = bound.data.size - 1 if bound.data is not None else 0
        size = min(room, 255 if block.endswith("255") else 80)
    else:
        prefix = _read_pointer(bound.prefix, int(inputs["LenPrefix"]))
        suffix = _read_pointer(bound.suffix, int(inputs["LenSuffix"]))
        size = int(inputs["SizeReceiveData"])
    return FramerSnapshot(
        prefix,
        suffix,
        size,
        int(inputs["Timeout"]) * MILLISECOND_NS,
        is_text,
        job.framer.discarded,
        job.framer.noise,
        job.tally,
        job.last,
    )


def _read_string(area: DataArea | None) -> bytes | None:
    return string_bytes(area) if area is not None else None


def _read_pointer(area: DataArea | None, length: int) -> bytes | None:
    return bytes(memoryview(area.content)[:length]) if area is not None else None
