"""What received bytes, messages and datagrams prove: whether a job waits or is stuck; wrong sizes, ports.

Each rule takes the evidence and answers one sentence, or "" where it does not apply; with it what to do.
"""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.table import block_row
from trcvtui.diagnosis.evidence import Evidence
from trcvtui.diagnosis.job import Answer, Sentence, do, how_far, limit, req_stays
from trcvtui.history.records import DroppedJob
from trcvtui.snapshots.bench import PeerSnapshot
from trcvtui.wording import SECOND, age, count, rate, times

QUIET_NS: Final = SECOND  # a frame begun and so long without a byte is stuck, unless the sender is a slow one
SLOW: Final = 2  # so many of a sender's longest pauses are waited for
RUNS: Final = frozenset({Condition.RECEIVING, Condition.RECEIVING_PART, Condition.RUNNING})
ARMED, FILLING, STUCK = "waiting", "receiving", "stuck"


# -- how a job stands -----------------------------------------------------------------------------------


def state(e: Evidence) -> str:
    """Return waiting (nothing came yet), receiving (bytes arrive) or stuck (some are here, no more come)."""
    if not e.have:
        return ARMED
    patience = max(QUIET_NS, SLOW * e.facts.longest_gap_ns)
    return STUCK if e.quiet_ns is not None and e.quiet_ns >= patience else FILLING


def is_stuck(e: Evidence) -> bool:
    """Return whether a static frame has begun and its sender seems to have no more."""
    is_running = e.condition in RUNS
    return is_running and not e.adhoc and not e.is_message and not e.is_datagram and state(e) == STUCK


def how_it_stands(e: Evidence) -> str:
    """Return what a job that receives has, wants, and since when nothing came."""
    wanted = f"up to {count(e.need, 'byte')} ({_name(e)})" if e.adhoc else count(e.need, "byte")
    if e.is_past:
        return f"{e.have} of {wanted} were here"
    if not e.have:
        return f"{ARMED} for {wanted}; none received yet{_before(e, 'frame')}{_since_up(e)}"
    if e.have >= e.need and not e.adhoc:
        return f"complete: all {wanted} received, DONE comes with the next scan"
    came = "" if e.quiet_ns is None else f", the last one {age(e.quiet_ns)} ago"
    return f"{state(e)}: {e.have} of {wanted} received{came}{_rate(e)}"


def _before(e: Evidence, thing: str) -> str:
    if e.quiet_ns is None:
        return ""
    ago = f"{age(e.quiet_ns)} ago"
    if e.done_scan is None or not e.done_len or e.facts.drop is not None:
        return f". The last {'byte' if thing == 'frame' else thing} came {ago}"
    return f". The last {thing} ({count(e.done_len, 'byte')}) was delivered in scan {e.done_scan}, {ago}"


def _switch(e: Evidence) -> str:
    if e.pin("ADHOC"):
        return "ADHOC, which is 1 for the next job,"
    return "ADHOC=1" if e.has_adhoc else "LEN=65535, which is ad hoc here,"


def _name(e: Evidence) -> str:
    return "ADHOC" if e.has_adhoc else "this ad-hoc LEN"


def _since_up(e: Evidence) -> str:
    up = e.facts.up_since
    if e.quiet_ns is not None or up is None:
        return ""
    return f". The link is up since scan {up.scan}, {age(e.age_of(up))}"


def _rate(e: Evidence) -> str:
    began = e.facts.job_began
    if state(e) != FILLING or began is None or e.last_bytes_ns is None:
        return ""
    lasted = e.last_bytes_ns - began.t_ns
    return f", {rate(e.have, lasted)}" if lasted >= 2 * e.interval_ns else ""


# -- who sends, and in which sizes ------------------------------------------------------------------------


def _last(e: Evidence) -> str:
    known = len(e.facts.messages.last)
    return f"{e.facts.sender}'s {'only message' if known == 1 else f'last {known} messages'}"


def _were(e: Evidence, size: int) -> str:
    return f"{_last(e)} {'was' if len(e.facts.messages.last) == 1 else 'were'} {count(size, 'byte')}"


# -- the rules --------------------------------------------------------------------------------------------


