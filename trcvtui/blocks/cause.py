"""Why a block shows what it shows: the evidence behind one STATUS edge."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from operator import attrgetter
from typing import Any, Final

from trcvtui.net.answers import Fault


class Why(StrEnum):
    """What kind of thing brought a STATUS about."""

    NOT_CALLED = "not called"
    INPUT = "input"
    SEQUENCE = "sequence"
    WAITING = "waiting"
    KERNEL = "kernel"
    BYTES = "bytes"
    PARTNER = "partner"
    PARAMETER = "parameter"
    OWNER = "owner"
    RESOURCE = "resource"
    OTHER_BLOCK = "other block"


# What fails like a call and is none; everything else is the kernel's own answer, or a planned fault's.
NO_KERNEL_CALLS: Final = {
    "queue": (Why.RESOURCE, "the job queue is full"),
    "buffer": (Why.RESOURCE, "no buffer is left"),
    "budget": (Why.RESOURCE, "no connection is left"),
    "description": (Why.PARAMETER, "the connection description is wrong"),
    "identity": (Why.OWNER, "another CONNECT has this ID"),
    "session": (Why.PARTNER, "the handshake failed"),
    "address": (Why.PARAMETER, "the address cannot be used"),
    "resolve": (Why.WAITING, "nobody has listened there yet"),
    "attempt_limit": (Why.WAITING, "no answer within the attempt's limit"),
}


@dataclass(frozen=True, slots=True)
class Cause:
    """Evidence: a pin's edge, a kernel call and its errno name, bytes have / need, the partner, the owner.

    `injected` is True where a fault plan and not the kernel answered. Empty fields do not apply.
    """

    why: Why
    name: str
    pin: str = ""
    value: int | None = None
    call: str = ""
    error: str = ""
    injected: bool = False
    peer: str = ""
    have: int | None = None
    need: int | None = None
    detail: str = ""

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel as a tuple: packed in a quarter of the time."""
        return type(self), _fields(self)


_fields: Final = attrgetter(*Cause.__slots__)


def cause_of(fault: Fault, peer: str = "") -> Cause:
    """Return the cause that a failed call is; what is no kernel call is a resource of the PLC."""
    why, name = NO_KERNEL_CALLS.get(fault.call, (Why.KERNEL, f"{fault.call} failed"))
    if fault.call == "resolve" and fault.error.startswith("EAI_"):  # the network's names, not `@NAME`
        why, name = Why.KERNEL, "nobody knows an address for the partner's name"
    return Cause(why, name, call=fault.call, error=fault.error, injected=fault.injected, peer=peer)
