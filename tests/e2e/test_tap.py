"""The tap between plain sockets: ends as they are, back-pressure, refusals, where it listens."""

from __future__ import annotations

import json
import re
import select
import signal
import socket
from pathlib import Path

import pytest

from tests.e2e.tapping import PATIENCE, Tap, calling, end_of, exactly, joined, listening, reset, tapped

pytestmark = pytest.mark.live


def test_a_half_close_passes_and_the_other_direction_goes_on() -> None:
    with tapped() as (tap, near, far):
        near.sendall(b"question")
        near.shutdown(socket.SHUT_WR)
        assert (exactly(far, 8), end_of(far)) == (b"question", (0, "FIN"))
        far.sendall(b"answer")
        far.close()
        assert (exactly(near, 6), end_of(near)) == (b"answer", (0, "FIN"))
        near.close()
        assert tap.end() == (0, "", "")


def test_a_reset_shows_at_once_to_an_end_whose_fin_has_passed() -> None:
    with tapped() as (_, near, far):
        far.shutdown(socket.SHUT_WR)
        assert end_of(near) == (0, "FIN")
        reset(far)
        assert select.select((), (near,), (near,), PATIENCE)
        with pytest.raises(OSError, match=r"reset|pipe"):
            while True:
                near.sendall(b"x")


def test_a_refusal_shows_as_a_reset_after_the_accept() -> None:
    with socket.socket() as silent:  # it has the port, so nothing else listens there
        silent.bind(("127.0.0.1", 0))
        refused_by(silent.getsockname()[1])


def refused_by(port: int) -> None:
    with Tap(str(port)) as tap:
        try:
            near = calling(tap.port)
        except ConnectionResetError:  # the RST was there before the call returned
            return
        with near:
            assert end_of(near) == (0, "RST")


def test_an_end_that_reads_nothing_closes_the_window_of_the_other() -> None:
    with tapped() as (tap, near, far):
        near.setblocking(False)
        sent = 0
        while select.select((), (near,), (), 0.3)[1]:
            sent += near.send(bytes(1 << 16))
        assert sent < 64 << 20
        before = resident(tap.process.pid)
        assert len(exactly(far, sent)) == sent
        assert before < 64 << 20


def resident(pid: int) -> int:
    """Return the bytes of memory of a process."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except OSError:
        pytest.skip("a system without /proc")
    return pages * 4096


def test_urgent_data_arrives_as_ordinary_bytes() -> None:
    with tapped() as (_, near, far):
        near.sendall(b"ab")
        near.send(b"!", socket.MSG_OOB)
        near.sendall(b"cd")
        assert exactly(far, 5) == b"ab!cd"


def test_the_two_sides_may_speak_another_ip_each() -> None:
    try:
        door, port = listening(socket.AF_INET6)
    except OSError:
        pytest.skip("a system without IPv6")
    with door, Tap(f"[::1]:{port}") as tap:
        near, far = joined(door, tap.port)
        with near, far:
            near.sendall(b"six")
            assert exactly(far, 3) == b"six"


def test_datagrams_find_the_client_who_asked() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far:
        far.bind(("127.0.0.1", 0))
        far.settimeout(PATIENCE)
        with Tap(f"udp:{far.getsockname()[1]}", listen="udp:127.0.0.1:0") as tap:
            clients = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(3)]
            for n, client in enumerate(clients):
                client.settimeout(PATIENCE)
                client.sendto(bytes([n]) * n, ("127.0.0.1", tap.port))
                data, came_from = far.recvfrom(100)
                assert data == bytes([n]) * n
                far.sendto(b"answer %d" % n, came_from)
                assert client.recv(100) == b"answer %d" % n
                client.close()
            assert tap.end() == (0, "", "")


@pytest.mark.parametrize("descriptors", [40, 41])  # one is left in one of both: a client takes two
def test_clients_without_a_descriptor_are_told_and_reset_and_one_that_leaves_frees_its_place(
    descriptors: int,
) -> None:
    door, port = listening()
    with door, Tap(str(port), "--format", "jsonl", descriptors=descriptors) as tap:
        clients = [calling(tap.port) for _ in range(descriptors)]
        assert end_of(clients[-1]) == (0, "RST")
        alive = [near for near in clients if not select.select((near,), (), (), 0)[0]]
        assert alive == clients[: len(alive)]
        assert descriptors // 4 < len(alive) < descriptors // 2
        reached = [door.accept()[0] for _ in alive]
        alive[-1].sendall(b"here")
        assert exactly(reached[-1], 4) == b"here"
        for sock in (reached[0], alive[0]):
            sock.close()
        near, far = joined(door, tap.port)
        near.sendall(b"free")
        assert exactly(far, 4) == b"free"
        code, out, errors = tap.end()
        notes = [record for record in map(json.loads, out.splitlines()) if "waiting" in record]
        waiting = re.fullmatch(r"T: no descriptor left: (\d+) clients? waits?\n", errors)
        assert waiting is not None
        assert (code, notes[0]["tap"], notes[0]["waiting"]) == (0, "T", int(waiting[1]))
        for sock in (*clients, *reached, near, far):
            sock.close()


def test_datagrams_of_a_client_without_a_descriptor_are_told() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far:
        far.bind(("127.0.0.1", 0))
        with Tap(f"udp:{far.getsockname()[1]}", listen="udp:127.0.0.1:0", descriptors=20) as tap:
            clients = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(20)]
            for client in clients:
                client.sendto(b"x", ("127.0.0.1", tap.port))
                client.close()
            assert tap.process.stderr is not None
            line = tap.process.stderr.readline().decode()
            assert re.fullmatch(r"T: no descriptor was left: \d+ datagrams? refused\n", line)


def test_a_closed_terminal_cuts_nothing_and_the_first_line_says_what_ends_the_tap() -> None:
    with tapped("--format", "jsonl") as (tap, near, far):
        assert tap.said.endswith(f"; kill {tap.process.pid} ends the tap\n")
        tap.process.send_signal(signal.SIGHUP)
        for _ in range(2):
            near.sendall(b"on")
            assert exactly(far, 2) == b"on"
        assert tap.end()[0] == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_tap_that_is_ended_ends_both_sides_with_fin(number: int) -> None:
    with tapped() as (tap, near, far):
        near.sendall(b"last words")
        assert exactly(far, 10) == b"last words"
        assert tap.end(number) == (0, "", "")
        assert end_of(near) == end_of(far) == (0, "FIN")


def test_it_says_whether_other_machines_reach_it() -> None:
    with Tap("9", listen="0.0.0.0:0") as tap:
        assert tap.process.stderr is not None
        assert tap.process.stderr.readline().decode() == f"other machines reach 0.0.0.0:{tap.port}\n"
