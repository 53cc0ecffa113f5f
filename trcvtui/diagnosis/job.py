"""Rules for a send job, a lock, a pin, a buffer, a description and a certificate: which of them is wrong.

Each rule, here and in receive, link and serial, takes the evidence and returns one sentence, or "" if it
does not apply. `do` of the answer says what to do. A rule that proves nothing by itself returns `do` alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from trcvtui.blocks.table import block_row
from trcvtui.diagnosis.evidence import Evidence
from trcvtui.history.records import ConnectFacts
from trcvtui.net.connection.description import format_selector
from trcvtui.net.connection.description_check import Transport, read_spec
from trcvtui.snapshots.bench import PeerSnapshot
from trcvtui.wording import age_text, count


class SuggestedAction(NamedTuple):
    """What to do: a sentence, and the bench lines that do it in order. `lines` is () if no line does it.

    If `needs_trial`, the lines were not tried on received bytes, and change what jobs take or bytes mean.
    """

    text: str
    lines: tuple[str, ...] = ()
    needs_trial: bool = False


class AdvisedCause(NamedTuple):
    """The proven cause, or "" if none is proven, and what to do about it."""

    cause: str
    do: tuple[SuggestedAction, ...] = ()


RuleAnswer = str | AdvisedCause  # a text alone is a cause, "": nothing
AdviceFunction = Callable[[Evidence], RuleAnswer]


def tip(cause: str, text: str, *lines: str, needs_trial: bool = False) -> AdvisedCause:
    """Return a cause and one thing to do about it. Each `{}` in `text` becomes one of the bench lines."""
    for line in lines:
        text = text.replace("{}", f"`{line}`", 1)
    return AdvisedCause(cause, (SuggestedAction(text, lines, needs_trial),))


def as_advised_cause(answer: RuleAnswer) -> AdvisedCause:
    return AdvisedCause(answer) if isinstance(answer, str) else answer


GONE: Final = " (gone)"


# -- sending ----------------------------------------------------------------------------------------------


def describe_progress(e: Evidence) -> str:
    """Return how much of a send job the local stack has taken, and how much is not acknowledged."""
    text = f"the local stack has taken {e.have} of {count(e.need, 'byte')}"
    if e.is_past:
        return text
    if e.have < e.need and e.quiet_ns is not None:
        text += f", no byte in the last {age_text(e.quiet_ns)}"
    return text + _describe_unacknowledged(e)


def _describe_unacknowledged(e: Evidence) -> str:
    waiting = e.link.unacknowledged if e.link is not None else None
    return f"; {count(waiting, 'byte')} not acknowledged by the partner" if waiting else ""


def explain_not_reading(e: Evidence) -> str:
    """Our bytes stay unacknowledged, or the stack takes no more: the partner does not read."""
    if e.is_past:
        return ""
    waiting = e.link.unacknowledged if e.link is not None else None
    stuck = e.condition == "send buffer full" or e.have < e.need
    if not stuck:
        return ""
    partner = e.link.remote if e.link is not None and e.link.remote else "the partner"
    held = f"not acknowledged: {count(waiting, 'byte')} sent here; " if waiting else ""
    return f"{held}{partner} has closed its window: its receive call is off, or slower than REQ"


def explain_stall(e: Evidence) -> RuleAnswer:
    """The partner is a peer of this bench. A command has stopped the peer from reading."""
    peer = find_connected_peer(e)
    if peer is None or not peer.stalled:
        return ""
    return tip(f"{peer.name} does not read: a command stopped it", "{}", f"peer {peer.name} resume")


def find_connected_peer(e: Evidence) -> PeerSnapshot | None:
    if e.link is None or e.link.state != "connected":
        return None
    ends = e.link.remote, e.link.local
    return next((p for p in e.peers if p.state == "connected" and (p.local, p.remote) == ends), None)


# -- the holder of the CONNECT -------------------------------------------------------------------------------


def explain_connect_holder(e: Evidence) -> RuleAnswer:
    """Say which other instance works on this CONNECT, and what frees the CONNECT."""
    sends = block_row(e.block).sends_on_net
    owners = (e.link.senders if sends else e.link.receivers) if e.link is not None else ()
    holder = next((o for o in owners if o.removesuffix(GONE) != e.instance or o.endswith(GONE)), "")
    holder = holder or e.cause.holder
    if not holder:
        return ""
    side = "send" if sends else "receive"
    connect = e.link.name if e.link is not None else e.config.name if e.config is not None else "this CONNECT"
    if holder.endswith(GONE) or e.cause.is_orphan:
        return tip(
            f"{holder.removesuffix(GONE)} was deleted or downloaded in mid frame and still holds the {side} "
            f"side of {connect}",
            f"to free {connect}, set CONT to 0, then to 1; or set COM_RST",
        )
    cure, *lines = ("wait for its DONE or ERROR",) if sends else ("{} frees it", f"set {holder} EN_R=0")
    held = f"{holder} holds the {side} side of {connect}"
    return tip(held, f"{cure}; better give each instance its own CONNECT", *lines)


# -- pins and parameters ----------------------------------------------------------------------------------


def explain_wrong_length(e: Evidence) -> RuleAnswer:
    """If LEN exceeds DATA or the maximum, say which limit it exceeds and which LEN fits."""
    have, most = e.cause.have, e.cause.need
    if have is None or most is None:
        return ""
    data = f"DATA ({e.data}) has {count(e.data_size, 'byte')}" if e.data else "DATA is open"
    if e.cause.value == 65535 and e.has_adhoc and e.config is not None and e.config.description:
        cause = f"only instructions before 3.0 take LEN 65535 as ad hoc; {data}"
        return tip(cause, "{} receives ad hoc", f"set {e.instance} ADHOC=1 LEN=0")
    if e.cause.value:
        lines = (f"set {e.instance} LEN=0",) if 0 < e.data_size <= most else ()
        way = "set LEN to 0 for all of DATA" if e.data_size <= most else f"set LEN to at most {most}"
        cause = f"LEN is {e.cause.value}, and {data}: {count(have - most, 'byte')} too many"
        return tip(cause, f"{way}, or enlarge DATA", *lines, needs_trial=not e.has_adhoc)
    return tip(
        f"LEN is 0, and {data}: {count(have - most, 'byte')} more than a job can have",
        f"set LEN to at most {most}",
    )


def explain_missing_data(e: Evidence) -> RuleAnswer:
    return f"{e.data} has 0 bytes" if e.data else tip("the DATA pin is open", "connect a variable to DATA")


def explain_receive_off(e: Evidence) -> RuleAnswer:
    is_off = e.cause.value == 0 if e.cause.pin == "EN_R" and e.is_past else e.pin("EN_R") == 0
    if not is_off or e.condition != "connected":
        return ""
    drop = e.facts.drop
    if drop is None:
        return "EN_R is 0: bytes that arrive now wait unread in the socket; nothing is lost"
    text = f"EN_R fell in scan {drop.at.scan} with {drop.have} of {count(drop.need, 'byte')} collected"
    text = f"{text}; they were dropped, and the next frame {_describe_next_frame_begin(e.facts)}"
    lines = (f"pulse {e.instance} COM_RST",) if e.pin("COM_RST") is not None else ()
    return text if e.facts.drop_cuts is False else tip(text, "pulse COM_RST before EN_R=1", *lines)


def _describe_next_frame_begin(facts: ConnectFacts) -> str:
    if facts.drop_cuts is False:
        return "begins with a message"
    if facts.drop_cuts is None or facts.after_drop is None:
        return "may begin in the middle of a message"
    byte, message = facts.after_drop.first, facts.after_drop.number
    return f"begins in the middle of a message, with byte {byte} of {facts.sender}'s message {message}"


def explain_no_edge(e: Evidence) -> RuleAnswer:
    return explain_req(e) if e.condition == "connected" else ""


def explain_req(e: Evidence) -> RuleAnswer:
    stays = tip(
        "REQ stays 1: a job starts with a rising edge only", "set REQ to 0 first", f"set {e.instance} REQ=0"
    )
    return stays if e.pin("REQ") == 1 else ""


def explain_missing_cont(e: Evidence) -> RuleAnswer:
    """Say that there is no job: CONT is 0, and REQ or EN_R, where they can connect, request nothing."""
    if e.pin("CONT") != 0 or e.condition != "no job":
        return ""
    stay = f"set {e.instance} CONT=1"
    keeps = SuggestedAction(f"or `{stay}` to stay connected", (stay,))
    if e.cause.pin == "REQ":
        send, clears = f"pulse {e.instance} REQ", (f"set {e.instance} REQ=0",) * bool(e.pin("REQ"))
        text = f"{'set REQ to 0 first, then ' * len(clears)}`{send}` to connect, send and disconnect"
        return AdvisedCause("REQ stays 1" * len(clears), (SuggestedAction(text, (*clears, send)), keeps))
    if e.cause.pin == "EN_R":
        text, receive = "{} to connect, receive and disconnect", f"set {e.instance} EN_R=1"
        return AdvisedCause("", (*tip("", text, receive).do, keeps))
    high = [pin for pin in ("EN_R", "REQ") if e.pin(pin)]
    return tip(f"CONT is 0{f' while {high[0]} is 1' if high else ''}", "{}", stay)


def explain_not_called(e: Evidence) -> RuleAnswer:
    if e.is_stopped:
        return tip("the PLC is in STOP: no block is called", "{}", "plc run")
    return "" if e.is_past else tip(f"no scan has called {e.instance} yet", "check whether its task runs")


def limit_text(e: Evidence) -> str:
    """Return what decides how many bytes a frame takes: `LEN is 96`, `LEN is 0 and DATA has 96 bytes`."""
    length = e.pin("LEN")
    if length == 0 or (length is None and e.need == e.data_size):
        return f"LEN is 0 and DATA ({e.data}) has {count(e.data_size, 'byte')}"
    return f"LEN is {e.need}"


ISO_PORT: Final = 102
MOST_BYTES: Final = 8


def make_constant_rule(text: str, *lines: str, cause: str = "") -> AdviceFunction:
    """Return a rule that always gives this answer; {peer} and {instance} are filled in."""

    def constant(e: Evidence) -> RuleAnswer:
        names = {"peer": _partner_name(e), "instance": e.instance}
        return tip(*(part.format(**names) for part in (cause, text, *lines)))

    return constant


def _partner_name(e: Evidence) -> str:
    return e.cause.peer or (e.link.remote if e.link is not None else "") or "the partner"


# -- the description -------------------------------------------------------------------------------------


def explain_description_flaw(e: Evidence) -> str:
    if e.config is None or e.config.description is None or e.config.flaw is None:
        return ""
    field = e.config.description.structure.field(e.config.flaw.field)
    if field is None:
        return ""
    raw = e.config.description.data[field.offset : field.offset + field.size]
    held = raw[:MOST_BYTES].hex(" ") + (" …" if len(raw) > MOST_BYTES else "")
    structure = e.config.description.structure.name
    place = f"{structure}.{field.name} begins at byte {field.offset} of {e.config.name}"
    return f"{place} and holds {held or 'nothing'}"


def suggest_description_key(e: Evidence) -> RuleAnswer:
    if e.cause.call != "description" or e.config is None or e.config.description is None:
        return ""
    return tip("", f"press `C` to see the description of {e.config.name} byte by byte, with the fault first")


def suggest_another_port(e: Evidence) -> RuleAnswer:
    """Return which port to take; the key for ISO-on-TCP is IsoPort."""
    config = e.config
    if config is None:
        return ""
    says_iso = config.description is not None and read_spec(config.description).protocol is Transport.ISO
    if says_iso:  # the key IsoPort is refused for any other description
        return tip(
            f"{ISO_PORT} is the port of ISO-on-TCP, which TCON_IP_RFC uses",
            f"if port {ISO_PORT} is in use, or your user may not use it: set "
            f"`IsoPort = 2102` in [[connect]] {config.name}, and the same port at the partner",
        )
    return tip(f"LocalPort of {config.name} is {config.local.port}", "take a free port, 2000 to 5000")


def suggest_name_lookup(e: Evidence) -> RuleAnswer:
    name = e.config.remote_name if e.config is not None else ""
    if not name and e.config is not None and e.config.description is not None:
        name = read_spec(e.config.description).remote_name
    text = f"check the name; `getent hosts {name}` shows whether this machine's DNS server knows it"
    return tip("", text) if name else ""


# -- the partner -----------------------------------------------------------------------------------------


def explain_refused_selector(e: Evidence) -> RuleAnswer:
    if e.cause.call != "session" or e.config is None or e.config.description is None:
        return ""
    spec = read_spec(e.config.description)
    if spec.protocol is not Transport.ISO:
        return ""
    ours = format_selector(spec.local_tsap) or "none"
    theirs = format_selector(spec.remote_tsap) or "any"
    return tip(
        f"{_partner_name(e)} accepted the connection, then refused it",
        "match the selectors crosswise: set the partner's remote selector to "
        f"our local one, {ours}, and its local selector to our remote one, {theirs}",
    )


# -- DATA and LEN ----------------------------------------------------------------------------------------


def explain_message_too_long(e: Evidence) -> RuleAnswer:
    """A message comes whole or not at all: how much room does it need?"""
    have, need = e.cause.have, e.cause.need
    if not have or not need:
        return ""
    text = f"{limit_text(e)}; the message had {count(have, 'byte')}: {count(have - need, 'byte')} too many"
    return tip(f"{text}. The message is lost", f"give DATA and LEN at least {have} bytes")


def explain_changed_parameter(e: Evidence) -> RuleAnswer:
    pin = e.cause.pin or "DATA"
    held = "until DONE or ERROR: change it while BUSY is 0"
    if pin == "DATA":
        return tip("", f"keep DATA unchanged {held}, or fill another variable and copy it before the edge")
    return tip("", f"keep {pin} unchanged {held}")


def explain_symbolic_data(e: Evidence) -> RuleAnswer:
    block = "in a data block that is not optimized (`optimized = false`)"
    if e.cause.pin == "LEN":
        return tip("", f"{{}}, or put DATA {block}", f"set {e.instance} LEN=0")
    return tip("", f"declare DATA as ARRAY OF BYTE or CHAR, or put DATA {block}")


def explain_small_result(e: Evidence) -> str:
    if e.cause.have is None or e.cause.need is None:
        return ""
    return f"RESULT ({e.data}) has {count(e.cause.have, 'byte')}, but the diagnosis needs {e.cause.need}"
