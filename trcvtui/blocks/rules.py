"""The questionnaire: everything that a vendor may decide, as one frozen record."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Final

from msgspec import Struct, field
from msgspec.structs import replace

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.pins import Pin
from trcvtui.net.connection.config import ConnectionPolicy
from trcvtui.net.connection.connection import LossKind
from trcvtui.net.connection.set_up import SetUpStage

# The defaults are the plain sequence; the answers of each vendor are in its dialect (`rules.py`).

# (stage, errno) -> condition; an errno of "" is every other one of that stage.
SetUpConditions = Mapping[tuple[SetUpStage, str], Condition]

PLAIN_SET_UP_CONDITIONS: Final[SetUpConditions] = {
    (SetUpStage.SOCKET, ""): Condition.NO_SOCKET,
    (SetUpStage.ADDRESS, ""): Condition.WRONG_LOCAL_ADDRESS,
    (SetUpStage.REUSE, ""): Condition.REUSE_FAILED,
    (SetUpStage.BIND, ""): Condition.BIND_FAILED,
    (SetUpStage.POLL_ADD, ""): Condition.POLL_ADD_FAILED,
    (SetUpStage.ACCEPT, ""): Condition.ACCEPT_FAILED,
    (SetUpStage.CONNECT, ""): Condition.CONNECT_FAILED,
}


class StatusRules(Struct, frozen=True):
    """Which condition a block shows in which scan. Conditions in a tuple show in turn, for one scan each.
    `reset`: what COM_RST shows. `reset_ends_send`: the error that shows first and ends a running send job.
    `rebuilding`: what shows between an error and "connecting" when the block reconnects.
    `let_go`: what a block shows after another block has closed or reset the connection.
    `closes_together`: if CONT falls on two blocks of a connection in one scan, both show the close.
    `idle_loss`: the error of a loss while no job runs. If None, only a dead link shows an error.
    `job_loss`: the error that ends a job, by kind of loss. Other kinds: "send failed" or "receive failed".
    `still_asked`: the error that EN_R = 1 shows in the scan after a loss that ended a job. A separate TRCV
    shows `still_asked` while the connection is rebuilt.
    `teardown`: "closing" shows before the error of a loss that ends a job.
    `silent_connect`: a failed attempt shows no error. `silent_dead_link`: a dead link shows no error.
    `reset_closes`: COM_RST closes the connection and its listener, and builds both anew.
    `request_connects`: an edge of REQ or EN_R = 1 connects too. With CONT the connection outlives the job.
    `faults_once`: a receive job that every call refuses shows its error once, not in each call.
    `set_up`: the error of a set-up step.
    """

    job_begins: Condition | None = None
    established: Condition | None = None
    waiting_req_sends: bool = False
    en_r_keeps_job: bool = False
    first_data_keeps_job: bool = False
    second_lags: bool = False
    reset: tuple[Condition, ...] = (Condition.RESETTING, Condition.CLOSING, Condition.CLOSED)
    reset_ends_send: Condition | None = None
    rebuilding: tuple[Condition, ...] = ()
    let_go: tuple[Condition, ...] = ()
    closes_together: bool = False
    idle_loss: Condition | None = None
    job_loss: Mapping[LossKind, Condition] = field(
        default_factory=lambda: {
            LossKind.CLOSED_BY_PARTNER: Condition.PARTNER_CLOSED,
            LossKind.LINK_DEAD: Condition.LINK_DEAD,
        }
    )
    still_asked: Condition | None = None
    teardown: bool = False
    silent_connect: bool = False
    silent_dead_link: bool = False
    reset_closes: bool = False
    request_connects: bool = False
    faults_once: bool = False
    set_up: SetUpConditions = field(default_factory=lambda: PLAIN_SET_UP_CONDITIONS)

    def set_up_condition(self, stage: SetUpStage, error: str) -> Condition:
        return self.set_up.get((stage, error)) or self.set_up[stage, ""]

    def outlives_en_r(self, has_data: bool) -> bool:
        """Return whether a receive job continues while EN_R is 0."""
        return self.en_r_keeps_job or (self.first_data_keeps_job and has_data)


class NotConnectedRule(Enum):
    """How long "asked for data, not connected" shows."""

    PULSE = "pulse"
    HOLD = "hold"
    NEVER = "never"


class DataAreaRules(Struct, frozen=True):
    """What a vendor asks of DATA and LEN.

    `missing`: the error if DATA is open, `longer`: if LEN exceeds DATA. `refuses_bits`: no BOOL, no
    ARRAY OF BOOL. `symbolic_alone`: a symbolic DATA takes LEN = 0 only. `symbolic_bytes`: in ad-hoc jobs
    only elements of 8 bits. `must_stay`: a change of DATA or LEN ends the running job. `adhoc_lens`: the
    LENs that mean ad-hoc. `texts_whole`: LEN of a STRING or WSTRING is 0, or covers all of it (send
    job) or its header (receive job). `datagram_needs_len`: TUSEND takes LEN = 0 only with a symbolic DATA.
    """

    missing: Condition = Condition.DATA_EMPTY
    longer: Condition = Condition.LENGTH_WRONG
    refuses_bits: bool = False
    symbolic_alone: bool = False
    symbolic_bytes: bool = False
    must_stay: bool = False
    adhoc_lens: frozenset[int] = frozenset()
    texts_whole: bool = False
    datagram_needs_len: bool = False


class VendorRules(Struct, frozen=True):
    """One vendor's answers. Lengths in bytes."""

    status: Mapping[Condition, int]
    status_of: Mapping[str, Mapping[Condition, int]] = field(default_factory=dict)  # codes of one block
    single_instructions: bool = False  # TCON, TSEND, ...: one job for each edge (blocks/single)
    course: StatusRules = field(default_factory=StatusRules)
    area: DataAreaRules = field(default_factory=DataAreaRules)
    lacks: frozenset[str] = frozenset()  # pins that this vendor's blocks do not have
    labels: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  # block -> pin -> its name here
    types: Mapping[str, str] = field(default_factory=dict)  # pin -> IEC type, where it differs
    also_busy: frozenset[Condition] = frozenset()  # BUSY shows here, too
    receiving_part: Condition = Condition.RECEIVING  # the job has some bytes
    datagram_too_long: Condition = Condition.RECEIVE_FAILED
    not_connected: NotConnectedRule = NotConnectedRule.PULSE
    short_frame_shown: bool = True
    reset_counts_as_close: bool = False
    com_rst_autoclear: bool = True
    max_len: int = 65535
    max_datagram: int = 2048
    large_datagram_cut: bool = False
    lock_across_tasks: bool = False
    adhoc_at_once: bool = False  # ADHOC acts on the job that runs; else on the next one
    part_follows_en_r: bool = False  # EN_R = 0 of the TRCV_C before a ComBuffer drops it
    lock_outlives: bool = True  # the lock of a job stays when its instance goes
    one_class: bool = False  # a connection works for blocks of one priority at a time
    policy: ConnectionPolicy = field(default_factory=ConnectionPolicy)
    buffers: int = 64
    queue: int = 64
    internal_fault: int = 0x8FFF  # STATUS of an instance stopped by an error of this program

    def with_iec_type(self, pin: Pin) -> Pin:
        """Return a pin with the IEC type that this vendor gives it."""
        return replace(pin, iec_type=self.types[pin.name]) if pin.name in self.types else pin

    def status_word(self, block: str, condition: Condition) -> int:
        if condition is Condition.INTERNAL_FAULT:
            return self.internal_fault
        own = self.status_of.get(block)
        return self.status[condition] if own is None or condition not in own else own[condition]
