"""What a peer sends and receives, against bare kernel calls on the simulated network and on loopback."""

from __future__ import annotations

from tests.bench.peers.peer_wire import MS, Wire, connected, write
from trcvtui.commands.words import PeerSend
from trcvtui.net.results import WOULD_BLOCK
from trcvtui.plc.ledger import PeerSent

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
    wire.until(lambda: peer.queues.inbox.count == 2)
    assert not peer.has_received(b"\x01") and not peer.has_received(b"\x02")
    assert peer.has_received(b"\x01\x02")
    assert peer.has_received(b"\x01\x02"), "what has held holds until more arrives"

    write(wire, other, b"\x03")
    wire.until(lambda: peer.queues.inbox.count == 3)
    assert not peer.has_received(b"\x01\x02")
    assert peer.has_received(b"\x03")
    assert peer.has_received(b"\x01\x02\x03")


def test_what_is_kept_of_a_flood_is_bounded(wire: Wire) -> None:
    peer, other = connected(wire)
    for number in range(8):
        write(wire, other, bytes([number]) * 32768)
        wire.until(lambda: peer.queues.inbox.count == 32768 * (number + 1))  # noqa: B023 - called at once
    snapshot = peer.snapshot()
    assert snapshot.bytes_received == 8 * 32768
    assert peer.queues.inbox.last_bytes == b"\x06" * 32768 + b"\x07" * 32768
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
