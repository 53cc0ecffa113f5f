"""What one call of a block answers: a condition, its cause, and what follows from it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from trcvtui.blocks import conditions
from trcvtui.blocks.cause import Cause, Why
from trcvtui.blocks.conditions import Condition


class Lamp(Enum):
    """BUSY or DONE of a block whose job is not to move bytes: its condition alone does not tell."""

    BUSY = "busy"
    DONE = "done"


@dataclass(frozen=True, slots=True, eq=False)  # the same object is the same answer
class Outcome:
    """The answer of one call. `rcvd_len` is non-zero only with DONE; `clear_com_rst` writes COM_RST back.

    Blocks on a ComBuffer keep `rcvd_len` until the next frame begins, and have `rx_timeout` or a `byte`.

    `lasts`: every further call gives this very object and changes nothing, until an input changes, the poll
    sees the CONNECT, or another block ends its connection.
    """

    condition: Condition
    cause: Cause
    rcvd_len: int = 0
    clear_com_rst: bool = False
    lasts: bool = False
    lamp: Lamp | None = None
    rx_timeout: bool = False
    byte: int = 0

    @property
    def busy(self) -> bool:
        """Return BUSY: a job is running."""
        return self.condition in conditions.BUSY or self.lamp is Lamp.BUSY

    @property
    def done(self) -> bool:
        """Return DONE: a job ended well, in this scan."""
        return self.condition in conditions.DONE or self.lamp is Lamp.DONE

    @property
    def error(self) -> bool:
        """Return ERROR."""
        return self.condition in conditions.ERROR


NOT_CALLED = Outcome(Condition.NOT_CALLED, Cause(Why.NOT_CALLED, "the block has not been called"))
