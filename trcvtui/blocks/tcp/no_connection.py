"""What a block shows without a connection: a loss, 80A1, or NO_JOB if another block builds it."""

from __future__ import annotations

from collections import deque

from msgspec.structs import replace

from trcvtui.blocks.block import Job
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, CauseKind, Outcome, cause_of_fault
from trcvtui.blocks.pins import Inputs
from trcvtui.blocks.rules import NotConnectedRule, VendorRules
from trcvtui.net.connection.connection import LOSS_REASONS, Connection, ConnectionLoss, LossKind
from trcvtui.net.connection.resources import Claim
from trcvtui.net.connection.set_up import SetUpStage

_FIN_CALL = {LossKind.CLOSED_BY_PARTNER: "recv"}  # it answered 0 bytes: no errno

_LOSS_NAMES = {
    **LOSS_REASONS,
    LossKind.CLOSED_BY_PARTNER: "the partner closed",
    LossKind.RESET_BY_PARTNER: "the partner reset",
}


def loss_walk(
    loss: ConnectionLoss, rules: VendorRules, job: Job, failed: Condition | None, short_frame: bool = False
) -> list[Outcome]:
    """Return the outcomes of a loss, one for each scan.

    `failed` is the condition of a job that the loss ends, or None without a job.
    """
    cause = loss_cause(loss, job)
    conditions = _loss_conditions(loss, rules, failed)
    if short_frame and rules.short_frame_shown and conditions == [Condition.PARTNER_CLOSED]:
        conditions.insert(0, Condition.SHORT_FRAME)  # 7.15.1: 80A6, then 80C5
    outcomes = [Outcome(condition, cause) for condition in conditions]
    if loss.release_fault is not None:
        outcomes[-1:] = [Outcome(Condition.POLL_DEL_FAILED, cause_of_fault(loss.release_fault, loss.peer))]
    return outcomes


def _loss_conditions(loss: ConnectionLoss, rules: VendorRules, failed: Condition | None) -> list[Condition]:
    course, kind = rules.course, loss.kind
    if kind is LossKind.REFUSED and loss.fault is not None:
        return [course.set_up_condition(SetUpStage.CONNECT, loss.fault.error)]  # as a failed attempt
    if kind is LossKind.OURS:
        return [] if loss.is_played else list(course.let_go)
    if failed is None:  # without a job only a dead link is an ERROR (7.15.1, 80AB)
        idle = Condition.LINK_DEAD if kind is LossKind.LINK_DEAD else None
        return [found for found in (course.idle_loss or idle,) if found]
    if kind is LossKind.RESET_BY_PARTNER and rules.reset_counts_as_close:
        kind = LossKind.CLOSED_BY_PARTNER  # switch reset_is
    ends = course.job_loss.get(kind, failed)
    return [Condition.CLOSING, ends] if course.teardown else [ends]


def loss_cause(loss: ConnectionLoss, job: Job) -> Cause:
    """Return the evidence of a loss: the call that reported the loss, and the progress of the job."""
    fault = loss.fault
    return Cause(
        CauseKind.OTHER_BLOCK
        if loss.kind is LossKind.OURS
        else CauseKind.PARTNER
        if fault is None
        else CauseKind.KERNEL,
        _LOSS_NAMES[loss.kind],
        call=fault.call if fault else _FIN_CALL.get(loss.kind, ""),
        error=fault.error if fault else "",
        injected=fault.injected if fault else False,
        words=fault.words if fault else "",
        peer=loss.peer,
        have=job.have if job.running else None,
        need=job.need if job.running else None,
    )


# A request keeps its 80A1 while another code has to show, and shows it in the first scan that is free.


def not_connected(pin: str, name: str, connection: Connection) -> Outcome:
    """Return the outcome of a request without a connection."""
    remote = str(connection.set_up.remote or "")
    return Outcome(Condition.NOT_CONNECTED, Cause(CauseKind.INPUT, name, pin=pin, value=1, peer=remote))


class StandingRequest:
    """EN_R of a block that builds its connection. An edge of EN_R or CONT lets 80A1 show in one scan."""

    def __init__(self, rule: NotConnectedRule) -> None:
        self._rule = rule
        self._en_r = False
        self._armed = False

    def update(self, inputs: Inputs, cont_rose: bool) -> None:
        en_r_rose = inputs.en_r and not self._en_r
        self._en_r = inputs.en_r
        if not (inputs.en_r and inputs.cont):
            self._armed = False
        elif en_r_rose or cont_rose:
            self._armed = True

    def forget_edge(self) -> None:
        """Forget the edge: the connection is up, and a later loss or reset does not arm 80A1 again."""
        self._armed = False

    def use_edge(self) -> bool:
        """Return whether 80A1 shows in this scan; with PULSE, 80A1 shows once per edge (7.15.1)."""
        shows = self._en_r and (
            self._rule is NotConnectedRule.HOLD or (self._rule is NotConnectedRule.PULSE and self._armed)
        )
        if shows:
            self._armed = False
        return shows


class KnownIncarnation:
    """Which incarnation of its connection a block knows, and the outcomes of a loss for later scans."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._incarnation = 0
        self._script: deque[Outcome] = deque()

    def next_outcome(self) -> Outcome | None:
        """Take the outcome that an earlier loss shows in this scan. Return None if none is left."""
        return self._script.popleft() if self._script else None

    def find_loss(self, claim: Claim | None = None) -> ConnectionLoss | None:
        """Return how the incarnation that this block knows has ended, None while it is up."""
        return self._connection.find_loss(self._incarnation, claim) if self._incarnation else None

    def adopt_new(self, claim: Claim) -> bool:
        """Adopt a connection that is up and new to this block; return whether it did so."""
        if self._incarnation == self._connection.incarnation or not self._connection.is_up_for(claim):
            return False
        self._incarnation = self._connection.incarnation
        return True

    def has_incarnation(self) -> bool:
        return self._incarnation != 0

    def end_incarnation(self, shown: list[Outcome]) -> Outcome:
        """Forget the incarnation. Return the first outcome of `shown`; the others show in later scans."""
        self._incarnation = 0
        self._script = deque(shown)
        return self._script.popleft() if self._script else _GONE


CONNECTED = Outcome(Condition.CONNECTED, Cause(CauseKind.PARTNER, "a connection is up"))
_GONE = Outcome(Condition.NO_JOB, Cause(CauseKind.WAITING, "no connection, and this block builds none"))
NO_LINK = replace(_GONE, stable=True)  # the scan of a loss is not: with EN_R = 1 the next one shows 80A1
