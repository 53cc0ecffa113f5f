"""A recording is one file: Wireshark opens it, a run runs again on it, a broken one harms nobody."""

from __future__ import annotations

import errno
import filecmp
import gzip
import os
import random
import re
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import pytest

from tests.recording.test_replay import recorded
from tests.scenario.scenarios import CONFIGS, SCENARIOS
from trcvtui import __version__
from trcvtui.capture import pcap
from trcvtui.capture.packets import TCP
from trcvtui.cli.main import main
from trcvtui.errors import UserError
from trcvtui.recording import recording
from trcvtui.recording.journal import SIM_WALL_NS, STEP, CallRecord, Entry, RunHeader
from trcvtui.recording.recording import Recording, RecordingWriter

TSHARK = shutil.which("tshark")
NEEDS_TSHARK = pytest.mark.skipif(TSHARK is None, reason="tshark is not installed")
MUTATIONS = 100_000 if os.environ.get("TRCVTUI_SOAK") else 1000


def begins(path: Path) -> RunHeader:
    return RunHeader(__version__, "sim", 1, SIM_WALL_NS, True, str(path), (), "", (), ())


def written(path: Path, target: Path) -> tuple[object, list[Entry]]:
    """Record a scenario into a file; return what it printed, and the entries."""
    seen, entries = recorded(path)
    writer = RecordingWriter(target)
    writer.add_entries([begins(path), *entries])
    writer.close()
    return seen, entries


def tshark(path: Path, *options: str) -> str:
    assert TSHARK
    ran = subprocess.run([TSHARK, "-r", str(path), *options], capture_output=True, text=True, check=False)
    return ran.stdout


@pytest.fixture(scope="module")
def a_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("recording") / "run.pcapng"
    written(LONGEST, target)
    return target


LONGEST = CONFIGS / "scenarios" / "stories" / "en-r-dropped.toml"


@pytest.mark.parametrize("seed", [0] if MUTATIONS == 1000 else range(8))
def test_two_runs_of_one_seed_give_the_same_bytes_whatever_the_hashes_of_the_process(
    seed: int, tmp_path: Path
) -> None:
    some = [*SCENARIOS[seed::8], LONGEST.with_name("four-bytes-short.toml")]  # this one is long: a keyframe
    paths = [str(path) for number, path in enumerate(some) if path not in some[:number]]
    command = [sys.executable, "-m", "trcvtui", "scenario", *paths, "--record"]
    runs = [
        subprocess.Popen(
            [*command, str(tmp_path / name)],
            env=os.environ | {"PYTHONHASHSEED": name},
            stdout=subprocess.DEVNULL,
        )
        for name in ("1", "2")
    ]
    assert [run.wait() for run in runs] == [0, 0]
    same, others, wrong = filecmp.cmpfiles(
        tmp_path / "1", tmp_path / "2", [f"{path.stem}.pcapng" for path in some], shallow=False
    )
    assert not wrong and set(others) <= {"tls-80e6-record-changed.pcapng"}  # a handshake has random keys
    assert (
        len(same) >= len(paths) - 1 and Recording(tmp_path / "1" / "four-bytes-short.pcapng").list_keyframes()
    )


