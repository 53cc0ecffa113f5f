"""Files that were changed, cut or made large: read, or refused with lines; no traceback, bounded memory.

TRCVTUI_SOAK takes 20,000 changed files and the floods; the suite a few of the files.
"""

from __future__ import annotations

import os
import random
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.cli.test_cli import ENVIRONMENT
from tests.line.test_watch import project, stream
from tests.recording.wire import ACK, PLC, SYN, capture, handshake, tcp
from tests.scenario.scenarios import CONFIGS
from trcvtui.cli.main import main

IS_SOAK = "TRCVTUI_SOAK" in os.environ
FILES = 20_000 if IS_SOAK else 300
MOST_KIB = 256 << 10
STORIES = (
    "baosky/80c5-fin-mid-send",
    "siemens/iso-passive",
    "siemens/udp-connect-c-blocks",
    "stories/auto-reply",
)
COMMANDS = (
    ("replay", "FILE", "--check"),
    ("replay", "FILE", "--format", "jsonl"),
    ("replay", "FILE", "--set", "instance.TRCV_C_1.LEN=5"),
    ("replay", "FILE", "--dialect", "s7-1500", "--format", "jsonl"),
    ("report", "FILE", "--out", "OUT"),
    ("recording", "strip", "FILE", "OUT", "--no-payload"),
    ("watch", "FILE", "--format", "jsonl"),
    ("conversations", "FILE"),
    ("doctor", "FILE", "--format", "json"),
)

pytestmark = pytest.mark.timeout(7200 if IS_SOAK else 120)


def changed(whole: bytes, chance: random.Random) -> bytes:
    """Return a file with some bytes changed, and perhaps some left out, put in, or cut off."""
    data = bytearray(whole)
    if chance.random() < 0.1:
        return bytes(data[: chance.randrange(len(data))])
    for _ in range(chance.randint(1, 5)):
        at = chance.randrange(len(data))
        match chance.randrange(6):
            case 0:
                del data[at : at + chance.randint(1, 16)]
            case 1:
                data[at:at] = chance.randbytes(chance.randint(1, 16))
            case 2:
                data[at : at + 4] = chance.choice((b"\xff" * 4, b"\0" * 4, struct.pack("<I", 1 << 31)))
            case _:
                data[at] = chance.choice((0, 1, 2, 7, 9, 48, 127, 128, 255, chance.randrange(256)))
    return bytes(data)


def test_each_command_reads_a_changed_file_or_says_what_is_wrong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chance = random.Random(11)
    sources = []
    for number, name in enumerate(STORIES):
        file = tmp_path / f"{number}.pcapng"
        assert main(["scenario", str(CONFIGS / "scenarios" / f"{name}.toml"), "--record", str(file)]) == 0
        sources.append(file.read_bytes())
    file, out = tmp_path / "changed.pcapng", tmp_path / "out"
    codes = set[int]()
    for number in range(FILES):
        file.write_bytes(changed(chance.choice(sources), chance))
        out.unlink(missing_ok=True)
        places = {"FILE": str(file), "OUT": str(out)}
        capsys.readouterr()
        code = main([places.get(word, word) for word in COMMANDS[number % len(COMMANDS)]])
        said = capsys.readouterr().err
        codes.add(code)
        assert code in (0, 1, 2) and (code != 2 or said), number
        assert "Traceback" not in said and said.replace("\n", "").isprintable(), number
    assert codes == {0, 1, 2}


def test_the_doctor_counts_no_frames_in_a_hole_of_gigabytes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, bench = tmp_path / "hole.pcapng", project(tmp_path)
    sizes = (12, 7, 5, 12, 3, 9, 12)
    late = [
        tcp(b"x" * size, seq=101 + sum(sizes[:n]) + 1_900_000_000, ack=501) for n, size in enumerate(sizes)
    ]
    file.write_bytes(capture([*handshake(), *stream(*sizes), *late]))
    assert main(["doctor", str(file), "--project", str(bench)]) == 1
    assert "loss" in capsys.readouterr().out


def calls() -> Iterator[bytes]:
    for port in range(1024, 30_000):
        partner = ("10.0.0.9", port)
        yield tcp(seq=100, flags=SYN, source=partner)
        yield tcp(seq=500, ack=101, flags=SYN | ACK, source=PLC, target=partner)
        yield tcp(b"x" * 12, seq=101, ack=501, source=partner)


def scans() -> Iterator[bytes]:
    for number in range(200_000):
        yield tcp(
            seq=number, flags=SYN, source=(f"10.1.{number >> 8 & 255}.{number & 255}", 1024 + number // 9)
        )


def middles() -> Iterator[bytes]:
    for number in range(60_000):
        source = (f"10.1.{number >> 8 & 255}.{number & 255}", 1024 + number % 60_000)
        yield tcp(b"x" * 12, seq=number, ack=1, source=source)


@pytest.mark.skipif(not IS_SOAK, reason="takes minutes: make soak")
@pytest.mark.skipif(sys.platform != "linux", reason="peak memory in KiB")
@pytest.mark.parametrize("flood", [calls, scans, middles], ids=lambda flood: flood.__name__)
@pytest.mark.parametrize("command", COMMANDS[4:9:2] + COMMANDS[7:8], ids=lambda words: words[0])
def test_a_flood_of_conversations_stays_in_256_mib(
    command: tuple[str, ...], flood: Callable[[], Iterator[bytes]], tmp_path: Path
) -> None:
    file = tmp_path / "flood.pcapng"
    file.write_bytes(capture([*flood()], step_ns=100_000))
    words = [{"FILE": str(file), "OUT": str(tmp_path / "out")}.get(word, word) for word in command]
    program = "import resource, sys; from trcvtui.cli.main import main; main(sys.argv[1:]); "
    program += "sys.stderr.write(f'\\npeak {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss}')"
    ran = subprocess.run(
        [sys.executable, "-c", program, *words], env=ENVIRONMENT, capture_output=True, text=True, check=False
    )
    assert int(ran.stderr.rpartition("peak ")[2]) < MOST_KIB
