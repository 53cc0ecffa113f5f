"""Which numbers a machine sends: sensible and senseless REALs, and whole numbers that look swapped.

Rule: between sensible and senseless there is room for doubt, and a doubt says nothing.
"""

from __future__ import annotations

import math
from typing import Final

from trcvtui.udt.types import Elementary, Kind

SENSIBLE_REAL: Final = (1e-5, 1e8)
SENSELESS_REAL: Final = (1e-15, 1e18)


def swap_verdict(row: Elementary, read: float, swapped: float) -> int:
    """Return 1: makes sense swapped only; -1: makes sense as read only; 0: says nothing."""
    if row.kind is Kind.REAL:
        good, bad = is_sensible_real, is_senseless_real
        return (bad(read) and good(swapped)) - (good(read) and bad(swapped))
    large = 1 << 8 * (row.size - 1)  # the highest byte is needed
    small = 1 << 4 * row.size  # the upper half of the bytes is not
    read, swapped = abs(read), abs(swapped)
    return (read >= large and 0 < swapped < small) - (swapped >= large and 0 < read < small)


def is_sensible_real(value: float, within: tuple[float, float] = SENSIBLE_REAL) -> bool:
    """Return whether the magnitude is one that machines send; 0 is not, it says nothing."""
    low, high = within
    return math.isfinite(value) and low <= abs(value) <= high


def is_senseless_real(value: float) -> bool:
    """Return whether it is no number, or one that no machine sends."""
    low, high = SENSELESS_REAL
    return not math.isfinite(value) or 0 < abs(value) < low or abs(value) > high
