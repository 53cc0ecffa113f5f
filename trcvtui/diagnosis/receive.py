"""What received bytes, messages and datagrams prove: whether a job waits or is stuck; wrong sizes, ports.

Each rule takes the evidence and answers one sentence, or "" where it does not apply; with it what to do.
"""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.table import block_row
from trcvtui.diagnosis.evidence import Evidence
from trcvtui.diagnosis.job import AdvisedCause, RuleAnswer, explain_req, limit, progress, tip
from trcvtui.history.records import DroppedJob
from trcvtui.snapshots.bench import PeerSnapshot
from trcvtui.wording import SECOND, age, count, rate_text, times

QUIET_NS: Final = SECOND  # a frame begun and so long without a byte is stuck, unless the sender is a slow one
SLOW_SENDER_PAUSES: Final = 2  # so many of a sender's longest pauses are waited for
RECEIVING_CONDITIONS: Final = frozenset({Condition.RECEIVING, Condition.RECEIVING_PART, Condition.RUNNING})
ARMED, FILLING, STUCK = "waiting", "receiving", "stuck"


# -- how a job stands -----------------------------------------------------------------------------------


def state(e: Evidence) -> str:
    """Return waiting (nothing came yet), receiving (bytes arrive) or stuck (some are here, no more come)."""
    if not e.have:
        return ARMED
    patience = max(QUIET_NS, SLOW_SENDER_PAUSES * e.facts.longest_gap_ns)
    return STUCK if e.quiet_ns is not None and e.quiet_ns >= patience else FILLING


def is_stuck(e: Evidence) -> bool:
    """Return whether a static frame has begun and its sender seems to have no more."""
    is_running = e.condition in RECEIVING_CONDITIONS
    return is_running and not e.adhoc and not e.is_message and not e.is_datagram and state(e) == STUCK


def describe_receive_job(e: Evidence) -> str:
    """Return what a job that receives has, wants, and since when nothing came."""
    wanted = f"up to {count(e.need, 'byte')} ({_adhoc_name(e)})" if e.adhoc else count(e.need, "byte")
    if e.is_past:
        return f"{e.have} of {wanted} were here"
    if not e.have:
        return f"{ARMED} for {wanted}; none received yet{_describe_last_arrival(e, 'frame')}{_link_age(e)}"
    if e.have >= e.need and not e.adhoc:
        return f"complete: all {wanted} received, DONE comes with the next scan"
    came = "" if e.quiet_ns is None else f", the last one {age(e.quiet_ns)} ago"
    return f"{state(e)}: {e.have} of {wanted} received{came}{_describe_rate(e)}"


def _describe_last_arrival(e: Evidence, thing: str) -> str:
    if e.quiet_ns is None:
        return ""
    ago = f"{age(e.quiet_ns)} ago"
    if e.done_scan is None or not e.done_len or e.facts.drop is not None:
        return f". The last {'byte' if thing == 'frame' else thing} came {ago}"
    return f". The last {thing} ({count(e.done_len, 'byte')}) was delivered in scan {e.done_scan}, {ago}"


def _setting(e: Evidence) -> str:
    if e.pin("ADHOC"):
        return "ADHOC, which is 1 for the next job,"
    return "ADHOC=1" if e.has_adhoc else "LEN=65535, which is ad hoc here,"


def _adhoc_name(e: Evidence) -> str:
    return "ADHOC" if e.has_adhoc else "this ad-hoc LEN"


def _link_age(e: Evidence) -> str:
    up = e.facts.up_since
    if e.quiet_ns is not None or up is None:
        return ""
    return f". The link is up since scan {up.scan}, {age(e.ns_since(up))}"


def _describe_rate(e: Evidence) -> str:
    began = e.facts.job_began
    if state(e) != FILLING or began is None or e.last_bytes_ns is None:
        return ""
    lasted = e.last_bytes_ns - began.t_ns
    return f", {rate_text(e.have, lasted)}" if lasted >= 2 * e.interval_ns else ""


# -- who sends, and in which sizes ------------------------------------------------------------------------


