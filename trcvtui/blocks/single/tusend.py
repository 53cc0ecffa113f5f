"""TUSEND: one datagram for each rising edge of REQ (siemens.md 1.10, 2.7).

The UDP_CONFIG stands for a connection that the CPU has established: its socket opens with the first call.
"""

from __future__ import annotations

from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.single.steps import IDLE, no_socket, shown_as
from trcvtui.blocks.tcp.addressed import no_target
from trcvtui.blocks.udp.udp_control import UdpBinding
from trcvtui.blocks.udp.usend_c import DatagramOut


class Tusend:
    """One TUSEND instance."""

    def __init__(self, bound: UdpBinding) -> None:
        self.job = DatagramOut(bound)
        self._env = bound.env
        self._port = bound.port
        self._address = bound.address
        self._req = False

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7000, 7001, 0000 with DONE; an edge without a socket is 80A1."""
        rose, self._req = inputs.req and not self._req, inputs.req
        self._port.step(self._env.scan, self._env.now)
        if self.job.running:
            return self.job.go_on()
        if not rose:
            return IDLE if self._port.is_open else _NO_SOCKET
        return self._begin(inputs.len)

    def stop(self, reason: str) -> None:
        """Drop the running job."""
        self.job.abandon(reason)

    def leave(self, reason: str) -> None:
        """Be gone; the socket stays as it is."""
        self.job.leave(reason)

    def _begin(self, length: int) -> Outcome:
        if not self._port.is_open:
            return no_socket(self._port, "REQ", "REQ rose without a socket")
        began = no_target(self._address) or self.job.begin(length)
        return shown_as(Condition.STARTED, began) if began.condition is Condition.SENDING else began


_NO_SOCKET = Outcome(Condition.NO_JOB, Cause(Why.WAITING, "REQ has not risen", pin="REQ"))
