"""Checksums of a message, as machines send them."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from functools import reduce
from operator import xor
from typing import Final

CRC16_START, CRC16_POLYNOMIAL = 0xFFFF, 0xA001


def _crc16_table_entry(byte: int) -> int:
    for _ in range(8):
        byte = (byte >> 1) ^ (CRC16_POLYNOMIAL if byte & 1 else 0)
    return byte


_CRC16_TABLE: Final = tuple(_crc16_table_entry(byte) for byte in range(256))


def _crc16_modbus(content: bytes) -> int:
    crc = CRC16_START
    for byte in content:
        crc = (crc >> 8) ^ _CRC16_TABLE[(crc ^ byte) & 0xFF]
    return crc


CHECKSUMS: Final[dict[str, tuple[int, Callable[[bytes], int]]]] = {
    "sum8": (1, lambda content: sum(content) & 0xFF),
    "xor8": (1, lambda content: reduce(xor, content, 0)),
    "crc16-modbus": (2, _crc16_modbus),
    "crc32": (4, zlib.crc32),
}
