"""Answers of kernel calls: WOULD_BLOCK, Fault, Datagram; and an Endpoint with its IPv4 address."""

from __future__ import annotations

import errno
from dataclasses import dataclass, field
from enum import Enum
from typing import Final, NamedTuple

from msgspec import Struct


class WouldBlock(Enum):
    """The answer "not now": there is nothing to read, no room to write, or no result yet.

    HELD_BACK means that bytes may be unread, but this scan's work budget is used up (ScanBudget).
    """

    WOULD_BLOCK = "WOULD_BLOCK"
    HELD_BACK = "HELD_BACK"

    __hash__ = object.__hash__  # Enum's own is slow Python code, and a recorder calls it in each scan


ANY_ADDRESS: Final = "0.0.0.0"
WOULD_BLOCK: Final = WouldBlock.WOULD_BLOCK
HELD_BACK: Final = WouldBlock.HELD_BACK
OWN_END: Final = "own end"  # in place of an errno: in the capture that is played, the PLC's end closed it


@dataclass(frozen=True, slots=True)
class Fault:
    """A failed call with its errno name. `injected` marks a planned fault. `words` are the system's own.

    `peer` is the partner of the failed call, if the caller does not know the partner.
    """

    call: str
    error: str
    injected: bool = False
    words: str = field(default="", compare=False)
    peer: str = field(default="", compare=False)

    def __str__(self) -> str:
        """Return a text such as `bind EADDRINUSE`. ` (injected)` follows for a Fault of a fault plan."""
        return f"{self.call} {self.error}" + (" (injected)" if self.injected else "")


class Endpoint(Struct, frozen=True, order=True):
    """One end of a connection, or of a datagram: a dotted IPv4 address and a port (0..65535)."""

    address: str
    port: int

    def __str__(self) -> str:
        return f"{self.address}:{self.port}"


class Datagram(Struct, frozen=True):
    """A received datagram of `whole` bytes. The first `size` of these bytes are in the caller's buffer."""

    size: int
    source: Endpoint
    whole: int

    @property
    def is_cut(self) -> bool:
        """Return whether the caller's buffer was too small, so that the rest is lost."""
        return self.size < self.whole


def parse_octets(address: str) -> tuple[int, ...] | None:
    """Return the four octets. Return None for any other text, and for short forms such as `127.1`."""
    parts = address.split(".")
    if len(parts) != 4 or not all(p.isascii() and p.isdigit() and len(p) <= 3 for p in parts):
        return None
    numbers = tuple(int(part) for part in parts)
    return numbers if max(numbers) < 256 else None


def parse_end(text: str) -> tuple[bytes, int | None] | None:
    """Return address and port of `10.0.0.5`, `10.0.0.5:2000`, `fd00::1` or `[fd00::1]:2000`, or None."""
    from ipaddress import ip_address  # here, because a bench does not need it: only a capture and a tap do

    address, colon, port = text, "", ""
    if text.startswith("["):
        address, closed, rest = text[1:].partition("]")
        colon, port = rest[:1] if closed else "]", rest[1:]
    elif text.count(":") == 1:
        address, colon, port = text.partition(":")
    try:
        number = int(port) if colon else None
        if colon not in ("", ":") or not (number is None or (port.isascii() and 0 < number < 65536)):
            return None
        return ip_address(address).packed, number
    except ValueError:
        return None


def is_loopback(address: str) -> bool:
    return address.startswith("127.")  # 127.0.0.0/8


def is_group(address: str) -> bool:
    """Return whether an address stands for several machines: multicast (224 to 239) or 255.255.255.255."""
    parts = parse_octets(address)
    return parts is not None and (224 <= parts[0] <= 239 or parts == (255, 255, 255, 255))


def broadcast_address(address: str, mask: str) -> str:
    """Return the last address of a network, or "" if the network has only one or two addresses."""
    parts, bits = parse_octets(address), parse_octets(mask)
    if parts is None or bits is None or bits >= (255, 255, 255, 254):  # RFC 3021: a /31 has no broadcast
        return ""
    return ".".join(str(part | ~bit & 255) for part, bit in zip(parts, bits, strict=True))


def sockaddr(end: Endpoint) -> tuple[str, int]:
    """Return the address for the socket module; raise OSError EINVAL if address or port is invalid."""
    if parse_octets(end.address) is None:  # a name would make the socket module wait for the resolver
        raise OSError(errno.EINVAL, "not a dotted IPv4 address")
    if not 0 <= end.port < 65536:
        raise OSError(errno.EINVAL, "not a port")
    return end.address, end.port


PEEK_DEPTH: Final = 256 << 10  # bytes after the read position that are peeked; of the rest only the size


class WaitingMessage(NamedTuple):
    """An unread datagram or message. `whole` is its full length in bytes."""

    source: Endpoint
    data: bytes
    whole: int


class Unread(NamedTuple):
    """What is unread at a handle.

    `size` counts the unread bytes of a stream. `data` has the unread bytes of a stream from `skip` to
    PEEK_DEPTH. `end` is fin or rst, or "" while the poll has seen no end. If `is_full`, the partner may see
    a small window, or a session takes no more bytes. `messages` are the unread messages after the first
    `skip`, or None for a stream. `clients` is how many clients wait at a listener. The stack had no room
    for `dropped` datagrams. If `has_session` (TLS, ISO-on-TCP), the bytes on the wire differ from the data.
    """

    size: int = 0
    data: bytes = b""
    end: str = ""
    is_full: bool = False
    messages: tuple[WaitingMessage, ...] | None = None
    clients: int = 0
    dropped: int = 0
    has_session: bool = False
