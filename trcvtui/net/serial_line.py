"""The settings and calls of a serial line, and a simulated line. No call waits, and no call raises."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

from msgspec import Struct

from trcvtui.net.results import Fault

# The calls that a fault plan can make fail, beside those of the network.
SERIAL_CALLS: Final = ("open", "read", "write")
TCP_URL_PREFIXES: Final = ("socket://", "rfc2217://")  # such a URL makes a TCP connection


class PortOpening:
    """The answer of `open` while the attempt is still running."""


OPENING: Final = PortOpening()


class SerialSettings(Struct, frozen=True):
    """A port by its name or URL, such as `/dev/ttyUSB0`, `COM3`, `socket://10.0.0.7:4001`."""

    port: str
    baud: int = 9600
    data_bits: int = 8
    parity: str = "none"
    stop_bits: float = 1
    handshake: str = "none"


LineErrors = tuple[int, int, int, int]  # framing, parity, breaks, overruns


class SerialPort(Protocol):
    """One port. If `read` or `write` returns a Fault, the port is gone and closed."""

    def open(self) -> Fault | PortOpening | None:
        """Open the port. Return None once it is open, a Fault, or OPENING. After OPENING, call it again."""

    def read(self, most: int) -> bytes | Fault:
        """Return the bytes that have come, b"" if there are none."""

    def write(self, payload: bytes) -> int | Fault:
        """Hand bytes over; return how many of them the port took, maybe 0."""

    def close(self) -> None:
        """Close the port, or give up the attempt to open it."""

    def simulate_arrival(self, payload: bytes) -> bool:
        """Simulate received bytes; return False on a real line."""

    def line_errors(self) -> LineErrors | None:
        """Return the line errors that the driver has counted, or None if the driver does not count."""


SerialPortFactory = Callable[[str, SerialSettings], SerialPort]  # by the name of the ComBuffer


SIMULATED_LINE_BYTES: Final = 1_048_576  # unread bytes of a simulated line; a sender cannot be slowed


class SimSerialPort:
    """A port that is always there. Written bytes vanish. Bytes that come to a closed port are lost."""

    def __init__(self) -> None:
        self.is_open = False
        self._waiting = bytearray()

    def open(self) -> None:
        self.is_open = True

    def read(self, most: int) -> bytes:
        got = bytes(self._waiting[:most])
        del self._waiting[:most]
        return got

    def write(self, payload: bytes) -> int:
        return len(payload)

    def close(self) -> None:
        self.is_open = False
        self._waiting.clear()

    def simulate_arrival(self, payload: bytes) -> bool:
        if self.is_open:
            self._waiting += payload[: SIMULATED_LINE_BYTES - len(self._waiting)]
        return True

    def line_errors(self) -> None:
        return
