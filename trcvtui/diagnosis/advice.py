"""Evidence to sentences: why a block shows what it shows, what proves it, and what to do about it.

Rule 1: which rules are asked goes by the condition, never by a STATUS number; each answers a sentence or "".
Rule 2: a rule is one row of RULES: conditions, what moves, function. Rows for what moves replace the general
ones of a condition; their order is the order in which they are told.
Rule 3: while the next attempt is waited for, the code of the last one and its advice come first, as if it
still showed. A block that showed no code of its own for it has none to tell.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import Final, NamedTuple

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.outcome import UNDERLYING_CALLS, Cause, CauseKind
from trcvtui.blocks.table import block_row
from trcvtui.diagnosis import handshake, job, link, receive, serial
from trcvtui.diagnosis.evidence import Evidence
from trcvtui.diagnosis.job import DoLine, Sentence, Tell, as_sentence, says
from trcvtui.history.records import SETUP_CALLS
from trcvtui.wording import count

INJECTED: Final = "injected fault: "
AN_END: Final = "0 bytes"  # what recv gives at a FIN, and no errno
SESSION: Final = {
    "ECONNREFUSED": "the partner took the call and refused it in the handshake",
    "ECONNRESET": "the partner took the call and ended it in the handshake",
}


class Moves(Enum):
    """What moves on the link of a block: it decides what is asked."""

    ANYTHING = auto()
    MESSAGES = auto()  # over a connection
    DATAGRAMS = auto()  # of USEND_C and URECV_C
    DATAGRAMS_OF_A_CONNECT = auto()  # its socket is the connection
    DATAGRAM_JOBS = auto()  # of TUSEND and TURCV
    RESULT = auto()  # of T_DIAG


class Rule(NamedTuple):
    """One row: in these conditions, where that moves, the function is asked.

    `says_why`: it tells how things stand now, which says more than the cause of the edge does.
    """

    conditions: frozenset[Condition]
    moves: Moves
    tell: Tell
    says_why: bool = False


def rows(
    conditions: Condition | tuple[Condition, ...],
    *tells: Tell,
    of: Moves | tuple[Moves, ...] = Moves.ANYTHING,
    says_why: bool = False,
) -> tuple[Rule, ...]:
    of_these = frozenset((conditions,) if isinstance(conditions, Condition) else conditions)
    moves = (of,) if isinstance(of, Moves) else of
    return tuple(Rule(of_these, each, tell, says_why) for each in moves for tell in tells)


DATAGRAMS: Final = (Moves.DATAGRAMS, Moves.DATAGRAMS_OF_A_CONNECT)
ALL_DATAGRAMS: Final = (*DATAGRAMS, Moves.DATAGRAM_JOBS)
# What knows no number stands in the STATUS table, on the same card.
RULES: Final[tuple[Rule, ...]] = (
    # how things stand, for the sentence of why
    *rows(Condition.RECEIVING, receive.how_it_stands, says_why=True),
    *rows(Condition.ESTABLISHING, link.who_is_waited_for, says_why=True),
    *rows(Condition.SENDING, job.how_far, of=(Moves.ANYTHING, Moves.MESSAGES, *DATAGRAMS), says_why=True),
    *rows(Condition.RECEIVING, receive.message_stands, of=Moves.MESSAGES, says_why=True),
    *rows(Condition.RECEIVING, receive.datagram_stands, of=DATAGRAMS, says_why=True),
    *rows(Condition.ESTABLISHING, link.who_is_waited_for, of=Moves.DATAGRAMS_OF_A_CONNECT, says_why=True),
    *rows(
        (Condition.STARTED, Condition.RUNNING),
        receive.datagram_job_stands,
        of=Moves.DATAGRAM_JOBS,
        says_why=True,
    ),
    # what to check next
    *rows(
        Condition.INTERNAL_FAULT,
        says("please send the report", cause="the error is in this program, not on the line"),
        says(
            "start {instance} anew: `download {instance}`, or `plc stop` and `plc run`", "download {instance}"
        ),
    ),
    *rows(
        Condition.STILL_ASKED,
        says(
            "`set {instance} EN_R=0`, and 1 when it is up",
            "set {instance} EN_R=0",
            cause="EN_R is 1 while there is no connection",
        ),
        link.lost_before,
    ),
    *rows(Condition.ENDPOINT_GONE, link.lost_before),
    *rows(Condition.PORT_IN_USE, link.injected, link.what_failed, job.another_port),
    *rows(Condition.PORT_RESERVED, job.where_the_flaw_is, job.another_port),
    *rows(
        Condition.REFUSED,
        link.injected,
        job.no_such_selector,
        link.what_failed,
        link.peer_that_could_call,
        link.lost_before,
    ),
    *rows(
        (
            Condition.UNREACHABLE,
            Condition.NO_SOCKET,
            Condition.WRONG_LOCAL_ADDRESS,
            Condition.REUSE_FAILED,
            Condition.BIND_FAILED,
            Condition.POLL_ADD_FAILED,
            Condition.ACCEPT_FAILED,
            Condition.CONNECT_FAILED,
        ),
        link.injected,
        link.no_connection_left,
        link.what_failed,
        link.peer_that_could_call,
        link.lost_before,
    ),
    *rows(
        (
            Condition.REMOTE_WRONG,
            Condition.ID_WRONG,
            Condition.INTERFACE_WRONG,
            Condition.TYPE_WRONG,
            Condition.PARAMETER_WRONG,
            Condition.UDP_ACTIVE,
            Condition.TSAP_WRONG,
            Condition.NAME_EMPTY,
            Condition.NAME_NOT_FULL,
            Condition.TLS_SERVER_BARE,
            Condition.TLS_DATAGRAMS,
            Condition.TLS_CLIENT_ASKS,
            Condition.TLS_SERVER_CHECKS,
            Condition.TLS_REFERENCE,
        ),
        job.where_the_flaw_is,
    ),
    *rows((Condition.LEN_OVER_DATA, Condition.LENGTH_WRONG), job.wrong_length),
    *rows(Condition.AREA_CHANGED, job.must_stay),
    *rows(Condition.DATA_SYMBOLIC, job.symbolic_data),
    *rows(Condition.MESSAGE_TOO_LONG, job.message_too_long),
    *rows((Condition.DATA_MISSING, Condition.DATA_EMPTY), job.no_data),
    *rows(Condition.RESULT_WRONG, job.result_too_small),
    *rows(Condition.NAME_UNKNOWN, job.ask_for_the_name),
    *rows(
        (
            Condition.TLS_MESSAGE,
            Condition.TLS_HANDSHAKE,
            Condition.TLS_UNSUPPORTED,
            Condition.TLS_DISCARDED,
            Condition.TLS_NO_CA,
            Condition.TLS_EXPIRED,
            Condition.TLS_EXTENSION,
        ),
        handshake.why_it_failed,
    ),
    *rows(Condition.STRING_OVERRUN, serial.string_too_long),
    *rows(Condition.RECEIVE_LENGTH_WRONG, serial.size_does_not_fit),
    *rows(Condition.DATA_OVERRUN, serial.frame_too_long),
    *rows(
        Condition.RECEIVING,
        receive.shifted_by_a_drop,
        receive.shifted,
        receive.too_short_a_sender,
        receive.several_messages_a_frame,
        receive.too_long_a_sender,
        receive.one_odd_message,
        receive.messages_of_many_sizes,
        receive.bursts_do_not_fill,
        receive.ad_hoc_hint,
        receive.nothing_sent,
        link.may_be_cut,
        link.second_client,
    ),
    *rows(
        Condition.RECEIVED,
        receive.shifted_by_a_drop,
        receive.shifted,
        receive.too_short_a_sender,
        receive.too_long_a_sender,
        receive.one_odd_message,
        receive.messages_of_many_sizes,
        receive.parts_of_a_message,
    ),
    *rows(
        Condition.ESTABLISHING,
        link.injected,
        link.let_go,
        link.what_failed,
        link.wrong_partner,
        link.peer_that_could_call,
        link.unanswered,
        link.lost_before,
    ),
    *rows(Condition.NOT_CALLED, job.not_called),
    *rows(
        Condition.NOT_CONNECTED,
        link.asked_too_early,
        link.wrong_partner,
        link.what_failed,
        link.peer_that_could_call,
    ),
    *rows(Condition.LINK_DEAD, link.injected, link.dead_link),
    *rows((Condition.SENDING, Condition.SEND_BUFFER_FULL), job.stalled_peer, job.does_not_read),
    *rows(Condition.CONNECT_IN_USE, job.who_holds),
    *rows(Condition.CONNECTED, job.nobody_reads_here, job.no_edge, link.second_client),
    *rows(Condition.NO_JOB, job.cont_is_missing, link.lost_before),
    *rows(
        (
            Condition.PARTNER_CLOSED,
            Condition.FOUND_CLOSED,
            Condition.SHORT_FRAME,
            Condition.SEND_FAILED,
            Condition.RECEIVE_FAILED,
        ),
        link.injected,
        handshake.why_it_failed,
        link.ended_by_partner,
        link.closed_after_its_message,
    ),
    # messages over a connection
    *rows(
        Condition.RECEIVING,
        receive.too_long_messages,
        receive.nothing_sent,
        receive.short_messages,
        link.may_be_cut,
        link.second_client,
        of=Moves.MESSAGES,
    ),
    *rows(Condition.RECEIVED, receive.short_messages, of=Moves.MESSAGES),
    # datagrams
    *rows(
        Condition.RECEIVING,
        receive.wrong_port,
        receive.nobody_sends,
        receive.too_long_datagrams,
        receive.short_datagrams,
        of=DATAGRAMS,
    ),
    *rows(Condition.RECEIVED, receive.too_long_datagrams, receive.short_datagrams, of=DATAGRAMS),
    *rows(Condition.RECEIVE_FAILED, link.injected, receive.too_long_datagrams, of=DATAGRAMS),
    *rows(Condition.SEND_FAILED, link.injected, of=DATAGRAMS),
    *rows(Condition.CONNECT_IN_USE, job.who_holds, of=ALL_DATAGRAMS),
    *rows(Condition.LENGTH_WRONG, job.wrong_length, of=ALL_DATAGRAMS),
    *rows(Condition.DATA_EMPTY, job.no_data, of=ALL_DATAGRAMS),
    *rows(Condition.NO_JOB, job.cont_is_missing, of=DATAGRAMS),
    *rows(Condition.CREATED, receive.datagrams_wait, receive.no_edge_for_a_datagram, of=Moves.DATAGRAMS),
    *rows((Condition.SENDING, Condition.SENT), receive.nobody_is_told, of=Moves.DATAGRAMS),
    *rows((Condition.SENDING, Condition.SENT), receive.took_it, of=Moves.DATAGRAMS_OF_A_CONNECT),
    *rows(
        Condition.CONNECTED,
        receive.datagrams_wait,
        receive.no_edge_for_a_datagram,
        of=Moves.DATAGRAMS_OF_A_CONNECT,
    ),
    *rows(
        Condition.MESSAGE_TOO_LONG,
        receive.datagram_too_long,
        of=(Moves.DATAGRAMS_OF_A_CONNECT, Moves.DATAGRAM_JOBS),
    ),
    *rows(
        Condition.REMOTE_WRONG,
        receive.addr_is_empty,
        of=(Moves.DATAGRAMS_OF_A_CONNECT, Moves.DATAGRAM_JOBS),
    ),
    *rows(Condition.SEND_BUFFER_FULL, link.injected, receive.nobody_is_told, of=Moves.DATAGRAMS_OF_A_CONNECT),
    # TUSEND and TURCV
    *rows(Condition.NO_JOB, receive.datagrams_wait, receive.no_edge_for_a_datagram, of=Moves.DATAGRAM_JOBS),
    *rows(
        (Condition.STARTED, Condition.RUNNING),
        receive.wrong_port,
        receive.nobody_sends,
        receive.short_datagrams,
        receive.nobody_is_told,
        of=Moves.DATAGRAM_JOBS,
    ),
    *rows(Condition.RECEIVED, receive.short_datagrams, of=Moves.DATAGRAM_JOBS),
    *rows(Condition.SENT, receive.nobody_is_told, of=Moves.DATAGRAM_JOBS),
    *rows((Condition.RECEIVE_FAILED, Condition.SEND_FAILED), link.injected, of=Moves.DATAGRAM_JOBS),
    *rows(Condition.NOT_CONNECTED, receive.socket_is_closed, of=Moves.DATAGRAM_JOBS),
    *rows(Condition.NEEDS_ADDR, receive.addr_is_empty, of=Moves.DATAGRAM_JOBS),
    *rows(Condition.FINISHED, receive.result_says, of=Moves.RESULT),
)

JOB: Final = frozenset({Condition.STARTED, Condition.RUNNING})


@dataclass(frozen=True, slots=True)
class Advice:
    """`why` is how things stand, `causes` what is proven, the most telling first; `do` is what to do.

    `code`: that whose row of the table says more than the row of the code that is shown. `rules`: those
    that spoke.
    """

    why: str
    causes: tuple[str, ...] = ()
    do: tuple[DoLine, ...] = ()
    code: int | None = None
    rules: tuple[Tell, ...] = ()

    @property
    def checks(self) -> tuple[str, ...]:
        """Return all that is more than `why`."""
        return (*self.causes, *(each.text for each in self.do))


def advice_on(e: Evidence) -> Advice:
    failed = e.facts.attempt
    words = because(failed.cause, e.block) if failed is not None else ""
    first = _attempt_told(e, words)
    rules = () if first and _stops_it(e) else _asked(e)
    told = _answers(e, (serial.port_trouble, *rules))
    parts = [*first, *(sentence for _, sentence in told)]
    causes = tuple(dict.fromkeys(part.cause for part in parts if part.cause))
    do = tuple(dict.fromkeys(line for part in parts for line in part.do))
    if first:  # which may say a cause already, after its own words
        causes = (causes[0], *(cause for cause in causes[1:] if cause not in causes[0]))
    return Advice(why(e), causes, do, _attempt_code(e), tuple(tell for tell, _ in told))


def _answers(e: Evidence, rules: Iterable[Tell]) -> list[tuple[Tell, Sentence]]:
    return [(tell, as_sentence(answer)) for tell in rules if (answer := tell(e))]


def _asked(e: Evidence) -> tuple[Tell, ...]:
    found = _rules(e, _moves(e)) or _rules(e, Moves.ANYTHING) or (link.injected,)
    return (*found, job.press_c)


def _rules(e: Evidence, moves: Moves, says_why: bool = False) -> tuple[Tell, ...]:
    condition = _condition(e)
    return tuple(
        rule.tell
        for rule in RULES
        if rule.moves is moves and condition in rule.conditions and rule.says_why is says_why
    )


def _moves(e: Evidence) -> Moves:
    row = block_row(e.block)
    if row.speaks_udp:
        return Moves.DATAGRAM_JOBS if row.datagrams else Moves.DATAGRAMS
    if row.data_pin == "RESULT":
        return Moves.RESULT
    if e.is_datagram:
        return Moves.DATAGRAMS_OF_A_CONNECT
    return Moves.MESSAGES if e.is_message else Moves.ANYTHING


def _condition(e: Evidence) -> Condition:
    condition = Condition(e.condition)
    if condition is Condition.RECEIVING_PART:
        return Condition.RECEIVING
    return (block_row(e.block).runs_as or condition) if condition in JOB else condition


def why(e: Evidence) -> str:
    """Return why it is shown: how things stand now, and where nothing is known of that, the edge's cause."""
    moves = _moves(e)
    found = _rules(e, moves, says_why=True)
    if not found and moves not in (Moves.DATAGRAMS, Moves.DATAGRAM_JOBS):
        found = _rules(e, Moves.ANYTHING, says_why=True)
    asked = [tell for tell in found if e.need or tell is link.who_is_waited_for]
    stands = as_sentence(asked[0](e)).cause if asked else ""
    if not stands:
        return serial.waits_for_the_port(e) or because(e.cause, e.block)
    return INJECTED + stands if e.cause.injected else stands


