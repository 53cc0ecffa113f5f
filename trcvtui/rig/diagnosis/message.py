"""What whole messages over a connection prove (ISO-on-TCP): a shorter one ends the job, a longer one is lost.

Each rule takes the evidence and answers one sentence, or "" where it does not apply.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.rig.diagnosis import job as job
from trcvtui.rig.diagnosis import link as link
from trcvtui.rig.diagnosis.evidence import Evidence
from trcvtui.rig.diagnosis.receive import at_rest, limit, nothing_sent
from trcvtui.rig.wording import age, count

Rule = Callable[[Evidence], str]


def how_it_stands(e: Evidence) -> str:
    """Return what a job waits for: a message is here whole, or not at all."""
    armed = f"armed for one message of at most {count(e.need, 'byte')}"
    if e.is_past:
        return f"{armed}: none was here yet"
    if e.quiet_ns is not None:
        return f"{armed}: none is here yet; the one before came {age(e.quiet_ns)} ago"
    up = e.facts.up_since
    since = f"; the link is up since scan {up.scan}, {age(e.age_of(up))}" if up is not None else ""
    return f"{armed}: none is here yet{since}"


def short_messages(e: Evidence) -> str:
    """A message shorter than LEN is a whole job; DATA keeps older bytes behind it."""
    is_here = e.condition in (Condition.RECEIVED, Condition.FINISHED)
    size = e.cause.have if is_here else e.done_len
    if not size or not e.need or size >= e.need:
        return ""
    return (
        f"{limit(e)}, the last message had {count(size, 'byte')}: a message is a whole job whatever its "
        f"size, RCVD_LEN says {size}, and DATA keeps older bytes from byte {size} on"
    )


def too_long_messages(e: Evidence) -> str:
    """The partner's messages are longer than LEN or DATA: each is lost."""
    size = e.facts.messages.only
    if size is None or not e.need or size <= e.need:
        return ""
    return (
        f"{e.facts.sender}'s messages have {count(size, 'byte')}, {limit(e)}: each is {size - e.need} too "
        f"long, and lost; DATA and LEN of at least {size} take it"
    )


RECEIVING: Final[tuple[Rule, ...]] = (too_long_messages, nothing_sent, short_messages, at_rest)
NOW: Final[dict[Condition, Rule]] = {Condition.RECEIVING: how_it_stands, Condition.SENDING: job.how_far}
NEXT: Final[dict[Condition, tuple[Rule, ...]]] = {
    Condition.RECEIVING: (*RECEIVING, link.second_client),
    Condition.RECEIVED: (short_messages,),
}
