"""Run to a trigger: it fires in the scan where it becomes true, and the picture is that of this very scan."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from tests import golden
from tests.bench.bench_project import TELEGRAM, bench_project
from tests.local_driver import LocalDriver
from trcvtui.bench.bench import Bench
from trcvtui.engine.trigger_watch import read_trigger
from trcvtui.history.records import HistoryRequest
from trcvtui.picture.bench_update import BenchUpdate, UpdateRequest
from trcvtui.plc.ledger import StatusEdge
from trcvtui.project.file import read_project
from trcvtui.snapshots.bench import TriggerEvent

BENCH = """
dialect = "baosky"
[[udt]]
file = "telegram.st"
[[data]]
name = "rx"
type = "Telegram"
[[data]]
name = "raw"
type = "ARRAY[0..7] OF BYTE"
[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"
[[instance]]
name = "X"
block = "TRCV_C"
connect = "C1"
data = "raw"
ADHOC = true
[[instance]]
name = "Y"
block = "TRCV_C"
connect = "C1"
data = "rx"
[[peer]]
name = "P1"
active = true
remote = "@C1"
"""


class Desk:
    """A bench on the simulated network, driven line by line."""

    def __init__(self, folder: Path, *lines: str) -> None:
        (folder / "telegram.st").write_text(TELEGRAM)
        self.driver = LocalDriver(Bench(read_project(tomllib.loads(BENCH), "b.toml", folder), "sim"))
        self.seq = 0
        self.fired: TriggerEvent | None = None
        self.told = ""
        self.do("set X CONT=1 EN_R=1", "run 4", "peer P1 connect", "run 4", *lines)

    def do(self, *lines: str) -> BenchUpdate:
        """Carry out lines, `run` lets scans pass; return the picture after them."""
        self.driver.play(*lines)
        past = HistoryRequest("C1", size=64, data=("X", 0, 8))
        picture = self.driver.shown(UpdateRequest(self.seq, ("raw", "rx"), ("X",), history=past))
        assert [answer.error for answer in picture.answers if answer.error] == []
        self.told = next((answer.message for answer in picture.answers if answer.message), "")
        self.seq = picture.lines[-1].seq if picture.lines else self.seq
        self.fired = picture.fired
        return picture

    @property
    def scan(self) -> int:
        return self.driver.console.bench.runtime.scans


@pytest.mark.parametrize(
    ("trigger", "lines", "after"),
    [
        ("X STATUS=7008", ("peer P1 send hex 01", "run 9"), 1),
        ("X STATUS = 16#7008", ("peer P1 send hex 01", "run 9"), 1),
        ("X DONE rises", ("peer P1 send hex 01", "run 9"), 1),
        ("X BUSY falls", ("peer P1 send hex 01", "run 9"), 1),
        ("X EN_R falls", ("run 3", "set X EN_R=0", "run 9"), 4),
        ("X EN_R rises", ("set X EN_R=0", "run 3", "set X EN_R=1", "run 9"), 4),
        ("X COM_RST rises", ("run 2", "pulse X COM_RST", "run 9"), 3),
        ("X LEN>4", ("set X LEN=4", "run 2", "set X LEN=5", "run 9"), 3),
        ("X RCVD_LEN!=4", ("peer P1 send hex 01 02 03 04", "run 5", "peer P1 send hex 01", "run 9"), 6),
        ("X RCVD_LEN=1", ("peer P1 send hex 01 02 03 04", "run 5", "peer P1 send hex 01", "run 9"), 6),
        ("X RCVD_LEN<4", ("peer P1 send hex 01 02 03 04", "run 5", "peer P1 send hex 01", "run 9"), 6),
        ("X STATUS=80C5", ("run 2", "peer P1 close", "run 9"), 3),
        ("rx.speed > 100", ("write rx.speed 99.5", "run 2", "write rx.speed 100.5", "run 9"), 3),
        ("rx.speed>=100.5", ("write rx.speed 99.5", "run 2", "write rx.speed 100.5", "run 9"), 3),
        ("rx.flag rises", ("run 2", "write rx.flag TRUE", "run 9"), 3),
        ("rx.name = 'a=b'", ("run 2", "write rx.name 'a=b'", "run 9"), 3),
        ("rx.mode != Off", ("run 2", "write rx.mode On", "run 9"), 3),
        ("rx.t > T#1s", ("write rx.t T#999ms", "run 2", "write rx.t T#1001ms", "run 9"), 3),
        ("rx.m[2,0] < 0", ("run 2", "write rx.m[2,0] -1", "run 9"), 3),
        ("rx.pts[1].y <= -3", ("run 2", "write rx.pts[1].y -3", "run 9"), 3),
        ("raw[0] = 7", ("run 2", "peer P1 send hex 07", "run 9"), 3),
    ],
)  # fmt: skip
def test_a_trigger_fires_in_the_very_scan(
    trigger: str, lines: tuple[str, ...], after: int, tmp_path: Path
) -> None:
    desk = Desk(tmp_path, f"trigger {trigger}")
    armed_in = desk.scan
    picture = desk.do(*lines)
    assert picture.fired is not None
    assert (picture.fired.text, picture.fired.scan) == (trigger, armed_in + after)
    assert picture.snapshot.scan == armed_in + after, "the picture is that of the scan, not of now"
    assert max(line.scan for line in picture.lines) <= armed_in + after
    assert picture.armed == ""


def test_what_is_so_already_has_to_become_so_again(tmp_path: Path) -> None:
    desk = Desk(tmp_path, "trigger X STATUS=7006")
    assert desk.told == "armed; it is already true: it fires when it becomes true again"
    assert desk.do("run 5").fired is None
    assert desk.do("peer P1 send hex 01", "run 9").fired is not None


def test_a_wrong_length_fires_again_and_again_when_it_is_armed_again(tmp_path: Path) -> None:
    desk = Desk(tmp_path)
    for number in (1, 2, 3):
        fired = desk.do("trigger X RCVD_LEN!=4", "peer P1 send hex 01", "run 9").fired
        assert fired is not None
        assert fired.number == number


def test_the_picture_of_the_scan_has_its_bytes_and_all_before_it(tmp_path: Path) -> None:
    desk = Desk(tmp_path, "trigger X RCVD_LEN=3")
    picture = desk.do("peer P1 send hex 01", "run 9", "peer P1 send hex 01 02 03", "run 9",
                      "peer P1 send hex 09", "run 9")  # fmt: skip
    assert dict(picture.data)["raw"][:3] == b"\x01\x02\x03", "a later frame has overwritten it meanwhile"
    shown = [line.event.outputs.status for line in picture.lines if isinstance(line.event, StatusEdge)]
    assert shown[-1] == 0x7008
    assert shown.count(0x7008) == 2, "the frame before it is there too"
    later = desk.do()
    assert later.fired is None
    assert later.snapshot.scan == desk.scan
    assert picture.lines[-1].seq + 1 == later.lines[0].seq, "no line is lost between the two"
    then, now = picture.history, later.history
    assert then is not None and now is not None and then.data is not None and now.data is not None
    assert (then.content, now.content) == (b"\x01\x01\x02\x03", b"\x01\x01\x02\x03\x09")
    assert (then.data.job, now.data.job) == (1, 2), "what stood in DATA before"


def test_a_resized_variable_is_looked_at_in_its_new_form(tmp_path: Path) -> None:
    desk = Desk(tmp_path, "trigger raw[3] = 7", "resize raw ARRAY[0..15] OF BYTE", "run 1")
    assert desk.do("write raw+3 hex 07", "run 2").fired is not None


def test_a_trigger_on_what_is_gone_is_disarmed(tmp_path: Path) -> None:
    desk = Desk(tmp_path, "trigger Y STATUS=7008", "delete Y")
    assert desk.do("run 2").armed == ""


def test_a_fresh_bench_has_no_trigger(tmp_path: Path) -> None:
    desk = Desk(tmp_path, "trigger X STATUS=7008")
    (tmp_path / "s.toml").write_text(BENCH + '[scenario]\nname = "s"\nsteps = "run 1"\n')
    desk.driver.submit(f"scenario load {tmp_path / 's.toml'} sim")
    desk.driver.submit("scenario stop")
    assert desk.do("run 1").armed == ""


def test_what_is_no_trigger_is_refused(tmp_path: Path) -> None:
    project = bench_project(tmp_path)
    golden.mistakes("triggers", lambda text: read_trigger(text, project, "prompt"))
