"""R8: `messages --udt` to csv against a loop of struct and csv that reads the pcapng by hand; its memory."""

from __future__ import annotations

import csv
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from benchmarks.captures import PARTNER_END, PLC_END
from benchmarks.figures import Effort, Figure, alternate, ratios
from benchmarks.udt_decode import CHILD
from trcvtui.capture.pcap import ETHERNET, interface_block, packet_block, section_block

MESSAGES: Final = 100_000
TELEGRAM: Final = struct.Struct("<hxxfi")
TYPE: Final = "TYPE Telegram : STRUCT state : INT; weight : REAL; count : DINT; END_STRUCT END_TYPE"
FRAME: Final = 14 + 20 + 20 + TELEGRAM.size
PACKET: Final = 6  # an Enhanced Packet Block


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the processor time of the whole command against the loop's, and its memory."""
    with tempfile.TemporaryDirectory() as folder:
        path, declared = Path(folder, "line.pcapng"), Path(folder, "telegram.st")
        path.write_bytes(_capture(MESSAGES))
        declared.write_text(TYPE)
        program = [sys.executable, "-c", CHILD, sys.executable, "-m", "trcvtui", "messages", str(path)]
        memory: list[float] = []

        def ours() -> float:
            argv = [*program, "--udt", str(declared), "--format", "csv"]
            ran = subprocess.run(argv, capture_output=True, text=True, check=True)
            seconds, mib = map(float, ran.stdout.split())
            memory.append(mib)
            return seconds

        figures = alternate(ours, lambda: _by_hand(path, Path(folder, "hand.csv")), max(3, effort.rounds))
        note = f"{MESSAGES} messages of {TELEGRAM.size} bytes, one a packet; the start of the program counts"
        yield Figure.of("messages --udt to csv / struct and csv by hand", ratios(figures), note=note)
        yield Figure("messages --udt: peak memory", f"{max(memory):.0f} MiB", max(memory))


def _by_hand(path: Path, out: Path) -> float:
    """Return the processor time of a loop that knows this capture: no stream is put together."""
    began, number = time.process_time(), 0
    block_of, head_of, telegram_of = (struct.Struct(form).unpack_from for form in ("<II", "<IIIII", "<hxxfi"))
    content = path.read_bytes()
    with out.open("w", newline="") as file:
        write = csv.writer(file).writerow
        write(("n", "t", "state", "weight", "count"))
        at = 0
        while at < len(content):
            kind, size = block_of(content, at)
            if kind == PACKET:
                _, high, low, _, whole = head_of(content, at + 8)
                if whole == FRAME:
                    number += 1
                    telegram = telegram_of(content, at + 28 + FRAME - TELEGRAM.size)
                    write((number, (high << 32 | low) / 1e9, *telegram))
            at += size
    assert number == MESSAGES
    return time.process_time() - began


def _capture(messages: int) -> bytes:
    """Return a pcapng: a connection is built, each message is a segment, each is acknowledged."""
    there, back = (50_000, 2000, PARTNER_END + PLC_END), (2000, 50_000, PLC_END + PARTNER_END)
    frames = [_frame(there, 0, 0, 2, b""), _frame(back, 0, 1, 18, b""), _frame(there, 1, 1, 16, b"")]
    for number in range(messages):
        seq = 1 + number * TELEGRAM.size
        frames.append(_frame(there, seq, 1, 24, TELEGRAM.pack(number % 100, number % 9973 / 100, number)))
        frames.append(_frame(back, 1, seq + TELEGRAM.size, 16, b""))
    blocks = (packet_block(0, 10**18 + number * 500_000, frame) for number, frame in enumerate(frames))
    return section_block("benchmark") + interface_block(ETHERNET, "wire") + b"".join(blocks)


def _frame(way: tuple[int, int, bytes], seq: int, ack: int, flags: int, data: bytes) -> bytes:
    source, target, addresses = way
    ip = struct.pack(">BBHHHBBH", 0x45, 0, 40 + len(data), 0, 0, 64, 6, 0) + addresses
    return bytes(12) + b"\x08\x00" + ip + struct.pack(
        ">HHIIBBHHH", source, target, seq, ack, 0x50, flags, 8192, 0, 0
    ) + data  # fmt: skip
