"""What a refusal proves: a flaw of a description, a port, a name, a certificate, DATA or LEN.

Each rule takes the evidence and answers one sentence, or "" where it does not apply.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.net.connection.description import selector_text
from trcvtui.net.connection.description_check import Protocol, meaning
from trcvtui.net.layer import TlsError
from trcvtui.rig.diagnosis import job as job
from trcvtui.rig.diagnosis import link as link
from trcvtui.rig.diagnosis.evidence import Evidence
from trcvtui.rig.diagnosis.receive import limit
from trcvtui.rig.wording import count

Rule = Callable[[Evidence], str]
ISO_PORT: Final = 102
MOST_BYTES: Final = 8


def says(sentence: str) -> Rule:
    """Return the rule that always answers this; {connect}, {peer} and {instance} are filled in."""

    def rule(e: Evidence) -> str:
        return sentence.format(connect=_connect(e), peer=_peer(e), instance=e.instance)

    return rule


def _connect(e: Evidence) -> str:
    return e.config.name if e.config is not None else "this CONNECT"


def _peer(e: Evidence) -> str:
    return e.cause.peer or (e.link.remote if e.link is not None else "") or "the partner"


# -- the description -------------------------------------------------------------------------------------


def where_the_flaw_is(e: Evidence) -> str:
    """Return which bytes of the description hold the flaw."""
    if e.config is None or e.config.description is None or e.config.flaw is None:
        return ""
    field = e.config.description.structure.field(e.config.flaw.field)
    if field is None:
        return ""
    raw = e.config.description.data[field.offset : field.offset + field.size]
    held = raw[:MOST_BYTES].hex(" ") + (" …" if len(raw) > MOST_BYTES else "")
    structure = e.config.description.structure.name
    return (
        f"{structure}.{field.name} is byte {field.offset} of {e.config.name}, and holds {held or 'nothing'}"
    )


def press_c(e: Evidence) -> str:
    """The screen shows the description byte for byte."""
    if e.cause.call != "description" or e.config is None or e.config.description is None:
        return ""
    return f"press C: the description of {e.config.name} byte for byte, what is wrong with it first"


def another_port(e: Evidence) -> str:
    """Return which port may be taken; the port of ISO-on-TCP has a key of its own."""
    config = e.config
    if config is None:
        return ""
    says_iso = config.description is not None and meaning(config.description).protocol is Protocol.ISO
    if config.local.port == ISO_PORT or says_iso:
        return (
            f"{ISO_PORT} is the port of ISO-on-TCP, which TCON_IP_RFC speaks; where it is taken, or not "
            f"for every user, `IsoPort = 2102` in [[connect]] {config.name} takes another, the partner's too"
        )
    return f"LocalPort of {config.name} is {config.local.port}: free ones are 2000 to 5000"


def ask_for_the_name(e: Evidence) -> str:
    """Return how to ask for the partner's name outside of the bench."""
    name = e.config.remote_name if e.config is not None else ""
    if not name and e.config is not None and e.config.description is not None:
        name = meaning(e.config.description).remote_name
    return (
        f"`getent hosts {name}`: is the name right, and does this machine's DNS server know it?"
        if name
        else ""
    )


# -- the partner -----------------------------------------------------------------------------------------


def no_such_selector(e: Evidence) -> str:
    """The partner took the call and refused its T-selector."""
    if e.cause.call != "session" or e.config is None or e.config.description is None:
        return ""
    says_what = meaning(e.config.description)
    if says_what.protocol is not Protocol.ISO:
        return ""
    ours = selector_text(says_what.local_tsap) or "none"
    theirs = selector_text(says_what.remote_tsap) or "any"
    return (
        f"{_peer(e)} took the call and refused it: crosswise, its remote selector has to be {ours} (our "
        f"local one) and its local selector {theirs} (our remote one)"
    )


def look_at_the_certificate(e: Evidence) -> str:
    """Return how to look at what the partner shows."""
    if e.config is None or not e.config.active or not e.cause.peer:
        return ""
    return f"`openssl s_client -showcerts -connect {e.cause.peer}` shows what the partner shows"