@NEEDS_TSHARK
def test_wireshark_finds_no_fault_and_follows_the_stream_to_the_bytes_of_data(a_file: Path) -> None:
    checked = ("-o", "tcp.check_checksum:TRUE", "-o", "ip.check_checksum:TRUE")
    bad = "_ws.malformed || ip.checksum.status == 0 || tcp.checksum.status == 0 || tcp.analysis.flags"
    assert tshark(a_file, *checked, "-Y", bad) == ""
    came = b"".join(
        entry.answer[1]
        for entry in Recording(a_file).read_entries()
        if isinstance(entry, CallRecord)
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


# -- the file ----------------------------------------------------------------------------------------------


def test_a_capture_of_others_is_no_recording(tmp_path: Path) -> None:
    path = tmp_path / "c.pcapng"
    path.write_bytes(pcap.section_block("dumpcap") + pcap.interface_block(pcap.ETHERNET, "eth0"))
    with pytest.raises(UserError, match=f"found no journal of trcvtui, .* use trcvtui watch {path}"):
        Recording(path)


def test_a_file_that_ends_anywhere_is_good_up_to_its_last_block(a_file: Path, tmp_path: Path) -> None:
    whole, target = a_file.read_bytes(), tmp_path / "cut"
    all_entries = list(Recording(a_file).read_entries())
    head = Recording(a_file).read_index()[0].packets_at
    for size in random.Random(3).sample(range(head, len(whole)), 60):
        target.write_bytes(whole[:size])
        opened = Recording(target)
        entries = list(opened.read_entries())
        assert entries == all_entries[: len(entries)]
        assert opened.read_index() == Recording(a_file).read_index()[: len(opened.read_index())]
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
    rows = Recording(a_file).read_index()
    assert rows
    assert rows[-1].scans > 0
    whole, target = a_file.read_bytes(), tmp_path / "cut"
    target.write_bytes(whole[: blocks_end(whole, rows[-1].journal_at)])
    assert Recording(target).read_index() == rows


def test_entries_are_read_from_any_block_on(a_file: Path) -> None:
    opened = Recording(a_file)
    whole = list(opened.read_entries())
    for number, row in enumerate(opened.read_index()):
        some = list(opened.read_entries(number))
        assert some == whole[-len(some) :]
        steps = [
            entry for entry in whole[: -len(some)] if isinstance(entry, CallRecord) and entry.call == STEP
        ]
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
            writer.add_entries([begins(LONGEST), *entries[at : at + 50]] if not at else entries[at : at + 50])
            writer.flush()
    writer.close()
    opened = Recording(path)
    assert list(opened.read_entries())
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
            list(opened.read_entries())
            opened.read_index()
        except UserError as told:
            refused += 1
            assert "\n" not in str(told)
    assert refused


# -- what was changed is seen ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def recorded_twice(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, bytes]:
    """Return the files of two scenarios that the command has recorded; the second one has a keyframe."""
    folder, found = tmp_path_factory.mktemp("twice"), []
    for name in ("every-split", "four-bytes-short"):
        target = folder / f"{name}.pcapng"
        assert main(["scenario", str(LONGEST.with_name(f"{name}.toml")), "--record", str(target)]) == 0
        found.append(target.read_bytes())
    return found[0], found[1]


def replayed(path: Path, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, str]:
    """Return the exit code of `replay` and the one line that it ends with."""
    capsys.readouterr()
    code = main(["replay", str(path), *options])
    told = capsys.readouterr()
    *_, line = (told.err or told.out).splitlines()
    return code, line


def flipped(whole: bytes, at: int, bit: int) -> bytes:
    changed = bytearray(whole)
    changed[at] ^= 1 << bit
    return bytes(changed)


def carried(whole: bytes) -> list[int]:
    """Return the byte of the file of each byte that a packet of the wire carries after its headers."""
    found, place = list[int](), 0
    while place < len(whole):
        kind, _, interface, _, _, size = struct.unpack_from("<6I", whole, place)
        if (kind, interface) == (pcap.ENHANCED_PACKET, recording.WIRE_ID):
            headers = 40 if whole[place + recording.AT_DATA + 9] == TCP else 28
            found += range(place + recording.AT_DATA + headers, place + recording.AT_DATA + size)
        place = blocks_end(whole, place)
    return found


def test_of_200_flipped_bits_of_payloads_200_are_seen(
    recorded_twice: tuple[bytes, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, path, source = recorded_twice[0], tmp_path / "R.pcapng", random.Random(200)
    path.write_bytes(whole)
    assert replayed(path, capsys, "--check")[0] == 0
    for at in source.choices(carried(whole), k=200):
        path.write_bytes(flipped(whole, at, source.randrange(8)))
        code, line = replayed(path, capsys, "--check")
        assert code in (1, 2) and re.match(rf"{path}: byte \d+: journal: found block \d+ with another", line)


def test_wherever_a_bit_of_journal_keyframe_or_index_is_flipped_the_place_is_told(
    recorded_twice: tuple[bytes, bytes], tmp_path: Path
) -> None:
    whole, path, source = recorded_twice[1], tmp_path / "R.pcapng", random.Random(11)
    for magic in (b"trcvtui journal\n", recording.KEYFRAME_MAGIC, recording.INDEX_MAGIC):
        begin = source.choice([found.start() for found in re.finditer(re.escape(magic), whole)])
        size = int.from_bytes(whole[begin - 9 : begin - 5], "little") - 1
        for at in (begin, begin + len(magic), *source.sample(range(begin, begin + size), 20)):
            path.write_bytes(flipped(whole, at, source.randrange(8)))
            assert re.match(rf"{path}: byte \d+: .*found .*, expected ", Recording(path).find_damage())


def test_what_stands_after_a_recording_and_another_version_are_told_with_their_place(
    recorded_twice: tuple[bytes, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (whole, other), path = recorded_twice, tmp_path / "R.pcapng"
    version = whole.index(b"trcvtui journal\n") + 16
    packet = pcap.packet_block(recording.WIRE_ID, 0, b"a packet")
    for content, code, said in (
        (whole + whole, 1, f"byte {len(whole)}: found a second capture after the first"),
        (whole + other, 1, f"byte {len(whole)}: found a second capture after the first"),
        (whole[:-100] + whole, 1, "found a block with two different lengths"),
        (whole + packet, 1, f"byte {len(whole)}: found another packet, expected the end of the file"),
        (whole + b"garbage at the end", 1, f"byte {len(whole)}: found a block of "),
        (whole + b"\0", 1, f"byte {len(whole)}: found the end of the file, expected the rest of a block"),
        (whole[:version] + b"\7" + whole[version + 1 :], 2, "journal: found version 7, expected version 2"),
    ):
        path.write_bytes(content)
        for form in (["--check"], ["--format", "jsonl"]):
            ended, line = replayed(path, capsys, *form)
            assert ended == code and line.startswith(f"{path}: byte ") and said in line
        assert main(["report", str(path), "--out", str(tmp_path / "X.html")]) == code


def test_a_gz_is_replayed_and_reported_like_what_it_holds(
    recorded_twice: tuple[bytes, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plain, packed = tmp_path / "R.pcapng", tmp_path / "R.pcapng.gz"
    plain.write_bytes(recorded_twice[1])
    whole = gzip.compress(recorded_twice[1])
    packed.write_bytes(whole)
    assert replayed(packed, capsys, "--check") == (0, f"{packed}: 6051 scans, the same again")
    assert [*Recording(packed).read_entries()] == [*Recording(plain).read_entries()]
    assert Recording(packed).read_index() == Recording(plain).read_index()
    assert main(["report", str(packed), "--out", str(tmp_path / "X.html")]) == 0
    for content, said in (
        (whole[:-3000], "found the .gz ends in the middle"),
        (whole + b"garbage", "found other bytes after the .gz"),
        (flipped(whole, len(whole) - 5, 3), "found the .gz is broken"),
    ):
        packed.write_bytes(content)
        assert Recording(packed).read_index()
        code, line = replayed(packed, capsys, "--check")
        assert code == 1 and line.startswith(f"{packed}: byte ") and said in line