def because(cause: Cause, block: str) -> str:
    """Return the cause of an edge: what happened, which call and errno, whose, and whether injected."""
    text = cause.name
    if cause.call == "session":  # what came inside the connection
        text = SESSION.get(cause.error, f"{cause.name} ({cause.error})")
    elif cause.call in UNDERLYING_CALLS:  # it is no call
        text += "" if cause.why is CauseKind.PARAMETER and cause.detail else f" ({cause.error})"
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
        if cause.pin and cause.value is None:  # what the pin points to, beside what the job needs
            return f": {cause.have} of {count(cause.need, 'byte')}"
        if cause.pin:
            return f": {cause.pin} is {cause.value}, wanted {cause.have}, at most {count(cause.need, 'byte')}"
        if not cause.have and row.receives and row.speaks_udp:  # it is here whole, or not at all
            return f", at most {count(cause.need, 'byte')}"
        if cause.why is CauseKind.FRAME and cause.have != cause.need:
            return f", {count(cause.have, 'byte')}"
        where = "taken" if row.sends else "here"
        return f", {cause.have} of {count(cause.need, 'byte')} {where}"
    if cause.pin and cause.value is not None and cause.pin not in cause.name:
        return f" ({cause.pin} is {cause.value})"
    return ""


# -- the last failed attempt, while the next one is waited for --------------------------------------------

