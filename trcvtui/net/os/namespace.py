"""A network of this process's own, without privileges: a user and a network namespace of Linux.

Everything in it crosses `lo`, whatever address it is for: with `lo` down every wire in it is cut for real. A
process is in one network at a time, so this state belongs to the process; enter before any thread starts.
"""

from __future__ import annotations

import ctypes
import errno
import os
import socket
import struct
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

with suppress(ImportError):  # Windows
    import fcntl

LOOPBACK: Final = "lo"
ETHERNET: Final = "plc0"  # a bridge without ports: the Ethernet port that carries the PLC's own addresses
CLONE_NEWUSER: Final = 0x10000000
CLONE_NEWNET: Final = 0x40000000
SIOCSIFFLAGS: Final = 0x8914
SIOCSIFADDR: Final = 0x8916
SIOCSIFNETMASK: Final = 0x891C
SIOCBRADDBR: Final = 0x89A0
IFF_UP: Final = 1
NAME_BYTES: Final = 16
REQUEST: Final = "16s24s"  # struct ifreq: a name and a union
SOCKET_ADDRESS: Final = "=H2x4s8x"  # struct sockaddr_in

_own_user = False  # this process has a user namespace of its own
_own_network = False


def is_own_network() -> bool:
    """Return whether this process has a network of its own, where `set_loopback` harms nobody."""
    return _own_network


def enter(addresses: Sequence[str] = (), not_ethernet: Sequence[str] = ()) -> str:
    """Move this process into a fresh network that has these addresses; return what is wrong, or ""."""
    if sys.platform != "linux":
        return "a system without network namespaces"
    error = _unshare()
    if error:
        return f"a system that refuses a namespace ({error})"
    try:
        _set_up(LOOPBACK, up=True)
        if addresses:
            _make_bridge(ETHERNET)
        for number, address in enumerate(addresses):
            _add_address(f"{ETHERNET}:{number}" if number else ETHERNET, address, "255.255.255.0")
        for number, address in enumerate(not_ethernet):
            # On loopback a wider mask would make the whole subnet local.
            _add_address(f"{LOOPBACK}:{number}", address, "255.255.255.255")
    except OSError as problem:
        return f"a system that refuses interfaces in a namespace ({_name(problem.errno)})"
    return ""


def set_loopback(up: bool) -> str:
    """Set `lo` of the own network up or down; return what is wrong, or ""."""
    if not _own_network:
        return "this is no network of its own"
    try:
        _set_up(LOOPBACK, up)
    except OSError as problem:
        return f"interface {LOOPBACK}: {_name(problem.errno)}"
    return ""


# -- namespaces -------------------------------------------------------------------------------------------


def _unshare() -> str:
    """Leave the present network for an empty one; return the errno of a refusal, or ""."""
    global _own_user, _own_network
    unshare = ctypes.CDLL(None, use_errno=True).unshare
    outside = os.getuid(), os.getgid()
    if not _own_user and unshare(CLONE_NEWUSER | CLONE_NEWNET) == 0:
        _own_user = _own_network = True
        _map_ids(*outside)
        return ""
    if unshare(CLONE_NEWNET) == 0:  # a second time, or root where user namespaces are switched off
        _own_network = True
        return ""
    return _name(ctypes.get_errno())


def _map_ids(user: int, group: int) -> None:
    """Be root in here, so that a program started from here keeps its rights; files stay the user's own."""
    with suppress(OSError):  # the rights are there without a map, as long as nothing is started
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"0 {user} 1")
        Path("/proc/self/gid_map").write_text(f"0 {group} 1")


# -- interfaces -------------------------------------------------------------------------------------------


def _set_up(interface: str, up: bool) -> None:
    _request(SIOCSIFFLAGS, interface, struct.pack("h", IFF_UP if up else 0))


def _make_bridge(name: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as door:
        fcntl.ioctl(door, SIOCBRADDBR, name.encode().ljust(NAME_BYTES, b"\0"))


def _add_address(label: str, address: str, mask: str) -> None:
    """Give an address to the interface whose name the label begins with."""
    for request, what in ((SIOCSIFADDR, address), (SIOCSIFNETMASK, mask)):
        _request(request, label, struct.pack(SOCKET_ADDRESS, socket.AF_INET, socket.inet_aton(what)))
    _set_up(label.partition(":")[0], up=True)


def _request(request: int, interface: str, union: bytes) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as door:
        fcntl.ioctl(door, request, struct.pack(REQUEST, interface.encode(), union))


def _name(number: int | None) -> str:
    return errno.errorcode.get(number or 0, str(number))
