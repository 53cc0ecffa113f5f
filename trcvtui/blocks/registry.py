"""Which blocks there are: one line a block."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from trcvtui.blocks.block import Binding, Block
from trcvtui.blocks.t_reset import TReset
from trcvtui.blocks.tcon import Tcon
from trcvtui.blocks.tdiscon import Tdiscon
from trcvtui.blocks.trcv import Trcv
from trcvtui.blocks.trcv_c import TrcvC
from trcvtui.blocks.tsend import Tsend
from trcvtui.blocks.tsend_c import TsendC

BLOCKS: Final[Mapping[str, Callable[[Binding], Block]]] = {
    "TRCV_C": TrcvC,
    "TSEND_C": TsendC,
    "TCON": Tcon,
    "TDISCON": Tdiscon,
    "T_RESET": TReset,
    "TSEND": Tsend,
    "TRCV": Trcv,
}
