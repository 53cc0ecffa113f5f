"""The frozen picture of one CONNECT."""

from __future__ import annotations

from trcvtui.net.connection.connection import Connection, State
from trcvtui.plc.snapshot import ConnectionSnapshot


def connection_snapshot(connection: Connection, now: int) -> ConnectionSnapshot:
    """Return a CONNECT as it stands at `now` (ns)."""
    loss = connection.last_loss
    retry = connection.retry_at
    connected = connection.state is State.CONNECTED
    return ConnectionSnapshot(
        name=connection.config.name,
        active=connection.config.active,
        state=str(connection.state),
        local=str(connection.local or ""),
        remote=str((connection.peer if connected else connection.set_up.remote) or ""),
        incarnation=connection.incarnation,
        since_scan=connection.since_scan,
        bytes_received=connection.bytes_received,
        attempts=connection.attempts,
        retry_in_ns=max(0, retry - now) if retry is not None else None,
        last_loss=loss.kind.name.lower().replace("_", " ") if loss else "",
        bytes_sent=connection.bytes_sent,
        unacknowledged=connection.unacknowledged() if connection.bytes_sent else 0,
        receivers=connection.receiving.owners(),
        senders=connection.sending.owners(),
        keep_alive_s=connection.config.keep_alive_s,
        udp=connection.config.is_datagram,
    )
