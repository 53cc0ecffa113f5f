"""Which blocks there are: one line a block."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

from trcvtui.blocks.block import Binding, Block
from trcvtui.blocks.serial.clear_com_buffer import ClearComBuffer
from trcvtui.blocks.serial.receive_byte import ReceiveByte
from trcvtui.blocks.serial.receive_data import ReceiveData
from trcvtui.blocks.serial.receive_string import ReceiveString, ReceiveString255
from trcvtui.blocks.serial.sending import SendByte, SendData, SendString
from trcvtui.blocks.serial.serial_binding import SerialBinding
from trcvtui.blocks.single.t_diag import TDiag
from trcvtui.blocks.single.t_reset import TReset as SingleTReset
from trcvtui.blocks.single.tcon import Tcon as SingleTcon
from trcvtui.blocks.single.tdiscon import Tdiscon as SingleTdiscon
from trcvtui.blocks.single.trcv import Trcv as SingleTrcv
from trcvtui.blocks.single.tsend import Tsend as SingleTsend
from trcvtui.blocks.single.turcv import Turcv
from trcvtui.blocks.single.tusend import Tusend
from trcvtui.blocks.tcp.t_reset import TReset
from trcvtui.blocks.tcp.tcon import Tcon
from trcvtui.blocks.tcp.tdiscon import Tdiscon
from trcvtui.blocks.tcp.trcv import Trcv
from trcvtui.blocks.tcp.trcv_c import TrcvC
from trcvtui.blocks.tcp.tsend import Tsend
from trcvtui.blocks.tcp.tsend_c import TsendC
from trcvtui.blocks.udp.udp_control import UdpBinding
from trcvtui.blocks.udp.urecv_c import UrecvC
from trcvtui.blocks.udp.usend_c import UsendC

BLOCKS: Final[Mapping[str, Callable[[Binding], Block]]] = {
    "TRCV_C": TrcvC,
    "TSEND_C": TsendC,
    "TCON": Tcon,
    "TDISCON": Tdiscon,
    "T_RESET": TReset,
    "TSEND": Tsend,
    "TRCV": Trcv,
}
SINGLE_INSTRUCTIONS: Final[Mapping[str, Callable[[Binding], Block]]] = {
    "TCON": SingleTcon,
    "TDISCON": SingleTdiscon,
    "T_RESET": SingleTReset,
    "TSEND": SingleTsend,
    "TRCV": SingleTrcv,
    "T_DIAG": TDiag,
}
# On a connection description of UDP, which TCON or a _C block builds.
UDP_ON_CONNECT: Final[Mapping[str, Callable[[Binding], Block]]] = {
    "TUSEND": partial(SingleTsend, needs_datagrams=True),
    "TURCV": partial(SingleTrcv, needs_datagrams=True),
}
UDP_BLOCKS: Final[Mapping[str, Callable[[UdpBinding], Block]]] = {
    "USEND_C": UsendC,
    "URECV_C": UrecvC,
    "TUSEND": Tusend,
    "TURCV": Turcv,
}
SERIAL_BLOCKS: Final[Mapping[str, Callable[[SerialBinding], Block]]] = {
    "ReceiveData": ReceiveData,
    "ReceiveByte": ReceiveByte,
    "ReceiveString": ReceiveString,
    "ReceiveString255": ReceiveString255,
    "SendData": SendData,
    "SendByte": SendByte,
    "SendString": SendString,
    "ClearComBuffer": ClearComBuffer,
}


def new_block(name: str, bound: Binding | UdpBinding | SerialBinding) -> Block:
    """Return the inside of a new instance."""
    if isinstance(bound, SerialBinding):
        return SERIAL_BLOCKS[name](bound)
    if isinstance(bound, UdpBinding):
        return UDP_BLOCKS[name](bound)
    if name in UDP_ON_CONNECT:
        return UDP_ON_CONNECT[name](bound)
    if bound.env.rules.single_instructions and name in SINGLE_INSTRUCTIONS:
        return SINGLE_INSTRUCTIONS[name](bound)
    return BLOCKS[name](bound)
