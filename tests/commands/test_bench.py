"""The bench commands: what each line means."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from tests.bench.bench_project import bench_project
from trcvtui.commands import words
from trcvtui.commands.patterns import parse_pattern
from trcvtui.commands.table import parse_line, parse_script
from trcvtui.commands.tokens import random_bytes
from trcvtui.project.project import Project

MS = 1_000_000
ZERO = bytes(60)


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Return the project of these tests."""
    return bench_project(tmp_path_factory.mktemp("bench"))


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("set X CONT=1 EN_R=1 LEN=4", words.Set("X", (("CONT", True), ("EN_R", True), ("LEN", 4)))),
        ("set X ADHOC=TRUE EN_R=false", words.Set("X", (("ADHOC", True), ("EN_R", False)))),
        ("set X LEN=16#FFFF", words.Set("X", (("LEN", 65535),))),
        ("set X LEN=4294967295", words.Set("X", (("LEN", 4294967295),))),
        ("set X EN_R=blink", words.Set("X", (("EN_R", "blink"),))),
        ("  set   X\tCONT=0  ", words.Set("X", (("CONT", False),))),
        ("set X CONT=1 # the contract's comment", words.Set("X", (("CONT", True),))),
        ("pulse X COM_RST", words.Pulse("X", "COM_RST")),
        ("plc stop", words.PlcStop()),
        ("plc run", words.PlcRun()),
        ("link C1 down", words.Link("C1", False)),
        ("link C1 up", words.Link("C1", True)),
        ("fault bind EADDRINUSE on C1 times=1", words.FaultOn("bind", "EADDRINUSE", "C1")),
        ("fault queue", words.FaultOn("queue")),
        (
            "fault recv ECONNRESET nth=3 times=forever",
            words.FaultOn("recv", "ECONNRESET", None, 3, words.FOREVER),
        ),
        ("fault accept times=2 on C1", words.FaultOn("accept", None, "C1", 1, 2)),
        ("fault clear", words.FaultClear()),
        ("run 5", words.RunScans(5)),
        ("run T#200ms", words.RunFor(200 * MS)),
        ("run t#1s500ms", words.RunFor(1500 * MS)),
        ("peer P1 connect", words.PeerConnect("P1")),
        ("peer P2 listen", words.PeerListen("P2")),
        ("peer P1 close", words.PeerClose("P1")),
        ("peer P1 rst", words.PeerRst("P1")),
        ("peer P1 shutdown", words.PeerShutdown("P1")),
        ("peer P1 stall", words.PeerStall("P1")),
        ("peer P1 resume", words.PeerResume("P1")),
    ],
)
def test_a_command_without_bytes(project: Project, line: str, command: words.BenchCommand) -> None:
    assert parse_line(line, project, "w") == command


@pytest.mark.parametrize("line", ["", "   ", "# set X CONT=1", "   # x"])
def test_a_blank_line_and_a_comment_are_no_command(project: Project, line: str) -> None:
    assert parse_line(line, project, "w") is None


# -- payloads ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("form", "payload"),
    [
        ("hex 01 02 03", b"\x01\x02\x03"),
        ("hex 0x01,0x02, 0x3", b"\x01\x02\x03"),
        ("hex 16#01 16#FF", b"\x01\xff"),
        ("hex 010203", b"\x01\x02\x03"),
        ('text "abc"', b"abc"),
        ('text "a # b"  # a comment', b"a # b"),
        (r'text "say \"hi\"\r\n\x00"', b'say "hi"\r\n\x00'),
        ("file x.bin", b"\x00\x01file"),
        ('file "x.bin"', b"\x00\x01file"),
        ("random 100 seed=1", random_bytes(100, 1)),
        ("random 3", random_bytes(3, 0)),
    ],
)
def test_a_payload_in_each_of_its_forms(project: Project, form: str, payload: bytes) -> None:
    assert parse_line(f"peer P1 send {form}", project, "w") == words.PeerSend("P1", payload)


