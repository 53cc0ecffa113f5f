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
    """One pin. `edge` pins act on their rising edge; `label`: how the manual draws it, if otherwise."""

    name: str
    direction: Direction
    iec_type: str
    text: str
    edge: bool = False
    label: str = ""

    @property
    def is_bool(self) -> bool:
        """Return whether the pin is a BOOL."""
        return self.iec_type == "BOOL"


# CONNECT and DATA are InOut too; they are named by the project file. Sections: baosky.md 2, 3, 5, 6.
_EN_R: Final = Pin("EN_R", Direction.IN, "BOOL", "TRUE keeps receiving, job after job")
_REQ: Final = Pin("REQ", Direction.IN, "BOOL", "rising edge sends DATA once", edge=True)
_CONT: Final = Pin("CONT", Direction.IN, "BOOL", "1 builds and holds the connection, 0 closes it")
_ADHOC: Final = Pin("ADHOC", Direction.IN, "BOOL", "0 static: exact length; 1 ad-hoc: whatever arrives")
_COM_RST: Final = Pin(
    "COM_RST", Direction.IN_OUT, "BOOL", "rising edge resets an established connection", edge=True
)
_RCV_LEN: Final = Pin(
    "LEN", Direction.IN, "UDINT", "bytes wanted (static) or limit (ad-hoc); 0 = size of DATA"
)
_SEND_LEN: Final = Pin("LEN", Direction.IN, "UDINT", "bytes to send; 0 = size of DATA")
_UDP_CONT: Final = Pin("CONT", Direction.IN, "BOOL", "1 creates and holds the UDP socket, 0 releases it")
_UDP_LEN: Final = Pin("LEN", Direction.IN, "UDINT", "longest datagram that is taken; 0 = size of DATA")
_RCVD_LEN: Final = Pin("RCVD_LEN", Direction.OUT, "UDINT", "bytes received; valid in the DONE scan only")
_LAMPS: Final = (
    Pin("DONE", Direction.OUT, "BOOL", "a job ended well; TRUE for one scan"),
    Pin("BUSY", Direction.OUT, "BOOL", "a job is running"),
    Pin("ERROR", Direction.OUT, "BOOL", "something failed; STATUS says what"),
    Pin("STATUS", Direction.OUT, "WORD", "what the block is doing"),
)


def _req(text: str) -> tuple[Pin, ...]:
    return (Pin("REQ", Direction.IN, "BOOL", text, edge=True), *_LAMPS)


PINS: Final[dict[str, tuple[Pin, ...]]] = {
    "TRCV_C": (_EN_R, _CONT, _RCV_LEN, _ADHOC, _COM_RST, *_LAMPS, _RCVD_LEN),
    "TSEND_C": (_REQ, _CONT, _SEND_LEN, _COM_RST, *_LAMPS),
    "TCON": _req("rising edge builds the connection, which is then kept"),
    "TDISCON": _req("rising edge closes the connection"),
    "T_RESET": _req("rising edge resets an established connection"),
    "TSEND": (_REQ, _SEND_LEN, *_LAMPS),
    "TRCV": (_EN_R, _RCV_LEN, _ADHOC, *_LAMPS, _RCVD_LEN),
    "T_DIAG": _req("rising edge reads how the connection stands into RESULT (key data)"),
    "TUSEND": (_REQ, _SEND_LEN, *_LAMPS),
    "TURCV": (_EN_R, _UDP_LEN, *_LAMPS, _RCVD_LEN),
    "USEND_C": (_REQ, _UDP_CONT, _SEND_LEN, *_LAMPS),
    "URECV_C": (_EN_R, _UDP_CONT, _UDP_LEN, *_LAMPS, _RCVD_LEN),
}
SPEAKS_UDP: Final = frozenset(
    {"USEND_C", "URECV_C", "TUSEND", "TURCV"}
)  # CONFIG and ADDR in the place of CONNECT
ON_CONNECT: Final = frozenset({"TUSEND", "TURCV"})  # these may have a CONNECT of UDP instead
HAS_ID: Final = frozenset({"TCON", "TSEND", "TRCV", "TDISCON", "T_RESET", "T_DIAG", "TUSEND", "TURCV"})
ID_ALONE: Final = HAS_ID - {"TCON"}  # where connections have an ID: no CONNECT beside it
ADDR_IF_UDP: Final = frozenset({"TSEND_C", "TRCV_C"})  # they need ADDR on a CONNECT of UDP
SENDS: Final = frozenset({"TSEND_C", "TSEND"})
MOVES_BYTES: Final = frozenset({"TRCV_C", "TSEND_C", "TSEND", "TRCV"}) | SPEAKS_UDP
HAS_DATA: Final = MOVES_BYTES | {"T_DIAG"}
DATA_PIN: Final = {"T_DIAG": "RESULT"}  # what the manual calls it, where that is not DATA


def inputs_of(block: str) -> tuple[Pin, ...]:
    """Return the pins of a block that can be written."""
    return tuple(p for p in PINS[block] if p.direction is not Direction.OUT)


def outputs_of(block: str) -> tuple[Pin, ...]:
    """Return the pins of a block that can only be read."""
    return tuple(p for p in PINS[block] if p.direction is Direction.OUT)
