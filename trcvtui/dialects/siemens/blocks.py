"""The Siemens blocks, in the groups that share a STATUS row."""

from __future__ import annotations

from typing import Final

SEND_C: Final = ("TSEND_C",)
RCV_C: Final = ("TRCV_C",)
BOTH_C: Final = SEND_C + RCV_C
TCON: Final = ("TCON",)
SET_UP: Final = BOTH_C + TCON  # these build a connection
SEND: Final = (*SEND_C, "TSEND")
RECEIVE: Final = (*RCV_C, "TRCV")
UDP: Final = ("TUSEND", "TURCV")
JOBS: Final = SEND + RECEIVE + UDP  # these move bytes
CLOSE: Final = ("TDISCON", "T_RESET")
SINGLE: Final = TCON + CLOSE + ("T_DIAG", "TSEND", "TRCV") + UDP
ALL: Final = BOTH_C + SINGLE
