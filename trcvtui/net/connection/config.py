"""Configurations: TCP_CONNECTCONFIG, UDP_CONFIG, ADDR_PARAM, and a dialect's policy.

This module imports no kernel: so a dialect's table of answers needs no kernel either.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from msgspec import Struct

from trcvtui.net.connection.description import ADDRESSES, Description, FieldValue, pack
from trcvtui.net.connection.description_check import DescriptionFlaw
from trcvtui.net.layer import LayerSettings
from trcvtui.net.received_ring import DEFAULT_HISTORY
from trcvtui.net.results import ANY_ADDRESS, Endpoint, Fault, parse_octets

SYSTEM_KEEP_ALIVE_S: Final = 10  # KeepAliveTimeInterval = 0 means the system setting, 10 s


class ConnectionPolicy(Struct, frozen=True):
    """What a dialect decides about connections; times in ns."""

    retry_ns: int = 1_000_000_000
    pauses_after_idle: bool = False  # an active end waits retry_ns if its connection ended before any byte
    attempt_limit_ns: int = 5_000_000_000
    strict_local_address: bool = False
    listens_at_once: bool = False  # it listens already in the scan that begins the set-up
    check_remote_ip: bool = True
    check_remote_port: bool = False
    second_client: str = "reject"
    backlog: int = 128  # clients that the listener's queue holds
    small_buffers: bool = False
    tpdu_default: int = 1024  # bytes of a DT to a partner of ISO-on-TCP that names no size
    narrow_tsaps: bool = False  # as an S7-1200: E0 or E1 with 00 or 01 after it, then ASCII
    keep_alive_s: int = SYSTEM_KEEP_ALIVE_S
    broadcasts: bool = False  # UDP broadcasts are sent and received: the manual has them
    user_timeout: bool = True  # sent bytes without an acknowledgement for 3 intervals end the connection


ANY_END: Final = Endpoint(ANY_ADDRESS, 0)
LONGEST_KEEP_ALIVE_S: Final = 32767  # what a stack takes (Linux, MAX_TCP_KEEPIDLE); a UINT can ask for more


class ConnectConfig(Struct, frozen=True):
    """One CONNECT. Addresses are dotted IPv4 text. Ports are 0..65535. RemotePort may be `@NAME`.

    `description` has the bytes as an engineer wrote them. `flaw` is the flaw that a CPU finds in the bytes.
    `remote_name` is resolved at each attempt. If `remote_name` is "", `remote_address` is used.
    With `any_local`, the system's routing chooses the local address of an active end.
    With `is_datagram` (UDP), an ADDR has the partner of each datagram.
    At most `history` bytes are stored in each direction.
    """

    name: str
    active: bool = False
    local: Endpoint = ANY_END
    remote_address: str = ANY_ADDRESS
    remote_port: int | str = 0
    send_delay_opt: bool = False
    keep_alive_interval_s: int = 0
    keep_alive_default_s: int = SYSTEM_KEEP_ALIVE_S
    session: LayerSettings | None = None
    description: Description | None = None
    flaw: DescriptionFlaw | None = None
    any_local: bool = False
    remote_name: str = ""
    is_datagram: bool = False
    history: int = DEFAULT_HISTORY

    @property
    def is_message_oriented(self) -> bool:
        """Return whether each job takes one whole message of the partner, not bytes of a stream."""
        return self.is_datagram or (self.session is not None and self.session.is_message_oriented)

    @property
    def keep_alive_s(self) -> int:
        return min(self.keep_alive_interval_s or self.keep_alive_default_s, LONGEST_KEEP_ALIVE_S)

    @property
    def keep_alive_limit_note(self) -> str:
        """Return a text if the interval in force is not the configured one, else ""."""
        if self.keep_alive_interval_s <= self.keep_alive_s:
            return ""
        asked, taken = self.keep_alive_interval_s, self.keep_alive_s
        return f"KeepAliveTimeInterval {asked} s: {taken} s is in force, the most that the stack takes"

    @property
    def dead_after_ms(self) -> int:
        """Return the milliseconds of silence after which the link is dead: 3 intervals (manual 7.15.4)."""
        return 3000 * self.keep_alive_s


def parse_address(text: str) -> str | None:
    """Return the address if it is exactly four octets 0..255, else None; never ask a resolver."""
    numbers = parse_octets(text)
    return ".".join(map(str, numbers)) if numbers is not None else None


TADDR_PARAM: Final = ADDRESSES["TADDR_Param"]


class UdpConfig(Struct, frozen=True):
    """One UDP_CONFIG. With LocalPort 0 the socket takes a free port, and keeps the port until STOP."""

    name: str
    local: Endpoint = ANY_END
    history: int = DEFAULT_HISTORY


class AddrParam(Struct, frozen=True):
    """One ADDR_PARAM as it is in the file. A RemotePort `@NAME` is resolved at each send.

    `description` has the bytes of a structure such as TADDR_Param, or None for only address and port.
    """

    name: str
    remote_address: str = ANY_ADDRESS
    remote_port: int | str = 0
    description: Description | None = None

    @property
    def effective_description(self) -> Description:
        if self.description is not None:
            return self.description
        port = self.remote_port if isinstance(self.remote_port, int) else 0
        values: dict[str, FieldValue] = {"rem_ip_addr": self.remote_address, "rem_port_nr": port}
        return Description(TADDR_PARAM, pack(TADDR_PARAM, values))


class RemoteAddress:
    """One ADDR_PARAM at run time: USEND_C reads it, URECV_C writes the source of a datagram into it.

    `generation` counts the changes of the address or port.
    """

    def __init__(self, param: AddrParam) -> None:
        self.name = param.name
        self.description = param.description  # as it was declared: its structure and its length
        self.address = param.remote_address
        self.port = param.remote_port
        self.generation = 0

    def set_end(self, source: Endpoint) -> None:
        if (self.address, self.port) != (source.address, source.port):
            self.address, self.port = source.address, source.port
            self.generation += 1

    def resolve_target(self, resolve: Callable[[str], int | None]) -> Endpoint | Fault:
        """Return where a datagram goes. `resolve` returns the port where `@NAME` listens now."""
        port = resolve(self.port) if isinstance(self.port, str) else self.port
        if port is None:
            return Fault("resolve", f"{self.port} does not listen")
        if self.address == ANY_ADDRESS:  # 0.0.0.0 would silently mean loopback
            return Fault("address", f"{self.address} is no address to send to")
        return Endpoint(self.address, port)

    def __str__(self) -> str:
        """Return `127.0.0.1:2000`, or `127.0.0.1:@P1` if RemotePort is still a name."""
        return f"{self.address}:{self.port}"