def showed_no_certificate(e: Evidence) -> str:
    """The partner showed no certificate, or one that will not do."""
    if e.cause.error == TlsError.NO_CERTIFICATE:
        return f"{_peer(e)} showed no certificate, and is asked for one: its own has to be set there"
    return f"{_peer(e)} showed a certificate for another use, or with too short a key"


# -- DATA and LEN ----------------------------------------------------------------------------------------


def message_too_long(e: Evidence) -> str:
    """A message comes whole or not at all: how much room it needs."""
    have, need = e.cause.have, e.cause.need
    if not have or not need:
        return ""
    return (
        f"{limit(e)}, the message had {count(have, 'byte')}: {count(have - need, 'byte')} too many, and it "
        f"is lost; DATA and LEN of at least {have} take it"
    )


def must_stay(e: Evidence) -> str:
    """DATA or LEN changed while a job ran."""
    pin = e.cause.pin or "DATA"
    held = "until DONE or ERROR: change it while BUSY is 0"
    if pin == "DATA":
        return f"DATA has to stay {held}, or fill a second variable and copy it before the edge"
    return f"{pin} has to stay {held}"


def result_too_small(e: Evidence) -> str:
    """RESULT cannot hold what is read."""
    if e.cause.have is None or e.cause.need is None:
        return ""
    return f"RESULT ({e.data}) has {count(e.cause.have, 'byte')}, the diagnosis has {e.cause.need}"


