"""The PLC: `scan(now)` is one scan in four phases, in this order, and nothing else.

1 read_inputs            commands are applied and frozen; the network's readiness is taken once
2 execute_program        every due instance is called once, in call order
3 write_outputs          conditions have become STATUS; the ledger gets what changed, and why
4 service_communication  every connection once: bounded housekeeping; the job queue is served
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import Environment
from trcvtui.blocks.rules import Rules
from trcvtui.net.connect_config import ConnectConfig
from trcvtui.net.connection import Connection, State
from trcvtui.net.kernel import Kernel
from trcvtui.net.resources import Resources
from trcvtui.plc.commands import (
    BlinkInput,
    Command,
    PlcRun,
    PlcStop,
    PulseInput,
    SetInput,
    WriteData,
)
from trcvtui.plc.instance import Instance, Outputs
from trcvtui.plc.ledger import BenchNote, Event, InputEdge, Ledger
from trcvtui.plc.snapshot import ConnectionSnapshot, DataSnapshot, InstanceSnapshot, Snapshot


@dataclass(frozen=True, slots=True)
class Task:
    """One task: its interval in ns; a larger interval than the fastest is called every so many scans."""

    name: str
    interval_ns: int
    priority: int = 1


@dataclass(frozen=True, slots=True)
class Call:
    """One instance to call: its name, block, CONNECT, DATA, task and the initial values of its inputs."""

    name: str
    block: str
    connect: str
    data: str | None
    task: str
    inputs: tuple[tuple[str, bool | int], ...] = ()


@dataclass(frozen=True, slots=True)
class Programme:
    """What a PLC is loaded with. `data` is (name, IEC type as text, size in bytes)."""

    dialect: str
    model: str
    rules: Rules
    tasks: tuple[Task, ...]
    data: tuple[tuple[str, str, int], ...]
    connects: tuple[ConnectConfig, ...]
    calls: tuple[Call, ...]


class Runtime:
    """One PLC. Readers get snapshots, ledger lines and Outputs, never the objects themselves."""

    def __init__(
        self,
        programme: Programme,
        kernel: Kernel,
        resources: Resources,
        resolve_peer: Callable[[str], int | None],
    ) -> None:
        self.ledger = Ledger()
        self.running = True
        self.called: tuple[Outputs, ...] = ()
        self.changed: tuple[Outputs, ...] = ()
        self.interval_ns = min(task.interval_ns for task in programme.tasks)
        self._programme = programme
        self._kernel = kernel
        self._resources = resources
        self._env = Environment(programme.rules, resources, [])
        self._commands: deque[Command] = deque()
        self._data = {name: DataArea(name, text, size) for name, text, size in programme.data}
        self._connections = {
            config.name: Connection(
                config, kernel, resources, programme.rules.policy, self._resolver(resolve_peer)
            )
            for config in programme.connects
        }
        self._instances = {call.name: self._instance(call) for call in programme.calls}
        self._every = self._call_periods(programme)

    def _instance(self, call: Call) -> Instance:
        data = self._data[call.data] if call.data is not None else None
        return Instance(
            call.name, call.block, self._env, self._connections[call.connect], data, call.inputs
        )

    def _call_periods(self, programme: Programme) -> tuple[tuple[Instance, int], ...]:
        periods = {task.name: max(1, round(task.interval_ns / self.interval_ns)) for task in programme.tasks}
        return tuple((self._instances[call.name], periods[call.task]) for call in programme.calls)

    def _resolver(self, resolve_peer: Callable[[str], int | None]) -> Callable[[str], int | None]:
        def resolve(reference: str) -> int | None:
            name = reference.removeprefix("@")
            return self.listening_port(name) if name in self._connections else resolve_peer(name)

        return resolve

    # -- what may be asked between scans ----------------------------------------------------------------

    def submit(self, command: Command) -> None:
        """Queue a command for phase 1 of the next scan."""
        self._commands.append(command)

    @property
    def scans(self) -> int:
        """Return how many scans have passed."""
        return self._env.scan

    def listening_port(self, connect: str) -> int | None:
        """Return the port that a CONNECT listens on, None while it does not."""
        set_up = self._connections[connect].set_up
        return set_up.local.port if set_up.listener is not None and set_up.local else None

    def outputs(self, instance: str) -> Outputs:
        """Return the outputs of an instance as the last scan left them."""
        return self._instances[instance].outputs

    def inputs(self, instance: str) -> Mapping[str, bool | int]:
        """Return a copy of the inputs of an instance."""
        return dict(self._instances[instance].inputs)

    def data(self, name: str) -> bytes:
        """Return a copy of a global variable."""
        return bytes(self._data[name].content)

    def partial(self, instance: str) -> bytes:
        """Return a copy of what an instance's running job has collected."""
        return self._instances[instance].partial()

    def write_ledger(self, event: Event) -> None:
        """Let the bench write down what it did between scans."""
        self.ledger.write(self._env.scan, self._env.now, event)

    # -- one scan ------------------------------------------------------------------------------------------

    def scan(self, now: int) -> None:
        """Run one scan; `now` is its time in ns from the start of the run and never goes back."""
        self._env.scan += 1
        self._env.now = now
        self._read_inputs()
        called = self._execute_program() if self.running else ()
        self._write_outputs(called)
        self._service_communication()

    def _read_inputs(self) -> None:
        while self._commands:
            self._apply(self._commands.popleft())
        self._kernel.poll()

    def _execute_program(self) -> Sequence[Instance]:
        turn = self._env.scan - 1
        called = [instance for instance, every in self._every if turn % every == 0]
        changed = []
        for instance in called:
            for pin in instance.toggle_blinking():
                self._note(InputEdge(instance.name, pin, instance.inputs[pin]))
            if instance.scan():
                changed.append(instance)
        self._changed = changed
        return called

    def _write_outputs(self, called: Sequence[Instance]) -> None:
        self.called = tuple([instance.outputs for instance in called])
        self._write_notes()
        if called:
            for instance in self._changed:
                self._note(instance.edge())
            self.changed = tuple([instance.outputs for instance in self._changed])
        else:
            self.changed = self._stopped_outputs
        self._stopped_outputs = ()

    def _write_notes(self) -> None:
        for connection in self._connections.values():
            if connection.notes:
                for note in connection.notes:
                    self._note(note)
                connection.notes.clear()
        if self._env.jobs:
            for job in self._env.jobs:
                self._note(job)
            self._env.jobs.clear()

    def _service_communication(self) -> None:
        self._resources.queue.serve()
        for connection in self._connections.values():
            connection.service()

    def _note(self, event: Event) -> None:
        self.ledger.write(self._env.scan, self._env.now, event)

    # -- commands --------------------------------------------------------------------------------------------

    _changed: Sequence[Instance] = ()
    _stopped_outputs: tuple[Outputs, ...] = ()

    def _apply(self, command: Command) -> None:
        match command:
            case SetInput(name, pin, value):
                if self._instances[name].set_input(pin, value):
                    self._note(InputEdge(name, pin, value))
            case PulseInput(name, pin):
                if self._instances[name].pulse(pin):
                    self._note(InputEdge(name, pin, True))
            case BlinkInput(name, pin):
                self._instances[name].blink(pin)
            case WriteData(name, offset, payload):
                self._data[name].write(offset, payload)
                self._note(BenchNote(name, "written", f"{len(payload)} bytes at {offset}"))
            case PlcStop():
                self._stop()
            case PlcRun():
                self._run()

    def _stop(self) -> None:
        if not self.running:
            return
        self.running = False
        self._note(BenchNote("PLC", "STOP"))
        for connection in self._connections.values():
            connection.stop()
        for instance in self._instances.values():
            instance.stop()
            self._note(instance.edge())
        self._stopped_outputs = tuple([i.outputs for i in self._instances.values()])

    def _run(self) -> None:
        if self.running:
            return
        self.running = True
        self._note(BenchNote("PLC", "RUN"))
        for instance in self._instances.values():
            instance.fresh()

    def close(self) -> None:
        """Free every socket; the run is over."""
        for connection in self._connections.values():
            connection.stop()

    # -- the frozen picture ------------------------------------------------------------------------------------

    def snapshot(self, faults: tuple[str, ...] = ()) -> Snapshot:
        """Return the PLC as the last scan left it."""
        return Snapshot(
            scan=self._env.scan,
            t_ns=self._env.now,
            running=self.running,
            dialect=self._programme.dialect,
            model=self._programme.model,
            interval_ns=self.interval_ns,
            instances=self._instance_snapshots(),
            connections=tuple(self._connection_snapshot(c) for c in self._connections.values()),
            data=tuple(DataSnapshot(d.name, d.type_name, d.size, d.generation) for d in self._data.values()),
            ledger_seq=self.ledger.last_seq,
            connections_used=self._resources.budget.used,
            connections_limit=self._resources.budget.limit,
            faults=faults,
        )

    def _instance_snapshots(self) -> tuple[InstanceSnapshot, ...]:
        return tuple(instance.snapshot() for instance in self._instances.values())

    def _connection_snapshot(self, connection: Connection) -> ConnectionSnapshot:
        loss = connection.last_loss
        retry = connection.retry_at
        connected = connection.state is State.CONNECTED
        return ConnectionSnapshot(
            name=connection.config.name,
            active=connection.config.active,
            state=str(connection.state),
            local=str(connection.local or ""),
            remote=str((connection.peer if connected else connection.set_up.remote) or ""),
            incarnation=connection.incarnation,
            since_scan=connection.since_scan,
            bytes_received=connection.bytes_received,
            attempts=connection.attempts,
            retry_in_ns=max(0, retry - self._env.now) if retry is not None else None,
            last_loss=loss.kind.name.lower().replace("_", " ") if loss else "",
        )
