"""What CONT and COM_RST do to a connection, scan by scan: the part that the _C blocks share."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from enum import Enum, auto
from typing import Final

from msgspec import Struct
from msgspec.structs import replace

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.environment import Environment
from trcvtui.blocks.outcome import Cause, CauseKind, Outcome, cause_of_fault
from trcvtui.blocks.rules import StatusRules
from trcvtui.blocks.tcp.job_checks import find_rival, in_use_cause
from trcvtui.net.connection.connection import Connection, LossKind, State
from trcvtui.net.connection.resources import Claim
from trcvtui.net.connection.set_up import SetUpStage, StepFault
from trcvtui.net.results import Fault

# cont_mode manual: an edge of REQ, EN_R = 1 or CONT = 1 builds a connection, which is kept. When CONT falls
# it ends: at once, or after the job that waits or runs. It also ends after a job for which CONT was 0 at the
# edge of REQ (for TRCV_C: when the connection was begun).


class ConnectionReasons(Struct, frozen=True):
    """Why a connection begins and why it ends, and the outcome without a connection."""

    asked: Cause
    ended: Cause
    idle: Outcome


def _idle_outcome(name: str, pin: str) -> Outcome:
    return Outcome(Condition.NO_JOB, Cause(CauseKind.INPUT, name, pin=pin, value=0), stable=True)


CONT_ROSE: Final = Cause(CauseKind.INPUT, "CONT rose", pin="CONT", value=1)
CONT_FELL: Final = Cause(CauseKind.INPUT, "CONT fell", pin="CONT", value=0)
CONT_IS_0: Final = _idle_outcome("CONT is 0", "CONT")
BY_REQ: Final = ConnectionReasons(
    asked=Cause(CauseKind.INPUT, "REQ rose without a connection", pin="REQ", value=1),
    ended=Cause(CauseKind.INPUT, "CONT was 0 when REQ rose", pin="CONT", value=0),
    idle=_idle_outcome("CONT is 0 and REQ has not risen", "REQ"),
)
BY_EN_R: Final = ConnectionReasons(
    asked=Cause(CauseKind.INPUT, "EN_R is 1 without a connection", pin="EN_R", value=1),
    ended=Cause(CauseKind.INPUT, "CONT was 0 when the connection was begun", pin="CONT", value=0),
    idle=_idle_outcome("CONT and EN_R are 0", "EN_R"),
)


class ConnectionDemand:
    """Whether one instance wants a connection. If `reasons` is None, CONT decides (cont_mode level)."""

    def __init__(self, reasons: ConnectionReasons | None) -> None:
        self.begins, self.ends_by = CONT_ROSE, CONT_FELL
        self.idle = reasons.idle if reasons else CONT_IS_0
        self.is_due = False  # the connection ends as soon as no job needs it
        self._reasons = reasons
        self._is_single = False  # it serves one job: CONT was 0 when it counted
        self._cont = self._is_wanted = False

    def update(self, cont: bool, asks: bool, is_closing: bool) -> bool:
        """Return whether the connection is wanted.

        `asks`: a request waits for the connection, or a job runs. `is_closing`: a close still shows codes.
        """
        if self._reasons is None:
            return cont
        fell, self._cont = self._cont and not cont, cont
        if fell and self._is_wanted:
            self.is_due, self.ends_by = True, CONT_FELL
        if self.is_due and not asks:
            self.is_due = self._is_wanted = False
        elif (cont or asks) and not is_closing and not self._is_wanted:
            self._is_wanted = True
            self.begins = self._reasons.asked if asks else CONT_ROSE
            self.latch_cont(cont)
        return self._is_wanted

    def latch_cont(self, cont: bool) -> None:
        """Latch CONT for the next job."""
        self._is_single = not cont

    def note_job_done(self) -> None:
        """Let the connection end if it was for this job alone."""
        if self._reasons is not None and self._is_single and not self.is_due:
            self.is_due, self.ends_by = True, self._reasons.ended

    def keep_connection(self) -> None:
        """Keep the connection while it is rebuilt. The job whose end would close the connection is gone."""
        self.is_due = self._is_single = False


# disconnect and reset return their outcomes, one a scan; after a failed call its error alone.


def disconnect(connection: Connection, cause: Cause) -> list[Outcome]:
    """Close the connection and the listener; return the outcomes "closing" and "closed by us"."""
    peer = connection.partner
    fault = connection.disconnect()
    if fault is not None:
        return [Outcome(_failure_condition(fault, Condition.DISCONNECT_FAILED), cause_of_fault(fault, peer))]
    return [Outcome(Condition.CLOSING, cause), Outcome(Condition.CLOSED, cause)]


def reset(connection: Connection, cause: Cause, shown: Iterable[Condition]) -> list[Outcome]:
    """Abort the connection with RST, but keep its listener. Return outcomes for `shown`, or one failure."""
    peer = connection.partner
    fault = connection.reset()
    if fault is not None:
        return [Outcome(_failure_condition(fault, Condition.RESET_FAILED), cause_of_fault(fault, peer))]
    return [Outcome(condition, cause) for condition in shown]


def _failure_condition(fault: Fault, otherwise: Condition) -> Condition:
    # 8087, whatever was asked: "poll remove failed" has a code of its own.
    return Condition.POLL_DEL_FAILED if fault.call == "poll_del" else otherwise


# Rule 1: inputs are evaluated before the network.
# Rule 2: outcomes that must show for exactly one scan wait in `_script`; each scan takes one.


class RivalWatch:
    """Looks for rivals: blocks of another priority that keep a block from building its connection."""

    def __init__(self, env: Environment, connection: Connection, claim: Claim) -> None:
        self.rival = ""  # the instance in the way at the last check, "" for none
        self._env = env
        self._connection = connection
        self._claim = claim
        self._again_at = 0

    def check_at_start(self) -> bool:
        """Return whether a rival is in the way as CONT rises; the next check shows the error."""
        rival = find_rival(self._env, self._connection, self._claim)
        self.rival = rival.instance if rival is not None else ""
        self._again_at = self._env.now
        return rival is not None

    def check_again(self) -> Outcome | None:
        """Check again once the retry pause is over; return the error if a rival is in the way."""
        if self._env.now < self._again_at:
            return None
        rival = find_rival(self._env, self._connection, self._claim)
        self.rival = rival.instance if rival is not None else ""
        if rival is None:
            return None
        self._again_at = self._env.now + self._env.rules.policy.retry_ns
        return Outcome(Condition.CONNECT_IN_USE, in_use_cause(rival, self._claim))


class Phase(Enum):
    IDLE = auto()
    STARTING = auto()
    CONNECTING = auto()
    CONNECTED = auto()


class ConnectionControl:
    """Shows the phases of a connection on STATUS. `call` returns None when the job decides what shows."""

    def __init__(
        self,
        env: Environment,
        connection: Connection,
        claim: Claim,
        has_addr: bool = True,
        demand: ConnectionDemand | None = None,
    ) -> None:
        self.phase = Phase.IDLE
        self.incarnation = 0
        self.waits = 0  # scans of 7002 since connecting began
        self._env = env
        self._course = env.rules.course
        self._connection = connection
        self._claim = claim
        self._has_addr = has_addr
        self._asks = False
        self._job_error: Condition | None = None
        self._script: deque[Outcome] = deque()
        self.cont = False
        self._has_begun_anew = False  # CONT has risen, and no connection has been up since
        self._demand = demand or ConnectionDemand(None)
        self._com_rst = False
        self._close_wanted = False
        self._reset_wanted = False
        self._queued = False
        self._connect_in_use = RivalWatch(env, connection, claim)
        self._wait: tuple[tuple[str, str, str, str, bool], Outcome] | None = None

    def is_steady(self) -> bool:
        """Return whether the connection is up, and only the job decides until an input changes."""
        return (
            self.phase is Phase.CONNECTED
            and self._connection.is_up
            and self._connection.incarnation == self.incarnation
            and self.cont
            and not self._reset_wanted
            and not self._script
        )

    @property
    def is_closing(self) -> bool:
        """Return whether codes of a close are still to be shown."""
        return not self.cont and (bool(self._script) or self._close_wanted)

    def call(
        self, cont: bool, com_rst: bool, asks: bool = False, job_error: Condition | None = None
    ) -> Outcome | None:
        """Return the outcome of this scan, or None if the connection is up and the job decides.

        If `asks`, a job waits for the connection. If a job runs, a reset first shows `job_error`.
        """
        self._asks, self._job_error = asks, job_error
        rose, fell = cont and not self.cont, self.cont and not cont
        # COM_RST that rises without a connection has no effect and is not remembered.
        self._reset_wanted |= com_rst and not self._com_rst and self.phase is Phase.CONNECTED
        self.cont, self._com_rst = cont, com_rst
        if fell or (self._close_wanted and not cont):  # rule 1: also before a loss; CONT wins over COM_RST
            return self._close()
        self._has_begun_anew |= rose
        if rose and not self._script:  # else a close that has begun ends first
            return self._start()
        if not cont:
            return self._script.popleft() if self._script else self._demand.idle
        return self._answer_while_wanted()

    def _answer_while_wanted(self) -> Outcome | None:
        reset = self._reset() if self._reset_wanted else None
        if reset is not None:
            return reset
        if self._script and not self._asks and self._script[0].condition is self._course.still_asked:
            self._script.popleft()  # EN_R has fallen: no 80C4
        if self._script:
            return self._script.popleft()
        if self.phase is Phase.IDLE:
            return self._start()
        if self._connect_in_use.rival:
            return self._wait_for_rival()
        if self.phase is Phase.STARTING:
            return self._advance_starting()
        if self.phase is Phase.CONNECTING:
            return self._advance_connecting()
        return None

    # -- CONT rises ---------------------------------------------------------------------------

    def _start(self) -> Outcome:
        self._script.clear()
        self._close_wanted = self._reset_wanted = False
        if self._connect_in_use.check_at_start():
            self.phase, self._queued = Phase.STARTING, False
            return self._creating_outcome()
        self._connection.keeping.hold(self._claim)
        if self._connection.state is not State.CLOSED:  # joins: 7002 and 7004 only
            return self.begin_waiting("another block has opened the connection")
        fault = self._connection.queue_set_up(self._env.now, self._has_addr)
        self.phase, self._queued = Phase.STARTING, fault is None  # 80AC: tried in each scan
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of_fault(fault))
        return self._creating_outcome()

    def _creating_outcome(self) -> Outcome:
        return Outcome(Condition.CREATING, self._demand.begins)

    def _wait_for_rival(self) -> Outcome:
        refused = self._connect_in_use.check_again()
        if refused is not None:
            self._script.extend(self._rebuilding_outcomes(refused.cause))
            return refused
        if self._connect_in_use.rival:
            return self._waiting(
                "before the next attempt", detail=f"CONNECT in use by {self._connect_in_use.rival}"
            )
        begun = self._start()
        return (
            replace(begun, condition=Condition.ESTABLISHING)  # 0001 has shown before
            if begun.condition is Condition.CREATING
            else begun
        )

    def _advance_starting(self) -> Outcome:
        if not self._queued:
            return self._start()
        failed = self._connection.step(self._env.scan, self._env.now)
        if failed is not None:
            return self._show_set_up_failure(failed)
        if self._connection.state is State.CREATED:
            return _CREATED
        return self.begin_waiting("the set-up has begun")

    def _show_set_up_failure(self, failed: StepFault) -> Outcome:
        if self.phase is Phase.STARTING:
            self.phase, self.waits = Phase.CONNECTING, 0
        shown = set_up_failed(self._connection, failed, self._course)
        # 7.15.1, 80AB: "holds it for one cycle, and subsequently stays in the 7002 state".
        is_dead = self._connection.link_is_dead and not self._has_begun_anew
        is_silent = self._course.silent_connect or (self._course.silent_dead_link and is_dead)
        if is_silent and failed.stage is SetUpStage.CONNECT:
            self.waits += 1
            return replace(shown, condition=Condition.ESTABLISHING)
        self._script.extend(self._rebuilding_outcomes(shown.cause))
        return shown

    def _rebuilding_outcomes(self, cause: Cause) -> list[Outcome]:
        return [Outcome(condition, cause) for condition in self._course.rebuilding]

    def _advance_connecting(self) -> Outcome:
        # The block called second in the scan that brings it up sees it one scan later (FAQ, figure 6).
        is_second = self._course.second_lags and self._connection.is_up_for(self._claim)
        failed = self._connection.step(self._env.scan, self._env.now)
        lags = is_second and self._connection.since_scan == self._env.scan
        if self.waits and not lags and self._connection.is_up_for(self._claim):  # after one 7002 or more
            return self._become_connected()
        if failed is not None:
            return self._show_set_up_failure(failed)
        self.waits += 1
        return self._waiting_outcome()

    def _become_connected(self) -> Outcome:
        self.phase, self._has_begun_anew = Phase.CONNECTED, False
        self.incarnation = self._connection.incarnation
        cause = established_cause(self._connection)
        begins = self._course.job_begins if self._asks else self._course.established
        return Outcome(begins or Condition.CONNECTED, cause)

    def first_scan_outcome(self, begun: Outcome, reserved: bool) -> Outcome:
        """Return the first outcome of a connection: `begun` if a job is reserved, else "established"."""
        if reserved:
            return begun
        return replace(begun, condition=self._course.established or Condition.CONNECTED)

    def hold_back(self, outcome: Outcome) -> None:
        """Show the first "connected" one scan later: another code takes this scan."""
        if outcome.condition is Condition.CONNECTED:
            self._script.append(outcome)

    def begin_waiting(self, reason: str) -> Outcome:
        """Show the first scan of "connecting"."""
        self.phase, self.waits = Phase.CONNECTING, 1
        return Outcome(Condition.ESTABLISHING, Cause(CauseKind.SEQUENCE, reason))

    def _waiting_outcome(self) -> Outcome:
        set_up = self._connection.set_up
        if not self._connection.config.active:
            # From the second 7002 on only the poll, or another block, ends this.
            stable = self.waits > 1 and set_up.listener is not None
            return self._waiting("no partner yet", local=str(set_up.listening_end or ""), stable=stable)
        remote = str(set_up.remote or "")
        return self._waiting("before the next attempt" if set_up.attempt is None else "no answer yet", remote)

    def _waiting(
        self, what: str, peer: str = "", detail: str = "", local: str = "", stable: bool = False
    ) -> Outcome:
        now = (what, peer, detail, local, stable)
        if self._wait is None or self._wait[0] != now:
            cause = Cause(CauseKind.WAITING, what, peer=peer, detail=detail, local=local)
            self._wait = now, Outcome(Condition.ESTABLISHING, cause, stable=stable)
        return self._wait[1]

    # -- the connection is gone -----------------------------------------------------------------

    def start_reconnecting(self, shown: Iterable[Outcome], reason: str) -> Outcome:
        """Show these outcomes, one a scan, then connecting; without outcomes, only connecting."""
        self._script = deque(shown)
        if not self._script:
            return self.begin_waiting(reason)
        if self._script[-1].error and self._script[-1].condition is not self._course.still_asked:
            self._script.extend(self._rebuilding_outcomes(self._script[-1].cause))
        self.phase, self.waits = Phase.CONNECTING, 0
        return self._script.popleft()

    # -- CONT falls, COM_RST rises ----------------------------------------------------------------

    def detach(self) -> None:
        self._connection.keeping.give_back(self._claim)

    def _close(self) -> Outcome:
        self._script.clear()
        self._reset_wanted = False
        if not self._connection.keeping.holds(self._claim):  # it has not begun to build it
            self.phase = Phase.IDLE
            return self._demand.idle
        cause = self._demand.ends_by
        fault = None if self._connection.state is State.CLOSED else self._connection.queue_job()
        self._close_wanted = fault is not None  # 80AC: closed in a later scan
        if fault is not None:
            return Outcome(Condition.QUEUE_FULL, cause_of_fault(fault))
        was_up = self._was_up()
        self.phase = Phase.IDLE
        self._connection.keeping.give_back(self._claim)
        shown, *more = disconnect(self._connection, cause)
        self._script.extend(more if was_up else ())  # 7007 only where it was up
        return shown

    def _was_up(self) -> bool:
        if self.phase is not Phase.CONNECTED:
            return False
        loss = self._connection.find_loss(self.incarnation)
        return loss is None or (self._course.closes_together and loss.kind is LossKind.OURS)

    def _reset(self) -> Outcome | None:
        self._reset_wanted = False
        if self.phase is not Phase.CONNECTED or self._connection.find_loss(self.incarnation) is not None:
            return None
        fault = self._connection.queue_job()
        if fault is not None:
            self._reset_wanted = True  # 80AC: reset in a later scan
            return Outcome(Condition.QUEUE_FULL, cause_of_fault(fault))
        self.phase, self.waits = Phase.CONNECTING, 0
        cause = Cause(CauseKind.INPUT, "COM_RST rose", pin="COM_RST", value=1)
        shown, *more = self._reset_connection(cause)
        self._script = deque(more)
        return replace(shown, clear_com_rst=self._env.rules.com_rst_autoclear)

    def _reset_connection(self, cause: Cause) -> list[Outcome]:
        first = (self._job_error,) if self._job_error else ()
        if not self._course.reset_closes:
            return reset(self._connection, cause, (*first, *self._course.reset))
        self.phase, self._queued = Phase.STARTING, False  # legacy: the listener is made anew too
        closed = disconnect(self._connection, cause)[0]
        return [*(Outcome(condition, cause) for condition in first), closed]


def established_cause(connection: Connection) -> Cause:
    """Return the cause of an established connection: its partner, or the open port for datagrams."""
    if connection.config.is_datagram:
        return Cause(CauseKind.SEQUENCE, "the UDP port is open", detail=f"at {connection.local}")
    return Cause(CauseKind.PARTNER, "the partner is connected", peer=connection.partner)


def set_up_failed(connection: Connection, failed: StepFault, course: StatusRules) -> Outcome:
    peer = connection.set_up.remote if failed.stage is SetUpStage.CONNECT else None
    cause = cause_of_fault(failed.fault, failed.client or str(peer or ""))
    if failed.detail:
        cause = replace(cause, detail=failed.detail)
    return Outcome(course.set_up_condition(failed.stage, failed.fault.error), cause)


_CREATED = Outcome(Condition.CREATED, Cause(CauseKind.SEQUENCE, "the set-up has begun"))
