"""The ERRORs of a run and their causes, for reports: each in one line, however often it came.

Bounds: MOST_KEPT different ones, the oldest are forgotten first; a report of a failed step holds NEWEST.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

from trcvtui.blocks.cause import Cause
from trcvtui.plc.ledger import StatusEdge
from trcvtui.rig.diagnosis.advice import because

MOST_KEPT: Final = 100
NEWEST: Final = 5


@dataclass(frozen=True, slots=True)
class ErrorTold:
    """One cause of ERROR at one instance: its STATUS, the first and last scan, how many such edges."""

    instance: str
    status: int
    text: str
    scan: int
    last: int
    times: int = 1

    def __str__(self) -> str:
        """Return `TRCV_C_1 80C5 in scan 12: the partner closed ...`."""
        when = f"in scan {self.scan}"
        if self.times > 1:
            when = f"{self.times} times in scans {self.scan} to {self.last}"
        return f"{self.instance} {self.status:04X} {when}: {self.text}"


class Errors:
    """What has been seen so far."""

    def __init__(self) -> None:
        self._told: dict[tuple[str, int, str], ErrorTold] = {}

    def see(self, scan: int, changed: Iterable[StatusEdge]) -> None:
        """Take what changed in a scan."""
        for edge in changed:
            if not edge.outputs.error:
                continue
            told = ErrorTold(edge.instance, edge.outputs.status, because(edge.cause, edge.block), scan, scan)
            key = told.instance, told.status, told.text
            known = self._told.get(key)
            self._told[key] = told if known is None else replace(known, last=scan, times=known.times + 1)
            if len(self._told) > MOST_KEPT:
                del self._told[next(iter(self._told))]

    def all(self) -> tuple[ErrorTold, ...]:
        """Return them in the order in which they came."""
        return tuple(self._told.values())

    def newest(self) -> tuple[ErrorTold, ...]:
        """Return the newest ones, the newest last."""
        return tuple(sorted(self._told.values(), key=lambda told: told.last)[-NEWEST:])


def cause_record(cause: Cause, block: str) -> dict[str, object]:
    """Return a cause as an object of JSON: what took no part is null."""
    return {
        "text": because(cause, block),
        "call": cause.asked or None,
        "errno": cause.errno or None,
        "peer": cause.peer or None,
        "injected": cause.injected,
    }
