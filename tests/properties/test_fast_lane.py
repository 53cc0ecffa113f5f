"""The fast lane is no visible matter: a PLC without lanes writes the same history, scan by scan."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Final

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

from trcvtui import LANE
from trcvtui.bench.bench import Bench
from trcvtui.commands.table import parse_line
from trcvtui.plc.fast_lane import Answer, Lane
from trcvtui.project.file import read_project

SIZES: Final = {"A": 8, "B": 5, "C": 24}
NAMES: Final = tuple(SIZES)
PEER_OF: Final = {"A": "P1", "B": "P2", "C": "P3"}
CALLS: Final = ("recv", "buffer", "accept", "poll_del", "close")
EXAMPLES: Final = 80


def document(dialect: str, sim: dict[str, object], options: dict[str, object]) -> dict[str, object]:
    """Return three receivers, each alone on its CONNECT; one more block sends on a fourth."""
    home = {"LocalAddress": "127.0.0.1", "LocalPort": 0}
    return {
        "dialect": dialect,
        "options": {"retry": "T#50ms", **options},
        "sim": sim,
        "task": [{"name": "FAST"}, {"name": "SLOW", "interval": "T#30ms"}],
        "data": [{"name": f"rx{n}", "type": f"ARRAY[1..{size}] OF BYTE"} for n, size in SIZES.items()],
        "connect": [
            {"name": "C1", **home},
            {"name": "C2", **home},
            {"name": "C3", "ActiveEstablished": True, "LocalAddress": "127.0.0.1",
             "RemoteAddress": "127.0.0.1", "RemotePort": "@P3"},
        ],
        "instance": [
            {"name": name, "block": "TRCV_C", "connect": connect, "data": f"rx{name}", "task": task}
            for name, connect, task in (("A", "C1", "FAST"), ("B", "C2", "SLOW"), ("C", "C3", "FAST"))
        ],
        "peer": [
            {"name": "P1", "active": True, "remote": "@C1"},
            {"name": "P2", "active": True, "remote": "@C2"},
            {"name": "P3", "active": False, "local": "127.0.0.1:0"},
            {"name": "P4", "active": True, "remote": "@C1"},
        ],
    }  # fmt: skip


class LaneMachine(RuleBasedStateMachine):
    """Two benches with the same history; one has lanes, the other has none."""

    lane_scans: ClassVar[int] = 0  # calls that a lane answered, over all examples
    monkeypatch: ClassVar[pytest.MonkeyPatch]

    @initialize(
        dialect=st.sampled_from(("baosky", "baosky", "s7-1500", "s7-1200")),
        seed=st.integers(0, 3),
        fragment=st.booleans(),
        second_client=st.sampled_from(("reject", "replace", "queue")),
        buffers=st.sampled_from((1, 2, 8)),
    )
    def start(self, dialect: str, seed: int, fragment: bool, second_client: str, buffers: int) -> None:
        sim: dict[str, object] = {"seed": seed, "fragment": fragment}
        options: dict[str, object] = {"buffers": buffers}
        if dialect == "baosky":
            options["second_client"] = second_client
        project = read_project(document(dialect, sim, options), "lanes", Path())
        self.ours = Bench(project, "sim")
        with self.monkeypatch.context() as patch:
            patch.setenv(LANE, "slow")
            self.theirs = Bench(project, "sim")
        assert self.ours.runtime.has_lanes and not self.theirs.runtime.has_lanes
        self.seq = self.number = 0
        self.bring_up()

    def teardown(self) -> None:
        for bench in (self.ours, self.theirs) if hasattr(self, "theirs") else ():
            bench.close()
            assert bench.leaks() == ()

    def do(self, line: str) -> None:
        answers = []
        for bench in (self.ours, self.theirs):
            command = parse_line(line, bench.project, "lanes")
            assert command is not None
            answers.append(bench.do(command))
        assert answers[0] == answers[1], line

    @rule(scans=st.integers(1, 12))
    def run(self, scans: int) -> None:
        for _ in range(scans):
            self.ours.step()
            self.theirs.step()
            self.check()

    def check(self) -> None:
        ours, theirs = self.ours.runtime, self.theirs.runtime
        assert ours.ledger.since(self.seq) == theirs.ledger.since(self.seq)
        self.seq = ours.ledger.last_seq
        assert ours.changed == theirs.changed and ours.called == theirs.called
        assert ours.snapshot() == theirs.snapshot()
        for name in NAMES:
            assert ours.data(f"rx{name}") == theirs.data(f"rx{name}")
            assert ours.partial(name) == theirs.partial(name)

    @rule()
    def bring_up(self) -> None:
        for line in ("fault clear", "plc run", "peer P3 listen"):
            self.do(line)
        for name in NAMES:
            self.do(f"set {name} CONT=1 EN_R=1 LEN=0 ADHOC=0")
        self.run(8)
        for peer in ("P1", "P2"):
            self.do(f"peer {peer} connect")
        self.run(8)

    @rule(name=st.sampled_from(NAMES), frames=st.integers(1, 12), scans=st.integers(0, 12))
    def send_frames(self, name: str, frames: int, scans: int) -> None:
        self.send(name, frames * SIZES[name], scans)

    @rule(name=st.sampled_from(NAMES), size=st.integers(1, 60), scans=st.integers(0, 5))
    def send(self, name: str, size: int, scans: int) -> None:
        self.number += 1
        payload = bytes((self.number * 31 + i * 7) & 0xFF for i in range(size))
        self.do(f"peer {PEER_OF[name]} send hex {payload.hex()}")
        self.run(scans)

    @rule(count=st.integers(1, 20))
    def send_to_all_one_by_one(self, count: int) -> None:
        self.bring_up()
        for _ in range(count):
            for name in NAMES:
                self.send(name, SIZES[name], 1)

    @rule(
        name=st.sampled_from(NAMES),
        pin=st.sampled_from(("EN_R", "CONT", "ADHOC")),
        value=st.sampled_from((True, True, False)),
    )
    def set_pin(self, name: str, pin: str, value: bool) -> None:
        self.do(f"set {name} {pin}={int(value)}")

    @rule(name=st.sampled_from(NAMES), length=st.sampled_from((0, 0, 3, 5, 8, 70)))
    def set_len(self, name: str, length: int) -> None:
        self.do(f"set {name} LEN={length}")

    @rule(
        name=st.sampled_from(NAMES),
        line=st.sampled_from(("pulse {} COM_RST", "pulse {} EN_R", "download {}")),
    )
    def play_with_a_pin(self, name: str, line: str) -> None:
        self.do(line.format(name))

    @rule(
        peer=st.sampled_from(("P1", "P2", "P3", "P4")),
        move=st.sampled_from(("connect", "close", "rst", "shutdown", "stall", "resume")),
    )
    def move_peer(self, peer: str, move: str) -> None:
        self.do(f"peer {peer} {'listen' if (peer, move) == ('P3', 'connect') else move}")

    @rule(name=st.sampled_from(("A", "B")), frames=st.integers(0, 2), move=st.sampled_from(("close", "rst")))
    def come_send_and_leave(self, name: str, frames: int, move: str) -> None:
        self.move_peer(PEER_OF[name], "connect")
        if frames:
            self.send(name, frames * SIZES[name], 0)
        self.move_peer(PEER_OF[name], move)

    @rule(call=st.sampled_from(CALLS), on=st.sampled_from(("", " on C1", " on C3")), nth=st.integers(1, 3))
    def fault(self, call: str, on: str, nth: int) -> None:
        self.do(f"fault {call}{on} nth={nth}")

    @rule()
    def clear_faults(self) -> None:
        self.do("fault clear")

    @rule(name=st.sampled_from(NAMES))
    def write_data(self, name: str) -> None:
        self.do(f"write rx{name} hex ff fe")

    @rule(scans=st.integers(1, 5))
    def stop_for_a_while(self, scans: int) -> None:
        self.do("plc stop")
        self.run(scans)
        self.do("plc run")


@pytest.mark.timeout(300)  # of processor time it takes a tenth
def test_a_scan_with_lanes_is_the_scan_without_them(monkeypatch: pytest.MonkeyPatch) -> None:
    answered = Lane.scan

    def counted(lane: Lane, *scan: object) -> Answer:
        got = answered(lane, *scan)  # type: ignore[arg-type]
        LaneMachine.lane_scans += got is not None
        return got

    monkeypatch.setattr(Lane, "scan", counted)
    LaneMachine.lane_scans, LaneMachine.monkeypatch = 0, monkeypatch
    many = settings(
        max_examples=EXAMPLES,
        stateful_step_count=40,
        deadline=None,
        database=None,
        derandomize=True,
        suppress_health_check=list(HealthCheck),
    )
    run_state_machine_as_test(LaneMachine, settings=many)
    assert LaneMachine.lane_scans >= 2_000, "the machine hardly ever took a lane"
