"""Baosky STATUS words of the normal course: the codes that the manual lists above its exceptions.

A row lists only _C blocks (such as TSEND_C). status.py adds inner blocks (such as TSEND) to the rows.
Causes and checks tell a reader at the cabinet which pin to look at and which command to type.
`ss`, `nc`, `ip` and `tcpdump` are meant for the machine that runs the bench.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reproducibility, StatusRow

RECEIVE: Final = ("TRCV_C",)
SEND: Final = ("TSEND_C",)
BOTH_BLOCKS: Final = RECEIVE + SEND

_state_row: Final = partial(StatusRow, error=False)
STATES: Final = (
    _state_row(
        0x0000,
        Condition.NOT_CALLED,
        BOTH_BLOCKS,
        "Not called",
        (
            "the program has not called this instance yet",
            "the PLC is in STOP",
            "the call stands in a branch or a task that does not run",
            "TDISCON, T_RESET: called, but REQ has not risen, or there is nothing to close",
        ),
        (
            "PLC mode: `plc run`, and watch whether the scan counter moves",
            "the instance's task: is it in the project, and does it come round?",
            "STATUS of the instance itself, not a copy that is written elsewhere",
        ),
        Reproducibility.LOGIC,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.6, 7.15.7",
    ),
    _state_row(
        0x0001,
        Condition.CREATING,
        BOTH_BLOCKS,
        "Creating the socket",
        (
            "CONT (TCON: REQ) has just risen; this shows for one scan",
            "seen again and again: the program toggles CONT",
        ),
        (
            "the next scan: 7001 is good, 8080 means that no socket was left",
            "CONT in History: it rises once and stays 1",
        ),
        Reproducibility.LOGIC,
        "Baosky library manual 7.15.1, 7.15.2",
    ),
    _state_row(
        0x7000,
        Condition.NO_JOB,
        BOTH_BLOCKS,
        "No job, and no connection",
        (
            "CONT was never set; EN_R or a REQ edge alone builds no connection",
            "the program took CONT away, often in its own error handling",
            "an ordered close has ended (7003, 7007 stand before it)",
            "TCON: REQ has not risen yet; TSEND, TRCV: no block has built the connection that they need",
        ),
        (
            "pin CONT: set it to 1 and keep it there, also after an ERROR",
            "the logic that writes CONT: what drops it?",
            "a passive block listens only while CONT is 1: until then its partner is refused",
        ),
        Reproducibility.LOGIC,
        "Baosky library manual 7.15.1, 7.15.2",
    ),
    _state_row(
        0x7001,
        Condition.CREATED,
        BOTH_BLOCKS,
        "Socket created",
        (
            "the first step of the set-up worked; this shows for one scan",
            "seen again and again: the program toggles CONT",
        ),
        (
            "the next scan: 7002 is good, 8081 to 8084 name the step that failed",
            "LocalAddress and LocalPort are tried next: `ip -br address`, `ss -ltn`",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2",
    ),
    _state_row(
        0x7002,
        Condition.ESTABLISHING,
        BOTH_BLOCKS,
        "Connecting, or waiting for the partner",
        (
            "passive: no partner has called yet, or a wrong one was turned away",
            "both ends are active, or both are passive",
            "active: nothing answers (firewall, cable), or the pause after a failed attempt is running",
            "the connection was lost, or another block on this CONNECT closed or reset it",
        ),
        (
            "ActiveEstablished: TRUE on exactly one of the two ends",
            "passive: `ss -ltn` shows LocalPort; from the partner `nc -vz <LocalAddress> <LocalPort>`",
            "active: `nc -vz <RemoteAddress> <RemotePort>`; the ledger keeps a one-scan 80A0 and its errno",
            "`tcpdump -ni any tcp port <port>`: a SYN without answer is a firewall or the cable, an RST is a "
            "port on which no program listens",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.5, 7.15.6, 7.15.7",
    ),
    _state_row(
        0x7003,
        Condition.CLOSING,
        BOTH_BLOCKS,
        "Closing the connection",
        (
            "CONT fell: 7007 and 7000 follow, or 7000 alone when nothing was connected",
            "COM_RST rose: part of a reset, 7007 and 7002 follow",
            "REQ of a TDISCON or a T_RESET rose: 7007 with DONE follows",
        ),
        (
            "pins CONT and COM_RST in the scan before: which of them moved?",
            "a frame that was half here is dropped with the connection: the ledger counts its bytes",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.6, 7.15.7",
    ),
    _state_row(
        0x7004,
        Condition.CONNECTED,
        BOTH_BLOCKS,
        "Connected, nothing asked for",
        (
            "the connection has just come up; one scan before 7006 when EN_R is 1",
            "TCON: it is up and is kept; TCON itself moves no bytes",
            "TRCV_C: EN_R is 0, so arriving bytes pile up unread in the socket",
            "TSEND_C: no rising edge at REQ; a REQ that stays 1 sends once only",
        ),
        (
            "TRCV_C: pin EN_R has to be 1 and stay 1",
            "TSEND_C: REQ has to go back to 0 before the next edge",
            "quiet for long: a cut line or a partner without power looks the same until keep-alive ends it",
            "`ss -tn`: Recv-Q above 0 means that the partner sends and no block reads",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.5, 7.15.7, 7.15.8, 7.15.9",
    ),
    _state_row(
        0x7005,
        Condition.SENDING,
        SEND,
        "Sending",
        (
            "a send job has started; at least one scan, however fast the line",
            "the partner does not read, so the rest of the frame has no room",
            "a long frame on a slow line",
        ),
        (
            "`ss -tn`: a Send-Q that does not shrink means that the partner has stopped reading",
            "the partner's receive call: is it enabled, and is its buffer large enough?",
            "REQ: further edges are ignored until 7009 or an error",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.2, 7.15.8",
    ),
    _state_row(
        0x7006,
        Condition.RECEIVING,
        RECEIVE,
        "Receiving, or ready and waiting",
        (
            "nothing has come: normal with EN_R = 1; a cut line or a partner without power looks the same "
            "until keep-alive ends it",
            "LEN (or the size of DATA when LEN is 0) is larger than what the partner sends",
            "padding makes DATA larger than the partner's record: UDT parts fill up to 4, a STRING is 82",
            "an earlier frame was cut (EN_R dropped, DATA resized), so the stream is shifted",
        ),
        (
            "compare the bytes here with the bytes wanted; how long ago did the last one come?",
            "compare the partner's message length with LEN; `trcvtui udt show FILE` prints the size of a UDT",
            "messages of varying length need ad-hoc mode, or one job for the header and one for the rest",
            "if values look shifted, pulse COM_RST and look at the first frame after it",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.9",
    ),
    _state_row(
        0x7007,
        Condition.CLOSED,
        BOTH_BLOCKS,
        "Closed by this side",
        (
            "CONT fell while connected: 7000 follows",
            "COM_RST rose: 7002 follows and the connection is rebuilt",
            "a TDISCON or a T_RESET has ended its work: DONE shows with it, for one scan",
        ),
        (
            "pins CONT and COM_RST: what moved, and was it meant?",
            "other blocks on this CONNECT lose the connection with it and show 7002",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.6, 7.15.7",
    ),
    _state_row(
        0x7008,
        Condition.RECEIVED,
        RECEIVE,
        "Frame received",
        (
            "static: all the bytes that LEN (or DATA) asks for are here",
            "ad-hoc: at least one byte is here; it may be part of a message, or several messages",
        ),
        (
            "copy RCVD_LEN in this very scan: together with DONE it is gone in the next",
            "values look wrong: bytes are little-endian and a UDT has padding; put hex and UDT side by side",
            "merged or split messages: TCP keeps no message ends, so LEN has to equal the partner's length",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.9",
    ),
    _state_row(
        0x7009,
        Condition.SENT,
        SEND,
        "Frame handed over",
        (
            "the local network stack has taken every byte",
            "this is no receipt: the partner may not have read it, or may have left already",
        ),
        (
            "`ss -tn`: Send-Q at 0 means that the partner's machine has confirmed the bytes",
            "whether the partner really has it: only an answer in your own protocol can tell",
            "the partner sees less than was sent: its program has to read on until the whole length is there",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.2, 7.15.8",
    ),
    _state_row(
        0x8000,
        Condition.RESETTING,
        BOTH_BLOCKS,
        "Resetting the connection",
        (
            "COM_RST (T_RESET: REQ) rose while connected; 7003, 7007 and 7002 follow",
            "the reset is meant to clear a shifted stream or a CONNECT that a lost instance still holds",
        ),
        (
            "COM_RST: an edge counts; with the switch com_rst_autoclear the block writes it back to FALSE",
            "the partner sees a reset and drops what it had; a passive block waits until it calls again",
            "without a connection, or with CONT=0, COM_RST does nothing and is not remembered",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.7",
    ),
)
