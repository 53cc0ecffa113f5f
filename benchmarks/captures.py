"""R4: a capture read and put together, against dpkt's bare reader; its memory. R7: the doctor on 1 GiB."""

from __future__ import annotations

import importlib
import importlib.util
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import Effort, Figure, alternate, ratios, spread
from benchmarks.udt_decode import CHILD
from trcvtui.capture.pcap import ETHERNET, interface_block, open_capture, packet_block, section_block
from trcvtui.capture.reassembly import Conversations

PACKETS: Final = 20_000
PAYLOAD: Final = 546  # 600 bytes with the heads
STREAMS: Final = 8
GIB: Final = 1 << 30
PARTS: Final = 8
TALKS: Final = 64
# The doctor's exit code is 1 where it finds anything; 2 is a mistake.
JUDGED: Final = CHILD.replace("check=True)", "check=False).returncode < 2 or sys.exit(1)")
PLC_END: Final = bytes([10, 0, 0, 5])
PARTNER_END: Final = bytes([10, 0, 0, 9])


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the speed against dpkt in both formats, and what 1 GiB takes of memory."""
    with tempfile.TemporaryDirectory() as folder:
        for name, write in (("pcapng", _pcapng), ("pcap", _pcap)):
            path = Path(folder, name)
            with path.open("wb") as file:
                file.write(write(0, True))
            yield _against_dpkt(name, path, effort.pairs)
        yield _memory(Path(folder, "large"))


def _against_dpkt(name: str, path: Path, pairs: int) -> Figure:
    case = f"{name}: reading and reassembly / dpkt's bare reader"
    if importlib.util.find_spec("dpkt") is None:
        return Figure.missing(case, "needs the package dpkt")
    reader: Any = importlib.import_module(f"dpkt.{name}").Reader

    def theirs() -> None:
        with path.open("rb") as file:
            assert sum(1 for _ in reader(file)) == PACKETS

    figures = alternate(lambda: 1 / _cost(lambda: _ours(path)), lambda: 1 / _cost(theirs), pairs)
    size = path.stat().st_size / 1e6
    note = f"{spread([size * mine for mine, _ in figures]).text(0, ' MB/s')}; packets of 600 bytes"
    return Figure.of(case, ratios(figures), note=note)


def _ours(path: Path) -> None:
    found = Conversations()
    with open_capture(path) as reader:
        found.add_packets(reader, reader.link_types)
    found.close()
    assert sum(one.there.byte_count for one in found.all) == PACKETS * PAYLOAD


def _cost(act: Callable[[], None]) -> float:
    """Return the processor time of one call."""
    began = time.process_time()
    act()
    return time.process_time() - began


def measure_doctor(effort: Effort) -> Iterator[Figure]:
    """Yield what 1 GiB of captures in eight files takes, of time and of memory, with two processes."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder, f"part{n}") for n in range(PARTS)]
        size = sum([_large(path, GIB // PARTS, _both_ways) for path in paths])
        words = ["doctor", *map(str, paths), "--jobs", "2", "--format", "jsonl"]
        program = [sys.executable, "-c", JUDGED, sys.executable, "-m", "trcvtui", *words]
        began = time.monotonic()
        ran = subprocess.run(program, capture_output=True, text=True, check=True)
        wall = time.monotonic() - began
        mib = float(ran.stdout.split()[-1])
        note = f"{size / wall / 1e6:.0f} MB/s; packets of 600 bytes, {TALKS} conversations a file, both ways"
        yield Figure("1 GiB of captures, --jobs 2", f"{wall:.0f} s", wall, note=note)
        yield Figure("peak memory of a process", f"{mib:.0f} MiB", mib)


Packets = Iterator[tuple[int, bytes]]


def _large(path: Path, least: int, packets_of: Callable[[int], Packets] | None = None) -> int:
    """Write a capture of so many bytes; return its size."""
    with path.open("wb") as file:
        size = file.write(_pcapng(0, True, packets_of))
        part = 1
        while size < least:
            size += file.write(_pcapng(part, False, packets_of))
            part += 1
    return size


def _both_ways(part: int) -> Packets:
    """Yield conversations with their handshakes: question and answer of 546 bytes each, in turn."""
    if not part:
        for talk in range(TALKS):
            for step, (way, flags) in enumerate(((0, 2), (1, 18), (0, 16))):
                yield (
                    talk * 1000 + step * 300,
                    _segment(talk, way, 1 if step == 2 else 0, step > 0, flags, b""),
                )
    for n in range(PACKETS):
        turn, way = divmod(part * PACKETS + n, 2)
        talk, message = turn % TALKS, turn // TALKS
        data = struct.pack(">HI", 0xAA55, message) * (PAYLOAD // 6)
        at = 1_000_000 + (part * PACKETS + n) * 50_000
        yield at, _segment(talk, way, 1 + message * len(data), 1 + (message + way) * len(data), 24, data)


def _segment(talk: int, way: int, seq: int, ack: int, flags: int, data: bytes) -> bytes:
    ends = ((PARTNER_END, 50_000 + talk), (PLC_END, 2000))
    (source, port), (target, to) = ends if way == 0 else ends[::-1]
    ip = struct.pack(">BBHHHBBH", 0x45, 0, 40 + len(data), 0, 0, 64, 6, 0) + source + target
    numbers = seq & 0xFFFFFFFF, ack & 0xFFFFFFFF
    return (
        bytes(12)
        + b"\x08\x00"
        + ip
        + struct.pack(">HHIIBBHHH", port, to, *numbers, 0x50, flags, 8192, 0, 0)
        + data
    )


def _memory(path: Path) -> Figure:
    size = _large(path, GIB)
    program = [sys.executable, "-c", CHILD, sys.executable, "-m", "trcvtui", "conversations", str(path)]
    ran = subprocess.run(program, capture_output=True, text=True, check=True)
    seconds, mib = map(float, ran.stdout.split())
    note = f"{STREAMS} streams; {size / seconds / 1e6:.0f} MB/s"
    return Figure("a capture of 1 GiB: peak memory", f"{mib:.0f} MiB", mib, note=note)


def _packets(part: int) -> Iterator[tuple[int, bytes]]:
    """Yield time and frame of so many segments in turn of all streams, one part after the other."""
    for n in range(PACKETS):
        seq = (1 + (part * PACKETS + n) // STREAMS * PAYLOAD) & 0xFFFFFFFF
        ip = struct.pack(">BBHHHBBH", 0x45, 0, 40 + PAYLOAD, 0, 0, 64, 6, 0) + PARTNER_END + PLC_END
        tcp = struct.pack(">HHIIBBHHH", 50_000 + n % STREAMS, 2000, seq, 1, 0x50, 16, 8192, 0, 0)
        frame = bytes(12) + b"\x08\x00" + ip + tcp + bytes([n & 255]) * PAYLOAD
        yield (part * PACKETS + n) * 50_000, frame


def _pcapng(part: int, is_first: bool, packets_of: Callable[[int], Packets] | None = None) -> bytes:
    head = section_block("benchmark") + interface_block(ETHERNET, "wire") if is_first else b""
    return head + b"".join(packet_block(0, ns, frame) for ns, frame in (packets_of or _packets)(part))


def _pcap(part: int, is_first: bool) -> bytes:
    head = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, ETHERNET) if is_first else b""
    records = (
        struct.pack("<IIII", ns // 10**9, ns % 10**9 // 1000, len(frame), len(frame)) + frame
        for ns, frame in _packets(part)
    )
    return head + b"".join(records)
