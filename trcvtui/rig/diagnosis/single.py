"""What TUSEND, TURCV and T_DIAG prove: datagrams of a socket that is open by itself, and what RESULT says.

Each rule takes the evidence and answers one sentence, or "" where it does not apply.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.table import block_row
from trcvtui.rig.diagnosis import job as job
from trcvtui.rig.diagnosis import link as link
from trcvtui.rig.diagnosis import udp as udp
from trcvtui.rig.diagnosis.evidence import Evidence

Rule = Callable[[Evidence], str]


def how_it_stands(e: Evidence) -> str:
    """Return what a receive job waits for, or how far a send job is."""
    return udp.how_it_stands(e) if block_row(e.block).receives else job.how_far(e)


def socket_is_closed(e: Evidence) -> str:
    """Without its socket no datagram moves."""
    at = e.link.name if e.link is not None else "UDP_CONFIG"
    return (
        f"the socket of {at} is not open: is LocalAddress one of this machine, and LocalPort free "
        "(`ss -ulnp`)? The next call tries again"
    )


def result_says(e: Evidence) -> str:
    """Return where the answer stands."""
    return (
        f"RESULT ({e.data}): byte 6 is State (1 lost, 2 the active end calls, 3 the passive end waits, "
        "4 established), byte 8 on the bytes sent, byte 12 on those received"
    )


_RECEIVING: Final[tuple[Rule, ...]] = (
    udp.wrong_port,
    udp.nobody_sends,
    udp.short_datagrams,
    udp.at_rest,
    udp.nobody_is_told,
)
NOW: Final[dict[Condition, Rule]] = {Condition.STARTED: how_it_stands, Condition.RUNNING: how_it_stands}
DATAGRAMS: Final[dict[Condition, tuple[Rule, ...]]] = {
    Condition.NO_JOB: (udp.nobody_reads_here, udp.no_edge),
    Condition.STARTED: _RECEIVING,
    Condition.RUNNING: _RECEIVING,
    Condition.RECEIVED: (udp.short_datagrams,),
    Condition.SENT: (udp.nobody_is_told,),
    Condition.MESSAGE_TOO_LONG: (udp.message_too_long,),
    Condition.RECEIVE_FAILED: (link.injected,),
    Condition.SEND_FAILED: (link.injected,),
    Condition.NOT_CONNECTED: (socket_is_closed,),
    Condition.REMOTE_WRONG: (udp.addr_is_empty,),
    Condition.NEEDS_ADDR: (udp.addr_is_empty,),
    Condition.CONNECT_IN_USE: job.IN_USE,
    Condition.LENGTH_WRONG: job.LENGTH,
    Condition.DATA_EMPTY: job.EMPTY,
}
RESULT: Final[dict[Condition, tuple[Rule, ...]]] = {Condition.FINISHED: (result_says,)}
