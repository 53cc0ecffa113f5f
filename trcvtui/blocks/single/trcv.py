"""TRCV as a single instruction: job after job as long as EN_R is 1 (siemens.md 1.10, 2.5)."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from trcvtui.blocks.block import Binding
from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.single.steps import end_of_job, shown_as
from trcvtui.blocks.tcp.fault_repeat import ToldOnce
from trcvtui.blocks.tcp.known_connection import LinkView
from trcvtui.blocks.tcp.not_connected import not_connected
from trcvtui.blocks.tcp.receive_job import ReceiveJob
from trcvtui.net.connection.connection import ConnectionLoss, State


class Trcv:
    """One TRCV instance."""

    needs_datagrams = False

    def __init__(self, bound: Binding) -> None:
        self.job = ReceiveJob(bound, self.needs_datagrams)
        self._course = bound.env.rules.course
        self._connection = bound.connection
        self._link = LinkView(bound.connection)
        self._complaint: Outcome | None = None
        self._told = ToldOnce(self._course.faults_once, Condition.NO_JOB)

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7000, 7001, 7002, 0000 with NDR; without a connection 80A1 or 80C4."""
        loss = self._link.lost(self.job.claim)
        if loss is not None and self.job.running:
            return self._lost(loss)
        if loss is not None:
            self._link.end([])  # nobody was asked to receive
        self._link.is_new(self.job.claim)
        if not inputs.en_r and not self.job.outlives_en_r():
            self.job.abandon("EN_R fell")
            self.job.let_go()
            self._told.forget()
            return _IDLE
        shown = self._receive(inputs) if self._link.is_known() else self._no_link()
        return self._told.shown(shown, inputs)

    def would_read(self, inputs: Inputs, waits: bool) -> bool:
        """Return whether this instance receives on the connection when its turn comes; see `Reader`."""
        return self.job.would_read(inputs, waits)

    def stop(self, reason: str) -> None:
        """Drop the running job."""
        self.job.abandon(reason)

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""
        self.job.leave(reason)

    def _receive(self, inputs: Inputs) -> Outcome:
        was_running = self.job.running
        got = self.job.call(inputs)
        if isinstance(got, ConnectionLoss):
            return self._lost(got)
        if got.condition not in (Condition.RECEIVING, Condition.RECEIVING_PART):
            return got
        return shown_as(Condition.RUNNING if was_running else Condition.STARTED, got)

    def _lost(self, loss: ConnectionLoss) -> Outcome:
        self._link.end([])
        shown = end_of_job(loss, self.job, self._course, Condition.RECEIVE_FAILED)
        self.job.abandon("connection lost")
        return shown

    def _no_link(self) -> Outcome:
        """Return 80A1, or 80C4 while somebody builds the connection again."""
        now = not_connected("EN_R", "EN_R is 1 without a connection", self._connection)
        if self._connection.state is not State.CLOSED and self._course.still_asked:
            now = replace(now, condition=self._course.still_asked)
        known = self._complaint
        if known is None or (known.cause, known.condition) != (now.cause, now.condition):
            self._complaint = known = replace(now, lasts=True)
        return known


class DatagramTrcv(Trcv):
    """One TURCV instance on a CONNECT of UDP."""

    needs_datagrams = True


_IDLE: Final = Outcome(Condition.NO_JOB, Cause(Why.INPUT, "EN_R is 0", pin="EN_R", value=0), lasts=True)
