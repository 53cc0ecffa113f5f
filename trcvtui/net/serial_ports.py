"""Serial ports beside the real one: one that bench commands feed, and one whose calls fail as planned."""

from __future__ import annotations

from typing import Final

from trcvtui.net.faults import FaultPlan
from trcvtui.net.results import Fault
from trcvtui.net.serial_line import Opening, SerialPort

MOST_WAITING: Final = 1_048_576  # bytes on a simulated line, whose sender nobody can slow


class SimSerialPort:
    """A port that is always there; what is sent to it goes nowhere, what comes while it is closed is lost."""

    def __init__(self) -> None:
        self._is_open = False
        self._waiting = bytearray()

    def open(self) -> None:
        """Open it."""
        self._is_open = True

    def read(self, most: int) -> bytes:
        """Return the bytes that have come."""
        got = bytes(self._waiting[:most])
        del self._waiting[:most]
        return got

    def write(self, payload: bytes) -> int:
        """Take all of it."""
        return len(payload)

    def close(self) -> None:
        """Give the port back."""
        self._is_open = False
        self._waiting.clear()

    def arrive(self, payload: bytes) -> bool:
        """Let bytes come."""
        if self._is_open:
            self._waiting += payload[: MOST_WAITING - len(self._waiting)]
        return True


class FaultyPort:
    """A port whose calls fail as planned; a Fault of `read` or `write` closes it, as one of its own would."""

    def __init__(self, port: SerialPort, plan: FaultPlan, owner: str) -> None:
        self._port, self._plan, self._owner = port, plan, owner

    def open(self) -> Fault | Opening | None:
        """Open it, once: an attempt that lasts is one call."""
        shown = self._port.open()
        if isinstance(shown, Opening):
            return shown
        fault = self._plan.take("open", self._owner)
        if fault is not None:
            self._port.close()
        return fault or shown

    def read(self, most: int) -> bytes | Fault:
        """Return the bytes that have come."""
        return self._broken("read") or self._port.read(most)

    def write(self, payload: bytes) -> int | Fault:
        """Hand bytes over."""
        return self._broken("write") or self._port.write(payload)

    def close(self) -> None:
        """Give the port back."""
        self._port.close()

    def arrive(self, payload: bytes) -> bool:
        """Let bytes come over a simulated line."""
        return self._port.arrive(payload)

    def _broken(self, call: str) -> Fault | None:
        fault = self._plan.take(call, self._owner)
        if fault is not None:
            self._port.close()
        return fault
