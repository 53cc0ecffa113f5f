"""What an instance more costs: M3, a thousand idle ones; 1 to 10,000, idle and busy; a simulated day.

`python -m benchmarks.growth size COUNT` and `... day SCANS` measure in a process of their own and answer as
JSON, so that memory is theirs alone.
"""

from __future__ import annotations

import gc
import json
import resource
import socket
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from benchmarks.figures import FULL, Effort, Figure, against, alternate, ratios, spread
from benchmarks.plc import ManyReceivers
from tests.local_driver import LocalDriver
from trcvtui.engine.controller import fresh_bench
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.project.file import read_project

IDLE: Final = 1000
SCAN_NS: Final = 1_000_000
SLICE_NS: Final = 50_000_000
SIZES: Final = (1, 10, 100, 1000, 4000, 10_000)
MESSAGE: Final = 256
MOST_PARTNERS: Final = 1000  # three descriptors each, beside a listener for every instance
ARRIVE_S: Final = 0.0005
DAY_S: Final = 86_400
PAIRS_OF_A_DAY: Final = 8
HOURS: Final = 24
SCANS_A_PICTURE: Final = 50


def idle(effort: Effort) -> Iterator[Figure]:
    """Yield M3: the share of a 1 ms scan, and the share of what calling all of them costs."""
    if not _descriptors(4 * IDLE):
        yield Figure.missing(f"{IDLE} idle / a 1 ms scan", f"needs ulimit -n {4 * IDLE}")
        return
    with _receivers(IDLE, IDLE) as (plc, _):
        plc.scan(10)
        figures = alternate(lambda: _idle_ns(plc, False), lambda: _idle_ns(plc, True), effort.pairs)
    share = spread([ours / SCAN_NS for ours, _ in figures])
    note = f"{1000 * share.median:.1f} us a scan; trace: tests/properties/test_ready_only.py"
    yield Figure.of(f"{IDLE} idle / a 1 ms scan", share, 4, note=note)
    yield Figure.of(f"{IDLE} idle asleep / called all", ratios(figures), 4)


def _idle_ns(plc: ManyReceivers, call_all: bool) -> float:
    plc.runtime.calls_all = call_all
    before = plc.runtime.scans
    took = plc.scan_for(SLICE_NS)
    return took / (plc.runtime.scans - before)


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield one busy of 1,000 against one of 1, all sizes by themselves, and a day's memory."""
    if _descriptors(4 * IDLE):
        yield from _one_busy(effort)
    yield from _sizes()
    yield _day(effort.scans_a_day)


def _one_busy(effort: Effort) -> Iterator[Figure]:
    with _receivers(1, 1) as alone, _receivers(IDLE, 1) as among:
        after: tuple[list[float], list[float]] = [], []

        def cost(of: Plc, snapshots: list[float]) -> float:
            scans, snapshot = _busy_us(*of, rounds=20)
            snapshots.append(snapshot)
            return scans

        figures = alternate(lambda: cost(among, after[0]), lambda: cost(alone, after[1]), effort.pairs)
    for case, pairs in (("two scans", figures), ("snapshot after them", list(zip(*after, strict=True)))):
        note = f"{against(pairs, 0, ' us')} of processor time"
        yield Figure.of(f"{case}, 1 busy of {IDLE} / 1 busy of 1", ratios(pairs), note=note)


def _sizes() -> Iterator[Figure]:
    builds = {}
    for count in SIZES:
        case = f"{count} instances"
        if not _descriptors(count + 3 * min(count, MOST_PARTNERS) + 100):
            yield Figure.missing(case, "not enough descriptors: ulimit -n")
            continue
        seen = _child("size", count)
        builds[count] = seen["build_ms"] / count
        busy = min(count, MOST_PARTNERS)
        note = (
            f"us of processor time: idle {seen['idle_us']:.1f}, snapshot {seen['idle_snapshot_us']:.0f}; "
            f"1 busy: two scans {seen['one_us']:.0f}, snapshot {seen['one_snapshot_us']:.0f}; {busy} busy, "
            f"each: two scans {seen['all_us'] / busy:.1f}, snapshot {seen['all_snapshot_us'] / busy:.1f}"
        )
        yield Figure(case, f"build {seen['build_ms']:.0f} ms, {seen['mb']:.1f} MB", None, note)
    if len(builds) == len(SIZES):
        share = builds[10_000] / builds[1000]
        yield Figure("build of one instance, of 10,000 / of 1,000", f"{share:.2f}", share, "processor time")


def _day(scans: int) -> Figure:
    seen = _child("day", scans)
    grown = seen["end_mb"] - seen["noon_mb"]
    note = (
        f"{seen['first_mb']:.1f} MB after an hour, {seen['end_mb']:.1f} MB at the end; {scans} scans, "
        f"{PAIRS_OF_A_DAY} TSEND_C to TRCV_C, {seen['lines']:.0f} ledger lines, {seen['cpu_s']:.0f} s"
    )
    whole = grown if scans >= FULL.scans_a_day else None  # with fewer scans it still fills its histories
    return Figure("memory: second half of a simulated day", f"{grown:+.1f} MB", whole, note)