def telegram(**leaves: bytes) -> bytes:
    """Return the bytes of a Telegram: 0 but for the members named, at the offsets of cap4 by hand."""
    places = {"id": 0, "speed": 4, "flag": 8, "mode": 10, "t": 12, "name": 16, "m": 26, "pts": 36, "w": 48}
    whole = bytearray(52)
    for name, content in leaves.items():
        whole[places[name] : places[name] + len(content)] = content
    return bytes(whole)


@pytest.mark.parametrize(
    ("braces", "payload"),
    [
        ("{}", telegram()),
        ("{ }", telegram()),
        ("{speed=1.5}", telegram(speed=struct.pack("<f", 1.5))),
        ("{id=-1, speed = 1e3}", telegram(id=b"\xff" * 4, speed=struct.pack("<f", 1000))),
        ("{id=16#10,flag=TRUE}", telegram(id=b"\x10\0\0\0", flag=b"\1")),
        ("{mode=On}", telegram(mode=b"\7\0")),
        ("{mode=7}", telegram(mode=b"\7\0")),
        ("{t=T#1s500ms}", telegram(t=struct.pack("<i", 1500))),
        ("{name='x, y} z'}", telegram(name=b"\x08\x07x, y} z")),
        ("{name='it$'s$0A'}", telegram(name=b"\x08\x05it's\n")),
        (r'{name="a\"\x41"}', telegram(name=b'\x08\x03a"A')),
        ("{name=plain}", telegram(name=b"\x08\x05plain")),
        ("{m[2,1]=5}", telegram(m=b"\0\0\0\0\0\0\5\0")),
        ("{pts[1].y=3}", telegram(pts=b"\0\0\0\0\0\0\3\0")),
        ("{pts[1]={x=1, y=2}, w=16#BEEF}", telegram(pts=b"\0\0\0\0\1\0\2\0", w=b"\xef\xbe")),
        ("{pts={[2]={x=9}}}", telegram(pts=b"\0\0\0\0\0\0\0\0\x09\0")),
    ],
)
def test_a_udt_is_sent_by_its_members(project: Project, braces: str, payload: bytes) -> None:
    assert parse_line(f"peer P1 send udt Telegram {braces}", project, "w") == words.PeerSend("P1", payload)


def test_options_of_send_come_in_any_order(project: Project) -> None:
    expected = words.PeerSend("P1", b"\1\2\3\4", (1, 2), 20 * MS, 10, 50 * MS)
    for options in (
        "split=1,2 gap=T#20ms repeat=10 every=T#50ms",
        "every=T#50ms repeat=10 gap=T#20ms split=1,2",
    ):
        assert parse_line(f"peer P1 send hex 01 02 03 04 {options}", project, "w") == expected


# -- DATA --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "data", "offset", "payload"),
    [
        ("write rx hex 01 02 03", "rx", 0, b"\1\2\3"),
        ("write rx+4 hex 01", "rx", 4, b"\1"),
        ("write rx.speed 12.5", "rx", 4, struct.pack("<f", 12.5)),
        ("write rx.speed hex 00 00", "rx", 4, b"\0\0"),
        ("write rx.flag TRUE", "rx", 8, b"\1"),
        ("write rx.name 'abc'", "rx", 16, b"\x08\x03abc\0\0\0\0\0"),
        ("write rx.m[2,0] -2", "rx", 30, b"\xfe\xff"),
        ("write rx.pts[2] {y=3}", "rx", 44, b"\0\0\3\0"),
        ("write rx {w=1}", "rx", 0, telegram(w=b"\1\0")),
        ("write rx udt Point {x=1}", "rx", 0, b"\1\0\0\0"),
        ("write raw[7] 16#FF", "raw", 7, b"\xff"),
        ('write raw text "hi"', "raw", 0, b"hi"),
        ("write raw random 8 seed=3", "raw", 0, random_bytes(8, 3)),
        ("write n 258", "n", 0, b"\2\1"),
    ],
)
def test_a_variable_is_written(project: Project, line: str, data: str, offset: int, payload: bytes) -> None:
    assert parse_line(line, project, "w") == words.Write(data, offset, payload)


