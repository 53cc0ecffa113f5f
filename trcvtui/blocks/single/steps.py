"""What every single instruction shows around its job: idle, started, running, finished (siemens.md 1.10)."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Final

from trcvtui.blocks.block import Job
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, Outcome, Why, cause_of
from trcvtui.blocks.rules import StatusSequence
from trcvtui.blocks.tcp.no_connection import loss_cause
from trcvtui.net.connection.connection import ConnectionLoss, LossKind
from trcvtui.net.connection.udp import UdpEndpoint
from trcvtui.net.results import Fault

IDLE: Final = Outcome(Condition.NO_JOB, Cause(Why.WAITING, "REQ has not risen", pin="REQ"), stable=True)
REQ_ROSE: Final = Cause(Why.INPUT, "REQ rose", pin="REQ", value=1)
NO_ENDPOINT: Final = Cause(Why.INPUT, "REQ rose where no such connection is", pin="REQ", value=1)


def no_socket(port: UdpEndpoint, pin: str, asked: str) -> Outcome:
    """Return why nothing moves on a UDP_CONFIG: what failed when its socket was to be made, if anything."""
    return _no_socket(port.failure, pin, asked)


@lru_cache(64)
def _no_socket(fault: Fault | None, pin: str, asked: str) -> Outcome:
    if fault is None:
        return Outcome(Condition.NOT_CONNECTED, Cause(Why.INPUT, asked, pin=pin, value=1))
    return Outcome(Condition.NOT_CONNECTED, replace(cause_of(fault), detail=asked))


@lru_cache(1024)
def shown_as(condition: Condition, outcome: Outcome) -> Outcome:
    """Return the same outcome under another condition; "started" is for one scan, whatever it waits for."""
    return replace(outcome, condition=condition, stable=outcome.stable and condition is not Condition.STARTED)


def end_of_job(loss: ConnectionLoss, job: Job, course: StatusSequence, failed: Condition) -> Outcome:
    """Return what ends a job whose connection is gone; a connection that we have closed is no longer up."""
    if loss.kind is LossKind.OURS:
        return Outcome(Condition.NOT_CONNECTED, loss_cause(loss, job))
    return Outcome(course.job_loss.get(loss.kind, failed), loss_cause(loss, job))
