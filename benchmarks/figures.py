"""What a measurement is asked and what it answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Effort:
    """How long to measure: pairs of slices, rounds of windows and their seconds, program starts, a minute."""

    pairs: int
    rounds: int
    window_s: int
    starts: int
    minute_s: int


FULL: Final = Effort(pairs=25, rounds=5, window_s=3, starts=11, minute_s=60)
QUICK: Final = Effort(pairs=7, rounds=1, window_s=3, starts=3, minute_s=5)


@dataclass(frozen=True, slots=True)
class Figure:
    """One case of a target: what was reached beside the aim; `held` is None where there is none."""

    case: str
    value: str
    aim: str = ""
    held: bool | None = None
    note: str = ""