def _name_messages(e: Evidence) -> str:
    known = len(e.facts.messages.last)
    return f"{e.facts.sender}'s {'only message' if known == 1 else f'last {known} messages'}"


def _sizes(e: Evidence, size: int) -> str:
    return f"{_name_messages(e)} {'was' if len(e.facts.messages.last) == 1 else 'were'} {count(size, 'byte')}"


# -- the rules --------------------------------------------------------------------------------------------


def explain_shift_by_drop(e: Evidence) -> RuleAnswer:
    """A frame was given up in its middle, and the bytes after it begin the next one."""
    drop, facts = e.facts.drop, e.facts
    if drop is None or e.adhoc or facts.up_since is None:
        return ""
    if not facts.messages.count:
        doubt = "unless the sender had ended a message there, the stream is shifted"
        return _advise_resync(e, f"{_describe_drop(drop)}; {doubt}")
    message = facts.begins_in
    if message is None or not message.first:
        return ""
    begins = f"This frame begins with byte {message.first} of {facts.sender}'s message {message.number}"
    return _advise_resync(e, f"{_describe_drop(drop)}. {begins}: the stream is shifted")


def _advise_resync(e: Evidence, cause: str) -> AdvisedCause:
    if e.pin("COM_RST") is None:
        return tip(cause, "disconnect and connect again: the next frame begins with a message")
    text = "{} to put the stream back in step, or CONT 0, then 1"
    return tip(cause, text, f"pulse {e.instance} COM_RST")


def _describe_drop(drop: DroppedJob) -> str:
    collected = f"{drop.have} of {count(drop.need, 'byte')} collected"
    return f"{drop.reason} in scan {drop.at.scan} with {collected}; they were dropped"


def explain_shift(e: Evidence) -> str:
    """The running job begins inside a message, and no dropped frame tells why."""
    message = e.facts.begins_in
    if e.adhoc or message is None or not message.first or e.facts.drop is not None or _has_other_size(e):
        return ""
    return (
        f"this frame begins with byte {message.first} of {e.facts.sender}'s message "
        f"{message.number} ({count(message.whole, 'byte')}): frames and messages are shifted"
    )


def _has_other_size(e: Evidence) -> bool:
    only = e.facts.messages.common
    return only is not None and only != e.need


def explain_short_sender(e: Evidence) -> RuleAnswer:
    """Every message is shorter than the frame, and no whole number of them fills it."""
    size = e.facts.messages.common
    if size is None or not size < e.need or e.need % size == 0 or e.adhoc:
        return ""
    missing = e.need - size
    text = f"{limit(e)}. {_sizes(e, size)}: LEN or DATA is {count(missing, 'byte')} too large for this sender"
    if len(e.facts.messages.last) > 1 and e.done_scan is not None:
        text += f". Each frame takes {count(missing, 'byte')} of the next message, so the values wander"
    pins = (("LEN", f"set {e.instance} LEN={size}"), ("COM_RST", f"pulse {e.instance} COM_RST"))
    has_len, has_reset = (e.pin(pin) is not None for pin, _ in pins)
    way = f"make both equal: {'{}, or ' * has_len}give DATA {count(size, 'byte')}{'; then {}' * has_reset}"
    return tip(text, way, *(line for pin, line in pins if e.pin(pin) is not None), needs_trial=True)


def explain_several_messages(e: Evidence) -> str:
    """A whole number of messages fills a frame."""
    size = e.facts.messages.common
    if size is None or e.adhoc or not size < e.need or e.need % size:
        return ""
    frame = f"{limit(e)}. {_sizes(e, size)}: one frame takes {e.need // size} of them"
    return f"{frame}, {e.have // size} are here" if e.have else frame


def explain_long_sender(e: Evidence) -> RuleAnswer:
    """Every message is longer than the frame."""
    size = e.facts.messages.common
    if size is None or not e.need or size <= e.need:
        return ""
    if e.adhoc:
        return (
            f"{_sizes(e, size)}. {_adhoc_name(e)} takes at most {e.need} at once: "
            f"one message comes as {-(-size // e.need)} frames"
        )
    rest = size % e.need
    if not rest:
        return f"{_sizes(e, size)}. {limit(e)}: one message comes as {size // e.need} frames"
    return tip(
        f"{_sizes(e, size)}. {limit(e)}, which is too small for this sender: {count(rest, 'byte')} of each "
        "message begin a next frame, so the values wander",
        f"give DATA and LEN {count(size, 'byte')}",
    )


