"""Bytes as `hexdump -v -C` prints them, in pure Python.

A line is a template of fixed columns; of many lines at once one column is filled with one strided copy, so
the work is a few dozen copies for 64 KiB whatever the bytes are (reference/performance.md section 3).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

ROW: Final = 16
BLOCK: Final = 65_536
_LINE: Final = 79  # with its line feed, offsets of eight digits
_PLACES: Final = tuple(10 + 3 * n + (n >= ROW // 2) for n in range(ROW))
_TEXT: Final = 61
_TEMPLATE: Final = b"00000000  " + b"00 " * 8 + b" " + b"00 " * 8 + b" |" + b"." * ROW + b"|\n"
_SHOWN: Final = bytes(byte if 0x20 <= byte < 0x7F else ord(".") for byte in range(256))
_DIGITS: Final = b"0123456789abcdef"
_HIGH: Final = bytes(_DIGITS[byte >> 4] for byte in range(256))
_LOW: Final = bytes(_DIGITS[byte & 15] for byte in range(256))
_EIGHT_DIGITS: Final = 1 << 32  # from there on an offset is wider


def hexdump(content: bytes | bytearray | memoryview) -> bytes:
    """Return the dump of all bytes, each line with its line feed, and the length in the last line."""
    return b"".join(hexdump_blocks(content))


def hexdump_blocks(content: bytes | bytearray | memoryview) -> Iterator[bytes | bytearray]:
    """Yield the dump of 64 KiB after 64 KiB; an empty dump for no bytes."""
    view = memoryview(content).cast("B")
    for start in range(0, len(view), BLOCK):
        yield _block(view[start : start + BLOCK], start)
    if len(view):
        yield b"%08x\n" % len(view)


def _block(part: memoryview, start: int) -> bytes | bytearray:
    full = len(part) - len(part) % ROW
    rows = _rows(part[:full], start) if full else b""
    return rows if full == len(part) else bytes(rows) + _last_row(bytes(part[full:]), start + full)


def _rows(part: memoryview, start: int) -> bytes | bytearray:
    if start + len(part) > _EIGHT_DIGITS:
        rows = range(0, len(part), ROW)
        return b"".join(_last_row(bytes(part[place : place + ROW]), start + place) for place in rows)
    count, content = len(part) // ROW, bytes(part)
    lines = bytearray(_EMPTY[: count * _LINE])
    if start:
        for column, digit in enumerate(b"%04x" % (start >> 16)):
            lines[column::_LINE] = bytes((digit,)) * count
    for place, column in enumerate(_PLACES):
        same = content[place::ROW]
        lines[column::_LINE] = same.translate(_HIGH)
        lines[column + 1 :: _LINE] = same.translate(_LOW)
        lines[_TEXT + place :: _LINE] = same.translate(_SHOWN)
    return lines


def _empty() -> bytes:
    """Return the lines of the first block without its bytes: in every block the low offsets are the same."""
    lines = bytearray(_TEMPLATE) * (BLOCK // ROW)
    for column, shift in ((4, 12), (5, 8), (6, 4)):
        lines[column::_LINE] = bytes(_DIGITS[offset >> shift & 15] for offset in range(0, BLOCK, ROW))
    return bytes(lines)


_EMPTY: Final = _empty()


def _last_row(row: bytes, offset: int) -> bytes:
    """Return one line of any length, offset of any width."""
    left, right = row[:8].hex(" "), row[8:].hex(" ")
    return f"{offset:08x}  {left:<24} {right:<24} |".encode() + row.translate(_SHOWN) + b"|\n"
