"""Hex and JSON from the argument, from a file and from stdin, and what can be wrong with them."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests import golden
from trcvtui.errors import UserError
from trcvtui.udt.cli_input import read_hex_argument, read_types, read_values
from trcvtui.udt.command import read_all_types


def refusal(read: object, argument: object) -> str:
    assert callable(read)
    with pytest.raises(UserError) as raised:
        read(argument)
    [line] = raised.value.lines()
    return line


def put_on_stdin(monkeypatch: pytest.MonkeyPatch, content: bytes) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(content)))


def test_hex_may_stand_in_a_file(tmp_path: Path) -> None:
    file = tmp_path / "rx.hex"
    file.write_text("01 02\n03\n")
    assert read_hex_argument(f"@{file}") == b"\x01\x02\x03"


def test_hex_may_come_on_stdin(monkeypatch: pytest.MonkeyPatch) -> None:
    put_on_stdin(monkeypatch, b"\xef\xbb\xbf01 02\r\n03")
    assert read_hex_argument("-") == b"\x01\x02\x03"


def test_values_may_stand_in_a_file_or_come_on_stdin(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file = tmp_path / "values.json"
    file.write_text('{"speed": 12.5}')
    put_on_stdin(monkeypatch, b'{"id": 1}')
    assert read_values(str(file)) == {"speed": 12.5}
    assert read_values("-") == {"id": 1}


def test_wrong_hex_in_a_file_is_named_with_line_and_column(tmp_path: Path) -> None:
    file = tmp_path / "rx.hex"
    file.write_text("01 02\n03 zz\n")
    expected = f"{file}, line 2, column 4: found 'z', expected hex bytes such as 01 02 0A"
    assert refusal(read_hex_argument, f"@{file}") == expected


@pytest.mark.parametrize("read", [read_hex_argument, read_values])
def test_binary_data_is_no_text(read: object, monkeypatch: pytest.MonkeyPatch) -> None:
    put_on_stdin(monkeypatch, b"01\xff\x00")
    assert refusal(read, "-").startswith("stdin: found binary data (byte 2 is 16#FF), expected text")


@pytest.mark.parametrize("read", [read_hex_argument, read_values])
def test_a_closed_stdin_is_a_mistake(read: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    assert refusal(read, "-") == "stdin: found a closed input, expected text that can be read"


def test_a_stdin_that_cannot_be_read_is_a_mistake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with (tmp_path / "write-only").open("w") as write_only:
        monkeypatch.setattr(
            sys, "stdin", io.TextIOWrapper(io.FileIO(write_only.fileno(), "rb", closefd=False))
        )
        assert (
            refusal(read_hex_argument, "-")
            == "stdin: found 'Bad file descriptor', expected text that can be read"
        )


@pytest.mark.parametrize(("name", "reason"), [("nix", "'No such file or directory'"), (".", "a folder")])
def test_a_file_that_is_not_there_or_a_directory_is_a_mistake(name: str, reason: str, tmp_path: Path) -> None:
    path = str(tmp_path / name)
    expected = f"{tmp_path / name}: found {reason}, expected text that can be read"
    assert refusal(read_values, path) == expected


def test_a_device_and_a_file_that_is_too_large_are_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("trcvtui.udt.cli_input.LARGEST_INPUT", 1000)
    large = tmp_path / "large"
    large.write_bytes(b"0" * 1001)
    assert (
        refusal(read_hex_argument, f"@{large}")
        == f"{large}: found a larger input, expected at most 1000 bytes"
    )
    assert (
        refusal(read_hex_argument, "@/dev/zero")
        == "/dev/zero: found a device, expected text that can be read"
    )


def test_what_is_no_json_object_is_a_mistake(monkeypatch: pytest.MonkeyPatch) -> None:
    def read(text: str) -> None:
        put_on_stdin(monkeypatch, text.encode())
        read_values("-")

    golden.mistakes("JSON of values", read)
    for text, found in (('{"a": ' + "9" * 5000 + "}", "too many digits"), ("[" * 200_000, "too deeply")):
        with pytest.raises(UserError, match=found):
            read(text)


def test_a_type_may_come_on_stdin_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    put_on_stdin(monkeypatch, "STRUCT\n  ä : INT;\nEND_STRUCT".encode("utf-16"))
    assert [each.name for each in read_types("-").types] == ["stdin"]
    for content, found in (
        (b" \n", "nothing, expected a type"),
        (b"\0\1\2", "NUL bytes, as in binary data"),
    ):
        put_on_stdin(monkeypatch, content)
        assert refusal(read_types, "-").startswith(f"stdin: found {found}")
    once = SimpleNamespace(file="-", others=[], constant=[], hex=["-"])
    assert refusal(lambda given: read_all_types(given, None), once) == (
        "stdin: found - more than once, expected only one input on stdin, the others in files"
    )
    put_on_stdin(monkeypatch, b"STRUCT a : INT; END_STRUCT")
    monkeypatch.setattr(sys.stdin.buffer, "isatty", lambda: True, raising=False)
    assert read_types("-").types and "Ctrl+D" in capsys.readouterr().err
