"""Types that no file declares because every tool brings them along; a declaration of the same name wins."""

from __future__ import annotations

from typing import Final

from trcvtui.udt.types import Text, Type, Unplaced

FB_INSTANCE: Final = "an FB instance"
ANY: Final = "a reference of unknown size"

_FUNCTION_BLOCKS = (
    *("TON", "TOF", "TP", "TONR", "LTON", "LTOF", "LTP", "TON_TIME", "TOF_TIME", "TP_TIME", "TONR_TIME"),
    *("TON_LTIME", "TOF_LTIME", "TP_LTIME", "TONR_LTIME", "IEC_TIMER", "IEC_LTIMER", "RTC"),
    *("CTU", "CTD", "CTUD", "CTU_INT", "CTU_DINT", "CTU_LINT", "CTU_UDINT", "CTU_ULINT"),
    *("CTD_INT", "CTD_DINT", "CTUD_INT", "CTUD_DINT", "IEC_COUNTER", "IEC_DCOUNTER"),
    *("R_TRIG", "F_TRIG", "SR", "RS", "SEMA"),
)
_ANY = (
    *("ANY", "ANY_NUM", "ANY_REAL", "ANY_INT", "ANY_BIT", "ANY_STRING", "ANY_DATE", "ANY_TYPE", "VARIANT"),
    "POINTER",
)

WELL_KNOWN: Final[dict[str, Type]] = {
    **{name.casefold(): Unplaced(name, FB_INSTANCE) for name in _FUNCTION_BLOCKS},
    **{name.casefold(): Unplaced(name, ANY) for name in _ANY},
    "t_maxstring": Text(255),  # TwinCAT, library Tc2_System
}
