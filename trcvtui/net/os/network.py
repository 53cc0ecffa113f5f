"""The network of this machine: addresses, resolver, and a network namespace for this process."""

from __future__ import annotations

import ctypes
import errno
import functools
import os
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from trcvtui.net.kernel import LocalAddress
from trcvtui.net.os.system_calls import error_name
from trcvtui.net.results import ANY_ADDRESS, WOULD_BLOCK, Fault, WouldBlock, broadcast_address, parse_octets

# -- a network of our own, without privileges: a user and a network namespace of Linux ---------------------
#
# All packets in it cross `lo`, whatever their address: with `lo` down every wire in it is really cut.
# A process is in one network at a time, so this state belongs to the process; enter before a thread starts.

with suppress(ImportError):  # Windows
    import fcntl

LOOPBACK_INTERFACE: Final = "lo"
ETHERNET: Final = "plc0"  # a bridge without ports: the Ethernet port that carries the PLC's own addresses
CLONE_NEWUSER: Final = 0x10000000
CLONE_NEWNET: Final = 0x40000000
SIOCSIFFLAGS: Final = 0x8914
SIOCSIFADDR: Final = 0x8916
SIOCSIFNETMASK: Final = 0x891C
SIOCBRADDBR: Final = 0x89A0
IFF_UP: Final = 1
NAME_BYTES: Final = 16
IFREQ_FORMAT: Final = "16s24s"  # struct ifreq: a name and a union
SOCKADDR_FORMAT: Final = "=H2x4s8x"  # struct sockaddr_in

_own_user = False  # this process has a user namespace of its own
_own_network = False


def has_own_network() -> bool:
    """Return whether this process has its own network. There `set_loopback` affects nothing else."""
    return _own_network


def enter_namespace(addresses: Sequence[str] = (), not_ethernet: Sequence[str] = ()) -> str:
    """Move this process into a new network with these addresses; return what is wrong, or ""."""
    if sys.platform != "linux":
        return "a system without network namespaces"
    error = _unshare()
    if error:
        return f"a system that refuses a namespace ({error})"
    try:
        _set_interface_up(LOOPBACK_INTERFACE, up=True)
        if addresses:
            _make_bridge(ETHERNET)
        for number, address in enumerate(addresses):
            _add_address(f"{ETHERNET}:{number}" if number else ETHERNET, address, "255.255.255.0")
        for number, address in enumerate(not_ethernet):
            # On loopback a wider mask would make every address of the subnet local.
            _add_address(f"{LOOPBACK_INTERFACE}:{number}", address, "255.255.255.255")
    except OSError as problem:
        return f"a system that refuses interfaces in a namespace ({_errno_name(problem.errno)})"
    return ""


def set_loopback(up: bool) -> str:
    """Set `lo` of this process's own network up or down; return what is wrong, or ""."""
    if not _own_network:  # never the `lo` of the machine
        return "this is no network of its own"
    try:
        _set_interface_up(LOOPBACK_INTERFACE, up)
    except OSError as problem:
        return f"interface {LOOPBACK_INTERFACE}: {_errno_name(problem.errno)}"
    return ""


def _unshare() -> str:
    """Move to a new, empty network; return "" or the errno of the system's refusal."""
    global _own_user, _own_network
    unshare = ctypes.CDLL(None, use_errno=True).unshare
    outside = os.getuid(), os.getgid()
    if not _own_user and unshare(CLONE_NEWUSER | CLONE_NEWNET) == 0:
        _own_user = _own_network = True
        _map_ids(*outside)
        return ""
    if unshare(CLONE_NEWNET) == 0:  # a second time; or as root, if user namespaces are switched off
        _own_network = True
        return ""
    return _errno_name(ctypes.get_errno())


