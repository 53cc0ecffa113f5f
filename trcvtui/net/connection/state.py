"""Where a connection stands."""

from __future__ import annotations

from enum import StrEnum


class State(StrEnum):
    """Where the connection stands."""

    CLOSED = "closed"
    QUEUED = "queued"
    CREATED = "created"
    ESTABLISHING = "establishing"
    CONNECTED = "connected"
