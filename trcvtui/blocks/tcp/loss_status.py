"""What a lost connection shows: which codes, one scan each (design 6, rows 7 to 10, 22, 23)."""

from __future__ import annotations

from trcvtui.blocks.block import Job
from trcvtui.blocks.cause import Cause, Why, cause_of
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Outcome
from trcvtui.blocks.rules import Rules
from trcvtui.net.connection.connection import ConnectionLoss, LossKind
from trcvtui.net.connection.set_up import SetUpStage

_FIN_CALL = {LossKind.CLOSED_BY_PARTNER: "recv"}  # it answered 0 bytes: no errno

_LOSS_NAMES = {
    LossKind.CLOSED_BY_PARTNER: "the partner closed",
    LossKind.RESET_BY_PARTNER: "the partner reset",
    LossKind.REFUSED: "the partner refused us at the end of the handshake",
    LossKind.LINK_DEAD: "the link is dead",
    LossKind.FAILED: "the connection failed",
    LossKind.OURS: "closed on our side",
}


def shown(
    loss: ConnectionLoss, rules: Rules, job: Job, failed: Condition | None, short_frame: bool = False
) -> list[Outcome]:
    """Return the outcomes of a loss, one a scan.

    `failed` is the condition of a job that the connection's failure ends, None: there is no job.
    """
    cause = loss_cause(loss, job)
    conditions = _conditions(loss, rules, failed)
    if short_frame and rules.short_frame_shown and conditions == [Condition.PARTNER_CLOSED]:
        conditions.insert(0, Condition.SHORT_FRAME)
    outcomes = [Outcome(condition, cause) for condition in conditions]
    if loss.release_fault is not None:
        outcomes[-1:] = [Outcome(Condition.POLL_DEL_FAILED, cause_of(loss.release_fault, loss.peer))]
    return outcomes


def _conditions(loss: ConnectionLoss, rules: Rules, failed: Condition | None) -> list[Condition]:
    course, kind = rules.course, loss.kind
    if kind is LossKind.REFUSED and loss.fault is not None:
        return [course.of_set_up(SetUpStage.CONNECT, loss.fault.error)]  # as an attempt that failed
    if kind is LossKind.OURS:
        return list(course.let_go)
    if failed is None:
        idle = Condition.LINK_DEAD if kind is LossKind.LINK_DEAD else None
        return [found for found in (course.idle_loss or idle,) if found]
    if kind is LossKind.RESET_BY_PARTNER and rules.reset_counts_as_close:
        kind = LossKind.CLOSED_BY_PARTNER
    ends = course.job_loss.get(kind, failed)
    return [Condition.CLOSING, ends] if course.teardown else [ends]


def loss_cause(loss: ConnectionLoss, job: Job) -> Cause:
    """Return the evidence of a loss: the call that told of it, and how far the job was."""
    fault = loss.fault
    return Cause(
        Why.OTHER_BLOCK if loss.kind is LossKind.OURS else Why.PARTNER if fault is None else Why.KERNEL,
        _LOSS_NAMES[loss.kind],
        call=fault.call if fault else _FIN_CALL.get(loss.kind, ""),
        error=fault.error if fault else "",
        injected=fault.injected if fault else False,
        peer=loss.peer,
        have=job.have if job.running else None,
        need=job.need if job.running else None,
    )
