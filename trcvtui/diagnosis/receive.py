"""Judges received bytes, messages and datagrams: finds waiting or stuck jobs, wrong sizes, wrong ports."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.table import block_row
from trcvtui.diagnosis.evidence import Evidence
from trcvtui.diagnosis.job import AdvisedCause, RuleAnswer, describe_progress, explain_req, limit_text, tip
from trcvtui.history.records import DroppedJob
from trcvtui.snapshots.bench import PeerSnapshot
from trcvtui.wording import SECOND, age_text, count, rate_text, times

STUCK_AFTER_NS: Final = SECOND  # a frame without a new byte for so long is stuck, unless its sender is slow
SLOW_SENDER_PAUSES: Final = 2  # times the longest pause of its sender, then it is stuck
RECEIVING_CONDITIONS: Final = frozenset({Condition.RECEIVING, Condition.RECEIVING_PART, Condition.RUNNING})
ARMED, FILLING, STUCK = "waiting", "receiving", "stuck"


# -- the state of a job ---------------------------------------------------------------------------------


def receive_state(e: Evidence) -> str:
    """Return whether a job waits for its first byte, receives, or is stuck because no more bytes come."""
    if not e.have:
        return ARMED
    patience = max(STUCK_AFTER_NS, SLOW_SENDER_PAUSES * e.facts.longest_gap_ns)
    return STUCK if e.quiet_ns is not None and e.quiet_ns >= patience else FILLING


def is_stuck(e: Evidence) -> bool:
    """Return whether a static frame has begun, and the sender seems to have no more bytes for it."""
    is_running = e.condition in RECEIVING_CONDITIONS
    return (
        is_running and not e.adhoc and not e.has_messages and not e.is_datagram and receive_state(e) == STUCK
    )


def describe_receive_job(e: Evidence) -> str:
    """Return how many bytes a job has received and wants (ADHOC: at most), and for how long none came."""
    wanted = f"up to {count(e.need, 'byte')} ({_adhoc_name(e)})" if e.adhoc else count(e.need, "byte")
    if e.is_past:
        return f"{e.have} of {wanted} had been received"
    if not e.have:
        return f"{ARMED} for {wanted}; none received yet{_describe_last_arrival(e, 'frame')}{_age_text(e)}"
    if e.have >= e.need and not e.adhoc:
        return f"complete: all {wanted} received, DONE comes with the next scan"
    came = "" if e.quiet_ns is None else f", the last one {age_text(e.quiet_ns)} ago"
    return f"{receive_state(e)}: {e.have} of {wanted} received{came}{_describe_rate(e)}"


def _describe_last_arrival(e: Evidence, thing: str) -> str:
    if e.quiet_ns is None:
        return ""
    ago = f"{age_text(e.quiet_ns)} ago"
    if e.done_scan is None or not e.done_len or e.facts.drop is not None:
        return f". The last {'byte' if thing == 'frame' else thing} came {ago}"
    return f". The last {thing} ({count(e.done_len, 'byte')}) was delivered in scan {e.done_scan}, {ago}"


def _adhoc_setting(e: Evidence) -> str:
    if e.pin("ADHOC"):
        return "ADHOC (1 for the next job)"
    return "ADHOC=1" if e.has_adhoc else "LEN=65535 (ad hoc)"


def _adhoc_name(e: Evidence) -> str:
    return "ADHOC" if e.has_adhoc else "LEN 65535"


def _age_text(e: Evidence) -> str:
    up = e.facts.up_since
    if e.quiet_ns is not None or up is None:
        return ""
    return f". The link is up since scan {up.scan} ({age_text(e.ns_since(up))})"


def _describe_rate(e: Evidence) -> str:
    began = e.facts.job_began
    if receive_state(e) != FILLING or began is None or e.last_bytes_ns is None:
        return ""
    lasted = e.last_bytes_ns - began.t_ns
    return f", {rate_text(e.have, lasted)}" if lasted >= 2 * e.interval_ns else ""


# -- the sender and its message sizes ------------------------------------------------------------------------


def _name_messages(e: Evidence) -> str:
    known = len(e.facts.messages.last)
    return f"{e.facts.sender}'s {'only message' if known == 1 else f'last {known} messages'}"


def _describe_sizes(e: Evidence, size: int) -> str:
    return f"{_name_messages(e)} had {count(size, 'byte')}"


# -- the rules --------------------------------------------------------------------------------------------


def explain_shift_by_drop(e: Evidence) -> RuleAnswer:
    """Explain a stream that is shifted because a frame was dropped in its middle."""
    drop, facts = e.facts.drop, e.facts
    if drop is None or e.adhoc or facts.up_since is None:
        return ""
    if not facts.messages.count:
        doubt = "the stream is shifted, unless a message of the sender ended just there"
        return _advise_resync(e, f"{_describe_drop(drop)}; {doubt}")
    message = facts.begins_in
    if message is None or not message.first:
        return ""
    begins = f"This frame begins with byte {message.first} of {facts.sender}'s message {message.number}"
    return _advise_resync(e, f"{_describe_drop(drop)}. {begins}: the stream is shifted")


def _advise_resync(e: Evidence, cause: str) -> AdvisedCause:
    if e.pin("COM_RST") is None:
        return tip(cause, "disconnect and connect again: the next frame then begins with a message")
    text = "{} to realign the stream; or set CONT to 0, then to 1"
    return tip(cause, text, f"pulse {e.instance} COM_RST")


def _describe_drop(drop: DroppedJob) -> str:
    collected = f"{drop.have} of {count(drop.need, 'byte')} collected"
    return f"{drop.reason} in scan {drop.at.scan} with {collected}; they were dropped"


def explain_shift(e: Evidence) -> str:
    """The running job begins inside a message, and no dropped frame explains it."""
    message = e.facts.begins_in
    if e.adhoc or message is None or not message.first or e.facts.drop is not None or _has_other_size(e):
        return ""
    return (
        f"this frame begins with byte {message.first} of {e.facts.sender}'s message "
        f"{message.number} ({count(message.whole, 'byte')}): frames and messages are shifted"
    )


def _has_other_size(e: Evidence) -> bool:
    only = e.facts.messages.common_size
    return only is not None and only != e.need


def explain_short_sender(e: Evidence) -> RuleAnswer:
    """Every message is shorter than the frame, and no whole number of messages fills a frame."""
    size = e.facts.messages.common_size
    if size is None or not size < e.need or e.need % size == 0 or e.adhoc:
        return ""
    missing = e.need - size
    larger = count(missing, "byte")
    text = f"{limit_text(e)}. {_describe_sizes(e, size)}: LEN or DATA is {larger} too large for this sender"
    if len(e.facts.messages.last) > 1 and e.done_scan is not None:
        text += f". Each frame takes {larger} of the next message, so the values shift"
    pins = (("LEN", f"set {e.instance} LEN={size}"), ("COM_RST", f"pulse {e.instance} COM_RST"))
    has_len, has_reset = (e.pin(pin) is not None for pin, _ in pins)
    way = f"match the message: {'{}, or ' * has_len}give DATA {count(size, 'byte')}{'; then {}' * has_reset}"
    return tip(text, way, *(line for pin, line in pins if e.pin(pin) is not None), needs_trial=True)


def explain_several_messages(e: Evidence) -> str:
    size = e.facts.messages.common_size
    if size is None or e.adhoc or not size < e.need or e.need % size:
        return ""
    frame = f"{limit_text(e)}. {_describe_sizes(e, size)}: one frame takes {count(e.need // size, 'message')}"
    return f"{frame}; {e.have // size} of them arrived" if e.have else frame


def explain_long_sender(e: Evidence) -> RuleAnswer:
    size = e.facts.messages.common_size
    if size is None or not e.need or size <= e.need:
        return ""
    if e.adhoc:
        return (
            f"{_describe_sizes(e, size)}. {_adhoc_name(e)} takes at most {e.need} bytes at once: "
            f"one message comes as {-(-size // e.need)} frames"
        )
    rest = size % e.need
    if not rest:
        return f"{_describe_sizes(e, size)}. {limit_text(e)}: one message comes as {size // e.need} frames"
    return tip(
        f"{_describe_sizes(e, size)}. {limit_text(e)}, which is too small for this sender: "
        f"{count(rest, 'byte')} of each message begin the next frame, so the values shift",
        f"give DATA and LEN {count(size, 'byte')}",
    )


def explain_odd_size(e: Evidence) -> str:
    """The newest message has another size than the frame; each earlier message filled a frame."""
    sizes = e.facts.messages.last
    if e.adhoc or len(sizes) < 2 or not e.need or sizes[-1] == e.need or set(sizes[:-1]) != {e.need}:
        return ""
    odd = sizes[-1] - e.need
    which = f"{count(abs(odd), 'byte')} {'shorter' if odd < 0 else 'longer'} than a frame"
    return f"{e.facts.sender}'s newest message had {sizes[-1]} bytes, {which}; the others had {e.need}"


def explain_many_sizes(e: Evidence) -> RuleAnswer:
    """Messages differ in size, but a static frame always has the same size."""
    sizes = e.facts.messages.last
    if e.adhoc or not sizes or e.facts.messages.common_size is not None or not e.need or explain_odd_size(e):
        return ""
    return tip(
        f"{_name_messages(e)} had {min(sizes)} to {max(sizes)} bytes, but a static frame always has {e.need}",
        f"{_adhoc_setting(e)} delivers what has arrived; or let one job take the header, the next the rest",
    )


def explain_burst_size(e: Evidence) -> str:
    """The bytes between two pauses have another size than a frame; the partner's messages are not known."""
    facts = e.facts
    size = facts.bursts.common_size
    if facts.messages.count or size is None or e.adhoc or not e.need or size == e.need:
        return ""
    if e.config is None:
        return ""  # a datagram comes whole, whatever its size
    if e.need % size == 0 and receive_state(e) != STUCK:
        return ""  # several of them fill a frame
    if facts.bursts.count == 1 and size > e.need and e.is_arriving:
        return f"{count(size, 'byte')} came without a pause: a stream does not show where a message ends"
    came = f"{count(size, 'byte')} came {times(facts.bursts.count)}. If that is the size of a message,"
    if size < e.need:
        return f"{limit_text(e)}; {came} LEN or DATA is {count(e.need - size, 'byte')} too large"
    if size % e.need:
        return f"{limit_text(e)}; {came} its last {count(size % e.need, 'byte')} begin the next frame"
    return f"{limit_text(e)}; {came} it comes as {size // e.need} frames"


