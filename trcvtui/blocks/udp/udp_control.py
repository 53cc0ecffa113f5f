"""What CONT does to a UDP_CONFIG, scan by scan: the part that USEND_C and URECV_C share.

Rule 1: there is no connection, so "socket created" is the ready state (manual 7.15.14, 7.15.15).
Rule 2: inputs are judged before the network is looked at; what shows for one scan stands in `_script`.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from trcvtui.blocks.cause import Cause, Why, cause_of
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import Environment
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.status_sequence import PLAIN_SET_UP
from trcvtui.blocks.table import BlockRow
from trcvtui.net.connection.config import RemoteAddress
from trcvtui.net.connection.resources import Claim
from trcvtui.net.connection.set_up import StepFault
from trcvtui.net.connection.udp import UdpEndpoint


@dataclass(frozen=True, slots=True)
class UdpBinding:
    """CONFIG, ADDR and DATA of one instance. `data` None: the pin is open; `priority` is that of its task."""

    env: Environment
    port: UdpEndpoint
    address: RemoteAddress
    data: DataArea | None
    instance: str
    priority: int = 1

    def claim(self) -> Claim:
        """Return this instance's claim on one direction of its UDP_CONFIG."""
        return Claim(self.instance, None if self.env.rules.lock_across_tasks else self.priority)

    def class_of(self, row: BlockRow) -> str:
        """Return the class of a block on a UDP_CONFIG."""
        return row.on_config


class UdpPart:
    """Show a socket's life on STATUS; `call` answers None when the job may decide."""

    def __init__(self, env: Environment, port: UdpEndpoint) -> None:
        self.cont = False
        self.waits = 0  # how many scans of "creating" have been shown since creating began
        self._env = env
        self._port = port
        self._incarnation = 0  # of the socket that this block works on, 0: of none
        self._held_back: Outcome | None = None
        self._script: deque[Outcome] = deque()
        self._is_late = False  # CONT rose while a close was still shown

    def call(self, cont: bool) -> Outcome | None:
        """Answer for this scan, or None while the socket is there."""
        rose, fell = cont and not self.cont, self.cont and not cont
        self.cont = cont
        if fell and not self._is_late:
            return self._close()
        if self._script:  # a close that has begun ends first (row 26)
            self._is_late = cont
            return self._script.popleft()
        if cont and (rose or self._is_late):
            return self._start()
        self._is_late = False
        return self._hold() if cont else NO_JOB

    def _start(self) -> Outcome:
        self._is_late = False
        if self._port.is_open:
            return self._ready("another block has created the socket")
        self.waits = 1
        return Outcome(Condition.CREATING, Cause(Why.INPUT, "CONT rose", pin="CONT", value=1))

    def _hold(self) -> Outcome | None:
        if self._incarnation and self._is_there():
            held, self._held_back = self._held_back, None
            return held
        if self._incarnation:
            self._incarnation, self._held_back, self.waits = 0, None, 1
            return _CLOSED_BY_ANOTHER
        failed = self._port.step(self._env.scan, self._env.now)
        if failed is not None:
            return _failed(failed)
        if self._port.is_open:
            return self._ready("the socket is there")
        self.waits += 1
        return _WAITING

    def _is_there(self) -> bool:
        return self._port.is_open and self._port.incarnation == self._incarnation

    def _ready(self, reason: str) -> Outcome:
        self._incarnation = self._port.incarnation
        return Outcome(Condition.CREATED, Cause(Why.SEQUENCE, reason, detail=f"at {self._port.local}"))

    def hold_back(self, outcome: Outcome) -> None:
        """Show the first "created" one scan later: another code takes this scan."""
        if outcome.condition is Condition.CREATED:
            self._held_back = outcome

    def _close(self) -> Outcome:
        was_there = self._incarnation != 0 and self._is_there()
        self._incarnation, self._held_back = 0, None
        self._script.clear()
        fault = self._port.close()
        if fault is not None:
            failed = Condition.POLL_DEL_FAILED if fault.call == "poll_del" else Condition.DISCONNECT_FAILED
            return Outcome(failed, cause_of(fault))
        cause = Cause(Why.INPUT, "CONT fell", pin="CONT", value=0)
        if was_there:
            self._script.append(Outcome(Condition.CLOSED, cause))
        return Outcome(Condition.CLOSING, cause)


def _failed(failed: StepFault) -> Outcome:
    return Outcome(PLAIN_SET_UP[failed.stage, ""], cause_of(failed.fault))


NO_JOB = Outcome(Condition.NO_JOB, Cause(Why.INPUT, "CONT is 0", pin="CONT", value=0), lasts=True)
_WAITING = Outcome(Condition.CREATING, Cause(Why.WAITING, "before the next attempt"))
_CLOSED_BY_ANOTHER = Outcome(
    Condition.CREATING, Cause(Why.OTHER_BLOCK, "another block has closed the socket; it is made anew")
)
