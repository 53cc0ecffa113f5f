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
    LINK_DEAD = auto()
    FAILED = auto()
    OURS = auto()


# 3.2: this whole family, on an established connection, means that the link is dead.
LINK_DEAD_ERRORS: Final = frozenset({"ETIMEDOUT", "EHOSTUNREACH", "ENETUNREACH", "EHOSTDOWN", "ENETDOWN"})
# The partner has ended a session, with a word of its own or without the one that belongs there.
ENDED_ERRORS: Final = frozenset({TlsError.REFUSED, TlsError.TRUNCATED})


@dataclass(frozen=True, slots=True)
class ConnectionLoss:
    """How one incarnation ended; `release_fault` is a failure to take its socket out of the poll set."""

    kind: LossKind
    peer: str
    fault: Fault | None = None
    release_fault: Fault | None = None


def loss_of(fault: Fault | None, peer: str) -> ConnectionLoss:
    """Return the loss that a call's answer means; None is the partner's FIN."""
    if fault is None or fault.error in ENDED_ERRORS:
        kind = LossKind.CLOSED_BY_PARTNER
    elif fault.error == "ECONNRESET":
        kind = LossKind.RESET_BY_PARTNER
    elif fault.error in LINK_DEAD_ERRORS:
        kind = LossKind.LINK_DEAD
    else:
        kind = LossKind.FAILED
    return ConnectionLoss(kind, peer, fault)
