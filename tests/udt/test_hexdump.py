"""The export of bytes: the same text as `hexdump -v -C`, byte for byte."""

from __future__ import annotations

import shutil
import subprocess

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trcvtui.udt.byte_text import hexdump


def test_a_dump_has_offset_hex_text_and_at_last_the_length() -> None:
    assert hexdump(b"0123456789abcdef\x00\x1b[1m\x7f\xff") == (
        b"00000000  30 31 32 33 34 35 36 37  38 39 61 62 63 64 65 66  |0123456789abcdef|\n"
        b"00000010  00 1b 5b 31 6d 7f ff                              |..[1m..|\n"
        b"00000017\n"
    )
    assert hexdump(bytes(48)).count(b"|................|") == 3, "equal lines are not left out"
    assert hexdump(b"") == b""


@pytest.mark.skipif(shutil.which("hexdump") is None, reason="needs the program hexdump")
@given(st.binary(min_size=1, max_size=400))
def test_hexdump_itself_says_the_same(content: bytes) -> None:
    theirs = subprocess.run(["hexdump", "-v", "-C"], input=content, capture_output=True, check=True)
    assert hexdump(content) == theirs.stdout
