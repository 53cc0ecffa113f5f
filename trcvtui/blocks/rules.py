"""The questionnaire: everything that a vendor may decide, as one frozen record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.pins import Pin
from trcvtui.blocks.status_sequence import Course
from trcvtui.net.connection.config import Policy


class NotConnected(Enum):
    """How long "asked for data, not connected" shows (design 6, row 3)."""

    PULSE = "pulse"
    HOLD = "hold"
    NEVER = "never"


@dataclass(frozen=True, slots=True)
class AreaRules:
    """What a vendor asks of DATA and LEN.

    `missing`: an open DATA pin. `longer`: LEN against the size of DATA. `refuses_bits`: no BOOL, no ARRAY OF
    BOOL. `symbolic_alone`: a symbolic DATA goes with LEN = 0 only, `symbolic_bytes`: and ad-hoc with elements
    of 8 bits only. `must_stay`: a change of DATA or LEN ends the job that runs. `adhoc_lens`: these values of
    LEN mean ad-hoc. `texts_whole`: LEN of a STRING or WSTRING is 0, or covers all of it in a send job and its
    header in a receive job. `datagram_needs_len`: LEN of TUSEND is not 0, but for a symbolic DATA.
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


@dataclass(frozen=True, slots=True)
class Rules:
    """One vendor's answers. Lengths in bytes."""

    status: Mapping[Condition, int]
    status_of: Mapping[str, Mapping[Condition, int]] = field(
        default_factory=dict
    )  # where a block has its own
    single_instructions: bool = False  # TCON, TSEND, ...: one job for each edge (blocks/single)
    course: Course = field(default_factory=Course)
    area: AreaRules = field(default_factory=AreaRules)
    lacks: frozenset[str] = frozenset()  # pins that this vendor's blocks do not have
    labels: Mapping[str, Mapping[str, str]] = field(
        default_factory=dict
    )  # block -> pin -> what this vendor calls it
    types: Mapping[str, str] = field(default_factory=dict)  # pin -> IEC type, where it is another one
    also_busy: frozenset[Condition] = frozenset()  # BUSY shows here, too
    receiving_part: Condition = Condition.RECEIVING  # the job has some bytes
    datagram_too_long: Condition = Condition.RECEIVE_FAILED
    not_connected: NotConnected = NotConnected.PULSE
    short_frame_shown: bool = True
    reset_counts_as_close: bool = False
    com_rst_autoclear: bool = True
    max_len: int = 65535
    max_datagram: int = 2048
    large_datagram_cut: bool = False
    lock_across_tasks: bool = False
    part_follows_en_r: bool = False  # of a frame behind a TRCV_C: EN_R = 0 throws it away
    lock_outlives: bool = True  # the lock of a job stays behind when its instance goes
    one_class: bool = False  # blocks of another priority are kept off a connection while one works on it
    policy: Policy = field(default_factory=Policy)
    buffers: int = 64
    queue: int = 64

    def typed(self, pin: Pin) -> Pin:
        """Return a pin with the IEC type that this vendor gives it."""
        return replace(pin, iec_type=self.types[pin.name]) if pin.name in self.types else pin

    def word(self, block: str, condition: Condition) -> int:
        """Return the STATUS that a condition has on a block."""
        own = self.status_of.get(block)
        return self.status[condition] if own is None or condition not in own else own[condition]
