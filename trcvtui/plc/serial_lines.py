"""The ComBuffers of a PLC, and what fills and empties them; TwinCAT programs use SerialLineControl.

A ComBuffer's source is `sim` (bench commands), `serial` (PortExchange), a TRCV_C (BufferFeed) or another
ComBuffer. In a simulated network, `serial` works like `sim`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

from msgspec.structs import replace

from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import Environment, SerialNote
from trcvtui.blocks.rules import VendorRules
from trcvtui.blocks.serial.com_buffer import COM_BUFFER_SIZE, BufferBinding, ComBuffer, LineRecording
from trcvtui.blocks.table import block_row
from trcvtui.net.connection.connection import Connection
from trcvtui.net.serial_line import TCP_URL_PREFIXES, SerialPortFactory
from trcvtui.plc.containment import Containment, RunPart
from trcvtui.plc.instance import Instance
from trcvtui.plc.ledger import BenchNote
from trcvtui.plc.serial_line_control import BufferDrain, BufferFeed, PortExchange
from trcvtui.plc.snapshot import ComBufferSnapshot
from trcvtui.project.project import ComBufferDecl, InstanceDecl

TCP_SOURCE: Final = "tcp"  # the source in a recording, if that is a TRCV_C
CABLE_SOURCE: Final = "cable"
StreamEnd = BufferFeed | BufferDrain
TCP_QUEUE_BYTES: Final = 65_536  # bytes in front of a framer on TCP, where the sender can be slowed


class SerialLines:
    """All ComBuffers by name, in the order of the project."""

    def __init__(
        self,
        decls: tuple[ComBufferDecl, ...],
        env: Environment,
        write: Callable[[SerialNote | BenchNote], None],
        ports: SerialPortFactory | None,
        containment: Containment,
        failed: Callable[[RunPart], None],
    ) -> None:
        self._containment, self._failed = containment, failed
        self._env, self._write, self._new_port = env, write, ports
        self._decls: dict[str, ComBufferDecl] = {}
        self._buffers: dict[str, ComBuffer] = {}
        self._streams: dict[str, StreamEnd] = {}  # by instance, also one that is deleted
        self._orphans: set[str] = set()  # the deleted ones
        self._ports: dict[str, PortExchange] = {}
        for decl in decls:
            self.declare(decl)

    def _now(self) -> int:
        return self._env.now

    def declare(self, decl: ComBufferDecl) -> None:
        size = decl.size or (TCP_QUEUE_BYTES if decl.is_fed else COM_BUFFER_SIZE)
        received = self._env.resources.received.open_ring(decl.name, decl.history)
        buffer = ComBuffer(decl.name, size, self._write, self._now, received)
        self._decls[decl.name], self._buffers[decl.name] = decl, buffer
        if decl.serial is not None and self._new_port is not None:
            note = partial(_write_note, self._write, f"{decl.name} {decl.serial.port}")
            self._ports[decl.name] = PortExchange(self._new_port(decl.name, decl.serial), buffer, note)
        for other in self._decls.values():
            if other.line in self._ports:
                self._ports[other.line].tx = self._buffers[other.name]

    def redeclare(self, decl: ComBufferDecl) -> None:
        """Replace a ComBuffer. The bytes of the ComBuffer are dropped, and its port is opened again."""
        self._forget(decl.name)
        self.declare(decl)

    def withdraw(self, name: str) -> None:
        """Remove a ComBuffer that no instance uses."""
        self._forget(name)
        del self._decls[name], self._buffers[name]

    def _forget(self, name: str) -> None:
        self._buffers[name].discard_all("declared anew")
        port = self._ports.pop(name, None)
        if port is not None:
            port.close()
        decl = self._decls[name]
        for instance in {decl.source, decl.line} & self._streams.keys():
            self._streams.pop(instance).note_deleted()
            self._orphans.discard(instance)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._buffers)

    def binding(
        self, env: Environment, decl: InstanceDecl, data: Mapping[str, DataArea], priority: int
    ) -> BufferBinding:
        if block_row(decl.block).writes_tx_buffer:
            self._decls[decl.connect] = replace(self._decls[decl.connect], is_written=True)
        areas = [data[name] if name else None for name in (decl.data, *decl.pointers)]
        bound, prefix, suffix = (*areas, None, None)[:3]
        return BufferBinding(env, self._buffers[decl.connect], bound, prefix, suffix, decl.name, priority)

    def attach(self, instance: Instance, connections: Mapping[str, Connection], rules: VendorRules) -> None:
        """Let an instance serve the ComBuffer that names it: a TRCV_C feeds it, a TSEND_C empties it."""
        connection = connections.get(instance.decl.connect)
        for buffer in self._decls.values() if connection is not None else ():
            if instance.name in (buffer.source, buffer.line) and instance.name not in self._decls:
                assert connection is not None
                stream = self._make_stream(buffer, instance, connection, rules)
                self._continue_stream(instance.name, stream)
                instance.set_com_stream(stream)
                return

    def detach(self, name: str) -> None:
        """An instance is deleted: the bytes in its ComBuffer still belong to the instance's connection."""
        if name in self._streams:
            self._streams[name].note_deleted()
            self._orphans.add(name)

    def _continue_stream(self, name: str, stream: StreamEnd) -> None:
        match self._streams.get(name), stream:
            case (BufferFeed() as earlier, BufferFeed()):
                stream.continue_from(earlier)
            case (BufferDrain() as before, BufferDrain()):
                stream.continue_from(before)
            case (other, _) if other is not None:
                other.leave_connection()
        self._streams[name] = stream
        self._orphans.discard(name)

    def _make_stream(
        self, decl: ComBufferDecl, instance: Instance, connection: Connection, rules: VendorRules
    ) -> StreamEnd:
        buffer = self._buffers[decl.name]
        if decl.line == instance.name:
            return BufferDrain(connection, instance.data, buffer, decl.per_cycle)
        follows = rules.part_follows_en_r
        return BufferFeed(connection, instance.data, buffer, holds=not decl.size, follows_en_r=follows)

    def recording(self, name: str, until: int, tick: int) -> LineRecording:
        """Return what has come over the line of a ComBuffer, or nothing for an unknown ComBuffer."""
        if name not in self._decls:  # it is declared by the next scan
            return LineRecording("", ())
        decl = self._decls[name]
        is_stream = decl.is_fed or (decl.serial is not None and decl.serial.port.startswith(TCP_URL_PREFIXES))
        source = CABLE_SOURCE if decl.source in self._decls else TCP_SOURCE if is_stream else decl.source
        return self._buffers[name].recorded.make_recording(source, until, tick)

    def inject_bytes(self, name: str, payload: bytes) -> None:
        self._ports[name].inject_bytes(payload) if name in self._ports else self._buffers[name].put(payload)

    def pull_cable(self, name: str) -> None:
        """Pull the cable of a ComBuffer: received bytes stay, and an incomplete frame ends."""
        self._buffers[name].mark_connection_end("line broken")

    def poll_errors(self) -> None:
        """Ask the drivers of the open ports for their error counts, so that a recording has them."""
        for feed in self._ports.values():
            feed.sample_line_errors()

    def receive(self, now: int) -> None:
        for name, port in self._ports.items():
            self._run_safely(name, partial(port.receive, now))
        for name in self._orphans:
            self._run_safely(name, self._streams[name].follow_connection)

    def _run_safely(self, name: str, do: Callable[[], object]) -> None:
        """Serve one line. If this raises, close the line's port, and never serve the line again."""
        part = "line", name
        if part not in self._containment.out:
            self._containment.attempt(part, do)
            if part in self._containment.out:
                self._failed(part)
                if name in self._ports:
                    self._containment.clean_up(part, self._ports[name].close)

    def send_waiting(self, now: int) -> None:
        """Send at most `per_cycle` bytes (0: all) of each written ComBuffer in a scan."""
        if not self._decls:
            return
        receivers = {decl.source: name for name, decl in self._decls.items() if decl.source in self._buffers}
        for name, decl in self._decls.items():
            if decl.line in self._ports:
                self._run_safely(decl.line, partial(self._ports[decl.line].send, decl.per_cycle, now))
            elif decl.is_written and not decl.line:  # else a TSEND_C takes them
                self._run_safely(name, partial(self._move_bytes, name, decl.per_cycle, receivers.get(name)))

    def _move_bytes(self, name: str, most: int, receiver: str | None) -> None:
        """Move at most `most` bytes (0 means all) of a written ComBuffer into its `receiver`."""
        gone = self._buffers[name].read(most or self._buffers[name].count)
        if gone and receiver is not None:  # bytes sent into no cable are lost, as on a real line
            self._buffers[receiver].put(gone)

    def stop(self) -> None:
        """PLC STOP: empty all ComBuffers and close the ports."""
        self.close()
        for buffer in self._buffers.values():
            buffer.discard_all("PLC STOP")
        for stream in self._streams.values():
            stream.stop()

    def close(self) -> None:
        for name, port in self._ports.items():
            self._containment.attempt(("line", name), port.close)

    def snapshots(self) -> tuple[ComBufferSnapshot, ...]:
        return tuple([self._snapshot(decl, self._buffers[name]) for name, decl in self._decls.items()])

    def _snapshot(self, decl: ComBufferDecl, b: ComBuffer) -> ComBufferSnapshot:
        fill = decl.name, decl.source, b.size, b.count, b.tail, b.lost
        owner = decl.line or decl.name
        feed, serial = self._ports.get(owner), self._decls[owner].serial if owner in self._decls else None
        if feed is None or serial is None:
            return ComBufferSnapshot(*fill, line=decl.line)
        return ComBufferSnapshot(*fill, feed.is_open, decl.line, serial.port, feed.fault)


def _write_note(write: Callable[[BenchNote], None], subject: str, what: str, detail: str) -> None:
    write(BenchNote(subject, what, detail))
