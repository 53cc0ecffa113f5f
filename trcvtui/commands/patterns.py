"""Patterns: of the STATUS of every scan (`expect X trace ...`), and of the bytes in a stream (`regex`).

The second is a machine that takes a stream byte by byte and never goes back: a bounded cost a byte.

Why not `re` itself: it tries again from each start, so a few bytes of a peer keep `(a+)+b` running for hours,
and what it finds depends on how the stream was cut. Here all ways of matching go on at once (Glushkov): a
place is one byte of the pattern, a state the set of places that may have come last, one bit each.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Final, NamedTuple

from msgspec import Struct

from trcvtui.errors import mistake

# A trace comes as runs of equal scans. Rule: work grows with atoms x scans / 64. The places that the first
# atoms can reach are the bits of one number, and each atom moves all of them at once, so no pattern can make
# the match backtrack.

Scan = tuple[int, bool]  # STATUS, ERROR
Run = tuple[Scan, int]  # and how many scans of it follow each other

MOST_REPEATS: Final = 1_000_000
NOTATION: Final = "0001 7002+ 7006* 7006{3} 80A1! 80C3!+ ..."
_ATOM: Final = re.compile(r"(?:16#)?([0-9A-Fa-f]{4})(!?)(\+|\*|\{[0-9]{1,7}\})?")


class Atom(Struct, frozen=True):
    """One word of a pattern: a scan (None: any) that comes `least` times, and more often when `more`."""

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


ANY: Final = Atom(None, 0, True)


class TracePattern(Struct, frozen=True):
    """A parsed pattern."""

    atoms: tuple[Atom, ...]

    def __str__(self) -> str:
        """Return the pattern in its own notation."""
        return " ".join(map(str, self.atoms))


def parse_pattern(text: str, where: str = "trace") -> TracePattern:
    """Return the pattern of a text such as `0001 7001 7002+ 80A1! ...`; raise UserError for a wrong word."""
    words = text.split()
    if not words:
        raise mistake(where, "no pattern", f"STATUS words such as {NOTATION}")
    return TracePattern(tuple(_atom(word, where) for word in words))


def _atom(word: str, where: str) -> Atom:
    if word in ("...", "…"):
        return ANY
    found = _ATOM.fullmatch(word)
    if found is None:
        raise mistake(where, f"'{word}'", f"four hex digits and ! + * or {{n}}, such as {NOTATION}")
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
            return _counted(scan, int(times[1:-1]), word, where)


def _counted(scan: Scan, count: int, word: str, where: str) -> Atom:
    if not 1 <= count <= MOST_REPEATS:
        raise mistake(where, f"'{word}'", f"a count from {{1}} to {{{MOST_REPEATS}}}")
    return Atom(scan, count)


def matches(pattern: TracePattern, trace: Sequence[Run]) -> bool:
    """Return whether the pattern describes the whole trace, scan by scan."""
    length = sum(count for _, count in trace)
    everywhere = (1 << length) - 1
    places = {atom.scan: _places_of(atom.scan, trace) for atom in pattern.atoms if atom.scan is not None}
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


def _places_of(scan: Scan, trace: Sequence[Run]) -> int:
    """Return the number whose bit n is set where scan n of the trace is this one."""
    # Base 2 is read in linear time; the last scan is the highest bit.
    return int("".join([("1" if each == scan else "0") * count for each, count in reversed(trace)]) or "0", 2)


def collapse(trace: Iterable[Run]) -> str:
    """Return a trace in the pattern's notation, equal scans counted: `0001 7002{25} 80A1! 7002{3}`."""
    return " ".join(str(Atom(scan, count)) for scan, count in trace) or "no scan"


MOST_PLACES: Final = 128  # a step looks at every place once at most
MOST_NESTED: Final = 32
MOST_KNOWN: Final = 4096  # steps remembered; beyond them the memory begins anew
CHUNK: Final = 8

REPEAT: Final = re.compile(rb"[*+?]|\{(?!\})(\d*)(,?)(\d*)\}")
SIGNS: Final[dict[bytes, tuple[int, int | None]]] = {b"*": (0, None), b"+": (1, None), b"?": (0, 1)}
ESCAPE: Final = re.compile(rb"\\(?:x[0-9a-fA-F]{2}|0[0-7]{0,2}|[1-7][0-7]{2}|[^0-9AbBzZ])", re.DOTALL)
SET: Final = re.compile(rb"\[\^?\]?(?:\\.|[^\\\]])*\]", re.DOTALL)
GROUP: Final = re.compile(rb"\((?:\?:|\?P<\w+>|(?!\?))")
NOT_HERE: Final = {
    b"^": "its ^ asks for the beginning of a text, which a stream has not",
    b"$": "its $ asks for the end of a text, which a stream has not",
    b"\\": "a place in the stream, or what a group has found",
    b"(": "a group that looks around or sets a flag",
    b"+": "a repetition that keeps what it has",
}


class _Part(NamedTuple):
    """A part of the pattern: may it be nothing, which places begin it, which end it."""

    is_nothing: bool
    first: int = 0
    last: int = 0


class _State(dict[int, "_State"]):
    """The places that may have come last; asked for a byte, the state after it."""

    def __init__(self, machine: StreamPattern, places: int, is_end: bool) -> None:
        super().__init__()
        self._machine = machine
        self.places = places
        self.is_end = is_end

    def __missing__(self, byte: int) -> _State:
        state = self[byte] = self._machine.step(self.places, byte)
        return state