def suggest_ad_hoc(e: Evidence) -> RuleAnswer:
    """A static job is stuck, and it is not known whether more bytes will come."""
    if e.adhoc or receive_state(e) != STUCK or not e.have:
        return ""
    here = count(e.have, "byte")
    if e.adhoc_at_once:
        now = tip("", f"{{}} to get the {here} at once", f"set {e.instance} ADHOC=1", needs_trial=True)
        return tip("", f"ADHOC=1 would have delivered the {here} at once") if e.is_past else now
    return tip(
        "", f"{_adhoc_setting(e)} would have delivered the {here} at once; it counts once EN_R rises again"
    )


def explain_partial_message(e: Evidence) -> str:
    """ADHOC delivers whatever has arrived: a part of a message, or several."""
    size = e.facts.messages.common_size
    length = e.cause.have
    if not e.adhoc or size is None or not length or length == size or size > e.need:
        return ""
    if e.condition != "received":
        return ""
    what = f"this job had {length}, {'a part of' if length < size else 'more than'} one message"
    return f"{_describe_sizes(e, size)}, and {what}: {_adhoc_name(e)} delivers what arrives, not messages"


def explain_nothing_sent(e: Evidence) -> RuleAnswer:
    """The partner is a peer of this bench, and has sent nothing on this connection."""
    if e.have or e.facts.bursts.count or e.is_past or e.link is None or e.facts.up_since is None:
        return ""
    for peer in e.peers:
        if peer.state == "connected" and (peer.local, peer.remote) == (e.link.remote, e.link.local):
            text = f"{peer.name} has sent nothing on this connection"
            return tip(text, "{}", f"peer {peer.name} send hex 01")
    return tip(
        "the partner has sent nothing since the link came up", "check whether its send call is enabled"
    )


