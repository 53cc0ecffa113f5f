"""What-if: a recorded run beside itself. Nothing changed, nothing differs; what is changed, parts them."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.replay.journals import InMemory, nothing_differs, recorded, what_if_nothing_changed
from tests.scenario.scenarios import CONFIGS, SCENARIOS
from trcvtui.cli.main import main
from trcvtui.recording.journal import CallRecord, Entry, Keyframe, LostEntries
from trcvtui.recording.recording import IS_KEYFRAME, BlockPlace, RecordingWriter
from trcvtui.replay import keyframes
from trcvtui.replay.keyframes import Keyframes, PositionedEntries
from trcvtui.replay.recorded_run import RecordedRun
from trcvtui.replay.what_if import RunTotals, WhatIf, print_both_runs

STORIES = CONFIGS / "scenarios" / "stories"


def in_memory(entries: Sequence[Entry]) -> Keyframes:
    return Keyframes(InMemory(tuple(entries)), "R.pcapng")


def what_if(path: Path, *sets: str, dialect: str | None = None) -> WhatIf:
    _, entries = recorded(path)
    run = WhatIf(in_memory(entries), sets, dialect)
    run.run_to_end()
    return run


class Late(InMemory):
    """A journal that begins in the middle, at a keyframe."""

    def __init__(self, whole: Sequence[Entry], frame: Keyframe) -> None:
        rest = PositionedEntries(InMemory(tuple(whole)), frame.steps, frame.beyond)
        super().__init__((whole[0], LostEntries(1, "it begins in the middle"), *rest))
        self._frame = frame._replace(steps=0, beyond=2)

    def list_keyframes(self) -> tuple[BlockPlace, ...]:  # type: ignore[override]
        return (BlockPlace(0, IS_KEYFRAME, self._frame.scan, self._frame.ns),)

    def read_keyframe(self, place: BlockPlace) -> Keyframe:
        return self._frame


@pytest.mark.parametrize("path", SCENARIOS[7::24], ids=lambda path: path.stem)
def test_a_run_from_a_keyframe_on_with_nothing_changed_is_the_recorded_one(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = recorded(path)[1]
    monkeypatch.setattr(keyframes, "KEYFRAME_SPACING", 9)
    known = in_memory(whole)
    run = known.start_run()
    while run.scan():
        known.keep_if_due(run)
    for frame in known._kept[:: 1 + len(known._kept) // 3]:
        late = WhatIf(Keyframes(Late(whole, frame), "R.pcapng"), [], None)
        late.run_to_end()
        nothing_differs(late)


def test_the_story_of_len_is_mended_by_len() -> None:
    run = what_if(STORIES / "four-bytes-short.toml", "instance.TRCV_C_1.LEN=20")
    assert run.parts_at == 53
    assert run.guess_from is None
    first = next(iter(run.describe()))
    assert first == "first difference at scan 53"


def test_the_story_of_the_byte_order_is_mended_by_the_byte_order() -> None:
    run = what_if(STORIES / "byte-order-swapped.toml", "data.meter.byte_order=big")
    assert run.parts_at is None
    assert run.value is not None
    assert (run.value.member, run.value.recorded, run.value.what_if) == ("meter.serial", 1781071872, 10602)
    assert [*run.describe()][:2] == [
        "STATUS is the same in each scan",
        f"scan {run.value.scan}: meter.serial is 1781071872 recorded, 10602 what-if",
    ]


def test_the_story_of_en_r_is_mended_by_a_pin_that_is_held() -> None:
    run = what_if(STORIES / "en-r-dropped.toml", "instance.TRCV_C_1.EN_R=true")
    said = "\n".join(run.describe())
    assert "3 commands left out: a pin held by the what-if is not written" in said
    assert run.guess_from is None
    was, now = run.get_totals()
    assert now.bytes == was.bytes
    carton = run.what_if.runtime.data("carton")
    assert carton == run.recorded.runtime.data("carton")


def test_another_dialect_shows_its_own_status() -> None:
    run = what_if(STORIES / "four-bytes-short.toml", dialect="s7-1500")
    assert run.parts_at == 1
    (shown,) = run.what_if.runtime.snapshot().instances
    assert (shown.outputs.done, shown.outputs.status, shown.jobs_done) == (True, 0x0000, 2)


def records(run: WhatIf) -> list[dict[str, object]]:
    out = io.StringIO()
    print_both_runs(run, out.write)
    return [json.loads(line) for line in out.getvalue().splitlines()]


def test_jsonl_has_both_runs_in_scan_order_and_then_what_has_come_of_them() -> None:
    _, entries = recorded(STORIES / "four-bytes-short.toml")
    lines = records(WhatIf(in_memory(entries), ["instance.TRCV_C_1.LEN=20"], None))
    *edges, last = lines
    assert last == {
        "parts_at_scan": 53,
        "guess_from_scan": None,
        "guess_why": None,
        "recorded": {"jobs": 2, "errors": 0, "bytes": 44},
        "what_if": {"jobs": 3, "errors": 0, "bytes": 60},
    }
    assert {edge["run"] for edge in edges} == {"recorded", "what-if"}
    scans = [int(str(edge["scan"])) for edge in edges]
    assert scans == sorted(scans)
    done = [(edge["scan"], edge["RCVD_LEN"]) for edge in edges if edge["run"] == "what-if" and edge["DONE"]]
    assert [size for _, size in done] == [20, 20, 20]


def test_what_a_partner_would_perhaps_have_done_is_a_guess(tmp_path: Path) -> None:
    # COM_RST of the recorded run ends the connection. Held at 0 it stands, and the partner comes again.
    run = what_if(STORIES / "en-r-dropped.toml", "instance.TRCV_C_1.COM_RST=false")
    assert run.guess_from is not None
    assert any("the what-if is a guess" in line for line in run.describe())


def test_bytes_that_the_recorded_run_left_unread_are_received(tmp_path: Path) -> None:
    scenario = tmp_path / "a.toml"
    scenario.write_text(UNREAD)
    run = what_if(scenario, "instance.A.EN_R=true")
    assert run.guess_from is None
    was, now = run.get_totals()
    assert (was, now) == (RunTotals(0, 0, 0), RunTotals(1, 1, 8))  # EN_R before there is a connection: 80A1


UNREAD = """
dialect = "baosky"
[[data]]
name = "rx"
type = "ARRAY[0..7] OF BYTE"
[[connect]]
name = "C1"
LocalAddress = "127.0.0.1"
LocalPort = 0
[[instance]]
name = "A"
block = "TRCV_C"
connect = "C1"
data = "rx"
CONT = true
[[peer]]
name = "P1"
active = true
remote = "@C1"
[scenario]
steps = '''
run 5
peer P1 connect
run 5
peer P1 send hex 01 02 03 04 05 06 07 08
run 20
'''
"""


@pytest.fixture
def a_file(tmp_path: Path) -> Path:
    _, entries = recorded(STORIES / "byte-order-swapped.toml")
    target = tmp_path / "run.pcapng"
    writer = RecordingWriter(target)
    writer.add_entries(entries)
    writer.close()
    return target


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--set", "instance.X.LEN=1"], "--set instance.X.LEN: found 'X', expected TRCV_C_1\n"),
        (["--set", "instance.TRCV_C_1.LEN=x"], "--set instance.TRCV_C_1.LEN: found "),
        (["--dialect", "s7"], "--dialect: found 's7', expected "),
        (["--dialect", "s7-1500", "--check"], "trcvtui replay: found --check with --set or --dialect"),
    ],
)
def test_a_wrong_path_or_value_is_a_line(
    given: list[str], said: str, a_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(a_file), *given]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(said)
    assert err.count("\n") == 1


def test_a_journal_with_strange_answers_ends_there() -> None:
    def strange(entry: Entry) -> Entry:
        if isinstance(entry, CallRecord) and (entry.owner, entry.call) == ("C1", "recv"):
            return entry._replace(answer=7)
        return entry

    _, entries = recorded(STORIES / "four-bytes-short.toml")
    what_if_nothing_changed(entries)
    told = RecordedRun(())
    told.read_beginning(map(strange, entries))
    while not told.is_broken:
        told.advance()