class StreamPattern:
    """One pattern, already taken by `re`. Raise ValueError that names what a stream cannot be asked for."""

    def __init__(self, pattern: bytes) -> None:
        self._text = pattern
        self._at = self._depth = 0
        self._fits = [0] * 256  # the places that a byte may stand at
        self._follow: list[int] = []
        whole = self._choice()
        self._first, self._last = whole.first, whole.last
        self._behind = [self._after_chunk(at) for at in range(0, len(self._follow), CHUNK)]
        self._known = 0
        self._states: dict[int, _State] = {}
        self._begin = self._state(0)
        self._now = self._begin

    # -- the stream ----------------------------------------------------------------------------------

    def begin(self) -> None:
        self._now = self._begin

    def take(self, arrived: bytes) -> int:
        """Return how many matches end in these bytes; each ends as early as it can, and none overlap."""
        state, hits = self._now, 0
        for byte in arrived:
            state = state[byte]
            if state.is_end:
                hits, state = hits + 1, self._begin
        self._now = state
        return hits

    @property
    def known(self) -> int:
        """Return how many steps are remembered."""
        return self._known

    def step(self, places: int, byte: int) -> _State:
        """Return the state after one more byte."""
        if self._known >= MOST_KNOWN:
            for state in self._states.values():
                state.clear()
            self._states, self._known = {self._begin.places: self._begin}, 0
        self._known += 1
        may_come = self._first
        for table in self._behind:
            may_come |= table[places & 0xFF]
            places >>= CHUNK
        return self._state(may_come & self._fits[byte])

    def _state(self, places: int) -> _State:
        if places not in self._states:
            self._states[places] = _State(self, places, bool(places & self._last))
        return self._states[places]

    def _after_chunk(self, at: int) -> list[int]:
        table = [0] * (1 << CHUNK)
        for places in range(1, 1 << CHUNK):
            lowest = (places & -places).bit_length() - 1
            follow = self._follow[at + lowest] if at + lowest < len(self._follow) else 0
            table[places] = table[places & (places - 1)] | follow
        return table

    # -- the pattern ---------------------------------------------------------------------------------

    def _choice(self) -> _Part:
        self._depth += 1
        if self._depth > MOST_NESTED:
            raise ValueError(f"groups in groups, {MOST_NESTED} deep")
        found = self._sequence()
        while self._comes(b"|"):
            other = self._sequence()
            found = _Part(
                found.is_nothing or other.is_nothing, found.first | other.first, found.last | other.last
            )
        self._depth -= 1
        return found

    def _sequence(self) -> _Part:
        found = _Part(True)
        while self._at < len(self._text) and self._text[self._at] not in b"|)":
            found = self._joined(found, self._repeated())
        return found

    def _joined(self, one: _Part, two: _Part) -> _Part:
        self._lead(one.last, two.first)
        first = one.first | two.first if one.is_nothing else one.first
        last = one.last | two.last if two.is_nothing else two.last
        return _Part(one.is_nothing and two.is_nothing, first, last)

    def _lead(self, from_places: int, to_places: int) -> None:
        for place in range(from_places.bit_length()):
            if from_places >> place & 1:
                self._follow[place] |= to_places

    def _repeated(self) -> _Part:
        start, found = self._at, self._one()
        repeat = REPEAT.match(self._text, self._at)
        if repeat is None:
            return found
        end, self._at = self._at, repeat.end()
        if self._comes(b"+"):
            raise ValueError(NOT_HERE[b"+"])
        self._comes(b"?")  # as few as can be: the earliest end is taken anyway
        return self._times(found, start, end, *_bounds(repeat)) if found.first else found

    def _times(self, found: _Part, start: int, end: int, least: int, most: int | None) -> _Part:
        result, times = _Part(True), max(least, most or 1)
        for number in range(1, times + 1):
            part = found if number == 1 else self._again(start, end)
            if most is None and number == times:
                self._lead(part.last, part.first)
            result = self._joined(result, part._replace(is_nothing=part.is_nothing or number > least))
        return _Part(True) if most == 0 else result

    def _again(self, start: int, end: int) -> _Part:
        after, text = self._at, self._text
        self._at, self._text = start, text[:end]
        part = self._sequence()
        self._at, self._text = after, text
        return part

    def _one(self) -> _Part:
        """Return a group, or one byte as `re` itself understands it."""
        group = GROUP.match(self._text, self._at)
        if group is not None:
            self._at = group.end()
            found = self._choice()
            self._comes(b")")
            return found
        sign = self._text[self._at : self._at + 1]
        rule = {b"\\": ESCAPE, b"[": SET}.get(sign)
        leaf = rule.match(self._text, self._at) if rule is not None else None
        if leaf is None and sign in NOT_HERE:
            raise ValueError(NOT_HERE[sign])
        written = leaf[0] if leaf is not None else sign
        self._at += len(written)
        return self._place(written)

    def _place(self, written: bytes) -> _Part:
        if len(self._follow) >= MOST_PLACES:
            raise ValueError(f"more than {MOST_PLACES} bytes, repetitions counted")
        place = 1 << len(self._follow)
        self._follow.append(0)
        for byte in _bytes_of(written):
            self._fits[byte] |= place
        return _Part(False, place, place)

    def _comes(self, text: bytes) -> bool:
        is_here = self._text.startswith(text, self._at)
        self._at += len(text) if is_here else 0
        return is_here


def _bounds(repeat: re.Match[bytes]) -> tuple[int, int | None]:
    if repeat[0] in SIGNS:
        return SIGNS[repeat[0]]
    least = int(repeat[1] or 0)
    return least, int(repeat[3]) if repeat[3] else None if repeat[2] else least


@lru_cache(maxsize=256)
def _bytes_of(written: bytes) -> bytes:
    """Return the bytes that one byte of a pattern fits."""
    fits = re.compile(b"\\{" if written == b"{" else written)
    return bytes(byte for byte in range(256) if fits.fullmatch(bytes([byte])))
