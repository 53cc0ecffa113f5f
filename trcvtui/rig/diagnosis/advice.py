"""Evidence to sentences: why a block shows what it shows, and what to check next with the actual numbers.

Rule: which rules are asked goes by the condition, never by a STATUS number; each answers one sentence or "".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from trcvtui.blocks.cause import TOOK_PART, Cause, Why
from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.table import block_row
from trcvtui.rig.diagnosis import attempt as attempt
from trcvtui.rig.diagnosis import job as job
from trcvtui.rig.diagnosis import link as link
from trcvtui.rig.diagnosis import message as message
from trcvtui.rig.diagnosis import receive as receive
from trcvtui.rig.diagnosis import refusal as refusal
from trcvtui.rig.diagnosis import serial as serial
from trcvtui.rig.diagnosis import single as single
from trcvtui.rig.diagnosis import udp as udp
from trcvtui.rig.diagnosis.evidence import Evidence
from trcvtui.rig.wording import count

Rule = Callable[[Evidence], str]
INJECTED: Final = "injected fault: "
AN_END: Final = "0 bytes"  # what recv gives at a FIN, and no errno
SESSION: Final = {
    "ECONNREFUSED": "the partner took the call and refused it in the handshake",
    "ECONNRESET": "the partner took the call and ended it in the handshake",
}

# What says more about the present than the cause of the edge does.
NOW: Final[dict[Condition, Rule]] = {
    Condition.RECEIVING: receive.how_it_stands,
    Condition.ESTABLISHING: link.who_is_waited_for,
    Condition.SENDING: job.how_far,
}
_ATTEMPT: Final = dict.fromkeys(
    (
        Condition.NO_SOCKET,
        Condition.WRONG_LOCAL_ADDRESS,
        Condition.REUSE_FAILED,
        Condition.BIND_FAILED,
        Condition.POLL_ADD_FAILED,
        Condition.ACCEPT_FAILED,
        Condition.CONNECT_FAILED,
    ),
    link.FAILED_ATTEMPT,
)
_LOST: Final = dict.fromkeys(
    (Condition.PARTNER_CLOSED, Condition.SHORT_FRAME, Condition.SEND_FAILED, Condition.RECEIVE_FAILED),
    link.LOST,
)
NEXT: Final[dict[Condition, tuple[Rule, ...]]] = {
    **refusal.NEXT,
    **serial.NEXT,
    Condition.RECEIVING: (*receive.RECEIVING, link.second_client),
    Condition.RECEIVED: receive.RECEIVED,
    Condition.ESTABLISHING: link.ESTABLISHING,
    Condition.NOT_CALLED: (job.not_called,),
    Condition.NOT_CONNECTED: link.NOT_CONNECTED,
    Condition.LINK_DEAD: link.DEAD,
    Condition.SENDING: job.SENDING,
    Condition.SEND_BUFFER_FULL: job.SENDING,
    Condition.CONNECT_IN_USE: job.IN_USE,
    Condition.LENGTH_WRONG: job.LENGTH,
    Condition.DATA_EMPTY: job.EMPTY,
    Condition.CONNECTED: (*job.IDLE, link.second_client),
    Condition.NO_JOB: (*job.NO_JOB, link.lost_before),
    **_ATTEMPT,
    **_LOST,
}
JOB: Final = frozenset({Condition.STARTED, Condition.RUNNING})


@dataclass(frozen=True, slots=True)
class Advice:
    """`why` in one sentence; `checks` are what to look at next, the most telling first.

    `code`: that whose row of the table says more than the row of the code that is shown.
    """

    why: str
    checks: tuple[str, ...]
    code: int | None = None


def advice_on(e: Evidence) -> Advice:
    """Return what the evidence proves."""
    failed = e.facts.attempt
    words = because(failed.cause, e.block) if failed is not None else ""
    first = attempt.told(e, _rules, words)
    rules = () if first and attempt.stops_it(e) else _rules(e)
    told = [sentence for rule in (*serial.ALWAYS, *rules) if (sentence := rule(e))]
    more = [sentence for sentence in told if not attempt.is_repeated(sentence, first)]
    return Advice(why(e), tuple(dict.fromkeys((*first, *more))), attempt.code(e))


def _rules(e: Evidence) -> tuple[Rule, ...]:
    """Return what is asked; of datagrams and of messages something else than of a stream."""
    condition = _condition(e)
    own = _own_next(e.block) or (udp.BY_CONNECT if e.is_datagram else message.NEXT if e.is_message else {})
    return own.get(condition) or NEXT.get(condition, (link.injected,))


def _own_next(block: str) -> Mapping[Condition, tuple[Rule, ...]]:
    """Return what a block is asked of its own, whatever moves on its CONNECT."""
    row = block_row(block)
    if row.speaks_udp:
        return single.DATAGRAMS if row.datagrams else udp.NEXT
    return single.RESULT if row.data_pin == "RESULT" else {}


def _own_now(block: str) -> Mapping[Condition, Rule]:
    row = block_row(block)
    if not row.speaks_udp:
        return {}
    return single.NOW if row.datagrams else udp.NOW


def _condition(e: Evidence) -> Condition:
    """Return what is the case, in the words of the blocks that have more of them."""
    condition = Condition(e.condition)
    if condition is Condition.RECEIVING_PART:
        return Condition.RECEIVING
    return (block_row(e.block).runs_as or condition) if condition in JOB else condition


def why(e: Evidence) -> str:
    """Return why it is shown: how things stand now, and where nothing is known of that, the edge's cause."""
    of_block = _own_now(e.block)
    own = of_block or (udp.NOW_BY_CONNECT if e.is_datagram else message.NOW if e.is_message else {})
    rule = own.get(_condition(e)) or (None if of_block else NOW.get(_condition(e)))
    stands = rule(e) if rule is not None and (e.need or rule is link.who_is_waited_for) else ""
    if not stands:
        return serial.waits_for_the_port(e) or because(e.cause, e.block)
    return INJECTED + stands if e.cause.injected else stands


def because(cause: Cause, block: str) -> str:
    """Return the cause of an edge: what happened, which call and errno, whose, and whether injected."""
    text = cause.name
    if cause.call == "session":  # what came inside the connection
        text = SESSION.get(cause.error, f"{cause.name} ({cause.error})")
    elif cause.call in TOOK_PART:  # it is no call
        text += "" if cause.why is Why.PARAMETER and cause.detail else f" ({cause.error})"
    elif cause.call and cause.call in text:
        text = f"{cause.call} gave {cause.error or AN_END}"
    elif cause.call:
        text += f" ({cause.call} gave {cause.error or AN_END})"
    if cause.injected:
        text = INJECTED + text
    text += _numbers(cause, block)
    if cause.peer and cause.peer not in text:
        text += f", partner {cause.peer}"
    listening = f"listening on {cause.local}" if cause.local else ""
    return ", ".join(
        part for part in (text, listening, ": ".join(filter(None, (cause.holder, cause.detail)))) if part
    )


def _numbers(cause: Cause, block: str) -> str:
    row = block_row(block)
    if cause.have is not None and cause.need is not None:
        if cause.pin:
            return f": {cause.pin} is {cause.value}, wanted {cause.have}, at most {count(cause.need, 'byte')}"
        if not cause.have and row.receives and row.speaks_udp:  # it is here whole, or not at all
            return f", at most {count(cause.need, 'byte')}"
        where = "taken" if row.sends else "here"
        return f", {cause.have} of {count(cause.need, 'byte')} {where}"
    if cause.pin and cause.value is not None and cause.pin not in cause.name:
        return f" ({cause.pin} is {cause.value})"
    return ""