def explain_odd_size(e: Evidence) -> str:
    """The newest message has another size than the frame, which all before it filled."""
    sizes = e.facts.messages.last
    if e.adhoc or len(sizes) < 2 or not e.need or sizes[-1] == e.need or set(sizes[:-1]) != {e.need}:
        return ""
    odd = sizes[-1] - e.need
    which = (
        f"{count(-odd, 'byte')} short of a frame" if odd < 0 else f"{count(odd, 'byte')} more than a frame"
    )
    return f"{e.facts.sender}'s newest message was {sizes[-1]} bytes, those before it {e.need}: it is {which}"


def explain_many_sizes(e: Evidence) -> RuleAnswer:
    """Messages differ in size, and a static frame has one."""
    sizes = e.facts.messages.last
    if e.adhoc or not sizes or e.facts.messages.common is not None or not e.need or explain_odd_size(e):
        return ""
    return tip(
        f"{_name_messages(e)} had {min(sizes)} to {max(sizes)} bytes, a static frame has always {e.need}",
        f"{_setting(e)} takes what is there, or one job reads the header and one the rest",
    )


def explain_burst_size(e: Evidence) -> str:
    """Of a partner whose messages are not known: what comes between two pauses has another size."""
    facts = e.facts
    size = facts.bursts.common
    if facts.messages.count or size is None or e.adhoc or not e.need or size == e.need:
        return ""
    if e.config is None:
        return ""  # a datagram is whole, whatever its size
    if e.need % size == 0 and state(e) != STUCK:
        return ""
    if facts.bursts.count == 1 and size > e.need and e.is_arriving:
        return f"{count(size, 'byte')} came without a pause: a stream does not show where a message ends"
    each = "" if facts.bursts.count == 1 else "each time "
    came = f"bytes came {times(facts.bursts.count)}, {each}{size}: if that is the sender's message,"
    if size < e.need:
        return f"{limit(e)}, {came} LEN or DATA is {e.need - size} too large"
    if size % e.need:
        return f"{limit(e)}, {came} its last {count(size % e.need, 'byte')} begin a next frame"
    return f"{limit(e)}, {came} it comes as {size // e.need} frames"


def suggest_ad_hoc(e: Evidence) -> RuleAnswer:
    """Static, stuck, and nothing tells whether more will come."""
    if e.adhoc or state(e) != STUCK or not e.have:
        return ""
    here = count(e.have, "byte")
    if e.adhoc_at_once:
        now = tip("", f"{{}} to get the {here} at once", f"set {e.instance} ADHOC=1", needs_trial=True)
        return tip("", f"ADHOC=1 would have delivered the {here} at once") if e.is_past else now
    return tip("", f"{_setting(e)} would have delivered the {here} at once (read when EN_R rises again)")


def explain_partial_message(e: Evidence) -> str:
    """ADHOC delivers what is there: that may be a part of a message, or several."""
    size = e.facts.messages.common
    length = e.cause.have
    if not e.adhoc or size is None or not length or length == size or size > e.need:
        return ""
    if e.condition != "received":
        return ""
    what = f"{length} of them are a part of one" if length < size else f"{length} are more than one"
    return f"{_sizes(e, size)}: {what}; {_adhoc_name(e)} delivers what is there, not messages"


def explain_nothing_sent(e: Evidence) -> RuleAnswer:
    """The partner is a peer of this bench, and has sent nothing on this connection."""
    if e.have or e.facts.bursts.count or e.is_past or e.link is None or e.facts.up_since is None:
        return ""
    for peer in e.peers:
        if peer.state == "connected" and (peer.local, peer.remote) == (e.link.remote, e.link.local):
            text = f"{peer.name} has sent nothing on this connection"
            return tip(text, "{}", f"peer {peer.name} send hex 01")
    return tip("the partner has sent nothing since the link is up", "check there: is its send call enabled?")


