"""What is filled into a message: rising numbers and checksums, against values that others published."""

from __future__ import annotations

import zlib
from pathlib import Path

import pytest

from tests.bench.bench_project import bench_project
from trcvtui.commands.counters_and_checksums import fill_message
from trcvtui.commands.table import parse_line
from trcvtui.commands.words import PeerSend
from trcvtui.project.project import Project

CHECK = b"123456789"  # the text whose checksums every catalogue of CRCs gives


def sent(line: str, project: Project, number: int = 0) -> bytes:
    command = parse_line(line, project, "w")
    assert isinstance(command, PeerSend)
    return fill_message(command.payload, command.fills, number)


@pytest.mark.parametrize(
    ("option", "published"),
    [
        ("sum8=9", b"\xdd"),
        ("xor8=9", b"\x31"),
        ("crc16-modbus=9", b"\x37\x4b"),
        ("crc16-modbus=9:big", b"\x4b\x37"),
        ("crc32=9:big", b"\xcb\xf4\x39\x26"),
        ("crc32=9", b"\x26\x39\xf4\xcb"),
    ],
)
def test_a_checksum_is_the_published_one(project: Project, option: str, published: bytes) -> None:
    assert sent(f'peer P1 send text "123456789" {option}', project) == CHECK + published


@pytest.mark.parametrize(
    ("hole", "number", "content"),
    [
        ("{n}", 7, "01 07 02"),
        ("{n}", 258, "01 02 02"),
        ("{n:2}", 258, "01 02 01 02"),
        ("{n:2:big}", 258, "01 01 02 02"),
        ("{sum8}", 0, "01 01 02"),
    ],
)
def test_a_hole_in_hex_is_filled(project: Project, hole: str, number: int, content: str) -> None:
    assert sent(f"peer P1 send hex 01 {hole} 02", project, number) == bytes.fromhex(content)


def test_a_checksum_covers_the_number_before_it_and_not_what_comes_behind(project: Project) -> None:
    message = sent("peer P1 send hex AA {n:4:big} {crc32:little} BB", project, 5)
    covered = b"\xaa\x00\x00\x00\x05"
    assert message == covered + zlib.crc32(covered).to_bytes(4, "little") + b"\xbb"


def test_a_number_at_an_offset_overwrites_what_stands_there(project: Project) -> None:
    assert sent("peer P1 send hex AA BB CC DD n=1:2:big", project, 9) == b"\xaa\x00\x09\xdd"


def test_digits_are_decimal_and_roll_over(project: Project) -> None:
    assert sent('peer P1 send text "no 000" digits=3:3', project, 1007) == b"no 007"


def test_a_text_of_send_keeps_its_braces(project: Project) -> None:
    assert sent('peer P1 send text "{n}"', project, 4) == b"{n}"


def test_the_project_s_byte_order_is_taken_where_none_is_said(tmp_path: Path) -> None:
    assert sent("peer P1 send hex {n:2}", bench_project(tmp_path), 1) == b"\x01\x00"
