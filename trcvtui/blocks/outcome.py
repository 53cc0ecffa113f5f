"""The outcome of one call: a condition, and the cause as evidence of it."""

from __future__ import annotations

import re
from enum import Enum, StrEnum
from typing import Final

from msgspec import Struct

from trcvtui.blocks import conditions
from trcvtui.blocks.conditions import Condition
from trcvtui.net.results import Fault


class CauseKind(StrEnum):
    NOT_CALLED = "not called"
    INPUT = "input"
    SEQUENCE = "sequence"
    WAITING = "waiting"
    KERNEL = "kernel"
    BYTES = "bytes"
    FRAME = "frame"  # it is whole, with `have` of at most `need` bytes
    PARTNER = "partner"
    PARAMETER = "parameter"
    OWNER = "owner"
    RESOURCE = "resource"
    OTHER_BLOCK = "other block"
    INTERNAL = "internal error"


# What fails like a call but is none (a plan can make it fail): the call behind it, "" for none.
UNDERLYING_CALLS: Final = {
    "budget": "",
    "description": "",
    "identity": "",
    "address": "",
    "session": "recv",  # it brought the answer of the partner, or none
    "attempt_limit": "connect",  # it had no answer
}
_ERRNO: Final = re.compile(r"E[A-Z0-9]+|EAI_[A-Z]+")

# The cause of what is no kernel call; every other fault is the kernel's, or a planned one.
PSEUDO_CALL_CAUSES: Final = {
    "queue": (CauseKind.RESOURCE, "the job queue is full"),
    "buffer": (CauseKind.RESOURCE, "no buffer is left"),
    "budget": (CauseKind.RESOURCE, "no connection is left"),
    "description": (CauseKind.PARAMETER, "the connection description is wrong"),
    "identity": (CauseKind.OWNER, "another CONNECT has this ID"),
    "session": (CauseKind.PARTNER, "the handshake failed"),
    "address": (CauseKind.PARAMETER, "the address cannot be used"),
    "resolve": (CauseKind.WAITING, "the partner does not listen yet"),
    "attempt_limit": (CauseKind.WAITING, "connect got no answer within its time limit"),
}


class Cause(Struct, frozen=True):
    """The evidence for an outcome, such as a pin's edge, a kernel call with its errno, or the partner.

    If `injected`, a fault plan answered and not the kernel. Empty fields do not apply.
    """

    why: CauseKind
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
    holder: str = ""  # the instance that is in the way
    is_orphan: bool = False  # it was deleted or downloaded
    local: str = ""  # where the block waits for a partner
    words: str = ""  # the system's text
    is_expected: bool = False  # EN_R before the first connection: it receives once that is up

    @property
    def kernel_call(self) -> str:
        """Return the kernel call of this cause, named as in a `fault` command, or "" if there is none."""
        if self.call == "resolve" and not self.errno:  # `@NAME` of the bench
            return ""
        return UNDERLYING_CALLS.get(self.call, self.call)

    @property
    def errno(self) -> str:
        """Return the name of the errno that the kernel call returned, or "" if there is none."""
        if self.call == "session" or not _ERRNO.fullmatch(self.error):
            return ""
        return str(self.error)


FULL: Final = Fault("send", "EAGAIN")  # the kernel's answer when it takes no byte
NEXT_REQ: Final = Cause(
    CauseKind.WAITING, "the last job has ended; a rising edge of REQ starts the next", pin="REQ"
)


def send_full_cause(fault: Fault, name: str, need: int, peer: str) -> Cause:
    """Return the cause if the stack took no byte of a send. `fault` is FULL or injected by a fault plan."""
    call, error, injected = fault.call, fault.error, fault.injected
    return Cause(
        CauseKind.BYTES, name, call=call, error=error, injected=injected, peer=peer, have=0, need=need
    )


def cause_of_fault(fault: Fault, peer: str = "") -> Cause:
    """Return the cause of a failed call, or of a failure without a call (PSEUDO_CALL_CAUSES)."""
    why, name = PSEUDO_CALL_CAUSES.get(fault.call, (CauseKind.KERNEL, f"{fault.call} failed"))
    if fault.call == "resolve" and fault.error.startswith("EAI_"):  # the network's names, not `@NAME`
        why, name = CauseKind.KERNEL, "no address is known for the partner's name"
    return Cause(
        why, name, call=fault.call, error=fault.error, injected=fault.injected, peer=peer or fault.peer,
        words=fault.words,
    )  # fmt: skip


class Lamp(Enum):
    """BUSY or DONE of an outcome, if the condition alone does not decide that."""

    BUSY = "busy"
    DONE = "done"


class Outcome(Struct, frozen=True, eq=False):
    """The result of one call. `rcvd_len` is non-zero only with DONE. `clear_com_rst` sets COM_RST to FALSE.

    A block on a ComBuffer keeps `rcvd_len` until the next frame begins, and sets `rx_timeout` or `byte`.
    If `stable`, calls return this until an input changes, the CONNECT has an event or its connection ends.
    """

    condition: Condition
    cause: Cause
    rcvd_len: int = 0
    clear_com_rst: bool = False
    stable: bool = False
    lamp: Lamp | None = None
    rx_timeout: bool = False
    byte: int = 0

    @property
    def busy(self) -> bool:
        return self.condition in conditions.BUSY_CONDITIONS or self.lamp is Lamp.BUSY

    @property
    def done(self) -> bool:
        return self.condition in conditions.DONE_CONDITIONS or self.lamp is Lamp.DONE

    @property
    def error(self) -> bool:
        return self.condition in conditions.ERROR_CONDITIONS


NOT_CALLED = Outcome(Condition.NOT_CALLED, Cause(CauseKind.NOT_CALLED, "the block has not been called"))