def shifted_by_a_drop(e: Evidence) -> Answer:
    """A frame was given up in its middle, and the bytes after it begin the next one."""
    drop, facts = e.facts.drop, e.facts
    if drop is None or e.adhoc or facts.up_since is None:
        return ""
    if not facts.messages.count:
        doubt = "unless the sender had ended a message there, the stream is shifted"
        return _in_step(e, f"{_drop(drop)}; {doubt}")
    message = facts.begins_in
    if message is None or not message.first:
        return ""
    begins = f"This frame begins with byte {message.first} of {facts.sender}'s message {message.number}"
    return _in_step(e, f"{_drop(drop)}. {begins}: the stream is shifted")


def _in_step(e: Evidence, cause: str) -> Sentence:
    if e.pin("COM_RST") is None:
        return do(cause, "disconnect and connect again: the next frame begins with a message")
    text = "{} to put the stream back in step, or CONT 0, then 1"
    return do(cause, text, f"pulse {e.instance} COM_RST")


def _drop(drop: DroppedJob) -> str:
    collected = f"{drop.have} of {count(drop.need, 'byte')} collected"
    return f"{drop.reason} in scan {drop.at.scan} with {collected}; they were dropped"


def shifted(e: Evidence) -> str:
    """The running job begins inside a message, and no dropped frame tells why."""
    message = e.facts.begins_in
    if e.adhoc or message is None or not message.first or e.facts.drop is not None or _fits(e):
        return ""
    return (
        f"this frame begins with byte {message.first} of {e.facts.sender}'s message "
        f"{message.number} ({count(message.whole, 'byte')}): frames and messages are shifted"
    )


def _fits(e: Evidence) -> bool:
    only = e.facts.messages.common
    return only is not None and only != e.need


def too_short_a_sender(e: Evidence) -> Answer:
    """Every message is shorter than the frame, and no whole number of them fills it."""
    size = e.facts.messages.common
    if size is None or not size < e.need or e.need % size == 0 or e.adhoc:
        return ""
    missing = e.need - size
    text = f"{limit(e)}. {_were(e, size)}: LEN or DATA is {count(missing, 'byte')} too large for this sender"
    if len(e.facts.messages.last) > 1 and e.done_scan is not None:
        text += f". Each frame takes {count(missing, 'byte')} of the next message, so the values wander"
    pins = (("LEN", f"set {e.instance} LEN={size}"), ("COM_RST", f"pulse {e.instance} COM_RST"))
    has_len, has_reset = (e.pin(pin) is not None for pin, _ in pins)
    way = f"make both equal: {'{}, or ' * has_len}give DATA {count(size, 'byte')}{'; then {}' * has_reset}"
    return do(text, way, *(line for pin, line in pins if e.pin(pin) is not None), needs_trial=True)


def several_messages_a_frame(e: Evidence) -> str:
    """A whole number of messages fills a frame."""
    size = e.facts.messages.common
    if size is None or e.adhoc or not size < e.need or e.need % size:
        return ""
    frame = f"{limit(e)}. {_were(e, size)}: one frame takes {e.need // size} of them"
    return f"{frame}, {e.have // size} are here" if e.have else frame


def too_long_a_sender(e: Evidence) -> Answer:
    """Every message is longer than the frame."""
    size = e.facts.messages.common
    if size is None or not e.need or size <= e.need:
        return ""
    if e.adhoc:
        return (
            f"{_were(e, size)}. {_name(e)} takes at most {e.need} at once: "
            f"one message comes as {-(-size // e.need)} frames"
        )
    rest = size % e.need
    if not rest:
        return f"{_were(e, size)}. {limit(e)}: one message comes as {size // e.need} frames"
    return do(
        f"{_were(e, size)}. {limit(e)}, which is too small for this sender: {count(rest, 'byte')} of each "
        "message begin a next frame, so the values wander",
        f"give DATA and LEN {count(size, 'byte')}",
    )


def one_odd_message(e: Evidence) -> str:
    """The newest message has another size than the frame, which all before it filled."""
    sizes = e.facts.messages.last
    if e.adhoc or len(sizes) < 2 or not e.need or sizes[-1] == e.need or set(sizes[:-1]) != {e.need}:
        return ""
    odd = sizes[-1] - e.need
    which = (
        f"{count(-odd, 'byte')} short of a frame" if odd < 0 else f"{count(odd, 'byte')} more than a frame"
    )
    return f"{e.facts.sender}'s newest message was {sizes[-1]} bytes, those before it {e.need}: it is {which}"


