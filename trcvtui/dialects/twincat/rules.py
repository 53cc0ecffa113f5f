"""Beckhoff TwinCAT, Tc2_SerialCom: its rules and its errors (ComError_t). Streams come through TRCV_C."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from msgspec.structs import replace

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.rules import VendorRules
from trcvtui.blocks.status import Reproducibility, StatusRow, unreached_row
from trcvtui.dialects.baosky.rules import BAOSKY
from trcvtui.dialects.dialect import Dialect, Switch, SwitchValue, map_codes

DATA_BLOCKS: Final = ("ReceiveData",)
STRING_BLOCKS: Final = ("ReceiveString", "ReceiveString255")
RECEIVE: Final = DATA_BLOCKS + STRING_BLOCKS
SEND: Final = ("SendData", "SendByte", "SendString")
SERIAL_BLOCKS: Final = ("ReceiveData", "ReceiveByte", *STRING_BLOCKS, *SEND, "ClearComBuffer")
MANUAL: Final = "TwinCAT TF6340 help, ComError_t"
HARDWARE_ONLY_TEXT: Final = "it is about a terminal or a serial interface, which this bench does not have"


def _row(
    code: int,
    name: str,
    condition: Condition,
    blocks: tuple[str, ...],
    title: str,
    causes: tuple[str, ...],
    checks: tuple[str, ...],
    unsure: str = "",
) -> StatusRow:
    title = f"{code} COMERROR_{name}: {title}"
    return StatusRow(
        code, condition, blocks, title, causes, checks, Reproducibility.LOGIC, MANUAL, unsure=unsure
    )


def _make_hardware_row(code: int, name: str, title: str) -> StatusRow:
    causes = ("SerialLineControl or the configuration of a terminal",)
    checks = ("the terminal's settings and its ComBuffer", "ErrorID of SerialLineControl")
    title = f"{code} COMERROR_{name}: {title}"
    return unreached_row(code, SERIAL_BLOCKS, title, causes, checks, MANUAL, HARDWARE_ONLY_TEXT)


NO_ERROR: Final = StatusRow(
    0,
    Condition.NOT_CALLED,
    SERIAL_BLOCKS,
    "0 COMERROR_NOERROR: no error",
    (
        "the block waits for bytes, has some, or has delivered a frame",
        "RxTimeout = 1: a gap has ended the frame, which is no error",
    ),
    (
        "DataReceived, StringReceived or ByteReceived: 1 for one scan",
        "a good frame with a suffix: DataReceived = 1, RxTimeout = 0 and Error = 0 together",
    ),
    Reproducibility.LOGIC,
    "TwinCAT TF6340 help, ReceiveData",
    error=False,
    also=(
        Condition.NO_JOB,
        Condition.FRAME_AWAITED,
        Condition.FRAME_PART,
        Condition.FRAME_RECEIVED,
        Condition.FRAME_GAP,
        Condition.BUFFER_EMPTY,
        Condition.SENDING,
        Condition.SENT,
    ),
)

COM_ERRORS: Final = (
    NO_ERROR,
    _row(
        1,
        "PARAMETERCHANGED",
        Condition.PARAMETER_CHANGED,
        RECEIVE + SEND,
        "an input changed while busy",
        (
            "prefix, suffix, size or target changed in the middle of a frame; what was there is thrown away",
            "a send block: length or variable changed before all bytes were in the ComBuffer",
        ),
        (
            "History of the pins and of the variables of prefix and suffix",
            "change them while busy is 0, or with Reset = 1",
        ),
        "the manual does not say which inputs count, and that the part is thrown away",
    ),
    _row(
        2,
        "TXBUFFOVERRUN",
        Condition.SEND_OVERRUN,
        SEND,
        "the data are larger than the send buffer",
        ("Length is larger than a ComBuffer, about 300 bytes",),
        ("send in pieces", "size of the ComBuffer in the project"),
    ),
    _row(
        10,
        "STRINGOVERRUN",
        Condition.STRING_OVERRUN,
        STRING_BLOCKS,
        "the string was full before its end was seen",
        (
            "the sender's text is longer than the string: 80 or 255 characters",
            "the suffix is another: CR LF, CR alone, LF alone",
            "no suffix and no Timeout: the end is never seen",
        ),
        ("the bytes of the frame in hex: what do they end with?", "ReceiveString255, or ReceiveData"),
        "that StringReceived is 1 with it is taken from ReceiveData",
    ),
    _row(
        11,
        "ZEROCHARINVALID",
        Condition.ZERO_CHARACTER,
        STRING_BLOCKS,
        "a byte 00 in a text",
        ("the sender sends binary data, or ends its texts with 00",),
        ("the bytes in hex", "ReceiveData takes any bytes; a suffix may be 00 there"),
        "the manual does not say when, and that the part is thrown away",
    ),
    _row(
        20,
        "INVALIDPOINTER",
        Condition.NULL_POINTER,
        (*DATA_BLOCKS, "SendData", "SendString"),
        "a pointer to prefix, suffix or send data is 0",
        (
            "LenPrefix or LenSuffix is greater than 0, and no variable is there",
            "the length is larger than the variable (here: memory after it is nothing)",
        ),
        ("pPrefix and pSuffix := ADR(variable), the lengths := SIZEOF(variable)",),
    ),
    _row(
        21,
        "INVALIDRXPOINTER",
        Condition.NULL_RECEIVE_POINTER,
        RECEIVE,
        "pReceiveData is 0",
        ("the instance has no data",),
        ("pReceiveData := ADR(variable)",),
    ),
    _row(
        22,
        "INVALIDRXLENGTH",
        Condition.RECEIVE_LENGTH_WRONG,
        DATA_BLOCKS,
        "SizeReceiveData is wrong",
        (
            "SizeReceiveData is 0 or less",
            "it is larger than the variable (a real PLC would write over what lies after it)",
        ),
        ("SizeReceiveData := SIZEOF(variable)",),
    ),
    _row(
        23,
        "DATASIZEOVERRUN",
        Condition.DATA_OVERRUN,
        DATA_BLOCKS,
        "size reached, suffix not seen",
        (
            "the sender's frame is longer than SizeReceiveData",
            "the suffix is another: CR LF, CR alone, LF alone",
            "a frame began in the middle: the rest of it comes as the next frame",
            "prefix and suffix together are longer than SizeReceiveData",
        ),
        (
            "DataReceived is 1 with it: look at the end of the data in hex",
            "SizeReceiveData, LenSuffix and the suffix's bytes",
        ),
        "an older manual says 10 in its place",
    ),
    _make_hardware_row(24, "INVALIDPROCESSDATASIZE", "wrong size of the process data"),
    _make_hardware_row(257, "MODENOTSUPPORTED", "mode not supported"),
    _make_hardware_row(258, "INVALIDCHANNELNUMBER", "wrong channel number"),
    _make_hardware_row(4097, "INVALIDBAUDRATE", "wrong baud rate"),
    _make_hardware_row(4098, "INVALIDNUMDATABITS", "wrong number of data bits"),
    _make_hardware_row(4099, "INVALIDNUMSTOPBITS", "wrong number of stop bits"),
    _make_hardware_row(4100, "INVALIDPARITY", "wrong parity"),
    _make_hardware_row(4101, "INVALIDHANDSHAKE", "wrong handshake"),
    _make_hardware_row(4102, "INVALIDNUMREGISTERS", "wrong number of registers"),
    _make_hardware_row(4103, "INVALIDREGISTER", "wrong register"),
    _make_hardware_row(4104, "TIMEOUT", "the hardware did not answer; not RxTimeout"),
)


# Beckhoff has no TRCV_C: here it is any source of a stream, and behaves as Baosky's.

STREAM_BLOCKS: Final = ("TRCV_C", "TSEND_C")


def _keep_stream_row(row: StatusRow) -> StatusRow | None:
    blocks = tuple(block for block in row.blocks if block in STREAM_BLOCKS)
    return replace(row, blocks=blocks) if blocks else None


RESET_WITH_EN_R_SWITCH: Final = Switch(
    "reset_framer_with_en_r",
    "bool",
    False,
    "an incomplete frame is discarded when EN_R falls at the TRCV_C that feeds the ComBuffer",
)
STREAM_ROWS: Final = tuple(kept for row in BAOSKY.status if (kept := _keep_stream_row(row)) is not None)


def make_rules(values: Mapping[str, SwitchValue]) -> VendorRules:
    follows = bool(dict(values).get(RESET_WITH_EN_R_SWITCH.name, RESET_WITH_EN_R_SWITCH.default))
    return replace(BAOSKY.answer(values), status_of=map_codes(COM_ERRORS), part_follows_en_r=follows)


TWINCAT: Final = Dialect(
    name="twincat",
    title="Beckhoff TwinCAT 3, Tc2_SerialCom; TRCV_C and TSEND_C as Baosky's",
    blocks=(*SERIAL_BLOCKS, *STREAM_BLOCKS),
    status=tuple(sorted((*COM_ERRORS, *STREAM_ROWS), key=lambda row: row.code)),
    switches=(*BAOSKY.switches, RESET_WITH_EN_R_SWITCH),
    models={"TC3": 32},
    default_model="TC3",
    layout="codesys-8",
    answer=make_rules,
)
