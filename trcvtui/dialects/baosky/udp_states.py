"""STATUS words of the normal course of the Baosky UDP blocks USEND_C and URECV_C (manual 7.15.14, 7.15.15).

Their own code tables could not be read: each code means what it means to the TCP blocks, where UDP has it.
The manual's own words: 7001 is the ready state, and DONE lasts one scan.
"""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reach, StatusRow

IN: Final = ("URECV_C",)
OUT: Final = ("USEND_C",)
UDP: Final = IN + OUT
MANUAL: Final = "7.15.14, 7.15.15"

UDP_STATES: Final = (
    StatusRow(
        0x0000,
        Condition.NOT_CALLED,
        UDP,
        False,
        "Not called",
        ("the program has not called this instance yet", "the PLC is in STOP: its UDP sockets are closed"),
        (
            "PLC mode: `plc run`, and watch whether the scan counter moves",
            "the instance's task: is it in the project, and does it come round?",
        ),
        Reach.LOGIC,
        MANUAL,
    ),
    StatusRow(
        0x0001,
        Condition.CREATING,
        UDP,
        False,
        "Creating the UDP socket",
        (
            "CONT has just risen; this shows for one scan",
            "an attempt has failed (the code was shown for one scan) and the next one is waited for",
            "another block on this UDP_CONFIG has closed the socket; it is made anew",
        ),
        (
            "the next scan: 7001 is good, 808x says what stands in the way",
            "the ledger: which call failed, and with which errno",
            "switch retry: the pause between two attempts",
        ),
        Reach.LOGIC,
        MANUAL,
    ),
    StatusRow(
        0x7000,
        Condition.NO_JOB,
        UDP,
        False,
        "No job: CONT is 0",
        (
            "CONT is 0, so there is no socket, whatever REQ or EN_R say",
            "the socket was released and 7007 has been shown",
        ),
        (
            "pin CONT: what should raise it, and does it?",
            "datagrams that arrive now are lost without a word to the sender",
        ),
        Reach.LOGIC,
        MANUAL,
    ),
    StatusRow(
        0x7001,
        Condition.CREATED,
        UDP,
        False,
        "Ready: the UDP socket is there",
        (
            "the socket is bound; UDP has no connection, so this is the ready state",
            "USEND_C: REQ has not risen; URECV_C: EN_R is 0",
        ),
        (
            "this says nothing about the partner: whether it is there, only an answer can tell",
            "`ss -uln`: the port is listed; Recv-Q counts bytes that wait for EN_R",
        ),
        Reach.REAL,
        MANUAL,
    ),
    StatusRow(
        0x7003,
        Condition.CLOSING,
        UDP,
        False,
        "Releasing the UDP socket",
        (
            "CONT has just fallen; this shows for one scan",
            "what waits in the socket is dropped, without DONE and without ERROR",
        ),
        (
            "the next scan: 7007 when there was a socket, 7000 when there was none",
            "another block on this UDP_CONFIG loses the socket with it and makes it anew (0001, 7001)",
        ),
        Reach.LOGIC,
        MANUAL,
    ),
    StatusRow(
        0x7005,
        Condition.SENDING,
        OUT,
        False,
        "Sending a datagram",
        (
            "REQ rose while ready: the stack was given the datagram in this very scan",
            "this shows for one scan, then 7009",
        ),
        (
            "pin ADDR: the target is named in the ledger and beside STATUS",
            "a further REQ edge in this scan is not seen",
        ),
        Reach.REAL,
        MANUAL,
    ),
    StatusRow(
        0x7006,
        Condition.RECEIVING,
        IN,
        False,
        "Waiting for a datagram",
        (
            "EN_R is 1 and no datagram has come since the last job",
            "a datagram is here and shows in the next scan: one 7006 stands before each 7008",
        ),
        (
            "the partner's target: it must be this LocalAddress and LocalPort",
            "`ss -uln` Recv-Q, or `tcpdump udp port N`: does anything arrive at all?",
            "a firewall on this machine drops datagrams without a trace here",
        ),
        Reach.REAL,
        MANUAL,
    ),
    StatusRow(
        0x7007,
        Condition.CLOSED,
        UDP,
        False,
        "UDP socket released",
        (
            "CONT fell while the socket was there; this shows for one scan",
            "7000 follows, whatever REQ or EN_R say",
        ),
        (
            "pin CONT: was it meant to fall?",
            "other blocks on this UDP_CONFIG with CONT=1 make the socket anew",
        ),
        Reach.REAL,
        MANUAL,
    ),
    StatusRow(
        0x7008,
        Condition.RECEIVED,
        IN,
        False,
        "Datagram received",
        (
            "one datagram is one job: RCVD_LEN is its size, also when it is shorter than LEN",
            "ADDR holds the sender's address and port from this scan on",
        ),
        (
            "copy RCVD_LEN in this very scan: together with DONE it is gone in the next",
            "bytes of DATA behind RCVD_LEN are those of earlier datagrams",
            "UDP may lose, double and reorder: only a number inside the telegram can tell",
        ),
        Reach.REAL,
        MANUAL,
    ),
    StatusRow(
        0x7009,
        Condition.SENT,
        OUT,
        False,
        "Datagram handed over",
        (
            "the local network stack has the whole datagram",
            "this is no receipt: it shows just the same when nobody listens at the target",
        ),
        (
            "ADDR: is it the right machine and port?",
            "`tcpdump udp port N` at the partner; only an answer in your own protocol proves the arrival",
        ),
        Reach.REAL,
        MANUAL,
    ),
)
