"""The UDP peer against bare kernel calls: the same transcript on the simulated network and on loopback."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Final

import pytest

from tests import golden
from tests.bench.peers.peer_wire import HOME, MS, Wire
from trcvtui.bench.bench import Bench
from trcvtui.bench.peers.peer import Peer
from trcvtui.bench.peers.transports import DatagramTransport
from trcvtui.commands.table import parse_line
from trcvtui.commands.words import PeerAction, PeerSend
from trcvtui.net.kernel import Handle
from trcvtui.net.os.kernel import OsKernel
from trcvtui.net.results import Datagram, Endpoint, Fault
from trcvtui.net.sim.kernel import SimKernel
from trcvtui.plc.ledger import PeerSent
from trcvtui.project.file import load_project
from trcvtui.project.project import PeerDecl, Project


class Air(Wire):
    """One kernel, one peer on it, and the PLC's side as a bare UDP socket."""

    def __init__(self, kernel: SimKernel | OsKernel) -> None:
        super().__init__(kernel)
        self.plc = self.socket()

    def socket(self) -> Handle:
        handle = self.kernel.datagram_socket("PLC")
        assert not isinstance(handle, Fault)
        assert self.kernel.bind(handle, HOME) is None
        return handle

    def end(self, handle: Handle) -> Endpoint:
        end = self.kernel.local_end(handle)
        assert end is not None
        return end

    def speaker(self, remote: Endpoint | str | None = None, end: Endpoint = HOME) -> Peer:
        peer = self.add(PeerDecl("P1", False, end, udp=True, remote=remote))
        assert isinstance(peer.transport, DatagramTransport)
        return peer

    def listening(self, remote: Endpoint | str | None = None) -> Peer:
        peer = self.speaker(remote)
        assert peer.listen() == ""
        return peer

    def tell(self, peer: Peer, data: bytes, sender: Handle | None = None) -> None:
        assert peer.transport.last_port is not None
        to = Endpoint("127.0.0.1", peer.transport.last_port)
        handle = self.plc if sender is None else sender
        assert self.kernel.send_to(handle, memoryview(data), to) == len(data)

    def heard(self, handle: Handle) -> list[bytes]:
        into = memoryview(bytearray(65536))
        found = []
        while isinstance(got := self.kernel.recv_from(handle, into), Datagram):
            found.append(bytes(into[: got.size]))
        return found


@pytest.fixture(params=["sim", "live"])
def air(request: pytest.FixtureRequest) -> Iterator[Air]:
    """Return both kernels in turn; nothing stays open after a test."""
    with closing(Air(SimKernel() if request.param == "sim" else OsKernel())) as air:
        yield air
        air.kernel.close(air.plc)
    assert air.kernel.leaks() == ()


# -- what it says ----------------------------------------------------------------------------------------


def test_a_message_is_one_datagram_and_split_makes_several(air: Air) -> None:
    peer = air.listening(air.end(air.plc))
    assert peer.send(PeerSend("P1", b"abcdef"), air.now) == ""
    assert peer.send(PeerSend("P1", b"abcdef", (1, 2)), air.now) == ""
    assert air.heard(air.plc) == [b"abcdef", b"a", b"bc", b"def"]
    sent = [event for event in air.events if isinstance(event, PeerSent)]
    assert [(s.message, s.size, s.remote) for s in sent] == [
        (1, 6, str(air.end(air.plc))),
        (2, 6, str(air.end(air.plc))),
    ]
    assert peer.snapshot().bytes_sent == 12


def test_without_a_remote_it_answers_whoever_was_heard_last(air: Air) -> None:
    peer = air.listening()
    line = "P1 has no partner to send to: no remote is open, and no datagram has come"
    assert (peer.can_send, peer.send(PeerSend("P1", b"x"), air.now)) == (False, line)
    other = air.socket()
    for sender, question in ((air.plc, b"one"), (other, b"two")):
        air.tell(peer, question, sender)
        air.until(lambda: peer.queues.inbox.count > 0 and peer.has_received(question))  # noqa: B023
        assert peer.send(PeerSend("P1", b"to " + question), air.now) == ""
        assert air.heard(sender) == [b"to " + question]
    assert peer.snapshot().remote == str(air.end(other))
    air.kernel.close(other)


def test_a_remote_is_spoken_to_whoever_was_heard(air: Air) -> None:
    other = air.socket()
    peer = air.listening("@U1")
    assert not peer.can_send
    air.ends["U1"] = air.end(other)
    air.tell(peer, b"hello")
    air.until(lambda: peer.has_received(b"hello"))
    assert peer.send(PeerSend("P1", b"to U1"), air.now) == ""
    assert (air.heard(other), air.heard(air.plc)) == ([b"to U1"], [])
    air.kernel.close(other)


def test_nobody_there_is_no_failure(air: Air) -> None:
    gone = air.socket()
    peer = air.listening(air.end(gone))
    air.kernel.close(gone)
    for _ in range(3):
        assert peer.send(PeerSend("P1", b"x"), air.now) == ""
        air.step()
    air.tell(peer, b"still listening")
    air.until(lambda: peer.has_received(b"still listening"))


