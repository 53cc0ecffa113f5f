"""Why a block shows what it shows: the evidence behind one STATUS edge."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


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
