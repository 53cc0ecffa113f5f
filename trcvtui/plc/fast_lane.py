"""The fast lane: a TRCV_C on a connection that stands, of which nothing but its bytes changes.

A lane does what `Instance.scan` does with such a block, call by call and line by line of the ledger
(tests/properties/test_fast_lane.py plays both).
Rule 1: a lane is made after a DONE, for the only instance on a CONNECT. It ends before any command, any look
of the communication phase at its CONNECT, and any usual call of its block.
Rule 2: what is not the usual course (no byte, FIN, RST, no buffer left) it leaves to the block, untouched.
Rule 3: while a fault is planned there is no lane: nobody knows which call the fault hits.
"""

from __future__ import annotations

from collections.abc import Container
from typing import Final

from trcvtui.blocks.environment import JobEnded, JobStarted
from trcvtui.blocks.tcp.receive_job import ReceiveJob
from trcvtui.net.events import BytesReceived
from trcvtui.net.kernel import DirectRead, Handle
from trcvtui.plc.instance import Instance
from trcvtui.plc.ledger import Ledger, StatusEdge

STILL: Final = False  # what a call answers that changed no output
Answer = StatusEdge | bool | None

BEGINS, COLLECTS, SHOWS = range(3)  # what the next call does: begin a job, go on with it, end it with DONE