_FLAW: Final = (where_the_flaw_is,)
_SHOWN: Final = look_at_the_certificate
# What is more than the flaw itself, in the order of the conditions.
_OWN: Final[dict[Condition, tuple[Rule, ...]]] = {
    Condition.FOUND_CLOSED: (
        *link.LOST,
        says("no job ran, nothing of one is lost; with CONT at 1 {connect} is built again"),
    ),
    Condition.STILL_ASKED: (
        says("EN_R is 1 while there is no connection: `set {instance} EN_R=0` until it stands"),
        link.lost_before,
    ),
    Condition.ENDPOINT_THERE: (says("{connect} stands already: TDISCON closes it, then TCON may build it"),),
    Condition.ID_BUILDING: (
        says("two CONNECTs of one ID are one connection: one block builds it, or {connect} gets another ID"),
    ),
    Condition.ID_OTHER: (says("each connection has an ID of its own: give {connect} one that is free"),),
    Condition.ENDPOINT_GONE: (
        says("nobody has built {connect}, or it was closed: TCON first"),
        link.lost_before,
    ),
    Condition.LET_GO: (
        says("another block on {connect} closed or reset it: look at CONT, COM_RST, TDISCON, T_RESET there"),
    ),
    Condition.RESET_IN_JOB: (says("the job that ran is lost, and bytes on the way with it: start it again"),),
    Condition.PORT_IN_USE: (link.injected, link.what_failed, another_port),
    Condition.PORT_RESERVED: (where_the_flaw_is, another_port),
    Condition.REFUSED: (
        link.injected,
        no_such_selector,
        link.what_failed,
        link.peer_that_could_call,
        link.lost_before,
    ),
    Condition.UNREACHABLE: link.FAILED_ATTEMPT,
    Condition.REMOTE_WRONG: (*_FLAW, says("it has to be one partner: no group, no broadcast, not this PLC")),
    Condition.LEN_OVER_DATA: job.LENGTH,
    Condition.AREA_CHANGED: (must_stay,),
    Condition.MESSAGE_TOO_LONG: (message_too_long,),
    Condition.DATA_MISSING: job.EMPTY,
    Condition.DATA_REFUSED: (says("take an ARRAY OF BYTE, or a STRUCT that has the bits as members"),),
    Condition.DATA_SYMBOLIC: (says("`set {instance} LEN=0` moves all of DATA; or wire a DATA of bytes"),),
    Condition.LEN_OF_TEXT: (says("`set {instance} LEN=0` moves the whole text, its header with it"),),
    Condition.RESULT_WRONG: (result_too_small,),
    Condition.NO_DESCRIPTION: (
        says("CONNECT has to be a whole TCON_IP_v4, TCON_IP_RFC, TCON_QDN or the like"),
    ),
    Condition.DESCRIPTION_LENGTH: (says("take the structure alone, all of it: not the DB or UDT around it"),),
    Condition.ID_WRONG: (*_FLAW, says("each connection has an ID of its own, the same at its blocks")),
    Condition.INTERFACE_WRONG: (
        *_FLAW,
        says("the device configuration names it: the first port is often 64"),
    ),
    Condition.INTERFACE_BARE: (
        says("give [[connect]] {connect} a LocalAddress: it stands for the interface"),
    ),
    Condition.TYPE_WRONG: _FLAW,
    Condition.NEEDS_ADDR: (says("datagrams are sent by TUSEND and taken by TURCV, with an address in ADDR"),),
    Condition.OTHER_TRANSPORT: (
        says("ConnectionType 16#13 (UDP) is for blocks with an ADDR, TCP for TSEND and TRCV without one"),
    ),
    Condition.UDP_ACTIVE: (*_FLAW, says("ActiveEstablished is FALSE on both ends of UDP: nobody calls")),
    Condition.TSAP_WRONG: (
        *_FLAW,
        says("two bytes begin with E0, as 16#E002; longer ones are text: TCP-1"),
    ),
    Condition.PARAMETER_WRONG: _FLAW,
    Condition.NAME_EMPTY: (*_FLAW, says("an active end needs its partner's name, with a dot behind it")),
    Condition.NAME_NOT_FULL: (*_FLAW, says("a whole name ends with a dot: plc2.line.local.")),
    Condition.NO_RESOLVER: (
        says("the CPU has no DNS server: name one at its interface, or take TCON_IP_v4"),
    ),
    Condition.NAME_UNKNOWN: (ask_for_the_name,),
    Condition.TLS_MESSAGE: (
        says("{peer} spoke no TLS: is ActivateSecureConn TRUE there, too, and is this the right port?"),
        _SHOWN,
    ),
    Condition.TLS_HANDSHAKE: (
        says("no version or cipher in common, or {peer} refused our certificate: its log says which"),
        _SHOWN,
    ),
    Condition.TLS_UNSUPPORTED: (
        showed_no_certificate,
        _SHOWN,
    ),
    Condition.TLS_DISCARDED: (says("not valid yet, revoked, or not to be read: look at its dates"), _SHOWN),
    Condition.TLS_NO_CA: (
        says("who signed the certificate of {peer} is not trusted: [[certificate]] has to name it"),
        _SHOWN,
    ),
    Condition.TLS_EXPIRED: (
        says("the certificate of {peer} is over, or the clock here is wrong: `date`"),
        _SHOWN,
    ),
    Condition.TLS_INTEGRITY: (
        link.injected,
        says("a record from {peer} was changed on its way: a proxy, or a fault of the line"),
    ),
    Condition.TLS_EXTENSION: (
        says(
            "the certificate of {peer} bears another name than the one that was asked for, or an extension "
            "that is not known: look at its subjectAlternateName"
        ),
        _SHOWN,
    ),
    Condition.TLS_SERVER_BARE: (
        *_FLAW,
        says("the passive end shows a certificate: its number belongs there"),
    ),
    Condition.TLS_DATAGRAMS: (*_FLAW, says("ActivateSecureConn FALSE, or ConnectionType 16#0B for TCP")),
    Condition.TLS_CLIENT_ASKS: (*_FLAW, says("only the passive end asks for a client's certificate")),
    Condition.TLS_SERVER_CHECKS: (*_FLAW, says("only the active end checks a name")),
    Condition.TLS_REFERENCE: (*_FLAW, says("[[certificate]] with that number is missing, or has no key")),
}
NEXT: Final = {condition: (*rules, press_c) for condition, rules in _OWN.items()}
