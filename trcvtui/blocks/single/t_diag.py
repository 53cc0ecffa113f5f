"""T_DIAG: read how a connection stands into RESULT, a TDiag_Status (siemens.md 1.10, 2.6)."""

from __future__ import annotations

import struct
from collections import deque
from typing import Final

from trcvtui.blocks.block import Binding, NoJob
from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.single.steps import IDLE, NO_ENDPOINT, REQ_ROSE
from trcvtui.blocks.tcp.job_checks import changed
from trcvtui.net.connection.connection import Connection, State
from trcvtui.net.connection.description import Description

# InterfaceId, ID, ConnectionType, ActiveEstablished, State, Kind, SentBytes, ReceivedBytes.
STATUS: Final = struct.Struct(">HHBBBBII")
INTERFACE: Final = 64  # the usual hardware identifier of a CPU's port
FIRST_ID: Final = 1
TCP: Final = 11
PROGRAMMED: Final = 3
DOWN, TRYING, WAITING, ESTABLISHED = 1, 2, 3, 4
COUNTER: Final = 0xFFFFFFFF


class TDiag:
    """One T_DIAG instance."""

    def __init__(self, bound: Binding) -> None:
        self.job = NoJob()
        self._connection = bound.connection
        self._result = bound.data
        self._shape: tuple[str, int] | None = None
        self._req = False
        self._script: deque[Outcome] = deque()

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7000, 7001, 7002, 0000 with DONE; RESULT is written with DONE."""
        rose, self._req = inputs.req and not self._req, inputs.req
        if self._script:
            return self._go_on()
        return self._begin() if rose else IDLE

    def stop(self, reason: str) -> None:
        """Forget what was still to be shown."""
        self._script.clear()

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""

    def _begin(self) -> Outcome:
        if self._result is None or self._result.size < STATUS.size:
            have = self._result.size if self._result is not None else 0
            short = Cause(Why.PARAMETER, "RESULT is too small", pin="RESULT", have=have, need=STATUS.size)
            return Outcome(Condition.RESULT_WRONG, short)
        if self._connection.state is State.CLOSED:
            return Outcome(Condition.ENDPOINT_GONE, NO_ENDPOINT)
        self._shape = self._result.shape
        self._script.extend([Outcome(Condition.RUNNING, REQ_ROSE), Outcome(Condition.FINISHED, REQ_ROSE)])
        return Outcome(Condition.STARTED, REQ_ROSE)

    def _go_on(self) -> Outcome:
        assert self._result is not None
        if self._result.shape != self._shape:
            self._script.clear()
            return changed("RESULT")
        shown = self._script.popleft()
        if shown.condition is Condition.FINISHED:
            self._result.write(0, _status(self._connection))
        return shown


def _status(connection: Connection) -> bytes:
    return STATUS.pack(
        *_described(connection.config.description),
        connection.config.active,
        _state(connection),
        PROGRAMMED,
        connection.bytes_sent & COUNTER,
        connection.bytes_received & COUNTER,
    )


def _described(description: Description | None) -> tuple[int, int, int]:
    """Return InterfaceId, ID and ConnectionType; a CONNECT that is no description is the first of TCP."""
    if description is None:
        return INTERFACE, FIRST_ID, TCP
    number = description.number
    return (
        number("InterfaceId") or INTERFACE,
        number("ID") or number("id"),
        number("ConnectionType") or number("connection_type"),
    )


def _state(connection: Connection) -> int:
    if connection.is_up:
        return ESTABLISHED
    if connection.state is State.CONNECTED:
        return DOWN  # lost, and somebody still reads what came before
    return TRYING if connection.config.active else WAITING
