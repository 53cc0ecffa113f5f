"""Makes host_captures.zip as root: real stacks in network namespaces, each with one fault.

`python -m tests.diagnosis.make_host_captures`; 40 s. What each capture should say stands in `EXPECTED`.
"""

from __future__ import annotations

import ctypes
import os
import socket
import subprocess
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from trcvtui.capture.pcap import ETHERNET, interface_block, packet_block, section_block

ZIP = Path(__file__).with_name("host_captures.zip")
EXPECTED = {
    "vain": "no-such-host", "udp": "refused", "half": "half-open", "half_new_port": "half-open",
    "probes": "dead-link", "mtu": "mtu", "prohibit": "filtered", "unreachable": "filtered",
    "double": "duplicate-ip", "healthy": "",
}  # fmt: skip
HOSTS = {"a": "10.9.0.5", "b": "10.9.0.9", "c": "10.9.0.20", "r": "10.9.0.1"}  # r: a router
NAMES = (*HOSTS, "s")  # s: the switch
CLONE_NEWNET = 0x40000000
TCP_REPAIR = 19  # a socket that is closed with it is gone without a packet, as that of a device that restarts


def run(words: str) -> None:
    subprocess.run(words.split(), check=True, capture_output=True)


def ip(host: str, words: str) -> None:
    run(f"ip -n trcv-{host} {words}")


def inside(host: str, make: Callable[[], socket.socket]) -> socket.socket:
    """Return a socket of a host."""
    made: list[socket.socket] = []

    def enter() -> None:
        with open(f"/var/run/netns/trcv-{host}") as space:
            assert ctypes.CDLL(None).setns(space.fileno(), CLONE_NEWNET) == 0
        made.append(make())

    thread = threading.Thread(target=enter)
    thread.start()
    thread.join()
    return made[0]


def stream(host: str = "a", port: int = 0) -> socket.socket:
    made = inside(host, lambda: socket.socket(socket.AF_INET, socket.SOCK_STREAM))
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    made.settimeout(4)
    made.bind((HOSTS[host], port))
    return made


@contextmanager
def captured(path: Path) -> Iterator[None]:
    """Write what the first host sends and gets."""
    tap = inside("a", lambda: socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(3)))
    tap.bind(("eth0", 0))
    tap.settimeout(0.1)
    found: list[tuple[int, bytes]] = []
    is_over = threading.Event()

    def read() -> None:
        while not is_over.is_set():
            with suppress(TimeoutError):
                found.append((time.time_ns(), tap.recv(65535)))

    thread = threading.Thread(target=read)
    thread.start()
    try:
        yield
        time.sleep(0.3)
    finally:
        is_over.set()
        thread.join()
    is_ipv6 = [data[12:14] == b"\x86\xdd" for _, data in found]
    blocks = [packet_block(0, ns, data) for (ns, data), six in zip(found, is_ipv6, strict=True) if not six]
    path.write_bytes(b"".join((section_block("tests"), interface_block(ETHERNET, "a"), *blocks)))


Ends = tuple[socket.socket, socket.socket]


def connected(listener: socket.socket, port: int = 0) -> Ends:
    caller = stream(port=port)
    caller.connect((HOSTS["b"], 2000))
    return caller, listener.accept()[0]


def listening() -> socket.socket:
    made = stream("b", 2000)
    made.listen()
    return made


def talk(ends: Ends) -> None:
    caller, other = ends
    for _ in range(6):
        caller.send(bytes(range(20)))
        other.recv(99)
        other.send(b"taken")
        caller.recv(99)
        time.sleep(0.2)


def vain() -> None:
    with suppress(OSError):
        stream().connect(("10.9.0.77", 2000))


def udp() -> None:
    said = inside("a", lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    for _ in range(5):
        said.sendto(bytes(20), (HOSTS["b"], 2500))
        time.sleep(0.5)


def half(port: int = 40001) -> None:
    listener = listening()
    old = connected(listener, port)
    talk(old)
    old[0].setsockopt(socket.IPPROTO_TCP, TCP_REPAIR, 1)
    old[0].close()
    time.sleep(2)
    new = connected(listener, port)
    talk(new)
    if not port:
        old[1].send(b"late")
        talk(new)


def probes() -> None:
    listener = listening()
    caller, _ = ends = connected(listener)
    talk(ends)
    caller.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in ((socket.TCP_KEEPIDLE, 1), (socket.TCP_KEEPINTVL, 1), (socket.TCP_KEEPCNT, 4)):
        caller.setsockopt(socket.IPPROTO_TCP, option, value)
    time.sleep(3.5)
    ip("b", "link set eth0 down")
    time.sleep(7)
    ip("b", "link set eth0 up")


def mtu() -> None:
    listener = listening()
    caller, _ = connected(listener)
    caller.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    caller.send(bytes(20))
    time.sleep(0.3)
    ip("b", "link set eth0 mtu 800")
    caller.send(bytes(1400))
    for _number in range(12):
        time.sleep(0.4)
        caller.send(bytes(30))
    ip("b", "link set eth0 mtu 1500")


def routed(kind: str) -> None:
    ip("r", f"route add {kind} 10.8.0.9/32")
    for _ in range(2):
        with suppress(OSError):
            stream().connect(("10.8.0.9", 2000))
        time.sleep(0.3)
    ip("r", f"route del {kind} 10.8.0.9/32")


def double() -> None:
    ip("c", "addr flush dev eth0")
    ip("c", f"addr add {HOSTS['b']}/24 dev eth0")
    for _ in range(3):
        ip("a", "neigh flush dev eth0")
        with suppress(OSError):
            stream().connect((HOSTS["b"], 2000))
        time.sleep(0.5)


def healthy() -> None:
    talk(connected(listening()))


WAYS: dict[str, Callable[[], None]] = {
    "vain": vain, "udp": udp, "half": half, "half_new_port": lambda: half(0), "probes": probes, "mtu": mtu,
    "prohibit": lambda: routed("prohibit"), "unreachable": lambda: routed("unreachable"), "double": double,
    "healthy": healthy,
}  # fmt: skip


def build() -> None:
    for name in NAMES:
        run(f"ip netns add trcv-{name}")
    ip("s", "link add br0 type bridge")
    ip("s", "link set br0 up")
    for name, address in HOSTS.items():
        run(f"ip link add p-{name} netns trcv-s type veth peer name eth0 netns trcv-{name}")
        ip("s", f"link set p-{name} master br0 up")
        ip(name, f"addr add {address}/24 dev eth0")
        ip(name, "link set eth0 up")
    ip("a", f"route add default via {HOSTS['r']}")
    run("ip netns exec trcv-r sysctl -w net.ipv4.ip_forward=1")


def remove() -> None:
    for name in NAMES:
        subprocess.run(["ip", "netns", "del", f"trcv-{name}"], capture_output=True)


def main() -> None:
    assert os.geteuid() == 0, "network namespaces want root"
    path = ZIP.with_suffix(".pcapng")
    with zipfile.ZipFile(ZIP, "w", zipfile.ZIP_DEFLATED) as made:
        for name, act in WAYS.items():
            remove()
            build()
            with captured(path):
                act()
            made.write(path, f"{name}.pcapng")
    remove()
    path.unlink()


if __name__ == "__main__":
    main()
