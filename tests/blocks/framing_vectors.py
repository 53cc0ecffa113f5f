"""The vectors V01 to V40 of ReceiveData, read from their table."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

TABLE = Path(__file__).with_name("framing_vectors.txt")
CYCLE_MS = 10


@dataclass(frozen=True)
class Call:
    """What one call gives: DataReceived with a frame, or a new error."""

    ms: int
    done: bool
    error: int
    timeout: bool = False
    data: bytes = b""


@dataclass(frozen=True)
class Vector:
    """One row. Times in ms; `suffixes` are (from when, suffix), `fed` is (time, bytes)."""

    id: str
    case: str
    settings: str
    prefix: bytes
    suffixes: tuple[tuple[int, bytes], ...]
    size: int
    timeout: int
    cycle: int
    reset_at: int | None
    fed: tuple[tuple[int, bytes], ...]
    calls: tuple[Call, ...]
    busy: bool
    part: bytes
    discarded: int
    left: bytes

    @property
    def has_target(self) -> bool:
        return "pReceiveData = 0" not in self.settings

    @property
    def has_prefix(self) -> bool:
        """Return whether pPrefix points somewhere."""
        return "pPrefix = 0" not in self.settings

    @property
    def len_prefix(self) -> int:
        return len(self.prefix) or int(not self.has_prefix)

    def suffix_at(self, ms: int) -> bytes:
        return [suffix for since, suffix in self.suffixes if since <= ms][-1]

    def arrived(self, before: int, until: int) -> bytes:
        return b"".join(piece for ms, piece in self.fed if before < ms <= until)

    @property
    def last_ms(self) -> int:
        events = [ms for ms, _ in self.fed] + [call.ms for call in self.calls] + [20]
        return max(events) + self.timeout + 2 * self.cycle


HEX = r"((?:[0-9A-F]{2} ?)+)"


def _hex(pattern: str, text: str) -> bytes:
    found = re.search(pattern + HEX, text)
    return bytes.fromhex(found[1]) if found else b""


def _number(pattern: str, text: str, default: int = 0) -> int:
    found = re.search(pattern + r"(\d+)", text)
    return int(found[1]) if found else default


def _call(text: str) -> Call:
    data = _hex("data=", text)
    call = Call(_number("t=", text), "DR=1" in text, _number("Err=", text), _number("To=", text) == 1, data)
    assert not call.done or _number("Len=", text) == len(data)
    return call


def _suffixes(settings: str) -> tuple[tuple[int, bytes], ...]:
    first = (-1, _hex(r"suffix ", settings))
    changed = _hex("changed to ", settings)
    return (first, (_number("at t=", settings), changed)) if changed else (first,)


def _vector(row: str) -> Vector:
    name, case, settings, fed, output, end = [cell.strip() for cell in row.strip("| \n").split(" | ")]
    pieces = [piece.partition(":") for piece in fed.split(";")] if fed != "none" else []
    return Vector(
        name,
        case,
        settings,
        _hex("prefix ", settings),
        _suffixes(settings),
        _number("size ", settings),
        _number("timeout ", settings),
        _number("cycle ", settings, CYCLE_MS),
        _number("Reset=TRUE at t=", settings) if "Reset" in settings else None,
        tuple((int(ms), bytes.fromhex(piece)) for ms, _, piece in pieces),
        tuple(_call(text) for text in output.split("<br>")) if output != "none" else (),
        "busy=1" in end,
        _hex("part=", end),
        _number("discarded=", end),
        _hex("in buffer=", end),
    )


VECTORS = tuple(_vector(row) for row in TABLE.read_text(encoding="utf-8").splitlines())
