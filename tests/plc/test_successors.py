"""Devices that open a connection for each message: every complete frame arrives, whatever the call order."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import pytest

from tests.bench.bench_lines import do
from trcvtui.bench.bench import Bench
from trcvtui.net.events import BytesDropped, ConnectionChanged, EventKind
from trcvtui.net.results import Endpoint, Fault
from trcvtui.project.file import read_project

KERNELS = ("sim", "live")
SIZE = 8
Block = tuple[str, str]  # block, name
RECEIVER: Block = ("TRCV_C", "R")
SENDER: Block = ("TSEND_C", "S")
INNER: tuple[Block, ...] = (("TCON", "B"), ("TRCV", "R"), ("TSEND", "S"))
ORDERS = [(RECEIVER,), (SENDER, RECEIVER), (RECEIVER, SENDER), *permutations(INNER)]


class Line:
    """A bench with these blocks on C1, in call order, and devices that come one after the other."""

    def __init__(
        self,
        *blocks: Block,
        kernel: str = "sim",
        slow: str = "",
        slow_priority: int = 1,
        dialect: str = "baosky",
        **options: object,
    ) -> None:
        document = {
            "dialect": dialect,
            "options": options,
            "task": [{"name": "MAIN"}, {"name": "SLOW", "interval": "T#70ms", "priority": slow_priority}],
            "data": [{"name": name, "type": f"ARRAY[1..{SIZE}] OF BYTE"} for name in ("rx", "tx")],
            "connect": [{"name": "C1", "LocalAddress": "127.0.0.1"}],
            "instance": [
                {"block": block, "name": name, "connect": "C1", "task": "SLOW" if name == slow else "MAIN"}
                | ({"data": "rx" if "RCV" in block else "tx"} if "RCV" in block or "SEND" in block else {})
                for block, name in blocks
            ],
            "peer": [{"name": f"P{n}", "active": True, "remote": "@C1"} for n in range(1, 7)],
        }
        self.bench = Bench(read_project(document, "line", Path()), kernel)
        self.names = [name for _, name in blocks]
        self.received: list[bytes] = []
        self.shown: dict[str, list[str]] = {name: [] for name in self.names}
        for block, name in blocks:
            if block.endswith("_C"):
                self.do(f"set {name} CONT=1")
            if block == "TCON":
                self.do(f"pulse {name} REQ")
            if "RCV" in block:
                self.do(f"set {name} EN_R=1")

    def do(self, *lines: str) -> None:
        do(self.bench, *lines)

    def run(self, scans: int) -> None:
        for _ in range(scans):
            self.bench.step()
            for out in self.bench.runtime.due_edges:
                self.shown[out.instance].append(f"{out.outputs.status:04X}" + "!" * out.outputs.error)
                if out.outputs.done and out.block.startswith("TRCV"):
                    self.received.append(self.bench.runtime.data("rx"))

    def device(self, peer: str, number: int, end: str = "close") -> None:
        self.do(f"peer {peer} connect", f"peer {peer} send hex {frame(number).hex()}", f"peer {peer} {end}")

    def walk(self, name: str) -> str:
        return " ".join(self.shown[name])

    def dropped(self) -> int:
        events = [line.event for line in self.bench.runtime.ledger]
        return sum(event.size for event in events if isinstance(event, BytesDropped))

    def turned_away(self) -> int:
        events = [line.event for line in self.bench.runtime.ledger]
        return sum(
            isinstance(event, ConnectionChanged) and event.what is EventKind.SECOND_CLIENT for event in events
        )

    def close(self) -> None:
        self.bench.close()
        assert self.bench.leaks() == ()


def frame(number: int) -> bytes:
    return number.to_bytes(SIZE, "big")


def frames(count: int) -> list[bytes]:
    return [frame(number) for number in range(1, count + 1)]


@pytest.mark.parametrize("end", ["close", "rst"])
@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("blocks", ORDERS, ids=lambda blocks: "-".join(name for _, name in blocks))
def test_six_devices_in_one_scan_and_six_frames(blocks: tuple[Block, ...], kernel: str, end: str) -> None:
    line = Line(*blocks, kernel=kernel)
    line.run(5)
    for number in range(1, 7):
        line.device(f"P{number}", number, end)
    line.run(50)
    assert line.received == frames(6)
    assert (line.dropped(), line.turned_away()) == (0, 0)
    line.close()


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("blocks", ORDERS[:3], ids=["R", "S-R", "R-S"])
def test_the_call_order_changes_nothing_that_the_receiver_shows(
    blocks: tuple[Block, ...], kernel: str
) -> None:
    line = Line(*blocks, kernel=kernel)
    line.run(5)
    line.device("P1", 1)
    line.run(8)
    assert line.walk("R").partition("7004")[2] == " 7006 7008 80C5! 7002 7002 7002 7002"
    line.close()


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_successor_waits_and_is_the_next_partner_while_the_first_frame_is_read(kernel: str) -> None:
    line = Line(RECEIVER, kernel=kernel)
    line.run(5)
    line.device("P1", 1)
    line.do("peer P2 connect", f"peer P2 send hex {frame(2).hex()}")
    line.run(12)
    assert line.walk("R").endswith("7004 7006 7008 80C5! 7002 7004 7006 7008 7006 7006 7006 7006")
    assert line.bench.peers["P2"].state == "connected"
    line.close()


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("slow", ["R1", "R2"])
@pytest.mark.parametrize("wait", range(7))
def test_a_whole_frame_shows_before_the_loss_that_a_task_of_another_priority_has_met(
    wait: int, slow: str, kernel: str
) -> None:
    line = Line(("TRCV_C", "R1"), ("TRCV_C", "R2"), slow=slow, slow_priority=2, kernel=kernel)
    line.run(30)
    line.do("peer P1 connect")
    line.run(14 + wait)
    for number in range(1, 4):
        line.do(f"peer P1 send hex {frame(number).hex()}")
    line.do("peer P1 close")
    line.run(40)
    walks = line.walk("R1") + line.walk("R2")
    assert (walks.count("7008"), walks.count("80A6"), line.dropped()) == (3, 0, 0)
    assert line.bench.runtime.snapshot().connections[0].state == "establishing"
    line.close()


def test_a_sender_that_sends_meets_the_loss_at_once_and_the_receiver_has_every_frame() -> None:
    line = Line(SENDER, RECEIVER)
    line.run(5)
    line.device("P1", 1)
    line.run(1)
    line.do("pulse S REQ")
    line.run(6)
    assert line.walk("S").endswith("7004 80C5! 7002 7002 7002 7002 7002")
    assert line.walk("R").endswith("7004 7006 7008 80C5! 7002 7002 7002")
    assert line.received == frames(1)
    line.close()


def test_en_r_that_rises_in_the_scan_of_the_fin_receives_though_the_sender_is_called_before() -> None:
    line = Line(SENDER, RECEIVER)
    line.do("set R EN_R=0")
    line.run(5)
    line.do("peer P1 connect")
    line.run(3)
    line.do(f"peer P1 send hex {frame(1).hex()}", "peer P1 close", "set R EN_R=1")
    line.run(5)
    assert line.received == frames(1)
    line.close()


@pytest.mark.parametrize("blocks", ORDERS[:3], ids=["R", "S-R", "R-S"])
def test_a_receiver_that_does_not_want_keeps_no_dead_connection(blocks: tuple[Block, ...]) -> None:
    line = Line(*blocks)
    line.do("set R EN_R=0")
    line.run(5)
    line.device("P1", 1)
    line.run(4)
    assert line.walk("R").endswith("7004 7002 7002 7002")
    assert line.dropped() == SIZE
    line.close()


@pytest.mark.parametrize("pins", ["R1 LEN=9", "R1 CONT=0"])
def test_two_receivers_that_cannot_receive_keep_no_dead_connection(pins: str) -> None:
    line = Line(SENDER, ("TRCV_C", "R1"), ("TRCV_C", "R2"))
    line.do(f"set {pins}", "set R2 LEN=9")
    line.run(5)
    line.device("P1", 1)
    line.run(4)
    assert line.walk("R2").endswith("80A5! 7002 7002") or line.walk("R2").endswith("7002 7002 7002")
    assert line.dropped() == SIZE
    line.close()


def test_a_receiver_kept_out_by_another_takes_over_what_that_one_leaves() -> None:
    line = Line(("TRCV_C", "R1"), ("TRCV_C", "R2"))
    line.run(5)
    line.do("peer P1 connect")
    line.run(3)
    assert line.walk("R2").endswith("80C3!")
    line.do("set R1 EN_R=0")
    line.do(f"peer P1 send hex {frame(1).hex()}", "peer P1 close")
    line.run(6)
    assert line.received == frames(1)
    line.close()


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("trouble", ["set R1 LEN=9", "fault buffer times=99"])
@pytest.mark.parametrize("blocks", [(), (SENDER,)], ids=["R1-R2", "S-R1-R2"])
def test_an_owner_that_cannot_receive_and_a_receiver_kept_out_keep_no_dead_connection(
    blocks: tuple[Block, ...], trouble: str, kernel: str
) -> None:
    line = Line(*blocks, ("TRCV_C", "R1"), ("TRCV_C", "R2"), kernel=kernel)
    line.run(5)
    line.do("peer P1 connect")
    line.run(3)
    line.do(f"peer P1 send hex {frame(1).hex()}", trouble)
    line.run(3)
    assert line.walk("R2").endswith("80C3! 80C3! 80C3!")
    line.do("peer P1 close")
    line.run(4)
    assert line.walk("R2").endswith("7002 7002 7002")
    assert line.received == frames(1)
    line.do("peer P2 connect")
    line.run(2)
    assert line.bench.peers["P2"].state == "connected"
    line.close()


def test_two_owners_of_different_priority_that_cannot_receive_keep_no_dead_connection() -> None:
    line = Line(SENDER, ("TRCV_C", "R1"), ("TRCV_C", "R2"), slow="R2", slow_priority=2)
    line.run(30)
    line.do("peer P1 connect")
    line.run(21)
    assert line.walk("R2").endswith("7006")
    line.do(f"peer P1 send hex {frame(1).hex()} {frame(2).hex()} {frame(3).hex()}")
    line.run(21)
    line.do("set R1 LEN=9", "set R2 LEN=9", f"peer P1 send hex {frame(4).hex()} {frame(5).hex()}")
    line.run(21)
    assert (line.walk("R1")[-5:], line.walk("R2")[-5:]) == ("80A5!", "80A5!")
    line.do("peer P1 close")
    line.run(14)
    assert line.walk("R1").endswith("7002 7002")
    line.close()


def test_a_whole_frame_waits_for_a_buffer_though_its_sender_has_gone() -> None:
    line = Line(SENDER, RECEIVER)
    line.run(5)
    line.do("fault buffer times=3")
    line.device("P1", 1)
    line.run(9)
    assert line.walk("R").endswith("7004 80A7! 80A7! 80A7! 7006 7008 80C5! 7002 7002")
    line.close()


def test_part_of_a_frame_after_whole_ones_is_80a6_and_the_successor_is_served() -> None:
    line = Line(SENDER, RECEIVER)
    line.run(5)
    line.do("peer P1 connect", f"peer P1 send hex {frame(1).hex()} 01 02", "peer P1 close")
    line.device("P2", 2)
    line.run(14)
    assert "7008 7006 80A6! 80C5! 7002 7004 7006 7008 80C5!" in line.walk("R")
    assert line.received == frames(2)
    line.close()


@pytest.mark.parametrize("kernel", KERNELS)
def test_who_comes_when_the_queue_is_full_comes_again_by_itself(kernel: str) -> None:
    line = Line(RECEIVER, kernel=kernel, backlog=1)
    line.run(5)
    line.do("peer P1 connect", "peer P2 connect", "peer P3 connect")
    assert [line.bench.peers[f"P{n}"].state for n in (1, 2, 3)] == ["connected", "connected", "connecting"]
    line.close()


@pytest.mark.parametrize("kernel", KERNELS)
def test_a_free_port_that_somebody_else_has_taken_meanwhile_is_not_waited_for(kernel: str) -> None:
    line = Line(RECEIVER, kernel=kernel)
    line.run(4)
    had = line.bench.runtime.listening_port("C1")
    assert had is not None
    line.do("set R CONT=0")
    line.run(2)
    stranger = line.bench._kernel.socket("stranger")
    assert not isinstance(stranger, Fault)
    assert line.bench._kernel.bind(stranger, Endpoint("127.0.0.1", had)) is None
    line.do("set R CONT=1")
    line.run(4)
    assert line.bench.runtime.listening_port("C1") not in (None, had)
    line.bench._kernel.close(stranger)
    line.close()