# -- messages (ISO-on-TCP): a shorter one ends the job, a longer one is lost ------------------------------


def describe_message_job(e: Evidence) -> str:
    """Return what a job waits for: a message comes whole or not at all."""
    armed = f"{ARMED} for one message of at most {count(e.need, 'byte')}; none received yet"
    return armed if e.is_past else armed + _describe_last_arrival(e, "message") + _age_text(e)


def explain_short_message(e: Evidence) -> str:
    is_here = e.condition in (Condition.RECEIVED, Condition.FINISHED)
    size = e.cause.have if is_here else e.done_len
    if not size or not e.need or size >= e.need:
        return ""
    return (
        f"{limit_text(e)}; the last message had {count(size, 'byte')}. A message of any size completes a "
        f"job; RCVD_LEN is {size}, and DATA keeps older bytes from byte {size} on"
    )


def explain_long_message(e: Evidence) -> RuleAnswer:
    """The partner's messages are longer than LEN or DATA: each is lost."""
    size = e.facts.messages.common_size
    if size is None or not e.need or size <= e.need:
        return ""
    return tip(
        f"{e.facts.sender}'s messages have {count(size, 'byte')}; {limit_text(e)}. Each message is "
        f"{count(size - e.need, 'byte')} too long and is lost",
        f"give DATA and LEN at least {size} bytes",
    )


