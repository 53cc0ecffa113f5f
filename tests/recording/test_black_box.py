"""The black box: what has been up to now comes into a file when it is asked for, and runs again from it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.replay.journals import again
from tests.waiting import until
from trcvtui import clock
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.errors import UserError
from trcvtui.files import FilesRead
from trcvtui.recording import black_box, recorder
from trcvtui.recording.black_box import BlackBox, find_new_path
from trcvtui.recording.journal import Entry, LostEntries
from trcvtui.recording.recorder import attach_black_box
from trcvtui.recording.recording import Recording
from trcvtui.replay.command import find_difference
from trcvtui.replay.keyframes import Keyframes
from trcvtui.scenario.scenario import load_bench_project

PROJECT = """
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
EN_R = true
[[peer]]
name = "P1"
active = true
remote = "@C1"
reconnect = "T#50ms"
every = "T#20ms"
says = ["hex 01 02 03 04 05 06 07 08"]
"""


class Run:
    """A bench as the engine of a screen has it, with its black box."""

    def __init__(self, folder: Path) -> None:
        path = folder / "p.toml"
        path.write_text(PROJECT)
        self.recorder, self.box = attach_black_box(None, FilesRead())
        self.recorder.box = self.box
        self.recorder.__enter__()
        project = load_bench_project(path)
        self.recorder.reads.store(str(path), PROJECT.encode())
        bench = fresh_bench(project, "sim", self.recorder.seam)
        self.recorder.add_header(bench, path, (), is_scenario=False)
        self.controller = Controller(bench)
        self.controller.black_box = self.box

    def scans(self, number: int) -> None:
        for _ in range(number):
            self.controller.step(None)
            self.recorder.finish_scan(self.controller.bench)

    def line(self, text: str) -> str:
        self.controller.handle_line(1, text)
        answer = self.controller._answers[-1]
        return answer.error or answer.message

    def until_written(self) -> None:
        self._until(lambda: not self.box._ending)

    def until_state(self) -> None:
        self._until(lambda: self.box._state is None)

    def _until(self, is_done: Callable[[], bool]) -> None:
        """Leave the processor to the process that is waited for: it is a nice one."""

        def goes_on() -> bool:
            self.box.advance()
            return is_done()

        until(goes_on, lambda: vars(self.box))

    def close(self) -> None:
        self.controller.bench.close()
        self.recorder.close()


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Run]:
    made = Run(tmp_path)
    yield made
    made.close()


def entries(path: Path) -> list[Entry]:
    return list(Recording(path).read_entries())


def test_what_has_been_up_to_now_is_saved_and_runs_again(run: Run, tmp_path: Path) -> None:
    run.scans(100)
    assert run.line(f"save recording {tmp_path}/one").startswith("saving ")
    run.scans(20)
    run.until_written()
    assert run.box.status_text == "one.pcapng is written"
    played = again(entries(tmp_path / "one.pcapng"))
    assert find_difference(played) == ""
    assert played.bench.runtime.scans == 100
    assert played.bench.runtime.snapshot().instances[0].jobs_done > 20


def test_a_recording_begins_with_the_run_and_goes_on_until_it_is_stopped(run: Run, tmp_path: Path) -> None:
    run.scans(50)
    assert run.line(f"record {tmp_path}/two.pcapng").startswith(f"recording into {tmp_path}/two.pcapng")
    assert run.box.is_recording
    assert "found a recording into two.pcapng, expected" in run.line(f"record {tmp_path}/three")
    run.scans(60)
    run.line("set A LEN=4")
    run.scans(10)
    assert run.line("record stop") == f"ending {tmp_path}/two.pcapng"
    run.scans(5)
    run.until_written()
    played = again(entries(tmp_path / "two.pcapng"))
    assert find_difference(played) == ""
    assert played.bench.runtime.scans == 120
    assert "no recording under way" in run.line("record stop")


def test_the_end_of_the_run_is_the_end_of_its_recording(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.scans(30)
    run.line(f"record {tmp_path}/end")
    run.scans(30)
    run.close()
    assert find_difference(again(entries(tmp_path / "end.pcapng"))) == ""


def test_a_file_that_is_there_stays(run: Run, tmp_path: Path) -> None:
    run.scans(3)
    (tmp_path / "mine.pcapng").write_bytes(b"mine")
    for line in ("save recording", "record"):
        said = run.line(f"{line} {tmp_path}/mine.pcapng")
        assert said.endswith("mine.pcapng, which is there already, expected the name of a new file")
    assert "no such folder" in run.line(f"record {tmp_path}/none/mine.pcapng")
    assert (tmp_path / "mine.pcapng").read_bytes() == b"mine"


def test_a_name_of_its_own_is_new(tmp_path: Path) -> None:
    assert find_new_path(tmp_path, "p").name == "p-1.pcapng"
    (tmp_path / "p-1.pcapng").touch()
    assert find_new_path(tmp_path, "p").name == "p-2.pcapng"


def test_only_the_newest_bytes_are_kept_and_a_file_says_what_it_lacks(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(black_box, "POST_INTERVAL_NS", 0)
    monkeypatch.setattr(recorder, "COST_CHECK_NS", 1 << 62)  # on a busy machine it would give up
    run.box._most = 20_000
    run.scans(3000)
    assert run.box._size <= 20_000
    run.line(f"save recording {tmp_path}/late")
    run.until_written()
    found = entries(tmp_path / "late.pcapng")
    lost = [entry for entry in found if isinstance(entry, LostEntries)]
    assert lost[0].number > 1000
    assert lost[0].why == "the black box keeps the newest 64 MiB"
    said = find_difference(again(found))
    assert "gap of" in said and "\n" not in said


def test_a_state_that_could_not_be_made_is_told(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(black_box, "POST_INTERVAL_NS", 0)
    monkeypatch.setattr(recorder, "COST_CHECK_NS", 1 << 62)
    run.box._most = 20_000
    while run.box._state is None:
        run.scans(1)
    run.box._state.process._process.kill()
    run.until_state()
    assert run.recorder.last_error.startswith("no keyframe of the black box: ")


def test_a_box_that_takes_too_much_of_the_time_gives_up(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run.scans(10)
    monkeypatch.setattr(recorder, "COST_CHECK_NS", 1)
    run.scans(10)
    assert run.recorder.seam.is_off
    said = run.line(f"save recording {tmp_path}/off")
    assert said.startswith("prompt: found no black box, as it took more than 2 % of a processor")
    jobs = run.controller.bench.runtime.snapshot().instances[0].jobs_done
    run.scans(20)
    assert run.controller.bench.runtime.snapshot().instances[0].jobs_done > jobs
    assert run.box._kept == type(run.box._kept)()


def test_a_box_that_waits_beside_other_programs_goes_on(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = itertools.count(0, recorder.COST_CHECK_NS // 2)
    monkeypatch.setattr(clock, "now_ns", lambda: next(times))  # each gap lasts seconds: they were not ours
    run.recorder._time_of = clock.now_ns
    run.scans(100)
    assert run.box._since > 0 and not run.recorder.seam.is_off
    monkeypatch.setattr(clock, "thread_cpu_ns", lambda: next(times))
    run.recorder._time_of = clock.now_ns
    run.scans(100)
    assert run.recorder.seam.is_off


def test_a_run_without_a_black_box_says_so(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text(PROJECT)
    bench = fresh_bench(load_bench_project(path), "sim")
    controller = Controller(bench)
    controller.handle_line(1, "record")
    assert controller._answers[-1].error.startswith("prompt: found no black box for this run, expected ")
    controller.report_recording("run.pcapng 3.8 KB", "")
    controller.handle_line(2, "record")
    assert controller._answers[-1].error.startswith("prompt: found a run that --record records")
    bench.close()


def test_why_a_file_was_not_written_stands_whole_in_the_history(run: Run, tmp_path: Path) -> None:
    run.scans(20)
    name = "x" * 300
    assert run.line(f"save recording {tmp_path}/{name}").startswith("saving ")
    run.until_written()
    for _ in range(2):
        run.controller.report_recording(run.recorder.describe_status(), run.recorder.last_error)
    told = [str(line.event) for line in run.controller.bench.runtime.ledger if "xxx" in str(line.event)]
    assert len(told) == 1 and "File name too long" in told[0]


def test_a_wrong_word_for_the_switch_is_a_mistake(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text('dialect = "baosky"\n[options]\nblack_box = "maybe"\n')
    with pytest.raises(UserError, match="on or off"):
        load_bench_project(path)


def test_a_writer_that_is_killed_harms_nobody(run: Run, tmp_path: Path) -> None:
    run.scans(10)
    run.line(f"record {tmp_path}/killed")
    writer = run.box._recording
    assert writer is not None
    writer._process.kill()
    writer._process.wait()
    for _ in range(100_000):
        run.scans(1)
        if not run.box.is_recording:
            break
    assert not run.box.is_recording
    assert "killed.pcapng" in run.box.status_text
    assert isinstance(run.box, BlackBox)


def test_a_box_that_has_forgotten_the_beginning_runs_again_from_a_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(black_box, "POST_INTERVAL_NS", 0)
    monkeypatch.setattr(
        recorder, "MOST_BOX_PERCENT", 100
    )  # scans without a pause: after 5 s it would give up
    run = Run(tmp_path)
    run.box._most = 150_000
    firsts: list[int] = []
    for name in ("one", "two"):
        passed = firsts[-1] if firsts else 0
        while run.box._passed_scans <= passed or not run.box._frames:
            run.scans(10)
            run.until_state()
            assert not run.recorder.seam.is_off, "the box has given up"
        run.line(f"save recording {tmp_path}/{name}")
        run.until_written()
        keyframes = Keyframes(Recording(tmp_path / f"{name}.pcapng"), name)
        again = keyframes.start_run()
        assert keyframes.first and find_difference(again) == ""
        assert again.bench.runtime.scans == run.controller.bench.runtime.scans
        firsts.append(keyframes.first)
    assert firsts[0] < firsts[1]
    run.close()
