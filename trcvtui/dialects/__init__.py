"""Which vendor's rules: STATUS words, switches, limits, layout. Tables, hardly any code.

A new vendor is one module that fills in a Dialect, and one line in DIALECTS.
"""

from __future__ import annotations

from typing import Final

from trcvtui.dialects.baosky import BAOSKY
from trcvtui.dialects.dialect import Dialect

DIALECTS: Final[dict[str, Dialect]] = {dialect.name: dialect for dialect in (BAOSKY,)}