def messages_of_many_sizes(e: Evidence) -> Answer:
    """Messages differ in size, and a static frame has one."""
    sizes = e.facts.messages.last
    if e.adhoc or not sizes or e.facts.messages.common is not None or not e.need or one_odd_message(e):
        return ""
    return do(
        f"{_last(e)} had {min(sizes)} to {max(sizes)} bytes, a static frame has always {e.need}",
        f"{_switch(e)} takes what is there, or one job reads the header and one the rest",
    )


def bursts_do_not_fill(e: Evidence) -> str:
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


def ad_hoc_hint(e: Evidence) -> Answer:
    """Static, stuck, and nothing tells whether more will come."""
    if e.adhoc or state(e) != STUCK or not e.have:
        return ""
    here = count(e.have, "byte")
    if e.adhoc_at_once:
        now = do("", f"{{}} to get the {here} at once", f"set {e.instance} ADHOC=1", needs_trial=True)
        return do("", f"ADHOC=1 would have delivered the {here} at once") if e.is_past else now
    return do("", f"{_switch(e)} would have delivered the {here} at once (read when EN_R rises again)")


def parts_of_a_message(e: Evidence) -> str:
    """ADHOC delivers what is there: that may be a part of a message, or several."""
    size = e.facts.messages.common
    length = e.cause.have
    if not e.adhoc or size is None or not length or length == size or size > e.need:
        return ""
    if e.condition != "received":
        return ""
    what = f"{length} of them are a part of one" if length < size else f"{length} are more than one"
    return f"{_were(e, size)}: {what}; {_name(e)} delivers what is there, not messages"


def nothing_sent(e: Evidence) -> Answer:
    """The partner is a peer of this bench, and has sent nothing on this connection."""
    if e.have or e.facts.bursts.count or e.is_past or e.link is None or e.facts.up_since is None:
        return ""
    for peer in e.peers:
        if peer.state == "connected" and (peer.local, peer.remote) == (e.link.remote, e.link.local):
            text = f"{peer.name} has sent nothing on this connection"
            return do(text, "{}", f"peer {peer.name} send hex 01")
    return do("the partner has sent nothing since the link is up", "check there: is its send call enabled?")


# -- messages (ISO-on-TCP): a shorter one ends the job, a longer one is lost ------------------------------


def message_stands(e: Evidence) -> str:
    """Return what a job waits for: a message is here whole, or not at all."""
    armed = f"{ARMED} for one message of at most {count(e.need, 'byte')}; none received yet"
    return armed if e.is_past else armed + _before(e, "message") + _since_up(e)


def short_messages(e: Evidence) -> str:
    """A message shorter than LEN is a whole job; DATA keeps older bytes after it."""
    is_here = e.condition in (Condition.RECEIVED, Condition.FINISHED)
    size = e.cause.have if is_here else e.done_len
    if not size or not e.need or size >= e.need:
        return ""
    return (
        f"{limit(e)}, the last message had {count(size, 'byte')}. A message is a whole job whatever its "
        f"size: RCVD_LEN says {size}, and DATA keeps older bytes from byte {size} on"
    )


def too_long_messages(e: Evidence) -> Answer:
    """The partner's messages are longer than LEN or DATA: each is lost."""
    size = e.facts.messages.common
    if size is None or not e.need or size <= e.need:
        return ""
    return do(
        f"{e.facts.sender}'s messages have {count(size, 'byte')}, {limit(e)}: each is {size - e.need} too "
        "long, and lost",
        f"give DATA and LEN at least {size}",
    )


# -- datagrams --------------------------------------------------------------------------------------------

ANY_ADDRESS: Final = "0.0.0.0"


# -- receiving --------------------------------------------------------------------------------------------


def datagram_stands(e: Evidence) -> str:
    """Return what a job waits for: a datagram is here whole, or not at all."""
    if e.have:
        return f"a datagram of {count(e.have, 'byte')} is received and shows in the next scan"
    armed = f"{ARMED} for one datagram of at most {count(e.need, 'byte')}; none received yet"
    if e.is_past:
        return armed
    if e.quiet_ns is not None:
        return armed + _before(e, "datagram")
    since = e.facts.open_since
    opened = f". The socket is open since scan {since.scan}, {age(e.age_of(since))}" if since else ""
    return armed + opened


def wrong_port(e: Evidence) -> str:
    """A peer of this bench sends, but not to this socket."""
    if not _waits_for_the_first(e):
        return ""
    astray = next(
        (peer for peer in _udp_peers(e) if peer.remote and not _is_at(peer.remote, _local(e))), None
    )
    if astray is None or not astray.messages_sent:
        return ""
    return f"{astray.name} sends to {astray.remote}, this socket is at {_local(e)}: address or port is wrong"


