"""A Hypothesis machine that plays with a simulated bench, and what must hold after every scan."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule

from tests.properties.promises import FramesKept
from trcvtui.bench.bench import Bench
from trcvtui.blocks.environment import JobEnded, JobStarted
from trcvtui.commands.table import parse_line
from trcvtui.net.events import BytesDropped, BytesReceived, ConnectionChanged, EventKind
from trcvtui.plc.ledger import BenchNote, Line, PeerSent, StatusEdge
from trcvtui.project.file import read_project

INSTANCES = ("A", "B", "C")
LEVELS = dict.fromkeys(INSTANCES, 1)  # all tasks have the default priority
DATA_OF = {"A": "rx_a", "B": "rx_b", "C": "rx_c"}
SIZES = {"rx_a": 8, "rx_b": 5, "rx_c": 64}
PEERS = ("P1", "P2", "P3")
CONNECTING = {0x0000, 0x0001, 0x7000, 0x7001, 0x7002, 0x7003, 0x7004, 0x7007, 0x8000}
CALLS = ("socket", "set_reuse", "bind", "listen", "poll_add", "poll_del", "accept", "connect", "recv",
         "shutdown", "abort", "close", "buffer", "queue")  # fmt: skip

OPTIONS: dict[str, object] = {"retry": "T#50ms", "attempt_limit": "T#200ms", "buffers": 2}
DOCUMENT: dict[str, object] = {
    "dialect": "baosky",
    "options": OPTIONS,
    "task": [{"name": "FAST"}, {"name": "SLOW"}],
    "data": [{"name": name, "type": f"ARRAY[1..{size}] OF BYTE"} for name, size in SIZES.items()],
    "connect": [
        {"name": "C1", "LocalAddress": "127.0.0.1", "LocalPort": 0},
        {
            "name": "C2",
            "ActiveEstablished": True,
            "LocalAddress": "127.0.0.1",
            "RemoteAddress": "127.0.0.1",
            "RemotePort": "@P2",
            "KeepAliveTimeInterval": 1,
        },
    ],
    "instance": [
        {"name": "A", "block": "TRCV_C", "connect": "C1", "data": "rx_a", "task": "SLOW"},
        {"name": "B", "block": "TRCV_C", "connect": "C1", "data": "rx_b"},
        {"name": "C", "block": "TRCV_C", "connect": "C2", "data": "rx_c"},
    ],
    "peer": [
        {"name": "P1", "active": True, "remote": "@C1"},
        {"name": "P2", "active": False, "local": "127.0.0.1:0"},
        {"name": "P3", "active": True, "remote": "@C1"},
    ],
}


@dataclass
class Stream:
    """What one TCP connection delivered to the PLC: which bytes were received, and what became of each."""

    peer_ends: tuple[str, str]
    received: int = 0
    settled: int = 0  # every byte before this offset went to DATA or was noted as dropped
    open_job: JobStarted | None = None
    done: list[tuple[int, int]] = field(default_factory=list)


class BenchMachine(RuleBasedStateMachine):
    """Random moves; after every scan the promises of design section 3 are checked."""

    scans = 0  # over all examples of a run

    @initialize(
        seed=st.integers(0, 3),
        fragment=st.booleans(),
        second_client=st.sampled_from(("reject", "replace", "queue")),
        slow=st.booleans(),
    )
    def start(self, seed: int, fragment: bool, second_client: str, slow: bool) -> None:
        document = DOCUMENT | {"sim": {"seed": seed, "fragment": fragment}}
        document["options"] = {**OPTIONS, "second_client": second_client}
        document["task"] = [{"name": "FAST"}, {"name": "SLOW", "interval": "T#70ms" if slow else "T#10ms"}]
        self.bench = Bench(read_project(document, "machine", Path(".")), "sim")
        self.before: dict[str, StatusEdge] = {}
        self.data = {name: self.bench.runtime.data(name) for name in SIZES}
        self.seq = 0
        self.streams: dict[tuple[str, int], Stream] = {}
        self.sent: dict[tuple[str, str], bytes] = {}  # by the peer's local and remote end
        self.number = 0
        self.kept = FramesKept()

    def teardown(self) -> None:
        if hasattr(self, "bench"):
            self.bench.close()
            assert self.bench.leaks() == ()

    def do(self, line: str) -> str:
        command = parse_line(line, self.bench.project, "machine")
        assert command is not None
        return self.bench.do(command)

    # -- moves ---------------------------------------------------------------------------------------

    @rule(scans=st.integers(1, 8))
    def run_a_little(self, scans: int) -> None:
        self.run(scans)

    @rule(scans=st.integers(20, 150))
    def run_on(self, scans: int) -> None:
        self.run(scans)

    @rule(peer=st.sampled_from(("P1", "P2")), sizes=st.lists(st.integers(1, 40), max_size=8))
    def talk(self, peer: str, sizes: list[int]) -> None:
        for size in sizes:
            self.send(peer, size, size // 3)
            self.run(1 + size % 3)

    @rule()
    def bring_up(self) -> None:
        for line in ("fault clear", "plc run", "link C2 up", "peer P2 listen", "peer P1 resume"):
            self.do(line)
        for name in INSTANCES:
            self.do(f"set {name} CONT=1 EN_R=1 LEN=0")
        self.run(8)
        self.do("peer P1 connect")
        self.run(8)

    def run(self, scans: int) -> None:
        for _ in range(scans):
            self.is_disturbed = self.bench.plan.active
            self.bench.step()
            BenchMachine.scans += 1
            self.check_scan()

    @rule(name=st.sampled_from(INSTANCES), pin=st.sampled_from(("EN_R", "CONT")), value=st.booleans())
    def set_pin(self, name: str, pin: str, value: bool) -> None:
        self.do(f"set {name} {pin}={int(value)}")

    @rule(name=st.sampled_from(INSTANCES), adhoc=st.booleans(), length=st.sampled_from((0, 1, 3, 5, 8, 70)))
    def set_mode(self, name: str, adhoc: bool, length: int) -> None:
        self.do(f"set {name} ADHOC={int(adhoc)} LEN={length}")

    @rule(name=st.sampled_from(INSTANCES))
    def reset(self, name: str) -> None:
        self.do(f"pulse {name} COM_RST")

    @rule(
        peer=st.sampled_from(PEERS), move=st.sampled_from(("connect", "connect", "close", "rst", "shutdown"))
    )
    def move_peer(self, peer: str, move: str) -> None:
        before = self.bench.peers[peer].snapshot()
        self.do(f"peer {peer} {'listen' if (peer, move) == ('P2', 'connect') else move}")
        after = self.bench.peers[peer].snapshot()
        if before.state == "connected" and move != "connect":
            self.kept.goes((before.local, before.remote))
        if move == "connect" and after.state == "connected" and after.local != before.local:
            self.kept.comes((after.local, after.remote))

    @rule(
        peers=st.lists(st.sampled_from(("P1", "P3")), min_size=1, max_size=5),
        size=st.integers(0, 30),
        move=st.sampled_from(("close", "rst", "shutdown")),
        gap=st.sampled_from((0, 0, 0, 1, 3)),
    )
    def call_for_one_message(self, peers: list[str], size: int, move: str, gap: int) -> None:
        """Let devices come one after the other: each connects, sends, and is gone at once."""
        for peer in peers:
            self.move_peer(peer, "close")
            self.move_peer(peer, "connect")
            if size:
                self.send(peer, size, 0)
            self.move_peer(peer, move)
            self.run(gap)

    @rule(peer=st.sampled_from(PEERS), size=st.integers(1, 200), split=st.integers(0, 20))
    def send(self, peer: str, size: int, split: int) -> None:
        self.number += 1
        payload = bytes((self.number * 31 + i * 7) & 0xFF for i in range(size))
        before = self.bench.peers[peer].snapshot()
        cut = f" split={split} gap=T#10ms" if 0 < split < size else ""
        if not self.do(f"peer {peer} send hex {payload.hex()}{cut}"):
            ends = before.local, before.remote
            self.sent[ends] = self.sent.get(ends, b"") + payload

    @rule(peer=st.sampled_from(PEERS), move=st.sampled_from(("stall", "resume")))
    def stall(self, peer: str, move: str) -> None:
        self.do(f"peer {peer} {move}")

    @rule(call=st.sampled_from(CALLS), on=st.sampled_from(("", " on C1", " on C2")), times=st.integers(1, 3))
    def fault(self, call: str, on: str, times: int) -> None:
        self.do(f"fault {call}{on} times={times}")

    @rule()
    def clear_faults(self) -> None:
        self.do("fault clear")

    @rule(scans=st.integers(1, 20))
    def stop_for_a_while(self, scans: int) -> None:
        self.do("plc stop")
        self.run(scans)
        self.do("plc run")

    @rule(up=st.booleans())
    def link(self, up: bool) -> None:
        self.do(f"link C2 {'up' if up else 'down'}")

    # -- promises --------------------------------------------------------------------------------------

    def check_scan(self) -> None:
        news = self.bench.runtime.ledger.since(self.seq)
        self.seq = self.bench.runtime.ledger.last_seq
        delivered = self.read_news(news)
        disturbed = self.is_disturbed or self.bench.plan.active
        self.kept.check(news, self.bench.runtime.snapshot(), LEVELS, disturbed)
        for out in self.bench.runtime.called:
            self.check_outputs(out)
        self.check_data(delivered)

    def check_outputs(self, out: StatusEdge) -> None:
        before, pins = self.before.get(out.instance), out.outputs
        assert pins.busy + pins.done + pins.error <= 1
        assert pins.rcvd_len == 0 or pins.done
        assert not (pins.done and before and before.outputs.done), "DONE lasts one scan, 7006 stands between"
        if pins.status in CONNECTING:
            assert not pins.busy and not pins.done
        assert pins.error == (pins.status >= 0x8080)
        assert pins.busy == (pins.status == 0x7006)
        assert pins.done == (pins.status == 0x7008)
        self.before[out.instance] = out

    def check_data(self, delivered: set[str]) -> None:
        for name, before in self.data.items():
            now = self.bench.runtime.data(name)
            assert now == before or name in delivered, "DATA changes only at DONE"
            self.data[name] = now

    def read_news(self, news: tuple[Line, ...]) -> set[str]:
        delivered = set()
        for line in news:
            match line.event:
                case ConnectionChanged(name, incarnation, EventKind.CONNECTED, local, peer):
                    self.streams[name, incarnation] = Stream((peer, local))
                case BytesReceived(name, incarnation, _, offset, size):
                    stream = self.streams[name, incarnation]
                    assert offset == stream.received, "no byte lost or doubled"
                    stream.received += size
                case JobStarted(_, _, name, incarnation, offset):
                    assert self.streams[name, incarnation].settled == offset
                case BytesDropped(name, incarnation, offset, size) if offset >= 0:
                    self.settle(name, incarnation, offset, size)
                case JobEnded(instance, _, name, incarnation, offset, size, True):
                    self.settle(name, incarnation, offset, size)
                    self.check_bytes(instance, name, incarnation, offset, size)
                    delivered.add(DATA_OF[instance])
                case PeerSent() | BenchNote() | _:
                    pass
        return delivered

    def settle(self, name: str, incarnation: int, offset: int, size: int) -> None:
        stream = self.streams[name, incarnation]
        assert offset == stream.settled, "bytes reach DATA or the ledger's list of dropped ones, in order"
        stream.settled += size
        assert stream.settled <= stream.received

    def check_bytes(self, instance: str, name: str, incarnation: int, offset: int, size: int) -> None:
        expected = self.sent[self.streams[name, incarnation].peer_ends][offset : offset + size]
        assert self.bench.runtime.data(DATA_OF[instance])[:size] == expected
