"""Real serial ports, through pyserial (the extra `serial`): a device, or a URL that pyserial knows.

Rule: no call waits. Threads open and close ports, with one attempt at a time for each port. While an
attempt hangs, there is no second one.
"""

from __future__ import annotations

import errno
import select
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, Final

from trcvtui.errors import require
from trcvtui.net.os.system_calls import error_name
from trcvtui.net.results import Fault
from trcvtui.net.serial_line import OPENING, LineErrors, PortOpening, SerialSettings

# Rule: the only threads below `tui`: the calls of pyserial that open and close wait, and a scan must not.
# A thread holds nothing but its port.


class OpenAttempt:
    """An attempt to open a port. When `is_over` is True, either `port` or `problem` is set."""

    def __init__(self, make_port: Callable[[], Any]) -> None:
        self.port: Any = None
        self.problem: Exception | None = None
        self._over = threading.Event()
        threading.Thread(target=self._run, args=(make_port,), daemon=True).start()

    @property
    def is_over(self) -> bool:
        return self._over.is_set()

    def _run(self, make_port: Callable[[], Any]) -> None:
        port = None
        try:
            port = make_port()
            port.open()
            self.port = port
        except Exception as problem:  # drivers and URL handlers raise anything
            self.problem = problem
            _close(port)
        self._over.set()


def close_in_background(port: Any) -> None:
    """Close a port in a thread. Closing waits (pyserial 3.5: a socket 0.3 s, drivers until all is sent)."""
    threading.Thread(target=_close, args=(port,), daemon=True).start()


def _close(port: Any) -> None:
    # pyserial 3.5 leaves a socket open after the partner's RST: its shutdown fails before its close.
    sock = getattr(port, "_socket", None)
    with suppress(Exception):  # it is gone already
        port.close()
    if sock is not None:
        with suppress(OSError):
            sock.close()


PORT_GONE: Final = "EIO"
FAR_END_CLOSED: Final = "EOF"  # not an errno: the far end has closed the connection in good order
MOST_TEXT_CHARS: Final = 160
TRY_AGAIN_ERRORS: Final = (-3, 11002)  # EAI_AGAIN of Linux, WSATRY_AGAIN
# Messages of pyserial 3.5 when no system call has failed.
MESSAGE_ERRORS: Final = (
    ("socket disconnected", FAR_END_CLOSED),
    ("reader thread died", FAR_END_CLOSED),
    ("does not seem to support", "ETIMEDOUT"),  # no answer in RFC 2217
    ("timeout while waiting", "ETIMEDOUT"),
)


def fault_from_error(call: str, problem: BaseException) -> Fault:
    name = next((name for each in _causes(problem) if (name := _errno_name(each))), "") or _pick_name(problem)
    words = "".join([letter for letter in str(problem) if letter.isprintable()])
    return Fault(call, name, words=words[:MOST_TEXT_CHARS])


def _causes(problem: BaseException | None) -> Iterator[BaseException]:
    while problem is not None:
        yield problem
        problem = problem.__cause__ or problem.__context__


def _errno_name(problem: BaseException) -> str:
    number = problem.args[0] if problem.args else None  # an OSError made with only a message has a text here
    if isinstance(problem, socket.gaierror):  # its numbers are no errno
        return "EAI_AGAIN" if number in TRY_AGAIN_ERRORS else "EAI_NONAME"
    if isinstance(number, int) and number in errno.errorcode:  # termios.error is no OSError
        return error_name(OSError(number, ""))
    if isinstance(problem, TimeoutError):
        return "ETIMEDOUT"
    return "EINVAL" if isinstance(problem, ValueError) else ""


def _pick_name(problem: BaseException) -> str:
    return next((name for words, name in MESSAGE_ERRORS if words in str(problem)), PORT_GONE)


PARITIES: Final = {"none": "N", "even": "E", "odd": "O", "mark": "M", "space": "S"}
HANDSHAKES: Final[dict[str, dict[str, bool]]] = {
    "none": {},
    "rts/cts": {"rtscts": True},
    "dsr/dtr": {"dsrdtr": True},
    "xon/xoff": {"xonxoff": True},
}
TIOCGICOUNT: Final = 0x545D
# struct serial_icounter_struct: six others, frame, overrun, parity, brk, buf_overrun, nine reserved.
_ICOUNTS: Final = struct.Struct("24x5i36x")
WRITE_BYTES: Final = 256  # bytes of one write: a terminal that is writable takes so many without waiting


class OsSerialPort:
    def __init__(self, settings: SerialSettings) -> None:
        self._serial = require("serial", "serial", settings.port, "a serial port, but no pyserial")
        self._settings = settings
        self._port: Any = None
        self._attempt: OpenAttempt | None = None
        self._is_given_up = False  # the running attempt

    def open(self) -> Fault | PortOpening | None:
        if self._attempt is None:
            self._attempt, self._is_given_up = OpenAttempt(self._make_port), False
        if not self._attempt.is_over:
            return OPENING
        attempt, self._attempt = self._attempt, None
        if self._is_given_up:
            if attempt.port is not None:
                close_in_background(attempt.port)
            return OPENING  # the next call starts a new attempt
        if attempt.problem is not None:
            return fault_from_error("open", attempt.problem)
        self._port = attempt.port
        return None

    def _make_port(self) -> Any:
        s = self._settings
        return self._serial.serial_for_url(
            s.port,
            do_not_open=True,
            baudrate=s.baud,
            bytesize=s.data_bits,
            parity=PARITIES[s.parity],
            stopbits=s.stop_bits,
            timeout=0,
            # pyserial 3.5 has no write timeout for rfc2217; `_has_room` keeps that write from waiting.
            write_timeout=None if s.port.startswith("rfc2217://") else 0,
            **HANDSHAKES[s.handshake],
        )

    def read(self, most: int) -> bytes | Fault:
        try:
            return bytes(self._port.read(most))
        except (OSError, TypeError) as problem:  # TypeError: pyserial on a port that closed under it
            return self._close_as_gone("read", problem)

    def write(self, payload: bytes) -> int | Fault:
        try:
            if not self._has_room():
                return 0
            return int(self._port.write(payload[:WRITE_BYTES]) or 0)
        except (OSError, TypeError) as problem:
            return self._close_as_gone("write", problem)

    def close(self) -> None:
        self._is_given_up = True  # a running attempt: a thread cannot be stopped, its port is closed later
        if self._port is not None:
            close_in_background(self._port)
        self._port = None

    def simulate_arrival(self, payload: bytes) -> bool:
        return False

    def line_errors(self) -> LineErrors | None:
        """Return how many line errors Linux has counted at a UART (TIOCGICOUNT). Elsewhere return None."""
        try:
            from fcntl import ioctl

            counted = _ICOUNTS.unpack(ioctl(self._port.fileno(), TIOCGICOUNT, bytes(_ICOUNTS.size)))
        except (ImportError, AttributeError, OSError, ValueError, TypeError):
            return None
        framing, overruns, parity, breaks, full = counted
        return framing, parity, breaks, overruns + full

    def _has_room(self) -> bool:
        """Return whether the port takes bytes now; if not, pyserial's own write would wait."""
        try:
            number = (getattr(self._port, "_socket", None) or self._port).fileno()
        except (AttributeError, OSError, ValueError):  # Windows: a queue of its own
            return True
        return number < 0 or bool(select.select([], [number], [], 0)[1])

    def _close_as_gone(self, call: str, problem: Exception) -> Fault:
        self.close()
        return fault_from_error(call, problem)
