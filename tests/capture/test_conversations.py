"""Conversations: streams put together, their events, and the command that lists them."""

from __future__ import annotations

import gzip
import io
import itertools
import json
import random
import shutil
import struct
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from tests.properties.test_hostile_files import changed
from tests.recording.wire import (
    ACK,
    FIN,
    NS,
    PARTNER,
    PLC,
    RST,
    SYN,
    answer,
    capture,
    handshake,
    ip,
    tcp,
    udp,
)
from trcvtui.capture import pcap
from trcvtui.capture.command import capture_notes, format_conversations
from trcvtui.capture.packets import MOST_FRAGMENTED, SkipReason
from trcvtui.capture.pcap import CaptureReader, interface_block, packet_block, section_block
from trcvtui.capture.plc_end import parse_plc
from trcvtui.capture.reassembly import MOST_KINDS, ConversationEvent, Conversations, SegmentKind
from trcvtui.cli.main import main
from trcvtui.errors import UserError


def listen(
    packets: Iterable[bytes], link_type: int = pcap.RAW_IP, step_ns: int = 1_000_000
) -> list[ConversationEvent]:
    events: list[ConversationEvent] = []
    found = Conversations(events.append)
    for packet in CaptureReader(io.BytesIO(capture(list(packets), link_type, step_ns)).read, "F"):
        found.add_packet(packet, link_type)
    found.close()
    return events


def kinds(events: list[ConversationEvent]) -> list[SegmentKind]:
    return [event.kind for event in events]


def to_plc(events: list[ConversationEvent]) -> bytes:
    """Return what the PLC was told; a missing byte is `?`."""
    text = b""
    for event in events:
        if event.direction.address[1] == PARTNER[1] and event.kind in (
            SegmentKind.BYTES,
            SegmentKind.MISSING,
        ):
            assert event.at == len(text)
            text += event.data if event.kind is SegmentKind.BYTES else b"?" * event.size
    return text


def test_a_conversation_from_syn_to_fin() -> None:
    events = listen(
        [
            *handshake(),
            tcp(b"abc", 101, 501),
            answer(b"ok", 501, 104),
            tcp(seq=104, ack=503, flags=FIN | ACK),
            answer(seq=503, ack=105, flags=FIN | ACK),
            tcp(seq=105, ack=504),
        ]
    )
    said = "SYN", "answer", "established", "bytes", "bytes", "FIN", "FIN"
    assert [one.kind.value for one in events] == list(said)
    conversation = events[0].conversation
    assert conversation.begins_with_syn and conversation.end == ("fin", conversation.there)
    assert conversation.listener is conversation.back


