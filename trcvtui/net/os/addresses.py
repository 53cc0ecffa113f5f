"""The IPv4 addresses of this machine: getifaddrs of the C library, which also finds secondary addresses."""

from __future__ import annotations

import ctypes
import functools
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from trcvtui.net.connection.config import ANY_ADDRESS
from trcvtui.net.connection.ipv4 import broadcast_of
from trcvtui.net.kernel import LocalAddress

AF_INET: Final = 2  # the same number on Linux, macOS and Windows
ARPHRD_ETHER: Final = 1  # also veth, bridge, macvlan, VLAN and WLAN; tun is 65534, loopback 772
IFF_BROADCAST: Final = 0x2
IFF_LOOPBACK: Final = 0x8
IFF_POINTOPOINT: Final = 0x10
LOOPBACK_ONLY: Final = (
    LocalAddress("127.0.0.1", "lo", ethernet=False, loopback=True, broadcast="127.255.255.255"),
)


class _IfAddrs(ctypes.Structure):
    """The head of `struct ifaddrs`, which Linux and the BSDs share; the rest is not read.

    `everybody` is the broadcast address, of a point-to-point interface the partner's.
    """


_IfAddrs._fields_ = [
    ("next", ctypes.POINTER(_IfAddrs)),
    ("name", ctypes.c_char_p),
    ("flags", ctypes.c_uint),
    ("address", ctypes.c_void_p),
    ("netmask", ctypes.c_void_p),
    ("everybody", ctypes.c_void_p),
]


@functools.cache
def _library() -> ctypes.CDLL | None:
    """Return the C library that the process has already loaded, None where it has no getifaddrs.

    It is loaded once: a bind asks in the middle of a scan, and looking for the file would start a process.
    """
    try:
        library = ctypes.CDLL(None)
        return library if library.getifaddrs and library.freeifaddrs else None
    except (OSError, AttributeError, TypeError):  # Windows has no such call, and no library without a name
        return None


def interface_addresses() -> tuple[LocalAddress, ...] | None:
    """Return every IPv4 address with its interface, None when the system cannot say now (EMFILE).

    () on a system that has no getifaddrs: nobody can say. Only 127.0.0.1 where there is no address at all.
    """
    library = _library()
    if library is None:
        return ()
    head = ctypes.POINTER(_IfAddrs)()
    if library.getifaddrs(ctypes.byref(head)) != 0:
        return None
    try:
        return tuple(_entries(head)) or LOOPBACK_ONLY
    finally:
        library.freeifaddrs(head)


def _entries(entry: ctypes._Pointer[_IfAddrs]) -> Iterator[LocalAddress]:
    while entry:
        item = entry.contents
        address = _ipv4(item.address)
        if address is not None:
            name, loopback = item.name.decode(errors="replace"), bool(item.flags & IFF_LOOPBACK)
            everybody = _broadcast(address, item)
            yield LocalAddress(address, name, _is_ethernet(name, item.flags), loopback, everybody)
        entry = item.next


def _broadcast(address: str, item: _IfAddrs) -> str:
    """Return the broadcast address that the interface tells, else that of its network."""
    told = _ipv4(item.everybody) if item.flags & IFF_BROADCAST else None
    if told in (None, ANY_ADDRESS):
        told = broadcast_of(address, _ipv4(item.netmask) or "")
    return "" if told is None or told == address else told


def _ipv4(address: int | None) -> str | None:
    """Return the dotted text of a `struct sockaddr`, None when it is of another family."""
    if not address:
        return None
    head = ctypes.string_at(address, 2)
    # Linux begins with a 16-bit family, the BSDs with a length byte and an 8-bit family.
    family = int.from_bytes(head, sys.byteorder) if sys.platform.startswith("linux") else head[1]
    if family != AF_INET:
        return None
    return ".".join(str(octet) for octet in ctypes.string_at(address + 4, 4))


def _is_ethernet(interface: str, flags: int) -> bool:
    device = interface.partition(":")[0]  # eth0:1 is a label of eth0
    try:
        return int(Path("/sys/class/net", device, "type").read_text()) == ARPHRD_ETHER
    except (OSError, ValueError):
        return not flags & (IFF_LOOPBACK | IFF_POINTOPOINT)
