"""Lines that intervene in a tap: read, written, completed, refused; places of a tap."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from trcvtui.bench.bench import Bench
from trcvtui.cli.main import main
from trcvtui.commands.table import parse_line, to_line
from trcvtui.commands.words import Intervene
from trcvtui.errors import UserError
from trcvtui.line.tap_observer import TapObserver, TapPlan
from trcvtui.line.watch_command import WatchLines
from trcvtui.net.tap import BACK, LOSS, TO, TapEvent, TapEventKind, TapOrder, order_of, place_of, route_of
from trcvtui.plc.ledger import StatusEdge
from trcvtui.project.file import read_project
from trcvtui.project.project import Project
from trcvtui.tui.completion import complete

TAP = {"name": "T", "listen": "2000", "to": "10.0.0.5:2000", "connect": "C1"}


@pytest.fixture
def project() -> Project:
    connect = {"name": "C1", "ActiveEstablished": False, "LocalPort": 2000}
    return read_project({"dialect": "baosky", "connect": [connect], "tap": [TAP]}, "p.toml", Path())


@pytest.mark.parametrize(
    ("line", "command"),
    [
        ("tap T to-plc hold", Intervene("T", True, "hold")),
        ("tap T from-plc go conversation 7", Intervene("T", False, "go", conversation=7)),
        ("tap T to-plc drop 3", Intervene("T", True, "drop", (3,))),
        ("tap T to-plc split 3,7", Intervene("T", True, "split", (3, 7))),
        ("tap T to-plc delay T#50ms", Intervene("T", True, "delay", (50_000_000,))),
        ("tap T to-plc edit 0 hex 0A 0B", Intervene("T", True, "edit", (0,), b"\n\x0b", "hex 0A 0B")),
        (
            'tap T to-plc insert text "a conversation 1" conversation 2',
            Intervene("T", True, "insert", (), b"a conversation 1", 'text "a conversation 1"', 2),
        ),
    ],
)
def test_a_line_is_read_and_written(project: Project, line: str, command: Intervene) -> None:
    assert parse_line(line, project, "w") == command
    assert to_line(command) == line


def test_the_conversation_may_stand_before_what_is_done(project: Project) -> None:
    line = "tap T to-plc conversation 7 edit 0 hex 0A"
    assert parse_line(line, project, "w") == Intervene("T", True, "edit", (0,), b"\n", "hex 0A", 7)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("tap X to-plc hold", "found 'X', expected T"),
        ("tap T up hold", "found 'up', expected to-plc or from-plc"),
        ("tap T to-plc hold 3", "found '3', expected the end of the command"),
        ("tap T to-plc drop 0", "found drop '0'"),
        ("tap T to-plc edit -1 hex 00", "found edit '-1'"),
        ("tap T to-plc delay 5", "found delay '5'"),
        ("tap T to-plc insert", "found nothing more, expected hex, text, udt, file or random"),
        ("tap T to-plc go conversation", "found 'conversation', expected conversation N at the end"),
        ("tap T to-plc insert random 1048577", "found 1048577 bytes, expected 1048576 at most"),
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
    assert bench.do(Intervene("T", True, "hold")) == "no tap runs here: `trcvtui tap` runs T"
    bench.close()


def test_an_order_crosses_as_a_line() -> None:
    order = TapOrder(1, 2, 1, "edit", (3,), b"\n \x00;")
    assert order_of(order.line().rstrip(b"\n"), order.route + 1) == order


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
    assert str(place_of(text, "LISTEN")) == place
    assert place_of(str(place_of(text, "")), "") == place_of(text, "")


def test_a_serial_place_has_its_settings() -> None:
    line = place_of("serial:/dev/ttyS0,19200,7E2", "LISTEN").line
    assert line is not None
    assert (line.baud, line.data_bits, line.parity, line.stop_bits) == (19200, 7, "even", 2)


class LinesOfAScreen:
    def scan(self, scan: int, changed: Sequence[StatusEdge], lacking: Sequence[str]) -> None:
        """Show a scan."""

    def note(self, ns: int, number: int, text: str) -> None:
        """Show what is said."""


def test_a_tap_without_descriptors_says_so_as_json_and_in_the_history_of_a_screen() -> None:
    plan = TapPlan([route_of("T", "1999", "2000", ("", ""))], None, None, None)
    written: list[str] = []
    said: list[str] = []
    lack = TapEvent(TapEventKind.LACK, TO, 0, 0, 3, 1_000_000_000, b"no descriptor left: 3 clients wait")
    lines = WatchLines(written.append, "jsonl", 10_000_000, 0)
    TapObserver(plan, lambda _: lines, list, said.append).take(lack)
    TapObserver(plan, lambda _: LinesOfAScreen(), list, said.append).take(lack)
    (record,) = map(json.loads, written)
    assert (record["tap"], record["waiting"], record["time"][:20]) == ("T", 3, "1970-01-01T00:00:01.")
    assert said == ["T: no descriptor left: 3 clients wait"]


def test_bytes_that_were_missed_are_a_hole_and_said() -> None:
    plan = TapPlan([route_of("T", "1999", "2000", ("", ""))], None, None, None)
    lines: list[str] = []
    said: list[str] = []
    looking = TapObserver(plan, lambda ns: WatchLines(lines.append, None, 10_000_000, ns), list, said.append)
    second = 1_000_000_000

    def event(kind: TapEventKind, ms: int, way: int = TO, at: int = 0, data: bytes = b"") -> None:
        looking.take(TapEvent(kind, way, 0, 1, at, 1000 * second + ms * 1_000_000, data))

    opens = b"tcp|127.0.0.1|50000|127.0.0.1|2000"
    event(TapEventKind.OPEN, 0, data=opens)
    event(TapEventKind.STANDS, 0, BACK)
    event(TapEventKind.BYTES, 100, data=b"seen")
    event(TapEventKind.LOST, 200, data=LOSS.pack(3, 1000) + (1).to_bytes(4, "little"))
    event(TapEventKind.OPEN, 200, at=1, data=opens)
    event(TapEventKind.BYTES, 300, at=1004, data=b"again")
    event(TapEventKind.NOW, 400)
    event(TapEventKind.OVER, 500)
    played = looking.close()
    assert said == ["3 events with 1000 bytes came faster than they were shown"]
    assert (played.assigned, played.unassigned) == ({1: ["C1", "C1_BACK"]}, {})
    text = "".join(lines)
    assert "C1: ? 1000 bytes missing in the capture, to the PLC end, from byte 4" in text
    assert "DONE 4 B" in text
    assert "? missing in the capture" in text.split("from byte 4")[1]


def test_what_is_held_from_the_beginning_needs_a_screen(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tap", "127.0.0.1:0", "127.0.0.1:1", "--hold"]) == 2
    assert capsys.readouterr().err == "--hold: found no screen, expected one that lets go what is held\n"


ROW = '[[tap]]\nname = "T"\nlisten = "{}"\nto = "{}"\nconnect = "{}"\n'
WRONG_PLACES = (
    (("here:2", "3"), "LISTEN: found 'here:2', expected [ADDR:]PORT, udp:[ADDR:]PORT or serial:"),
    (("2", "70000"), "CONNECT: found '70000', expected [ADDR:]PORT"),
    (("2", "udp:3"), "CONNECT: found 'udp:3' after '2', expected two places of one kind"),
    (("1502", "127.0.0.1:1502"), "expected another place than that of LISTEN"),
    (("serial:/dev/x,9600,9N1", "serial:/dev/y"), "LISTEN: found 'serial:/dev/x,9600,9N1', expected"),
    (("192.0.2.1:2", "3"), "LISTEN: found 192.0.2.1:2 (EADDRNOTAVAIL), expected an address that is free"),
    (("serial:/dev/not-there", "serial:/dev/neither"), "/dev/not-there: found open ENOENT"),
    (("x", "1", "C1"), "listen: found 'x', expected [ADDR:]PORT"),
    (("udp:1", "2", "C1"), "expected two places of one kind"),
    (("1", "2", "CX"), "found 'CX', expected"),
    ((), "found neither, expected LISTEN and CONNECT, or a --project with [[tap]]"),
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
