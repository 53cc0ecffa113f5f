"""Between a serial port and its ComBuffers: what SerialLineControl does each cycle.

A port that is not there, or vanishes, is looked for again every RETRY_NS; the frame that was half here ends.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.blocks.serial.com_buffer import ComBuffer
from trcvtui.net.results import Fault
from trcvtui.net.serial_line import Opening, SerialPort

RETRY_NS: Final = 1_000_000_000
MOST_A_SCAN: Final = 4096
SLOW: Final = "port opens slowly"
UNANSWERED: Final = Fault("open", "EINPROGRESS", words="nobody has answered yet")


class PortFeed:
    """One port: what comes goes to `rx`, what is in `tx` goes out. `note` tells the ledger what happened.

    `fault`: why it is not there, None while that is not known.
    """

    def __init__(self, port: SerialPort, rx: ComBuffer, note: Callable[[str, str], None]) -> None:
        self.is_open = False
        self.fault: Fault | None = None
        self.tx: ComBuffer | None = None
        self._port = port
        self._rx = rx
        self._note = note
        self._retry_at: int | None = None  # None: at once
        self._told: Fault | None = None
        self._opening_since: int | None = None

    def arrive(self, payload: bytes) -> None:
        """Let bytes come as if over the line."""
        if not self._port.arrive(payload):
            self._rx.put(payload)

    def receive(self, now: int) -> None:
        """Take what has come; what the ComBuffer has no room for is lost, as on a real line."""
        if not self._is_there(now):
            return
        got = self._port.read(MOST_A_SCAN)
        if isinstance(got, Fault):
            self._lost(got, now)
        elif got:
            self._rx.put(got)

    def send(self, most: int, now: int) -> None:
        """Hand on what waits, `most` bytes of it (0: all); while the port is away it waits on."""
        if self.tx is None or not self.is_open or not self.tx.count:
            return
        payload = self.tx.look()
        taken = self._port.write(payload[:most] if most else payload)
        if isinstance(taken, Fault):
            self._lost(taken, now)
        else:
            self.tx.take(taken)

    def close(self) -> None:
        """Give the port back."""
        self._port.close()
        self.is_open, self._retry_at, self._opening_since = False, None, None
        self.fault = None

    def _is_there(self, now: int) -> bool:
        if self.is_open:
            return True
        if self._retry_at is not None and now < self._retry_at:
            return False
        wrong = self._port.open()
        if isinstance(wrong, Opening):
            self._wait(now)
            return False
        self._opening_since = None
        if wrong is None:
            self.is_open, self.fault, self._told = True, None, None
            self._note("port open", "")
            return True
        self._retry_at = now + RETRY_NS
        self._tell("port not there", wrong)
        return False

    def _wait(self, now: int) -> None:
        """Tell, once, that a port takes long to open."""
        if self._opening_since is None:
            self._opening_since = now
        elif now - self._opening_since >= RETRY_NS:
            self._tell(SLOW, UNANSWERED)

    def _tell(self, what: str, fault: Fault) -> None:
        """Tell what is in the way, once, however long it is away."""
        self.fault = fault
        if fault != self._told:
            self._told = fault
            self._note(what, UNANSWERED.words if fault is UNANSWERED else _worded(fault))

    def _lost(self, fault: Fault, now: int) -> None:
        self.close()
        self._retry_at = now + RETRY_NS
        self._rx.end("port gone")
        self.fault = fault
        self._note("port gone", _worded(fault))


def _worded(fault: Fault) -> str:
    return f"{fault}: {fault.words}" if fault.words else str(fault)
