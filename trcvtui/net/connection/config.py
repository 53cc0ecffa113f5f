"""TCP_CONNECTCONFIG: the record that says who connects to whom (baosky.md section 1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from trcvtui.net.connection.description import Description
from trcvtui.net.connection.description_check import Finding
from trcvtui.net.connection.ipv4 import octets
from trcvtui.net.layer import Settings
from trcvtui.net.results import Endpoint

ANY_ADDRESS: Final = "0.0.0.0"
ANY_END: Final = Endpoint(ANY_ADDRESS, 0)
SYSTEM_KEEP_ALIVE_S: Final = 10  # KeepAliveTimeInterval = 0 means the system setting, 10 s
LONGEST_KEEP_ALIVE_S: Final = 32767  # what a stack takes (Linux, MAX_TCP_KEEPIDLE); a UINT can ask for more


@dataclass(frozen=True, slots=True)
class ConnectConfig:
    """One CONNECT. Addresses are dotted IPv4 text; ports 0..65535, or `@NAME` for RemotePort.

    `description`: the bytes that an engineer has for it; `flaw`: what a CPU finds wrong with them.
    `remote_name`: the partner's name, asked for at each attempt; "": `remote_address` says where he is.
    `any_local`: the system's own routing gives an active end its local address.
    `is_datagram`: UDP; the partner of each datagram stands in an ADDR.
    """

    name: str
    active: bool = False
    local: Endpoint = ANY_END
    remote_address: str = ANY_ADDRESS
    remote_port: int | str = 0
    send_delay_opt: bool = False
    keep_alive_interval_s: int = 0
    session: Settings | None = None
    description: Description | None = None
    flaw: Finding | None = None
    any_local: bool = False
    remote_name: str = ""
    is_datagram: bool = False

    @property
    def is_message_oriented(self) -> bool:
        """Return whether the partner's messages arrive whole, one a job."""
        return self.is_datagram or (self.session is not None and self.session.is_message_oriented)

    @property
    def keep_alive_s(self) -> int:
        """Return the keep-alive interval in seconds that is in force."""
        return min(self.keep_alive_interval_s or SYSTEM_KEEP_ALIVE_S, LONGEST_KEEP_ALIVE_S)

    @property
    def keep_alive_limited(self) -> str:
        """Return in words that another interval is in force than the one asked for, else ""."""
        if self.keep_alive_interval_s <= self.keep_alive_s:
            return ""
        asked, taken = self.keep_alive_interval_s, self.keep_alive_s
        return f"KeepAliveTimeInterval {asked} s: {taken} s is in force, the most that the stack takes"

    @property
    def dead_after_ms(self) -> int:
        """Return after how many milliseconds of silence the link counts as dead: 3 intervals (7.15.4)."""
        return 3000 * self.keep_alive_s


def parse_address(text: str) -> str | None:
    """Return the address when it is exactly four octets 0..255, else None; never ask a resolver."""
    numbers = octets(text)
    return ".".join(map(str, numbers)) if numbers is not None else None
