"""Baosky STATUS words with ERROR=1, from 80A4: what stops a receive or send job.

The same number means something else on other vendors' blocks: rows where that misleads say so.
"""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reach, StatusRow
from trcvtui.dialects.baosky.states import BOTH, RECEIVE, SEND

JOB_ERRORS: Final = (
    StatusRow(
        0x80A4,
        Condition.DATA_EMPTY,
        BOTH,
        True,
        "DATA has no byte",
        (
            "no variable is bound to DATA",
            "the bound variable has size 0, or was shrunk to nothing",
        ),
        (
            "pin DATA of the call, in a project file the key `data` of the instance",
            "the size of the variable: `trcvtui udt show FILE`; on the bench `resize`",
            "the connection stays; as soon as DATA has a size the job starts",
        ),
        Reach.LOGIC,
        "7.15.1, 7.15.2",
    ),
    StatusRow(
        0x80A5,
        Condition.LENGTH_WRONG,
        BOTH,
        True,
        "LEN does not fit",
        (
            "LEN is larger than DATA, often after DATA was made smaller or its UDT changed",
            "LEN is above the limit of one job (65535; switch max_len)",
            "LEN is 0 and DATA itself is above that limit",
        ),
        (
            "pin LEN against the size of DATA: `trcvtui udt show FILE` counts the padding too",
            "where LEN comes from: a negative number turned into UDINT is huge",
            "the connection stays; as soon as LEN fits the job starts",
        ),
        Reach.LOGIC,
        "7.15.1, 7.15.2, 7.15.8, 7.15.9",
    ),
    StatusRow(
        0x80A6,
        Condition.SHORT_FRAME,
        RECEIVE,
        True,
        "Frame ended too early (static mode)",
        (
            "the partner closed when only part of LEN had come",
            "the partner's message is shorter than LEN, and it closes after each message",
            "a shift from earlier left a remainder that never becomes a frame",
        ),
        (
            "bytes here against bytes wanted at the moment of the close: the ledger has both",
            "the partner's message length against LEN (or the size of DATA); else ADHOC=1",
            "the next scan names the close itself; the part that had come is dropped, DATA is unchanged",
        ),
        Reach.REAL,
        "7.15.1",
    ),
    StatusRow(
        0x80A7,
        Condition.NO_BUFFER,
        BOTH,
        True,
        "No buffer for the job",
        (
            "more jobs run at the same time than the PLC has buffers",
            "a fault was injected at the buffer pool",
        ),
        (
            "count the instances with BUSY=1; lower EN_R where nothing is expected",
            "the switch `buffers` of the project: how many jobs the pool carries",
            "on a Siemens TDISCON the same number speaks of an unfinished TCON: not here",
        ),
        Reach.LOGIC,
        "7.15.1, 7.15.2",
    ),
    StatusRow(
        0x80A8,
        Condition.SEND_BUFFER_FULL,
        SEND,
        True,
        "Send buffer is full",
        (
            "the partner does not read, so not one byte of this job found room",
            "REQ comes faster than the line or the partner can take",
        ),
        (
            "`ss -tn`: Send-Q here and Recv-Q at the partner tell who is waiting",
            "the partner's receive call; a partner on the bench: `peer P1 resume`",
            "the connection stays: send again with a new REQ edge, and only after DONE or ERROR",
        ),
        Reach.REAL,
        "7.15.2",
    ),
    StatusRow(
        0x80A9,
        Condition.SEND_FAILED,
        SEND,
        True,
        "Sending failed",
        (
            "the partner reset the connection: crash, kill, or a close with bytes left unread (ECONNRESET)",
            "the partner had closed and the answer to our bytes was a reset (EPIPE)",
        ),
        (
            "the errno in the ledger, and the partner's log at that time",
            "does the partner read everything that this side sends before it closes?",
            "after 7004 a new REQ edge is needed: nothing is sent again by itself",
        ),
        Reach.REAL,
        "7.15.2",
    ),
    StatusRow(
        0x80AA,
        Condition.RECEIVE_FAILED,
        RECEIVE,
        True,
        "Receiving failed",
        (
            "the partner reset the connection: crash, kill, or an abortive close (ECONNRESET)",
            "the partner closed while bytes from this side lay unread in its socket",
            "a bench tool that drops its connection instead of closing it",
        ),
        (
            "the errno in the ledger, and the partner's log at that time",
            "`tcpdump -ni any tcp port <port>`: who sends the RST, and right after what?",
            "a TSEND_C on the same CONNECT: does the partner read what it sends?",
            "bytes of an unfinished frame are dropped; 7002 follows and the connection is rebuilt",
        ),
        Reach.REAL,
        "7.15.1",
    ),
    StatusRow(
        0x80AB,
        Condition.LINK_DEAD,
        BOTH,
        True,
        "The link is dead",
        (
            "cable, switch or power at the partner: no answer for 3 x KeepAliveTimeInterval",
            "the partner's address is gone, or a route or firewall in between has changed",
        ),
        (
            "link lamp, `ip -br link`, `ip neigh`, `ping <RemoteAddress>`",
            "KeepAliveTimeInterval: 0 means 10 s, so the loss shows after 30 s; a smaller value is faster",
            "it shows for one scan, then 7002: catch it in the program or read it in the ledger",
            "the partner was not told: it may hold the old connection and refuse the new one",
        ),
        Reach.NAMESPACE,
        "7.15.1, 7.15.2, 7.15.4",
    ),
    StatusRow(
        0x80AC,
        Condition.QUEUE_FULL,
        BOTH,
        True,
        "Job queue is full",
        (
            "more blocks connect, close or reset in one scan than the queue carries",
            "a fault was injected at the queue",
        ),
        (
            "let CONT and COM_RST of many blocks rise in different scans",
            "the switch `queue` of the project: how many such jobs one scan carries",
            "the block tries again in the next scan by itself",
        ),
        Reach.LOGIC,
        "7.15.1, 7.15.2, 7.15.6",
    ),
    StatusRow(
        0x80C3,
        Condition.CONNECT_IN_USE,
        BOTH,
        True,
        "CONNECT is used by another block of this kind",
        (
            "another TRCV_C with EN_R=1 (or a sending TSEND_C) works on the same CONNECT",
            "an instance was deleted in mid frame: its claim outlives it",
            "initial values were changed and downloaded in mid frame: that makes a new instance, "
            "the old one keeps the claim",
        ),
        (
            "search the project for this CONNECT: one TRCV_C and one TSEND_C may share it",
            "EN_R of the others to 0; give each its own CONNECT when both are needed",
            "no other block found: a rising edge at COM_RST, or CONT to 0 and back, frees the claim",
            "on a Siemens CPU the same number speaks of resources: not here",
        ),
        Reach.LOGIC,
        "7.15.1, 7.15.2",
    ),
    StatusRow(
        0x80C5,
        Condition.PARTNER_CLOSED,
        BOTH,
        True,
        "The partner closed during the job",
        (
            "the partner's program ended or closed its connection",
            "the partner opens and closes a connection for each message",
            "the partner closed its sending half only; this side takes that as a close",
            "a device or firewall that ends idle connections",
        ),
        (
            "the partner's log; the FIN comes from its address: `tcpdump -ni any tcp port <port>`",
            "bytes here against bytes wanted: a partner that sends less than LEN never fills a frame",
            "7002 follows and the connection is rebuilt: active calls again, passive waits",
            "TSEND_C: after 7004 a new REQ edge is needed",
        ),
        Reach.REAL,
        "7.15.1, 7.15.2",
    ),
)
