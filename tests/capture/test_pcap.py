"""Capture files: what we write is read by Wireshark's tools, what they write is read here."""

from __future__ import annotations

import gzip
import io
import random
import shutil
import struct
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

from trcvtui.capture.pcap import (
    COMMENT,
    ETHERNET,
    RAW_IP,
    USER0,
    CaptureReader,
    Packet,
    interface_block,
    open_capture,
    packet_block,
    secrets_block,
    section_block,
)
from trcvtui.errors import UserError

NS = 1_700_000_000_123_456_789


def judge(tool: str, *words: object) -> str:
    """Return what a tool of Wireshark says; skip where it is not installed."""
    if shutil.which(tool) is None:
        pytest.skip(f"{tool} is not installed")
    return subprocess.run([tool, *map(str, words)], capture_output=True, text=True, check=True).stdout


def read(data: bytes) -> tuple[list[Packet], CaptureReader]:
    reader = CaptureReader(io.BytesIO(data).read, "F")
    return list(reader), reader


def udp(payload: bytes) -> bytes:
    head = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 28 + len(payload), 0, 0, 64, 17, 0, b"\n\0\0\1", b"\n\0\0\2")
    return head + struct.pack(">HHHH", 1000, 2000, 8 + len(payload), 0) + payload


def ours() -> bytes:
    return b"".join(
        (
            section_block("trcvtui"),
            interface_block(RAW_IP, "PLC"),
            interface_block(USER0, "journal"),
            secrets_block(b"CLIENT_RANDOM 00 11\n"),
            packet_block(0, NS, udp(b"abc"), ("TRCV_C_1: 16#7008 DONE", "ö second")),
            packet_block(1, NS + 1, b"journal!!"),
            block("<", 0xBAD, struct.pack("<I", 32473) + b"12345"),  # of an enterprise
            packet_block(0, NS + 2, udp(b"hello")[:30], length=33),
        )
    )


def block(order: str, kind: int, body: bytes) -> bytes:
    body += bytes(-len(body) & 3)
    size = struct.pack(order + "I", len(body) + 12)
    return struct.pack(order + "I", kind) + size + body + size


def foreign(order: str, *blocks: bytes) -> bytes:
    mark = struct.pack(order + "I", 0x1A2B3C4D)
    return block(order, 0x0A0D0D0A, mark + struct.pack(order + "HHq", 1, 0, -1)) + b"".join(blocks)


def interface(order: str, link: int, snaplen: int = 0, options: Sequence[tuple[int, bytes]] = ()) -> bytes:
    body = struct.pack(order + "HHI", link, 0, snaplen)
    for code, value in options:
        body += struct.pack(order + "HH", code, len(value)) + value + bytes(-len(value) & 3)
    return block(order, 1, body + (bytes(4) if options else b""))


def packet(order: str, index: int, ticks: int, data: bytes, length: int | None = None) -> bytes:
    head = (index, ticks >> 32, ticks & 0xFFFFFFFF, len(data), len(data) if length is None else length)
    return block(order, 6, struct.pack(order + "IIIII", *head) + data)


def test_what_was_written_is_read_again() -> None:
    reader = CaptureReader(io.BytesIO(ours()).read, "F")
    packets = list(reader)
    assert reader.trouble is None
    assert [one[:5] for one in packets] == [
        (NS, 0, udp(b"abc"), 31, ("TRCV_C_1: 16#7008 DONE", "ö second")),
        (NS + 1, 1, b"journal!!", 9, ()),
        (NS + 2, 0, udp(b"hello")[:30], 33, ()),
    ]
    assert [(one.link_type, one.name) for one in reader.interfaces] == [(RAW_IP, "PLC"), (USER0, "journal")]
    for one in packets:
        assert ours()[one.at] == 6


def test_wireshark_reads_what_we_write(tmp_path: Path) -> None:
    path = tmp_path / "ours.pcapng"
    path.write_bytes(ours())
    fields = ["-T", "fields", "-e", "frame.time_epoch", "-e", "frame.comment", "-e", "udp.port"]
    said = judge("tshark", "-r", path, *fields)
    rows = [line.split("\t") for line in said.splitlines()]
    assert rows[0] == ["1700000000.123456789", "TRCV_C_1: 16#7008 DONE,ö second", "1000,2000"]
    assert [row[0] for row in rows[1:] if row[0]] == ["1700000000.123456790", "1700000000.123456791"]
    assert "Malformed" not in judge("tshark", "-r", path, "-V")
    said = judge("capinfos", "-M", path)
    assert "Number of packets:   3" in said and "Number of decryption secrets in file: 1" in said


