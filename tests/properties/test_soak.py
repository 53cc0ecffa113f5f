"""Millions of scans: `make soak`. Nothing leaks: no descriptor, no memory, no resource of the PLC."""

from __future__ import annotations

import gc
import os
import random
import tracemalloc
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis.stateful import run_state_machine_as_test

from tests.properties.drawn_projects import DATA
from tests.properties.shared_machine import LENGTHS, TYPES, SharedMachine
from trcvtui.bench.bench import Bench
from trcvtui.engine.controller import Controller, fresh_bench
from trcvtui.engine.timing import ScanTiming
from trcvtui.net.kernel import KERNEL_CALLS
from trcvtui.picture.bench_update import UpdateRequest
from trcvtui.project.file import read_project

LEAST_SCANS = int(os.environ.get("TRCVTUI_SOAK_SCANS", "1000000"))
EXAMPLES = 150  # of one round; Hypothesis forgets them after it
MOST_GROWTH = 48 << 20  # bytes of the process, from the first round to the last
LIFE = 100_000  # scans of the one long life
MOST_GAIN = 256 << 10  # bytes that lines of trcvtui may hold more than in the middle of it
TRAFFIC_SCANS = int(os.environ.get("TRCVTUI_SOAK_TRAFFIC", "10000000"))  # of self-checking traffic
LOOKS = 50  # at the memory meanwhile
FILLED = 700_000  # scans; every history is full then (256 pairs of ends) and forgets the oldest
MOST_DRIFT = 6 << 20  # bytes of the process, from then to the end

KINDS = ("TRCV_C", "TSEND_C", "TCON", "TRCV", "TSEND", "T_RESET")
PEER_MOVES = ("close", "rst", "shutdown", "open", "open", "stall", "resume")
VALUES = ("0", "1", "1", "pulse", "blink")

pytestmark = [
    pytest.mark.skipif("TRCVTUI_SOAK" not in os.environ, reason="takes minutes: make soak"),
    pytest.mark.timeout(7200),
]


def descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


