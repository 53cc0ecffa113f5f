"""Siemens STATUS words 80C3 to 80C9: no resources, not now, refused or closed, unreachable, too long."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reach, StatusRow
from trcvtui.dialects.siemens.blocks import BOTH_C, CLOSE, RCV_C, SET_UP, TCON, UDP

_LINKED: Final = (*SET_UP, "TSEND", "TRCV")  # these meet a partner over a connection

JOB_ERRORS: Final = (
    StatusRow(
        0x80C3,
        Condition.NO_SOCKET,
        (*BOTH_C, *TCON, *CLOSE, "TSEND", "TRCV", *UDP),
        True,
        "No resources, or the ID is busy elsewhere",
        (
            "all connections of the CPU are in use, or the process has no free file descriptor",
            "another instance works on the same CONNECT in the same direction",
            "more jobs run at the same time than the CPU has room for",
            "a block with this ID works in a task of another priority: one OB for all of them",
        ),
        (
            "the cause in the ledger: budget, queue, buffer, or the name of the other instance",
            "count the CONNECTs in use; CONT = 0 or TDISCON where none is needed",
            "`ulimit -n` and `ls /proc/PID/fd | wc -l` where the errno is EMFILE",
        ),
        Reach.LOGIC,
        "siemens.md 2.1 to 2.5, 2.7",
        also=(Condition.NO_BUFFER, Condition.QUEUE_FULL, Condition.CONNECT_IN_USE),
        unsure="for TDISCON and T_RESET no list names it: here a full job queue shows it",
    ),
    StatusRow(
        0x80C4,
        Condition.NOT_NOW,
        (*SET_UP, *CLOSE, "TSEND", "TRCV", "TURCV"),
        True,
        "Not possible at this moment",
        (
            "TRCV, TRCV_C: EN_R is 1 while the connection is built again, or in the scan behind its loss",
            "TSEND, TSEND_C: the partner takes no byte, so that a job cannot even begin",
            "a call of the network stack failed: the ledger names it",
            "TDISCON: the connection is still being built; or the partner's own reset came just before",
        ),
        (
            "wait and try again: the code speaks of something that passes",
            "`ss -tn`: a standing Send-Q means that the partner does not read",
            "EN_R to 0 in the scan of 80C5 keeps it away",
        ),
        Reach.REAL,
        "siemens.md 1.9, 2.1 to 2.7",
        also=(
            Condition.STILL_ASKED,
            Condition.SEND_BUFFER_FULL,
            Condition.SEND_FAILED,
            Condition.RECEIVE_FAILED,
            Condition.POLL_DEL_FAILED,
            Condition.DISCONNECT_FAILED,
            Condition.RESET_FAILED,
        ),
        unsure="80C4 for one scan behind 80C5 is a recommended reading",
    ),
    StatusRow(
        0x80C4,
        None,
        ("T_DIAG",),
        True,
        "Not possible at this moment",
        (
            "an internal error of the CPU that passes",
            "the interface takes over new settings",
        ),
        (
            "a new edge at REQ some scans later",
            "the diagnostic buffer of the CPU",
        ),
        Reach.NEVER,
        "siemens.md 2.6",
        unreached="to read how a connection stands takes no call that can fail",
    ),
    StatusRow(
        0x80C4,
        Condition.SEND_BUFFER_FULL,
        ("TUSEND",),
        True,
        "Not possible at this moment",
        (
            "the stack has no room for the datagram",
            "jobs follow each other faster than the line takes them",
        ),
        (
            "`ss -uan`: Send-Q of the local port",
            "the time between two jobs",
        ),
        Reach.INJECTED,
        "siemens.md 2.7",
    ),
    StatusRow(
        0x80C5,
        Condition.PARTNER_CLOSED,
        _LINKED,
        True,
        "The partner refused or closed",
        (
            "active: the machine is there, but nobody listens on RemotePort (ECONNREFUSED)",
            "the partner closed or reset the connection in the middle of a job",
            "ISO-on-TCP: the partner has no such TSAP, or answered with a disconnect",
        ),
        (
            "`nc -vz RemoteAddress RemotePort`: refused means that nobody listens",
            "the partner's log at that time; `tcpdump -ni any tcp port PORT`: who sends FIN or RST?",
            "with CONT = 1 the connection is built again; a send job is lost and needs a new edge",
            "EN_R to 0 until 7002 shows: else 80C4 follows",
        ),
        Reach.REAL,
        "siemens.md 1.9, 2.1 to 2.5",
        also=(Condition.REFUSED,),
    ),
    StatusRow(
        0x80C5,
        None,
        UDP,
        True,
        "The partner closed",
        ("a connection has been ended by its partner", "never with datagrams between two IP addresses"),
        (
            "whether the partner is there at all: only an answer of its own can tell",
            "`tcpdump -ni any udp port PORT`: does anything come back?",
        ),
        Reach.NEVER,
        "siemens.md 2.7",
        unreached="datagrams have no connection that a partner could close",
    ),
    StatusRow(
        0x80C6,
        Condition.UNREACHABLE,
        _LINKED,
        True,
        "The partner cannot be reached",
        (
            "no route, no answer to ARP, or no answer at all within the time of an attempt",
            "a firewall swallows the call",
            "a connection that stood is dead: cable, switch, or the partner lost its power",
        ),
        (
            "`ip route get RemoteAddress`, `ip neigh`, `ping`: up to where does it go?",
            "the errno in the ledger: EHOSTUNREACH and ETIMEDOUT tell different stories",
            "`tcpdump -ni any tcp port PORT`: a SYN without an answer, or one with an ICMP message",
        ),
        Reach.REAL,
        "siemens.md 1.9, 2.1 to 2.5",
        also=(Condition.LINK_DEAD,),
    ),
    StatusRow(
        0x80C6,
        Condition.SEND_FAILED,
        ("TUSEND",),
        True,
        "The network did not take the datagram",
        (
            "no route to the address in ADDR (ENETUNREACH, EHOSTUNREACH)",
            "an earlier datagram was answered with port unreachable",
        ),
        (
            "`ip route get ADDRESS` with the address in ADDR",
            "the errno in the ledger",
        ),
        Reach.INJECTED,
        "siemens.md 2.7",
        also=(Condition.UNREACHABLE,),
    ),
    StatusRow(
        0x80C7,
        None,
        (*TCON, "TSEND", "TRCV", *UDP),
        True,
        "Time limit of the job",
        (
            "the CPU has not ended the job in its own time",
            "an overloaded interface",
        ),
        (
            "the load of the interface and of the cycle",
            "a new edge at REQ",
        ),
        Reach.NEVER,
        "siemens.md 2.3 to 2.5, 2.7",
        unreached="no manual says after which time; an attempt without an answer ends with 80C6",
    ),
    StatusRow(
        0x80C8,
        Condition.ID_OTHER,
        SET_UP,
        True,
        "ID in use with other settings",
        (
            "another connection of the program has this ID",
            "a CONNECT was copied and pointed at another partner, and its ID was not changed",
        ),
        (
            "the IDs of all descriptions: one each; the ledger names the CONNECT that has it",
            "TDISCON, or CONT = 0 at the other block, before the ID is used anew",
        ),
        Reach.LOGIC,
        "siemens.md 2.3, 4.4",
        unsure="that TSEND_C and TRCV_C pass it on from TCON is inferred",
    ),
    StatusRow(
        0x80C9,
        Condition.MESSAGE_TOO_LONG,
        (*RCV_C, "TRCV", "TURCV"),
        True,
        "The message is longer than DATA or LEN",
        (
            "ISO-on-TCP: the partner's message has more bytes than this job has room for",
            "UDP: the datagram has; TCP never shows it, there the rest stays for the next job",
        ),
        (
            "the cause: bytes that came against bytes wanted; make DATA larger or LEN 0",
            "the message is gone as a whole, DATA is unchanged, and the next one is clean",
        ),
        Reach.REAL,
        "siemens.md 2.5, 2.7, 4.2, A11",
    ),
    StatusRow(
        0x80C9,
        None,
        TCON,
        True,
        "The caller is not the partner of CONNECT",
        (
            "another machine calls on this port",
            "RemoteAddress or RemotePort of the description names somebody else",
        ),
        (
            "`ss -tn` and `tcpdump -ni any tcp port PORT`: who calls?",
            "RemoteAddress 0.0.0.0 and RemotePort 0 take any partner",
        ),
        Reach.NEVER,
        "siemens.md 2.3",
        unreached="a wrong caller is reset with a line in the ledger, and the block goes on waiting (7002)",
    ),
)
