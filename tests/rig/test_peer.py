"""The peer against bare kernel calls: the same transcript on the simulated network and on loopback."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

import pytest

from trcvtui.net.kernel import WOULD_BLOCK, Accepted, Endpoint, Fault, Handle
from trcvtui.net.os_kernel import OsKernel
from trcvtui.net.sim_kernel import SimKernel
from trcvtui.plc.ledger import BenchNote, Event, PeerSent
from trcvtui.plc.project import PeerDecl
from trcvtui.rig.bench_words import PeerSend
from trcvtui.rig.peer import Peer

MS: Final = 1_000_000
HOME: Final = Endpoint("127.0.0.1", 0)
MOST_STEPS: Final = 20_000  # loopback answers within a few; a peer that never does is a failure, not a hang


class Wire:
    """One kernel, the peers on it, and the other side of each connection in bare kernel calls."""

    def __init__(self, kernel: SimKernel | OsKernel) -> None:
        self.kernel = kernel
        self.peers: list[Peer] = []
        self.events: list[Event] = []
        self.now = 0
        self.ends: dict[str, Endpoint] = {}

    def peer(self, name: str, active: bool, end: Endpoint | str = HOME) -> Peer:
        peer = Peer(PeerDecl(name, active, end), self.kernel, self.ends.get, self.events.append)
        self.peers.append(peer)
        return peer

    def socket(self) -> Handle:
        handle = self.kernel.socket("PLC")
        assert not isinstance(handle, Fault)
        return handle

    def listener(self) -> Handle:
        handle = self.socket()
        assert self.kernel.bind(handle, HOME) is None and self.kernel.listen(handle, 4) is None
        end = self.kernel.local_end(handle)
        assert end is not None
        self.ends["C1"] = end
        return handle

    def client(self, peer: Peer) -> Handle:
        assert peer.listening_port is not None
        handle = self.socket()
        assert self.kernel.connect(handle, Endpoint("127.0.0.1", peer.listening_port)) is None
        self.until(lambda: self.kernel.connect_result(handle) is None)
        return handle

    def accept(self, listener: Handle) -> Handle:
        found: list[Accepted] = []

        def accepted() -> bool:
            got = self.kernel.accept(listener)
            if isinstance(got, Accepted):
                found.append(got)
            return bool(found)

        self.until(accepted)
        return found[0].handle

    def step(self, ns: int = MS) -> None:
        self.now += ns
        if isinstance(self.kernel, SimKernel):
            self.kernel.advance(self.now)
        for peer in self.peers:
            peer.step(self.now)

    def until(self, holds: Callable[[], bool]) -> None:
        for _ in range(MOST_STEPS):
            self.step()
            if holds():
                return
        raise AssertionError("it never came")

    def read(self, handle: Handle, size: int) -> bytes:
        """Return exactly `size` bytes."""
        got = bytearray()

        def complete() -> bool:
            buffer = memoryview(bytearray(size - len(got)))
            count = self.kernel.recv(handle, buffer)
            if isinstance(count, int):
                got.extend(buffer[:count])
            return len(got) == size

        if size:
            self.until(complete)
        return bytes(got)

    def ending(self, handle: Handle) -> str:
        """Return FIN or the errno name with which the connection ends."""
        found: list[str] = []

        def ended() -> bool:
            count = self.kernel.recv(handle, memoryview(bytearray(100)))
            if isinstance(count, Fault):
                found.append(count.error)
            elif count == 0:
                found.append("FIN")
            return bool(found)

        self.until(ended)
        return found[0]

    def notes(self, name: str) -> list[str]:
        return [e.what for e in self.events if isinstance(e, BenchNote) and e.subject == name]


@pytest.fixture(params=["sim", "live"])
def wire(request: pytest.FixtureRequest) -> Iterator[Wire]:
    """Return a wire on each of the two kernels; nothing stays open behind a test."""
    kernel = SimKernel() if request.param == "sim" else OsKernel()
    wire = Wire(kernel)
    yield wire
    for peer in wire.peers:
        peer.end()
    if isinstance(kernel, OsKernel):
        kernel.close_all()


def connected(wire: Wire) -> tuple[Peer, Handle]:
    """Return an active peer and the other end of its connection."""
    listener = wire.listener()
    peer = wire.peer("P1", True, "@C1")
    assert peer.connect(wire.now) == ""
    other = wire.accept(listener)
    wire.until(lambda: peer.state == "connected")
    return peer, other


def write(wire: Wire, handle: Handle, payload: bytes) -> None:
    assert wire.kernel.send(handle, memoryview(payload)) == len(payload)


# -- states ----------------------------------------------------------------------------------------------


def test_an_active_peer_connects_on_command_and_not_before(wire: Wire) -> None:
    listener = wire.listener()
    peer = wire.peer("P1", True, "@C1")
    wire.step()
    assert (peer.state, peer.is_in("closed"), wire.kernel.accept(listener)) == ("closed", True, WOULD_BLOCK)

    peer.connect(wire.now)
    wire.accept(listener)
    wire.until(lambda: peer.is_in("connected"))
    assert not peer.is_in("closed")
    assert peer.snapshot().remote == str(wire.ends["C1"])


def test_a_refusal_is_a_state_and_no_error(wire: Wire) -> None:
    listener = wire.listener()
    peer = wire.peer("P1", True, "@C1")
    wire.kernel.close(listener)
    assert peer.connect(wire.now) == ""
    wire.until(lambda: peer.is_in("refused"))
    assert (peer.state, wire.notes("P1")) == ("refused", ["refused"])


def test_a_connect_that_nobody_listens_for_is_refused_at_once(wire: Wire) -> None:
    peer = wire.peer("P1", True, "@C1")
    assert peer.connect(wire.now) == ""
    assert peer.is_in("refused")


def test_one_command_is_one_attempt(wire: Wire) -> None:
    peer = wire.peer("P1", True, "@C1")
    peer.connect(wire.now)
    listener = wire.listener()
    for _ in range(5):
        wire.step()
    assert wire.kernel.accept(listener) is WOULD_BLOCK and peer.is_in("refused")


def test_connect_on_a_connection_changes_nothing(wire: Wire) -> None:
    peer, other = connected(wire)
    assert peer.connect(wire.now) == ""
    assert peer.send(PeerSend("P1", b"x"), wire.now) == ""
    assert wire.read(other, 1) == b"x"


def test_a_passive_peer_listens_again_and_remembers_how_the_last_connection_ended(wire: Wire) -> None:
    peer = wire.peer("P2", False)
    assert peer.listen() == ""
    assert (peer.state, peer.is_in("closed")) == ("listening", False)
    client = wire.client(peer)
    wire.until(lambda: peer.is_in("connected"))
    assert not peer.is_in("listening")

    wire.kernel.close(client)
    wire.until(lambda: peer.is_in("closed"))
    assert peer.is_in("listening") and not peer.is_in("reset")

    client = wire.client(peer)
    wire.until(lambda: peer.is_in("connected"))
    wire.kernel.abort(client)
    wire.until(lambda: peer.is_in("reset"))
    assert peer.is_in("listening") and not peer.is_in("closed")


def test_a_free_port_is_kept_when_the_listener_is_opened_again(wire: Wire) -> None:
    peer = wire.peer("P2", False)
    peer.listen()
    port = peer.listening_port
    peer.close()
    assert (peer.state, peer.listening_port) == ("closed", None)
    assert peer.listen() == "" and peer.listening_port == port
    assert peer.listen() == "", "an open listener stays"


def test_close_of_a_connected_passive_peer_keeps_it_listening(wire: Wire) -> None:
    peer = wire.peer("P2", False)
    peer.listen()
    client = wire.client(peer)
    wire.until(lambda: peer.state == "connected")
    peer.close()
    assert wire.ending(client) == "FIN"
    assert peer.is_in("closed") and peer.is_in("listening")


def test_the_newest_client_of_a_passive_peer_wins(wire: Wire) -> None:
    peer = wire.peer("P2", False)
    peer.listen()
    first = wire.client(peer)
    wire.until(lambda: peer.state == "connected")
    second = wire.client(peer)
    assert wire.ending(first) == "ECONNRESET"
    peer.send(PeerSend("P2", b"to the second"), wire.now)
    assert wire.read(second, 13) == b"to the second"
    assert "reset for a newer connection" in wire.notes("P2")


def test_a_port_that_is_taken_is_told(wire: Wire) -> None:
    wire.listener()
    peer = wire.peer("P2", False, wire.ends["C1"])
    assert peer.listen() in {f"P2 cannot listen: {call} EADDRINUSE" for call in ("bind", "listen")}
    assert (peer.state, peer.listening_port) == ("closed", None)


# -- ends ------------------------------------------------------------------------------------------------


def test_close_is_a_fin_even_with_unread_bytes(wire: Wire) -> None:
    peer, other = connected(wire)
    peer.stall()
    write(wire, other, b"nobody has read this")
    wire.step()
    peer.close()
    assert wire.ending(other) == "FIN"


def test_close_behind_the_partners_fin_leaves_the_listener_open(wire: Wire) -> None:
    peer = wire.peer("P2", False)
    peer.listen()
    client = wire.client(peer)
    wire.until(lambda: peer.state == "connected")
    peer.stall()
    write(wire, client, b"unread")
    wire.kernel.close(client)
    wire.step()
    assert peer.state == "connected", "a stalled peer reads neither the bytes nor the FIN behind them"
    peer.close()
    assert peer.is_in("closed") and peer.is_in("listening") and peer.has_received(b"unread")


def test_rst_is_a_reset_and_counts_as_closed(wire: Wire) -> None:
    peer, other = connected(wire)
    peer.rst()
    assert wire.ending(other) == "ECONNRESET"
    assert peer.is_in("reset") and peer.is_in("closed")


def test_shutdown_sends_fin_and_goes_on_reading(wire: Wire) -> None:
    peer, other = connected(wire)
    peer.shutdown()
    assert wire.ending(other) == "FIN"
    write(wire, other, b"still here")
    wire.until(lambda: peer.traffic.inbox.count == 10)
    assert peer.is_in("connected")
    assert peer.send(PeerSend("P1", b"x"), wire.now) == "P1 has shut down its sending side"
    wire.kernel.close(other)
    wire.until(lambda: peer.is_in("closed"))


def test_the_partners_fin_comes_after_its_last_bytes(wire: Wire) -> None:
    peer, other = connected(wire)
    write(wire, other, b"last words")
    wire.kernel.close(other)
    wire.until(lambda: peer.is_in("closed"))
    assert peer.has_received(b"last words")


def test_commands_without_a_connection_say_so_in_the_journal(wire: Wire) -> None:
    peer = wire.peer("P1", True, "@C1")
    assert (peer.rst(), peer.shutdown(), peer.close()) == ("", "", "")
    assert wire.notes("P1") == ["nothing to reset", "nothing to shut down"]


# -- sending ---------------------------------------------------------------------------------------------


def test_send_on_a_connection_that_is_not_up_is_an_error(wire: Wire) -> None:
    peer = wire.peer("P1", True, "@C1")
    assert peer.send(PeerSend("P1", b"x"), 0) == "P1 is closed, not connected"
    peer.connect(0)
    assert peer.send(PeerSend("P1", b"x"), 0) == "P1 is refused, not connected"


def test_a_message_is_on_the_wire_before_the_command_returns(wire: Wire) -> None:
    peer, other = connected(wire)
    assert peer.send(PeerSend("P1", bytes(1000)), wire.now) == ""
    assert (peer.snapshot().pending, peer.snapshot().bytes_sent) == (0, 1000)
    assert wire.read(other, 1000) == bytes(1000)


def test_every_message_is_told_with_its_number_and_its_place_in_the_stream(wire: Wire) -> None:
    peer, other = connected(wire)
    peer.send(PeerSend("P1", b"abc", (1,), repeat=2), wire.now)
    peer.send(PeerSend("P1", b"de"), wire.now)
    sent = [event for event in wire.events if isinstance(event, PeerSent)]
    assert [(s.message, s.offset, s.size) for s in sent] == [(1, 0, 3), (2, 3, 3), (3, 6, 2)]
    assert {(s.local, s.remote) for s in sent} == {(peer.snapshot().local, str(wire.ends["C1"]))}
    assert wire.read(other, 8) == b"abcabcde"


def test_a_new_connection_is_a_new_stream_but_messages_count_on(wire: Wire) -> None:
    listener = wire.listener()
    peer = wire.peer("P1", True, "@C1")
    for _ in range(2):
        peer.connect(wire.now)
        wire.accept(listener)
        wire.until(lambda: peer.state == "connected")
        peer.send(PeerSend("P1", b"abc"), wire.now)
        peer.close()
    sent = [event for event in wire.events if isinstance(event, PeerSent)]
    assert [(s.message, s.offset) for s in sent] == [(1, 0), (2, 0)]


def test_chunks_with_a_gap_go_on_while_time_passes(wire: Wire) -> None:
    peer, other = connected(wire)
    peer.send(PeerSend("P1", b"abcdef", (2, 2), gap_ns=20 * MS), wire.now)
    assert wire.read(other, 2) == b"ab"
    assert wire.kernel.recv(other, memoryview(bytearray(9))) is WOULD_BLOCK
    assert peer.snapshot().pending == 4
    wire.step(20 * MS)
    assert wire.read(other, 2) == b"cd"
    wire.step(20 * MS)
    assert wire.read(other, 2) == b"ef"
    assert peer.snapshot().pending == 0


def test_what_the_stack_does_not_take_goes_on_when_the_partner_reads(wire: Wire) -> None:
    peer, other = connected(wire)
    payload = bytes(range(256)) * 65536  # 16 MiB: more than any window
    peer.send(PeerSend("P1", payload), wire.now)
    assert peer.snapshot().pending > 0
    assert wire.read(other, len(payload)) == payload
    assert (peer.snapshot().pending, peer.snapshot().messages_sent) == (0, 1)


def test_a_reset_ends_the_sending_and_tells_what_did_not_go(wire: Wire) -> None:
    peer, other = connected(wire)
    peer.send(PeerSend("P1", b"abcd", (1,), gap_ns=MS * 500), wire.now)
    wire.kernel.abort(other)
    wire.until(lambda: peer.is_in("reset"))
    assert wire.notes("P1")[-2:] == ["lost", "not sent"]
    assert peer.snapshot().pending == 0


# -- receiving -------------------------------------------------------------------------------------------


def test_a_stalled_peer_reads_nothing_until_it_resumes(wire: Wire) -> None:
    peer, other = connected(wire)
    peer.stall()
    write(wire, other, b"wait")
    for _ in range(5):
        wire.step()
    assert (peer.traffic.inbox.count, peer.snapshot().stalled) == (0, True)
    peer.resume()
    wire.until(lambda: peer.has_received(b"wait"))


def test_a_stalled_peer_learns_of_a_reset(wire: Wire) -> None:
    peer, other = connected(wire)
    peer.stall()
    wire.kernel.abort(other)
    wire.until(lambda: peer.is_in("reset"))


def test_a_stalled_peer_learns_of_a_fin_with_nothing_in_front_of_it(wire: Wire) -> None:
    peer, other = connected(wire)
    peer.stall()
    wire.kernel.close(other)
    wire.until(lambda: peer.is_in("closed"))


def test_a_stall_closes_the_partners_window(wire: Wire) -> None:
    peer, other = connected(wire)
    peer.stall()
    block = memoryview(bytes(1 << 20))

    def window_is_closed() -> bool:
        return wire.kernel.send(other, block) is WOULD_BLOCK

    wire.until(window_is_closed)
    peer.resume()
    wire.until(lambda: not window_is_closed())


def test_received_means_all_of_the_connection_or_all_since_it_last_held(wire: Wire) -> None:
    peer, other = connected(wire)
    write(wire, other, b"\x01\x02")
    wire.until(lambda: peer.traffic.inbox.count == 2)
    assert not peer.has_received(b"\x01") and not peer.has_received(b"\x02")
    assert peer.has_received(b"\x01\x02")
    assert peer.has_received(b"\x01\x02"), "what has held holds until more arrives"

    write(wire, other, b"\x03")
    wire.until(lambda: peer.traffic.inbox.count == 3)
    assert not peer.has_received(b"\x01\x02")
    assert peer.has_received(b"\x03")
    assert peer.has_received(b"\x01\x02\x03")


def test_what_is_kept_of_a_flood_is_bounded(wire: Wire) -> None:
    peer, other = connected(wire)
    for number in range(8):
        write(wire, other, bytes([number]) * 32768)
        wire.until(lambda: peer.traffic.inbox.count == 32768 * (number + 1))  # noqa: B023 - called at once
    snapshot = peer.snapshot()
    assert snapshot.bytes_received == 8 * 32768
    assert peer.traffic.inbox.last == b"\x06" * 32768 + b"\x07" * 32768
    assert len(snapshot.last_received) == 4096


def test_nothing_of_a_peer_stays_open_at_the_end(wire: Wire) -> None:
    connected(wire)
    passive = wire.peer("P2", False)
    passive.listen()
    wire.client(passive)
    assert len(wire.kernel.leaks()) == 6
    for peer in wire.peers:
        peer.end()
    assert len(wire.kernel.leaks()) == 3, "the listener, the accepted end and the client of this test"
