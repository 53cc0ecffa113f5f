"""UDP_CONFIG and ADDR_PARAM: where a PLC receives datagrams, whom it sends them to (baosky.md section 6)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from trcvtui.net.connection.config import ANY_ADDRESS, ANY_END
from trcvtui.net.connection.description import ADDRESSES, Description, Value, pack
from trcvtui.net.results import Endpoint, Fault

TADDR_PARAM: Final = ADDRESSES["TADDR_Param"]


@dataclass(frozen=True, slots=True)
class UdpConfig:
    """One UDP_CONFIG. LocalPort 0 takes a free port and keeps it until STOP."""

    name: str
    local: Endpoint = ANY_END


@dataclass(frozen=True, slots=True)
class AddrParam:
    """One ADDR_PARAM as it stands in the file; `@NAME` for RemotePort, resolved at each send.

    `description`: the bytes of a TADDR_Param, or of what stands there instead; None: only an end is given.
    """

    name: str
    remote_address: str = ANY_ADDRESS
    remote_port: int | str = 0
    description: Description | None = None

    @property
    def written(self) -> Description:
        """Return it as the TADDR_Param that it stands for."""
        if self.description is not None:
            return self.description
        port = self.remote_port if isinstance(self.remote_port, int) else 0
        values: dict[str, Value] = {"rem_ip_addr": self.remote_address, "rem_port_nr": port}
        return Description(TADDR_PARAM, pack(TADDR_PARAM, values))


class RemoteAddress:
    """One ADDR_PARAM at work: USEND_C reads it, URECV_C writes the source of a datagram into it.

    `generation` counts the writes.
    """

    def __init__(self, param: AddrParam) -> None:
        self.name = param.name
        self.description = param.description  # as it was declared: its structure and its length
        self.address = param.remote_address
        self.port = param.remote_port
        self.generation = 0

    def take(self, source: Endpoint) -> None:
        """Become the source of a datagram."""
        if (self.address, self.port) != (source.address, source.port):
            self.address, self.port = source.address, source.port
            self.generation += 1

    def target(self, resolve: Callable[[str], int | None]) -> Endpoint | Fault:
        """Return where a datagram goes; `resolve` says where `@NAME` listens now."""
        port = resolve(self.port) if isinstance(self.port, str) else self.port
        if port is None:
            return Fault("resolve", f"{self.port} does not listen")
        if self.address == ANY_ADDRESS:  # 0.0.0.0 would silently mean loopback
            return Fault("address", f"{self.address} is no address to send to")
        return Endpoint(self.address, port)

    def __str__(self) -> str:
        """Return `127.0.0.1:2000`, or `127.0.0.1:@P1` as long as the file's name stands there."""
        return f"{self.address}:{self.port}"
