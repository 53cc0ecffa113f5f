"""Lines that intervene in a tap: read, written, completed, refused; places of a tap."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest

from trcvtui.bench.bench import Bench
from trcvtui.capture.pcap import CaptureReader, packet_block
from trcvtui.cli.main import main
from trcvtui.commands.table import format_command, parse_line
from trcvtui.commands.words import TapAct
from trcvtui.errors import UserError
from trcvtui.line.capture_player import CapturePlayer
from trcvtui.line.live import LivePlan
from trcvtui.line.shadows import ShadowPlan
from trcvtui.line.tap_capture import NOTES_ID, TapEncoder
from trcvtui.line.tap_watch import TapWatch
from trcvtui.line.watch_command import WatchLines
from trcvtui.net.os.lossy_pipe import MOST_LINE
from trcvtui.net.tap import WAY_BACK, WAY_TO, TapEvent, TapEventKind, TapOrder, parse_order, parse_place
from trcvtui.project.file import read_project
from trcvtui.project.project import Project
from trcvtui.tui.completion import complete

MS = 1_000_000
TAP = {"name": "T", "listen": "2000", "to": "10.0.0.5:2000", "connect": "C1"}


@pytest.fixture
def project() -> Project:
    connect = {"name": "C1", "ActiveEstablished": False, "LocalPort": 2000}
    return read_project({"dialect": "baosky", "connect": [connect], "tap": [TAP]}, "p.toml", Path())


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("tap T to-plc hold", TapAct("T", True, "hold")),
        ("tap T from-plc go conversation 7", TapAct("T", False, "go", conversation=7)),
        ("tap T to-plc drop 3", TapAct("T", True, "drop", (3,))),
        ("tap T to-plc split 3,7", TapAct("T", True, "split", (3, 7))),
        ("tap T to-plc delay T#50ms", TapAct("T", True, "delay", (50_000_000,))),
        ("tap T to-plc edit 0 hex 0A 0B", TapAct("T", True, "edit", (0,), b"\n\x0b", "hex 0A 0B")),
        (
            'tap T to-plc insert text "a conversation 1" conversation 2',
            TapAct("T", True, "insert", (), b"a conversation 1", 'text "a conversation 1"', 2),
        ),
    ],
)
def test_a_line_is_read_and_written(project: Project, line: str, command: TapAct) -> None:
    assert parse_line(line, project, "w") == command
    assert format_command(command) == line


def test_the_conversation_may_stand_before_what_is_done(project: Project) -> None:
    line = "tap T to-plc conversation 7 edit 0 hex 0A"
    assert parse_line(line, project, "w") == TapAct("T", True, "edit", (0,), b"\n", "hex 0A", 7)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("tap X to-plc hold", "found 'X', expected T"),
        ("tap T up hold", "found 'up', expected to-plc or from-plc"),
        ("tap T to-plc hold 3", "found '3', expected the end of the command"),
        ("tap T to-plc drop 0", "found drop '0'"),
        ("tap T to-plc edit -1 hex 00", "found edit '-1'"),
        ("tap T to-plc delay 5", "found delay '5'"),
        ("tap T to-plc insert", "found no further word, expected one of hex, text, udt, file, random"),
        ("tap T to-plc go conversation", "found 'conversation', expected conversation N at the end"),
        ("tap T to-plc insert random 1048577", "found 1048577 bytes, expected at most 1048576 bytes"),
    ],
)
def test_a_wrong_line_is_one_line(project: Project, line: str, said: str) -> None:
    with pytest.raises(UserError) as caught:
        parse_line(line, project, "w")
    assert said in str(caught.value)


def test_a_line_is_completed(project: Project) -> None:
    assert complete("tap ", project) == "tap T"
    assert complete("tap T f", project) == "tap T from-plc"
    assert complete("tap T to-plc ed", project) == "tap T to-plc edit"


def test_a_bench_without_a_tap_says_who_has_one(project: Project) -> None:
    bench = Bench(project, "sim")
    assert bench.do(TapAct("T", True, "hold")) == "no tap runs here: `trcvtui tap` runs T"
    bench.close()


def test_an_order_crosses_as_a_line() -> None:
    order = TapOrder(1, 2, 1, "edit", (3,), b"\n \x00;")
    assert parse_order(order.encode().rstrip(b"\n"), order.route + 1) == order


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("2000", "127.0.0.1:2000"),
        ("10.0.0.5:2000", "10.0.0.5:2000"),
        ("[fd00::5]:2000", "[fd00::5]:2000"),
        ("udp:2000", "udp:127.0.0.1:2000"),
        ("serial:/dev/ttyUSB0", "serial:/dev/ttyUSB0"),
    ],
)
def test_a_place_is_written_whole(text: str, place: str) -> None:
    assert str(parse_place(text, "LISTEN")) == place
    assert parse_place(str(parse_place(text, "")), "") == parse_place(text, "")


def test_a_serial_place_has_its_settings() -> None:
    line = parse_place("serial:/dev/ttyS0,19200,7E2", "LISTEN").line
    assert line is not None
    assert (line.baud, line.data_bits, line.parity, line.stop_bits) == (19200, 7, "even", 2)


class Observed:
    """What a tap tells, read as its observers do, by a TapWatch whose lines are kept."""

    def __init__(
        self, project: Path | None = None, *places: tuple[str, str, str], plc: str | None = None
    ) -> None:
        self.taps = [*places] or [("T", "1999", "2000")]
        self.capture = TapEncoder("a tap", {"taps": self.taps, "plc": plc, "dialect": None})
        self.lines: list[str] = []
        self.said: list[tuple[str, str]] = []
        plan = LivePlan(project, None, None)  # as an agent has it before the tap names its places

        def begin(made: ShadowPlan, first_ns: int) -> CapturePlayer:
            lines = WatchLines(self.lines.append, "jsonl", 10 * MS, first_ns)
            return CapturePlayer(made, (), first_ns, lines)

        self.watch = TapWatch(plan, begin, None, lambda ns, note, text: self.said.append((note.note, text)))

    def read(self, *blocks: bytes) -> list[dict[str, Any]]:
        """Play blocks to their end; return the records, the last of them what became of conversations."""
        reader = CaptureReader(BytesIO(self.capture.encode_head(1) + b"".join(blocks)).read, "tap")
        self.watch.found.names = reader.interface_name
        self.watch.found.add_packets(reader, reader.link_types)
        player = self.watch.finish()
        assert isinstance(player.lines, WatchLines)
        player.lines.write_outcome(player.close())
        return [json.loads(line) for line in "".join(self.lines).splitlines()]

    def blocks(self, *events: TapEvent) -> bytes:
        return b"".join([self.capture.encode_event(event) for event in events])


def event(
    kind: TapEventKind,
    ms: int,
    way: int = WAY_TO,
    at: int = 0,
    data: bytes = b"",
    number: int = 1,
    tap: int = 0,
) -> TapEvent:
    return TapEvent(kind, way, tap, number, at, 1_000_000_000_000 + ms * MS, data)


OPENS = b"tcp|127.0.0.1|50000|127.0.0.1|2000"
BEGIN = event(TapEventKind.OPEN, 0, data=OPENS), event(TapEventKind.ANSWERED, 0, WAY_BACK)


def test_a_tap_without_descriptors_says_so_in_words_of_its_tap() -> None:
    tap = Observed()
    tap.read(tap.blocks(event(TapEventKind.LACK, 0, at=3, data=b"no descriptor left: 3 clients wait")))
    assert tap.said == [("lack", "T: no descriptor left: 3 clients wait")]


def test_bytes_that_were_missed_are_a_hole_and_said() -> None:
    tap = Observed()
    before = tap.blocks(*BEGIN, event(TapEventKind.BYTES, 100, data=b"seen"))
    tap.blocks(event(TapEventKind.BYTES, 150, at=4, data=bytes(1000)))  # was left out
    loss = tap.capture.encode_loss(200 * MS, 3, 3, 1000) + tap.capture.encode_open_talks()
    again = event(TapEventKind.BYTES, 300, at=1004, data=b"again"), event(TapEventKind.ENDED, 500)
    records = tap.read(before, loss, tap.blocks(*again))
    assert tap.said == [("lost", "3 events with 1000 bytes came faster than they were shown")]
    assert records[-1]["assigned"] == [{"id": "C1", "shadows": ["C1", "C1_BACK"]}]
    notes = [(each["t_ms"], each["note"]) for each in records if each.get("conversation") == "C1"]
    assert notes == [(300.0, "? 1000 bytes missing in the capture, to the PLC end, from byte 4")]
    assert next(each["RCVD_LEN"] for each in records if each.get("DONE")) == 4


def test_another_process_that_serves_ends_what_has_ended_before_it_came() -> None:
    tap, other = Observed(), Observed()
    before = tap.blocks(*BEGIN, event(TapEventKind.BYTES, 100, data=b"seen"))
    begin = [each._replace(number=2, ns=each.ns + 300 * MS) for each in BEGIN]
    after = other.blocks(*begin, event(TapEventKind.BYTES, 400, data=b"second", number=2))
    records = tap.read(before, other.capture.encode_head(1_000_000_000_000 + 200 * MS), after)
    assert records[-1]["assigned"] == [{"id": name, "shadows": ["C1", "C1_BACK"]} for name in ("C1", "C2")]
    assert [each["RCVD_LEN"] for each in records if each.get("DONE")] == [4, 6]


def test_a_typed_line_that_never_ends_is_left_out_and_said() -> None:
    tap = Observed()
    tap.read()
    assert [len(tap.watch.run_typed_lines(part)) for part in (bytes(MOST_LINE), b"0", b"\n")] == [0, 1, 0]


def test_what_is_held_is_told_again_and_what_another_process_does_not_tell_is_not_held() -> None:
    tap, other = Observed(), Observed()
    other.blocks(event(TapEventKind.OPEN, 0, at=1, data=OPENS))
    before = tap.blocks(*BEGIN, event(TapEventKind.HELD, 100, at=4, data=b"!held"))

    def held(*blocks: bytes) -> list[int | None]:
        tap.read(*blocks)
        assert tap.watch.player is not None and tap.watch.player.talks is not None
        return [each.to_plc.held for each in tap.watch.player.talks.make_snapshots()]

    assert held(before, tap.capture.encode_loss(200 * MS, 3, 3, 1000), tap.capture.encode_open_talks()) == [4]
    assert held(other.capture.encode_head(300 * MS), other.capture.encode_open_talks()) == [None]


ROWS = """
[[connect]]
name = "C2"
ActiveEstablished = false
LocalPort = 2001
[[tap]]
name = "ONE"
listen = "1998"
to = "2000"
connect = "C1"
[[tap]]
name = "TWO"
listen = "1999"
to = "2000"
connect = "C2"
"""


@pytest.mark.parametrize("data", [b"1", b"more"])
def test_a_conversation_whose_begin_was_lost_has_its_ends_and_the_connect_of_its_tap(
    data: bytes, tmp_path: Path
) -> None:
    project = tmp_path / "p.toml"
    connect = 'dialect = "baosky"\n[[connect]]\nname = "C1"\nActiveEstablished = false\nLocalPort = 2000\n'
    project.write_text(connect + ROWS)
    tap = Observed(project, ("ONE", "1998", "2000"), ("TWO", "1999", "2000"))
    told = event(TapEventKind.OPEN, 0, at=1, data=OPENS, number=7, tap=1)
    later = (
        event(TapEventKind.BYTES, 9, WAY_BACK, 5, data, 7, 1),
        event(TapEventKind.BYTES, 9, WAY_TO, 4, data, 7, 1),
    )
    records = tap.read(tap.blocks(told, *later))
    assert records[-1]["assigned"] == [{"id": "C7", "shadows": ["C2"]}]
    assert [each["note"] for each in records if "conversation" in each] == ["begins in the middle"]
    (shown,) = tap.watch.player.talks.make_snapshots()  # type: ignore[union-attr]
    assert (shown.tap, shown.partner, shown.plc) == ("TWO", "127.0.0.1:50000", "127.0.0.1:2000")
    assert (shown.to_plc.size, shown.from_plc.size) == (len(data), len(data))


@pytest.mark.parametrize("kind", ["tcp", "udp"])
@pytest.mark.parametrize(("caller", "jobs"), [("127.0.0.2", [4]), ("127.0.0.3", [])])
def test_a_plc_that_calls_is_known_in_the_middle_of_a_conversation_too(
    kind: str, caller: str, jobs: list[int]
) -> None:
    place = "" if kind == "tcp" else "udp:"
    tap = Observed(None, ("T", f"{place}1999", f"{place}2000"), plc="127.0.0.2")
    opens = f"{kind}|{caller}|50001|127.0.0.1|2000".encode()
    told = event(TapEventKind.OPEN, 0, at=1, data=opens), event(TapEventKind.BYTES, 9, at=4, data=b"more")
    records = tap.read(tap.blocks(*told))
    assert [each["RCVD_LEN"] for each in records if each.get("DONE")] == jobs
    assert len(tap.watch.player.shadows.bench.project.instances) == 2  # type: ignore[union-attr]
    assert records[-1]["assigned"] == [{"id": "C1", "shadows": ["C1", "C1_BACK"]}] * len(jobs)


@pytest.mark.parametrize(
    "note",
    [
        b"", b"\xff", b'{"x": ' + b"[" * 100_000, b"7", b'{"note": "taps"}',
        b'{"note": "taps", "taps": [["a", "b", "c"]]}',
        b'{"note": "open", "tap": 9}', b'{"note": "open", "ends": [["x", 1], ["y", 2]]}',
        b'{"note": "open", "ends": [["127.0.0.1", 99999], ["::1", 2]]}', b'{"note": "open", "kind": "x"}',
        b'{"note": "held", "conversation": 1, "first": "xx"}', b'{"note": "figures", "window": "much"}',
        b'{"note": "end", "conversation": 5}', b'{"note": "ours", "conversation": -1, "tap": -5}',
    ],
)  # fmt: skip
def test_a_note_that_is_none_is_left_out(note: bytes) -> None:
    tap = Observed()
    whole = tap.blocks(*BEGIN, event(TapEventKind.BYTES, 100, data=b"seen"))
    records = tap.read(packet_block(NOTES_ID, 1, note), whole)
    assert records[-1]["assigned"] == [{"id": "C1", "shadows": ["C1", "C1_BACK"]}]


def test_what_is_held_from_the_beginning_needs_a_screen(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tap", "127.0.0.1:0", "127.0.0.1:1", "--hold"]) == 2
    assert (
        capsys.readouterr().err == "--hold: found no screen, expected a screen: only it releases held bytes\n"
    )


ROW = '[[tap]]\nname = "T"\nlisten = "{}"\nto = "{}"\nconnect = "{}"\n'
WRONG_PLACES = (
    (("here:2", "3"), "LISTEN: found 'here:2', expected [ADDR:]PORT, udp:[ADDR:]PORT or serial:"),
    (("2", "70000"), "CONNECT: found '70000', expected [ADDR:]PORT"),
    (("2", "udp:3"), "CONNECT: found 'udp:3' after '2', expected two places of one kind"),
    (("1502", "127.0.0.1:1502"), "expected a place other than LISTEN"),
    (("serial:/dev/x,9600,9N1", "serial:/dev/y"), "LISTEN: found 'serial:/dev/x,9600,9N1', expected"),
    (
        ("192.0.2.1:2", "3"),
        "LISTEN: found 192.0.2.1:2 (EADDRNOTAVAIL), expected a free address of this machine",
    ),
    (("serial:/dev/not-there", "serial:/dev/neither"), "/dev/not-there: found open ENOENT"),
    (("x", "1", "C1"), "listen: found 'x', expected [ADDR:]PORT"),
    (("udp:1", "2", "C1"), "expected two places of one kind"),
    (("1", "2", "CX"), "found 'CX', expected"),
    ((), "found no ends, expected LISTEN and CONNECT, or a --project with [[tap]]"),
)


@pytest.mark.parametrize(("places", "said"), WRONG_PLACES)
def test_a_wrong_place_is_one_line(
    places: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "wrong.toml"
    connect = 'dialect = "baosky"\n[[connect]]\nname = "C1"\nActiveEstablished = false\nLocalPort = 2000\n'
    file.write_text(connect + (ROW.format(*places) if len(places) == 3 else ""))
    words = places if len(places) == 2 else ("--project", str(file))
    assert main(["tap", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
