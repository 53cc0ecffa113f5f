"""What the datagrams of a URECV_C or USEND_C prove: sizes against LEN, nobody sends, the wrong port.

Each rule takes the evidence and answers one sentence, or "" where it does not apply.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.rig.diagnosis import job as job
from trcvtui.rig.diagnosis import link as link
from trcvtui.rig.diagnosis.evidence import Evidence
from trcvtui.rig.diagnosis.receive import limit
from trcvtui.rig.snapshots import PeerSnapshot
from trcvtui.rig.wording import age, count

ANY: Final = "0.0.0.0"


# -- receiving --------------------------------------------------------------------------------------------


def how_it_stands(e: Evidence) -> str:
    """Return what a job waits for: a datagram is here whole, or not at all."""
    if e.have:
        return f"a datagram of {count(e.have, 'byte')} is here and shows in the next scan"
    armed = f"armed for one datagram of at most {count(e.need, 'byte')}"
    if e.is_past:
        return f"{armed}: none was here yet"
    if e.quiet_ns is not None:
        return f"{armed}: none is here yet; the one before came {age(e.quiet_ns)} ago"
    since = e.facts.open_since
    opened = f"; the socket is open since scan {since.scan}, {age(e.age_of(since))}" if since else ""
    return f"{armed}: none is here yet{opened}"


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


def nobody_sends(e: Evidence) -> str:
    """No datagram has come to this socket yet."""
    if not _waits_for_the_first(e) or wrong_port(e):
        return ""
    for peer in _udp_peers(e):
        if _is_at(peer.remote, _local(e)) and not peer.messages_sent:
            return f"{peer.name} has sent nothing: `peer {peer.name} send hex 01`"
    return (
        f"no datagram has come to {_local(e)}: does the partner send to this address and port? UDP tells "
        "the sender nothing, and a firewall drops without a word"
    )


def _waits_for_the_first(e: Evidence) -> bool:
    return not e.is_past and e.link is not None and not e.have and not e.facts.datagrams.count


def _local(e: Evidence) -> str:
    return e.link.local if e.link is not None else ""


def _udp_peers(e: Evidence) -> tuple[PeerSnapshot, ...]:
    return tuple(peer for peer in e.peers if peer.udp)


def _is_at(target: str, local: str) -> bool:
    """Return whether what goes to `target` comes to a socket at `local`."""
    address, _, port = local.rpartition(":")
    return target == local or (address == ANY and target.rpartition(":")[2] == port)


def too_long_datagrams(e: Evidence) -> str:
    """What does not fit into LEN or DATA is gone: a datagram comes once."""
    sizes = e.facts.datagrams.last
    need = e.need or 0
    if not need or not sizes or sizes[-1] <= need:
        return ""
    return f"{limit(e)}, {_were(e)}: {count(sizes[-1] - need, 'byte')} of it did not fit and are lost"


def short_datagrams(e: Evidence) -> str:
    """A datagram shorter than LEN is a whole job; DATA keeps older bytes behind it."""
    size = e.cause.have if e.condition == Condition.RECEIVED else e.done_len
    if not size or not e.need or size >= e.need or too_long_datagrams(e):
        return ""
    return (
        f"{limit(e)}, {_were(e)}: a datagram is a whole job whatever its size, RCVD_LEN says {size}, "
        f"and DATA keeps older bytes from byte {size} on"
    )


def _were(e: Evidence) -> str:
    """Return the sizes of what came last."""
    sizes = e.facts.datagrams
    if len(sizes.last) < 2:
        return (
            f"the only datagram had {count(sizes.last[-1], 'byte')}"
            if sizes.last
            else "the datagram is short"
        )
    if sizes.only is not None:
        return f"the last {len(sizes.last)} datagrams had {count(sizes.only, 'byte')}"
    span = f"{min(sizes.last)} to {count(max(sizes.last), 'byte')}"
    return f"the last {len(sizes.last)} datagrams had {span}, the newest {sizes.last[-1]}"


def at_rest(e: Evidence) -> str:
    """Between two datagrams that came well, armed is the normal state."""
    if e.have or e.done_scan is None or e.is_past:
        return ""
    return (
        f"not stuck: the last datagram ({count(e.done_len or 0, 'byte')}) was delivered "
        f"in scan {e.done_scan}, the next one has not come"
    )


def nobody_reads_here(e: Evidence) -> str:
    """The socket is open and EN_R is 0."""
    if e.pin("EN_R") != 0:
        return ""
    return "EN_R is 0: datagrams wait in the socket; when it is full the stack drops the newer ones unseen"


# -- sending ----------------------------------------------------------------------------------------------


def nobody_is_told(e: Evidence) -> str:
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
        return f"it went to {target}, and {near.name} is closed: `peer {near.name} listen`"
    return f"it went to {target}, {near.name} receives at {near.local}: address or port in ADDR is wrong"


def took_it(e: Evidence) -> str:
    """Return the same of a block whose edge does not name the receiver."""
    return nobody_is_told(e) or (
        "DONE tells that the local stack took the datagram; UDP does not tell whether it came"
    )


def no_edge(e: Evidence) -> str:
    """The socket is open and REQ stays 1: that is no edge."""
    return "REQ stays 1: a job starts with a rising edge only, set it to 0 first" if e.pin("REQ") == 1 else ""


def addr_is_empty(e: Evidence) -> str:
    """The receiver of a datagram stands in ADDR."""
    return "ADDR is the receiver: write both address and port into it before the edge of REQ"


def message_too_long(e: Evidence) -> str:
    """A datagram that DATA has no room for is gone, and the next one is clean."""
    have, need = e.cause.have, e.cause.need
    if not have or not need:
        return ""
    return f"the datagram had {count(have, 'byte')}, {have - need} too many; DATA of at least {have} takes it"


Rule = Callable[[Evidence], str]
NOW: Final[dict[Condition, Rule]] = {Condition.RECEIVING: how_it_stands, Condition.SENDING: job.how_far}
NEXT: Final[dict[Condition, tuple[Rule, ...]]] = {
    Condition.CREATED: (nobody_reads_here, no_edge),
    Condition.RECEIVING: (wrong_port, nobody_sends, too_long_datagrams, short_datagrams, at_rest),
    Condition.RECEIVED: (too_long_datagrams, short_datagrams),
    Condition.RECEIVE_FAILED: (link.injected, too_long_datagrams),
    Condition.SEND_FAILED: (link.injected,),
    Condition.SENDING: (nobody_is_told,),
    Condition.SENT: (nobody_is_told,),
    Condition.CONNECT_IN_USE: job.IN_USE,
    Condition.LENGTH_WRONG: job.LENGTH,
    Condition.DATA_EMPTY: job.EMPTY,
    Condition.NO_JOB: (job.cont_is_missing,),
}
# The same of blocks whose CONNECT says UDP: to these the socket is their connection.
NOW_BY_CONNECT: Final[dict[Condition, Rule]] = {**NOW, Condition.ESTABLISHING: link.who_is_waited_for}
BY_CONNECT: Final[dict[Condition, tuple[Rule, ...]]] = {
    **{condition: rules for condition, rules in NEXT.items() if condition is not Condition.CREATED},
    Condition.CONNECTED: (nobody_reads_here, no_edge),
    **dict.fromkeys((Condition.SENDING, Condition.SENT), (took_it,)),
    Condition.MESSAGE_TOO_LONG: (message_too_long,),
    Condition.REMOTE_WRONG: (addr_is_empty,),
    Condition.SEND_BUFFER_FULL: (link.injected, nobody_is_told),
}
