"""What a race has shown: frozen rows, a dialect beside the other, and where they differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

CALLED: Final = "called"
FIELDS: Final = ("STATUS", "BUSY", "DONE", "ERROR", "RCVD_LEN", "DATA")


class Shown(NamedTuple):
    """What one instance shows in one scan. `data` is a short hash of all of DATA, "" without DATA."""

    status: int
    busy: bool
    done: bool
    error: bool
    rcvd_len: int | None
    data: str


@dataclass(frozen=True, slots=True)
class Row:
    """`scans` equal scans from `scan` on, one entry a dialect; None: not called in that scan."""

    scan: int
    scans: int
    shown: tuple[Shown | None, ...]

    @property
    def differs(self) -> tuple[str, ...]:
        """Return in what the dialects differ here: outputs, DATA, or whether the block was called."""
        if len(set(self.shown)) == 1:
            return ()
        called = [each for each in self.shown if each is not None]
        if len(called) < len(self.shown):
            return (CALLED,)
        columns = zip(*called, strict=True)
        return tuple(name for name, values in zip(FIELDS, columns, strict=True) if len(set(values)) > 1)


@dataclass(frozen=True, slots=True)
class InstanceRace:
    """One instance in the dialects that have it; `is_cut`: later rows are not kept."""

    instance: str
    block: str
    dialects: tuple[str, ...]
    rows: tuple[Row, ...]
    is_cut: bool = False

    @property
    def scans(self) -> int:
        """Return of how many scans the rows tell."""
        return sum(row.scans for row in self.rows)

    @property
    def differing(self) -> int:
        """Return in how many of them the dialects differ."""
        return sum(row.scans for row in self.rows if row.differs)

    @property
    def first(self) -> Row | None:
        """Return the first row in which they differ."""
        return next((row for row in self.rows if row.differs), None)


@dataclass(frozen=True, slots=True)
class Note:
    """What a dialect did not do as the scenario says; `step` 0: before the first one."""

    dialect: str
    step: int
    text: str


@dataclass(frozen=True, slots=True)
class Race:
    """One race from its first scan to its last."""

    name: str
    dialects: tuple[str, ...]
    interval_ns: int
    scans: int
    expectations: int  # `expect` steps that were left out
    instances: tuple[InstanceRace, ...]
    notes: tuple[Note, ...]
