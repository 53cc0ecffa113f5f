"""Hex as people write it, and where it stops being hex."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import golden
from trcvtui.errors import UserError
from trcvtui.udt.byte_text import parse_hex


@pytest.mark.parametrize(
    "text",
    [
        "01020a",
        "01020A",
        "01 02 0A",
        "01,02,0A",
        "01, 02, 0A,",
        "0x01 0x02 0x0A",
        "0x01,0x02,0x0A",
        "0X01020A",
        "16#01 16#02 16#0a",
        "16#01020A",
        "1 2 a",
        "0x1, 0x2, 0xA",
        "01 02\n0A\n",
        "\t01\r\n02\r\n\r\n0A",
        "0102 0A",
    ],
)
def test_every_usual_way_of_writing_three_bytes(text: str) -> None:
    assert parse_hex(text) == b"\x01\x02\x0a"


@pytest.mark.parametrize("text", ["", "  ", "\n", ",", " , "])
def test_no_digits_are_no_bytes(text: str) -> None:
    assert parse_hex(text) == b""


def test_the_first_thing_that_is_no_hex_is_named_with_its_place() -> None:
    golden.mistakes("hex", parse_hex)
    with pytest.raises(UserError, match=r"position 4: found '\\x1b'"):
        parse_hex("01 \x1b[2J")


def test_a_long_run_of_digits_is_not_repeated_in_the_message() -> None:
    with pytest.raises(UserError) as raised:
        parse_hex("12 " + "0" * 10_001, "rx.hex")
    assert raised.value.lines() == [
        "rx.hex, position 4: found '00000000000000000000...' with 10001 digits, "
        "expected hex bytes such as 01 02 0A"
    ]


@given(st.binary(max_size=50), st.sampled_from(["", " ", ",", "\n"]))
def test_bytes_written_as_hex_read_back(payload: bytes, gap: str) -> None:
    assert parse_hex(gap.join(f"{byte:02x}" for byte in payload)) == payload


@given(st.text(alphabet="0123456789abcxX#, \n_g", max_size=30))
def test_any_text_is_bytes_or_a_mistake_of_one_line(text: str) -> None:
    try:
        assert isinstance(parse_hex(text), bytes)
    except UserError as refused:
        assert len(refused.lines()) == 1