def test_what_the_stack_refuses_is_told_and_not_tried_again(air: Air) -> None:
    peer = air.listening(Endpoint("255.255.255.255", 9))
    assert peer.send(PeerSend("P1", b"abc", repeat=2), air.now) == "P1 cannot send: send EACCES"
    assert (air.notes()[-2:], peer.snapshot().pending) == (["not sent", "not sent"], 0)
    assert peer.snapshot().messages_sent == 0


def test_a_message_larger_than_a_datagram_needs_split(air: Air) -> None:
    peer = air.listening(air.end(air.plc))
    line = "P1: a datagram of 65508 bytes exceeds 65507: use split="
    assert peer.send(PeerSend("P1", bytes(65508)), air.now) == line
    assert peer.send(PeerSend("P1", bytes(65508), (65507,)), air.now) == ""
    assert air.heard(air.plc) == [bytes(65507), bytes(1)]


# -- what it hears ---------------------------------------------------------------------------------------


def test_received_compares_the_bytes_of_all_datagrams_since_it_last_held(air: Air) -> None:
    peer = air.listening()
    air.tell(peer, b"one")
    air.tell(peer, b"two")
    air.until(lambda: peer.has_received(b"onetwo"))
    air.tell(peer, b"three")
    air.until(lambda: peer.has_received(b"three"))
    assert not peer.has_received(b"two")
    assert peer.snapshot().bytes_received == 11


def test_a_stalled_peer_reads_nothing_until_it_resumes(air: Air) -> None:
    peer = air.listening()
    peer.stall()
    air.tell(peer, b"wait")
    for _ in range(5):
        air.step()
    assert (peer.queues.inbox.count, peer.snapshot().stalled) == (0, True)
    peer.resume()
    air.until(lambda: peer.has_received(b"wait"))


def test_a_flood_costs_bounded_work_in_one_step() -> None:
    air = Air(SimKernel())
    peer = air.listening()
    for _ in range(300):
        air.tell(peer, b"")
    air.tell(peer, b"x")
    air.step()
    assert peer.queues.inbox.count == 0
    peer.end()


# -- open and closed -------------------------------------------------------------------------------------


def test_a_closed_peer_hears_and_says_nothing_and_keeps_its_port(air: Air) -> None:
    peer = air.listening(air.end(air.plc))
    port = peer.transport.last_port
    assert peer.is_in("listening") and not peer.is_in("closed")
    peer.send(PeerSend("P1", b"ab", (1,), gap_ns=500 * MS), air.now)
    peer.close()
    assert peer.is_in("closed") and air.notes()[-2:] == ["stopped listening", "not sent"]
    assert peer.send(PeerSend("P1", b"x"), air.now) == "P1 is closed"
    air.tell(peer, b"lost")
    assert (peer.listen(), peer.transport.last_port) == ("", port)
    assert peer.listen() == "", "an open socket stays"
    air.tell(peer, b"new")
    air.until(lambda: peer.has_received(b"new"))


def test_a_port_that_is_taken_is_told(air: Air) -> None:
    peer = air.speaker(end=air.end(air.plc))
    assert peer.listen() == "P1 cannot listen: bind EADDRINUSE"
    assert peer.state == "closed"


def test_commands_of_connections_answer_one_line(air: Air) -> None:
    peer = air.listening()
    answers = [peer.connect(0), peer.rst(), peer.shutdown()]
    verbs = ("connect", "rst", "shutdown")
    assert answers == [f"P1 speaks UDP: there is no connection to {verb}" for verb in verbs]


# -- in a project file -----------------------------------------------------------------------------------

PROJECT: Final = """
dialect = "baosky"
[[peer]]
name = "P1"
udp = true
says = ['text "hello"', 'hex 01 02 split=1']
every = "T#20ms"
"""


@pytest.mark.parametrize("kernel", ["sim", "live"])
def test_a_udp_peer_of_a_project_listens_at_load_and_says_its_messages_by_itself(
    tmp_path: Path, kernel: str
) -> None:
    file = tmp_path / "b.toml"
    file.write_text(PROJECT)
    bench = Bench(load_project(file), kernel)
    air = Air(bench._kernel)
    peer = bench.peers["P1"]
    assert isinstance(peer.transport, DatagramTransport) and peer.state == "listening"
    bench.step()
    air.tell(peer, b"I am here")
    heard: list[bytes] = []
    for _ in range(4):
        bench.step()
        heard += air.heard(air.plc)
    assert heard == [b"hello", b"\x01", b"\x02"]
    assert bench.do(PeerAction("P1", "rst")) == "P1 speaks UDP: there is no connection to rst"
    air.kernel.close(air.plc)
    bench.close()
    assert bench.leaks() == ()


def test_what_a_udp_peer_does_not_have_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)

    def loaded(line: str = "") -> Project:
        Path("b.toml").write_text(f'dialect = "baosky"\n[[peer]]\nname = "P1"\nudp = true\n{line}\n')
        return load_project("b.toml")

    golden.mistakes("UDP peers", loaded)
    project = loaded()
    golden.mistakes("lines to a UDP peer", lambda line: parse_line(line, project, "w"))