def resident() -> int:
    """Return how many bytes of memory the process has."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def test_a_million_scans_of_many_benches_leak_nothing() -> None:
    SharedMachine.scans, rounds, sizes = 0, 0, []
    before = descriptors()
    round_of = settings(
        max_examples=EXAMPLES,
        stateful_step_count=50,
        deadline=None,
        database=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    while SharedMachine.scans < LEAST_SCANS:
        rounds += 1
        run_state_machine_as_test(seed(rounds)(type("Soak", (SharedMachine,), {})), settings=round_of)
        sizes.append(resident())
        print(f"round {rounds}: {SharedMachine.scans} scans, {sizes[-1] >> 20} MiB, {descriptors()} fds")
    assert descriptors() == before
    assert max(sizes) - sizes[0] < MOST_GROWTH


def test_one_bench_lives_long_and_holds_no_more_than_before() -> None:
    dice, life = random.Random(1), SharedMachine()
    life.begin(project())
    tracemalloc.start()
    held = []
    for until in (LIFE // 2, LIFE):
        while life.bench.runtime.scans < until:
            live_on(life, dice)
        held.append(held_by_the_program())
        print(f"{life.bench.runtime.scans} scans: {held[-1] >> 10} KiB held")
    tracemalloc.stop()
    life.teardown()
    assert held[1] - held[0] < MOST_GAIN


def project() -> dict[str, object]:
    connects: list[dict[str, object]] = [
        {"name": "C1", "LocalAddress": "127.0.0.1"},
        {
            "name": "C2",
            "LocalAddress": "127.0.0.1",
            "ActiveEstablished": True,
            "RemoteAddress": "127.0.0.1",
            "RemotePort": "@P2",
        },
    ]
    return {
        "dialect": "baosky",
        "options": {"retry": "T#50ms", "attempt_limit": "T#200ms", "small_buffers": True},
        "task": [{"name": "T1"}, {"name": "T2", "interval": "T#30ms", "priority": 2}],
        "data": [{"name": name, "type": f"ARRAY[1..{size}] OF BYTE"} for name, size in DATA.items()],
        "connect": connects,
        "instance": [
            {"name": f"I{n}", "block": block, "connect": f"C{n % 2 + 1}", "task": f"T{n % 3 // 2 + 1}"}
            | ({"data": f"D{n % 4 + 1}"} if "RCV" in block or "SEND" in block else {})
            for n, block in enumerate(KINDS, 1)
        ],
        "peer": [
            {"name": "P1", "active": True, "remote": "@C1"},
            {"name": "P2", "active": False},
        ],
    }


def live_on(life: SharedMachine, dice: random.Random) -> None:
    """Make one move that dice choose, and let some scans pass."""
    pick, name, choose = dice.randrange(24), dice.choice(tuple(DATA)), dice.choice
    moves = {
        "bring up": lambda: life.bring_up(dice.choice(("", *KERNEL_CALLS))),
        "turn": lambda: life.turn(pick, dice.randrange(24), choose(VALUES)),
        "length": lambda: life.set_length(pick, dice.random() < 0.5, dice.choice(LENGTHS)),
        "write": lambda: life.write(name, 0, b"\x01\x02\x03"),
        "resize": lambda: life.resize(name, dice.choice(TYPES[:8])),
        "create": lambda: life.create(
            dice.randint(1, 8),
            choose(KINDS),
            pick,
            0,
            name,
            True,
        ),
        "delete": lambda: life.delete(pick),
        "download": lambda: life.download(pick),
        "peer": lambda: life.move_peer(pick, choose(PEER_MOVES)),
        "ask": lambda: life.ask(pick, [1, 0, 2, 0]),
        "talk": lambda: life.talk(pick, [5, 40, 8]),
        "leave": lambda: life.end_in_mid_frame(pick, 10, choose(PEER_MOVES[:3])),
        "stop": lambda: life.stop_for_a_while(3),
        "wire": lambda: life.link(pick, dice.random() < 0.8, 2),
        "fault": lambda: life.fault(dice.choice(KERNEL_CALLS), "", pick, 1),
    }
    dice.choice(tuple(moves.values()))()
    life.run(dice.randint(1, 12))


def held_by_the_program() -> int:
    """Return how many bytes lines of trcvtui have asked for and still hold."""
    gc.collect()
    ours = tracemalloc.Filter(True, "*/trcvtui/*")
    taken = tracemalloc.take_snapshot().filter_traces([ours])
    return sum(line.size for line in taken.statistics("filename"))


# -- self-checking traffic ---------------------------------------------------------------------------------

NAMES = ("plain", "iso")
FRAME = 64
COMES_AGAIN = 5_000  # scans that a partner stays


def pairs() -> dict[str, object]:
    """Return passive CONNECTs, each with a TRCV_C and a TSEND_C on one DATA, and a peer for each."""
    iso = {"type": "TCON_IP_RFC", "IsoPort": 0}
    return {
        "dialect": "s7-1500",
        "data": [{"name": f"D{name}", "type": f"ARRAY[1..{FRAME}] OF BYTE"} for name in NAMES],
        "connect": [
            {"name": name} | (iso | {"LocalTSelector": f"text:{name}"} if name == "iso" else {"LocalPort": 0})
            for name in NAMES
        ],
        "instance": [
            {"name": f"{way}{name}", "block": block, "connect": name, "data": f"D{name}", "CONT": True}
            for name in NAMES
            for way, block in (("R", "TRCV_C"), ("S", "TSEND_C"))
        ],
        "peer": [
            {"name": f"P{name}", "active": True, "remote": f"@{name}"}
            | ({"iso": True, "local_tsap": "16#E001", "remote_tsap": f"text:{name}"} if name == "iso" else {})
            for name in NAMES
        ],
        "start": "\n".join(f"set R{name} EN_R=1\nset Splain REQ=blink" for name in NAMES),
    }


def test_self_checking_traffic_keeps_the_memory_flat() -> None:
    """The console of the engine scans, keeps its histories, and draws a picture now and then."""
    console = Controller(fresh_bench(read_project(pairs(), "traffic", Path()), "sim"))
    peers, timing, seq = list(console.bench.peers), ScanTiming("soak"), 0
    sizes: dict[int, int] = {}
    frames = 0
    say = iter(range(1, 1 << 60))
    while (scan := console.bench.runtime.scans) < TRAFFIC_SCANS:
        for turn, name in enumerate(peers):
            if scan % COMES_AGAIN == 100 * turn:
                frames += judged(console.bench, name)
                console.handle_line(next(say), f"peer {name} check off")
            if scan % COMES_AGAIN == 100 * turn + 15:  # what is on its way has come
                console.handle_line(next(say), f"peer {name} close")
            if scan % COMES_AGAIN == 100 * turn + 20:
                console.handle_line(next(say), f"peer {name} connect")
            if scan % COMES_AGAIN == 100 * turn + 40:
                console.handle_line(
                    next(say), f"peer {name} check on size={FRAME} every=T#40ms on R{name[1:]}"
                )
        assert console.scan()
        timing.count_scan(scan, scan, scan + 1, 10_000_000)
        if scan % 500 == 0:
            seen = console.picture(UpdateRequest(seq), timing.summary(scan), 2000)
            seq = seen.snapshot.ledger_seq
        if scan and scan % (TRAFFIC_SCANS // LOOKS) == 0:
            sizes[scan] = resident()
            print(f"{scan} scans, {frames} frames: {sizes[scan] / (1 << 20):.1f} MiB", flush=True)
    after = [size for scan, size in sizes.items() if scan >= FILLED]
    assert frames > TRAFFIC_SCANS * len(NAMES) // 5
    assert max(after) - after[0] < MOST_DRIFT
    console.bench.close()
    assert console.bench.leaks() == ()


def judged(bench: Bench, peer: str) -> int:
    """Return how many frames of this partner have reached DATA, each of them good."""
    (seen,) = [one for one in bench.peer_snapshots() if one.name == peer]
    if seen.check is None:
        return 0
    data = seen.check.data
    assert data is not None
    assert (data.lost, data.doubled, data.shifts, data.strange) == (0, 0, 0, 0)
    return data.frames