def _map_ids(user: int, group: int) -> None:
    """Become root in this namespace: child programs keep the rights, and files stay the user's."""
    with suppress(OSError):  # this process has the rights also without a map: only its programs need one
        Path("/proc/self/setgroups").write_text("deny")  # required before gid_map: user_namespaces(7)
        Path("/proc/self/uid_map").write_text(f"0 {user} 1")
        Path("/proc/self/gid_map").write_text(f"0 {group} 1")


def _set_interface_up(interface: str, up: bool) -> None:
    _interface_ioctl(SIOCSIFFLAGS, interface, struct.pack("h", IFF_UP if up else 0))


def _make_bridge(name: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        fcntl.ioctl(sock, SIOCBRADDBR, name.encode().ljust(NAME_BYTES, b"\0"))


def _add_address(label: str, address: str, mask: str) -> None:
    for request, what in ((SIOCSIFADDR, address), (SIOCSIFNETMASK, mask)):
        _interface_ioctl(request, label, struct.pack(SOCKADDR_FORMAT, socket.AF_INET, socket.inet_aton(what)))
    _set_interface_up(label.partition(":")[0], up=True)


def _interface_ioctl(request: int, interface: str, union: bytes) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        fcntl.ioctl(sock, request, struct.pack(IFREQ_FORMAT, interface.encode(), union))


def _errno_name(number: int | None) -> str:
    return errno.errorcode.get(number or 0, str(number))


# -- names: the system's own resolver, called in a separate process, so that no scan waits for it ----------
#
# Rule 1: the system decides how a name is resolved (hosts file, DNS, ...): nothing here speaks DNS.
# Rule 2: at most MOST_QUESTIONS processes run at a time; one whose answer is not needed any more is ended.

MOST_QUESTIONS: Final = 8
LONGEST_ANSWER: Final = 64  # bytes
NAME_UNKNOWN: Final = "EAI_NONAME"
# Prints an address or why there is none. An unknown name and a name server that does not answer are both
# EAI_NONAME, as on the simulated network: the difference is this machine's, not the partner's. The name is
# tried without its last dot, too: so it is in a hosts file.
RESOLVER_PROGRAM: Final = """
import socket, sys
said = "EAI_NONAME"
for name in (sys.argv[1], sys.argv[1].rstrip(".")):
    try:
        said = socket.getaddrinfo(name, None, socket.AF_INET, socket.SOCK_STREAM)[0][4][0]
        break
    except (OSError, UnicodeError):
        pass
print(said)
"""


class NameResolver:
    def __init__(self) -> None:
        self._processes: dict[int, subprocess.Popen[bytes]] = {}  # by the handle that needs the address

    def ask(self, handle: int, name: str) -> str | WouldBlock | Fault:
        """Return the address of a name, WOULD_BLOCK while there is no answer, else a Fault."""
        program = self._processes.get(handle)
        if program is None:
            return self._start_process(handle, name)
        if program.poll() is None:
            return WOULD_BLOCK
        assert program.stdout is not None
        answer = program.stdout.read(LONGEST_ANSWER).decode("ascii", "replace").strip()
        self.forget(handle)
        if parse_octets(answer) is not None:
            return answer
        return Fault("resolve", NAME_UNKNOWN)

    def _start_process(self, handle: int, name: str) -> WouldBlock | Fault:
        if len(self._processes) < MOST_QUESTIONS:  # Rule 2; beyond it the next call tries again
            words = [sys.executable, "-I", "-S", "-c", RESOLVER_PROGRAM, name]
            null = subprocess.DEVNULL
            try:
                process = subprocess.Popen(words, stdin=null, stdout=subprocess.PIPE, stderr=null)
            except OSError as problem:
                return Fault("resolve", error_name(problem))
            except ValueError:  # a NUL in the name
                return Fault("resolve", NAME_UNKNOWN)
            self._processes[handle] = process
        return WOULD_BLOCK

    def forget(self, handle: int) -> None:
        program = self._processes.pop(handle, None)
        if program is not None:
            program.kill()
            program.wait()
            assert program.stdout is not None
            program.stdout.close()


ARPHRD_ETHER: Final = 1  # also veth, bridge, macvlan, VLAN and WLAN; tun is 65534, loopback 772
IFF_BROADCAST: Final = 0x2
IFF_LOOPBACK: Final = 0x8
IFF_POINTOPOINT: Final = 0x10
LOOPBACK_ONLY: Final = (
    LocalAddress("127.0.0.1", "lo", ethernet=False, loopback=True, broadcast="127.255.255.255"),
)


class _IfAddrs(ctypes.Structure):
    """The first fields of `struct ifaddrs`, the same on Linux and the BSDs. No other fields are read.

    `broadcast` is the broadcast address. For a point-to-point interface it is the partner's address.
    """


_IfAddrs._fields_ = [
    ("next", ctypes.POINTER(_IfAddrs)),
    ("name", ctypes.c_char_p),
    ("flags", ctypes.c_uint),
    ("address", ctypes.c_void_p),
    ("netmask", ctypes.c_void_p),
    ("broadcast", ctypes.c_void_p),
]


@functools.cache
def _c_library() -> ctypes.CDLL | None:
    """Return the loaded C library, or None if it has no getifaddrs."""
    # CDLL(None), once: a bind asks in the middle of a scan, and ctypes.util.find_library starts a process.
    try:
        library = ctypes.CDLL(None)
        return library if library.getifaddrs and library.freeifaddrs else None
    except (OSError, AttributeError, TypeError):  # Windows has no such call, and no library without a name
        return None


def interface_addresses() -> tuple[LocalAddress, ...] | None:
    """Return every IPv4 address with its interface, or None if the system cannot list them now (EMFILE).

    Without getifaddrs, return (). If no interface has an address, return 127.0.0.1 only.
    """
    library = _c_library()
    if library is None:
        return ()
    head = ctypes.POINTER(_IfAddrs)()
    if library.getifaddrs(ctypes.byref(head)) != 0:
        return None
    try:
        return tuple(_iter_addresses(head)) or LOOPBACK_ONLY
    finally:
        library.freeifaddrs(head)


def _iter_addresses(entry: ctypes._Pointer[_IfAddrs]) -> Iterator[LocalAddress]:
    while entry:
        item = entry.contents
        address = _read_ipv4(item.address)
        if address is not None:
            name, loopback = item.name.decode(errors="replace"), bool(item.flags & IFF_LOOPBACK)
            broadcast = _broadcast_address(address, item)
            yield LocalAddress(address, name, _is_ethernet(name, item.flags), loopback, broadcast)
        entry = item.next


def _broadcast_address(address: str, item: _IfAddrs) -> str:
    found = _read_ipv4(item.broadcast) if item.flags & IFF_BROADCAST else None
    if found in (None, ANY_ADDRESS, address):  # glibc returns the own address if none was set (`ip addr add`)
        found = broadcast_address(address, _read_ipv4(item.netmask) or "")
    return "" if found == address else found


def _read_ipv4(address: int | None) -> str | None:
    """Return the address in a `struct sockaddr` as dotted text, or None if it is not IPv4."""
    if not address:
        return None
    head = ctypes.string_at(address, 2)
    # Linux begins with a 16-bit family, the BSDs with a length byte and an 8-bit family.
    family = int.from_bytes(head, sys.byteorder) if sys.platform.startswith("linux") else head[1]
    if family != socket.AF_INET:
        return None
    return ".".join(str(octet) for octet in ctypes.string_at(address + 4, 4))


def _is_ethernet(interface: str, flags: int) -> bool:
    device = interface.partition(":")[0]  # eth0:1 is a label of eth0
    try:
        return int(Path("/sys/class/net", device, "type").read_text()) == ARPHRD_ETHER
    except (OSError, ValueError):  # no sysfs (not Linux): a guess by the flags
        return not flags & (IFF_LOOPBACK | IFF_POINTOPOINT)
