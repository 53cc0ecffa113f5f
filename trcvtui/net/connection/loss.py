"""How an established connection ends: by the partner, by a dead link, by a failure, by us."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import Final

from trcvtui.net.kernel import Fault
from trcvtui.net.tls_words import TlsError


class LossKind(Enum):
    """How an established connection ended."""

    CLOSED_BY_PARTNER = auto()
    RESET_BY_PARTNER = auto()
    REFUSED = auto()  # at the end of a handshake that was over for us: the partner does not take us
    LINK_DEAD = auto()
    FAILED = auto()
    OURS = auto()


# 3.2: this whole family, on an established connection, means that the link is dead.
LINK_DEAD_ERRORS: Final = frozenset({"ETIMEDOUT", "EHOSTUNREACH", "ENETUNREACH", "EHOSTDOWN", "ENETDOWN"})
# The partner has ended a session, with a word of its own or without the one that belongs there.
ENDED_ERRORS: Final = frozenset({TlsError.REFUSED, TlsError.TRUNCATED})
LOSSES_KEPT: Final = 8


@dataclass(frozen=True, slots=True)
class ConnectionLoss:
    """How one incarnation ended; `release_fault` is a failure to take its socket out of the poll set."""

    kind: LossKind
    peer: str
    fault: Fault | None = None
    release_fault: Fault | None = None


class Losses:
    """How the newest incarnations of one connection ended."""

    def __init__(self) -> None:
        self._of: dict[int, ConnectionLoss] = {}

    def add(self, incarnation: int, loss: ConnectionLoss) -> None:
        """Keep how this incarnation ended; the oldest one is forgotten."""
        self._of[incarnation] = loss
        if len(self._of) > LOSSES_KEPT:
            del self._of[min(self._of)]

    def of(self, incarnation: int) -> ConnectionLoss | None:
        """Return how that incarnation ended, None where nobody knows."""
        return self._of.get(incarnation)

    @property
    def newest(self) -> ConnectionLoss | None:
        """Return how the newest one that is lost ended."""
        return self._of[max(self._of)] if self._of else None


def loss_of(fault: Fault | None, peer: str, may_refuse: bool = False) -> ConnectionLoss:
    """Return the loss that a call's answer means; None is the partner's FIN.

    `may_refuse`: we have called, and nothing of the partner's data has come: an alert of TLS refuses us.
    """
    if may_refuse and fault is not None and fault.error == TlsError.REFUSED:
        kind = LossKind.REFUSED
    elif fault is None or fault.error in ENDED_ERRORS:
        kind = LossKind.CLOSED_BY_PARTNER
    elif fault.error == "ECONNRESET":
        kind = LossKind.RESET_BY_PARTNER
    elif fault.error in LINK_DEAD_ERRORS:
        kind = LossKind.LINK_DEAD
    else:
        kind = LossKind.FAILED
    return ConnectionLoss(kind, peer, fault)
