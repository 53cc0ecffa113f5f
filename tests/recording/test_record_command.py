"""`--record` and `replay` from the command line: files, refusals, exit codes, writers that are killed."""

from __future__ import annotations

import os
import re
import signal
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.test_cli import ENVIRONMENT
from tests.scenario.scenarios import BAOSKY, CONFIGS
from tests.waiting import until, until_size
from trcvtui import __version__
from trcvtui.capture.pcap import open_capture
from trcvtui.cli.main import main
from trcvtui.errors import mistake
from trcvtui.recording import files, journal, state, writer
from trcvtui.recording.files import RecordTarget
from trcvtui.recording.journal import SIM_WALL_NS, CallRecord, Entry, LostEntries, RunHeader
from trcvtui.recording.recording import Recording, RecordingWriter
from trcvtui.recording.writer import WriterProcess
from trcvtui.replay.run_again import ReplayRun

RING_S = 400 if "TRCVTUI_SOAK" in os.environ else 160  # simulated, of a ring that holds some 90
STORY = CONFIGS / "scenarios" / "baosky" / "80c5-fin-mid-send.toml"


def entries(path: Path) -> list[Entry]:
    return list(Recording(path).read_entries())


@pytest.mark.parametrize("kernel", ["sim", pytest.param("live", marks=[pytest.mark.live, pytest.mark.slow])])
def test_a_recorded_scenario_checks_and_prints_the_same(
    tmp_path: Path, kernel: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "R.pcapng"
    asked = ["scenario", str(STORY), "--kernel", kernel, "--format", "jsonl", "--record", str(file)]
    assert main(asked) == 0
    printed = capsys.readouterr().out
    assert file.stat().st_mode & 0o777 == 0o600
    assert main(["replay", str(file), "--check"]) == 0
    assert capsys.readouterr().out == f"{file}: 20 scans, the same again\n"
    assert main(["replay", str(file), "--format", "jsonl"]) == 0
    assert capsys.readouterr().out == printed


def test_several_scenarios_have_a_file_each(tmp_path: Path) -> None:
    asked = BAOSKY[:3]
    assert main(["scenario", *map(str, asked), "--record", str(tmp_path / "new")]) == 0
    assert sorted(each.name for each in (tmp_path / "new").iterdir()) == [f"{p.stem}.pcapng" for p in asked]


def test_a_file_that_is_there_is_refused_and_only_a_recording_is_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, other = tmp_path / "R.pcapng", tmp_path / "other.txt"
    other.write_text("mine")
    assert main(["scenario", str(STORY), "--record", str(file)]) == 0
    before = file.read_bytes()
    assert main(["scenario", str(STORY), "--record", str(file)]) == 2
    assert "there already" in capsys.readouterr().err and file.read_bytes() == before
    assert main(["scenario", str(STORY), "--record", str(file), "--overwrite"]) == 0
    assert main(["scenario", str(STORY), "--record", str(other), "--overwrite"]) == 2
    assert other.read_text() == "mine"


def test_what_is_no_recording_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(STORY), "--check"]) == 2
    assert main(["replay", str(tmp_path / "none"), "--check"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 2


# -- the process that writes -------------------------------------------------------------------------------

BEGINS = RunHeader("0", "sim", 0, 0, True, "x.toml", (), "/", (), ())


def some(count: int) -> list[Entry]:
    return [CallRecord("C1", "recv", (7, 9), (9, number.to_bytes(9, "big"))) for number in range(count)]


def test_what_a_writer_process_gets_stands_in_the_file(tmp_path: Path) -> None:
    sink = WriterProcess(tmp_path / "R.pcapng", RecordTarget(tmp_path / "R.pcapng"))
    sink.add_entries([BEGINS])
    for _ in range(20):
        sink.add_entries(some(1000))
    sink.close()
    assert sink.trouble == ""
    assert entries(tmp_path / "R.pcapng") == [BEGINS, *some(1000) * 20]


def test_a_writer_that_is_killed_is_told_once_and_the_run_goes_on(tmp_path: Path) -> None:
    sink = WriterProcess(tmp_path / "R.pcapng", RecordTarget(tmp_path / "R.pcapng"))
    sink.add_entries([BEGINS])
    os.kill(sink.pid, signal.SIGKILL)
    while not sink.trouble:
        sink.add_entries(some(100_000))
    sink.add_entries(some(1))
    sink.close()
    assert sink.trouble.endswith("the writer has ended; nothing more is recorded")
    assert Recording(tmp_path / "R.pcapng").stopped == ""


def test_a_writer_that_does_not_follow_leaves_a_marked_gap(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer, "MOST_WAITING_BYTES", 1 << 20)
    sink = WriterProcess(tmp_path / "R.pcapng", RecordTarget(tmp_path / "R.pcapng"))
    sink.add_entries([BEGINS])
    os.kill(sink.pid, signal.SIGSTOP)
    for _ in range(40):
        sink.add_entries(some(10_000))
        sink.queue_own_block()
    os.kill(sink.pid, signal.SIGCONT)
    while sink.is_behind:
        sink.advance()
    sink.add_entries(some(3))
    sink.close()
    found = entries(tmp_path / "R.pcapng")
    [gap] = [one for one in found if isinstance(one, LostEntries)]
    assert gap.number + len(found) == 1 + 40 * 10_000 + 3 + 1
    assert found[-3:] == some(3)
    assert sink.trouble.endswith(f": {gap.number} entries are not recorded: the writer was too slow")


# -- `trcvtui record` --------------------------------------------------------------------------------------

PROJECT = """
dialect = "baosky"
start = "set TRCV_C_1 CONT=1 EN_R=1"
[[data]]
name = "rx"
type = "ARRAY[1..1000] OF BYTE"
[[connect]]
name = "C1"
ActiveEstablished = true
LocalAddress = "127.0.0.1"
RemoteAddress = "127.0.0.1"
RemotePort = "@P1"
[[instance]]
name = "TRCV_C_1"
block = "TRCV_C"
connect = "C1"
data = "rx"
[[peer]]
name = "P1"
active = false
says = ["random 1000 seed=7 repeat=100000 every=T#1s"]
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    path = tmp_path / "P.toml"
    path.write_text(PROJECT)
    return path


def names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def test_record_keeps_a_run_for_its_duration(project: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    asked = ["record", str(project), "--kernel", "sim", "--out", str(out), "--duration", "T#3s"]
    assert main(asked) == 0
    assert main(asked) == 0
    assert names(out) == ["P-0001.pcapng", "P-0002.pcapng"]
    assert main(["replay", str(out / "P-0001.pcapng"), "--check"]) == 0
    assert main(["replay", str(out / "P-0002.pcapng"), "--check"]) == 0


def test_a_ring_keeps_the_newest_files_and_each_runs_again_from_its_beginning(
    project: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    limits = ["--ring", "256KiB", "--split", "64KiB", "--duration", f"T#{RING_S}s"]
    assert main(["record", str(project), "--kernel", "sim", "--out", str(out), *limits]) == 0
    files = names(out)
    assert len(files) > 2 and "P-0001.pcapng" not in files
    assert sum((out / name).stat().st_size for name in files) < 300 << 10
    assert main(["replay", str(out / files[-1]), "--check"]) == 0
    first, last = map(
        int, re.findall(r": scans (\d+) to (\d+), the same again\n", capsys.readouterr().out)[0]
    )
    assert 75 * RING_S < first < last == 100 * RING_S + 1
    for name in files:
        done = [
            one for one in entries(out / name) if isinstance(one, CallRecord) and one.args[3:4] == (True,)
        ]
        with open_capture(out / name) as capture:
            came = [packet for packet in capture if packet.data[:1] == b"E" and len(packet.data) > 40]
        if name == files[-1] and not came:  # it began in the last scans: sizes follow the path's length
            continue
        assert sum(len(packet.data) - 40 for packet in came) == 1000 * len(done) > 0
        assert came[0].comments[0].startswith("begins in the middle: ")
        assert sum(" DONE 1000 B" in text for packet in came for text in packet.comments) == len(done)
        assert {packet.data[20:24] for packet in came} == {struct.pack(">HH", 32768, 32769)}


@pytest.fixture
def blinking(tmp_path: Path) -> list[str]:
    """Return how to record a run whose peer acts between scans, faster than its block receives."""
    text = PROJECT.replace("EN_R=1", "EN_R=1 ADHOC=blink").replace("1000 seed=7", "200 seed=7")
    (tmp_path / "P.toml").write_text(text.replace("T#1s", "T#3ms"))
    return ["record", str(tmp_path / "P.toml"), "--kernel", "sim", "--out", str(tmp_path / "out")]


def test_each_file_of_a_split_run_runs_again(
    blinking: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*blinking, "--split", "64KiB", "--duration", "T#6s"]) == 0
    files = sorted((tmp_path / "out").iterdir())
    assert len(files) > 6
    assert [main(["replay", str(file), "--check"]) for file in files] == [0] * len(files)
    assert capsys.readouterr().err == ""
    assert all(Recording(file).list_keyframes() for file in files[1:])


def test_a_late_file_of_another_version_is_refused_with_its_version(
    blinking: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with monkeypatch.context() as older:  # its states name classes that are renamed since
        older.setattr(journal, "__version__", "0.3.0.dev1")
        assert main([*blinking, "--split", "64KiB", "--duration", "T#2s"]) == 0
    first, late, *_ = (str(file) for file in sorted((tmp_path / "out").iterdir()))
    assert main(["replay", late, "--check"]) == 2
    [error] = capsys.readouterr().err.splitlines()
    assert "found a state of trcvtui 0.3.0.dev1" in error and f"expected one of {__version__}" in error
    assert main(["replay", first, "--check"]) == 0  # it begins with its run: it needs no state


def test_a_ring_too_small_for_two_files_is_told_with_the_size_that_would_do(
    blinking: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    limits = ["--split", "64KiB", "--duration", "T#6s"]
    assert main([*blinking, *limits, "--ring", "128KiB"]) == 1
    [told] = capsys.readouterr().err.splitlines()
    found, least = re.findall(r"found (\d+) bytes, .* expected (\d+KiB) or more", told)[0]
    assert int(found) == 128 << 10 and len(names(tmp_path / "out")) == 1
    assert main([*blinking, *limits, "--ring", least]) == 0
    assert len(names(tmp_path / "out")) > 2
    assert capsys.readouterr().err == ""


def test_a_state_that_cannot_be_kept_is_told_as_an_error_of_the_program(
    blinking: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(state, "MAY_HOLD", [one for one in state.MAY_HOLD if one != "trcvtui.bench"])
    assert main([*blinking, "--split", "64KiB", "--duration", "T#2s"]) == 1
    [told] = capsys.readouterr().err.splitlines()
    assert "found TypeError: no name of trcvtui.bench." in told and "an error of trcvtui" in told
    assert main(["replay", str(tmp_path / "out" / "P-0001.pcapng"), "--check"]) == 0


ASKED_ON = ["record", "--on", "TRCV_C_1 STATUS=7008", "--before", "T#100ms", "--after", "T#50ms"]
ASKED_ON += ["--kernel", "sim", "--duration", "T#3s"]


def test_what_surrounds_a_trigger_is_kept(project: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main([*ASKED_ON, "--out", str(out), str(project)]) == 0
    assert len(names(out)) > 1
    for name in names(out):
        assert main(["replay", str(out / name), "--check"]) == 0  # from the beginning of its run
        found = entries(out / name)
        [told] = [one.args for one in found if isinstance(one, CallRecord) and one.call == "do"][-1:]
        assert isinstance(found[0], RunHeader) and told == ("trigger TRCV_C_1 STATUS=7008",)
        at = [one.answer for one in found if isinstance(one, CallRecord) and one.call == "step"][-1]
        assert isinstance(at, int)
        with open_capture(out / name) as capture:
            times = [p.ns - SIM_WALL_NS for p in capture if p.data[:1] == b"E" and len(p.data) > 40]
        assert times
        assert min(times) >= at - 180_000_000  # 100 before, 50 after, and what is rounded to scans


@pytest.mark.parametrize("is_followed", [True, False])
def test_a_file_of_a_trigger_after_too_long_a_run_has_a_keyframe_or_says_what_it_lacks(
    project: Path,
    tmp_path: Path,
    is_followed: bool,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(files, "MOST_OLD_BYTES", 1000)
    if not is_followed:
        monkeypatch.setattr(ReplayRun, "scan", lambda run: False)
    out = tmp_path / "out"
    assert main([*ASKED_ON, "--out", str(out), str(project)]) == (not is_followed)
    monkeypatch.undo()
    told = capsys.readouterr().err.splitlines()
    assert is_followed or ("no keyframe in " in told[0] and "the first is P-0003.pcapng" in told[0])
    assert len(told) == (not is_followed)
    last = entries(out / names(out)[-1])
    gaps = [one for one in last if isinstance(one, LostEntries)]
    assert gaps[0].why == files.IN_MIDDLE_REASON
    assert (main(["replay", str(out / names(out)[-1]), "--check"]) == 0) == is_followed


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--before", "T#1s"], "no --on"),
        (["--ring", "12"], "64KiB or more"),
        (["--ring", "64KiB", "--split", "64KiB"], "two files"),
        (["--on", "TRCV_C_9 STATUS=7008"], "TRCV_C_9"),
        (["--duration", "soon"], "soon"),
    ],
)
def test_options_that_do_not_fit_are_one_line(
    project: Path, tmp_path: Path, words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["record", str(project), "--out", str(tmp_path / "out"), *words]) == 2
    said = capsys.readouterr().err
    assert told in said and len(said.splitlines()) == 1


@pytest.mark.parametrize("command", ["record", "scenario"])
def test_a_disk_that_is_full_in_the_midst_of_a_run_is_one_line(
    project: Path,
    tmp_path: Path,
    command: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    target = tmp_path / "out"
    is_record = command == "record"
    words = [str(project), "--out", str(target), "--kernel", "sim", "--duration", "T#1m"]
    story = [str(CONFIGS / "scenarios" / "stories" / "en-r-dropped.toml"), "--record", str(target)]
    write = RecordingWriter._write

    def full(self: RecordingWriter, data: bytes) -> None:
        if self.size + len(data) > 10_000:
            self._file.close()
            raise mistake("R", "No space left on device", "room for it")
        write(self, data)

    monkeypatch.setattr(RecordingWriter, "_write", full)
    assert main([command, *(words if is_record else story)]) == is_record
    printed = capsys.readouterr()
    assert printed.err == "R: found No space left on device, expected room for it\n"
    assert is_record or printed.out.startswith("passed")  # the run goes on without its recording


@pytest.mark.parametrize(("out", "told"), [("bench.toml", "a file"), ("no/folder", "No such file")])
def test_a_folder_that_cannot_be_made_is_one_line(
    project: Path, tmp_path: Path, out: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "bench.toml").touch()
    assert main(["record", str(project), "--out", str(tmp_path / out)]) == 2
    said = capsys.readouterr().err
    assert told in said and len(said.splitlines()) == 1
    two = ["configs/scenarios/stories/en-r-dropped.toml", "configs/scenarios/stories/auto-reply.toml"]
    assert main(["scenario", *two, "--kernel", "sim", "--record", str(tmp_path / out)]) == 2
    said = capsys.readouterr().err
    assert told in said and len(said.splitlines()) == 1


@pytest.mark.live
@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_record_ends_cleanly_when_all_its_programs_are_told_to(
    project: Path, tmp_path: Path, number: int
) -> None:
    out = tmp_path / "out"
    words = ["record", str(project), "--out", str(out)]
    program = [sys.executable, "-m", "trcvtui", *words]
    with subprocess.Popen(program, env=ENVIRONMENT, start_new_session=True) as run:
        until(lambda: run.poll() is not None or (out.exists() and names(out)))
        until_size(run, out / names(out)[0], 5_000)
        os.killpg(run.pid, number)
        assert run.wait() == 0
    assert main(["replay", str(out / names(out)[0]), "--check"]) == 0
