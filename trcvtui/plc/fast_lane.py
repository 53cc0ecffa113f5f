"""The fast lane: a TRCV_C on a connection that stands, of which nothing but its bytes changes.

A lane does what `Instance.scan` does with such a block, call by call and line by line of the ledger
(tests/properties/test_fast_lane.py plays both), on the same job, connection and outputs.
Rule 1: a lane is made after a DONE, for the only instance on a CONNECT. It ends before any command, any look
of the communication phase at its CONNECT, and any usual call of its block.
Rule 2: what is not the usual course (no byte, FIN, RST, no buffer left) it leaves to the block, untouched.
Rule 3: while a fault is planned there is no lane: nobody knows which call the fault hits.
"""

from __future__ import annotations

import os
from collections.abc import Container
from typing import Final

from trcvtui.blocks.environment import JobEnded, JobStarted
from trcvtui.blocks.tcp.receive_job import ReceiveJob
from trcvtui.net.events import BytesReceived
from trcvtui.net.kernel import DirectRead, Handle
from trcvtui.plc.instance import Instance
from trcvtui.plc.ledger import Ledger

SWITCH: Final = "TRCVTUI_LANE"  # of the environment; "slow": no lanes


def is_wanted() -> bool:
    """Return whether lanes are made."""
    return os.environ.get(SWITCH) != "slow"


class Lane:
    """The lane of one instance; `scan` returns None where the block has to be called."""

    __slots__ = (
        "_begun",
        "_buffers",
        "_connection",
        "_data",
        "_direct",
        "_done",
        "_full",
        "_handle",
        "_incarnation",
        "_instance",
        "_job",
        "_ledger",
        "_name",
        "_need",
        "_read",
        "_shown",
    )

    def __init__(
        self, instance: Instance, job: ReceiveJob, handle: Handle, direct: DirectRead, ledger: Ledger
    ) -> None:
        assert job.data is not None
        connection = job.connection
        self._instance, self._job, self._handle, self._direct = instance, job, handle, direct
        self._connection, self._data, self._buffers = connection, job.data, job.buffers
        self._incarnation, self._name, self._need = connection.incarnation, connection.config.name, job.need
        self._ledger, self._read = ledger, direct.read
        self._shown = instance.name
        full, begun = job.outcome_at(job.need), job.outcome_at(0)
        self._full, self._begun = (full, instance.shown(full)), (begun, instance.shown(begun))
        self._done = instance.outcome, instance.edge

    def scan(self, ready: Container[Handle], scan: int, now: int) -> bool | None:
        """Do what one call does; return whether any output differs from the scan before."""
        job = self._job
        if job.complete:
            return self._deliver(job, scan, now)
        if self._handle in ready:
            return self._collect(job, scan, now)
        buffers, instance = self._buffers, self._instance
        if job.running or buffers.used >= buffers.count:
            return None
        self._start(job, scan, now)
        instance.asleep = True
        instance.outcome, instance.edge = self._begun
        instance.since_scan = scan
        return True

    def hand_over(self) -> None:
        """Leave the job as the block keeps it: it is called the usual way from now on."""
        job = self._job
        job.span_offset, job.next_offset = job.first_offset, job.first_offset + job.have
        job.view = memoryview(job.buffer)
        job.claim.has_frame = job.complete

    # fmt: off
    def _start(self, job: ReceiveJob, scan: int, now: int) -> None:
        job.number = number = job.number + 1
        job.running = True
        job.first_offset = offset = self._connection.bytes_received
        self._buffers.used += 1
        ledger = self._ledger
        ledger.last_seq += 1
        ledger.append((
            scan, now, JobStarted, self._shown, number, self._name, self._incarnation, offset, self._need,
            False,
        ))
    # fmt: on

    def _collect(self, job: ReceiveJob, scan: int, now: int) -> bool | None:
        """Read once; a job that begins in this scan shows its frame in the next one."""
        have, need = job.have, self._need
        starts = not job.running
        buffers = self._buffers
        if starts and buffers.used >= buffers.count:
            return None
        try:
            size = self._read(memoryview(job.buffer)[have:] if have else job.buffer)
        except OSError as problem:
            self._direct.failed(problem)
            return None
        if not size:
            return None
        if have + size != need:
            size = self._direct.read_on(memoryview(job.buffer)[have:], size)
        if starts:
            self._start(job, scan, now)
        connection, instance, ledger = self._connection, self._instance, self._ledger
        offset = connection.bytes_received
        connection.bytes_received = offset + size
        connection.recvs = recvs = connection.recvs + 1
        job.have = have = have + size
        job.last_bytes = now
        ledger.last_seq += 1
        ledger.append(
            (scan, now, BytesReceived, self._name, self._incarnation, recvs, offset, size, self._shown)
        )
        if have != need:
            outcome = job.outcome_at(have)
            instance.asleep = outcome.stable
            return outcome is not instance.outcome and instance.take(outcome)
        if not starts:
            return self._deliver(job, scan, now)
        job.complete = True
        instance.asleep = False
        instance.outcome, instance.edge = self._full
        instance.since_scan = scan
        return True

    def _deliver(self, job: ReceiveJob, scan: int, now: int) -> bool:
        """Hand the frame over to DATA: the scan with DONE."""
        data, instance, need = self._data, self._instance, self._need
        job.buffer, data.content = data.content, job.buffer
        data.generation += 1
        self._buffers.used -= 1
        job.running = job.complete = False
        job.have = 0
        ledger = self._ledger
        ledger.last_seq += 1
        # fmt: off
        ledger.append((
            scan, now, JobEnded, self._shown, job.number, self._name, self._incarnation, job.first_offset,
            need, True, "complete",
        ))
        # fmt: on
        instance.outcome, instance.edge = self._done
        instance.jobs_done += 1
        instance.last_done = scan, need
        instance.since_scan = scan
        instance.asleep = False
        return True


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