# -- conditions --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "condition"),
    [
        ("X STATUS=7004", words.PinsAre("X", (("STATUS", 0x7004),))),
        ("X STATUS=16#80a1 ERROR=1", words.PinsAre("X", (("STATUS", 0x80A1), ("ERROR", True)))),
        ("X STATUS=W#16#0001", words.PinsAre("X", (("STATUS", 1),))),
        (
            "X DONE=TRUE RCVD_LEN=4 LEN=16#10",
            words.PinsAre("X", (("DONE", True), ("RCVD_LEN", 4), ("LEN", 16))),
        ),
        ("peer P1 connected", words.PeerIs("P1", "connected")),
        ("peer P2 listening", words.PeerIs("P2", "listening")),
        ("peer P1 received hex 01 02", words.PeerReceived("P1", b"\1\2")),
        ('peer P1 received text "ok"', words.PeerReceived("P1", b"ok")),
        ("peer P1 received nothing", words.PeerReceived("P1", b"")),
        ("rx hex 01 02 03 04", words.DataIs("rx", 0, b"\1\2\3\4")),
        ("rx+50 hex 01", words.DataIs("rx", 50, b"\1")),
        ("rx.speed 12.5", words.MemberIs("rx", "speed", 12.5)),
        ("rx.speed 0.1", words.MemberIs("rx", "speed", struct.unpack("<f", struct.pack("<f", 0.1))[0])),
        ("rx.flag 1", words.MemberIs("rx", "flag", True)),
        ("rx.mode On", words.MemberIs("rx", "mode", 7)),
        ("rx.t T#1500ms", words.MemberIs("rx", "t", "T#1s500ms")),
        ("rx.name 'a b'", words.MemberIs("rx", "name", "a b")),
        ("rx.PTS[1].X 3", words.MemberIs("rx", "pts[1].x", 3)),
        ("raw[3] 4", words.MemberIs("raw", "[3]", 4)),
        ("n 5", words.MemberIs("n", "", 5)),
    ],
)
def test_a_condition(project: Project, text: str, condition: words.Condition) -> None:
    assert parse_line(f"expect {text}", project, "w") == words.Expect(condition)
    assert parse_line(f"expect {text} within T#1s", project, "w") == words.Expect(condition, 1000 * MS)
    assert parse_line(f"wait {text}", project, "w") == words.Wait(condition, 10_000 * MS)
    assert parse_line(f"wait {text} within T#2s", project, "w") == words.Wait(condition, 2000 * MS)


def test_a_trace(project: Project) -> None:
    text = "0001 7001 7002 80A1! 7002+ 7004 7006{3} 80C3!+ ..."
    expected = words.ExpectTrace("X", parse_pattern(text))
    assert parse_line(f"expect X trace {text}", project, "w") == expected


# -- scripts -----------------------------------------------------------------------------------------------


def test_a_script_numbers_its_commands_and_nothing_else(project: Project) -> None:
    script = "\n# first\nset X CONT=1\n\n   run 5   # wait\n#\nplc stop\n"
    assert parse_script(script, project, "s.toml") == [
        words.Step(1, "set X CONT=1", words.Set("X", (("CONT", True),))),
        words.Step(2, "run 5   # wait", words.RunScans(5)),
        words.Step(3, "plc stop", words.PlcStop()),
    ]


def test_files_are_looked_for_beside_the_project(tmp_path: Path) -> None:
    project = bench_project(tmp_path)
    (tmp_path / "sub dir").mkdir()
    (tmp_path / "sub dir" / "y.bin").write_bytes(b"y")
    command = parse_line('peer P1 send file "sub dir/y.bin" repeat=2', project, "w")
    assert command == words.PeerSend("P1", b"y", repeat=2)