COPY, OTHER = SegmentKind.RETRANSMISSION, SegmentKind.DIFFERENT_COPY
WRAP = 2**32 - 4
# What the PLC was told, after these packets; how often these kinds of events come.
STREAMS: dict[str, tuple[list[bytes], bytes, dict[SegmentKind, int]]] = {
    "out of order": ([tcp(b"ghi", 107), tcp(b"def", 104), tcp(b"abc", 101)], b"abcdefghi", {COPY: 0}),
    "a different copy": ([tcp(b"abcdef", 101), tcp(b"aXcdefg", 101)], b"abcdefg", {OTHER: 1}),
    "one among those that wait": (
        [tcp(b"CDE", 103), tcp(b"bcdef", 102), tcp(b"a", 101)], b"abCDEf", {OTHER: 1},
    ),
    "an equal copy": (
        [tcp(b"abc", 101), tcp(b"def", 104), tcp(b"bcde", 102)], b"abcdef", {COPY: 1, OTHER: 0},
    ),
    "a SYN sent again": ([tcp(seq=100, flags=SYN), tcp(b"abc", 101)], b"abc", {COPY: 1}),
    "a hole": (
        [tcp(b"abc", 101), tcp(b"ghi", 107), *[answer(seq=501, ack=110)] * 30, tcp(b"jk", 110)],
        b"abc???ghijk", {SegmentKind.MISSING: 1},
    ),
    "a hole at the end": ([tcp(b"abc", 101), answer(seq=501, ack=110)], b"abc??????", {}),
    "an ACK before its packet": (
        [answer(seq=501, ack=104), tcp(b"abc", 101), tcp(b"def", 104)], b"abcdef", {SegmentKind.MISSING: 0},
    ),
    **{
        f"a keep-alive of {len(garbage)} bytes": (
            [
                tcp(b"abc", 101), answer(seq=501, ack=104), tcp(garbage, 103, 501),
                answer(seq=501, ack=104), tcp(b"d", 104),
            ],
            b"abcd",
            {SegmentKind.KEEP_ALIVE: 1, SegmentKind.KEEP_ALIVE_ACK: 1, SegmentKind.BYTES: 2, COPY: 0},
        )
        for garbage in (b"", b"\0")
    },
    **{
        f"a window probe that gets in: {gets_in}": (
            [
                tcp(b"abc", 101), answer(seq=501, ack=104, window=0), tcp(b"d", 104, 501),
                answer(seq=501, ack=104 + gets_in, window=0), answer(seq=501, ack=104 + gets_in),
                tcp(b"def"[gets_in:], 104 + gets_in, 501),
            ],
            b"abcdef",
            {SegmentKind.ZERO_WINDOW: 1, SegmentKind.WINDOW_PROBE: 1, SegmentKind.WINDOW_OPENS: 1, COPY: 0},
        )
        for gets_in in (False, True)
    },
}  # fmt: skip


@pytest.mark.parametrize("name", STREAMS)
def test_segments_are_put_together(name: str) -> None:
    packets, text, counts = STREAMS[name]
    events = listen([*handshake(), *packets])
    assert to_plc(events) == text and {event.conversation.number for event in events} == {1}
    assert {kind: kinds(events).count(kind) for kind in counts} == counts
    assert events[0].direction.missing == text.count(b"?")


def test_numbers_wrap_and_a_new_syn_between_the_same_ends_is_a_new_conversation() -> None:
    wrap = [tcp(b"abcdef", WRAP + 1), tcp(b"jkl", WRAP + 10), tcp(b"ghi", WRAP + 7)]
    events = listen([*handshake(WRAP), *wrap])
    assert to_plc(events) == b"abcdefghijkl"
    last = listen([*handshake(WRAP), *wrap, *handshake(9000, 9500), tcp(b"xyz", 9001)])[-1]
    assert (last.conversation.number, last.at, last.data) == (2, 0, b"xyz")


def test_rst_and_silence_are_events() -> None:
    events = listen([*handshake(), answer(seq=501, flags=RST)], step_ns=11_000_000_000)
    assert kinds(events).count(SegmentKind.SILENCE) == 3
    assert events[-1].kind is SegmentKind.RST and events[-1].conversation.end == ("rst", events[-1].direction)


def test_the_number_of_an_ended_conversation_may_begin_another_one() -> None:
    """Our recordings count from 0 in each connection; before its end such a SYN is a copy."""
    reset = tcp(seq=101, ack=501, flags=RST | ACK)
    assert listen([*handshake(), reset, *handshake()])[-1].conversation.number == 2
    assert listen([*handshake(), tcp(seq=100, flags=SYN)])[-1].conversation.number == 1


def test_a_conversation_that_begins_in_the_middle_is_said_to() -> None:
    events = listen([answer(seq=7, ack=1000), tcp(b"\0", 999, 7), tcp(b"abc", 1000, 7), tcp(b"d", 1003, 7)])
    assert not events[0].conversation.begins_with_syn and to_plc(events) == b"abcd"
    assert events[0].kind is SegmentKind.KEEP_ALIVE


def test_a_packet_cut_by_snaplen_leaves_a_hole() -> None:
    events: list[ConversationEvent] = []
    found = Conversations(events.append)
    for n, (data, keep) in enumerate(
        [*((one, 99) for one in handshake()), (tcp(b"abcdef", 101), 43), (tcp(b"gh", 107), 99)]
    ):
        found.add_packet(pcap.Packet(n, 0, data[:keep], len(data), (), 0), pcap.RAW_IP)
    assert to_plc(events) == b"abc???gh"


