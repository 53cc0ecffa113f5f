"""A recording is one file: Wireshark opens it, a run runs again on it, a broken one harms nobody."""

from __future__ import annotations

import errno
import os
import random
import shutil
import stat
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import pytest

from tests.capture.test_replay import SCENARIOS, recorded, run
from tests.rig.scenarios import CONFIGS
from trcvtui import __version__
from trcvtui.capture import recording
from trcvtui.capture.journal import SIM_WALL_NS, STEP, Answered, Entry, RunBegins, WireCall
from trcvtui.capture.pcap import open_capture
from trcvtui.capture.recording import Recording, RecordingWriter
from trcvtui.capture.replay import Replay
from trcvtui.errors import UserError
from trcvtui.rig.scenario.runner import VirtualPace

TSHARK = shutil.which("tshark")
NEEDS_TSHARK = pytest.mark.skipif(TSHARK is None, reason="tshark is not installed")
MUTATIONS = 100_000 if os.environ.get("TRCVTUI_SOAK") else 1000


def begins(path: Path) -> RunBegins:
    return RunBegins(__version__, "sim", 1, SIM_WALL_NS, True, str(path), (), "", (), ())


def written(path: Path, target: Path) -> tuple[object, list[Entry]]:
    """Record a scenario into a file; return what it printed, and the entries."""
    seen, entries = recorded(path)
    writer = RecordingWriter(target)
    writer.take([begins(path), *entries])
    writer.close()
    return seen, entries


def kept(entries: list[Entry]) -> list[Entry]:
    return [entry for entry in entries if not isinstance(entry, WireCall)]


def tshark(path: Path, *options: str) -> str:
    assert TSHARK
    ran = subprocess.run([TSHARK, "-r", str(path), *options], capture_output=True, text=True, check=False)
    return ran.stdout


