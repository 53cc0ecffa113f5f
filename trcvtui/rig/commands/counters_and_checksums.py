"""What is filled into a message each time it is sent: a rising number, a checksum over what stands before.

Rule: the number first, then the checksums in the order of their offsets, so that one may cover another.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal, cast

NUMBER, DIGITS = "n", "digits"
NUMBERS: Final = (NUMBER, DIGITS)
CRC16_START, CRC16_POLYNOMIAL = 0xFFFF, 0xA001
Order = Literal["little", "big"]


def _sum8(content: bytes) -> int:
    return sum(content) & 0xFF


def _xor8(content: bytes) -> int:
    found = 0
    for byte in content:
        found ^= byte
    return found


def _crc16_row(byte: int) -> int:
    for _ in range(8):
        byte = (byte >> 1) ^ (CRC16_POLYNOMIAL if byte & 1 else 0)
    return byte


_CRC16: Final = tuple(_crc16_row(byte) for byte in range(256))


def _crc16_modbus(content: bytes) -> int:
    crc = CRC16_START
    for byte in content:
        crc = (crc >> 8) ^ _CRC16[(crc ^ byte) & 0xFF]
    return crc


CHECKSUMS: Final[dict[str, tuple[int, Callable[[bytes], int]]]] = {
    "sum8": (1, _sum8),
    "xor8": (1, _xor8),
    "crc16-modbus": (2, _crc16_modbus),
    "crc32": (4, zlib.crc32),
}
KINDS: Final = (*NUMBERS, *CHECKSUMS)


@dataclass(frozen=True, slots=True)
class Fill:
    """`width` bytes at `offset`: n (binary), digits (decimal) or a checksum of all bytes before.

    `hole`: it stands as {n} in the payload's text, not as an option behind it.
    """

    kind: str
    offset: int
    width: int
    order: Order = "little"
    hole: bool = field(default=False, compare=False)

    def content(self, before: bytes, number: int) -> bytes:
        """Return the bytes, given those before them and the number of the message, from 0."""
        if self.kind == NUMBER:
            return (number % (1 << 8 * self.width)).to_bytes(self.width, self.order)
        if self.kind == DIGITS:
            return b"%0*d" % (self.width, number % 10**self.width)
        return CHECKSUMS[self.kind][1](before).to_bytes(self.width, self.order)


def filled(payload: bytes, fills: Sequence[Fill], number: int) -> bytes:
    """Return a message with everything filled in; what stands at its end makes it longer."""
    if not fills:
        return payload
    content = bytearray(payload)
    for fill in in_order(fills):
        content[fill.offset : fill.offset + fill.width] = fill.content(bytes(content[: fill.offset]), number)
    return bytes(content)


def in_order(fills: Sequence[Fill]) -> list[Fill]:
    """Return fills in the order in which they are put in."""
    return sorted(fills, key=lambda fill: (fill.kind not in NUMBERS, fill.offset))


def as_order(text: str) -> Order:
    """Return a byte order that a project or a command names."""
    return cast(Order, text)
