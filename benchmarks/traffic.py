"""The partners of a paced run, a process of their own: some send once a cycle, the others are silent.

And the project whose CONNECTs dial them: some of its many instances receive.
"""

from __future__ import annotations

import ctypes
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

SLACK = 29  # PR_SET_TIMERSLACK


def project(interval: str, ports: Sequence[int], instances: int, receiving: int, message: int) -> str:
    """Return the file; the instances share the CONNECTs in turn, the first `receiving` have EN_R."""
    parts = ['dialect = "baosky"', 'model = "T4"']
    if message > 65535:
        parts.append(f"[options]\nmax_len = {message}")
    parts.append(f'[[task]]\nname = "MAIN"\ninterval = "{interval}"')
    for number, port in enumerate(ports):
        parts.append(
            f'[[connect]]\nname = "C{number}"\nActiveEstablished = true\nLocalAddress = "127.0.0.1"\n'
            f'RemoteAddress = "127.0.0.1"\nRemotePort = {port}'
        )
    for number in range(instances):
        receives = "true" if number < receiving else "false"
        parts.append(
            f'[[data]]\nname = "rx{number}"\ntype = "ARRAY[1..{message}] OF BYTE"\n'
            f'[[instance]]\nname = "TRCV_C_{number}"\nblock = "TRCV_C"\nconnect = "C{number % len(ports)}"\n'
            f'data = "rx{number}"\nCONT = true\nEN_R = {receives}'
        )
    return "\n\n".join(parts) + "\n"


@contextmanager
def traffic(partners: int, senders: int, size: int, interval_ns: int) -> Iterator[list[int]]:
    """Let partners listen, and the first `senders` of them send `size` bytes a cycle; yield their ports."""
    numbers = [str(number) for number in (partners, senders, size, interval_ns)]
    process = subprocess.Popen([sys.executable, __file__, *numbers], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield [int(port) for port in process.stdout.readline().split()]
    finally:
        process.kill()
        process.wait()


def main(partners: int, senders: int, size: int, interval_ns: int) -> None:
    """Listen, say where, take everybody in, send until a connection breaks."""
    listeners = [socket.create_server(("127.0.0.1", 0)) for _ in range(partners)]
    print(*(listener.getsockname()[1] for listener in listeners), flush=True)
    connections = [listener.accept()[0] for listener in listeners]
    for connection in connections:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setblocking(False)
    _send_for_ever(connections[:senders], b"x" * size, interval_ns)


def _send_for_ever(connections: list[socket.socket], message: bytes, interval_ns: int) -> None:
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(SLACK, 1, 0, 0, 0)
    due = time.perf_counter_ns()
    while True:
        due = max(due + interval_ns, time.perf_counter_ns())
        time.sleep(max(0, due - time.perf_counter_ns()) / 1e9)
        for connection in connections:
            try:
                connection.send(message)
            except BlockingIOError:
                continue
            except OSError:
                return


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
