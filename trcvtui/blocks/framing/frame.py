"""What a framer is asked for and what it answers: frozen values."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple


class Ending(StrEnum):
    """What ended a frame."""

    SUFFIX = "suffix"
    SIZE = "size reached"
    OVERRUN = "size reached without the suffix"
    GAP = "gap"
    ZERO = "byte 00 in a text"


@dataclass(frozen=True, slots=True)
class Framing:
    """How frames are cut. `size`: the most bytes of a frame; `timeout_ns`: the longest gap, 0: any.

    `text`: frames are STRINGs. A byte 00 ends them, and a size that is reached is never a good end.
    """

    size: int
    prefix: bytes = b""
    suffix: bytes = b""
    timeout_ns: int = 0
    text: bool = False

    def cuts_like(self, other: Framing) -> bool:
        """Return whether only the timeout differs, if anything."""
        mine = self.size, self.prefix, self.suffix, self.text
        return mine == (other.size, other.prefix, other.suffix, other.text)


class Frame(NamedTuple):
    """A frame: its bytes, prefix and suffix among them, and what ended it."""

    content: bytes
    ending: Ending


class Taken(NamedTuple):
    """One call of a framer: how many bytes it took, and the frame that they complete."""

    used: int
    frame: Frame | None = None
