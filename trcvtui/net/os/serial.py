"""Real serial ports, through pyserial (the extra `serial`): a device, or a URL that pyserial knows.

Rule: no call waits. Threads open and close (os_serial_opening.py), one attempt at a time for each port:
as long as a device hangs, nobody tries again.
"""

from __future__ import annotations

import select
from typing import Any, Final

from trcvtui.errors import mistake
from trcvtui.net.os.serial_errors import fault_of
from trcvtui.net.os.serial_opening import Attempt, put_away
from trcvtui.net.results import Fault
from trcvtui.net.serial_line import OPENING, Opening, SerialSettings

PARITIES: Final = {"none": "N", "even": "E", "odd": "O", "mark": "M", "space": "S"}
HANDSHAKES: Final[dict[str, dict[str, bool]]] = {
    "none": {},
    "rts/cts": {"rtscts": True},
    "dsr/dtr": {"dsrdtr": True},
    "xon/xoff": {"xonxoff": True},
}
PIECE: Final = 256  # bytes of one write: a terminal that can be written takes them without a pause


class OsSerialPort:
    """One real port."""

    def __init__(self, settings: SerialSettings) -> None:
        try:
            import serial  # type: ignore[import-untyped]
        except ImportError:
            expected = "it: pip install 'trcvtui[serial]'"
            raise mistake(settings.port, "a serial port, but no pyserial", expected) from None
        self._settings = settings
        self._serial = serial
        self._port: Any = None
        self._attempt: Attempt | None = None
        self._is_given_up = False  # the attempt that still runs

    def open(self) -> Fault | Opening | None:
        """Open it; return what is in the way, OPENING as long as that is not known."""
        if self._attempt is None:
            self._attempt, self._is_given_up = Attempt(self._made), False
        if not self._attempt.is_over:
            return OPENING
        attempt, self._attempt = self._attempt, None
        if self._is_given_up:
            if attempt.port is not None:
                put_away(attempt.port)
            return OPENING  # the next call begins anew
        if attempt.problem is not None:
            return fault_of("open", attempt.problem)
        self._port = attempt.port
        return None

    def _made(self) -> Any:
        """Return the port, which the thread opens."""
        s = self._settings
        return self._serial.serial_for_url(
            s.port,
            do_not_open=True,
            baudrate=s.baud,
            bytesize=s.data_bits,
            parity=PARITIES[s.parity],
            stopbits=s.stop_bits,
            timeout=0,
            # pyserial 3.5 has none for rfc2217; there a socket that has room takes a piece at once.
            write_timeout=None if s.port.startswith("rfc2217://") else 0,
            **HANDSHAKES[s.handshake],
        )

    def read(self, most: int) -> bytes | Fault:
        """Return the bytes that have come."""
        try:
            return bytes(self._port.read(most))
        except (OSError, TypeError) as problem:  # TypeError: pyserial on a port that closed under it
            return self._gone("read", problem)

    def write(self, payload: bytes) -> int | Fault:
        """Hand bytes over, as far as there is room."""
        try:
            if not self._has_room():
                return 0
            return int(self._port.write(payload[:PIECE]) or 0)
        except (OSError, TypeError) as problem:
            return self._gone("write", problem)

    def close(self) -> None:
        """Give the port back; an attempt that still runs is given up."""
        self._is_given_up = True
        if self._port is not None:
            put_away(self._port)
        self._port = None

    def arrive(self, payload: bytes) -> bool:
        """Return that the line is a real one."""
        return False

    def _has_room(self) -> bool:
        """Return whether a write would take bytes at once: pyserial itself tries until it does."""
        try:
            number = (getattr(self._port, "_socket", None) or self._port).fileno()
        except (AttributeError, OSError, ValueError):  # Windows: a queue of its own
            return True
        return number < 0 or bool(select.select([], [number], [], 0)[1])

    def _gone(self, call: str, problem: Exception) -> Fault:
        self.close()
        return fault_of(call, problem)