# -- messages (ISO-on-TCP): a shorter one ends the job, a longer one is lost ------------------------------


def describe_message_job(e: Evidence) -> str:
    """Return what a job waits for: a message is here whole, or not at all."""
    armed = f"{ARMED} for one message of at most {count(e.need, 'byte')}; none received yet"
    return armed if e.is_past else armed + _describe_last_arrival(e, "message") + _link_age(e)


def explain_short_message(e: Evidence) -> str:
    """A message shorter than LEN is a whole job; DATA keeps older bytes after it."""
    is_here = e.condition in (Condition.RECEIVED, Condition.FINISHED)
    size = e.cause.have if is_here else e.done_len
    if not size or not e.need or size >= e.need:
        return ""
    return (
        f"{limit(e)}, the last message had {count(size, 'byte')}. A message is a whole job whatever its "
        f"size: RCVD_LEN says {size}, and DATA keeps older bytes from byte {size} on"
    )


def explain_long_message(e: Evidence) -> RuleAnswer:
    """The partner's messages are longer than LEN or DATA: each is lost."""
    size = e.facts.messages.common
    if size is None or not e.need or size <= e.need:
        return ""
    return tip(
        f"{e.facts.sender}'s messages have {count(size, 'byte')}, {limit(e)}: each is {size - e.need} too "
        "long, and lost",
        f"give DATA and LEN at least {size}",
    )


# -- datagrams --------------------------------------------------------------------------------------------

ANY_ADDRESS: Final = "0.0.0.0"


# -- receiving --------------------------------------------------------------------------------------------


def describe_datagram_receive(e: Evidence) -> str:
    """Return what a job waits for: a datagram is here whole, or not at all."""
    if e.have:
        return f"a datagram of {count(e.have, 'byte')} is received and shows in the next scan"
    armed = f"{ARMED} for one datagram of at most {count(e.need, 'byte')}; none received yet"
    if e.is_past:
        return armed
    if e.quiet_ns is not None:
        return armed + _describe_last_arrival(e, "datagram")
    since = e.facts.open_since
    opened = f". The socket is open since scan {since.scan}, {age(e.ns_since(since))}" if since else ""
    return armed + opened


def explain_wrong_port(e: Evidence) -> str:
    """A peer of this bench sends, but not to this socket."""
    if not _is_awaiting_first(e):
        return ""
    astray = next(
        (peer for peer in _udp_peers(e) if peer.remote and not _is_at(peer.remote, _local(e))), None
    )
    if astray is None or not astray.messages_sent:
        return ""
    return f"{astray.name} sends to {astray.remote}, this socket is at {_local(e)}: address or port is wrong"


def explain_no_sender(e: Evidence) -> RuleAnswer:
    if not _is_awaiting_first(e) or explain_wrong_port(e):
        return ""
    for peer in _udp_peers(e):
        if _is_at(peer.remote, _local(e)) and not peer.messages_sent:
            return tip(f"{peer.name} has sent nothing", "{}", f"peer {peer.name} send hex 01")
    return tip(
        f"no datagram has come to {_local(e)}; UDP tells the sender nothing, a firewall drops without a "
        "word, and 255.255.255.255 is not heard",
        "check whether the partner sends to this address and port",
    )


def _is_awaiting_first(e: Evidence) -> bool:
    return not e.is_past and e.link is not None and not e.have and not e.facts.datagrams.count


def _local(e: Evidence) -> str:
    return e.link.local if e.link is not None else ""


def _udp_peers(e: Evidence) -> tuple[PeerSnapshot, ...]:
    return tuple(peer for peer in e.peers if peer.udp)


def _is_at(target: str, local: str) -> bool:
    address, _, port = local.rpartition(":")
    return target == local or (address == ANY_ADDRESS and target.rpartition(":")[2] == port)


def explain_cut_datagram(e: Evidence) -> str:
    """What does not fit into LEN or DATA is gone: a datagram comes once."""
    sizes = e.facts.datagrams.last
    need = e.need or 0
    if not need or not sizes or sizes[-1] <= need:
        return ""
    return (
        f"{limit(e)}, {_datagram_sizes(e)}: {count(sizes[-1] - need, 'byte')} of it did not fit and are lost"
    )


