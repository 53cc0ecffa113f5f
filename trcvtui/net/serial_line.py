"""A serial line as its settings, and the seam to it: four calls that never wait and never raise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from trcvtui.net.answers import Fault


@dataclass(frozen=True, slots=True)
class SerialSettings:
    """A port by its name or URL, such as `/dev/ttyUSB0`, `COM3`, `socket://10.0.0.7:4001`."""

    port: str
    baud: int = 9600
    data_bits: int = 8
    parity: str = "none"
    stop_bits: float = 1
    handshake: str = "none"


class SerialPort(Protocol):
    """One port. A Fault of `read` or `write` means that it is gone, and closed."""

    def open(self) -> Fault | None:
        """Open it; return what is in the way."""
        ...

    def read(self, most: int) -> bytes | Fault:
        """Return the bytes that have come, none where none have."""
        ...

    def write(self, payload: bytes) -> int | Fault:
        """Hand bytes over and return how many of them were taken, also none."""
        ...

    def close(self) -> None:
        """Give the port back."""
        ...


SerialPorts = Callable[[SerialSettings], SerialPort]
