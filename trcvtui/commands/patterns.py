"""Patterns of the STATUS of every scan: `expect X trace 0001 7001 7002+ 80A1! ...`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Final

from msgspec import Struct

from trcvtui.errors import mistake

# A trace has runs of equal scans. Rule: work grows with atoms x scans / 64. The places that the first atoms
# can reach are the bits of one number, and each atom moves all of them at once: no pattern backtracks.

Scan = tuple[int, bool]  # STATUS, ERROR
ScanRun = tuple[Scan, int]  # and how many equal scans follow each other

MOST_REPEATS: Final = 1_000_000
NOTATION: Final = "0001 7002+ 7006* 7006{3} 80A1! 80C3!+ ..."
_ATOM_PATTERN: Final = re.compile(r"(?:16#)?([0-9A-Fa-f]{4})(!?)(\+|\*|\{[0-9]{1,7}\})?")


class Atom(Struct, frozen=True):
    """One word of a pattern: `scan` (None: any scan) comes `least` times, or more often if `more`."""

    scan: Scan | None
    least: int = 1
    more: bool = False

    def __str__(self) -> str:
        """Return the word, such as `80C3!+`."""
        if self.scan is None:
            return "..."
        status, error = self.scan
        return f"{status:04X}{'!' * error}{self._times()}"

    def _times(self) -> str:
        if self.more:
            return "+" if self.least else "*"
        return "" if self.least == 1 else f"{{{self.least}}}"


ANY_SCANS: Final = Atom(None, 0, True)


class TracePattern(Struct, frozen=True):
    atoms: tuple[Atom, ...]

    def __str__(self) -> str:
        return " ".join(map(str, self.atoms))


def parse_pattern(text: str, where: str = "trace") -> TracePattern:
    """Return the pattern of a text such as `0001 7001 7002+ 80A1! ...`; raise UserError for a wrong word."""
    words = text.split()
    if not words:
        raise mistake(where, "no pattern", f"STATUS words such as {NOTATION}")
    return TracePattern(tuple(_parse_atom(word, where) for word in words))


def _parse_atom(word: str, where: str) -> Atom:
    if word in ("...", "…"):
        return ANY_SCANS
    found = _ATOM_PATTERN.fullmatch(word)
    if found is None:
        raise mistake(where, f"'{word}'", f"four hex digits, optional ! and + * or {{n}}, such as {NOTATION}")
    digits, mark, times = found.groups()
    scan = (int(digits, 16), bool(mark))
    match times:
        case None:
            return Atom(scan)
        case "+":
            return Atom(scan, 1, True)
        case "*":
            return Atom(scan, 0, True)
        case _:
            return _make_counted_atom(scan, int(times[1:-1]), word, where)


def _make_counted_atom(scan: Scan, count: int, word: str, where: str) -> Atom:
    if not 1 <= count <= MOST_REPEATS:
        raise mistake(where, f"'{word}'", f"a count from {{1}} to {{{MOST_REPEATS}}}")
    return Atom(scan, count)


def matches(pattern: TracePattern, trace: Sequence[ScanRun]) -> bool:
    """Return whether the pattern describes the whole trace, scan by scan."""
    length = sum(count for _, count in trace)
    everywhere = (1 << length) - 1
    places = {atom.scan: _mask_places(atom.scan, trace) for atom in pattern.atoms if atom.scan is not None}
    reached = 1  # bit n: the atoms so far can have used up exactly n scans
    for atom in pattern.atoms:
        here = everywhere if atom.scan is None else places[atom.scan]
        for _ in range(atom.least):
            reached = (reached & here) << 1
            if not reached:
                return False
        if atom.more:
            # A carry runs from each reached place through the run of matching scans after it.
            reached |= ((reached & here) + here) ^ here
    return bool(reached >> length & 1)


def _mask_places(scan: Scan, trace: Sequence[ScanRun]) -> int:
    """Return a number in which bit n is set if scan n of the trace is equal to `scan`."""
    # Base 2 is read in linear time; the last scan is the highest bit.
    return int("".join([("1" if each == scan else "0") * count for each, count in reversed(trace)]) or "0", 2)


def format_trace(trace: Iterable[ScanRun]) -> str:
    """Return a trace in the pattern's notation, equal scans counted: `0001 7002{25} 80A1! 7002{3}`."""
    return " ".join(str(Atom(scan, count)) for scan, count in trace) or "no scan"
