"""TSEND: send on a connection that another block has built (manual 7.15.8)."""

from __future__ import annotations

from trcvtui.blocks.block import Binding
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp.known_connection import NO_LINK, LinkView
from trcvtui.blocks.tcp.not_connected import not_connected
from trcvtui.blocks.tcp.send_job import SendJob
from trcvtui.blocks.tcp.tsend_c import READY
from trcvtui.net.connection.connection import ConnectionLoss


class Tsend:
    """One TSEND instance."""

    def __init__(self, bound: Binding) -> None:
        self.job = SendJob(bound)
        self._connection = bound.connection
        self._link = LinkView(bound.connection)
        self._req = False

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7004, 7005, 7009; an edge without a connection is 80A1."""
        req_rose = inputs.req and not self._req
        self._req = inputs.req
        loss = self._link.lost()
        if loss is not None:
            return self._lost(loss, req_rose)
        shown = self._link.next_shown()
        if shown is not None and not req_rose:
            return shown
        self._link.is_new(self.job.claim)
        if self._link.is_known():
            return self._send(inputs, req_rose)
        return (
            not_connected("REQ", "REQ rose without a connection", self._connection) if req_rose else NO_LINK
        )

    def stop(self, reason: str) -> None:
        """Drop the running job."""
        self.job.abandon(reason)

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""
        self.job.leave(reason)

    def _send(self, inputs: Inputs, req_rose: bool) -> Outcome:
        if self.job.running:
            got = self.job.go_on()
        elif req_rose:
            got = self.job.begin(inputs)
        else:
            got = self.job.check_loss() or READY
        return got if isinstance(got, Outcome) else self._lost(got, req_rose)

    def _lost(self, loss: ConnectionLoss, req_rose: bool) -> Outcome:
        return self._link.end(self.job.shown(loss, asked=req_rose))
