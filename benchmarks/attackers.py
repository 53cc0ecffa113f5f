"""Partners who ask for more work than a scan has time for: a process for each attack, until it is killed.

`python attackers.py ATTACK PORT`; nothing here knows the house, so that nothing is paid twice.
"""

from __future__ import annotations

import itertools
import socket
import ssl
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Final

HOST: Final = "127.0.0.1"
# CR from E0 01 to E0 FF with TPDUs of 1024 bytes; DTs: empty and one byte without an end, one byte with it.
REQUEST: Final = bytes.fromhex("03000016 11e00000000100 c102e001 c202e0ff c0010a")
EMPTY: Final = bytes.fromhex("03000007 02f000")
ONE_BYTE: Final = bytes.fromhex("03000008 02f00078")
WHOLE: Final = bytes.fromhex("03000008 02f08078")
MANY: Final = 8192  # of them in one send
OPEN_AT_ONCE: Final = 400  # handshakes that stop
BURST: Final = 64  # clients that come together


def main(attack: str, port: int) -> None:
    """Attack until killed; what breaks is begun again."""
    act = ATTACKS[attack]
    while True:
        with suppress(OSError):
            act(port)


@contextmanager
def connected(port: int) -> Iterator[socket.socket]:
    """Return a connected socket, with RST at its end, so that no port is used up."""
    with socket.create_connection((HOST, port), 5) as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        yield sock


def tpdus(unit: bytes) -> Callable[[int], None]:
    """Return an attack that sends one kind of TPDU for ever."""

    def act(port: int) -> None:
        with connected(port) as sock:
            sock.sendall(REQUEST)
            sock.recv(64)
            while True:
                sock.sendall(unit * MANY)

    return act


def hello() -> bytes:
    """Return what a TLS client says first."""
    said = ssl.MemoryBIO()
    end = unverified().wrap_bio(ssl.MemoryBIO(), said)
    with suppress(ssl.SSLWantReadError):
        end.do_handshake()
    return said.read()


def unverified() -> ssl.SSLContext:
    """Return a context that believes everybody."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context


def dropped_handshakes(port: int) -> None:
    """Begin a handshake and go, as often as it goes."""
    first = hello()
    while True:
        with connected(port) as sock:
            sock.sendall(first)


def stopped_handshakes(port: int) -> None:
    """Begin many handshakes and say no more."""
    first = hello()
    held: list[socket.socket] = []
    while True:
        held.append(socket.create_connection((HOST, port), 5))
        held[-1].sendall(first)
        if len(held) > OPEN_AT_ONCE:
            held.pop(0).close()


def tiny_records(port: int) -> None:
    """Send records of one byte."""
    with connected(port) as sock, unverified().wrap_socket(sock) as end:
        while True:
            end.send(b"x")


def clients(port: int) -> None:
    """Come and go, many together."""
    while True:
        come = [socket.socket() for _ in range(BURST)]
        for sock in come:
            sock.setblocking(False)
            sock.connect_ex((HOST, port))
        for sock in come:
            sock.close()


def datagrams(port: int) -> None:
    """Send datagrams of one byte."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for _ in itertools.count():
            sock.sendto(b"x", (HOST, port))


ATTACKS: Final[dict[str, Callable[[int], None]]] = {
    "empty DTs": tpdus(EMPTY),
    "one-byte DTs": tpdus(ONE_BYTE),
    "one-byte messages": tpdus(WHOLE),
    "handshakes dropped": dropped_handshakes,
    "handshakes stopped": stopped_handshakes,
    "one-byte records": tiny_records,
    "clients": clients,
    "datagrams": datagrams,
}

if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
