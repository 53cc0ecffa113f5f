"""Baosky (Tianxing) PLC: the answered questionnaire of manual 7.15.1, 7.15.2, 7.15.4, 7.15.14 and 7.15.15.

Each point that the manual leaves open is a switch.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from trcvtui.blocks.rules import NotConnectedRule, StatusRules, VendorRules
from trcvtui.dialects.baosky.status import STATUS
from trcvtui.dialects.baosky.udp_status import UDP_STATUS
from trcvtui.dialects.dialect import BACKLOG_SWITCH, INTERNAL_FAULT, Dialect, Switch, SwitchValue
from trcvtui.net.connection.config import ConnectionPolicy

SECOND: Final = 1_000_000_000  # ns
MAX_DATAGRAM: Final = 2048  # bytes, manual 7.15.14 and 7.15.15

SWITCHES: Final = (
    Switch("retry", "duration", SECOND, "pause between a failed attempt to connect and the next one"),
    Switch("attempt_limit", "duration", 5 * SECOND, "longest time that one attempt to connect may take"),
    Switch(
        "not_connected",
        "choice",
        "pulse",
        "80A1 of TRCV_C without a connection (pulse: one scan an edge; hold: each scan; never: not at all)",
        ("pulse", "hold", "never"),
    ),
    Switch(
        "short_frame",
        "choice",
        "both",
        "partner closes within a static frame (both: 80A6, then 80C5; 80C5: this code alone)",
        ("both", "80C5"),
    ),
    Switch(
        "reset_is",
        "choice",
        "80AA",
        "partner resets during a receive job (80AA: receiving failed; 80C5: as after a close)",
        ("80AA", "80C5"),
    ),
    # 7.15.1, 80AB: "holds it for one cycle, and subsequently stays in the 7002 state".
    Switch(
        "dead_link",
        "choice",
        "silent",
        "after 80AB (silent: 7002 until the link is up; 80A0: this code at each failed attempt)",
        ("silent", "80A0"),
    ),
    # 7.15.1, ADHOC mode: "sets the current reception function to ADHOC mode".
    Switch(
        "adhoc", "choice", "at_once", "ADHOC acts on the running job, or on the next", ("at_once", "latched")
    ),
    Switch("com_rst_autoclear", "bool", True, "the block writes COM_RST back to FALSE when the reset starts"),
    # The pin tables say 65535, the text of 80A5 says 65536.
    Switch("max_len", "choice", "65535", "longest job in bytes", ("65535", "65536")),
    # The UDP code tables could not be read; another vendor's block refuses such a datagram (80C9).
    Switch(
        "large_datagram",
        "choice",
        "error",
        "a datagram larger than LEN or DATA (error: lost with 80AA; cut: its first bytes are a frame)",
        ("error", "cut"),
    ),
    Switch("buffers", "count", 64, "jobs that can run at the same time; one more shows 80A7"),
    Switch("queue", "count", 64, "connects, closes and resets that one scan takes; one more shows 80AC"),
    # 7.15.1 and 7.15.2, notes: in tasks of different priority DATA gets into disorder.
    Switch(
        "lock_across_tasks",
        "bool",
        False,
        "blocks that share a CONNECT show 80C3 also across tasks of different priority",
    ),
    Switch(
        "user_timeout",
        "bool",
        True,
        "bytes unacknowledged for 3 keep-alive intervals show 80AB; false: only after minutes",
    ),
    Switch("strict_local_address", "bool", False, "a loopback LocalAddress shows 8081"),
    Switch(
        "second_client",
        "choice",
        "reject",
        "second client of a passive CONNECT (reject: reset; replace: takes the first's place; queue: waits)",
        ("reject", "replace", "queue"),
    ),
    Switch("check_remote_ip", "bool", True, "a passive CONNECT accepts only RemoteAddress (0.0.0.0: any)"),
    Switch("check_remote_port", "bool", False, "a passive CONNECT accepts clients only from RemotePort"),
    BACKLOG_SWITCH,
    INTERNAL_FAULT,
    Switch("small_buffers", "bool", False, "smallest socket buffers, so that 7005 and 80A8 come in seconds"),
)


def make_rules(values: Mapping[str, SwitchValue]) -> VendorRules:
    """Return the rules for these switch values; a switch that is not given has its default."""
    chosen = {switch.name: switch.default for switch in SWITCHES} | dict(values)
    return VendorRules(
        status={condition: row.code for row in STATUS for condition in row.conditions},
        not_connected=NotConnectedRule(chosen["not_connected"]),
        course=StatusRules(silent_dead_link=chosen["dead_link"] == "silent"),
        adhoc_at_once=chosen["adhoc"] == "at_once",
        short_frame_shown=chosen["short_frame"] == "both",
        reset_counts_as_close=chosen["reset_is"] == "80C5",
        com_rst_autoclear=bool(chosen["com_rst_autoclear"]),
        max_len=int(chosen["max_len"]),
        max_datagram=MAX_DATAGRAM,
        large_datagram_cut=chosen["large_datagram"] == "cut",
        lock_across_tasks=bool(chosen["lock_across_tasks"]),
        policy=_policy(chosen),
        buffers=int(chosen["buffers"]),
        queue=int(chosen["queue"]),
        internal_fault=int(str(chosen["internal_fault"]), 16),
    )


def _policy(chosen: Mapping[str, SwitchValue]) -> ConnectionPolicy:
    return ConnectionPolicy(
        retry_ns=int(chosen["retry"]),
        attempt_limit_ns=int(chosen["attempt_limit"]),
        strict_local_address=bool(chosen["strict_local_address"]),
        check_remote_ip=bool(chosen["check_remote_ip"]),
        check_remote_port=bool(chosen["check_remote_port"]),
        second_client=str(chosen["second_client"]),
        backlog=int(chosen["backlog"]),
        small_buffers=bool(chosen["small_buffers"]),
        user_timeout=bool(chosen["user_timeout"]),
    )


BAOSKY: Final = Dialect(
    name="baosky",
    title="Baosky (Tianxing) PLC, TCP and UDP blocks 7.15",
    blocks=("TRCV_C", "TSEND_C", "TCON", "TDISCON", "T_RESET", "TSEND", "TRCV", "USEND_C", "URECV_C"),
    status=STATUS + UDP_STATUS,
    switches=SWITCHES,
    models={"T3": 8, "T4": 32},  # TCP connections, manual 7.15.4
    default_model="T4",
    layout="baosky",
    answer=make_rules,
)
