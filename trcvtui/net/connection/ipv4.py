"""What a dotted IPv4 address says by itself: its octets and its kind."""

from __future__ import annotations

import errno

from trcvtui.net.results import Endpoint


def octets(address: str) -> tuple[int, ...] | None:
    """Return the four octets, None for any other text (short forms such as `127.1` are refused too)."""
    parts = address.split(".")
    if len(parts) != 4 or not all(p.isascii() and p.isdigit() and len(p) <= 3 for p in parts):
        return None
    numbers = tuple(int(part) for part in parts)
    return numbers if max(numbers) < 256 else None


def is_loopback(address: str) -> bool:
    """Return whether it lies in 127.0.0.0/8."""
    return address.startswith("127.")


def is_group(address: str) -> bool:
    """Return whether it is multicast (224 to 239) or the broadcast address: no single machine."""
    parts = octets(address)
    return parts is not None and (224 <= parts[0] <= 239 or parts == (255, 255, 255, 255))


def broadcast_of(address: str, mask: str) -> str:
    """Return the last address of a network; "" where it has but two or one (RFC 3021)."""
    parts, bits = octets(address), octets(mask)
    if parts is None or bits is None or bits >= (255, 255, 255, 254):
        return ""
    return ".".join(str(part | ~bit & 255) for part, bit in zip(parts, bits, strict=True))


def pair(end: Endpoint) -> tuple[str, int]:
    """Return what the socket module takes; four octets only, so that no text reaches the resolver."""
    if octets(end.address) is None:
        raise OSError(errno.EINVAL, "not a dotted IPv4 address")
    if not 0 <= end.port < 65536:
        raise OSError(errno.EINVAL, "not a port")
    return end.address, end.port
