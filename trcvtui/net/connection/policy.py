"""What a dialect decides about connections; apart, so that a table of answers needs no kernel."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Policy:
    """What a dialect decides about connections; times in ns."""

    retry_ns: int = 1_000_000_000
    pauses_behind_idle: bool = False  # an active end whose connection fell before a byte moved waits retry_ns
    attempt_limit_ns: int = 5_000_000_000
    strict_local_address: bool = False
    check_remote_ip: bool = True
    check_remote_port: bool = False
    second_client: str = "reject"
    backlog: int = 128  # clients that the listener's queue holds
    small_buffers: bool = False
    tpdu_default: int = 1024  # bytes of a DT to a partner of ISO-on-TCP who tells no size
    narrow_tsaps: bool = False  # as an S7-1200: E0 or E1 with 00 or 01 behind it, then ASCII
    user_timeout: bool = True  # sent bytes that nobody acknowledges for 3 intervals end the connection