def explain_short_datagram(e: Evidence) -> str:
    """A datagram shorter than LEN is a whole job; DATA keeps older bytes after it."""
    size = e.cause.have if e.condition == Condition.RECEIVED else e.done_len
    if not size or not e.need or size >= e.need or explain_cut_datagram(e):
        return ""
    return (
        f"{limit(e)}, {_datagram_sizes(e)}. A datagram is a whole job whatever its size: "
        f"RCVD_LEN says {size}, and DATA keeps older bytes from byte {size} on"
    )


def _datagram_sizes(e: Evidence) -> str:
    sizes = e.facts.datagrams
    if len(sizes.last) < 2:
        return (
            f"the only datagram had {count(sizes.last[-1], 'byte')}"
            if sizes.last
            else "the datagram is short"
        )
    if sizes.common is not None:
        return f"the last {len(sizes.last)} datagrams had {count(sizes.common, 'byte')}"
    span = f"{min(sizes.last)} to {count(max(sizes.last), 'byte')}"
    return f"the last {len(sizes.last)} datagrams had {span}, the newest {sizes.last[-1]}"


def explain_unread(e: Evidence) -> str:
    """The socket is open and EN_R is 0."""
    if e.pin("EN_R") != 0:
        return ""
    return "EN_R is 0: datagrams wait in the socket; when it is full the stack drops the newer ones unseen"


# -- sending ----------------------------------------------------------------------------------------------


def explain_sent(e: Evidence) -> RuleAnswer:
    """DONE of a datagram tells of the local stack only; a peer of this bench would have to be there."""
    target = e.cause.peer
    if not target:
        return ""
    if e.is_past or any(_is_at(target, peer.local) and peer.state != "closed" for peer in _udp_peers(e)):
        return f"DONE tells that the local stack took it for {target}; UDP does not tell whether it came"
    near = next((peer for peer in _udp_peers(e) if peer.local), None)
    if near is None:
        return f"DONE tells that the local stack took it for {target}; UDP does not tell whether it came"
    if near.state == "closed":
        text = f"it went to {target}, and {near.name} is closed"
        return tip(text, "{}", f"peer {near.name} listen")
    return f"it went to {target}, {near.name} receives at {near.local}: address or port in ADDR is wrong"


def explain_done(e: Evidence) -> RuleAnswer:
    """Return the same of a block whose edge does not name the receiver."""
    return explain_sent(e) or (
        "DONE tells that the local stack took the datagram; UDP does not tell whether it came"
    )


def explain_datagram_edge(e: Evidence) -> RuleAnswer:
    """The socket is open and REQ stays 1: that is no edge."""
    return explain_req(e)


def explain_empty_addr(e: Evidence) -> RuleAnswer:
    """The receiver of a datagram stands in ADDR."""
    return tip("ADDR names the receiver", "write both address and port into it before the edge of REQ")


def explain_datagram_too_long(e: Evidence) -> RuleAnswer:
    """A datagram that DATA has no room for is gone, and the next one is clean."""
    have, need = e.cause.have, e.cause.need
    if not have or not need:
        return ""
    return tip(
        f"the datagram had {count(have, 'byte')}, {have - need} too many", f"give DATA at least {have}"
    )


# The same of blocks whose CONNECT says UDP: to these the socket is their connection.


def describe_datagram_job(e: Evidence) -> str:
    """Return what a receive job waits for, or how far a send job is."""
    return describe_datagram_receive(e) if block_row(e.block).receives else progress(e)


def explain_closed_socket(e: Evidence) -> RuleAnswer:
    at = e.link.name if e.link is not None else "UDP_CONFIG"
    return tip(
        f"the socket of {at} is not open; the next call tries again",
        "check whether LocalAddress is one of this machine, and LocalPort free (`ss -ulnp`)",
    )


def explain_result_layout(e: Evidence) -> str:
    return (
        f"RESULT ({e.data}): byte 6 is State (1 lost, 2 the active end calls, 3 the passive end waits, "
        "4 established), byte 8 on the bytes sent, byte 12 on those received"
    )
