"""What a peer sends: escapes, random bytes, files, chunks."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trcvtui.commands.tokens import chunks, file_bytes, random_bytes, text_bytes
from trcvtui.errors import UserError


@pytest.mark.parametrize(
    ("text", "payload"),
    [
        ("abc", b"abc"),
        ("", b""),
        (r"a\r\n\t\\\"\0", b'a\r\n\t\\"\0'),
        (r"\x02\xFF\xfe", b"\x02\xff\xfe"),
        ("Öl", "Öl".encode()),
    ],
)
def test_escapes_become_bytes(text: str, payload: bytes) -> None:
    assert text_bytes(text) == payload


@pytest.mark.parametrize(("text", "found"), [(r"\q", r"'\q'"), ("\\", "'\\'"), (r"\xG1", r"'\x'")])
def test_an_unknown_escape_is_named(text: str, found: str) -> None:
    with pytest.raises(UserError) as caught:
        text_bytes(text, "t")
    assert caught.value.problems[0].found == found


@given(st.binary())
def test_every_payload_can_be_written_as_text(payload: bytes) -> None:
    assert text_bytes("".join(f"\\x{byte:02X}" for byte in payload)) == payload


@given(st.binary(max_size=64), st.lists(st.integers(1, 20), max_size=8))
def test_chunks_are_the_payload_cut(payload: bytes, split: list[int]) -> None:
    pieces = chunks(payload, split)
    assert b"".join(pieces) == payload
    assert all(len(piece) for piece in pieces)
    for piece, size in zip(pieces[:-1], split, strict=False):
        assert len(piece) == size


def test_what_is_left_is_the_last_chunk() -> None:
    assert [bytes(piece) for piece in chunks(b"abcdef", (1, 2))] == [b"a", b"bc", b"def"]


def test_chance_depends_on_the_seed_alone() -> None:
    assert random_bytes(100, 1) == random_bytes(100, 1) != random_bytes(100, 2)
    assert len(random_bytes(1000, 0)) == 1000


def test_a_file_is_sent_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "x.bin").write_bytes(bytes(range(256)))
    assert file_bytes(tmp_path / "x.bin", "w") == bytes(range(256))


def test_a_file_has_bytes_and_at_most_16_mib(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()
    with (tmp_path / "large").open("wb") as file:
        file.truncate(16 * 1024 * 1024 + 1)
    for name, said in (
        ("empty", "which is empty, expected at least one byte"),
        ("large", "which is too large, expected at most 16777216 bytes"),
        ("nix", "expected a file that can be read"),
        (".", "expected a file that can be read"),
    ):
        with pytest.raises(UserError) as caught:
            file_bytes(tmp_path / name, "w")
        assert caught.value.lines()[0].endswith(said)
