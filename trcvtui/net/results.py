"""The values that cross the seam and rise through the floors: WOULD_BLOCK, Fault, Endpoint, Datagram."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import Final


class WouldBlock(Enum):
    """The answer "not now": nothing to read, no room to write, no verdict yet.

    HELD_BACK: something to read may be there, but this scan has done its part for it (net/work.py).
    """

    WOULD_BLOCK = "WOULD_BLOCK"
    HELD_BACK = "HELD_BACK"


WOULD_BLOCK: Final = WouldBlock.WOULD_BLOCK
HELD_BACK: Final = WouldBlock.HELD_BACK


@dataclass(frozen=True, slots=True)
class Fault:
    """A call that failed: its name, the errno name, whether a fault plan did it, the system's own words.

    `peer`: whom it was about, where only the kernel's side knows.
    """

    call: str
    error: str
    injected: bool = False
    words: str = field(default="", compare=False)
    peer: str = field(default="", compare=False)

    def __str__(self) -> str:
        """Return `bind EADDRINUSE`, with `(injected)` behind it where a plan did it."""
        return f"{self.call} {self.error}" + (" (injected)" if self.injected else "")


@dataclass(frozen=True, slots=True, order=True)
class Endpoint:
    """One end of a connection or of a datagram's way: a dotted IPv4 address and a port (0..65535)."""

    address: str
    port: int

    def __str__(self) -> str:
        """Return `127.0.0.1:2000`."""
        return f"{self.address}:{self.port}"


@dataclass(frozen=True, slots=True)
class Datagram:
    """One datagram that was taken: `size` bytes of it are in the view, `whole` is how many it had."""

    size: int
    source: Endpoint
    whole: int

    @property
    def is_cut(self) -> bool:
        """Return whether the view was too small for it: the rest is gone."""
        return self.size < self.whole
