"""The connection of a peer, against bare kernel calls on the simulated network and on loopback."""

from __future__ import annotations

from unittest.mock import patch

from tests.bench.peers.peer_wire import Wire, connected, write
from trcvtui.bench.peers.peer import Peer
from trcvtui.commands.words import PeerSend
from trcvtui.net.kernel import Handle, NewClient
from trcvtui.net.results import WOULD_BLOCK, Endpoint

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
    port = peer.transport.last_port
    peer.close()
    assert peer.state == "closed"
    assert peer.listen() == "" and peer.transport.last_port == port
    assert peer.listen() == "", "an open listener stays"


def test_a_free_port_goes_to_nobody_else_while_the_peer_does_not_listen(wire: Wire) -> None:
    peer = wire.peer("P2", False)
    peer.listen()
    assert peer.transport.last_port is not None
    end = Endpoint("127.0.0.1", peer.transport.last_port)
    peer.close()
    fault = wire.kernel.bind(wire.socket(), end)
    assert fault is not None and fault.error == "EADDRINUSE"
    assert peer.listen() == ""


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
    assert peer.state == "closed"


# -- ends ------------------------------------------------------------------------------------------------


def test_close_is_a_fin_even_with_unread_bytes(wire: Wire) -> None:
    peer, other = connected(wire)
    peer.stall()
    write(wire, other, b"nobody has read this")
    wire.step()
    peer.close()
    assert wire.ending(other) == "FIN"


def test_close_after_the_partners_fin_leaves_the_listener_open(wire: Wire) -> None:
    peer = wire.peer("P2", False)
    peer.listen()
    client = wire.client(peer)
    wire.until(lambda: peer.state == "connected")
    peer.stall()
    write(wire, client, b"unread")
    wire.kernel.close(client)
    wire.step()
    assert peer.state == "connected", "a stalled peer reads neither the bytes nor the FIN after them"
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
    wire.until(lambda: peer.queues.inbox.count == 10)
    assert peer.is_in("connected")
    assert peer.send(PeerSend("P1", b"x"), wire.now) == "P1 has shut down its sending side"
    wire.kernel.close(other)
    wire.until(lambda: peer.is_in("closed"))


def test_commands_without_a_connection_say_so_in_the_journal(wire: Wire) -> None:
    peer = wire.peer("P1", True, "@C1")
    assert (peer.rst(), peer.shutdown(), peer.close()) == ("", "", "")
    assert wire.notes("P1") == ["nothing to reset", "nothing to shut down"]


# -- a send and a reset at once --------------------------------------------------------------------------


def test_an_active_peer_reads_what_came_before_the_reset_of_whom_it_has_called(wire: Wire) -> None:
    peer, other = called(wire)
    write(wire, other, b"frame")
    wire.kernel.abort(other)
    wire.until(lambda: peer.is_in("reset"))
    assert peer.has_received(b"frame") and not peer.is_in("refused")


def test_a_passive_peer_reads_clients_that_reset_before_it_looks_and_whoever_comes_after_them(
    wire: Wire,
) -> None:
    peer = wire.peer("P2", False)
    peer.listen()
    for word in (b"one,", b"two,", b"three"):
        assert peer.transport.last_port is not None
        client = wire.socket()
        assert wire.kernel.connect(client, Endpoint("127.0.0.1", peer.transport.last_port)) is None
        assert wire.kernel.connect_result(client) is None
        write(wire, client, word)
        wire.kernel.abort(client)
    wire.until(lambda: peer.is_in("reset"))
    assert peer.queues.inbox.total == len(b"one,two,three") and peer.has_received(b"three")


def test_a_peer_whose_send_meets_the_reset_reads_what_came_before_it(wire: Wire) -> None:
    peer, other = connected(wire)
    write(wire, other, b"frame")
    wire.kernel.abort(other)
    assert peer.send(PeerSend("P1", b"too late"), wire.now) == ""
    assert peer.is_in("reset") and peer.has_received(b"frame")


def test_a_stalled_peer_whose_send_meets_the_reset_reads_nothing(wire: Wire) -> None:
    peer, other = connected(wire)
    peer.stall()
    wire.step()
    write(wire, other, b"frame")
    wire.kernel.abort(other)
    peer.send(PeerSend("P1", b"too late"), wire.now)
    assert peer.is_in("reset") and not peer.has_received(b"frame")


def called(wire: Wire) -> tuple[Peer, Handle]:
    """Return an active peer that has not asked yet how its call has ended, and the other end."""
    listener = wire.listener()
    peer = wire.peer("P1", True, "@C1")
    with patch.object(wire.kernel, "connect_result", lambda _: WOULD_BLOCK):
        assert peer.connect(wire.now) == ""
    got = wire.kernel.accept(listener)
    assert isinstance(got, NewClient)
    return peer, got.handle
