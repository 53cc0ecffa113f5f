"""Siemens STATUS words 80A0 to 80B1: ports, partners, and who let a connection go (siemens.md 2)."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reach, StatusRow
from trcvtui.dialects.siemens.blocks import BOTH_C, SEND, SEND_C, SET_UP, TCON, UDP

CONNECTION_ERRORS: Final = (
    StatusRow(
        0x80A1,
        Condition.PORT_IN_USE,
        SET_UP,
        True,
        "The connection or the local port is taken",
        (
            "another program or another CONNECT already listens on this port",
            "active with a fixed LocalPort: the old connection is still in TIME_WAIT",
        ),
        (
            "`ss -ltnp 'sport = :PORT'` names the holder; it heals when the holder goes",
            "two CONNECTs with the same LocalPort in the project",
            "LocalPort 0 on the active side takes a free one",
            "on a Baosky block the same number means that nothing is connected: not here",
        ),
        Reach.REAL,
        "siemens.md 2.1, 2.3",
    ),
    StatusRow(
        0x80A1,
        Condition.NOT_CONNECTED,
        ("TSEND", "TRCV", *UDP),
        True,
        "There is no connection to work on",
        (
            "TCON (or the _C block) has not built it yet, or TDISCON has closed it",
            "it is being closed, or the interface starts anew",
        ),
        (
            "the DONE of TCON: start jobs behind it; T_DIAG shows State 4 while it stands",
            "the same CONNECT at both blocks",
            "TSEND: this edge is used up, the next job needs a new one",
        ),
        Reach.LOGIC,
        "siemens.md 2.4, 2.5, 2.7",
    ),
    StatusRow(
        0x80A2,
        Condition.PORT_RESERVED,
        SET_UP,
        True,
        "The local port is the system's own",
        (
            "one of 20, 21, 80, 102, 135, 161, 162, 443, 34962 to 34964, or from 49152 on",
            "on this bench also a port below 1024 without the right to use it (EACCES)",
        ),
        (
            "LocalPort: take one from 2000 to 5000, which is what the field uses",
            "`sysctl net.ipv4.ip_unprivileged_port_start` where the errno is EACCES",
        ),
        Reach.LOGIC,
        "siemens.md 2.3, 3.7",
    ),
    StatusRow(
        0x80A3,
        Condition.FOUND_CLOSED,
        BOTH_C,
        True,
        "The connection was found closed",
        (
            "the partner closed or reset it while no job ran here",
            "the link is dead, which the keep-alive has found",
            "another CONNECT of the same ID and the same description is up: passed on from TCON",
        ),
        (
            "nothing to mend: 7001 and 7002 follow, and the block builds it again",
            "the partner's log: does it close when nothing comes for some time?",
            "`trcvtui scenario configs/scenarios/siemens/1-9-tsend_c-idle.toml` shows the course",
            "it comes with each attempt: which other CONNECT has this ID?",
        ),
        Reach.REAL,
        "siemens.md 1.9, 2.1, 2.3, 4.4",
        also=(Condition.ENDPOINT_THERE,),
        unsure="that the idle block shows it in one scan and goes on by itself is a recommended reading",
    ),
    StatusRow(
        0x80A3,
        Condition.ENDPOINT_THERE,
        TCON,
        True,
        "This connection is there already",
        (
            "TCON has built it before: it stands, or its endpoint waits for the partner to come again",
            "a _C block holds the same CONNECT",
            "another CONNECT has the same ID and the same description, and holds the connection",
        ),
        (
            "REQ of TCON: once at start-up is enough, the endpoint builds a lost connection again itself",
            "TDISCON first, where the connection is meant to be another one",
        ),
        Reach.LOGIC,
        "siemens.md 2.3, 4.4",
        also=(Condition.ID_BUILDING,),
    ),
    StatusRow(
        0x80A3,
        Condition.ENDPOINT_GONE,
        ("TDISCON", "T_DIAG"),
        True,
        "There is no such connection",
        (
            "nobody has built it yet: no TCON, no _C block that CONT, REQ or EN_R asks",
            "it is closed already; T_DIAG behind TDISCON ends here, too",
        ),
        (
            "the order of calls: TCON, then jobs, then TDISCON once",
            "the line CONNECT of the block: closed means that nothing holds it",
        ),
        Reach.LOGIC,
        "siemens.md 2.6",
    ),
    StatusRow(
        0x80A4,
        Condition.REMOTE_WRONG,
        (*SET_UP, "TUSEND"),
        True,
        "The partner's address cannot be used",
        (
            "RemoteAddress is the CPU's own address, a broadcast or a multicast address",
            "TUSEND: the address in ADDR is 0.0.0.0, or nobody has written one yet",
        ),
        (
            "RemoteAddress of CONNECT (TUSEND: of ADDR), byte by byte: ADDR[1] is the first number",
            "`ip -br address`: which addresses are this machine's own?",
        ),
        Reach.LOGIC,
        "siemens.md 2.1, 2.3, 2.7",
    ),
    StatusRow(
        0x80A7,
        Condition.RESET_IN_JOB,
        SEND_C,
        True,
        "COM_RST came while a send job ran",
        (
            "the program resets the connection without a look at BUSY",
            "the job took long because the partner does not read, and a watchdog raised COM_RST",
        ),
        (
            "the data of this job is lost, in part or whole: send it again behind the next 7004",
            "what raises COM_RST, and whether BUSY was 1 there",
        ),
        Reach.REAL,
        "siemens.md 1.9, 2.1",
    ),
    StatusRow(
        0x80A7,
        Condition.RESET_IN_JOB,
        TCON,
        True,
        "TDISCON came before TCON had ended",
        (
            "the program closes the connection while TCON still waits for the partner",
            "a time-out of the program's own, shorter than the wait for the partner",
        ),
        (
            "REQ of TDISCON: only behind DONE or ERROR of TCON",
            "a new edge at TCON begins again",
        ),
        Reach.LOGIC,
        "siemens.md 2.3",
    ),
    StatusRow(
        0x80AA,
        Condition.LET_GO,
        BOTH_C,
        True,
        "The other block let the connection go",
        (
            "two _C blocks share a connection, and CONT of the other one ended it",
            "TDISCON or T_RESET worked on this block's connection",
            "another CONNECT of the same ID and the same description is just being built",
        ),
        (
            "TSEND_C with TRCV, or TSEND with TRCV_C: one block alone holds the connection",
            "CONT of both blocks: drop and raise them together",
            "7001 follows: with CONT = 1 this block builds the connection again",
        ),
        Reach.LOGIC,
        "siemens.md 1.8, 2.1, 2.2, 4.4, A8",
        also=(Condition.ID_BUILDING,),
        unsure="what a _C block shows whose connection TDISCON or T_RESET has closed is named nowhere",
    ),
    StatusRow(
        0x80B1,
        Condition.AREA_CHANGED,
        (*SEND, "TUSEND", "T_DIAG"),
        True,
        "DATA was changed before the job ended",
        (
            "DATA got another type or size while the job ran (T_DIAG: RESULT)",
            "a download changed the data block under a running job",
        ),
        (
            "BUSY has to be 0 before DATA or its type may change",
            "what was sent of the job is on its way: the partner may be shifted, COM_RST clears that",
        ),
        Reach.LOGIC,
        "siemens.md 2.4, 2.6, 2.7",
        unsure="values written into DATA are not noticed: it was copied in the scan of the edge",
    ),
    StatusRow(
        0x80B1,
        None,
        ("TRCV", "TURCV"),
        True,
        "DATA was changed before the job ended",
        (
            "DATA got another type or size while the job ran",
            "a download changed the data block under a running job",
        ),
        (
            "`trcvtui status 8085 --block TRCV`: the code that this bench shows for it",
            "BUSY has to be 0 before DATA or its type may change",
        ),
        Reach.NEVER,
        "siemens.md 2.5, 2.7",
        unreached="the manual gives 8085 for the same case, and that is shown",
    ),
)

LEGACY_ERRORS: Final = (
    StatusRow(
        0x80A0,
        None,
        SET_UP,
        True,
        "Group of 80A1 and 80A2",
        ("the port is taken, by the user or by the system", "instructions before 3.0 do not tell which"),
        ("`ss -ltnp 'sport = :PORT'` names the holder", "LocalPort: take one from 2000 to 5000"),
        Reach.NEVER,
        "siemens.md 2.1, 2.3",
        unreached="the bench always knows which of the two it is",
    ),
    StatusRow(
        0x80A5,
        Condition.ID_OTHER,
        SET_UP,
        True,
        "ID in use",
        (
            "another connection of the program has this ID, and other settings",
            "a CONNECT was copied, and its ID was not changed",
        ),
        (
            "the IDs of all descriptions: one each; the ledger names the CONNECT that has it",
            "TDISCON, or CONT = 0, before the ID is used anew",
        ),
        Reach.LOGIC,
        "siemens.md 2.3",
        unsure="that TSEND_C and TRCV_C pass it on from TCON is inferred",
    ),
    StatusRow(
        0x80B2,
        None,
        SET_UP,
        True,
        "CONNECT is in load memory only",
        ("the data block of CONNECT has the attribute `only store in load memory`", "it was never loaded"),
        ("attributes of that data block", "a CONNECT in the instance of the block itself"),
        Reach.NEVER,
        "siemens.md 2.1, 2.3",
        unreached="the bench has no load memory",
    ),
)