def _child(*words: object) -> dict[str, float]:
    command = [sys.executable, "-m", "benchmarks.growth", *map(str, words)]
    answer: dict[str, float] = json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=True).stdout)
    return answer


# -- many receivers ------------------------------------------------------------------------------------------

Plc = tuple[ManyReceivers, list[socket.socket]]


@contextmanager
def _receivers(count: int, partners: int) -> Iterator[Plc]:
    """Yield so many, all with EN_R, the first of them with a partner; no collector, as in the engine."""
    plc = ManyReceivers(count, MESSAGE)
    dialled = [socket.create_connection(("127.0.0.1", port)) for port in plc.ports()[:partners]]
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        plc.take_partners(partners)
        plc.receive()
        plc.scan(3)
        yield plc, dialled
    finally:
        gc.enable()
        gc.unfreeze()
        for sock in dialled:
            sock.close()
        plc.close()


def _busy_us(plc: ManyReceivers, partners: Sequence[socket.socket], rounds: int) -> tuple[float, float]:
    """Return the us of processor time of two scans, in which all messages are DONE, and of a snapshot."""

    def two_scans() -> float:
        for partner in partners:
            partner.send(bytes(MESSAGE))
        time.sleep(ARRIVE_S)
        return _us(lambda: plc.scan(2))

    scans = [two_scans() for _ in range(rounds)]
    plc.runtime.snapshot()
    snapshots = [_us(plc.runtime.snapshot) for _ in range(rounds) if two_scans()]
    return statistics.median(scans), statistics.median(snapshots)


def _us(act: Callable[[], object]) -> float:
    began = time.thread_time_ns()
    act()
    return (time.thread_time_ns() - began) / 1000


def _descriptors(wanted: int) -> bool:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
    if soft < most:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0] >= wanted


# -- the processes -------------------------------------------------------------------------------------------


def _size(count: int) -> dict[str, float]:
    gc.disable()  # as in the engine's process
    before, began = _mb(), _used_s()
    with _receivers(count, 0) as (plc, _):  # built, and EN_R raised everywhere
        seen = {"build_ms": 1000 * (_used_s() - began), "mb": _mb() - before}
        seen["idle_us"] = statistics.median(_us(plc.scan) for _ in range(60))
        seen["idle_snapshot_us"] = statistics.median(_us(plc.runtime.snapshot) for _ in range(20))
        ports = plc.ports()[:MOST_PARTNERS]
        partners = [socket.create_connection(("127.0.0.1", port)) for port in ports]
        plc.take_partners(len(partners))
        for name, busy in (("one", partners[:1]), ("all", partners)):
            rounds = max(6, min(40, 4000 // len(busy)))
            seen[f"{name}_us"], seen[f"{name}_snapshot_us"] = _busy_us(plc, busy, rounds)
    return seen


def _simulated_day(scans: int) -> dict[str, float]:
    document = _of_a_day(DAY_S * 1000 // scans)
    driver = LocalDriver(fresh_bench(read_project(document, "day", Path()), "sim"))
    seq, marks = 0, []
    for _ in range(HOURS):
        for _ in range(scans // HOURS // SCANS_A_PICTURE):
            driver.scan(SCANS_A_PICTURE)
            driver.request(UpdateRequest(since_seq=seq))
            picture = driver.poll_picture()
            assert picture is not None
            seq = picture.lines[-1].seq if picture.lines else seq
        marks.append(_mb())
    memory = {"first_mb": marks[0], "noon_mb": marks[HOURS // 2 - 1], "end_mb": marks[-1]}
    return {**memory, "lines": seq, "cpu_s": time.process_time()}


def _of_a_day(interval_ms: int) -> dict[str, object]:
    numbers = range(PAIRS_OF_A_DAY)
    ends = {"LocalAddress": "127.0.0.1", "RemoteAddress": "127.0.0.1"}
    return {
        "dialect": "baosky",
        "start": "\n".join(f"set S{n} REQ=blink" for n in numbers),
        "task": [{"name": "MAIN", "interval": f"T#{interval_ms}ms"}],
        "data": [{"name": f"{of}{n}", "type": "ARRAY[1..64] OF BYTE"} for of in "rt" for n in numbers],
        "connect": [
            *({"name": f"P{n}", "LocalAddress": "127.0.0.1", "LocalPort": 2000 + n} for n in numbers),
            *({"name": f"A{n}", "ActiveEstablished": True, "RemotePort": 2000 + n, **ends} for n in numbers),
        ],
        "instance": [
            *({"name": f"R{n}", "block": "TRCV_C", "connect": f"P{n}", "data": f"r{n}", "CONT": True,
               "EN_R": True} for n in numbers),
            *({"name": f"S{n}", "block": "TSEND_C", "connect": f"A{n}", "data": f"t{n}", "CONT": True}
              for n in numbers),
        ],
    }  # fmt: skip


def _used_s() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


def _mb() -> float:
    """Return how much memory this process has now (Linux)."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / (1 << 20)


if __name__ == "__main__":
    act, number = sys.argv[1], int(sys.argv[2])
    print(json.dumps(_size(number) if act == "size" else _simulated_day(number)))
