"""STATUS words of the Siemens blocks, versions from 3.0, by condition (siemens.md sections 1 and 2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from trcvtui.blocks.conditions import Condition

# TSEND_C and TRCV_C: siemens.md 2.1 and 2.2; what each instruction shows in its own way stands below.
CODES: Final[Mapping[Condition, int]] = {
    Condition.NOT_CALLED: 0x0000,
    Condition.NO_JOB: 0x7000,
    Condition.CREATING: 0x7001,
    Condition.CREATED: 0x7002,
    Condition.ESTABLISHING: 0x7002,
    Condition.CLOSING: 0x7003,
    Condition.CONNECTED: 0x7004,
    Condition.JOB_BEGINS: 0x0001,
    Condition.SENDING: 0x7005,
    Condition.RECEIVING: 0x7006,
    Condition.CLOSED: 0x0003,
    Condition.RECEIVED: 0x0000,
    Condition.SENT: 0x0000,
    Condition.RESETTING: 0x7003,
    Condition.NO_SOCKET: 0x80C3,
    Condition.WRONG_LOCAL_ADDRESS: 0x809B,
    Condition.REUSE_FAILED: 0x80C4,
    Condition.BIND_FAILED: 0x80C4,
    Condition.POLL_ADD_FAILED: 0x80C4,
    Condition.ACCEPT_FAILED: 0x80C4,
    Condition.POLL_DEL_FAILED: 0x80C4,
    Condition.CONNECT_FAILED: 0x80C4,
    Condition.NOT_CONNECTED: 0x80A1,
    Condition.DISCONNECT_FAILED: 0x80C4,
    Condition.RESET_FAILED: 0x80C4,
    Condition.DATA_EMPTY: 0x8085,
    Condition.LENGTH_WRONG: 0x8085,
    Condition.SHORT_FRAME: 0x80C5,
    Condition.NO_BUFFER: 0x80C3,
    Condition.SEND_BUFFER_FULL: 0x80C4,
    Condition.SEND_FAILED: 0x80C4,
    Condition.RECEIVE_FAILED: 0x80C4,
    Condition.LINK_DEAD: 0x80C6,
    Condition.QUEUE_FULL: 0x80C3,
    Condition.CONNECT_IN_USE: 0x80C3,
    Condition.PARTNER_CLOSED: 0x80C5,
    Condition.REFUSED: 0x80C5,
    Condition.UNREACHABLE: 0x80C6,
    Condition.NOT_NOW: 0x80C4,
    Condition.FOUND_CLOSED: 0x80A3,
    Condition.STILL_ASKED: 0x80C4,
    Condition.LET_GO: 0x80AA,
    Condition.RESET_IN_JOB: 0x80A7,
    Condition.PORT_IN_USE: 0x80A1,
    Condition.PORT_RESERVED: 0x80A2,
    Condition.REMOTE_WRONG: 0x80A4,
    Condition.LEN_OVER_DATA: 0x8088,
    Condition.AREA_CHANGED: 0x8085,
    Condition.MESSAGE_TOO_LONG: 0x80C9,
}
