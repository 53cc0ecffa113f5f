"""A Hypothesis machine: blocks of every kind that share CONNECTs, in a program that changes while it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

from tests.properties.byte_model import ByteModel
from tests.properties.drawn_projects import BLOCKS, DATA, Document, projects
from tests.properties.promises import (
    NO_BUFFER,
    FramesKept,
    check_in_use,
    check_orphans,
    check_outputs,
    check_owners,
)
from tests.properties.witness import Witness
from trcvtui.bench.bench import Bench
from trcvtui.bench.peers.peer import Peer
from trcvtui.blocks.table import block_row
from trcvtui.commands.table import parse_line
from trcvtui.commands.words import CreateBlock, Retype, WriteBytes
from trcvtui.net.kernel import KERNEL_CALLS
from trcvtui.plc.ledger import StatusEdge
from trcvtui.project.file import read_project
from trcvtui.project.project import InstanceDecl

MOST_INSTANCES: Final = 8
SMALL_WINDOW: Final = 2000  # bytes: as long as no more are on the way, no window of this bench has closed
TYPES: Final = (
    *(f"ARRAY[1..{size}] OF BYTE" for size in (1, 5, 8, 64, 64, 500, 30_000, 30_000, 65535, 65536)),
    "STRUCT END_STRUCT",  # no byte at all
)
LENGTHS: Final = (0, 0, 0, 0, 1, 3, 3, 5, 5, 64, 70, 29_999, 65536)
WAITS: Final = (0, 1, 2, 5, 330)  # scans; 3 x I, when a dead link is found, are 300
ERRORS: Final = ("", "", "", " ECONNRESET", " ETIMEDOUT", " EAGAIN", " EPIPE")
PICK: Final = st.integers(0, 23)  # which of what is there, modulo their number


class SharedMachine(RuleBasedStateMachine):
    """Random moves; after every scan the promises of design section 3 are checked."""

    scans = 0  # over all examples of a run

    @initialize(document=projects(), busy=st.booleans())
    def start(self, document: Document, busy: bool) -> None:
        self.begin(document)
        if busy:
            self.bring_up()

    def begin(self, document: Document) -> None:
        self.bench = Bench(read_project(document, "machine", Path(".")), "sim")
        self.witness = Witness(self.bench)
        self.model = ByteModel(DATA, self.bench.project.instances)
        self.across_tasks = bool(self.bench.project.options["lock_across_tasks"])
        self.before: dict[str, StatusEdge] = {}
        self.picture = self.bench.runtime.snapshot()
        self.task_of = {i.name: i.task for i in self.bench.project.instances}
        self.cut: set[str] = set()  # CONNECTs whose wire has been cut
        self.seq = self.number = 0
        self.kept = FramesKept()
        self.is_sound = True

    def teardown(self) -> None:
        if hasattr(self, "bench"):
            if self.is_sound:
                self.come_to_rest()
            self.bench.close()
            assert self.bench.leaks() == ()

    def do(self, line: str) -> str:
        command = parse_line(line, self.bench.project, "machine")
        assert command is not None
        match command:
            case CreateBlock(decl):
                self.model.created.append(decl)
            case Retype(name, _, decl):
                size = decl.size
                self.model.changes.append((name, lambda old: old[:size] + bytes(size - len(old[:size]))))
            case WriteBytes(name, at, payload):
                self.model.changes.append((name, lambda old: _written(old, at, payload)))
        return self.bench.do(command)

    def run(self, scans: int) -> None:
        for _ in range(scans):
            self.is_sound = False
            self.is_disturbed = self.bench.plan.active
            self.bench.step()
            SharedMachine.scans += 1
            self.check_scan()
            self.is_sound = True

    # -- scans -----------------------------------------------------------------------------------------

    @rule(scans=st.integers(1, 8))
    def run_a_little(self, scans: int) -> None:
        self.run(scans)

    @rule(scans=st.integers(20, 150))
    def run_on(self, scans: int) -> None:
        self.run(scans)

    @rule(scans=st.integers(1, 20))
    def stop_for_a_while(self, scans: int) -> None:
        self.do("plc stop")
        self.run(scans)
        self.do("plc run")

    # -- pins and DATA -----------------------------------------------------------------------------------

    def an_instance(self, pick: int) -> InstanceDecl | None:
        there = self.bench.project.instances
        return there[pick % len(there)] if there else None

    @rule(pick=PICK, pin=PICK, value=st.sampled_from(("0", "1", "1", "pulse", "pulse", "blink")))
    def turn(self, pick: int, pin: int, value: str) -> None:
        decl = self.an_instance(pick)
        if decl is not None:
            pins = [p.name for p in block_row(decl.block).inputs if p.is_bool]
            name = pins[pin % len(pins)]
            pulse = value == "pulse"
            self.do(f"pulse {decl.name} {name}" if pulse else f"set {decl.name} {name}={value}")

    @rule(pick=PICK, adhoc=st.booleans(), length=st.sampled_from(LENGTHS))
    def set_length(self, pick: int, adhoc: bool, length: int) -> None:
        decl = self.an_instance(pick)
        if decl is not None and block_row(decl.block).uses_network:
            mode = f" ADHOC={int(adhoc)}" if decl.block.startswith("TRCV") else ""
            self.do(f"set {decl.name} LEN={length}{mode}")

    @rule(
        data=st.sampled_from(tuple(DATA)),
        at=st.one_of(st.integers(0, 70), st.integers(9000, 29_900)),
        payload=st.binary(min_size=1, max_size=20),
    )
    def write(self, data: str, at: int, payload: bytes) -> None:
        decl = self.bench.project.data_decl(data)
        if decl is not None and at + len(payload) <= decl.size:
            self.do(f"write {data}+{at} hex {payload.hex()}")

    @rule(data=st.sampled_from(tuple(DATA)), type_name=st.sampled_from(TYPES))
    def resize(self, data: str, type_name: str) -> None:
        self.do(f"resize {data} {type_name}")

    # -- instances ---------------------------------------------------------------------------------------

    @rule(
        number=st.integers(1, MOST_INSTANCES),
        block=st.sampled_from(BLOCKS),
        connect=PICK,
        task=PICK,
        data=st.sampled_from((*DATA, "")),
        busy=st.booleans(),
    )
    def create(self, number: int, block: str, connect: int, task: int, data: str, busy: bool) -> None:
        project, name = self.bench.project, f"I{number}"
        if project.instance(name) is None:
            words = [f"connect={project.connects[connect % len(project.connects)].name}"]
            words.append(
                f"task={self.task_of.setdefault(name, project.tasks[task % len(project.tasks)].name)}"
            )
            words += [f"data={data}"] if data and block_row(block).uses_network else []
            words += [
                f"{p.name}={int(busy)}" for p in block_row(block).inputs if p.is_bool and p.name != "COM_RST"
            ]
            self.do(f"create {block} {name} {' '.join(words)}")

    @rule(pick=PICK)
    def delete(self, pick: int) -> None:
        decl = self.an_instance(pick)
        if decl is not None:
            self.do(f"delete {decl.name}")

    @rule(pick=PICK)
    def download(self, pick: int) -> None:
        decl = self.an_instance(pick)
        if decl is not None:
            self.do(f"download {decl.name}")

    # -- partners, the wire, faults ----------------------------------------------------------------------

    def a_peer(self, pick: int) -> Peer:
        peers = tuple(self.bench.peers.values())
        peer = peers[pick % len(peers)]
        assert isinstance(peer, Peer)
        return peer

    @rule(pick=PICK, move=st.sampled_from(("open", "open", "close", "rst", "shutdown", "stall", "resume")))
    def move_peer(self, pick: int, move: str) -> None:
        peer = self.a_peer(pick)
        before = peer.snapshot()
        if move == "open":
            move = "connect" if before.active else "listen"
        self.do(f"peer {before.name} {move}")
        if before.state == "connected" and move in ("close", "rst", "shutdown"):
            self.note_end((before.local, before.remote), move, before.pending)
        after = peer.snapshot()
        if move == "connect" and after.state == "connected" and after.local != before.local:
            self.kept.comes((after.local, after.remote))

    @rule(
        picks=st.lists(PICK, min_size=1, max_size=5),
        size=st.integers(0, 100),
        move=st.sampled_from(("close", "rst", "shutdown")),
        gap=st.sampled_from((0, 0, 0, 1, 3)),
    )
    def call_for_one_message(self, picks: list[int], size: int, move: str, gap: int) -> None:
        """Let devices come one after the other: each connects, sends, and is gone at once."""
        for pick in picks:
            self.move_peer(pick, "close")
            self.move_peer(pick, "open")
            if size:
                self.send(pick, size, 0)
            self.move_peer(pick, move)
            self.run(gap)

    def note_end(self, ends: tuple[str, str], move: str, unsent: int) -> None:
        """Keep what the PLC can see of a FIN or RST in its next scan, as long as wire and window are open."""
        said = self.model.said.setdefault(ends, bytearray())
        if unsent:
            del said[-unsent:]
        if move == "rst":
            self.model.finished.pop(ends, None)
        elif self.is_flowing(ends):
            self.model.finished.setdefault(ends, len(said))
        if (move == "rst" and not self.cut) or self.is_flowing(ends):
            self.model.ended.add(ends)
            self.kept.goes(ends)

    def is_flowing(self, ends: tuple[str, str]) -> bool:
        return not self.cut and ends not in self.witness.crowded

    @rule(pick=PICK, size=st.one_of(st.integers(1, 200), st.integers(1, 20_000)), split=st.integers(0, 20))
    def send(self, pick: int, size: int, split: int) -> None:
        peer = self.a_peer(pick)
        before = peer.snapshot()
        ends = before.local, before.remote
        self.number += 1
        payload = bytes((self.number * 31 + i * 7) & 0xFF for i in range(size))
        cut = f" split={split} gap=T#10ms" if 0 < split < size else ""
        if not self.do(f"peer {before.name} send hex {payload.hex()}{cut}"):
            self.model.said.setdefault(ends, bytearray()).extend(payload)
            if self.on_the_way(ends) > SMALL_WINDOW:
                self.witness.crowded.add(ends)

    def on_the_way(self, ends: tuple[str, str]) -> int:
        there = [link for link in self.model.links.values() if (link.peer, link.local) == ends]
        return len(self.model.said[ends]) - sum(link.received for link in there)

    @rule(connect=PICK, up=st.booleans(), scans=st.sampled_from(WAITS))
    def link(self, connect: int, up: bool, scans: int) -> None:
        connects = self.bench.project.connects
        name = connects[connect % len(connects)].name
        if not up:
            self.cut.add(name)
        self.do(f"link {name} {'up' if up else 'down'}")
        self.run(scans)

    @rule(
        call=st.sampled_from(KERNEL_CALLS),
        error=st.sampled_from(ERRORS),
        connect=PICK,
        times=st.integers(1, 3),
    )
    def fault(self, call: str, error: str, connect: int, times: int) -> None:
        names = ["", *(f" on {c.name}" for c in self.bench.project.connects)]
        self.do(f"fault {call}{error}{names[connect % len(names)]} times={times}")

    @rule()
    def clear_faults(self) -> None:
        self.do("fault clear")

    # -- stretches of a good day ---------------------------------------------------------------------------

    def mend(self) -> None:
        self.do("fault clear")
        self.do("plc run")
        for connect in self.bench.project.connects:
            self.do(f"link {connect.name} up")
        for peer in self.bench.project.peers:
            self.do(f"peer {peer.name} resume")
            if not peer.active:
                self.do(f"peer {peer.name} listen")

    @rule(call=st.sampled_from(("", "", *KERNEL_CALLS)))
    def bring_up(self, call: str = "") -> None:
        """Ask every block for all it can do, and let the partners come; perhaps one call fails."""
        self.mend()
        if call:
            self.do(f"fault {call}")
        for decl in self.bench.project.instances:
            names = {pin.name for pin in block_row(decl.block).inputs}
            pins = [f"{pin}=1" for pin in ("CONT", "EN_R") if pin in names]
            if pins:
                self.do(f"set {decl.name} {' '.join(pins)}")
            if decl.block == "TCON":
                self.do(f"pulse {decl.name} REQ")
        self.run(12)
        for peer in self.bench.project.peers:
            if peer.active:
                self.do(f"peer {peer.name} connect")
        self.run(8)

    @rule(pick=PICK, sizes=st.lists(st.integers(1, 40), min_size=1, max_size=8))
    def talk(self, pick: int, sizes: list[int]) -> None:
        for size in sizes:
            self.send(pick, size, size // 3)
            self.run(1 + size % 3)

    def senders(self) -> list[str]:
        return [i.name for i in self.bench.project.instances if i.block.startswith("TSEND")]

    @rule(first=PICK, gaps=st.lists(st.integers(0, 4), min_size=2, max_size=12))
    def ask(self, first: int, gaps: list[int]) -> None:
        names = self.senders()
        for number, gap in enumerate(gaps if names else ()):
            self.do(f"pulse {names[(first + number) % len(names)]} REQ")
            self.run(gap)
        self.run(1)

    @rule(fill=st.binary(min_size=1, max_size=3))
    def write_while_sending(self, fill: bytes) -> None:
        """Change DATA after the bytes that the stack has taken: the frame was copied at the edge."""
        self.mend()
        for name in self.senders():
            self.do(f"set {name} LEN=0")
            self.do(f"pulse {name} REQ")
        self.run(1)
        for job in self.picture.instances:
            if job.block.startswith("TSEND") and job.data and job.have < job.need:
                self.write(job.data, job.need - len(fill), fill)
        self.run(5)

    @rule(scans=st.integers(2, 20))
    def blink(self, scans: int) -> None:
        for name in self.senders():
            self.do(f"set {name} REQ=blink")
        self.run(scans)

    @rule(pick=PICK, size=st.integers(1, 100), move=st.sampled_from(("close", "rst", "shutdown")))
    def end_in_mid_frame(self, pick: int, size: int, move: str) -> None:
        """Let all work, and a partner leave in the midst of it; he comes again."""
        for name in self.senders():
            self.do(f"pulse {name} REQ")
        self.run(size % 3)
        self.send(pick, size, 0)
        self.run(size % 2)
        self.move_peer(pick, move)
        self.run(2 + size % 20)
        self.move_peer(pick, "open")

    # -- promises --------------------------------------------------------------------------------------

    def check_scan(self) -> None:
        runtime, model = self.bench.runtime, self.model
        news = runtime.ledger.lines_since(self.seq)
        model.read(news)
        self.seq = runtime.ledger.last_seq
        before, self.picture = self.picture, runtime.snapshot()
        priorities = {t.name: 0 if self.across_tasks else t.priority for t in self.bench.project.tasks}
        levels = {name: priorities[task] for name, task in self.task_of.items()}
        self.kept.check(news, self.picture, levels, self.is_disturbed or self.bench.plan.active)
        for name in model.anew if runtime.running else tuple(self.before):
            self.before.pop(name, None)
        called = runtime.due_edges
        began = model.began + [out.instance for out in called if out.outputs.status == NO_BUFFER]
        for out in called:
            check_outputs(out, self.before.get(out.instance))
            check_in_use(out, before, self.picture, began)
            assert (out.outputs.done and block_row(out.block).uses_network) == (out.instance in model.done)
            self.before[out.instance] = out
        for name, expected in model.data.items():
            assert runtime.data(name) == expected, "DATA changes only at DONE, and by commands"
        check_orphans(before, self.picture)
        check_owners(self.picture, model, levels)
        self.witness.check(model.said, len(model.receiving) + len(model.sending))

    # -- the end ---------------------------------------------------------------------------------------

    def come_to_rest(self) -> None:
        """Let what is on its way arrive, take everything back, and find nothing left."""
        self.mend()
        for decl in self.bench.project.instances:
            if "REQ" in {pin.name for pin in block_row(decl.block).inputs}:
                self.do(f"set {decl.name} REQ=0")
        self.run(10)
        for _ in range(60):  # a lost segment, or a closed window, is tried again every second
            if self.witness.has_all(self.picture, self.model):
                break
            self.run(20)
        assert self.witness.has_all(self.picture, self.model), "the partner has every byte"
        for decl in self.bench.project.instances:
            self.do(f"delete {decl.name}")
        self.run(1)
        self.witness.check_no_job_left()
        assert not self.model.receiving and not self.model.sending
        self.do("plc stop")
        self.run(1)
        self.witness.check_nothing_left(self.picture)


def _written(old: bytes, at: int, payload: bytes) -> bytes:
    """Return DATA after a write; it may have become smaller since the command was given."""
    return old[:at] + payload[: max(0, len(old) - at)] + old[at + len(payload) :]


def run_machine(machine: type[SharedMachine], examples: int) -> None:
    SharedMachine.scans = 0
    checks = list(HealthCheck)
    many = settings(
        max_examples=examples, stateful_step_count=50, database=None, suppress_health_check=checks
    )
    run_state_machine_as_test(machine, settings=many)
