"""Bytes as `hexdump -v -C` prints them, in pure Python.

A line is a template of fixed columns, filled in pieces of eight characters: three for eight bytes, two for
the text. Eight lines are a whole number of such pieces, so in every eighth line a piece has the same place,
and one strided copy puts it into all of them: 64 copies for 32 KiB, whatever the bytes are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

ROW: Final = 16
BLOCK: Final = 32_768
_LINE: Final = 79  # with its line feed, offsets of eight digits
_PIECE: Final = 8  # characters: the widest item that a memoryview copies
_BYTES: Final = (10, 18, 26, 35, 43, 51)  # columns of the pieces
_TEXT: Final = (61, 69)
_TEMPLATE: Final = b"00000000  " + b"00 " * 8 + b" " + b"00 " * 8 + b" |" + b"." * ROW + b"|\n"
_SHOWN: Final = bytes(byte if 0x20 <= byte < 0x7F else ord(".") for byte in range(256))
_DIGITS: Final = b"0123456789abcdef"
_EIGHT_DIGITS: Final = 1 << 32  # from there on an offset is wider


def hexdump(content: bytes | bytearray | memoryview) -> bytes:
    """Return the dump of all bytes, each line with its line feed, and the length in the last line."""
    return b"".join(hexdump_blocks(content))


def hexdump_blocks(content: bytes | bytearray | memoryview) -> Iterator[bytes | bytearray]:
    """Yield the dump of 32 KiB after 32 KiB; an empty dump for no bytes."""
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
    lines = bytearray(_EMPTY[start // BLOCK % 2][: len(part) // ROW * _LINE])
    for column, digit in enumerate(b"%04x" % (start >> 16)):
        lines[column::_LINE] = bytes((digit,)) * (len(part) // ROW)
    _fill(lines, _BYTES, (part.hex(" ") + " ").encode())
    _fill(lines, _TEXT, bytes(part).translate(_SHOWN))
    return lines


def _fill(lines: bytearray, columns: Sequence[int], content: bytes) -> None:
    """Copy the pieces of each line to their columns."""
    whole, pieces = memoryview(lines), memoryview(content).cast("Q")
    shifted = [_in_pieces(whole[shift:]) for shift in range(_PIECE)]
    step = _PIECE * len(columns)
    for line in range(min(_PIECE, len(lines) // _LINE)):
        for number, column in enumerate(columns):
            place, shift = divmod(line * _LINE + column, _PIECE)
            shifted[shift][place::_LINE] = pieces[line * len(columns) + number :: step]


def _in_pieces(characters: memoryview) -> memoryview:
    return characters[: len(characters) - len(characters) % _PIECE].cast("Q")


def _empty(start: int) -> bytes:
    """Return the lines of a block without its bytes: of two blocks in turn the low offsets are the same."""
    lines = bytearray(_TEMPLATE) * (BLOCK // ROW)
    for column, shift in ((4, 12), (5, 8), (6, 4)):
        offsets = range(start, start + BLOCK, ROW)
        lines[column::_LINE] = bytes(_DIGITS[offset >> shift & 15] for offset in offsets)
    return bytes(lines)


_EMPTY: Final = (_empty(0), _empty(BLOCK))


def _last_row(row: bytes, offset: int) -> bytes:
    """Return one line of any length, offset of any width."""
    left, right = row[:8].hex(" "), row[8:].hex(" ")
    return f"{offset:08x}  {left:<24} {right:<24} |".encode() + row.translate(_SHOWN) + b"|\n"
