"""The pins of each block: name, direction, IEC type, rule. Panels and commands are built from these."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final


class Direction(StrEnum):
    """Where a pin points."""

    IN = "in"
    IN_OUT = "in_out"
    OUT = "out"


@dataclass(frozen=True, slots=True)
class Pin:
    """One pin. `edge` pins act on their rising edge."""

    name: str
    direction: Direction
    iec_type: str
    text: str
    edge: bool = False

    @property
    def is_bool(self) -> bool:
        """Return whether the pin is a BOOL."""
        return self.iec_type == "BOOL"


# Manual 7.15.1 (baosky.md section 2). CONNECT and DATA are InOut too; they are named by the project file.
TRCV_C: Final = (
    Pin("EN_R", Direction.IN, "BOOL", "TRUE keeps receiving, job after job"),
    Pin("CONT", Direction.IN, "BOOL", "1 builds and holds the connection, 0 closes it"),
    Pin("LEN", Direction.IN, "UDINT", "bytes wanted (static) or limit (ad-hoc); 0 = size of DATA"),
    Pin("ADHOC", Direction.IN, "BOOL", "0 static: exact length; 1 ad-hoc: whatever arrives"),
    Pin("COM_RST", Direction.IN_OUT, "BOOL", "rising edge resets an established connection", edge=True),
    Pin("DONE", Direction.OUT, "BOOL", "a job ended well; TRUE for one scan"),
    Pin("BUSY", Direction.OUT, "BOOL", "a job is running"),
    Pin("ERROR", Direction.OUT, "BOOL", "something failed; STATUS says what"),
    Pin("STATUS", Direction.OUT, "WORD", "what the block is doing"),
    Pin("RCVD_LEN", Direction.OUT, "UDINT", "bytes received; valid in the DONE scan only"),
)

PINS: Final[dict[str, tuple[Pin, ...]]] = {"TRCV_C": TRCV_C}


def inputs_of(block: str) -> tuple[Pin, ...]:
    """Return the pins of a block that can be written."""
    return tuple(p for p in PINS[block] if p.direction is not Direction.OUT)


def outputs_of(block: str) -> tuple[Pin, ...]:
    """Return the pins of a block that can only be read."""
    return tuple(p for p in PINS[block] if p.direction is Direction.OUT)
