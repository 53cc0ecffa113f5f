"""Mending the project that runs: `set` of a part, `remove`, `undo`; what is refused, what restarts."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests import golden
from tests.local_driver import LocalDriver
from trcvtui.engine.controller import fresh_bench
from trcvtui.project.file import load_project
from trcvtui.scenario.command import run_files
from trcvtui.scenario.scenario import load_bench_project, load_scenario

PROJECT = """# the line to the scale
dialect = "baosky"

[[data]]
name = "rx"
type = "ARRAY[0..7] OF BYTE"  # eight

[[connect]]
name = "C1"  # to the scale
LocalAddress = "127.0.0.1"
LocalPort = 2000

[[connect]]
name = "C2"
ActiveEstablished = true
LocalAddress = "127.0.0.1"
RemoteAddress = "127.0.0.1"
RemotePort = "@P2"

[[instance]]
name = "R1"
block = "TRCV_C"
connect = "C1"
data = "rx"

[[instance]]
name = "C2"
block = "TSEND_C"
connect = "C2"
data = "rx"

[[peer]]
name = "P1"
remote = "@C1"

[[peer]]
name = "P2"
active = false
"""


class Desk(LocalDriver):
    """A simulated bench of a project file."""

    def __init__(self, path: Path, text: str = PROJECT) -> None:
        path.write_text(text, encoding="utf-8")
        self.path = path
        super().__init__(fresh_bench(load_bench_project(path), "sim"), pause=2)
        self.scan()

    def status(self, name: str) -> str:
        return f"{self.bench.runtime.outputs(name).status:04X}"


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path / "line.toml")


def test_set_of_a_connect_says_before_and_now_and_who_begins_anew(desk: Desk) -> None:
    desk.do("set R1 CONT=1 EN_R=1")
    desk.scan(3)
    assert desk.bench.runtime.listening_port("C1") == 2000
    told = desk.answer("set C1 LocalPort=2500")
    assert told == "CONNECT C1: LocalPort 2000 before, 2500 now; restarts: CONNECT C1, instance R1"
    desk.scan(1)
    assert desk.status("R1") == "0001", "CONT is 1 as before, and counts as rising"
    desk.scan(5)
    assert desk.bench.runtime.listening_port("C1") == 2500
    desk.do("peer P1 connect")
    desk.scan(4)
    desk.do("peer P1 send hex 01 02 03 04 05 06 07 08")
    desk.scan(4)
    assert desk.bench.runtime.data("rx") == bytes(range(1, 9))
    desk.bench.close()
    assert desk.bench.leaks() == ()


def test_set_of_pins_stays_what_it_was(desk: Desk) -> None:
    desk.do("set R1 CONT=1 EN_R=1 LEN=4")
    assert desk.bench.runtime.inputs("R1")["LEN"] == 4
    assert desk.answer("set R1 CONT=2").startswith("✗ prompt")
    assert desk.answer("undo").startswith("✗"), "pins are no edit of the project"


def test_a_name_of_two_kinds_is_refused_with_both_ways_to_say_it(desk: Desk) -> None:
    both = "found 'C2', the name of a CONNECT and an instance, expected "
    assert both + "set connect C2 .. or set instance C2 .." in desk.answer("set C2 CONT=1")
    assert both + "remove connect C2 or remove instance C2" in desk.answer("remove C2")
    desk.do("set connect C2 SendDelayOpt=true", "set instance C2 CONT=1")
    assert desk.bench.runtime.inputs("C2")["CONT"] is True
    assert desk.bench.project.connect("C2").send_delay_opt  # type: ignore[union-attr]


def test_undo_takes_back_the_edits_one_by_one_and_no_pin_and_no_byte(desk: Desk) -> None:
    desk.do("set C1 LocalPort=2500", "set rx ARRAY[0..9] OF BYTE", "remove P1", "add data tx REAL")
    desk.do("write rx hex 07", "set R1 EN_R=1")
    assert desk.answer("undo") == "taken back: DATA variable tx is removed"
    assert desk.answer("undo") == "taken back: peer P1 is added: active=true remote=@C1"
    desk.scan(2)
    assert [peer.decl.name for peer in desk.bench.peers.values()] == ["P1", "P2"]
    desk.do("undo", "undo")
    assert desk.bench.runtime.data("rx") == b"\x07" + bytes(7)
    assert desk.bench.runtime.inputs("R1")["EN_R"] is True
    assert desk.console._edits.unsaved_count == 0, "everything is as in the file"
    assert desk.answer("undo").startswith("✗")


def test_twenty_edits_can_be_taken_back(desk: Desk) -> None:
    desk.do(*(f"set C1 LocalPort={2100 + number}" for number in range(23)), *["undo"] * 20)
    assert desk.bench.project.connect("C1").local.port == 2102  # type: ignore[union-attr]
    assert desk.answer("undo").startswith("✗")


def test_an_instance_comes_back_to_its_place_in_the_call_order(desk: Desk) -> None:
    desk.do("remove R1", "undo")
    assert [out.instance for out in desk.bench.runtime.due_edges] == ["R1", "C2"]
    desk.do("add data tx REAL", "set R1 data=tx", "set R1 CONT=1")
    desk.scan(2)
    assert desk.bench.project.instance("R1").data == "tx"  # type: ignore[union-attr]


def test_a_combuffer_and_what_reads_it_are_built_anew(tmp_path: Path) -> None:
    text = (
        'dialect = "twincat"\n[[combuffer]]\nname = "B1"\n[[data]]\nname = "rx"\n'
        'type = "ARRAY[0..9] OF BYTE"\n[[instance]]\nname = "RD"\nblock = "ReceiveData"\nRxBuffer = "B1"\n'
        'data = "rx"\nSizeReceiveData = 3\n'
    )
    desk = Desk(tmp_path / "serial.toml", text)
    desk.do("feed B1 hex 01")
    told = desk.answer("set B1 size=400")
    assert told == "ComBuffer B1: size none before, 400 now; restarts: ComBuffer B1, instance RD"
    desk.scan()
    desk.do("feed B1 hex 07 08 09")
    assert desk.bench.runtime.data("rx")[:3] == b"\x07\x08\x09", "what was in it is gone"
    assert "in use by instance RD" in desk.answer("remove B1")
    desk.do("remove RD", "remove B1")
    assert desk.bench.runtime.snapshot().combuffers == ()
    desk.do("undo", "undo", "feed B1 hex 01 02 03")
    assert desk.bench.runtime.data("rx")[:3] == b"\x01\x02\x03"


@pytest.mark.parametrize("dialect", ["s7-1500", "s7-1200", "s7-1200-legacy"])
def test_a_connection_description_is_set_by_its_fields(tmp_path: Path, dialect: str) -> None:
    text = (
        f'dialect = "{dialect}"\n[[connect]]\nname = "C1"\nLocalPort = 2000\n[[connect]]\nname = "C2"\n'
        'LocalPort = 2001\nLocalAddress = "127.0.0.1"\n'
    )
    desk = Desk(tmp_path / "s7.toml", text)
    assert "LocalPort" not in desk.answer("set C2 LocalPort=2500").partition(" now")[2]
    desk.do("save project")
    assert text.replace("2001", "2500") == desk.path.read_text(encoding="utf-8")
    assert load_project(desk.path).connect("C2").local.port == 2500  # type: ignore[union-attr]


def test_save_project_writes_the_keys_that_changed_and_leaves_the_rest(desk: Desk) -> None:
    desk.do(
        "set C1 LocalPort=2500 SendDelayOpt=true", "set rx ARRAY[0..9] OF BYTE", "remove P1", "save project"
    )
    text = PROJECT.replace("LocalPort = 2000\n", "LocalPort = 2500\nSendDelayOpt = true\n")
    text = text.replace("0..7", "0..9").replace('[[peer]]\nname = "P1"\nremote = "@C1"\n\n', "")
    assert desk.path.read_text(encoding="utf-8") == text
    assert desk.console._edits.unsaved_count == 0
    desk.do("undo", "undo", "undo", "save project")
    assert load_project(desk.path).peer("P1") is not None
    assert load_project(desk.path).connect("C1").local.port == 2000  # type: ignore[union-attr]


def test_what_start_names_cannot_be_removed(tmp_path: Path) -> None:
    desk = Desk(tmp_path / "start.toml", 'start = "peer P2 listen"\n' + PROJECT.replace('"@P2"', "4000"))
    assert "start: step 1 (peer P2 listen)" in desk.answer("remove P2")


def test_the_lines_work_in_a_scenario_and_a_saved_session_plays_them_again(
    desk: Desk, capsys: pytest.CaptureFixture[str]
) -> None:
    desk.do("set R1 CONT=1", "set C1 LocalPort=2500", "remove P1", "undo", "set P1 reconnect=T#50ms")
    desk.scan(20)
    assert desk.bench.peers["P1"].is_in("connected")
    scenario = desk.path.parent / "played.toml"
    desk.do(f"save scenario {scenario}")
    assert run_files([scenario], "sim", "text", None, []) == 0, capsys.readouterr().out
    commands = [step.command for step in load_scenario(scenario).steps]
    assert {"Change", "Remove", "UndoEdit"} <= {type(command).__name__ for command in commands}


def test_what_cannot_be_is_one_line_and_changes_nothing(desk: Desk) -> None:
    before = desk.bench.project
    golden.answers("mending", lambda line: [desk.answer(line)])
    assert desk.bench.project is before and desk.console._edits.unsaved_count == 0