# What shows while a connection is built; RUNNING of the block that builds one.
BUILDING: Final = frozenset({Condition.CREATING, Condition.CREATED, Condition.ESTABLISHING})


def _is_building(e: Evidence) -> bool:
    is_run = e.condition == Condition.RUNNING and block_row(e.block).runs_as in BUILDING
    return e.condition in BUILDING or is_run


def _attempt_code(e: Evidence) -> int | None:
    """Return the code of the last failed attempt, None where none is waited for or none was shown."""
    attempt = e.facts.attempt
    return attempt.status if attempt is not None and attempt.condition and _is_building(e) else None


def _attempt_told(e: Evidence, words: str) -> tuple[Sentence, ...]:
    """Return what is told of it: it is asked about as in the scan that showed it, `words` are its cause."""
    attempt = e.facts.attempt
    if attempt is None or _attempt_code(e) is None:
        return ()
    then = replace(e, condition=attempt.condition, cause=attempt.cause)
    asked = (tell for tell in _asked(then) if tell is not link.lost_before)
    first, *rest = [sentence for _, sentence in _answers(then, asked)] or [Sentence(words)]
    said = f" ({attempt.said})" if attempt.said and attempt.said not in first.cause else ""
    head = f"the last attempt ended in {attempt.status:04X} in scan {attempt.at.scan}"
    return (first._replace(cause=": ".join(filter(None, (head, first.cause))) + said), *rest)


def _stops_it(e: Evidence) -> bool:
    """Return whether it never came to a socket: ports and partners have no part in it."""
    attempt = e.facts.attempt
    return attempt is not None and attempt.cause.call in SETUP_CALLS
