"""R5: a tap against socat: round trips, one stream; and how much a second its recording keeps."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from benchmarks.figures import Effort, Figure, alternate, ratios, spread

TRIPS: Final = 1500  # of one slice
FRAME: Final = bytes(64)
PIECE: Final = bytes(256 << 10)
STREAM: Final = 512  # pieces of one slice
RATES: Final = (40, 60, 80, 100, 120, 150, 200)  # MB/s
RATE_S: Final = 3
LATE_S: Final = 0.5  # for the recording to be whole after the last byte
LOST: Final = b"are not in the recording", b'"note": "lost"'
FAR: Final = """
import socket, sys
door = socket.create_server(("127.0.0.1", 0))
print(door.getsockname()[1], flush=True)
buffer = memoryview(bytearray(1 << 18))
while True:
    sock = door.accept()[0]
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    with sock:
        while size := sock.recv_into(buffer):
            if size == 64:
                sock.sendall(buffer[:size])
"""


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield round trips and the stream against socat, and the rate of a recording."""
    with ExitStack() as opened:
        far = opened.enter_context(_far_end())
        tap = opened.enter_context(_tap(far))
        if shutil.which("socat") is None:
            yield Figure.missing("round trip of 64 bytes / through socat", "needs socat")
        else:
            relay = opened.enter_context(_socat(far))
            trips = [(_trips(tap), _trips(relay)) for _ in range(effort.pairs)]
            for name, at in (("p50", TRIPS // 2), ("p99", TRIPS * 99 // 100)):
                pairs = [(mine[at], theirs[at]) for mine, theirs in trips]
                note = spread([mine * 1e6 for mine, _ in pairs]).text(0, " us")
                yield Figure.of(f"round trip of 64 bytes / through socat, {name}", ratios(pairs), note=note)
            streams = alternate(lambda: _stream(tap), lambda: _stream(relay), effort.pairs)
            note = spread([mine for mine, _ in streams]).text(0, " MB/s")
            yield Figure.of("one stream / socat -b 65536", ratios(streams), note=note)
        kept = [rate for rate in RATES if _is_kept(far, rate)]
        note = f"of {RATES} MB/s for {RATE_S} s"
        most = max(kept, default=0)
        yield Figure("recorded, nothing left out, MB/s", f"{most}", most, note)


@contextmanager
def _far_end() -> Iterator[int]:
    with subprocess.Popen([sys.executable, "-c", FAR], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        yield int(process.stdout.readline())
        process.kill()


@contextmanager
def _tap(far: int, *words: str) -> Iterator[int]:
    command = [sys.executable, "-m", "trcvtui", "tap", "127.0.0.1:0", str(far), *words]
    null = subprocess.DEVNULL
    with subprocess.Popen(command, stdin=null, stderr=subprocess.PIPE) as process:
        assert process.stderr is not None
        said = process.stderr.readline().decode()
        yield int(said.partition(" to ")[0].rpartition(":")[2])
        process.terminate()


@contextmanager
def _socat(far: int) -> Iterator[int]:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port: int = free.getsockname()[1]
    listen = f"TCP-LISTEN:{port},bind=127.0.0.1,fork,nodelay,reuseaddr"
    with subprocess.Popen(["socat", "-b", "65536", listen, f"TCP:127.0.0.1:{far},nodelay"]) as process:
        yield port
        process.terminate()


def _called(port: int) -> socket.socket:
    until = time.monotonic() + 5
    while True:
        with suppress(ConnectionRefusedError):
            sock = socket.create_connection(("127.0.0.1", port))
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return sock
        if time.monotonic() > until:
            raise TimeoutError(f"nobody listens at {port}")
        time.sleep(0.01)


def _trips(port: int) -> list[float]:
    """Return the seconds of round trips, the quickest first."""
    taken = []
    with _called(port) as sock:
        for _ in range(TRIPS):
            began = time.perf_counter()
            sock.sendall(FRAME)
            sock.recv(64)
            taken.append(time.perf_counter() - began)
    return sorted(taken)


def _stream(port: int, rate: float | None = None, pieces: int = STREAM) -> float:
    """Return how many MB a second went through; a `rate` in MB/s paces them."""
    with _called(port) as sock:
        began = time.perf_counter()
        for number in range(pieces):
            if rate is not None:
                time.sleep(max(began + number * len(PIECE) / rate / 1e6 - time.perf_counter(), 0))
            sock.sendall(PIECE)
        sock.shutdown(socket.SHUT_WR)
        sock.recv(1)
        return pieces * len(PIECE) / 1e6 / (time.perf_counter() - began)


def _is_kept(far: int, rate: int) -> bool:
    """Return whether a tap records a stream of so many MB/s as it comes, and all of it."""
    pieces = round(rate * 1e6 * RATE_S / len(PIECE))
    folder = "/dev/shm" if os.path.isdir("/dev/shm") else None  # the disk is not what is measured
    with tempfile.TemporaryDirectory(dir=folder) as place:
        file = Path(place, "line.pcapng")
        with _tap(far, "--record", str(file)) as port:
            reached = _stream(port, rate, pieces)
            time.sleep(LATE_S)
            size = file.stat().st_size
        content = file.read_bytes()
        is_whole = size > pieces * len(PIECE) and not any(each in content for each in LOST)
        return reached > 0.95 * rate and is_whole
