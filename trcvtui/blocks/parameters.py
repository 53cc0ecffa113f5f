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
# ReceiveData and what belongs to it (receivedata.md 2). EN is that of the box in FBD and LD: it is called.
_EN: Final = Pin("EN", Direction.IN, "BOOL", "the block is called while EN is 1")
_TIMEOUT: Final = Pin("Timeout", Direction.IN, "TIME", "longest gap between two bytes; 0 = any")
_RESET: Final = Pin("Reset", Direction.IN, "BOOL", "1 throws the part of a frame away")
_COM_ERROR: Final = Pin("Error", Direction.OUT, "UINT", "ComError_t; 0 = no error")
_SEND_LAMPS: Final = (Pin("Busy", Direction.OUT, "BOOL", "the ComBuffer has not taken all bytes"), _COM_ERROR)
_RECEIVE_LAMPS: Final = (
    Pin("busy", Direction.OUT, "BOOL", "a frame has begun"),
    _COM_ERROR,
    Pin("RxTimeout", Direction.OUT, "BOOL", "a gap ended the frame"),
)
_RECEIVE_DATA: Final = (
    Pin("LenPrefix", Direction.IN, "BYTE", "bytes of the prefix; 0 = none"),
    Pin("LenSuffix", Direction.IN, "BYTE", "bytes of the suffix; 0 = none"),
    Pin("SizeReceiveData", Direction.IN, "DINT", "the most bytes of a frame"),
    _TIMEOUT,
    _RESET,
    Pin("DataReceived", Direction.OUT, "BOOL", "a frame is in the data; TRUE for one scan"),
    *_RECEIVE_LAMPS,
    Pin("LenReceiveData", Direction.OUT, "UDINT", "bytes of the frame, prefix and suffix among them"),
)
_RECEIVE_STRING: Final = (
    _TIMEOUT,
    _RESET,
    Pin("StringReceived", Direction.OUT, "BOOL", "a text is in the string; TRUE for one scan"),
    *_RECEIVE_LAMPS,
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
    "ReceiveData": _RECEIVE_DATA,
    "ReceiveByte": (
        Pin("ByteReceived", Direction.OUT, "BOOL", "a byte has come; TRUE for one scan"),
        Pin("ReceivedByte", Direction.OUT, "BYTE", "the byte"),
        _COM_ERROR,
    ),
    "ReceiveString": _RECEIVE_STRING,
    "ReceiveString255": _RECEIVE_STRING,
    "SendData": (_EN, Pin("Length", Direction.IN, "UDINT", "bytes to send"), *_SEND_LAMPS),
    "SendByte": (_EN, Pin("SendByte", Direction.IN, "BYTE", "the byte to send"), *_SEND_LAMPS),
    "SendString": (_EN, *_SEND_LAMPS),
    "ClearComBuffer": (_EN,),
}
# What each output shows, of what an instance knows of its outputs.
SHOWS: Final = {
    "DONE": "done", "BUSY": "busy", "ERROR": "error", "STATUS": "status", "RCVD_LEN": "rcvd_len",
    "DataReceived": "done", "StringReceived": "done", "ByteReceived": "done", "busy": "busy", "Busy": "busy",
    "Error": "status", "RxTimeout": "rx_timeout", "LenReceiveData": "rcvd_len", "ReceivedByte": "byte",
}  # fmt: skip
# What a block on a ComBuffer calls it; such a block has no CONNECT.
BUFFER_PIN: Final = {
    "ReceiveData": "RxBuffer", "ReceiveByte": "RxBuffer", "ReceiveString": "RxBuffer",
    "ReceiveString255": "RxBuffer", "SendData": "TxBuffer", "SendByte": "TxBuffer", "SendString": "TxBuffer",
    "ClearComBuffer": "Buffer",
}  # fmt: skip
# Further variables that a block is bound to, beside its data: prefix first, then suffix.
POINTERS: Final = {
    "ReceiveData": ("pPrefix", "pSuffix"),
    "ReceiveString": ("Prefix", "Suffix"),
    "ReceiveString255": ("Prefix", "Suffix"),
}
TIMES: Final = frozenset({"Timeout"})  # pins of type TIME: whole milliseconds
SPEAKS_UDP: Final = frozenset(
    {"USEND_C", "URECV_C", "TUSEND", "TURCV"}
)  # CONFIG and ADDR in the place of CONNECT
ON_CONNECT: Final = frozenset({"TUSEND", "TURCV"})  # these may have a CONNECT of UDP instead
HAS_ID: Final = frozenset({"TCON", "TSEND", "TRCV", "TDISCON", "T_RESET", "T_DIAG", "TUSEND", "TURCV"})
ID_ALONE: Final = HAS_ID - {"TCON"}  # where connections have an ID: no CONNECT beside it
ADDR_IF_UDP: Final = frozenset({"TSEND_C", "TRCV_C"})  # they need ADDR on a CONNECT of UDP
# Who moves bytes over a CONNECT or a UDP_CONFIG, and which way: their pins say it.
SENDERS: Final = frozenset(block for block, pins in PINS.items() if _REQ in pins)
RECEIVERS: Final = frozenset(block for block, pins in PINS.items() if _EN_R in pins)
MOVES_BYTES: Final = SENDERS | RECEIVERS
DATA_PIN: Final = {
    "T_DIAG": "RESULT", "ReceiveData": "pReceiveData", "ReceiveString": "ReceivedString",
    "ReceiveString255": "ReceivedString", "SendData": "pSendData", "SendString": "SendString",
}  # what the manual calls it, where that is not DATA  # fmt: skip
HAS_DATA: Final = MOVES_BYTES | set(DATA_PIN)


def inputs_of(block: str) -> tuple[Pin, ...]:
    """Return the pins of a block that can be written."""
    return tuple(p for p in PINS[block] if p.direction is not Direction.OUT)


def outputs_of(block: str) -> tuple[Pin, ...]:
    """Return the pins of a block that can only be read."""
    return tuple(p for p in PINS[block] if p.direction is Direction.OUT)
