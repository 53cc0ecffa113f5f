"""The rules of each vendor as tables, with hardly any code: STATUS words, switches, limits, layout.

A new vendor is one folder whose `rules.py` fills in a Dialect, and one line in DIALECTS.
"""

from __future__ import annotations

from typing import Final

from trcvtui.dialects.baosky.rules import BAOSKY
from trcvtui.dialects.dialect import Dialect
from trcvtui.dialects.siemens.rules import S7_1200, S7_1200_LEGACY, S7_1500
from trcvtui.dialects.twincat.rules import TWINCAT

DIALECTS: Final[dict[str, Dialect]] = {
    dialect.name: dialect for dialect in (BAOSKY, S7_1500, S7_1200, S7_1200_LEGACY, TWINCAT)
}