@pytest.fixture(scope="module")
def a_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of a scenario with several jobs."""
    target = tmp_path_factory.mktemp("recording") / "run.pcapng"
    written(LONGEST, target)
    return target


LONGEST = CONFIGS / "scenarios" / "stories" / "en-r-dropped.toml"


def test_a_scenario_runs_again_on_its_file(tmp_path: Path) -> None:
    for number, path in enumerate(SCENARIOS[::8]):
        target = tmp_path / f"{number}.pcapng"
        seen, entries = written(path, target)
        opened = Recording(target)
        again = list(opened.entries())
        assert again == [begins(path), *kept(entries)], path
        replay = Replay(iter(again[1:]), "R")
        assert run(path, "sim", replay, VirtualPace()) == seen
        replay.end()
        assert opened.stopped == ""


def test_two_runs_of_one_seed_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        written(LONGEST, tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@NEEDS_TSHARK
def test_wireshark_finds_no_fault_and_follows_the_stream_to_the_bytes_of_data(a_file: Path) -> None:
    checked = ("-o", "tcp.check_checksum:TRUE", "-o", "ip.check_checksum:TRUE")
    bad = "_ws.malformed || ip.checksum.status == 0 || tcp.checksum.status == 0 || tcp.analysis.flags"
    assert tshark(a_file, *checked, "-Y", bad) == ""
    came = b"".join(
        entry.answer[1]
        for entry in Recording(a_file).entries()
        if isinstance(entry, Answered)
        and entry.call == "recv"
        and entry.owner == "C1"
        and isinstance(entry.answer, tuple)
    )
    assert came
    ports = tshark(
        a_file, "-Y", "tcp.flags.syn == 1 && tcp.flags.ack == 0", "-T", "fields", "-e", "tcp.stream"
    )
    followed = ""
    for number in ports.split():
        text = tshark(a_file, "-q", "-z", f"follow,tcp,raw,{number}")
        lines = [
            line
            for line in text.splitlines()
            if line.strip() and set(line.strip()) <= set("0123456789abcdef")
        ]
        followed += "".join(line for line in lines if not line.startswith("\t"))
    assert followed == came.hex()


@NEEDS_TSHARK
def test_the_packet_that_completes_a_job_says_so(a_file: Path) -> None:
    comments = tshark(a_file, "-T", "fields", "-e", "frame.comment").split("\n")
    found = [line for line in comments if line]
    assert found
    assert all(": 16#" in line and ", job " in line and ", scan " in line for line in found)


def test_bytes_that_a_packet_carries_are_not_written_twice(tmp_path: Path) -> None:
    _, entries = written(LONGEST, tmp_path / "a")
    reads = [entry for entry in entries if isinstance(entry, Answered) and entry.call == "recv"]
    inside = max((each.answer[1] for each in reads if each.owner == "C1"), key=len)  # type: ignore[index]
    assert len(inside) >= 8
    with open_capture(tmp_path / "a") as reader:
        journals = [packet.data for packet in reader if packet.interface == recording.JOURNAL]
    of_peers = sum(each.answer[1] == inside for each in reads if each.owner != "C1")  # type: ignore[index]
    assert sum(journal.count(inside) for journal in journals) <= of_peers


# -- the file ----------------------------------------------------------------------------------------------


def test_a_file_that_is_there_is_refused_and_only_a_recording_is_replaced(tmp_path: Path) -> None:
    ours, other = tmp_path / "ours.pcapng", tmp_path / "other.txt"
    RecordingWriter(ours).close()
    assert stat.S_IMODE(ours.stat().st_mode) == 0o600
    with pytest.raises(UserError, match="which is there already"):
        RecordingWriter(ours)
    RecordingWriter(ours, overwrite=True).close()
    other.write_text("a letter")
    with pytest.raises(UserError, match="no recording of trcvtui"):
        RecordingWriter(other, overwrite=True)
    assert other.read_text() == "a letter"


def test_a_capture_of_others_is_no_recording(tmp_path: Path) -> None:
    from trcvtui.capture import pcap

    path = tmp_path / "c.pcapng"
    path.write_bytes(pcap.section_block("dumpcap") + pcap.interface_block(pcap.ETHERNET, "eth0"))
    with pytest.raises(UserError, match=f"no recording of trcvtui: try trcvtui watch {path}"):
        Recording(path)


def test_a_file_that_ends_anywhere_is_good_up_to_its_last_block(a_file: Path, tmp_path: Path) -> None:
    whole, target = a_file.read_bytes(), tmp_path / "cut"
    all_entries = list(Recording(a_file).entries())
    head = Recording(a_file).index()[0].packets_at
    for size in random.Random(3).sample(range(head, len(whole)), 60):
        target.write_bytes(whole[:size])
        opened = Recording(target)
        entries = list(opened.entries())
        assert entries == all_entries[: len(entries)]
        assert opened.index() == Recording(a_file).index()[: len(opened.index())]
        assert (opened.stopped == "") == (size in block_borders(whole))


def blocks_end(whole: bytes, at: int) -> int:
    return at + int.from_bytes(whole[at + 4 : at + 8], "little")


def block_borders(whole: bytes) -> set[int]:
    at, found = 0, {0}
    while at < len(whole):
        at = blocks_end(whole, at)
        found.add(at)
    return found


def test_an_index_that_is_missing_is_found_again(a_file: Path, tmp_path: Path) -> None:
    rows = Recording(a_file).index()
    assert rows
    assert rows[-1].scans > 0
    whole, target = a_file.read_bytes(), tmp_path / "cut"
    target.write_bytes(whole[: blocks_end(whole, rows[-1].journal_at)])
    assert Recording(target).index() == rows


def test_entries_are_read_from_any_block_on(a_file: Path) -> None:
    opened = Recording(a_file)
    whole = list(opened.entries())
    for number, row in enumerate(opened.index()):
        some = list(opened.entries(number))
        assert some == whole[-len(some) :]
        steps = [entry for entry in whole[: -len(some)] if isinstance(entry, Answered) and entry.call == STEP]
        assert len(steps) == row.scans


def test_a_full_disk_ends_the_recording_with_a_line_and_leaves_a_good_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, entries = recorded(LONGEST)
    path = tmp_path / "full.pcapng"
    writer = RecordingWriter(path)
    file: IO[bytes] = writer._file
    room = 20_000  # bytes: two blocks of the journal

    class Full:
        closed = False

        def write(self, data: memoryview) -> int:
            nonlocal room
            if not room:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            size = min(room, len(data))
            room -= size
            return file.write(data[:size])

        def truncate(self, size: int) -> int:
            return file.truncate(size)

        def close(self) -> None:
            self.closed = True
            file.close()

    monkeypatch.setattr(writer, "_file", Full())
    with pytest.raises(UserError, match=r"No space left on device.*the recording ends after"):
        for at in range(0, len(entries), 50):
            writer.take([begins(LONGEST), *entries[at : at + 50]] if not at else entries[at : at + 50])
            writer.flush()
    writer.close()
    opened = Recording(path)
    assert list(opened.entries())
    assert opened.stopped == ""


def mutated(whole: bytes) -> Iterator[bytes]:
    source = random.Random(7)
    for _ in range(MUTATIONS):
        changed = bytearray(whole)
        for _ in range(source.randint(1, 4)):
            at = source.randrange(len(changed))
            match source.randrange(3):
                case 0:
                    changed[at] = source.choice((0, 1, 127, 128, 255))
                case 1:
                    del changed[at : at + source.randint(1, 16)]
                case _:
                    changed[at:at] = source.randbytes(source.randint(1, 16))
        yield bytes(changed)


def test_a_recording_that_was_changed_anywhere_is_read_or_refused_with_a_line(
    a_file: Path, tmp_path: Path
) -> None:
    target = tmp_path / "changed"
    refused = 0
    for content in mutated(a_file.read_bytes()[:20_000]):
        target.write_bytes(content)
        try:
            opened = Recording(target)
            list(opened.entries())
            opened.index()
        except UserError as told:
            refused += 1
            assert "\n" not in str(told)
    assert refused
