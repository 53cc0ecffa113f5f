"""The PLC: `scan(now)` is one scan in four phases, in this order, and nothing else.

1 read_inputs            commands are applied and frozen; the network's readiness is taken once
2 execute_program        every due instance is called once, in call order; sleeping ones are left out
3 write_outputs          conditions have become STATUS; the ledger gets what changed, and why
4 service_communication  the job queue is emptied; connections with a poll event are served
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, Final, TypeVar

from trcvtui.blocks.block import ConnectBinding
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.data_area import NO_TEXT_LENS, DataArea, ElementKind, LeastTextLens
from trcvtui.blocks.environment import Environment
from trcvtui.blocks.pins import PinValue
from trcvtui.blocks.serial.com_buffer import BufferBinding, LineRecording
from trcvtui.blocks.table import block_row
from trcvtui.blocks.udp.datagram_jobs import UdpBinding
from trcvtui.net.connection.config import AddrParam, ConnectConfig, RemoteAddress, UdpConfig
from trcvtui.net.connection.connection import Connection, SocketUse, State
from trcvtui.net.connection.resources import Resources
from trcvtui.net.connection.udp import UdpEndpoint
from trcvtui.net.events import ConnectionChanged, EventKind
from trcvtui.net.kernel import Handle
from trcvtui.net.layers.layer_kernel import ReadyListKernel
from trcvtui.net.received_ring import ReceivedRing
from trcvtui.net.serial_line import SerialPortFactory
from trcvtui.plc.call_order import CallOrder
from trcvtui.plc.commands import (
    AddDeclaration,
    BlinkInput,
    Command,
    CreateInstance,
    DeleteInstance,
    DownloadInstance,
    FeedBuffer,
    PartDecl,
    PulseInput,
    RemoveDeclaration,
    ReplaceDeclaration,
    ResizeData,
    RunPlc,
    SetInput,
    StopPlc,
    WriteData,
)
from trcvtui.plc.containment import COMMAND, INTERNAL_ERROR, Containment, RunPart
from trcvtui.plc.instance import Instance
from trcvtui.plc.ledger import BenchNote, Ledger, Outputs, StatusEdge
from trcvtui.plc.serial_lines import SerialLines
from trcvtui.plc.snapshot import (
    AddrSnapshot,
    ConnectionSnapshot,
    InstanceSnapshot,
    SentCount,
    Snapshot,
    connection_snapshot,
    data_snapshot,
)
from trcvtui.project.project import ComBufferDecl, DataDecl, InstanceDecl, Project
from trcvtui.udt.types import Array, Elementary, StringType, Type, ValueKind

LEAST_STRING_LEN: Final = 2  # STEP 7 help: LEN of a TRCV into a STRING, and into a WSTRING
LEAST_WSTRING_LEN: Final = 5


def element_kind_of(type_: Type) -> ElementKind:
    """Return the kind of a variable's elements; a STRUCT always has the kind OTHER."""
    while isinstance(type_, Array):
        type_ = type_.element
    if not isinstance(type_, Elementary):
        return ElementKind.OTHER
    if type_.kind is ValueKind.BOOL:
        return ElementKind.BITS
    return ElementKind.BYTES if type_.size == 1 else ElementKind.OTHER


def text_lens_of(type_: Type, size: int) -> LeastTextLens:
    """Return the least LENs for a text variable: `size` to send, a constant to receive."""
    if not isinstance(type_, StringType):
        return NO_TEXT_LENS
    return LeastTextLens(sent=size, received=LEAST_WSTRING_LEN if type_.wide else LEAST_STRING_LEN)


def make_data_area(decl: DataDecl) -> DataArea:
    texts = text_lens_of(decl.type, decl.size)
    return DataArea(decl.name, decl.type_name, decl.size, element_kind_of(decl.type), decl.optimized, texts)


T = TypeVar("T")