# -- receiving datagrams ----------------------------------------------------------------------------------

ANY_ADDRESS: Final = "0.0.0.0"


def describe_datagram_receive(e: Evidence) -> str:
    """Return what a job waits for: a datagram comes whole or not at all."""
    if e.have:
        return f"a datagram of {count(e.have, 'byte')} is received and shows in the next scan"
    armed = f"{ARMED} for one datagram of at most {count(e.need, 'byte')}; none received yet"
    if e.is_past:
        return armed
    if e.quiet_ns is not None:
        return armed + _describe_last_arrival(e, "datagram")
    since = e.facts.open_since
    opened = f". The socket is open since scan {since.scan} ({age_text(e.ns_since(since))})" if since else ""
    return armed + opened


def explain_wrong_port(e: Evidence) -> str:
    """A peer of this bench sends, but not to this socket."""
    if not _is_awaiting_first(e):
        return ""
    astray = next(
        (peer for peer in _udp_peers(e) if peer.remote and not _is_same(peer.remote, _local(e))), None
    )
    if astray is None or not astray.messages_sent:
        return ""
    return (
        f"{astray.name} sends to {astray.remote}, but this socket is at {_local(e)}: address or port is wrong"
    )


def explain_no_sender(e: Evidence) -> RuleAnswer:
    if not _is_awaiting_first(e) or explain_wrong_port(e):
        return ""
    for peer in _udp_peers(e):
        if _is_same(peer.remote, _local(e)) and not peer.messages_sent:
            return tip(f"{peer.name} has sent nothing", "{}", f"peer {peer.name} send hex 01")
    return tip(
        f"no datagram has come to {_local(e)}. UDP reports no loss to the sender, firewalls drop silently, "
        "and a datagram to 255.255.255.255 does not arrive here",
        "check whether the partner sends to this address and port",
    )


def _is_awaiting_first(e: Evidence) -> bool:
    return not e.is_past and e.link is not None and not e.have and not e.facts.datagrams.count


def _local(e: Evidence) -> str:
    return e.link.local if e.link is not None else ""


def _udp_peers(e: Evidence) -> tuple[PeerSnapshot, ...]:
    return tuple(peer for peer in e.peers if peer.udp)


def _is_same(target: str, local: str) -> bool:
    address, _, port = local.rpartition(":")
    return target == local or (address == ANY_ADDRESS and target.rpartition(":")[2] == port)


