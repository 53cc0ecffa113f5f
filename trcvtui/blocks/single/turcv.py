"""TURCV: one datagram a job, job after job as long as EN_R is 1 (siemens.md 1.10, 2.7).

The UDP_CONFIG stands for a connection that the CPU has established: its socket opens with the first call.
"""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.single.steps import no_socket, shown_as
from trcvtui.blocks.tcp.addressed import wrong_structure
from trcvtui.blocks.udp.udp_control import UdpBinding
from trcvtui.blocks.udp.urecv_c import DatagramIn


class Turcv:
    """One TURCV instance."""

    def __init__(self, bound: UdpBinding) -> None:
        self.job = DatagramIn(bound)
        self._env = bound.env
        self._port = bound.port
        self._unfit = wrong_structure(bound.address)
        self._course = bound.env.rules.course

    def call(self, inputs: Inputs) -> Outcome:
        """Answer one call: 7000, 7001, 7002, 0000 with NDR; without a socket 80A1."""
        self._port.step(self._env.scan, self._env.now)
        if not inputs.en_r and not (self.job.running and self._course.outlives_en_r(self.job.have > 0)):
            self.job.abandon("EN_R fell")
            self.job.let_go()
            return _IDLE
        if not self._port.is_open:
            return no_socket(self._port, "EN_R", "EN_R is 1 without a socket")
        was_running = self.job.running
        got = self._unfit or self.job.call(inputs.len)
        if got.condition is not Condition.RECEIVING:
            return got
        return shown_as(Condition.RUNNING if was_running else Condition.STARTED, got)

    def stop(self, reason: str) -> None:
        """Drop the running job."""
        self.job.abandon(reason)

    def leave(self, reason: str) -> None:
        """Be gone; the socket stays as it is."""
        self.job.leave(reason)


_IDLE: Final = Outcome(Condition.NO_JOB, Cause(Why.INPUT, "EN_R is 0", pin="EN_R", value=0))