class Runtime:
    """One PLC. Other modules get snapshots, ledger lines and Outputs, never the objects of the PLC."""

    def __init__(
        self,
        project: Project,
        kernel: ReadyListKernel,
        resources: Resources,
        resolve_peer: Callable[[str], int | None],
        ports: SerialPortFactory | None,
        containment: Containment,
    ) -> None:
        self.ledger, self._containment = Ledger(), containment
        self.running = True
        self.calls_all = False  # True: sleeping instances are called too; no output differs
        self.changed: tuple[StatusEdge, ...] = ()
        self._program_ran = False
        self._ready_handles: Mapping[Handle, str] | None = None  # what the poll saw; None: check all
        self._stopped: list[Instance] = []  # a STOP has changed their outputs, and `changed` lacks them
        self.interval_ns = min(task.interval_ns for task in project.tasks)
        self._project = project
        self._kernel = kernel
        self._resources = resources
        resources.work.set_interval(self.interval_ns)
        resources.work.report_wait = self._report_wait
        self._env = Environment(project.rules, resources, self.ledger.write)
        self._commands: deque[Command] = deque()
        self._resolve_peer = resolve_peer
        self._data = {d.name: make_data_area(d) for d in project.data}
        self._connections = {config.name: self._make_connection(config) for config in project.connects}
        self._ports = {config.name: self._make_udp_endpoint(config) for config in project.udp_configs}
        self._addrs = {param.name: RemoteAddress(param) for param in project.addrs}
        self._lines = SerialLines(
            project.combuffers, self._env, self.ledger.write, ports, containment, self._stop_all_on
        )
        self._instances = {decl.name: self._make_instance(decl) for decl in project.instances}
        self._call_order = self._new_call_order()
        self._written: set[str] = set()  # the variables that a command has written since the last snapshot
        self._pausing: set[str] = set()  # the CONNECTs that wait for their next attempt
        self._instance_snapshots = {name: i.snapshot() for name, i in self._instances.items()}
        self._connection_snapshots = {n: self.link_snapshot(n) for n in (*self._connections, *self._ports)}
        self._data_snapshots = {name: data_snapshot(data) for name, data in self._data.items()}

    def _make_connection(self, config: ConnectConfig) -> Connection:
        policy, journal = self._project.rules.policy, self.ledger.write
        kind = UdpEndpoint if config.is_datagram else Connection
        return kind(config, self._kernel, self._resources, policy, self._resolve_port, journal)

    def _make_udp_endpoint(self, config: UdpConfig) -> UdpEndpoint:
        policy, journal = self._project.rules.policy, self.ledger.write
        return UdpEndpoint(config, self._kernel, self._resources, policy, self._resolve_port, journal)

    def _make_instance(self, decl: InstanceDecl) -> Instance:
        instance = Instance(decl, self._make_binding(decl), self.ledger.write)
        self._lines.attach(instance, self._connections, self._project.rules)
        return instance

    def _make_binding(self, decl: InstanceDecl) -> ConnectBinding | UdpBinding | BufferBinding:
        task = self._project.task(decl.task)
        data = self._data[decl.data] if decl.data is not None else None
        priority = task.priority if task else 1
        row = block_row(decl.block)
        if row.has_com_buffer:
            return self._lines.binding(self._env, decl, self._data, priority)
        common: dict[str, Any] = {"env": self._env, "data": data, "instance": decl.name, "priority": priority}
        addr = self._addrs[decl.addr] if decl.addr is not None and (row.owns_link or row.speaks_udp) else None
        if addr is not None and decl.on_config:
            return UdpBinding(**common, port=self._ports[decl.connect], address=addr)
        return ConnectBinding(**common, connection=self._connections[decl.connect], address=addr)

    def _new_call_order(self) -> CallOrder:
        """Order the instances by the priority of their tasks (1 before 2), then as in the project file."""
        tasks = {task.name: task for task in self._project.tasks}
        order = sorted(self._instances.values(), key=lambda i: tasks[i.decl.task].priority)
        entries = [(i, tasks[i.decl.task].interval_ns) for i in order]
        links = (*self._connections, *self._ports, *self._lines.names)
        check = self._containment.raise_recorded if self._containment.is_due is not None else None
        return CallOrder(entries, self.interval_ns, links, self._fail, check)

    def _resolve_port(self, reference: str) -> int | None:
        name = reference.removeprefix("@")
        is_own = name in self._connections or name in self._ports
        return self.listening_port(name) if is_own else self._resolve_peer(name)

    # -- what may be asked between scans ----------------------------------------------------------------

    def submit(self, command: Command) -> None:
        self._commands.append(command)

    def use_kernel(self, kernel: ReadyListKernel) -> None:
        """Use this kernel, which wraps the previous one, for new CONNECTs; older CONNECTs keep theirs."""
        self._kernel = kernel

    @property
    def scans(self) -> int:
        return self._env.scan

    def sockets(self) -> Iterator[tuple[str, Handle, SocketUse]]:
        for name, connection in (*self._connections.items(), *self._ports.items()):
            for handle, use in connection.sockets:
                yield name, handle, use

    def listening_port(self, connect: str) -> int | None:
        """Return the port that a CONNECT or a UDP_CONFIG listens on, None while it does not listen."""
        if connect in self._ports:
            local = self._ports[connect].local
            return local.port if local else None
        if connect not in self._connections:
            return None  # it is declared by the next scan
        end = self._connections[connect].set_up.listening_end
        return end.port if end else None

    def connected_in_scan(self, connect: str) -> int:
        """Return the scan in which the newest connection of a CONNECT came up, or 0 if none came up."""
        connection = self._connections.get(connect)
        return 0 if connection is None else connection.since_scan

    def retry_now(self, connect: str) -> None:
        """Let a CONNECT try to connect again at once. The pause before its next attempt ends."""
        connection = self._connections.get(connect)
        if connection is not None:
            connection.retry_at = None

    @property
    def due_edges(self) -> tuple[StatusEdge, ...]:
        """Return the edges of the instances that were due in the last scan, in call order."""
        if not self._program_ran:
            return ()
        return tuple(instance.edge for instance in self._call_order.due_instances(self._env.scan - 1))

    def outputs(self, instance: str) -> Outputs:
        """Return the outputs of an instance after the last scan, or 0 and FALSE before its first scan."""
        known = self._instances.get(instance)
        return known.outputs if known else Outputs(0, False, False, False, 0)

    def inputs(self, instance: str) -> Mapping[str, PinValue]:
        known = self._instances.get(instance)
        return dict(known.inputs) if known else {}

    def data(self, name: str, most: int | None = None) -> bytes:
        """Return a copy of a global variable, or of its first `most` bytes."""
        data = self._data.get(name)  # None: it is declared by the next scan
        return bytes(memoryview(data.content)[:most]) if data else b""

    def data_part(self, name: str, start: int, stop: int) -> bytes:
        """Return a copy of the bytes `start` to `stop` of a global variable; its end limits `stop`."""
        return bytes(self._data[name].content[start:stop])

    def received_ring(self, name: str) -> ReceivedRing | None:
        """Return the ring of bytes that a link or ComBuffer received, or sent (for a `sent_ring_name`)."""
        return self._resources.received.get(name)

    def job_bytes(self, instance: str) -> bytes:
        known = self._instances.get(instance)
        return known.job_bytes() if known else b""

    def recording(self, combuffer: str) -> LineRecording:
        """Return what has come over the line of a ComBuffer, with its times."""
        return self._lines.recording(combuffer, self._env.now, self.interval_ns)

    def sent_count(self, connect: str) -> SentCount | None:
        """Return how much a CONNECT has sent on its present connection, or None without a connection."""
        connection = self._connections[connect]
        if connection.state is not State.CONNECTED:
            return None
        ends = str(connection.local or ""), str(connection.peer or "")
        return SentCount(*ends, connection.bytes_sent, connection.unacknowledged())

    def quiet_until(self) -> int | None:
        """Return when (ns) time alone changes something next, if scans change nothing now; None: never.

        If this is unknown, return the time of the last scan. A ready handle may change something earlier.
        """
        resources, now = self._resources, self._env.now
        if self._commands or resources.unsettled or self._lines.names:
            return now
        due: int | None = None
        for name in self._call_order.awake:
            link = self._connections.get(name) or self._ports[name]
            if len(self._call_order.call_positions(name)) > 1 and not self._call_order.is_one_task:
                return now
            for at in (link.retry_at, link.set_up.deadline):
                if at is not None and at > now and (due is None or at < due):
                    due = at
        return due

    def skip(self, scans: int) -> None:
        """Add this many scans to the count, but do not run them: they would change nothing."""
        self._env.scan += scans

    def sample_stack(self) -> None:
        """Ask the stack about each connection, so that a recording has the answers."""
        for connection in self._connections.values():
            if connection.state is State.CONNECTED:
                connection.unacknowledged()
        self._lines.poll_errors()

    # -- one scan ------------------------------------------------------------------------------------------

    def scan(self, now: int) -> None:
        """Run one scan. `now` is its time in ns from the start of the run. The time never goes back."""
        self._env.scan += 1
        self._env.now = now
        self.ledger.scan, self.ledger.t_ns = self._env.scan, now
        self._resources.work.begin_scan(now)
        self._read_inputs()
        self._execute_program()
        self._write_outputs()
        self._service_communication()

    def _report_wait(self, connect: str, what: EventKind, partner: str, why: str) -> None:
        connection = self._connections.get(connect)
        incarnation = connection.incarnation if connection else 0
        self.ledger.write(ConnectionChanged(connect, incarnation, what, peer=partner, detail=why))

    def _read_inputs(self) -> None:
        if self._commands:
            while self._commands:
                self._containment.attempt(COMMAND, partial(self._apply, self._commands.popleft()))
            self._call_order.wake_all()  # a command may change any instance
        self._kernel.poll()
        if self.running:
            self._lines.receive(self._env.now)
        self._ready_handles = ready = None if self.calls_all else self._kernel.ready_handles()
        if ready is None:  # this kernel cannot say
            self._call_order.wake_all()
        elif ready:
            self._call_order.wake(ready.values())

    def _execute_program(self) -> None:
        self._program_ran = self.running
        env, self.changed = self._env, ()
        if self.running:
            self.changed = tuple(self._call_order.call(env.scan - 1))

    def _write_outputs(self) -> None:
        if self.changed:
            self.ledger.write_all(self.changed)
        if self._stopped:
            shown = {edge.instance for edge in self.changed}
            self.changed += tuple([i.edge for i in self._stopped if i.name not in shown])
            self._stopped.clear()

    def _service_communication(self) -> None:
        resources, ready = self._resources, self._ready_handles
        resources.queue.clear()  # its places are those of one scan (80AC)
        self._lines.send_waiting(self._env.now)
        if ready is None or ready:
            for name in self._connections if ready is None else self._ready_listeners(ready):
                self._run_safely(name, self._connections[name].serve_listener)
        for name in tuple(resources.unsettled) if resources.unsettled else ():
            self._run_safely(name, self._connections[name].check_dead_link)

    def _ready_listeners(self, ready_handles: Mapping[Handle, str]) -> list[str]:
        connections = self._connections
        return [  # without the connection's own handle, which its blocks read
            name
            for handle, name in ready_handles.items()
            if name in connections and (connections[name].handle != handle or connections[name].pending_loss)
        ]

    # -- what an internal error has stopped ----------------------------------------------------------------

    def _run_safely(self, name: str, do: Callable[[], bool]) -> None:
        if (part := ("CONNECT", name)) in self._containment.out:
            return
        is_changed = self._containment.attempt(part, do)
        if is_changed is None:
            self._stop_all_on(part)
            self._containment.clean_up(part, self._connections[name].abandon)
        if is_changed:
            self._call_order.wake((name,))

    def _stop_all_on(self, part: RunPart) -> None:
        for instance in self._instances.values():
            if instance.decl.connect == part[1] and self._stop_instance(
                instance, f"{' '.join(part)} has failed"
            ):
                self.ledger.write(instance.edge)
                self._stopped.append(instance)

    def _fail(self, instance: Instance, error: Exception) -> bool:
        return self._stop_instance(
            instance, *self._containment.record_error(("instance", instance.name), error)
        )

    def _stop_instance(self, instance: Instance, why: str, in_connection: bool = False) -> bool:
        """Show ERROR, release locks. Close the connection if `in_connection` or no instance works on it."""
        name, connect = instance.name, instance.decl.connect
        self._containment.clean_up(("instance", name), partial(instance.drop_job, INTERNAL_ERROR))
        is_changed = instance.fail(why)
        link = self._connections.get(connect) or self._ports.get(connect)
        if link is not None:
            for direction in link.direction_claims:
                direction.release_instance(name)
            if in_connection or not any(map(self._asks_for_work, self._call_order.instances_on((connect,)))):
                self._containment.clean_up(("CONNECT", connect), link.abandon)
        return is_changed

    @staticmethod
    def _asks_for_work(instance: Instance) -> bool:
        row, pins = block_row(instance.block_name), instance.inputs
        always = row.uses_network or row.runs_as is Condition.ESTABLISHING  # no CONT: TSEND, TRCV, TCON
        asks = pins.get("CONT", always) or pins.get("EN_R", False) or pins.get("REQ", False)
        return bool(asks) and not instance.has_failed

    # -- commands --------------------------------------------------------------------------------------------

    def _apply(self, command: Command) -> None:
        match command:
            case SetInput(name, pin, value):
                self._instances[name].set_input(pin, value)
            case PulseInput(name, pin):
                self._instances[name].pulse(pin)
            case BlinkInput(name, pin):
                self._instances[name].blink(pin)
            case WriteData(name, offset, payload):
                self._data[name].write(offset, payload)
                self._written.add(name)
                self.ledger.write(BenchNote(name, "written", f"{len(payload)} bytes at {offset}"))
            case StopPlc():
                self._switch_to_stop()
            case RunPlc():
                self._switch_to_run()
            case CreateInstance(decl, place):
                self._create(decl, place)
            case AddDeclaration(declared):
                self._declare(declared)
            case ReplaceDeclaration(before, declared_anew):
                self._redeclare(before, declared_anew)
            case RemoveDeclaration(withdrawn):
                self._remove_declaration(withdrawn)
            case DeleteInstance(name):
                self._delete(name)
            case DownloadInstance(name):
                self._download(name)
            case FeedBuffer(name, payload):
                self._lines.pull_cable(name) if payload is None else self._lines.inject_bytes(name, payload)
            case ResizeData(data):
                kind = element_kind_of(data.type), text_lens_of(data.type, data.size)
                self._data[data.name].resize(data.type_name, data.size, *kind)
                self._written.add(data.name)
                self.ledger.write(BenchNote(data.name, "resized", f"{data.type_name}, {data.size} bytes"))

    def _create(self, decl: InstanceDecl, place: int | None) -> None:
        instance = self._make_instance(decl)
        self._instances = _insert(self._instances, decl.name, instance, place)
        self._instance_snapshots = _insert(self._instance_snapshots, decl.name, instance.snapshot(), place)
        self._call_order = self._new_call_order()
        self.ledger.write(BenchNote(decl.name, "created", f"{decl.block} on {decl.connect}"))

    def _declare(self, decl: DataDecl | ConnectConfig | UdpConfig | AddrParam | ComBufferDecl) -> None:
        match decl:
            case ComBufferDecl():
                self._lines.declare(decl)
                for name in {decl.source, decl.line} & self._instances.keys():
                    self._lines.attach(self._instances[name], self._connections, self._project.rules)
            case DataDecl(name):
                data = self._data[name] = make_data_area(decl)
                self._data_snapshots[name] = data_snapshot(data)
            case ConnectConfig(name):
                self._connections[name] = self._make_connection(decl)
                self._connection_snapshots[name] = self.link_snapshot(name)
            case UdpConfig(name):
                self._ports[name] = self._make_udp_endpoint(decl)
                self._connection_snapshots[name] = self.link_snapshot(name)
            case AddrParam(name):
                self._addrs[name] = RemoteAddress(decl)
        self._call_order = self._new_call_order()
        self.ledger.write(BenchNote(decl.name, "declared"))

    def _redeclare(self, before: PartDecl | InstanceDecl, decl: PartDecl | InstanceDecl) -> None:
        name, ends = decl.name, set[str]()
        self._containment.restore_parts(("CONNECT", name), ("line", name))
        match decl:
            case DataDecl():
                if (before.type_name, before.size) != (decl.type_name, decl.size):  # type: ignore[union-attr]
                    self._apply(ResizeData(decl))
                self._data[name].symbolic = decl.optimized
            case ConnectConfig():
                self._connections[name].stop()
                self._connections[name] = self._make_connection(decl)
            case UdpConfig():
                self._ports[name].stop()
                self._ports[name] = self._make_udp_endpoint(decl)
            case AddrParam():
                self._addrs[name] = RemoteAddress(decl)
            case ComBufferDecl():
                self._lines.redeclare(decl)
                ends = {decl.source, decl.line}
            case InstanceDecl():
                self._instances[name].decl = decl
                ends = {name}
        if isinstance(before, ComBufferDecl):
            ends |= {before.source, before.line}
        if not isinstance(decl, DataDecl):
            for instance in [i for i in self._instances.values() if i.name in ends or _uses(i.decl, decl)]:
                self._rebind(instance, before)
        self._call_order = self._new_call_order()
        self.ledger.write(BenchNote(name, "declared anew"))

    def _rebind(self, instance: Instance, before: PartDecl | InstanceDecl) -> None:
        decl, kept = instance.decl, dict(instance.inputs)
        self._containment.restore_parts(("CONNECT", decl.connect))
        if isinstance(before, InstanceDecl):
            declared = dict(before.inputs)  # an input stays as it is unless its declaration changed
            kept |= {pin: value for pin, value in decl.inputs if declared.get(pin) != value}
        self._lines.detach(decl.name)
        instance.drop_job("declared anew")
        fresh = self._instances[decl.name] = self._make_instance(decl)
        fresh.inputs.update({pin: value for pin, value in kept.items() if pin in fresh.inputs})
        self._instance_snapshots[decl.name] = fresh.snapshot()

    def _remove_declaration(self, decl: PartDecl) -> None:
        name = decl.name
        match decl:
            case DataDecl():
                del self._data[name], self._data_snapshots[name]
            case ConnectConfig():
                self._connections.pop(name).stop()
                del self._connection_snapshots[name]
                self._resources.unsettled.pop(name, None)
            case UdpConfig():
                self._ports.pop(name).stop()
                del self._connection_snapshots[name]
            case AddrParam():
                del self._addrs[name]
            case ComBufferDecl():
                self._lines.withdraw(name)
        self._call_order = self._new_call_order()
        self.ledger.write(BenchNote(name, "removed"))

    def _delete(self, name: str) -> None:
        instance = self._instances.pop(name)
        del self._instance_snapshots[name]
        self._call_order = self._new_call_order()
        self.ledger.write(BenchNote(name, "deleted"))
        self._lines.detach(name)
        instance.drop_job("instance deleted")

    def _download(self, name: str) -> None:
        self.ledger.write(BenchNote(name, "downloaded", "a new instance of the same name"))
        instance = self._instances[name]
        self._containment.restore_parts(("instance", name), ("CONNECT", instance.decl.connect))
        self._containment.attempt(("instance", name), partial(instance.drop_job, "instance downloaded"))
        instance.restart_block()

    def _switch_to_stop(self) -> None:
        if not self.running:
            return
        self.running = False
        self.ledger.write(BenchNote("PLC", "STOP"))
        self.close()
        self._lines.stop()
        for instance in self._instances.values():
            if self._containment.attempt(("instance", instance.name), instance.stop):
                self.ledger.write(instance.edge)
                self._stopped.append(instance)

    def _switch_to_run(self) -> None:
        if self.running:
            return
        self.running = True
        self._containment.out.clear()
        self.ledger.write(BenchNote("PLC", "RUN"))
        for instance in self._instances.values():
            self._containment.attempt(("instance", instance.name), instance.restart_block)

    def close(self) -> None:
        """Free every socket; the run is over."""
        for name, link in (*self._connections.items(), *self._ports.items()):
            self._containment.attempt(("CONNECT", name), link.stop)
        self._lines.close()

    # -- the frozen picture ------------------------------------------------------------------------

    def snapshot(self, faults: tuple[str, ...] = ()) -> Snapshot:
        """Return the PLC after its last scan. Unchanged parts are the same objects as before."""
        self._renew_snapshots()
        return Snapshot(
            scan=self._env.scan,
            t_ns=self._env.now,
            running=self.running,
            dialect=self._project.dialect.name,
            model=self._project.model,
            interval_ns=self.interval_ns,
            instances=tuple(self._instance_snapshots.values()),
            connections=tuple(self._connection_snapshots.values()),
            data=tuple(self._data_snapshots.values()),
            ledger_seq=self.ledger.last_seq,
            connections_used=self._resources.budget.used,
            connections_limit=self._resources.budget.limit,
            faults=faults,
            addrs=tuple([AddrSnapshot(a.name, str(a), a.generation) for a in self._addrs.values()]),
            combuffers=self._lines.snapshots(),
        )

    def instance_snapshot(self, name: str) -> InstanceSnapshot | None:
        """Return the present state of an instance, or None if the instance is not created yet."""
        found = self._instances.get(name)
        return found.snapshot() if found is not None else None

    def link_snapshot(self, name: str) -> ConnectionSnapshot:
        """Return a CONNECT or UDP_CONFIG as it is now."""
        return connection_snapshot(self._ports.get(name) or self._connections[name], self._env.now)

    def _renew_snapshots(self) -> None:
        awake = self._call_order.take_awakened() | set(self._resources.unsettled)
        for instance in self._call_order.instances_on(awake):
            self._instance_snapshots[instance.name] = instance.snapshot()
            if instance.data is not None:
                self._written.add(instance.data.name)
        for name in self._written & self._data.keys():
            if self._data_snapshots[name].generation != self._data[name].generation:
                self._data_snapshots[name] = data_snapshot(self._data[name])
        self._written.clear()
        # retry_in_ns counts down, even where no block is left to make that attempt.
        for name in awake | self._pausing:
            if name in self._connection_snapshots:
                fresh = self.link_snapshot(name)
                if fresh != self._connection_snapshots[name]:
                    self._connection_snapshots[name] = fresh
                (self._pausing.discard if fresh.retry_in_ns is None else self._pausing.add)(name)


def _uses(instance: InstanceDecl, decl: PartDecl | InstanceDecl) -> bool:
    if isinstance(decl, AddrParam):
        return instance.addr == decl.name
    if instance.connect != decl.name:
        return False
    if isinstance(decl, ComBufferDecl):
        return block_row(instance.block).has_com_buffer
    return isinstance(decl, UdpConfig) == instance.on_config and not block_row(instance.block).has_com_buffer


def _insert(entries: dict[str, T], name: str, entry: T, place: int | None) -> dict[str, T]:
    kept = list(entries.items())
    kept.insert(len(kept) if place is None else place, (name, entry))
    return dict(kept)
