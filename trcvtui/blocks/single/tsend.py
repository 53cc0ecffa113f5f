"""TSEND as a single instruction: one job for each rising edge of REQ (siemens.md 1.10, 2.4)."""

from __future__ import annotations

from trcvtui.blocks.block import Binding
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.single.steps import IDLE, end_of_job, shown_as
from trcvtui.blocks.tcp.known_connection import LinkView
from trcvtui.blocks.tcp.not_connected import not_connected
from trcvtui.blocks.tcp.send_job import SendJob
from trcvtui.net.connection.connection import ConnectionLoss


class Tsend:
    """One TSEND instance."""

    needs_datagrams = False

    def __init__(self, bound: Binding) -> None:
        self.job = SendJob(bound, self.needs_datagrams)
        self._course = bound.env.rules.course
        self._connection = bound.connection
        self._link = LinkView(bound.connection)
        self._req = False

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7000, 7001, 7002, 0000 with DONE; an edge without a connection is 80A1."""
        rose, self._req = inputs.req and not self._req, inputs.req
        loss = self._link.lost()
        if loss is not None and self.job.running:
            return self._lost(loss)
        if loss is not None:
            self._link.end([])  # nobody was asked to send
        self._link.is_new(self.job.claim)
        if self.job.running:
            return self._shown(self.job.go_on(), Condition.RUNNING)
        if not rose:
            return IDLE
        if not self._link.is_known():
            return not_connected("REQ", "REQ rose without a connection", self._connection)
        return self._shown(self.job.begin(inputs), Condition.STARTED)

    def stop(self, reason: str) -> None:
        """Drop the running job."""
        self.job.abandon(reason)

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""
        self.job.leave(reason)

    def _shown(self, got: Outcome | ConnectionLoss, sending: Condition) -> Outcome:
        if isinstance(got, ConnectionLoss):
            return self._lost(got)
        return shown_as(sending, got) if got.condition is Condition.SENDING else got

    def _lost(self, loss: ConnectionLoss) -> Outcome:
        self._link.end([])
        shown = end_of_job(loss, self.job, self._course, Condition.SEND_FAILED)
        self.job.abandon("connection lost")
        return shown


class DatagramTsend(Tsend):
    """One TUSEND instance on a CONNECT of UDP."""

    needs_datagrams = True
