"""Turns evidence into sentences: why a block shows its STATUS, what proves it, and what to do about it.

Rule 1: the condition selects the rules, never a STATUS number. Each rule returns a sentence or "".
Rule 2: a rule is one row of ADVICE_RULES: conditions, traffic, function. Rows for one kind of traffic replace
the general rows of a condition. The order of the rows is the order of the sentences.
Rule 3: while a block waits for its next attempt, the code of the last attempt and the advice on it come
first, as if the block still showed that code. If the last attempt showed no code, the advice names no code.
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
from trcvtui.diagnosis.job import (
    AdviceFunction,
    AdvisedCause,
    SuggestedAction,
    as_advised_cause,
    make_constant_rule,
)
from trcvtui.history.records import SETUP_CALLS
from trcvtui.wording import count

INJECTED_PREFIX: Final = "injected fault: "
EMPTY_READ_TEXT: Final = "0 bytes"  # what recv gives at a FIN, and no errno
SESSION_ERROR_TEXTS: Final = {
    "ECONNREFUSED": "the partner accepted the call, then refused it in the handshake",
    "ECONNRESET": "the partner accepted the call, then ended it in the handshake",
}


class Traffic(Enum):
    """The kind of traffic on the link of a block; the kind selects the rules."""

    ANYTHING = auto()
    MESSAGES = auto()  # over a connection
    DATAGRAMS = auto()  # of USEND_C and URECV_C
    DATAGRAMS_OF_A_CONNECT = auto()  # its socket is the connection
    DATAGRAM_JOBS = auto()  # of TUSEND and TURCV
    RESULT = auto()  # of T_DIAG


class AdviceRule(NamedTuple):
    """One row. `tell` gives the advice in `conditions`, if the block has the traffic `traffic`.

    If `says_why`, the answer describes the present state, which says more than the cause of the edge.
    """

    conditions: frozenset[Condition]
    traffic: Traffic
    tell: AdviceFunction
    says_why: bool = False


def make_rules(
    conditions: Condition | tuple[Condition, ...],
    *tells: AdviceFunction,
    of: Traffic | tuple[Traffic, ...] = Traffic.ANYTHING,
    says_why: bool = False,
) -> tuple[AdviceRule, ...]:
    of_these = frozenset((conditions,) if isinstance(conditions, Condition) else conditions)
    traffic = (of,) if isinstance(of, Traffic) else of
    return tuple(AdviceRule(of_these, each, tell, says_why) for each in traffic for tell in tells)


DATAGRAMS: Final = (Traffic.DATAGRAMS, Traffic.DATAGRAMS_OF_A_CONNECT)
ALL_DATAGRAMS: Final = (*DATAGRAMS, Traffic.DATAGRAM_JOBS)
# Advice without numbers is in the STATUS table, on the same card.
ADVICE_RULES: Final[tuple[AdviceRule, ...]] = (
    # the present state, for `why`
    *make_rules(Condition.RECEIVING, receive.describe_receive_job, says_why=True),
    *make_rules(Condition.ESTABLISHING, link.describe_setup_wait, says_why=True),
    *make_rules(
        Condition.SENDING,
        job.describe_progress,
        of=(Traffic.ANYTHING, Traffic.MESSAGES, *DATAGRAMS),
        says_why=True,
    ),
    *make_rules(Condition.RECEIVING, receive.describe_message_job, of=Traffic.MESSAGES, says_why=True),
    *make_rules(Condition.RECEIVING, receive.describe_datagram_receive, of=DATAGRAMS, says_why=True),
    *make_rules(
        Condition.ESTABLISHING, link.describe_setup_wait, of=Traffic.DATAGRAMS_OF_A_CONNECT, says_why=True
    ),
    *make_rules(
        (Condition.STARTED, Condition.RUNNING),
        receive.describe_datagram_job,
        of=Traffic.DATAGRAM_JOBS,
        says_why=True,
    ),
    # what to check next
    *make_rules(
        Condition.INTERNAL_FAULT,
        make_constant_rule("please send the report", cause="the error is in trcvtui, not on the line"),
        make_constant_rule(
            "restart {instance}: `download {instance}`, or `plc stop` and `plc run`", "download {instance}"
        ),
    ),
    *make_rules(
        Condition.STILL_ASKED,
        make_constant_rule(
            "`set {instance} EN_R=0`, then EN_R=1 when the connection is up",
            "set {instance} EN_R=0",
            cause="EN_R is 1 while there is no connection",
        ),
        link.explain_lost_connection,
    ),
    *make_rules(Condition.ENDPOINT_GONE, link.explain_lost_connection),
    *make_rules(Condition.PORT_IN_USE, link.find_injection, link.explain_failure, job.suggest_another_port),
    *make_rules(Condition.PORT_RESERVED, job.explain_description_flaw, job.suggest_another_port),
    *make_rules(
        Condition.REFUSED,
        link.find_injection,
        job.explain_refused_selector,
        link.explain_failure,
        link.suggest_peer_action,
        link.explain_lost_connection,
    ),
    *make_rules(
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
        link.find_injection,
        link.explain_connection_limit,
        link.explain_failure,
        link.suggest_peer_action,
        link.explain_lost_connection,
    ),
    *make_rules(
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
        job.explain_description_flaw,
    ),
    *make_rules((Condition.LEN_OVER_DATA, Condition.LENGTH_WRONG), job.explain_wrong_length),
    *make_rules(Condition.AREA_CHANGED, job.explain_changed_parameter),
    *make_rules(Condition.DATA_SYMBOLIC, job.explain_symbolic_data),
    *make_rules(Condition.MESSAGE_TOO_LONG, job.explain_message_too_long),
    *make_rules((Condition.DATA_MISSING, Condition.DATA_EMPTY), job.explain_missing_data),
    *make_rules(Condition.RESULT_WRONG, job.explain_small_result),
    *make_rules(Condition.NAME_UNKNOWN, job.suggest_name_lookup),
    *make_rules(
        (
            Condition.TLS_MESSAGE,
            Condition.TLS_HANDSHAKE,
            Condition.TLS_UNSUPPORTED,
            Condition.TLS_DISCARDED,
            Condition.TLS_NO_CA,
            Condition.TLS_EXPIRED,
            Condition.TLS_EXTENSION,
        ),
        handshake.explain_handshake_failure,
    ),
    *make_rules(Condition.STRING_OVERRUN, serial.explain_string_too_long),
    *make_rules(Condition.RECEIVE_LENGTH_WRONG, serial.explain_wrong_frame_size),
    *make_rules(Condition.DATA_OVERRUN, serial.explain_frame_too_long),
    *make_rules(
        Condition.RECEIVING,
        receive.explain_shift_by_drop,
        receive.explain_shift,
        receive.explain_short_sender,
        receive.explain_several_messages,
        receive.explain_long_sender,
        receive.explain_odd_size,
        receive.explain_many_sizes,
        receive.explain_burst_size,
        receive.suggest_ad_hoc,
        receive.explain_nothing_sent,
        link.explain_quiet_line,
        link.explain_second_client,
    ),
    *make_rules(
        Condition.RECEIVED,
        receive.explain_shift_by_drop,
        receive.explain_shift,
        receive.explain_short_sender,
        receive.explain_long_sender,
        receive.explain_odd_size,
        receive.explain_many_sizes,
        receive.explain_partial_message,
    ),
    *make_rules(
        Condition.ESTABLISHING,
        link.find_injection,
        link.explain_refused_caller,
        link.explain_failure,
        link.explain_wrong_partner,
        link.suggest_peer_action,
        link.explain_unanswered_call,
        link.explain_lost_connection,
    ),
    *make_rules(Condition.NOT_CALLED, job.explain_not_called),
    *make_rules(
        Condition.NOT_CONNECTED,
        link.explain_early_request,
        link.explain_wrong_partner,
        link.explain_failure,
        link.suggest_peer_action,
    ),
    *make_rules(Condition.LINK_DEAD, link.find_injection, link.explain_dead_link),
    *make_rules((Condition.SENDING, Condition.SEND_BUFFER_FULL), job.explain_stall, job.explain_not_reading),
    *make_rules(Condition.CONNECT_IN_USE, job.explain_connect_holder),
    *make_rules(
        Condition.CONNECTED, job.explain_receive_off, job.explain_no_edge, link.explain_second_client
    ),
    *make_rules(Condition.NO_JOB, job.explain_missing_cont, link.explain_lost_connection),
    *make_rules(
        (
            Condition.PARTNER_CLOSED,
            Condition.FOUND_CLOSED,
            Condition.SHORT_FRAME,
            Condition.SEND_FAILED,
            Condition.RECEIVE_FAILED,
        ),
        link.find_injection,
        handshake.explain_handshake_failure,
        link.explain_partner_end,
        link.explain_small_messages,
    ),
    # messages over a connection
    *make_rules(
        Condition.RECEIVING,
        receive.explain_long_message,
        receive.explain_nothing_sent,
        receive.explain_short_message,
        link.explain_quiet_line,
        link.explain_second_client,
        of=Traffic.MESSAGES,
    ),
    *make_rules(Condition.RECEIVED, receive.explain_short_message, of=Traffic.MESSAGES),
    # datagrams
    *make_rules(
        Condition.RECEIVING,
        receive.explain_wrong_port,
        receive.explain_no_sender,
        receive.explain_cut_datagram,
        receive.explain_short_datagram,
        of=DATAGRAMS,
    ),
    *make_rules(
        Condition.RECEIVED, receive.explain_cut_datagram, receive.explain_short_datagram, of=DATAGRAMS
    ),
    *make_rules(Condition.RECEIVE_FAILED, link.find_injection, receive.explain_cut_datagram, of=DATAGRAMS),
    *make_rules(Condition.SEND_FAILED, link.find_injection, of=DATAGRAMS),
    *make_rules(Condition.CONNECT_IN_USE, job.explain_connect_holder, of=ALL_DATAGRAMS),
    *make_rules(Condition.LENGTH_WRONG, job.explain_wrong_length, of=ALL_DATAGRAMS),
    *make_rules(Condition.DATA_EMPTY, job.explain_missing_data, of=ALL_DATAGRAMS),
    *make_rules(Condition.NO_JOB, job.explain_missing_cont, of=DATAGRAMS),
    *make_rules(
        Condition.CREATED, receive.explain_unread, receive.explain_datagram_edge, of=Traffic.DATAGRAMS
    ),
    *make_rules((Condition.SENDING, Condition.SENT), receive.explain_sent, of=Traffic.DATAGRAMS),
    *make_rules((Condition.SENDING, Condition.SENT), receive.explain_done, of=Traffic.DATAGRAMS_OF_A_CONNECT),
    *make_rules(
        Condition.CONNECTED,
        receive.explain_unread,
        receive.explain_datagram_edge,
        of=Traffic.DATAGRAMS_OF_A_CONNECT,
    ),
    *make_rules(
        Condition.MESSAGE_TOO_LONG,
        receive.explain_datagram_too_long,
        of=(Traffic.DATAGRAMS_OF_A_CONNECT, Traffic.DATAGRAM_JOBS),
    ),
    *make_rules(
        Condition.REMOTE_WRONG,
        receive.explain_empty_addr,
        of=(Traffic.DATAGRAMS_OF_A_CONNECT, Traffic.DATAGRAM_JOBS),
    ),
    *make_rules(
        Condition.SEND_BUFFER_FULL,
        link.find_injection,
        receive.explain_sent,
        of=Traffic.DATAGRAMS_OF_A_CONNECT,
    ),
    # TUSEND and TURCV
    *make_rules(
        Condition.NO_JOB, receive.explain_unread, receive.explain_datagram_edge, of=Traffic.DATAGRAM_JOBS
    ),
    *make_rules(
        (Condition.STARTED, Condition.RUNNING),
        receive.explain_wrong_port,
        receive.explain_no_sender,
        receive.explain_short_datagram,
        receive.explain_sent,
        of=Traffic.DATAGRAM_JOBS,
    ),
    *make_rules(Condition.RECEIVED, receive.explain_short_datagram, of=Traffic.DATAGRAM_JOBS),
    *make_rules(Condition.SENT, receive.explain_sent, of=Traffic.DATAGRAM_JOBS),
    *make_rules(
        (Condition.RECEIVE_FAILED, Condition.SEND_FAILED), link.find_injection, of=Traffic.DATAGRAM_JOBS
    ),
    *make_rules(Condition.NOT_CONNECTED, receive.explain_closed_socket, of=Traffic.DATAGRAM_JOBS),
    *make_rules(Condition.NEEDS_ADDR, receive.explain_empty_addr, of=Traffic.DATAGRAM_JOBS),
    *make_rules(Condition.FINISHED, receive.explain_result_layout, of=Traffic.RESULT),
)

JOB_CONDITIONS: Final = frozenset({Condition.STARTED, Condition.RUNNING})


@dataclass(frozen=True, slots=True)
class Advice:
    """`why` is the present state. `causes` is what is proven, the most telling first. `do` is what to do.

    `code` is the STATUS of the last failed attempt, on which the table says more than on the shown STATUS.
    `rules` are the rules that returned a sentence.
    """

    why: str
    causes: tuple[str, ...] = ()
    do: tuple[SuggestedAction, ...] = ()
    code: int | None = None
    rules: tuple[AdviceFunction, ...] = ()

    @property
    def checks(self) -> tuple[str, ...]:
        """Return `causes` and the texts of `do`: everything except `why`."""
        return (*self.causes, *(each.text for each in self.do))


def make_advice(e: Evidence) -> Advice:
    failed = e.facts.attempt
    words = describe_cause(failed.cause, e.block) if failed is not None else ""
    first = _describe_failed_attempt(e, words)
    rules = () if first and _has_failed_early(e) else _select_rules(e)
    answers = _ask_rules(e, (serial.explain_port_trouble, *rules))
    parts = [*first, *(sentence for _, sentence in answers)]
    causes = tuple(dict.fromkeys(part.cause for part in parts if part.cause))
    do = tuple(dict.fromkeys(line for part in parts for line in part.do))
    if first:  # its sentence may contain a cause already
        causes = (causes[0], *(cause for cause in causes[1:] if cause not in causes[0]))
    return Advice(explain_status(e), causes, do, _attempt_code(e), tuple(tell for tell, _ in answers))


def _ask_rules(e: Evidence, rules: Iterable[AdviceFunction]) -> list[tuple[AdviceFunction, AdvisedCause]]:
    return [(tell, as_advised_cause(answer)) for tell in rules if (answer := tell(e))]


def _select_rules(e: Evidence) -> tuple[AdviceFunction, ...]:
    found = _find_rules(e, _traffic_of(e)) or _find_rules(e, Traffic.ANYTHING) or (link.find_injection,)
    return (*found, job.suggest_description_key)


def _find_rules(e: Evidence, traffic: Traffic, says_why: bool = False) -> tuple[AdviceFunction, ...]:
    condition = _condition(e)
    return tuple(
        rule.tell
        for rule in ADVICE_RULES
        if rule.traffic is traffic and condition in rule.conditions and rule.says_why is says_why
    )


def _traffic_of(e: Evidence) -> Traffic:
    row = block_row(e.block)
    if row.speaks_udp:
        return Traffic.DATAGRAM_JOBS if row.datagrams else Traffic.DATAGRAMS
    if row.data_pin == "RESULT":
        return Traffic.RESULT
    if e.is_datagram:
        return Traffic.DATAGRAMS_OF_A_CONNECT
    return Traffic.MESSAGES if e.has_messages else Traffic.ANYTHING


def _condition(e: Evidence) -> Condition:
    condition = Condition(e.condition)
    if condition is Condition.RECEIVING_PART:
        return Condition.RECEIVING
    return (block_row(e.block).runs_as or condition) if condition in JOB_CONDITIONS else condition


def explain_status(e: Evidence) -> str:
    """Return why a block shows its STATUS: the present state, or the cause of the edge if no rule fits."""
    traffic = _traffic_of(e)
    found = _find_rules(e, traffic, says_why=True)
    if not found and traffic not in (Traffic.DATAGRAMS, Traffic.DATAGRAM_JOBS):
        found = _find_rules(e, Traffic.ANYTHING, says_why=True)
    describing = [tell for tell in found if e.need or tell is link.describe_setup_wait]
    state = as_advised_cause(describing[0](e)).cause if describing else ""
    if not state:
        return serial.describe_port_wait(e) or describe_cause(e.cause, e.block)
    return INJECTED_PREFIX + state if e.cause.injected else state


def describe_cause(cause: Cause, block: str) -> str:
    """Return the cause of an edge: what happened, call and errno, partner or holder, whether injected."""
    text = cause.name
    if cause.call == "session":  # the answer came inside the connection
        text = SESSION_ERROR_TEXTS.get(cause.error, f"{cause.name} ({cause.error})")
    elif cause.call in UNDERLYING_CALLS:  # it is no call
        text += "" if cause.why is CauseKind.PARAMETER and cause.detail else f" ({cause.error})"
    elif cause.call and cause.call in text:
        text = f"{cause.call} gave {cause.error or EMPTY_READ_TEXT}"
    elif cause.call:
        text += f" ({cause.call} gave {cause.error or EMPTY_READ_TEXT})"
    if cause.injected:
        text = INJECTED_PREFIX + text
    text += _format_sizes(cause, block)
    if cause.peer and cause.peer not in text:
        text += f", partner {cause.peer}"
    text += f", listening on {cause.local}" if cause.local else ""
    end = "; ".join(filter(None, (cause.holder, cause.detail)))
    colon = ": " if cause.why in (CauseKind.PARAMETER, CauseKind.OWNER) else ", "
    return f"{text}{colon}{end}" if end else text


def _format_sizes(cause: Cause, block: str) -> str:
    row = block_row(block)
    if cause.have is not None and cause.need is not None:
        is_small = cause.why is CauseKind.PARAMETER and cause.have < cause.need  # a variable, a ComBuffer
        if cause.value is None and (cause.pin or is_small):
            return f": {cause.have} of {count(cause.need, 'byte')}"
        if cause.pin:
            whole = f" ({count(cause.have, 'byte')})" if cause.value != cause.have else ""
            return f": {cause.pin} is {cause.value}{whole}, allowed: at most {count(cause.need, 'byte')}"
        if not cause.have and row.receives_on_net and row.speaks_udp:  # a datagram comes whole or not at all
            return f", at most {count(cause.need, 'byte')}"
        if cause.why is CauseKind.FRAME and cause.have != cause.need:
            return f", {count(cause.have, 'byte')}"
        if cause.have > cause.need:
            return f": {count(cause.have, 'byte')}, at most {cause.need} fit"
        where = "taken" if row.sends_on_net or row.writes_tx_buffer else "received"
        return f", {cause.have} of {count(cause.need, 'byte')} {where}"
    if cause.pin and cause.value is not None and cause.pin not in cause.name:
        return f" ({cause.pin} is {cause.value})"
    return ""


# -- the last failed attempt, while the next one is waited for --------------------------------------------

# What shows while a connection is built; RUNNING of the block that builds one.
BUILDING_CONDITIONS: Final = frozenset({Condition.CREATING, Condition.CREATED, Condition.ESTABLISHING})


def _is_building(e: Evidence) -> bool:
    is_run = e.condition == Condition.RUNNING and block_row(e.block).runs_as in BUILDING_CONDITIONS
    return e.condition in BUILDING_CONDITIONS or is_run


def _attempt_code(e: Evidence) -> int | None:
    """Return the code of the last failed attempt. Return None if no attempt follows or no code showed."""
    attempt = e.facts.attempt
    return attempt.status if attempt is not None and attempt.condition and _is_building(e) else None


def _describe_failed_attempt(e: Evidence, words: str) -> tuple[AdvisedCause, ...]:
    """If the last attempt showed a code, return its causes and remedies, or `words` if no rule fits."""
    attempt = e.facts.attempt
    if attempt is None or _attempt_code(e) is None:
        return ()
    then = replace(e, condition=attempt.condition, cause=attempt.cause)
    others = (tell for tell in _select_rules(then) if tell is not link.explain_lost_connection)
    first, *rest = [sentence for _, sentence in _ask_rules(then, others)] or [AdvisedCause(words)]
    said = f" ({attempt.said})" if attempt.said and attempt.said not in first.cause else ""
    head = f"the last attempt ended with {attempt.status:04X} in scan {attempt.at.scan}"
    return (first._replace(cause=": ".join(filter(None, (head, first.cause))) + said), *rest)


def _has_failed_early(e: Evidence) -> bool:
    """Return whether the attempt failed before it had a socket, so ports and partners do not matter."""
    attempt = e.facts.attempt
    return attempt is not None and attempt.cause.call in SETUP_CALLS