def test_udp_ends_are_a_conversation() -> None:
    events = listen([udp(b"one"), udp(b"two"), udp(b"back", PLC, PARTNER)])
    assert [event.data for event in events] == [b"one", b"two", b"back"]
    assert {event.conversation.protocol for event in events} == {"udp"}


def ethernet(kind: bytes, packet: bytes, tags: bytes = b"") -> bytes:
    return bytes.fromhex("000e8c000001 020000000001") + tags + kind + packet


V4, V6 = b"\x08\x00", b"\x86\xdd"
LINKS: dict[str, tuple[int, Callable[[bytes], bytes]]] = {
    "ethernet": (pcap.ETHERNET, lambda one: ethernet(V4, one) + bytes(6)),
    "vlan": (pcap.ETHERNET, lambda one: ethernet(V4, one, b"\x81\x00\x00\x07")),
    "stacked vlans": (pcap.ETHERNET, lambda one: ethernet(V4, one, b"\x88\xa8\x00\x07\x81\x00\x00\x08")),
    "cooked": (pcap.LINUX_SLL, lambda one: bytes(14) + V4 + one),
    "cooked, vlan": (pcap.LINUX_SLL, lambda one: bytes(14) + b"\x81\x00\x00\x07" + V4 + one),
    "cooked 2": (pcap.LINUX_SLL2, lambda one: V4 + bytes(18) + one),
    "raw": (pcap.RAW_IP, lambda one: one),
    "raw 4": (pcap.IPV4, lambda one: one),
    "null": (pcap.NULL, lambda one: b"\x02\0\0\0" + one),
    "loop": (pcap.LOOP, lambda one: b"\0\0\0\x02" + one),
}


@pytest.mark.parametrize("name", LINKS)
def test_each_link_layer_is_read(name: str) -> None:
    link_type, wrap = LINKS[name]
    packets = [*handshake(), tcp(b"abc", 101, 501), tcp(b"def", 104, 501)]
    assert to_plc(listen([wrap(one) for one in packets], link_type)) == b"abcdef"


@pytest.mark.parametrize(
    "extra", [b"", bytes.fromhex("0600000000000000"), bytes.fromhex("2c00000000000000 0600000000000000")]
)
def test_ipv6_and_its_extension_headers_are_read(extra: bytes) -> None:
    plc, partner = ("fd00::5", 2000), ("fd00::9", 51000)
    packets = [tcp(b"abc", 1, 1, ACK, 9, partner, plc, extra), tcp(b"def", 4, 1, ACK, 9, partner, plc, extra)]
    assert to_plc(listen(packets)) == b"abcdef"


