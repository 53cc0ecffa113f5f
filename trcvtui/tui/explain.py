"""Why a block shows what it shows, in a person's words and with the actual numbers."""

from __future__ import annotations

from typing import Final

from trcvtui.plc.ledger import StatusEdge
from trcvtui.plc.snapshot import SENDERS, ConnectionSnapshot, InstanceSnapshot
from trcvtui.tui.formatting import age, count

INJECTED: Final = "injected fault: "


def why_now(instance: InstanceSnapshot, connection: ConnectionSnapshot | None, t_ns: int) -> str:
    """Return why an instance shows its STATUS now; numbers are those of this moment."""
    text = why(instance)
    if instance.need and instance.busy and not instance.sends:
        text = _bytes_now(instance, t_ns)
    elif connection is not None and connection.state != "connected" and instance.pin("CONT"):
        text += _attempts(connection)
    return text


def _bytes_now(instance: InstanceSnapshot, t_ns: int) -> str:
    wanted = (
        f"up to {count(instance.need, 'byte')} (ADHOC)" if instance.adhoc else count(instance.need, "byte")
    )
    last = instance.last_receive_ns
    since = "" if last is None else f", the last one came {age(t_ns - last)} ago"
    if not instance.have:
        return f"armed for {wanted}: none is here yet{since}"
    return f"{instance.have} of {wanted} are here{since}"


def _attempts(connection: ConnectionSnapshot) -> str:
    if not connection.active:
        return ""
    text = f"; {count(connection.attempts, 'attempt')} so far" if connection.attempts else ""
    if connection.retry_in_ns is not None:
        text += f", the next in {age(connection.retry_in_ns)}"
    return text


def why(shown: StatusEdge | InstanceSnapshot) -> str:
    """Return the evidence of a STATUS: what happened, which call and error, whose, and whether injected."""
    cause = shown.cause
    text = cause.name
    if cause.call and cause.call in text:
        text = f"{cause.call} gave {cause.error or 'an error'}"
    elif cause.call:
        text += f" ({cause.call} gave {cause.error or 'an error'})"
    if cause.injected:
        text = INJECTED + text
    text += _numbers(shown)
    if cause.peer and cause.peer not in text:
        text += f", partner {cause.peer}"
    return text + (f", {cause.detail}" if cause.detail else "")


def _numbers(shown: StatusEdge | InstanceSnapshot) -> str:
    cause = shown.cause
    if cause.have is not None and cause.need is not None:
        if cause.pin:
            return f": {cause.pin} is {cause.value}, wanted {cause.have}, at most {count(cause.need, 'byte')}"
        where = "taken" if shown.block in SENDERS else "here"
        return f", {cause.have} of {count(cause.need, 'byte')} {where}"
    if cause.pin and cause.value is not None and cause.pin not in cause.name:
        return f" ({cause.pin} is {cause.value})"
    return ""
