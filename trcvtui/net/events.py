"""Events of connections, as frozen values; the ledger records them."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

from msgspec import Struct

from trcvtui.net.results import Fault


class EventKind(StrEnum):
    LISTENING = "listening"
    CONNECTING = "connecting"
    CONNECTED = "connected"
    ATTEMPT_FAILED = "attempt failed"
    ACCEPT_FAILED = "accept failed"
    PARTNER_CLOSED = "partner closed"
    LOST = "lost"
    DISCONNECTED = "disconnected"
    RESET = "reset"
    STOPPED = "stopped"
    CALL_FAILED = "call failed"
    WRONG_PARTNER = "wrong partner reset"
    SECOND_CLIENT = "second client reset"
    REPLACED = "replaced by a second client"
    OPTION_REFUSED = "option refused"
    OPTION_LIMITED = "option limited"
    RELEASED = "released"
    TPDUS_WAIT = "TPDUs wait"  # this and the next four: there is more to do than one scan may (ScanBudget)
    RECORDS_WAIT = "TLS records wait"
    CLIENTS_WAIT = "clients wait"
    HANDSHAKES_WAIT = "handshakes wait"
    LONG_HANDSHAKE = "a handshake is long"


class ConnectionChanged(Struct, frozen=True):
    """Something happened on the CONNECT `connection`. `incarnation` counts its TCP connections from 1."""

    connection: str
    incarnation: int
    what: EventKind
    local: str = ""
    peer: str = ""
    fault: Fault | None = None
    detail: str = ""


class BytesReceived(NamedTuple):
    """One recv call read `size` bytes, at `offset` of the incarnation's received stream.

    `instance` received the bytes. `instance` can change from event to event (resources.py,
    DirectionClaims). `position` is the first byte's position in the CONNECT's ring (received_ring.py).
    `cut` is how many bytes of a datagram had no room in the buffer.
    """

    connection: str
    incarnation: int
    recv: int
    offset: int
    size: int
    instance: str = ""
    position: int = 0
    cut: int = 0


class BytesSent(NamedTuple):
    """One send call gave `size` bytes of `instance` to the local stack. `offset` is in the sent stream.

    `position` is the first byte's position in the CONNECT's ring of sent bytes.
    """

    connection: str
    incarnation: int
    send: int
    offset: int
    size: int
    instance: str = ""
    position: int = 0


class BytesDropped(Struct, frozen=True):
    """Bytes of the stream that will never reach DATA, and why.

    If `offset` is -1, the bytes were still in the stack. `position` is where the ring has the first byte.
    """

    connection: str
    incarnation: int
    offset: int
    size: int
    reason: str
    position: int = -1


ConnectionEvent = ConnectionChanged | BytesReceived | BytesSent | BytesDropped
