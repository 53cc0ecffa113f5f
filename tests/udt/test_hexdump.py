"""The export of bytes: the same text as `hexdump -v -C`, byte for byte."""

from __future__ import annotations

import random
import shutil
import subprocess

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trcvtui.udt.byte_text import BLOCK, _last_row, _rows, hexdump, hexdump_blocks

NEEDS_HEXDUMP = pytest.mark.skipif(shutil.which("hexdump") is None, reason="needs the program hexdump")


def test_a_dump_has_offset_hex_text_and_at_last_the_length() -> None:
    assert hexdump(b"0123456789abcdef\x00\x1b[1m\x7f\xff") == (
        b"00000000  30 31 32 33 34 35 36 37  38 39 61 62 63 64 65 66  |0123456789abcdef|\n"
        b"00000010  00 1b 5b 31 6d 7f ff                              |..[1m..|\n"
        b"00000017\n"
    )


def test_equal_lines_are_not_left_out() -> None:
    assert hexdump(bytes(48)).count(b"|................|") == 3


def test_no_bytes_are_no_dump() -> None:
    assert hexdump(b"") == b""


@pytest.mark.parametrize("size", [1, 7, 8, 9, 15, 16, 17, 32, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 5])
def test_every_line_stands_as_if_it_were_made_alone(size: int) -> None:
    content = random.Random(size).randbytes(size)
    lines = [_last_row(content[place : place + 16], place) for place in range(0, size, 16)]
    assert hexdump(content) == b"".join(lines) + f"{size:08x}\n".encode()


def test_offsets_grow_beyond_eight_digits() -> None:
    assert bytes(_rows(memoryview(bytes(16)), 1 << 32)).startswith(b"100000000  00 00")


def test_it_comes_in_blocks_of_bounded_size() -> None:
    pieces = list(hexdump_blocks(bytes(2 * BLOCK + 3)))
    assert len(pieces) == 4
    assert b"".join(pieces) == hexdump(bytes(2 * BLOCK + 3))


@NEEDS_HEXDUMP
@given(st.binary(min_size=1, max_size=400))
def test_hexdump_itself_says_the_same(content: bytes) -> None:
    theirs = subprocess.run(["hexdump", "-v", "-C"], input=content, capture_output=True, check=True)
    assert hexdump(content) == theirs.stdout


@NEEDS_HEXDUMP
def test_hexdump_itself_says_the_same_of_a_mebibyte() -> None:
    content = random.Random(1).randbytes((1 << 20) + 11)
    theirs = subprocess.run(["hexdump", "-v", "-C"], input=content, capture_output=True, check=True)
    assert hexdump(content) == theirs.stdout
