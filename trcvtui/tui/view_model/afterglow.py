"""One-scan pulses made visible: each lamp knows when it was last lit; from the ledger, not from samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from trcvtui.plc.ledger import StatusEdge
from trcvtui.plc.snapshot import InstanceSnapshot
from trcvtui.tui.formatting import SECOND

GLOW_NS: Final = SECOND
DONE, ERROR = "DONE", "ERROR"


@dataclass(frozen=True, slots=True)
class Pulse:
    """A lamp was lit in `scan` at `t_ns` with this STATUS; `rcvd_len` in bytes where the block has it."""

    scan: int
    t_ns: int
    status: int
    rcvd_len: int | None


class Afterglow:
    """The newest pulse of each lamp of each instance. Times are those of the run, so a held PLC glows on."""

    def __init__(self) -> None:
        self._pulses: dict[tuple[str, str], Pulse] = {}

    def note(self, scan: int, t_ns: int, edge: StatusEdge) -> None:
        """Take the lamps of one STATUS edge of the ledger."""
        pulse = Pulse(scan, t_ns, edge.status, edge.rcvd_len)
        if edge.done:
            self._pulses[edge.instance, DONE] = pulse
        if edge.error:
            self._pulses[edge.instance, ERROR] = pulse

    def forget(self, instance: str) -> None:
        """Let nothing glow on: another instance may come under this name."""
        for lamp in (DONE, ERROR):
            self._pulses.pop((instance, lamp), None)

    def catch_up(self, instance: InstanceSnapshot, t_ns: int) -> None:
        """Take pulses whose ledger lines were skipped; their time is then that of the picture."""
        self._catch_up(instance.name, DONE, instance.last_done_scan, t_ns, None, instance.last_rcvd_len)
        self._catch_up(instance.name, ERROR, instance.last_error_scan, t_ns, instance.last_error_status, None)

    def _catch_up(
        self, name: str, lamp: str, scan: int | None, t_ns: int, status: int | None, length: int | None
    ) -> None:
        known = self._pulses.get((name, lamp))
        if scan is None:
            self._pulses.pop((name, lamp), None)  # of one that bore the name before
        elif known is None or known.scan < scan:
            self._pulses[name, lamp] = Pulse(scan, t_ns, status or 0, length)

    def glow(self, instance: str, lamp: str, t_ns: int) -> Pulse | None:
        """Return the pulse that still glows at `t_ns`, else None."""
        pulse = self._pulses.get((instance, lamp))
        return pulse if pulse is not None and t_ns - pulse.t_ns < GLOW_NS else None
