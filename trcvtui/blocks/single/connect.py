"""TCON, TDISCON, T_RESET, T_DIAG as single instructions (STEP 7 help)."""

from __future__ import annotations

import struct
from functools import lru_cache
from typing import Final

from msgspec.structs import replace

from trcvtui.blocks.block import ConnectBinding, NoJob, ScriptedBlock, StoppableJob
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, CauseKind, Outcome, cause_of_fault
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.rules import StatusRules
from trcvtui.blocks.tcp.connection_control import disconnect, established_cause, reset, set_up_failed
from trcvtui.blocks.tcp.job_checks import changed_outcome, find_rival, in_use_cause
from trcvtui.blocks.tcp.no_connection import loss_cause
from trcvtui.net.connection.connection import Connection, ConnectionLoss, LossKind, State
from trcvtui.net.connection.description import Description
from trcvtui.net.connection.set_up import SetUpStage
from trcvtui.net.connection.udp import UdpEndpoint
from trcvtui.net.results import Fault

IDLE: Final = Outcome(Condition.NO_JOB, Cause(CauseKind.WAITING, "REQ has not risen", pin="REQ"), stable=True)
REQ_ROSE: Final = Cause(CauseKind.INPUT, "REQ rose", pin="REQ", value=1)
NO_ENDPOINT: Final = Cause(CauseKind.INPUT, "REQ rose, but no such connection exists", pin="REQ", value=1)


def no_socket_outcome(port: UdpEndpoint, pin: str, asked: str) -> Outcome:
    """Return 80A1 for a UDP_CONFIG without a socket, with the error of opening it, if there was one."""
    return _cached_no_socket_outcome(port.failure, pin, asked)


@lru_cache(64)
def _cached_no_socket_outcome(fault: Fault | None, pin: str, asked: str) -> Outcome:
    if fault is None:
        return Outcome(Condition.NOT_CONNECTED, Cause(CauseKind.INPUT, asked, pin=pin, value=1))
    return Outcome(Condition.NOT_CONNECTED, replace(cause_of_fault(fault), detail=asked))


@lru_cache(1024)
def with_condition(condition: Condition, outcome: Outcome) -> Outcome:
    """Return the outcome with another condition. "started" is not stable, because it lasts one scan."""
    return replace(outcome, condition=condition, stable=outcome.stable and condition is not Condition.STARTED)


def end_job(loss: ConnectionLoss, job: StoppableJob, course: StatusRules, failed: Condition) -> Outcome:
    """End a job that has lost its connection. If our side closed the connection, show "not connected"."""
    is_ours = loss.kind is LossKind.OURS
    condition = Condition.NOT_CONNECTED if is_ours else course.job_loss.get(loss.kind, failed)
    cause = loss_cause(loss, job)
    job.abandon(loss.reason)
    return Outcome(condition, cause)


ENDPOINT_IS_THERE: Final = Cause(CauseKind.INPUT, "REQ rose, but the endpoint exists", pin="REQ", value=1)
STILL_CLOSING: Final = Cause(CauseKind.OTHER_BLOCK, "TDISCON is still closing the connection")


