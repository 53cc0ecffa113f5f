"""The frozen pictures of the UDP side: a UDP_CONFIG as a connection's picture, and the ADDR records."""

from __future__ import annotations

from collections.abc import Iterable

from trcvtui.net.connection.udp_config import RemoteAddress
from trcvtui.net.connection.udp_port import UdpPort
from trcvtui.plc.snapshot import AddrSnapshot, ConnectionSnapshot


def port_snapshot(port: UdpPort, now: int) -> ConnectionSnapshot:
    """Return a UDP_CONFIG: `created` is its ready state, `remote` the other end of the last datagram."""
    waiting = port.retry_at is not None
    return ConnectionSnapshot(
        name=port.config.name,
        active=False,
        state="created" if port.is_open else "establishing" if waiting else "closed",
        local=str(port.local or ""),
        remote=str(port.peer or ""),
        incarnation=port.incarnation,
        since_scan=port.since_scan,
        bytes_received=port.bytes_received,
        attempts=port.attempts,
        retry_in_ns=max(0, port.retry_at - now) if port.retry_at is not None else None,
        last_loss="",
        bytes_sent=port.bytes_sent,
        receivers=port.receiving.owners(),
        senders=port.sending.owners(),
        udp=True,
    )


def addr_snapshots(addrs: Iterable[RemoteAddress]) -> tuple[AddrSnapshot, ...]:
    """Return the ADDR records as they stand now."""
    return tuple([AddrSnapshot(addr.name, str(addr), addr.generation) for addr in addrs])