@pytest.mark.parametrize("kind", ["pcapng", "pcap", "nsecpcap", "modpcap"])
@pytest.mark.parametrize("is_packed", [False, True])
def test_each_format_that_editcap_writes_is_read(tmp_path: Path, kind: str, is_packed: bool) -> None:
    one, out = tmp_path / "one.pcapng", tmp_path / "out"
    parts = [packet_block(0, NS + n, udp(b"x" * n)) for n in range(50)]
    one.write_bytes(section_block("t") + interface_block(RAW_IP, "PLC") + b"".join(parts))
    judge("editcap", "-F", kind, one, out)
    if is_packed:
        out.write_bytes(gzip.compress(out.read_bytes()))
    with open_capture(out) as reader:
        packets = list(reader)
    assert reader.trouble is None
    exact = 1 if kind in ("pcapng", "nsecpcap") else 1000
    assert [one.ns for one in packets] == [(NS + n) // exact * exact for n in range(50)]
    assert [one.data for one in packets] == [udp(b"x" * n) for n in range(50)]


def test_what_mergecap_joins_keeps_its_interfaces(tmp_path: Path) -> None:
    for name, link in (("a", RAW_IP), ("b", ETHERNET)):
        (tmp_path / name).write_bytes(
            section_block("t") + interface_block(link, name) + packet_block(0, NS, bytes(20))
        )
    judge("mergecap", "-w", tmp_path / "both", tmp_path / "a", tmp_path / "b")
    with open_capture(tmp_path / "both") as reader:
        packets = list(reader)
    assert sorted(reader.interfaces[one.interface].link_type for one in packets) == [ETHERNET, RAW_IP]


@pytest.mark.parametrize("order", "<>")
def test_sections_have_interfaces_clocks_and_a_byte_order_of_their_own(order: str) -> None:
    data = foreign(
        order,
        interface(order, 1),
        interface(order, 101, options=[(9, b"\x0c"), (2, b"pico")]),
        interface(order, 101, options=[(9, b"\x8a"), (14, struct.pack(order + "q", -5)), (1, b"note")]),
        packet(order, 0, 7, b"micro"),
        packet(order, 1, 7_999, b"pico!"),
        packet(order, 2, 10 * 1024 + 512, b"binary"),
    ) + foreign(">", interface(">", 101), packet(">", 0, 3, b"again", 99))
    packets, reader = read(data)
    assert reader.trouble is None
    assert [(one.ns, one.interface, one.data, one.length) for one in packets] == [
        (7000, 0, b"micro", 5),
        (7, 1, b"pico!", 5),
        (5_500_000_000, 2, b"binary", 6),
        (3000, 3, b"again", 99),
    ]
    assert reader.interfaces[2].comments == ("note",)


@pytest.mark.parametrize("order", "<>")
def test_simple_and_obsolete_packets_are_read(order: str) -> None:
    old = struct.pack(order + "HHIIII", 0, 0xFFFF, 0, 9, 3, 8) + b"old\0"
    simple = struct.pack(order + "I", 100) + b"cut."
    packets, reader = read(
        foreign(order, interface(order, 101, 4), block(order, 2, old), block(order, 3, simple))
    )
    assert reader.trouble is None
    assert [one[:4] for one in packets] == [(9000, 0, b"old", 8), (9000, 0, b"cut.", 100)]


def test_a_comment_of_every_length_is_kept() -> None:
    texts = tuple("c" * n for n in range(1, 70))
    packets, _ = read(section_block("t") + interface_block(1, "") + packet_block(0, 5, b"abc", texts))
    assert packets[0].comments == texts and COMMENT == 1


def test_a_pipe_that_gives_one_byte_at_a_time_is_read() -> None:
    file = io.BytesIO(ours())
    assert [one.ns for one in CaptureReader(lambda most: file.read(1), "F")] == [NS, NS + 1, NS + 2]


@pytest.mark.parametrize(
    "content", [b"", b"GIF89a", b"\n\r\r\n", b"\n\r\r\n" + bytes(40), gzip.compress(b"no", mtime=0)]
)
def test_what_is_no_capture_is_refused_or_said_to_stop(content: bytes) -> None:
    try:
        packets, reader = read(content)
    except UserError as error:
        assert len(error.lines()) == 1
    else:
        assert not packets and reader.trouble is not None


@pytest.mark.parametrize("begin", [b"GMBU\0\2\1\0", b"RTSS\1\1\0\0", b"snoop\0\0\0\0\0\0\2\0\0\0\4"])
def test_a_capture_of_another_program_is_named_with_the_command_that_makes_it_ours(
    begin: bytes, tmp_path: Path
) -> None:
    for path in (tmp_path / "a b.cap", tmp_path / "a b.gz"):
        path.write_bytes(gzip.compress(begin) if path.suffix == ".gz" else begin)
        with pytest.raises(UserError) as refused, open_capture(path):
            pass
        assert str(refused.value).endswith(f"editcap -F pcapng '{path}' '{path}'.pcapng")


def test_a_file_cut_anywhere_gives_what_stands_before_the_cut() -> None:
    data = ours()
    ends = [one.at for one in read(data)[0]]
    for cut in range(28, len(data)):
        packets, _ = read(data[:cut])
        assert [one.ns for one in packets] == [NS + n for n in range(3)][: len(packets)]
        assert len(packets) >= sum(at < cut for at in ends) - 1


def test_a_cut_gz_gives_what_could_be_unpacked() -> None:
    chance = random.Random(1)
    parts = [packet_block(0, NS + n, chance.randbytes(500)) for n in range(300)]
    data = gzip.compress(section_block("t") + interface_block(1, "") + b"".join(parts))
    packets, reader = read(data[: len(data) // 2])
    assert 100 < len(packets) < 200 and reader.trouble is not None and ".gz" in str(reader.trouble)


@pytest.mark.parametrize("size", [0, 3, 8, 13, 0x7FFFFFFC, 0xFFFFFFFC, 0xFFFFFFFF])
def test_a_hostile_length_ends_the_file_with_a_line(size: int) -> None:
    data = ours() + struct.pack("<II", 6, size) + bytes(100)
    packets, reader = read(data)
    assert len(packets) == 3 and reader.trouble is not None
    assert str(reader.trouble).startswith(f"F: byte {len(ours())}: found")


def test_a_packet_that_claims_more_than_its_block_ends_the_file() -> None:
    body = struct.pack("<IIIII", 0, 0, 0, 0xFFFFFFFF, 5) + b"abcd"
    packets, reader = read(foreign("<", interface("<", 1), block("<", 6, body)))
    assert not packets and reader.trouble is not None
