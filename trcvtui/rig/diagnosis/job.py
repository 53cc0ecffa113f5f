"""What a send job, a lock, a pin or a buffer proves: who does not read, who holds, which number is wrong.

Each rule takes the evidence and answers one sentence, or "" where it does not apply.
"""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.table import block_row
from trcvtui.rig.diagnosis.evidence import Evidence
from trcvtui.rig.history.records import Drop, Facts
from trcvtui.rig.snapshots import PeerSnapshot
from trcvtui.rig.wording import age, count

GONE: Final = " (gone)"


# -- sending ----------------------------------------------------------------------------------------------


def how_far(e: Evidence) -> str:
    """Return how much of a send job the local stack has taken, and what is on the way."""
    text = f"the local stack has {e.have} of {count(e.need, 'byte')}"
    if e.is_past:
        return text
    if e.have < e.need and e.quiet_ns is not None:
        text += f", it took none for {age(e.quiet_ns)}"
    return text + _on_the_way(e)


def _on_the_way(e: Evidence) -> str:
    waiting = e.link.unacknowledged if e.link is not None else None
    return f"; {count(waiting, 'byte')} not acknowledged by the partner" if waiting else ""


def does_not_read(e: Evidence) -> str:
    """Bytes of ours stay unacknowledged, or the stack takes no more: the partner does not read."""
    if e.is_past:
        return ""
    waiting = e.link.unacknowledged if e.link is not None else None
    stuck = e.condition == "send buffer full" or e.have < e.need
    if not stuck:
        return ""
    who = e.link.remote if e.link is not None and e.link.remote else "the partner"
    held = f"{count(waiting, 'byte')} of ours are not acknowledged, " if waiting else ""
    return f"{held}the window is closed: {who} does not read; its receive call is off, or slower than REQ"


def stalled_peer(e: Evidence) -> str:
    """The partner is a peer of this bench that was told not to read."""
    peer = partner(e)
    if peer is None or not peer.stalled:
        return ""
    return f"{peer.name} was told to stop reading: `peer {peer.name} resume`"


def partner(e: Evidence) -> PeerSnapshot | None:
    """Return the peer of this bench at the other end of the connection."""
    if e.link is None or e.link.state != "connected":
        return None
    ends = e.link.remote, e.link.local
    return next((p for p in e.peers if p.state == "connected" and (p.local, p.remote) == ends), None)


# -- who holds the CONNECT --------------------------------------------------------------------------------


def who_holds(e: Evidence) -> str:
    """Another instance works on this CONNECT: which one, and how it lets go."""
    sends = block_row(e.block).sends
    owners = (e.link.senders if sends else e.link.receivers) if e.link is not None else ()
    holder = next((o for o in owners if o.removesuffix(GONE) != e.instance or o.endswith(GONE)), "")
    holder = holder or e.cause.holder
    if not holder:
        return ""
    side = "send" if sends else "receive"
    connect = e.link.name if e.link is not None else e.config.name if e.config is not None else "this CONNECT"
    if holder.endswith(GONE) or e.cause.is_orphan:
        return (
            f"{holder.removesuffix(GONE)} was deleted or downloaded in mid frame and still holds the {side} "
            f"side of {connect}: CONT 0 then 1, or COM_RST, frees it"
        )
    cure = "it lets go with its DONE or ERROR" if sends else f"`set {holder} EN_R=0` frees it"
    return f"{holder} holds the {side} side of {connect}: {cure}; better give each a CONNECT of its own"


# -- pins and parameters ----------------------------------------------------------------------------------


def wrong_length(e: Evidence) -> str:
    """LEN does not fit: which of the two limits, and what would."""
    have, most = e.cause.have, e.cause.need
    if have is None or most is None:
        return ""
    data = f"DATA ({e.data}) has {count(e.data_size, 'byte')}" if e.data else "DATA is open"
    if e.cause.value:
        way = "LEN=0 takes all of DATA" if e.data_size <= most else f"at most LEN={most}"
        return f"LEN is {e.cause.value}, {data}: {have - most} too many; {way}, or enlarge DATA"
    return f"LEN is 0 and {data}, {have - most} more than one job can have: set LEN to at most {most}"


def no_data(e: Evidence) -> str:
    """DATA is open or empty."""
    return "the DATA pin is open: give the instance a variable" if not e.data else f"{e.data} has no byte"


def nobody_reads_here(e: Evidence) -> str:
    """Connected, EN_R is 0, and the stream was left in the middle of a frame."""
    is_off = e.cause.value == 0 if e.cause.pin == "EN_R" and e.is_past else e.pin("EN_R") == 0
    if not is_off or e.condition != "connected":
        return ""
    drop = e.facts.drop
    if drop is None:
        return "EN_R is 0: what arrives now waits unread in the socket, nothing is lost"
    text = f"EN_R fell in scan {drop.at.scan} with {drop.have} of {count(drop.need, 'byte')} collected"
    return f"{text}; they are dropped, and the next frame {_begins(e.facts, drop)}"


def _begins(facts: Facts, drop: Drop) -> str:
    """Return with what the frame behind a drop begins."""
    if facts.drop_cuts is False:
        return "begins with a message"
    cure = "COM_RST before EN_R=1"
    if facts.drop_cuts is None or facts.after_drop is None:
        return f"may begin in the middle of a message: {cure}"
    byte, message = drop.end - facts.after_drop.offset, facts.after_drop.number
    return (
        f"begins in the middle of a message, with byte {byte} of {facts.sender}'s message {message}: {cure}"
    )


def no_edge(e: Evidence) -> str:
    """Connected, and REQ stays 1: that is no edge."""
    if e.pin("REQ") != 1 or e.condition != "connected":
        return ""
    return "REQ stays 1: a job starts with a rising edge only, set it to 0 first"


def cont_is_missing(e: Evidence) -> str:
    """No job because CONT is 0, and where REQ or EN_R connects, because that does not ask."""
    if e.pin("CONT") != 0 or e.condition != "no job":
        return ""
    keeps = f"`set {e.instance} CONT=1` connects, too, and stays"
    if e.cause.pin == "REQ":
        first = "REQ stays 1: set it to 0 first; an edge" if e.pin("REQ") else f"`pulse {e.instance} REQ`"
        return f"{first} connects, sends and disconnects; {keeps}"
    if e.cause.pin == "EN_R":
        return f"`set {e.instance} EN_R=1` connects, receives and disconnects; {keeps}"
    asked = [pin for pin in ("EN_R", "REQ") if e.pin(pin)]
    return f"CONT is 0{f' while {asked[0]} is 1' if asked else ''}: `set {e.instance} CONT=1`"


def not_called(e: Evidence) -> str:
    """Nothing is called in STOP."""
    if e.is_stopped:
        return "the PLC is in STOP, no block is called: `plc run`"
    return "" if e.is_past else f"no scan has called {e.instance} yet: is its task running?"


SENDING: Final = (stalled_peer, does_not_read)
IN_USE: Final = (who_holds,)
LENGTH: Final = (wrong_length,)
EMPTY: Final = (no_data,)
IDLE: Final = (nobody_reads_here, no_edge)
NO_JOB: Final = (cont_is_missing,)
