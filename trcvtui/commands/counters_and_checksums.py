"""Numbers and checksums that each sent message gets anew, and the frames of self-checking traffic.

Rule: the number is filled in first, then the checksums by offset, so one checksum may cover another.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

from trcvtui.snapshots.bench import TrafficCheckTally
from trcvtui.udt.compare.checksums import CHECKSUMS

# A frame: C5 5C, the number (4 bytes), filling, CRC32 of all before; numbers big-endian.

FRAME_MARK: Final = b"\xc5\x5c"
NUMBER_END: Final = len(FRAME_MARK) + 4
CRC_BYTES: Final = 4
LEAST_FRAME_SIZE: Final = NUMBER_END + CRC_BYTES
FRAME_FILLING: Final = bytes(range(256))


def make_frame(number: int, size: int) -> bytes:
    room = size - LEAST_FRAME_SIZE
    filling = (FRAME_FILLING * (room // 256 + 1))[:room]
    body = FRAME_MARK + (number & 0xFFFFFFFF).to_bytes(4, "big") + filling
    return body + zlib.crc32(body).to_bytes(CRC_BYTES, "big")


class FrameChecker:
    """The receiver of frames of one size; it keeps fewer bytes than one frame, whatever arrives."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._kept = bytearray()
        self._next = 0
        self._is_shifted = False  # looking for the next frame
        self._frames = self._lost = self._doubled = self._shifts = self._strange = 0

    def begin_stream(self) -> None:
        """Begin with a new stream: an incomplete frame of the old one is dropped."""
        self._kept.clear()
        self._is_shifted = False

    def check_bytes(self, arrived: bytes) -> None:
        self._kept += arrived
        at = 0
        while at + self._size <= len(self._kept):
            if self._is_frame(at):
                self._count_frame(int.from_bytes(self._kept[at + len(FRAME_MARK) : at + NUMBER_END], "big"))
                at, self._is_shifted = at + self._size, False
                continue
            place = self._kept.find(FRAME_MARK, at + 1)  # no frame here: look for the next mark
            then = place if place >= 0 else max(at + 1, len(self._kept) - len(FRAME_MARK) + 1)
            self._shifts += not self._is_shifted
            self._strange += then - at
            at, self._is_shifted = then, True
        del self._kept[:at]

    def _is_frame(self, at: int) -> bool:
        if not self._kept.startswith(FRAME_MARK, at):
            return False
        body = self._kept[at : at + self._size - CRC_BYTES]
        crc = self._kept[at + self._size - CRC_BYTES : at + self._size]
        return zlib.crc32(body) == int.from_bytes(crc, "big")

    def _count_frame(self, number: int) -> None:
        self._frames += 1
        if number < self._next:
            self._doubled += 1
            return
        self._lost += number - self._next
        self._next = number + 1

    def tally(self) -> TrafficCheckTally:
        return TrafficCheckTally(self._frames, self._lost, self._doubled, self._shifts, self._strange)


BINARY_NUMBER, DECIMAL_DIGITS = "n", "digits"
NUMBER_KINDS: Final = (BINARY_NUMBER, DECIMAL_DIGITS)
ByteOrder = Literal["little", "big"]
FILL_KINDS: Final = (*NUMBER_KINDS, *CHECKSUMS)


@dataclass(frozen=True, slots=True)
class Fill:
    """`width` bytes at `offset` for a binary number, decimal digits or a checksum of all earlier bytes.

    If `hole`, the command wrote the number as {n} in the text, and not as an option after the text.
    """

    kind: str
    offset: int
    width: int
    order: ByteOrder = "little"
    hole: bool = field(default=False, compare=False)

    def content(self, before: bytes, number: int) -> bytes:
        """Return the bytes to fill in after the bytes `before`. `number` counts the messages from 0."""
        if self.kind == BINARY_NUMBER:
            return (number % (1 << 8 * self.width)).to_bytes(self.width, self.order)
        if self.kind == DECIMAL_DIGITS:
            return b"%0*d" % (self.width, number % 10**self.width)
        return CHECKSUMS[self.kind][1](before).to_bytes(self.width, self.order)


def fill_message(payload: bytes, fills: Sequence[Fill], number: int) -> bytes:
    """Return a message with everything filled in; a fill at the end makes the message longer."""
    if not fills:
        return payload
    content = bytearray(payload)
    for fill in sort_fills(fills):
        content[fill.offset : fill.offset + fill.width] = fill.content(bytes(content[: fill.offset]), number)
    return bytes(content)


def sort_fills(fills: Sequence[Fill]) -> list[Fill]:
    return sorted(fills, key=lambda fill: (fill.kind not in NUMBER_KINDS, fill.offset))  # the rule above
