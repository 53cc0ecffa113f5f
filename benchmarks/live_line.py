"""R6: packets of a pipe as they come: what 20,000 a second cost, that none is lost, how soon one is shown.

`python live_line.py` is the sender: it paces packets that it has made before, so its time is none of ours.
"""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Final

from benchmarks.figures import Effort, Figure, spread
from trcvtui.capture.pcap import ETHERNET, interface_block, packet_block, section_block

TALKS: Final = 200
RATE: Final = 25  # messages a second, each way, each with its ACK
SECONDS: Final = 8
SIZE: Final = 64
SHOWN: Final = 40  # single packets
PACE_S: Final = 0.005
LEAD_S: Final = 0.3  # between the handshakes and the first message
SYN, ACK, PUSH = 2, 16, 24
_IP: Final = struct.Struct(">BBHHHBBH4s4s").pack
_TCP: Final = struct.Struct(">HHIIBBHHH").pack
_MACS: Final = bytes.fromhex("0200000000020200000000010800")


class Line:
    """The packets of conversations, in the order of their times; `ns` counts from now."""

    def __init__(self, talks: int) -> None:
        self._next = [[100, 500] for _ in range(talks)]
        self.packets: list[tuple[int, bytes]] = []
        for talk in range(talks):
            for step, (way, flags) in enumerate(((0, SYN), (1, SYN | ACK), (0, ACK))):
                self.add(talk * 3000 + step * 900, talk, way, flags)

    def add(self, ns: int, talk: int, way: int, flags: int, data: bytes = b"") -> None:
        """Add a segment to the PLC (way 0), or from it."""
        ends = ((bytes((10, 2, 0, talk)), 40_000 + talk), (bytes((10, 1, 0, talk)), 2000))
        (source, port), (target, to) = ends if way == 0 else ends[::-1]
        own = self._next[talk]
        seq, ack = own[way], own[1 - way] if flags & ACK else 0
        own[way] += len(data) + (1 if flags & SYN else 0)
        head = _IP(0x45, 0, 40 + len(data), 0, 0x4000, 64, 6, 0, source, target)
        self.packets.append((ns, _MACS + head + _TCP(port, to, seq, ack, 80, flags, 64_000, 0, 0) + data))

    def message(self, ns: int, talk: int) -> None:
        """Add a message to the PLC, one from it, and both ACKs."""
        data = bytes(range(SIZE))
        self.add(ns, talk, 0, PUSH, data)
        self.add(ns + 40_000, talk, 1, ACK)
        self.add(ns + 900_000, talk, 1, PUSH, data)
        self.add(ns + 940_000, talk, 0, ACK)


def full_line(talks: int, seconds: float) -> list[tuple[int, bytes]]:
    """Return the packets of R6."""
    line = Line(talks)
    for number in range(round(RATE * seconds)):
        for talk in range(talks):
            line.message(int((LEAD_S + (number + talk / talks) / RATE) * 1e9), talk)
    return sorted(line.packets)


def begin_of(packets: list[tuple[int, bytes]]) -> bytes:
    """Return what a capture program writes before packets."""
    return section_block("benchmark") + interface_block(ETHERNET, "eth0")


def send(packets: list[tuple[int, bytes]]) -> None:
    """Write packets to stdout when their time has come."""
    start = time.time_ns()
    blocks = [(ns, packet_block(0, start + ns, data)) for ns, data in packets]
    start, at = time.perf_counter_ns(), 0
    os.write(1, begin_of(packets))
    while at < len(blocks):
        now = time.perf_counter_ns() - start
        first = at
        while at < len(blocks) and blocks[at][0] <= now:
            at += 1
        left = memoryview(b"".join([block for _, block in blocks[first:at]]))
        while left:
            left = left[os.write(1, left) :]
        time.sleep(PACE_S)


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield what reading and shadows cost, what was lost, and how late a packet is shown."""
    shares, lost = [], 0
    for _ in range(effort.pairs):
        share, done = _watched()
        shares.append(share)
        lost += 2 * TALKS * RATE * SECONDS - done
    note = f"{TALKS} conversations, {TALKS * RATE * 4} packets a second, lines of JSON written"
    yield Figure.of("reading and shadows, of one core", spread(shares), note=note)
    yield Figure("messages lost", f"{lost}", lost, f"of {effort.pairs * 2 * TALKS * RATE * SECONDS}")
    late = sorted(_shown())
    text = f"{late[len(late) // 2]:.0f} ms in the middle, {late[-1]:.0f} ms at most"
    yield Figure("a packet is shown after, ms: the longest", text, late[-1], "since it was in the pipe")


def _watched() -> tuple[float, int]:
    """Return the processor time of `watch -` as a share of the line's time, and how many DONEs it showed."""
    watch = [sys.executable, "-m", "trcvtui", "watch", "-", "--format", "jsonl"]
    read, write = os.pipe()
    sender = subprocess.Popen([sys.executable, "-m", "benchmarks.live_line"], stdout=write)
    os.close(write)
    process = subprocess.Popen(watch, stdin=read, stdout=subprocess.PIPE)
    os.close(read)
    assert process.stdout is not None
    done = sum(chunk.count(b'"DONE":true') for chunk in iter(process.stdout.readline, b""))
    _, _, used = os.wait4(process.pid, 0)
    process.returncode = 0
    sender.wait()
    return (used.ru_utime + used.ru_stime) / (SECONDS + LEAD_S), done


def _shown() -> Iterator[float]:
    """Yield for single packets how many ms after they were written their DONE was read."""
    watch = [sys.executable, "-m", "trcvtui", "watch", "-", "--format", "jsonl"]
    with subprocess.Popen(watch, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        line = Line(1)
        os.write(process.stdin.fileno(), begin_of([]))
        for number in range(SHOWN):
            line.message(0, 0) if number else None
            packets, line.packets = line.packets, []
            time.sleep(0.15)
            now, written = time.time_ns(), time.perf_counter()
            blocks = [packet_block(0, now + ns - packets[-1][0], data) for ns, data in packets]
            os.write(process.stdin.fileno(), b"".join(blocks))
            shadows = {"C1_TO_PLC", "C1_FROM_PLC"} if number else set()
            while shadows:  # of both directions
                record = json.loads(process.stdout.readline())
                shadows -= {record["instance"]} if record["DONE"] else set()
            if number > 1:
                yield (time.perf_counter() - written) * 1e3
        process.stdin.close()
        process.stdout.read()


if __name__ == "__main__":
    send(full_line(TALKS, SECONDS))
