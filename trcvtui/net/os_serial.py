"""Real serial ports, through pyserial (the extra `serial`): a device, or a URL that pyserial knows.

Rule: no call waits. A device opens at once; a URL opens as fast as its host answers (pyserial: 5 s at most).
"""

from __future__ import annotations

import errno
import select
from contextlib import suppress
from typing import Any, Final

from trcvtui.errors import mistake
from trcvtui.net.answers import Fault
from trcvtui.net.os_errors import error_name
from trcvtui.net.serial_line import SerialSettings

PARITIES: Final = {"none": "N", "even": "E", "odd": "O", "mark": "M", "space": "S"}
HANDSHAKES: Final[dict[str, dict[str, bool]]] = {
    "none": {},
    "rts/cts": {"rtscts": True},
    "dsr/dtr": {"dsrdtr": True},
    "xon/xoff": {"xonxoff": True},
}
PIECE: Final = 256  # bytes of one write: a terminal that can be written takes them without a pause
GONE: Final = "EIO"


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

    def open(self) -> Fault | None:
        """Open it; return what is in the way."""
        s = self._settings
        try:
            self._port = self._serial.serial_for_url(
                s.port,
                baudrate=s.baud,
                bytesize=s.data_bits,
                parity=PARITIES[s.parity],
                stopbits=s.stop_bits,
                timeout=0,
                write_timeout=0,
                **HANDSHAKES[s.handshake],
            )
        except (
            OSError,
            ValueError,
        ) as problem:  # SerialException is an OSError; ValueError: it cannot do that
            return Fault("open", _name_of(problem))
        return None

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
        """Give the port back."""
        if self._port is None:
            return
        # pyserial 3.5 leaves a socket open that its partner has reset: its shutdown fails before its close.
        left = getattr(self._port, "_socket", None)
        with suppress(OSError):  # it is gone already
            self._port.close()
        if left is not None:
            left.close()
        self._port = None

    def _has_room(self) -> bool:
        """Return whether a write would take bytes at once: pyserial itself tries until it does."""
        try:
            number = self._port.fileno()
        except (AttributeError, OSError):  # rfc2217, Windows: pyserial has a queue or a timeout of its own
            return True
        return bool(select.select([], [number], [], 0)[1])

    def _gone(self, call: str, problem: Exception) -> Fault:
        self.close()
        return Fault(call, _name_of(problem))


def _name_of(problem: Exception) -> str:
    """Return the errno name; pyserial often has words alone for a device that is gone."""
    number = getattr(problem, "errno", None)
    if isinstance(problem, OSError) and number in errno.errorcode:
        return error_name(problem)
    return "EINVAL" if isinstance(problem, ValueError) else GONE
