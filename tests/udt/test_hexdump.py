"""The export of bytes: the same text as `hexdump -v -C`, byte for byte."""

from __future__ import annotations

import random
import shutil
import subprocess

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trcvtui.udt import byte_text
from trcvtui.udt.byte_text import BLOCK, _line, hexdump, hexdump_blocks

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


@pytest.mark.parametrize(
    "size", [1, 7, 8, 9, 15, 16, 17, 32, 127, 128, 129, 250, BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 5]
)
def test_every_line_stands_as_if_it_were_made_alone(size: int) -> None:
    content = random.Random(size).randbytes(size)
    lines = [_line(content[place : place + 16], place) for place in range(0, size, 16)]
    assert hexdump(content) == b"".join(lines) + f"{size:08x}\n".encode()


def test_offsets_grow_beyond_eight_digits(monkeypatch: pytest.MonkeyPatch) -> None:
    assert _line(bytes(16), 1 << 32).startswith(b"100000000  00 00")
    content = random.Random(2).randbytes(BLOCK + 100)
    dump = hexdump(content)
    monkeypatch.setattr(byte_text, "_EIGHT_DIGITS", BLOCK + 32)  # as if the lines from there on were wider
    assert hexdump(content) == dump


def test_it_comes_in_blocks_of_bounded_size_and_all_in_one_buffer() -> None:
    content = random.Random(3).randbytes(3 * BLOCK + 3)
    pieces, kept = [], []
    for piece in hexdump_blocks(content):
        pieces.append(bytes(piece))
        kept.append(piece)
    assert b"".join(pieces) == hexdump(content)
    assert len(pieces) == 5
    assert bytes(kept[0]) == bytes(kept[2]) == pieces[2] != pieces[0], (
        "what was yielded before is overwritten"
    )


def test_the_digits_of_the_offsets_follow_over_a_mebibyte_and_back_to_nought() -> None:
    lines = hexdump(bytes(17 * BLOCK + 16)).splitlines()
    assert [int(line[:8], 16) for line in lines] == list(range(0, 17 * BLOCK + 32, 16))


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
