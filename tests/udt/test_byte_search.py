"""What can be looked for: hex, a text, a number of any size in either byte order."""

from __future__ import annotations

import struct

import pytest

from trcvtui.errors import UserError
from trcvtui.udt.byte_text import all_in, first_in, last_in, wanted


@pytest.mark.parametrize(
    ("text", "patterns"),
    [
        ("29 00", (b"\x29\x00",)),
        ("0x29,16#0", (b"\x29\x00",)),
        ('"héllo"', ("héllo".encode(),)),
        ("'open", (b"open",)),
        ("=258", (b"\x02\x01", b"\x01\x02", b"\x02\x01\0\0", b"\0\0\x01\x02",
                  struct.pack("<q", 258), struct.pack(">q", 258))),
        ("=-1", (b"\xff" * 2, b"\xff" * 4, b"\xff" * 8)),
        ("=65536", (b"\0\0\x01\0", b"\0\x01\0\0", struct.pack("<q", 65536), struct.pack(">q", 65536))),
        ("=1.5", tuple(struct.pack(code, 1.5) for code in ("<f", ">f", "<d", ">d"))),
        ("=16#FFFF", (b"\xff\xff", b"\xff\xff\0\0", b"\0\0\xff\xff",
                      b"\xff\xff" + bytes(6), bytes(6) + b"\xff\xff")),
    ],
)  # fmt: skip
def test_a_text_asks_for_these_bytes(text: str, patterns: tuple[bytes, ...]) -> None:
    assert wanted(text).patterns == patterns


@pytest.mark.parametrize("text", ["", '""', "4x", "=", "=abc", "=99999999999999999999", "00" * 257])
def test_what_asks_for_nothing_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(UserError) as refused:
        wanted(text)
    assert len(refused.value.lines()) == 1


def test_the_nearest_of_several_patterns_counts() -> None:
    content = b"..ab..cd..ab"
    assert first_in(content, (b"cd", b"ab")) == 2
    assert first_in(content, (b"cd", b"ab"), 3) == 6
    assert last_in(content, (b"cd", b"ab"), 10) == 6
    assert last_in(content, (b"cd", b"ab"), 11) == 10
    assert first_in(content, (b"x",)) is None and last_in(content, (b"ab",), 0) is None
    assert list(all_in(b"aaa", (b"aa",))) == [range(2), range(1, 3)]