def test_ipv4_options_are_read_and_fragments_are_told(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    fragment = bytearray(tcp(b"abc", 101))
    fragment[6:8] = b"\x20\x00"
    path = tmp_path / "one"
    ping = ip("10.0.0.1", "10.0.0.2", 1, b"12345678")
    path.write_bytes(capture([tcp(b"abc", 101, extra=bytes(4)), bytes(fragment), ping, b""]))
    assert main(["conversations", str(path), "--format", "json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)[0]["to_plc"]["bytes"] == 3
    assert "1 IP fragments of incomplete packets" in said.err


def cut(packet: bytes, number: int, *places: int) -> list[bytes]:
    """Return an IP packet as fragments that begin at 0 and at these bytes of its content."""
    is_six = packet[0] >> 4 == 6
    head, content = (packet[:40], packet[40:]) if is_six else (packet[:20], packet[20:])
    found = []
    for begin, end in itertools.pairwise((0, *places, len(content))):
        piece, more = content[begin:end], end < len(content)
        if is_six:
            extra = struct.pack(">BBHI", head[6], 0, begin | more, number)
            changed = head[:4] + struct.pack(">HB", len(piece) + 8, 44) + head[7:]
        else:
            extra = b""
            fields = struct.pack(">HHH", 20 + len(piece), number, more << 13 | begin // 8)
            changed = head[:2] + fields + head[8:]
        found.append(changed + extra + piece)
    return found


@pytest.mark.parametrize("ends", [(PLC, PARTNER), (("fd00::5", 2000), ("fd00::9", 51000))])
def test_fragments_are_put_together_in_any_order(ends: tuple[tuple[str, int], tuple[str, int]]) -> None:
    plc, partner = ends
    text = bytes(range(90))
    whole = tcp(text, 101, 501, source=partner, target=plc)
    after = tcp(b"end", 191, 501, source=partner, target=plc)
    begin = tcp(seq=100, flags=SYN, source=partner, target=plc)
    for order in itertools.permutations(range(3)):
        pieces = cut(whole, 7, 8, 48)
        assert to_plc(listen([begin, *(pieces[n] for n in order), pieces[0], after])) == text + b"end"


def test_an_ethernet_frame_of_fragments_keeps_its_mac() -> None:
    found = Conversations()
    frames = [bytes(6) + b"\0\x1b\x1b123" + b"\x08\0" + one for one in cut(udp(bytes(40)), 3, 24)]
    for packet in CaptureReader(io.BytesIO(capture(frames, pcap.ETHERNET)).read, "F"):
        found.add_packet(packet, pcap.ETHERNET)
    assert (found.all[0].there.byte_count, found.all[0].there.mac) == (40, b"\0\x1b\x1b123")
    assert not found.not_read


def test_fragments_that_overlap_lack_one_or_come_late_are_told_and_bounded() -> None:
    chance, found = random.Random(2), Conversations()
    for n in range(3000):
        one, two = cut(udp(chance.randbytes(400)), n, 8 * chance.randrange(1, 9))
        odd = bytearray(two if chance.random() < 0.5 else one)
        odd[6:8] = chance.randbytes(2)
        found.add_packet(pcap.Packet(n * 10**9, 0, bytes(odd), len(odd), (), 0), pcap.RAW_IP)
        found.add_packet(pcap.Packet(n * 10**9, 0, one, len(one), (), 0), pcap.RAW_IP)
        assert len(found._fragments._packets) <= MOST_FRAGMENTED
    late = cut(udp(b"0123456789"), 9, 8)
    for ns, one in zip((4000 * 10**9, 4031 * 10**9), late, strict=True):
        found.add_packet(pcap.Packet(ns, 0, one, len(one), (), 0), pcap.RAW_IP)
    assert found.not_read[SkipReason.FRAGMENT] > 3000


@pytest.mark.parametrize("seed", range(40))
def test_any_order_and_any_copies_give_the_stream_and_lost_bytes_are_holes(seed: int) -> None:
    chance = random.Random(seed)
    there = chance.choice([100, 2**32 - 3000])
    text = bytes(chance.randrange(256) for _ in range(8000)).replace(b"?", b"!")
    pieces, at = [], 0
    while at < len(text):
        size = chance.randrange(2, 300)
        pieces.append((at, text[at : at + size]))
        at += size
    lost = set(chance.sample(range(1, len(pieces) - 1), 3)) if seed % 2 else set()
    sent = [piece for n, piece in enumerate(pieces) if n not in lost for _ in range(chance.randrange(1, 3))]
    order = sorted(range(len(sent)), key=lambda n: n + chance.randrange(8))
    got = to_plc(listen([*handshake(there), *(tcp(sent[n][1], there + 1 + sent[n][0]) for n in order)]))
    expected = bytearray(text)
    for n in lost:
        begin, data = pieces[n]
        expected[begin : begin + len(data)] = b"?" * len(data)
    assert got == expected


def test_memory_of_a_direction_with_a_hole_is_bounded() -> None:
    found = Conversations()
    packets = [*handshake(), *(tcp(bytes(1400), 200 + n * 1400) for n in range(3000))]
    for n, data in enumerate(packets):
        found.add_packet(pcap.Packet(n, 0, data, len(data), (), 0), pcap.RAW_IP)
        assert found.all[0].there.waiting_cost <= 1 << 20
    assert found.all[0].there.byte_count == 3000 * 1400 and found.all[0].there.missing == 99


def test_conversations_above_the_limit_are_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("trcvtui.capture.reassembly.MOST_CONVERSATIONS", 3)
    path = tmp_path / "scan"
    path.write_bytes(capture([tcp(flags=SYN, source=("10.0.0.9", n)) for n in range(1, 9)]))
    assert main(["conversations", str(path)]) == 0
    said = capsys.readouterr()
    assert [line[:2] for line in said.out.splitlines() if line[0] != " "] == ["ID", "C1", "C2", "C3"]
    assert "5 packets of conversations after the first 3" in said.err


ETHERCAT = b"\x88\xa4" + bytes(40)
SLL = bytes(14)


@pytest.mark.parametrize(
    ("link_type", "frames", "line"),
    [
        (pcap.ETHERNET, [ethernet(b"", ETHERCAT)] * 3, "3 EtherCAT frames (16#88A4)"),
        (pcap.ETHERNET, [ethernet(b"\x81\0\0\7\x88\xa8\0\7", ETHERCAT)], "1 EtherCAT frame (16#88A4)"),
        (pcap.LINUX_SLL, [SLL + b"\x81\0\0\7" + ETHERCAT], "1 EtherCAT frame (16#88A4)"),
        (pcap.LINUX_SLL2, [b"\x81\0" + bytes(18) + b"\0\7" + ETHERCAT], "1 EtherCAT frame (16#88A4)"),
        (pcap.ETHERNET, [ethernet(b"\x43\x21", b"")], "1 frame (16#4321)"),
        (pcap.ETHERNET, [ethernet(b"\0\x27", b"")], "1 802.3 LLC frame"),
        (pcap.ETHERNET, [b"cut"], "1 packet cut off before its EtherType"),
        (pcap.LINUX_SLL, [SLL + b"\0\x0c" + bytes(16)], "1 CAN frame (16#000C)"),
        (pcap.ETHERNET, [ethernet(V4, ip("10.0.0.5", "224.0.0.1", 2, b""))], "1 IGMP packet (IP protocol 2)"),
        (pcap.RAW_IP, [ip("10.0.0.5", "10.0.0.9", 99, b"")], "1 IP packet (IP protocol 99)"),
        (pcap.RAW_IP, [ip("fd00::5", "fd00::9", 58, bytes(9), b"\x3a" + bytes(7))],
         "1 ICMPv6 packet (IP protocol 58)"),
        (pcap.RAW_IP, [b"x"], "1 packet (link type 101)"),
        (227, [b"x"], "1 CAN packet (link type 227)"),
        (pcap.ETHERNET, [ethernet(struct.pack(">H", 0x1000 + n % 6), b"") for n in range(60)] +
         [ethernet(b"", ETHERCAT)] * 11,
         "11 EtherCAT frames (16#88A4), 10 frames (16#1000), 10 frames (16#1001), 10 frames (16#1002), "
         "30 packets of 3 other kinds"),
    ],
)  # fmt: skip
def test_what_is_neither_tcp_nor_udp_is_named(link_type: int, frames: list[bytes], line: str) -> None:
    found = Conversations()
    for data in frames:
        found.add_packet(pcap.Packet(0, 0, data, len(data), (), 0), link_type)
    assert [*capture_notes(found, [])][1:] == [f"not read (neither TCP nor UDP): {line}"]


def test_the_kinds_of_what_is_not_read_are_bounded() -> None:
    found = Conversations()
    for number in range(65_536):
        data = ethernet(number.to_bytes(2, "big"), b"")
        found.add_packet(pcap.Packet(0, 0, data, len(data), (), 0), pcap.ETHERNET)
    assert found.others.total() > 65_000 and len(found.others) <= MOST_KINDS + 1


# -- the command -----------------------------------------------------------------------------------------


def rows_of(path: Path, *words: str, capsys: pytest.CaptureFixture[str]) -> list[dict[str, object]]:
    assert main(["conversations", str(path), "--format", "json", *words]) == 0
    return list(json.loads(capsys.readouterr().out))


def test_the_json_of_a_conversation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "c.pcapng"
    said = [tcp(b"abc", 101, 501), answer(b"ok", 501, 104), tcp(b"abc", 101, 503)]
    path.write_bytes(capture([*handshake(), *said, answer(seq=503, flags=RST)]))
    assert rows_of(path, capsys=capsys) == [
        {
            "id": "C1",
            "protocol": "tcp",
            "plc": "10.0.0.5:2000",
            "partner": "10.0.0.9:51000",
            "plc_guess": {"confidence": 0.75, "why": "port 2000, usual at PLCs"},
            "t_s": 0.0,
            "duration_s": 0.006,
            "begin": "syn",
            "end": "rst-plc",
            "to_plc": {"bytes": 3, "segments": 2, "retransmitted": 3, "missing": 0, "copies": 0},
            "from_plc": {"bytes": 2, "segments": 1, "retransmitted": 0, "missing": 0, "copies": 0},
            "quality": [],
        }
    ]


OF_PROJECT = 'dialect = "baosky"\n[[connect]]\nname = "C1"\nActiveEstablished = false\nLocalPort = 51000\n'
FROM_SIEMENS = capture(
    [ethernet(V4, tcp(flags=SYN, source=("10.0.0.5", 51001), target=PARTNER))], pcap.ETHERNET
)
MIDDLE = capture([answer(b"a", 501, 101), tcp(b"b", 101, 502)])


@pytest.mark.parametrize(
    ("content", "words", "why", "confidence"),
    [
        (capture(handshake()), "--plc 10.0.0.9", "--plc", 1.0),
        (capture(handshake()), "--plc 10.0.0.9:51000", "--plc", 1.0),
        (FROM_SIEMENS, "", "MAC of Siemens", 0.7),
        (MIDDLE, "--project p.toml", "port 51000 of the project", 0.8),
    ],
)
def test_what_tells_the_plc_end(
    content: bytes,
    words: str,
    why: str,
    confidence: float,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "p.toml").write_text(OF_PROJECT, "utf-8")
    (tmp_path / "one").write_bytes(content)
    (row,) = rows_of(tmp_path / "one", *words.split(), capsys=capsys)
    assert row["plc"] == "10.0.0.9:51000"
    assert row["plc_guess"] == {"confidence": confidence, "why": why}


def test_the_text_stays_in_80_columns(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "one"
    path.write_bytes(capture([*handshake(), tcp(b"abc", 101, 501), tcp(b"abc", 101, 501), answer(ack=110)]))
    assert main(["conversations", str(path)]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "ID  PLC END        PARTNER END     AT      FOR     TO PLC  FROM PLC",
        "C1  10.0.0.5:2000  10.0.0.9:51000  0.000s  0.005s  3 B     0 B",
        "    tcp, syn to open; PLC end (75% sure): port 2000, usual at PLCs",
        "    to PLC, 2 segments: 3 B sent again, 6 B missing",
        "    quality: gaps, ends-early",
    ]
    far = tuple((f"2001:1111:2222:3333:4444:5555:6666:77{n}", 65535) for n in (77, 88))
    whole = tcp(bytes(1400), 1, 1, source=far[0], target=far[1])
    path.write_bytes(capture([whole, *handshake()], step_ns=10**13))
    assert main(["conversations", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80 and sum(line.startswith("C") for line in lines) == 2
    assert far[0][0] in " ".join(lines) and far[1][0] in " ".join(lines)


def test_several_files_are_one_capture_in_time_order(tmp_path: Path) -> None:
    packets = [*handshake(), *(tcp(b"%d" % n, 101 + n, 501) for n in range(9))]
    names = []
    for part in (2, 0, 1):
        blocks = [packet_block(0, NS + n, one) for n, one in enumerate(packets) if n % 3 == part]
        (tmp_path / f"{part}").write_bytes(
            section_block("t") + interface_block(pcap.RAW_IP, "") + b"".join(blocks)
        )
        names.append(str(tmp_path / f"{part}"))
    (row,) = json.loads("".join(format_conversations(names, None, "json")))
    counts = {"bytes": 9, "segments": 9, "retransmitted": 0, "missing": 0, "copies": 0}
    assert row["begin"] == "syn" and row["to_plc"] == counts


@pytest.mark.parametrize(
    "text",
    ["", "10.0.0", "10.0.0.5:0", "10.0.0.5:x", "10.0.0.5:", "[fd00::1", "[fd00::1]2000", "[fd00::1]:70000"],
)
def test_a_wrong_plc_end_is_one_line(text: str) -> None:
    with pytest.raises(UserError, match="--plc: found"):
        parse_plc(text)
    assert parse_plc("[fd00::1]:2000") == (bytes.fromhex("fd" + "0" * 29 + "1"), 2000)
    assert parse_plc("fd00::1")[1] is None and parse_plc("10.0.0.5:2000") == (b"\n\0\0\5", 2000)


def test_files_that_are_no_capture_are_one_line_and_a_cut_one_is_read_up_to_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "gif").write_bytes(b"GIF89a")
    (tmp_path / "cut").write_bytes(capture(handshake())[:-5])
    for name in ("gif", "nothing", "."):
        assert main(["conversations", str(tmp_path / name)]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
    assert main(["conversations", str(tmp_path / "cut")]) == 0
    said = capsys.readouterr()
    assert "10.0.0.5:2000" in said.out and said.err.endswith("; only the packets before that are read\n")


def classic(packets: list[bytes]) -> bytes:
    head = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, pcap.RAW_IP)
    return head + b"".join(
        struct.pack("<IIII", 1, n, len(one), len(one)) + one for n, one in enumerate(packets)
    )


@pytest.mark.parametrize("form", ["pcapng", "pcap", "gz"])
def test_a_thousand_broken_files_end_with_a_line(
    form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    packets = [*handshake(), tcp(b"abc", 101, 501), tcp(b"ghi", 107, 501), udp(b"xyz")]
    packets.append(answer(seq=501, ack=110, flags=FIN | ACK))
    good = classic(packets) if form == "pcap" else capture(packets)
    if form == "gz":
        good = gzip.compress(good)
    path = tmp_path / "broken"
    codes = set()
    for seed in range(1000):
        chance = random.Random(seed)
        path.write_bytes(changed(good, chance))
        code = main(["conversations", str(path), "--format", chance.choice(["text", "json"])])
        said = capsys.readouterr()
        assert code in (0, 2) and "Traceback" not in said.err
        assert (code == 2) == (not said.out and len(said.err.splitlines()) == 1) or code == 0
        codes.add(code)
    assert codes == {0, 2}


# -- judges ----------------------------------------------------------------------------------------------


def test_tshark_follows_the_same_bytes(tmp_path: Path) -> None:
    if shutil.which("tshark") is None:
        pytest.skip("tshark is not installed")
    chance = random.Random(3)
    text = chance.randbytes(6000)
    sent = [(at, text[at : at + 100]) for at in range(0, 6000, 100)]
    order = sorted(range(60), key=lambda n: n + chance.randrange(6))
    packets = [*handshake(), *(tcp(sent[n][1], 101 + sent[n][0], 501) for n in order)]
    path = tmp_path / "c.pcapng"
    path.write_bytes(capture(packets))
    said = subprocess.run(
        ["tshark", "-r", str(path), "-q", "-z", "follow,tcp,raw,0"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    followed = "".join(line for line in said.splitlines() if line and set(line) <= set("0123456789abcdef"))
    assert bytes.fromhex(followed) == to_plc(listen(packets)) == text