class Lane:
    """The lane of one instance. `scan` answers a call with the edge that it brings, STILL, or None.

    None: the block has to be called. The job, the connection and the instance are written by `settle`, before
    anybody looks at them; DATA, the pool of buffers and the ledger always are as they should be.
    """

    __slots__ = (
        "_begun",
        "_buffer",
        "_buffers",
        "_connection",
        "_data",
        "_direct",
        "_done",
        "_done_in",
        "_dones",
        "_first",
        "_full",
        "_have",
        "_incarnation",
        "_instance",
        "_job",
        "_ledger",
        "_name",
        "_need",
        "_number",
        "_read",
        "_read_at",
        "_received",
        "_recvs",
        "_shown",
        "_since",
        "handle",
        "step",
    )

    def __init__(
        self, instance: Instance, job: ReceiveJob, handle: Handle, direct: DirectRead, ledger: Ledger
    ) -> None:
        assert job.data is not None
        connection = job.connection
        self._instance, self._job, self.handle, self._direct = instance, job, handle, direct
        self._connection, self._data, self._buffers = connection, job.data, job.buffers
        self._incarnation, self._name, self._need = connection.incarnation, connection.config.name, job.need
        self._ledger, self._read, self._shown = ledger, direct.read, instance.name
        self._begun, self._full = (instance.shown(job.outcome_at(have)) for have in (0, job.need))
        self._received, self._done = instance.outcome, instance.edge
        self.step, self._buffer, self._number, self._have = BEGINS, job.buffer, job.number, 0
        self._first, self._recvs, self._read_at = connection.bytes_received, connection.recvs, job.last_bytes
        self._dones, self._done_in, self._since = 0, 0, instance.since_scan

    # fmt: off
    def scan(self, ready: Container[int], scan: int, now: int) -> Answer:
        """Do what one call does."""
        step = self.step
        if step == SHOWS:
            return self._deliver(scan, now, 1)
        if self.handle not in ready:
            return None if step == COLLECTS else self._begin(scan, now)
        if step == COLLECTS:
            return self._go_on(scan, now)
        buffers, need = self._buffers, self._need
        if buffers.used >= buffers.count:
            return None
        try:
            size = self._read(self._buffer)
        except OSError as problem:
            self._direct.failed(problem)
            return None
        if size != need:
            if not size:
                return None
            size = self._direct.read_on(memoryview(self._buffer), size)
        buffers.used += 1
        self._number = number = self._number + 1
        self._recvs = recvs = self._recvs + 1
        ledger, name, incarnation, offset = self._ledger, self._name, self._incarnation, self._first
        ledger.last_seq += 2
        append, shown = ledger.append, self._shown
        append((scan, now, JobStarted, shown, number, name, incarnation, offset, need, False))
        append((scan, now, BytesReceived, name, incarnation, recvs, offset, size, shown))
        self._have, self._read_at, self._since = size, now, scan
        if size == need:
            self.step = SHOWS
            return self._full
        self.step = COLLECTS
        return self._instance.shown(self._job.outcome_at(size))

    def _receive(self, into: bytearray | memoryview) -> int:
        """Return how many bytes came; 0: ask the block."""
        try:
            size = self._read(into)
        except OSError as problem:
            self._direct.failed(problem)
            return 0
        return size if size == len(into) or not size else self._direct.read_on(memoryview(into), size)

    def _begin(self, scan: int, now: int) -> Answer:
        buffers, ledger = self._buffers, self._ledger
        if buffers.used >= buffers.count:
            return None
        buffers.used += 1
        if self._direct.unasked is not None:
            self._direct.unasked(self._need)
        self._number = number = self._number + 1
        ledger.last_seq += 1
        connect = self._name, self._incarnation, self._first
        ledger.append((scan, now, JobStarted, self._shown, number, *connect, self._need, False))
        self.step, self._since = COLLECTS, scan
        return self._begun

    def _go_on(self, scan: int, now: int) -> Answer:
        """Read on; the last byte is DONE in the same scan."""
        have = self._have
        size = self._receive(memoryview(self._buffer)[have:] if have else self._buffer)
        if not size:
            return None
        self._recvs = recvs = self._recvs + 1
        ledger, name, incarnation = self._ledger, self._name, self._incarnation
        self._read_at = now
        ledger.append((
            scan, now, BytesReceived, name, incarnation, recvs, self._first + have, size, self._shown,
        ))
        self._have = have = have + size
        if have == self._need:
            return self._deliver(scan, now, 2)
        ledger.last_seq += 1
        before, now_shown = (self._instance.shown(self._job.outcome_at(n)) for n in (have - size, have))
        if before.outputs == now_shown.outputs:
            return STILL
        self._since = scan
        return now_shown

    def _deliver(self, scan: int, now: int, events: int) -> Answer:
        data, need, ledger, first = self._data, self._need, self._ledger, self._first
        data.content, self._buffer = self._buffer, data.content
        data.generation += 1
        self._buffers.used -= 1
        ledger.last_seq += events
        ledger.append((
            scan, now, JobEnded, self._shown, self._number, self._name, self._incarnation, first, need, True,
            "complete",
        ))
        self.step, self._have, self._first = BEGINS, 0, first + need
        self._since = self._done_in = scan
        self._dones += 1
        return self._done
    # fmt: on

    def settle(self) -> None:
        """Write the job, the connection and the instance as the block would have left them."""
        job, instance, have, step = self._job, self._instance, self._have, self.step
        job.number, job.have, job.buffer, job.last_bytes = self._number, have, self._buffer, self._read_at
        job.running = step != BEGINS
        job.complete = job.claim.has_frame = step == SHOWS
        job.view = memoryview(job.buffer)
        job.first_offset = job.span_offset = self._first
        job.next_offset = self._connection.bytes_received = self._first + have
        self._connection.recvs = self._recvs
        instance.outcome = self._received if step == BEGINS else job.outcome_at(have)
        instance.edge = instance.shown(instance.outcome)
        instance.asleep = step == COLLECTS
        instance.since_scan = self._since
        if self._dones:
            instance.last_done = self._done_in, self._need
            instance.jobs_done += self._dones
            self._dones = 0


def lane_of(instance: Instance, ledger: Ledger) -> Lane | None:
    """Return the lane of an instance that has just shown DONE; None where the block has to be called."""
    job = instance.usual_job
    handle = job.connection.handle if job is not None else None
    if job is None or handle is None or job.running:
        return None
    direct = job.connection.direct_read()
    if direct is None or instance.outputs.rcvd_len not in (job.need, None):
        return None
    return Lane(instance, job, handle, direct, ledger)
