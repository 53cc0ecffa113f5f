"""A symptom is something wrong that a block showed. This module knows which causes explain which symptom.

A symptom is a Finding. `at` is its first time (UTC), `leads_to` the condition of an ERROR. `evidence` is
a text, then STATUS card sentences. If the block knows why TLS failed, `is_fact` is True (better remedy).
Rule: a symptom without a cause is itself a finding, so that a run with an ERROR is never healthy.
"""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.diagnosis.cause_words import CAUSE_WORDS
from trcvtui.snapshots.doctor import Finding

C = Condition
LINK_CAUSES: Final = frozenset({
    "address", "second-client", "refused", "filtered", "wrong-tsap", "tls-refused", "closes-each-message",
    "reconnect-storm", "no-keep-alive", "dead-link", "resets", "turned-away", "no-such-host", "duplicate-ip",
    "half-open", "mtu", "plain-tcp",
})  # fmt: skip
FRAME_CAUSES: Final = frozenset({
    "frame-short", "frame-long", "adhoc-missing", "adhoc-splits", "header", "padding", "byte-order",
    "shifted", "merged", "framing", "datagram-size", "encoding", "text",
})  # fmt: skip
LINK_ERRORS: Final = frozenset({
    C.CONNECT_FAILED, C.NOT_CONNECTED, C.SEND_FAILED, C.RECEIVE_FAILED, C.LINK_DEAD, C.PARTNER_CLOSED,
    C.REFUSED, C.UNREACHABLE, C.NOT_NOW, C.FOUND_CLOSED, C.STILL_ASKED, C.ENDPOINT_GONE, C.SHORT_FRAME,
    C.ACCEPT_FAILED, C.DISCONNECT_FAILED, C.RESET_FAILED,
})  # fmt: skip
# A block refuses its job whatever the line does: bytes that wait in the stack are then not the line's fault.
JOB_REFUSALS: Final = frozenset({
    C.DATA_EMPTY, C.LENGTH_WRONG, C.LEN_OVER_DATA, C.DATA_MISSING, C.DATA_REFUSED, C.DATA_SYMBOLIC,
    C.LEN_OF_TEXT, C.CONNECT_IN_USE, C.NO_BUFFER, C.OTHER_TRANSPORT, C.NULL_POINTER, C.NULL_RECEIVE_POINTER,
    C.RECEIVE_LENGTH_WRONG,
})  # fmt: skip
_DESCRIPTION_CAUSES: Final = ("address", "limits")
# Causes of an ERROR besides those whose `leads_to` (cause_words.py) has its condition.
_CAUSES_OF_ERRORS: Final[tuple[tuple[frozenset[Condition], frozenset[str]], ...]] = (
    (LINK_ERRORS, LINK_CAUSES),
    (frozenset({C.NOT_CONNECTED, C.STILL_ASKED}), frozenset({"not-connected-request"})),
    (frozenset({C.SHORT_FRAME}), FRAME_CAUSES),
    (
        frozenset({C.QUEUE_FULL, C.SEND_BUFFER_FULL, C.PARAMETER_CHANGED}),
        frozenset({"request-too-fast", "partner-not-reading", "dead-link"}),
    ),
    (frozenset({C.MESSAGE_TOO_LONG}), frozenset({"datagram-size", "frame-long", "limits"})),
    (frozenset({C.DATA_OVERRUN, C.STRING_OVERRUN}), frozenset({"framing"})),
    (frozenset({C.AREA_CHANGED}), frozenset({"shifted"})),
    (frozenset(one for one in Condition if one.name.startswith("TLS_")), frozenset({"tls-refused"})),
    (
        frozenset({
            C.NO_SOCKET, C.LENGTH_WRONG, C.LEN_OVER_DATA, C.CONNECT_IN_USE, C.BIND_FAILED, C.PORT_IN_USE,
            C.PORT_RESERVED,
            C.WRONG_LOCAL_ADDRESS, C.REMOTE_WRONG, C.ID_WRONG, C.ID_OTHER, C.ID_BUILDING, C.TSAP_WRONG,
            C.TYPE_WRONG, C.INTERFACE_WRONG, C.INTERFACE_BARE, C.NO_DESCRIPTION, C.DESCRIPTION_LENGTH,
            C.PARAMETER_WRONG,
            C.NEEDS_ADDR, C.OTHER_TRANSPORT, C.UDP_ACTIVE, C.NAME_EMPTY, C.NAME_NOT_FULL, C.TLS_REFERENCE,
            C.TLS_DATAGRAMS,
        }),
        frozenset(_DESCRIPTION_CAUSES),
    ),
)  # fmt: skip


def list_explaining_causes(symptom: Finding) -> frozenset[str]:
    """Return the causes that explain a symptom, if they are found on the same line."""
    if not symptom.leads_to:
        return LINK_CAUSES if symptom.cause == "not-connected" else FRAME_CAUSES | LINK_CAUSES
    (condition,) = symptom.leads_to
    leading = {cause for cause, row in CAUSE_WORDS.items() if condition in row.leads_to}
    return frozenset(leading.union(*(causes for errors, causes in _CAUSES_OF_ERRORS if condition in errors)))
