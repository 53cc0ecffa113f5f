"""The interface of every block. A block gets its binding when it is made, and one call a scan."""

from __future__ import annotations

from collections import deque
from importlib import import_module
from typing import Protocol

from msgspec import Struct

from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import Environment
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.table import BlockRow
from trcvtui.net.connection.config import RemoteAddress
from trcvtui.net.connection.connection import Connection
from trcvtui.net.connection.resources import Claim


class JobBinding(Struct, frozen=True):
    """What every job needs. `data` is None if the DATA pin is open. `priority` is the task's priority."""

    env: Environment
    data: DataArea | None
    instance: str
    priority: int

    def make_claim(self) -> Claim:
        return Claim(self.instance, None if self.env.rules.lock_across_tasks else self.priority)


class ConnectBinding(JobBinding, frozen=True):
    """The binding of an instance on a CONNECT. `address` is the value of ADDR, only for datagrams."""

    connection: Connection
    address: RemoteAddress | None = None

    def class_of(self, row: BlockRow) -> str:
        """Return `datagrams` of the row, else `single` if the vendor has single blocks, else `shared`."""
        is_single = bool(row.single) and self.env.rules.single_instructions
        return row.datagrams or (row.single if is_single else row.shared)


class AnyBinding(Protocol):
    """A binding of any kind. `class_of` returns the class of a block for this kind of binding."""

    def class_of(self, row: BlockRow) -> str: ...


class Job(Protocol):
    """A job that has moved `have` of `need` bytes. `last_bytes_at` is when bytes last moved, in ns."""

    @property
    def running(self) -> bool: ...

    @property
    def have(self) -> int: ...

    @property
    def need(self) -> int: ...

    @property
    def adhoc(self) -> bool: ...

    @property
    def last_bytes_at(self) -> int | None: ...

    def received_part(self) -> bytes: ...


class NoJob:
    """The job of a block that moves no bytes."""

    running = False
    have = need = 0
    adhoc = False
    last_bytes_at: int | None = None

    def received_part(self) -> bytes:
        return b""


class StoppableJob(Job, Protocol):
    def abandon(self, reason: str) -> None: ...

    def detach(self, reason: str) -> None: ...


class HasJob(Protocol):
    @property
    def job(self) -> StoppableJob: ...


class JobBlock:
    """A block with a job. The connection outlives the block's instance."""

    def stop(self: HasJob, reason: str) -> None:
        self.job.abandon(reason)

    def detach(self: HasJob, reason: str) -> None:
        self.job.detach(reason)


class JoblessBlock:
    def __init__(self) -> None:
        self.job = NoJob()

    def stop(self, reason: str) -> None: ...

    def detach(self, reason: str) -> None: ...


class ScriptedBlock(JoblessBlock):
    """A block that shows its script, one outcome a call."""

    def __init__(self) -> None:
        super().__init__()
        self._req = False
        self._script: deque[Outcome] = deque()

    def stop(self, reason: str) -> None:
        self._script.clear()


class StoppedBlock(JoblessBlock):
    """The placeholder of a block that an internal error has stopped; no scan calls the placeholder."""

    def call(self, inputs: Inputs) -> Outcome:
        raise NotImplementedError


class Block(Protocol):
    @property
    def job(self) -> Job: ...

    def call(self, inputs: Inputs) -> Outcome: ...

    def stop(self, reason: str) -> None:
        """Drop the running job; the runtime closes the connection (PLC STOP)."""

    def detach(self, reason: str) -> None:
        """End the job of an instance that is deleted or downloaded; the lock of a running job may stay."""


def new_block(row: BlockRow, bound: AnyBinding) -> Block:
    module, _, name = bound.class_of(row).partition(":")
    block: Block = getattr(import_module(module), name)(bound)
    return block
