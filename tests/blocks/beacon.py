"""BEACON, a block that nobody sells: what a new block is, one class and one row."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.block import ConnectBinding, NoJob
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import Cause, CauseKind, Outcome
from trcvtui.blocks.pins import Direction, Inputs, Pin
from trcvtui.blocks.table import BlockRow


class Beacon:
    """It is on while REQ is 1, and seen in the scan in which REQ falls."""

    def __init__(self, bound: ConnectBinding) -> None:
        self.job = NoJob()
        self._req = False

    def call(self, inputs: Inputs) -> Outcome:
        was, self._req = self._req, inputs.req
        condition = Condition.SENDING if inputs.req else Condition.SENT if was else Condition.NO_JOB
        return Outcome(condition, Cause(CauseKind.INPUT, "REQ is asked", pin="REQ", value=int(inputs.req)))

    def stop(self, reason: str) -> None:
        """Forget nothing: it keeps nothing."""

    def detach(self, reason: str) -> None:
        """Leave the connection as it is."""


BEACON: Final = BlockRow(
    "BEACON",
    (
        Pin("REQ", Direction.IN, "BOOL", "1: the beacon is on", edge=True),
        Pin("LIT", Direction.OUT, "BOOL", "the beacon is on", shows="busy"),
        Pin("SEEN", Direction.OUT, "BOOL", "somebody may have seen it; TRUE for one scan", shows="done"),
        Pin("STATUS", Direction.OUT, "WORD", "what the block is doing", shows="status"),
    ),
    shared="tests.blocks.beacon:Beacon",
    data_pin="LAMP",
)
