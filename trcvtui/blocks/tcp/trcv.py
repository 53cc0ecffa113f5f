"""TRCV: receive on a connection that another block has built (manual 7.15.9)."""

from __future__ import annotations

from dataclasses import replace

from trcvtui.blocks.block import Binding
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.tcp.known_connection import CONNECTED, NO_LINK, LinkView
from trcvtui.blocks.tcp.not_connected import not_connected
from trcvtui.blocks.tcp.receive_job import ReceiveJob
from trcvtui.blocks.tcp.trcv_c import READY
from trcvtui.net.connection.connection import ConnectionLoss


class Trcv:
    """One TRCV instance."""

    def __init__(self, bound: Binding) -> None:
        self.job = ReceiveJob(bound)
        self._connection = bound.connection
        self._link = LinkView(bound.connection)
        self._complaint: Outcome | None = None

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7004, 7006, 7008; EN_R without a connection is 80A1 in each scan (design 6)."""
        if not inputs.en_r:
            self.job.abandon("EN_R fell")
            self.job.let_go()
        loss = self._link.lost(self.job.claim)
        if loss is not None:
            return self._lost(loss)
        shown = self._link.next_shown()
        if shown is not None:
            return shown
        if self._link.is_new(self.job.claim):
            return CONNECTED
        if self._link.is_known():
            return self._receive(inputs)
        if not inputs.en_r:
            return NO_LINK
        return self._not_connected()

    def would_read(self, inputs: Inputs, waits: bool) -> bool:
        """Return whether this instance receives on the connection when its turn comes; see `Reader`."""
        return self.job.would_read(inputs, waits)

    def stop(self, reason: str) -> None:
        """Drop the running job."""
        self.job.abandon(reason)

    def leave(self, reason: str) -> None:
        """Be gone; the connection stays as it is."""
        self.job.leave(reason)

    def _not_connected(self) -> Outcome:
        """Return 80A1: the same object as long as the same partner is missing."""
        now = not_connected("EN_R", "EN_R is 1 without a connection", self._connection)
        if self._complaint is None or self._complaint.cause != now.cause:
            self._complaint = replace(now, lasts=True)
        return self._complaint

    def _receive(self, inputs: Inputs) -> Outcome:
        got = self.job.call(inputs) if inputs.en_r else self.job.check_loss() or READY
        return got if isinstance(got, Outcome) else self._lost(got)

    def _lost(self, loss: ConnectionLoss) -> Outcome:
        return self._link.end(self.job.shown(loss))