def nobody_sends(e: Evidence) -> Answer:
    if not _waits_for_the_first(e) or wrong_port(e):
        return ""
    for peer in _udp_peers(e):
        if _is_at(peer.remote, _local(e)) and not peer.messages_sent:
            return do(f"{peer.name} has sent nothing", "{}", f"peer {peer.name} send hex 01")
    return do(
        f"no datagram has come to {_local(e)}; UDP tells the sender nothing, a firewall drops without a "
        "word, and 255.255.255.255 is not heard",
        "check whether the partner sends to this address and port",
    )


def _waits_for_the_first(e: Evidence) -> bool:
    return not e.is_past and e.link is not None and not e.have and not e.facts.datagrams.count


def _local(e: Evidence) -> str:
    return e.link.local if e.link is not None else ""


def _udp_peers(e: Evidence) -> tuple[PeerSnapshot, ...]:
    return tuple(peer for peer in e.peers if peer.udp)


def _is_at(target: str, local: str) -> bool:
    address, _, port = local.rpartition(":")
    return target == local or (address == ANY_ADDRESS and target.rpartition(":")[2] == port)


def too_long_datagrams(e: Evidence) -> str:
    """What does not fit into LEN or DATA is gone: a datagram comes once."""
    sizes = e.facts.datagrams.last
    need = e.need or 0
    if not need or not sizes or sizes[-1] <= need:
        return ""
    return (
        f"{limit(e)}, {_datagrams_were(e)}: {count(sizes[-1] - need, 'byte')} of it did not fit and are lost"
    )


def short_datagrams(e: Evidence) -> str:
    """A datagram shorter than LEN is a whole job; DATA keeps older bytes after it."""
    size = e.cause.have if e.condition == Condition.RECEIVED else e.done_len
    if not size or not e.need or size >= e.need or too_long_datagrams(e):
        return ""
    return (
        f"{limit(e)}, {_datagrams_were(e)}. A datagram is a whole job whatever its size: "
        f"RCVD_LEN says {size}, and DATA keeps older bytes from byte {size} on"
    )


def _datagrams_were(e: Evidence) -> str:
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


def datagrams_wait(e: Evidence) -> str:
    """The socket is open and EN_R is 0."""
    if e.pin("EN_R") != 0:
        return ""
    return "EN_R is 0: datagrams wait in the socket; when it is full the stack drops the newer ones unseen"


# -- sending ----------------------------------------------------------------------------------------------


def nobody_is_told(e: Evidence) -> Answer:
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
        return do(text, "{}", f"peer {near.name} listen")
    return f"it went to {target}, {near.name} receives at {near.local}: address or port in ADDR is wrong"


def took_it(e: Evidence) -> Answer:
    """Return the same of a block whose edge does not name the receiver."""
    return nobody_is_told(e) or (
        "DONE tells that the local stack took the datagram; UDP does not tell whether it came"
    )


def no_edge_for_a_datagram(e: Evidence) -> Answer:
    """The socket is open and REQ stays 1: that is no edge."""
    return req_stays(e)


def addr_is_empty(e: Evidence) -> Answer:
    """The receiver of a datagram stands in ADDR."""
    return do("ADDR names the receiver", "write both address and port into it before the edge of REQ")


def datagram_too_long(e: Evidence) -> Answer:
    """A datagram that DATA has no room for is gone, and the next one is clean."""
    have, need = e.cause.have, e.cause.need
    if not have or not need:
        return ""
    return do(f"the datagram had {count(have, 'byte')}, {have - need} too many", f"give DATA at least {have}")


# The same of blocks whose CONNECT says UDP: to these the socket is their connection.


def datagram_job_stands(e: Evidence) -> str:
    """Return what a receive job waits for, or how far a send job is."""
    return datagram_stands(e) if block_row(e.block).receives else how_far(e)


def socket_is_closed(e: Evidence) -> Answer:
    at = e.link.name if e.link is not None else "UDP_CONFIG"
    return do(
        f"the socket of {at} is not open; the next call tries again",
        "check whether LocalAddress is one of this machine, and LocalPort free (`ss -ulnp`)",
    )


def result_says(e: Evidence) -> str:
    return (
        f"RESULT ({e.data}): byte 6 is State (1 lost, 2 the active end calls, 3 the passive end waits, "
        "4 established), byte 8 on the bytes sent, byte 12 on those received"
    )