def explain_cut_datagram(e: Evidence) -> str:
    """Bytes that do not fit into LEN or DATA are lost: a datagram comes once."""
    sizes = e.facts.datagrams.last
    need = e.need or 0
    if not need or not sizes or sizes[-1] <= need:
        return ""
    lost = count(sizes[-1] - need, "byte")
    return f"{limit_text(e)}; {_datagram_sizes(e)}: {lost} did not fit; that part is lost"


def explain_short_datagram(e: Evidence) -> str:
    size = e.cause.have if e.condition == Condition.RECEIVED else e.done_len
    if not size or not e.need or size >= e.need or explain_cut_datagram(e):
        return ""
    return (
        f"{limit_text(e)}; {_datagram_sizes(e)}. A datagram of any size completes a job; "
        f"RCVD_LEN is {size}, and DATA keeps older bytes from byte {size} on"
    )


def _datagram_sizes(e: Evidence) -> str:
    sizes = e.facts.datagrams
    if len(sizes.last) < 2:
        return (
            f"the only datagram had {count(sizes.last[-1], 'byte')}"
            if sizes.last
            else "the datagram is short"
        )
    if sizes.common_size is not None:
        return f"the last {len(sizes.last)} datagrams had {count(sizes.common_size, 'byte')}"
    span = f"{min(sizes.last)} to {count(max(sizes.last), 'byte')}"
    return f"the last {len(sizes.last)} datagrams had {span}, the newest had {sizes.last[-1]}"


def explain_unread(e: Evidence) -> str:
    if e.pin("EN_R") != 0:
        return ""
    return "EN_R is 0: datagrams wait in the socket. When it is full, the stack silently drops newer ones"


# -- sending datagrams ------------------------------------------------------------------------------------


def explain_sent(e: Evidence) -> RuleAnswer:
    """Say which peer here the datagram missed, or that DONE only means that the local stack took it."""
    target = e.cause.peer
    if not target:
        return ""
    taken = f"DONE means: the local stack took the datagram for {target}; UDP cannot say whether it arrived"
    if e.is_past or any(_is_same(target, peer.local) and peer.state != "closed" for peer in _udp_peers(e)):
        return taken
    near = next((peer for peer in _udp_peers(e) if peer.local), None)
    if near is None:
        return taken
    if near.state == "closed":
        text = f"the datagram went to {target}, but {near.name} is closed"
        return tip(text, "{}", f"peer {near.name} listen")
    return (
        f"the datagram went to {target}, but {near.name} is at {near.local}: ADDR has a wrong address or port"
    )


def explain_done(e: Evidence) -> RuleAnswer:  # the edge may not name the receiver
    return explain_sent(e) or (
        "DONE means: the local stack took the datagram; UDP cannot say whether it arrived"
    )


def explain_datagram_edge(e: Evidence) -> RuleAnswer:
    return explain_req(e)


def explain_empty_addr(e: Evidence) -> RuleAnswer:
    return tip("ADDR names the receiver", "write its address and port to ADDR before the rising edge of REQ")


def explain_datagram_too_long(e: Evidence) -> RuleAnswer:
    """A datagram without room in DATA is lost whole; the next datagram is not affected."""
    have, need = e.cause.have, e.cause.need
    if not have or not need:
        return ""
    return tip(
        f"the datagram had {count(have, 'byte')}, {have - need} too many", f"give DATA at least {have} bytes"
    )


def describe_datagram_job(e: Evidence) -> str:
    """Return what a receive job waits for, or how far a send job is."""
    return describe_datagram_receive(e) if block_row(e.block).receives_on_net else describe_progress(e)


def explain_closed_socket(e: Evidence) -> RuleAnswer:
    at = e.link.name if e.link is not None else "UDP_CONFIG"
    return tip(
        f"the socket of {at} is not open; the next call tries again",
        "check whether this machine has LocalAddress, and whether LocalPort is free (`ss -ulnp`)",
    )


def explain_result_layout(e: Evidence) -> str:
    return (
        f"RESULT ({e.data}): byte 6 is State (1 lost, 2 the active end calls, 3 the passive end waits, "
        "4 established), bytes 8 to 11 count the bytes sent, bytes 12 to 15 the bytes received"
    )
