"""Who holds which port of the simulated machine: the REUSEADDR matrix of status-reproduction 3.1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from trcvtui.net.kernel import Endpoint

ANY: Final = "0.0.0.0"
FIRST_FREE: Final = 32768
LAST_FREE: Final = 60999


@dataclass(slots=True, eq=False)
class Claim:
    """One socket's hold on a local end; port 0 = none yet.

    `fixed` says that the program asked for this very port: it is then kept until the handle is freed.
    """

    address: str = ANY
    port: int = 0
    reuse: bool = False
    listening: bool = False
    fixed: bool = False

    @property
    def end(self) -> Endpoint | None:
        """Return the local end, None while there is none."""
        return Endpoint(self.address, self.port) if self.port else None

    def child(self, address: str) -> Claim:
        """Return the claim of a connection that a listener accepts: it shares port and REUSEADDR."""
        return Claim(address, self.port, self.reuse)


class PortTable:
    """All claims of one machine, by port."""

    def __init__(self) -> None:
        self._claims: dict[int, list[Claim]] = {}
        self._next = FIRST_FREE

    def bind(self, claim: Claim, end: Endpoint) -> str:
        """Give the end to the claim; return "" or the errno name."""
        port = end.port or self._free_port()
        if not port or self._is_taken(claim, end.address, port):
            return "EADDRINUSE"
        claim.address, claim.port, claim.fixed = end.address, port, end.port != 0
        self.add(claim)
        return ""

    def borrow(self, claim: Claim, address: str) -> bool:
        """Give a claim without port a free one for a connect; return whether there was one."""
        claim.address = address
        if claim.port:
            return True
        claim.port = self._free_port()
        if claim.port:
            self.add(claim)
        return claim.port != 0

    def listen(self, claim: Claim) -> str:
        """Make the claim exclusive; return "" or the errno name."""
        if not claim.port and not self.borrow(claim, claim.address):
            return "EADDRINUSE"
        if self._is_taken(claim, claim.address, claim.port):
            return "EADDRINUSE"
        claim.listening = True
        return ""

    def add(self, claim: Claim) -> None:
        """Enter a claim whose end is known."""
        self._claims.setdefault(claim.port, []).append(claim)

    def release(self, claim: Claim) -> None:
        """Drop a claim; one that is not entered is no fault."""
        holders = self._claims.get(claim.port)
        if holders is not None and claim in holders:
            holders.remove(claim)
            if not holders:
                del self._claims[claim.port]

    def _is_taken(self, claim: Claim, address: str, port: int) -> bool:
        return any(
            other is not claim
            and (address == other.address or ANY in (address, other.address))
            and (other.listening or not (claim.reuse and other.reuse))
            for other in self._claims.get(port, ())
        )

    def _free_port(self) -> int:
        """Return a port that nobody holds, 0 when there is none."""
        for _ in range(FIRST_FREE, LAST_FREE + 1):
            port = self._next
            self._next = port + 1 if port < LAST_FREE else FIRST_FREE
            if port not in self._claims:
                return port
        return 0
