"""The blocks, ONE row each. Files, forms, command lines, waveforms and calls read the rows.

A new block needs one row here and the class that the row names. A dialect that has the block lists it.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Final

from msgspec import Struct

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.pins import Direction, Pin

MARK_NAMES: Final = ("prefix", "suffix")


class BlockRow(Struct, frozen=True):
    """One block. A row names classes as `module:Class`; they are imported when an instance is made.

    `shared` is the class on a CONNECT, `single` the class for a vendor with single instructions.
    `datagrams` is the class on a CONNECT of UDP, `on_config` on a UDP_CONFIG, `serial` on a ComBuffer.
    `data_pin` is the manual's name of DATA, or "". `data_length` is the pin for the size of DATA.
    `buffer_pin` is the pin for a ComBuffer. A block with a ComBuffer has no CONNECT.
    `pointers` are the pins of prefix, then suffix; `mark_lengths` the pins for both lengths, in this order.
    `has_id`: the block has an ID pin if connections have IDs. `id_alone`: the ID replaces CONNECT.
    `runs_as` is the condition while a job runs; the STATUS of a single instruction does not show this.
    """

    name: str
    pins: tuple[Pin, ...] = ()
    shared: str = ""
    single: str = ""
    datagrams: str = ""
    on_config: str = ""
    serial: str = ""
    data_pin: str = ""
    data_length: str = ""
    buffer_pin: str = ""
    pointers: tuple[str, ...] = ()
    mark_lengths: tuple[str, ...] = ()
    has_id: bool = False
    id_alone: bool = False
    runs_as: Condition | None = None

    @property
    def inputs(self) -> tuple[Pin, ...]:
        return tuple([pin for pin in self.pins if pin.direction is not Direction.OUT])

    @property
    def outputs(self) -> tuple[Pin, ...]:
        return tuple([pin for pin in self.pins if pin.direction is Direction.OUT])

    def _has_pin(self, name: str) -> bool:
        return any(pin.name == name for pin in self.pins)

    @property
    def sends_on_net(self) -> bool:
        """Return whether REQ sends DATA over a CONNECT or a UDP_CONFIG."""
        return self._has_pin("REQ") and self.data_pin == "DATA"

    @property
    def receives_on_net(self) -> bool:
        """Return whether EN_R receives into DATA from a CONNECT or a UDP_CONFIG."""
        return self._has_pin("EN_R")

    @property
    def sends_stream(self) -> bool:
        return self.sends_on_net and not self.speaks_udp

    @property
    def receives_stream(self) -> bool:
        return self.receives_on_net and not self.speaks_udp

    @property
    def uses_network(self) -> bool:
        """Return whether the block sends or receives on a CONNECT or a UDP_CONFIG."""
        return self.sends_on_net or self.receives_on_net

    @property
    def speaks_udp(self) -> bool:
        """Return whether the block moves only datagrams, with an ADDR."""
        return bool(self.on_config)

    @property
    def owns_link(self) -> bool:
        """Return whether the block builds its own CONNECT. A ComBuffer can use only such a block's stream.

        On a CONNECT of UDP the block needs an ADDR.
        """
        return self._has_pin("CONT") and not self.speaks_udp

    @property
    def has_com_buffer(self) -> bool:
        return bool(self.buffer_pin)

    @property
    def reads_rx_buffer(self) -> bool:
        return self.buffer_pin == "RxBuffer"

    @property
    def writes_tx_buffer(self) -> bool:
        return self.buffer_pin == "TxBuffer"

    @property
    def affix_pins(self) -> dict[str, str]:
        """Return the pins of prefix and suffix, each with its name in MARK_NAMES."""
        return dict(zip(self.pointers, MARK_NAMES, strict=False))


# CONNECT and DATA are InOut too; the project file names them.
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
_UDP_LEN: Final = Pin("LEN", Direction.IN, "UDINT", "longest datagram that is accepted; 0 = size of DATA")


def _output(name: str, iec_type: str, shows: str, text: str) -> Pin:
    return Pin(name, Direction.OUT, iec_type, text, shows=shows)


_RCVD_LEN: Final = _output("RCVD_LEN", "UDINT", "rcvd_len", "bytes received; valid in the DONE scan only")
_LAMPS: Final = (
    _output("DONE", "BOOL", "done", "a job ended well; TRUE for one scan"),
    _output("BUSY", "BOOL", "busy", "a job is running"),
    _output("ERROR", "BOOL", "error", "something failed; STATUS says what"),
    _output("STATUS", "WORD", "status", "what the block is doing"),
)
# ReceiveData and its relatives (TwinCAT TF6340 help). EN is that of the box in FBD and LD: 1 calls the block.
_EN: Final = Pin("EN", Direction.IN, "BOOL", "the block is called while EN is 1")
_TIMEOUT: Final = Pin("Timeout", Direction.IN, "TIME", "longest gap between two bytes; 0 = any")
_RESET: Final = Pin("Reset", Direction.IN, "BOOL", "1 throws away a frame that has only begun")
_COM_ERROR: Final = _output("Error", "UINT", "status", "ComError_t; 0 = no error")
_SEND_LAMPS: Final = (_output("Busy", "BOOL", "busy", "the ComBuffer has not taken all bytes"), _COM_ERROR)
_RECEIVE_LAMPS: Final = (
    _output("busy", "BOOL", "busy", "a frame has begun"),
    _COM_ERROR,
    _output("RxTimeout", "BOOL", "rx_timeout", "a gap ended the frame"),
)


def _req_and_lamps(text: str) -> tuple[Pin, ...]:
    return (Pin("REQ", Direction.IN, "BOOL", text, edge=True), *_LAMPS)


def _receive_string_row(name: str, inside: str) -> BlockRow:
    done = _output("StringReceived", "BOOL", "done", "a text has been received; TRUE for one scan")
    return BlockRow(
        name,
        (_TIMEOUT, _RESET, done, *_RECEIVE_LAMPS),
        serial=inside,
        data_pin="ReceivedString",
        buffer_pin="RxBuffer",
        pointers=("Prefix", "Suffix"),
    )


_TCP: Final = "trcvtui.blocks.tcp"
_SINGLE: Final = "trcvtui.blocks.single"
_UDP: Final = "trcvtui.blocks.udp"
_SERIAL: Final = "trcvtui.blocks.serial"

_ROWS: Final = (
    BlockRow(
        "TRCV_C",
        (_EN_R, _CONT, _RCV_LEN, _ADHOC, _COM_RST, *_LAMPS, _RCVD_LEN),
        shared=f"{_TCP}.compact_blocks:TrcvC",
        data_pin="DATA",
    ),
    BlockRow(
        "TSEND_C",
        (_REQ, _CONT, _SEND_LEN, _COM_RST, *_LAMPS),
        shared=f"{_TCP}.compact_blocks:TsendC",
        data_pin="DATA",
    ),
    BlockRow(
        "TCON",
        _req_and_lamps("rising edge builds the connection and keeps it"),
        shared=f"{_TCP}.separate_blocks:Tcon",
        single=f"{_SINGLE}.connect:SingleTcon",
        has_id=True,
        runs_as=Condition.ESTABLISHING,
    ),
    BlockRow(
        "TDISCON",
        _req_and_lamps("rising edge closes the connection"),
        shared=f"{_TCP}.separate_blocks:Tdiscon",
        single=f"{_SINGLE}.connect:SingleTdiscon",
        has_id=True,
        id_alone=True,
    ),
    BlockRow(
        "T_RESET",
        _req_and_lamps("rising edge resets an established connection"),
        shared=f"{_TCP}.separate_blocks:TReset",
        single=f"{_SINGLE}.connect:SingleTReset",
        has_id=True,
        id_alone=True,
    ),
    BlockRow(
        "TSEND",
        (_REQ, _SEND_LEN, *_LAMPS),
        shared=f"{_TCP}.separate_blocks:Tsend",
        single=f"{_SINGLE}.transfer:SingleTsend",
        data_pin="DATA",
        has_id=True,
        id_alone=True,
        runs_as=Condition.SENDING,
    ),
    BlockRow(
        "TRCV",
        (_EN_R, _RCV_LEN, _ADHOC, *_LAMPS, _RCVD_LEN),
        shared=f"{_TCP}.separate_blocks:Trcv",
        single=f"{_SINGLE}.transfer:SingleTrcv",
        data_pin="DATA",
        has_id=True,
        id_alone=True,
        runs_as=Condition.RECEIVING,
    ),
    BlockRow(
        "T_DIAG",
        _req_and_lamps("rising edge reads the state of the connection into RESULT (key data)"),
        single=f"{_SINGLE}.connect:TDiag",
        data_pin="RESULT",
        has_id=True,
        id_alone=True,
    ),
    BlockRow(
        "TUSEND",
        (_REQ, _SEND_LEN, *_LAMPS),
        datagrams=f"{_SINGLE}.transfer:TusendOnConnect",
        on_config=f"{_SINGLE}.transfer:Tusend",
        data_pin="DATA",
        has_id=True,
        id_alone=True,
    ),
    BlockRow(
        "TURCV",
        (_EN_R, _UDP_LEN, *_LAMPS, _RCVD_LEN),
        datagrams=f"{_SINGLE}.transfer:TurcvOnConnect",
        on_config=f"{_SINGLE}.transfer:Turcv",
        data_pin="DATA",
        has_id=True,
        id_alone=True,
    ),
    BlockRow(
        "USEND_C",
        (_REQ, _UDP_CONT, _SEND_LEN, *_LAMPS),
        on_config=f"{_UDP}.compact_blocks:UsendC",
        data_pin="DATA",
    ),
    BlockRow(
        "URECV_C",
        (_EN_R, _UDP_CONT, _UDP_LEN, *_LAMPS, _RCVD_LEN),
        on_config=f"{_UDP}.compact_blocks:UrecvC",
        data_pin="DATA",
    ),
    BlockRow(
        "ReceiveData",
        (
            Pin("LenPrefix", Direction.IN, "BYTE", "length of the prefix in bytes; 0 = none"),
            Pin("LenSuffix", Direction.IN, "BYTE", "length of the suffix in bytes; 0 = none"),
            Pin("SizeReceiveData", Direction.IN, "DINT", "largest size of a frame in bytes"),
            _TIMEOUT,
            _RESET,
            _output("DataReceived", "BOOL", "done", "a frame has been received; TRUE for one scan"),
            *_RECEIVE_LAMPS,
            _output("LenReceiveData", "UDINT", "rcvd_len", "length of the frame with prefix and suffix"),
        ),
        serial=f"{_SERIAL}.receiving:ReceiveData",
        data_pin="pReceiveData",
        data_length="SizeReceiveData",
        buffer_pin="RxBuffer",
        pointers=("pPrefix", "pSuffix"),
        mark_lengths=("LenPrefix", "LenSuffix"),
    ),
    BlockRow(
        "ReceiveByte",
        (
            _output("ByteReceived", "BOOL", "done", "a byte has been received; TRUE for one scan"),
            _output("ReceivedByte", "BYTE", "byte", "the received byte"),
            _COM_ERROR,
        ),
        serial=f"{_SERIAL}.receiving:ReceiveByte",
        buffer_pin="RxBuffer",
    ),
    _receive_string_row("ReceiveString", f"{_SERIAL}.receiving:ReceiveString"),
    _receive_string_row("ReceiveString255", f"{_SERIAL}.receiving:ReceiveString255"),
    BlockRow(
        "SendData",
        (_EN, Pin("Length", Direction.IN, "UDINT", "number of bytes to send"), *_SEND_LAMPS),
        serial=f"{_SERIAL}.sending:SendData",
        data_pin="pSendData",
        buffer_pin="TxBuffer",
    ),
    BlockRow(
        "SendByte",
        (_EN, Pin("SendByte", Direction.IN, "BYTE", "the byte to send"), *_SEND_LAMPS),
        serial=f"{_SERIAL}.sending:SendByte",
        buffer_pin="TxBuffer",
    ),
    BlockRow(
        "SendString",
        (_EN, *_SEND_LAMPS),
        serial=f"{_SERIAL}.sending:SendString",
        data_pin="SendString",
        buffer_pin="TxBuffer",
    ),
    BlockRow("ClearComBuffer", (_EN,), serial=f"{_SERIAL}.sending:ClearComBuffer", buffer_pin="Buffer"),
)
BLOCKS: Final[dict[str, BlockRow]] = {row.name: row for row in _ROWS}
_NO_BLOCK: Final = BlockRow("")


def block_row(name: str | None) -> BlockRow:
    return BLOCKS.get(name or "", _NO_BLOCK)


def known_blocks(names: Iterable[str]) -> tuple[str, ...]:
    """Return the given names that are known blocks, in the given order."""
    return tuple([name for name in names if name in BLOCKS])


def com_buffer_pins() -> tuple[str, ...]:
    """Return the names of all pins for a ComBuffer, sorted."""
    return tuple(sorted({row.buffer_pin for row in BLOCKS.values() if row.buffer_pin}))


def affix_pin_names() -> tuple[str, ...]:
    """Return the names of all pins for prefix or suffix."""
    return tuple(dict.fromkeys(pin for row in BLOCKS.values() for pin in row.pointers))


# -- pins by name alone: those of one name are alike in every block ---------------------------------------


@lru_cache(256)
def find_pin(name: str) -> Pin | None:
    return next((pin for row in BLOCKS.values() for pin in row.pins if pin.name == name), None)


def outcome_field(name: str) -> str:
    """Return the field of Outcome that an output shows, or "" if `name` is no output."""
    pin = find_pin(name)
    return pin.shows if pin is not None else ""


def is_time_pin(name: str) -> bool:
    """Return whether a pin is a TIME, in whole milliseconds."""
    pin = find_pin(name)
    return pin is not None and pin.iec_type == "TIME"
