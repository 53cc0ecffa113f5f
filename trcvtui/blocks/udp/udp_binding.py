"""What an instance of a UDP block is tied to."""

from __future__ import annotations

from dataclasses import dataclass

from trcvtui.blocks.data_area import DataArea
from trcvtui.blocks.environment import Environment
from trcvtui.net.connection.ownership import Claim
from trcvtui.net.connection.udp_config import RemoteAddress
from trcvtui.net.connection.udp_port import UdpPort


@dataclass(frozen=True, slots=True)
class UdpBinding:
    """CONFIG, ADDR and DATA of one instance. `data` None: the pin is open; `priority` is that of its task."""

    env: Environment
    port: UdpPort
    address: RemoteAddress
    data: DataArea | None
    instance: str
    priority: int = 1

    def claim(self) -> Claim:
        """Return this instance's claim on one direction of its UDP_CONFIG."""
        return Claim(self.instance, None if self.env.rules.lock_across_tasks else self.priority)