class SingleTcon:
    """One TCON instance. After each loss, a TCON rebuilds the connection that it has established."""

    def __init__(self, bound: ConnectBinding) -> None:
        self.job = NoJob()
        self._env = bound.env
        self._connection = bound.connection
        self._claim = bound.make_claim()
        self._req = False
        self._is_building = False
        self._incarnation = 0  # the newest that it knows
        self._keeps = False  # established by this instance: the endpoint is there until TDISCON or T_RESET

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call with 7000, 7001, 7002, or 0000 and DONE. A failed attempt ends the job."""
        rose, self._req = inputs.req and not self._req, inputs.req
        if self._connection.state is State.CLOSED:
            self._keeps = False
        if self._is_building:
            return self._advance()
        if rose:
            return self._begin()
        if self._keeps:
            return self._maintain_connection()
        return IDLE

    def stop(self, reason: str) -> None:
        self._is_building = self._keeps = False

    def detach(self, reason: str) -> None:
        self._connection.keeping.give_back(self._claim)

    def _begin(self) -> Outcome:
        rival = find_rival(self._env, self._connection, self._claim)
        if rival is not None:
            return Outcome(Condition.CONNECT_IN_USE, in_use_cause(rival, self._claim))
        if self._connection.set_up.is_closing:
            return Outcome(Condition.NOT_NOW, STILL_CLOSING)
        if self._connection.state is not State.CLOSED:
            return self._refuse()
        fault = self._connection.queue_set_up(self._env.now)
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of_fault(fault))
        self._is_building = True
        self._connection.keeping.hold(self._claim)
        return Outcome(Condition.STARTED, REQ_ROSE)

    def _refuse(self) -> Outcome:
        failed = self._connection.set_up.claim_description()
        if failed is not None:
            return set_up_failed(self._connection, failed, self._env.rules.course)
        return Outcome(Condition.ENDPOINT_THERE, ENDPOINT_IS_THERE)

    def _advance(self) -> Outcome:
        if self._connection.set_up.is_withdrawn or self._connection.state is State.CLOSED:  # TDISCON, CONT
            self._end_job()
            self._connection.disconnect()
            return Outcome(
                Condition.RESET_IN_JOB, Cause(CauseKind.OTHER_BLOCK, "closed before it was established")
            )
        failed = self._connection.step(self._env.scan, self._env.now)
        if failed is not None:
            if self._env.rules.course.silent_connect and failed.stage is SetUpStage.CONNECT:
                return _BUILDING  # legacy: 7002 and BUSY stay (STEP 7 help, TCON)
            self._end_job()
            shown = set_up_failed(self._connection, failed, self._env.rules.course)
            self._connection.disconnect()
            return shown
        if not self._connection.is_up:
            return _BUILDING
        self._end_job()
        self._keeps, self._incarnation = True, self._connection.incarnation
        return Outcome(Condition.FINISHED, established_cause(self._connection))

    def _end_job(self) -> None:
        self._is_building = False
        self._connection.keeping.give_back(self._claim)

    def _maintain_connection(self) -> Outcome:
        """Rebuild a lost connection. If the partner refuses an attempt, show the error of the attempt."""
        loss = self._connection.find_loss(self._incarnation) or self._connection.check_loss()
        course = self._env.rules.course
        if loss is not None and loss.fault and loss.kind is LossKind.REFUSED and not course.silent_connect:
            self._keeps = False
            self._connection.disconnect()
            return Outcome(
                course.set_up_condition(SetUpStage.CONNECT, loss.fault.error), loss_cause(loss, self.job)
            )
        if self._connection.is_up:
            self._incarnation = self._connection.incarnation
        else:
            self._connection.step(self._env.scan, self._env.now)
        return _KEEPING if self._connection.is_up else _REBUILDING


_BUILDING = Outcome(Condition.RUNNING, Cause(CauseKind.WAITING, "no partner yet"))
_KEEPING = Outcome(Condition.NO_JOB, Cause(CauseKind.WAITING, "established; REQ has not risen", pin="REQ"))
_REBUILDING = Outcome(
    Condition.NO_JOB,
    Cause(CauseKind.WAITING, "the lost connection is being rebuilt; REQ has not risen", pin="REQ"),
)

STILL_BUILDING: Final = Cause(CauseKind.OTHER_BLOCK, "the connection is still being built")


class SingleScriptedBlock(ScriptedBlock):
    """An instruction without bytes: 7000, then from an edge of REQ on 7001, 7002, 0000 with DONE."""

    def __init__(self, bound: ConnectBinding) -> None:
        super().__init__()
        self._connection = bound.connection

    def call(self, inputs: Inputs) -> Outcome:
        rose, self._req = inputs.req and not self._req, inputs.req
        if self._script:
            return self._advance()
        return self._begin() if rose else IDLE

    def _begin(self) -> Outcome:
        self._script.extend([Outcome(Condition.RUNNING, REQ_ROSE), Outcome(Condition.FINISHED, REQ_ROSE)])
        return Outcome(Condition.STARTED, REQ_ROSE)

    def _advance(self) -> Outcome:
        return self._script.popleft()


class SingleTdiscon(SingleScriptedBlock):
    """One TDISCON instance. It shows 80A3 without a connection to close, 80C4 during its first set-up."""

    def _advance(self) -> Outcome:
        shown = super()._advance()
        self._connection.set_up.is_closing = bool(self._script)
        return shown

    def stop(self, reason: str) -> None:
        super().stop(reason)
        self._connection.set_up.is_closing = False

    def detach(self, reason: str) -> None:
        self.stop(reason)

    def _begin(self) -> Outcome:
        if self._connection.state is State.CLOSED:
            return Outcome(Condition.ENDPOINT_GONE, NO_ENDPOINT)
        set_up = self._connection.set_up
        if not set_up.has_been_up:  # this ends its TCON; a _C block continues
            set_up.is_withdrawn = True
            return Outcome(Condition.NOT_NOW, STILL_BUILDING)
        fault = self._connection.queue_job()
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of_fault(fault))
        ended = disconnect(self._connection, REQ_ROSE)
        if ended[0].error:
            return ended[0]
        set_up.is_closing = True
        return super()._begin()


class SingleTReset(SingleScriptedBlock):
    """One T_RESET instance; 0001 with DONE if no connection is established. The endpoint stays."""

    def _begin(self) -> Outcome:
        if self._connection.state is State.CLOSED:
            return Outcome(Condition.ENDPOINT_GONE, NO_ENDPOINT)
        if not self._connection.is_up:
            return Outcome(Condition.NOTHING_TO_RESET, REQ_ROSE)
        fault = self._connection.queue_job()
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of_fault(fault))
        ended = reset(self._connection, REQ_ROSE, (Condition.STARTED,))
        return ended[0] if ended[0].error else super()._begin()


# InterfaceId, ID, ConnectionType, ActiveEstablished, State, Kind, SentBytes, ReceivedBytes.
RESULT_LAYOUT: Final = struct.Struct(">HHBBBBII")  # this order is ours
DEFAULT_INTERFACE_ID: Final = 64  # the usual hardware identifier of a CPU's port
DEFAULT_ID: Final = 1
TCP_TYPE: Final = 11
KIND_PROGRAMMED: Final = 3
STATE_DOWN, STATE_TRYING, STATE_WAITING, STATE_ESTABLISHED = 1, 2, 3, 4  # STEP 7 help, T_DIAG
COUNTER_MASK: Final = 0xFFFFFFFF  # UDINT: it begins again at 0


class TDiag(SingleScriptedBlock):
    """One T_DIAG instance; RESULT is written with DONE."""

    def __init__(self, bound: ConnectBinding) -> None:
        super().__init__(bound)
        self._result = bound.data
        self._shape: tuple[str, int] | None = None

    def _begin(self) -> Outcome:
        if self._result is None or self._result.size < RESULT_LAYOUT.size:
            have = self._result.size if self._result is not None else 0
            need = RESULT_LAYOUT.size
            short = Cause(CauseKind.PARAMETER, "RESULT is too small", pin="RESULT", have=have, need=need)
            return Outcome(Condition.RESULT_WRONG, short)
        if self._connection.state is State.CLOSED:
            return Outcome(Condition.ENDPOINT_GONE, NO_ENDPOINT)
        self._shape = self._result.shape
        return super()._begin()

    def _advance(self) -> Outcome:
        assert self._result is not None
        if self._result.shape != self._shape:
            self._script.clear()
            return changed_outcome("RESULT")
        shown = super()._advance()
        if shown.condition is Condition.FINISHED:
            self._result.write(0, _pack_result(self._connection))
        return shown


def _pack_result(connection: Connection) -> bytes:
    return RESULT_LAYOUT.pack(
        *_identity_fields(connection.config.description),
        connection.config.active,
        _diag_state(connection),
        KIND_PROGRAMMED,
        connection.bytes_sent & COUNTER_MASK,
        connection.bytes_received & COUNTER_MASK,
    )


def _identity_fields(description: Description | None) -> tuple[int, int, int]:
    if description is None:
        return DEFAULT_INTERFACE_ID, DEFAULT_ID, TCP_TYPE
    number = description.number
    return (
        number("InterfaceId") or DEFAULT_INTERFACE_ID,
        number("ID") or number("id"),
        number("ConnectionType") or number("connection_type"),
    )


def _diag_state(connection: Connection) -> int:
    if connection.is_up:
        return STATE_ESTABLISHED
    if connection.state is State.CONNECTED:
        return STATE_DOWN  # lost, but a receiver still reads earlier bytes
    return STATE_TRYING if connection.config.active else STATE_WAITING
