"""Siemens STATUS words 80A0 to 80C9: partners, resources, refused or closed, too long."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reproducibility, StatusRow, unreached_row
from trcvtui.dialects.siemens.states import C_BLOCKS, CLOSE, RCV_C, SEND, SEND_C, SET_UP, TCON, UDP

CONNECTION_ERRORS: Final = (
    StatusRow(
        0x80A1,
        Condition.PORT_IN_USE,
        SET_UP,
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
        Reproducibility.REAL,
        "STEP 7 help: TSEND_C, TCON",
    ),
    StatusRow(
        0x80A1,
        Condition.NOT_CONNECTED,
        ("TSEND", "TRCV", *UDP),
        "There is no connection to work on",
        (
            "TCON (or the _C block) has not built it yet, or TDISCON has closed it",
            "it is being closed, or the interface starts anew",
        ),
        (
            "the DONE of TCON: start jobs after it; T_DIAG shows State 4 while it stands",
            "the same CONNECT at both blocks",
            "TSEND: this edge is used up, the next job needs a new one",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND, TRCV, TUSEND, TURCV",
    ),
    StatusRow(
        0x80A2,
        Condition.PORT_RESERVED,
        SET_UP,
        "The local port is the system's own",
        (
            "one of 20, 21, 80, 102, 135, 161, 162, 443, 34962 to 34964, or from 49152 on",
            "on this bench also a port below 1024 without the right to use it (EACCES)",
        ),
        (
            "LocalPort: take one from 2000 to 5000, which is what the field uses",
            "`sysctl net.ipv4.ip_unprivileged_port_start` where the errno is EACCES",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TCON",
    ),
    StatusRow(
        0x80A3,
        Condition.FOUND_CLOSED,
        C_BLOCKS,
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
        Reproducibility.REAL,
        "STEP 7 help: TSEND_C, TRCV_C, TCON",
        also=(Condition.ENDPOINT_THERE,),
        unsure="that the idle block shows it in one scan and goes on by itself is a recommended reading",
    ),
    StatusRow(
        0x80A3,
        Condition.ENDPOINT_THERE,
        TCON,
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
        Reproducibility.LOGIC,
        "STEP 7 help: TCON",
        also=(Condition.ID_BUILDING,),
    ),
    StatusRow(
        0x80A3,
        Condition.ENDPOINT_GONE,
        ("TDISCON", "T_DIAG"),
        "There is no such connection",
        (
            "it is not built yet: no TCON, no _C block that CONT, REQ or EN_R asks",
            "it is closed already; T_DIAG after TDISCON ends here, too",
        ),
        (
            "the order of calls: TCON, then jobs, then TDISCON once",
            "the line CONNECT of the block: closed means that nothing holds it",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TDISCON, T_DIAG",
    ),
    StatusRow(
        0x80A4,
        Condition.REMOTE_WRONG,
        (*SET_UP, "TUSEND"),
        "The partner's address cannot be used",
        (
            "RemoteAddress is the CPU's own address, a broadcast or a multicast address",
            "TUSEND: the address in ADDR is 0.0.0.0, or none is written yet",
        ),
        (
            "RemoteAddress of CONNECT (TUSEND: of ADDR), byte by byte: ADDR[1] is the first number",
            "`ip -br address`: which addresses are this machine's own?",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TCON, TUSEND",
    ),
    StatusRow(
        0x80A7,
        Condition.RESET_IN_JOB,
        SEND_C,
        "COM_RST came while a send job ran",
        (
            "the program resets the connection without a look at BUSY",
            "the job took long because the partner does not read, and a watchdog raised COM_RST",
        ),
        (
            "the data of this job is lost, in part or whole: send it again after the next 7004",
            "what raises COM_RST, and whether BUSY was 1 there",
        ),
        Reproducibility.REAL,
        "STEP 7 help: TSEND_C",
    ),
    StatusRow(
        0x80A7,
        Condition.RESET_IN_JOB,
        TCON,
        "TDISCON came before TCON had ended",
        (
            "the program closes the connection while TCON still waits for the partner",
            "a time-out of the program's own, shorter than the wait for the partner",
        ),
        (
            "REQ of TDISCON: only after DONE or ERROR of TCON",
            "a new edge at TCON begins again",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TCON",
    ),
    StatusRow(
        0x80AA,
        Condition.LET_GO,
        C_BLOCKS,
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
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TRCV_C; Siemens FAQ 109479564",
        also=(Condition.ID_BUILDING,),
        unsure="what a _C block shows whose connection TDISCON or T_RESET has closed is named nowhere",
    ),
    StatusRow(
        0x80B1,
        Condition.AREA_CHANGED,
        (*SEND, "TUSEND", "T_DIAG"),
        "DATA was changed before the job ended",
        (
            "DATA got another type or size while the job ran (T_DIAG: RESULT)",
            "a download changed the data block under a running job",
        ),
        (
            "BUSY has to be 0 before DATA or its type may change",
            "what was sent of the job is on its way: the partner may be shifted, COM_RST clears that",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND, T_DIAG, TUSEND",
        unsure="values written into DATA are not noticed: it was copied in the scan of the edge",
    ),
    unreached_row(
        0x80B1,
        ("TRCV", "TURCV"),
        "DATA was changed before the job ended",
        (
            "DATA got another type or size while the job ran",
            "a download changed the data block under a running job",
        ),
        (
            "`trcvtui status 8085 --block TRCV`: the code that this bench shows for it",
            "BUSY has to be 0 before DATA or its type may change",
        ),
        "STEP 7 help: TRCV, TURCV",
        unreached="the manual gives 8085 for the same case, and that is shown",
    ),
)

LEGACY_ERRORS: Final = (
    unreached_row(
        0x80A0,
        SET_UP,
        "Group of 80A1 and 80A2",
        ("the port is taken, by the user or by the system", "instructions before 3.0 do not tell which"),
        ("`ss -ltnp 'sport = :PORT'` names the holder", "LocalPort: take one from 2000 to 5000"),
        "STEP 7 help: TSEND_C, TCON",
        unreached="the bench always knows which of the two it is",
    ),
    StatusRow(
        0x80A5,
        Condition.ID_OTHER,
        SET_UP,
        "ID in use",
        (
            "another connection of the program has this ID, and other settings",
            "a CONNECT was copied, and its ID was not changed",
        ),
        (
            "the IDs of all descriptions: one each; the ledger names the CONNECT that has it",
            "TDISCON, or CONT = 0, before the ID is used anew",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TCON",
        unsure="that TSEND_C and TRCV_C pass it on from TCON is inferred",
    ),
    unreached_row(
        0x80B2,
        SET_UP,
        "CONNECT is in load memory only",
        ("the data block of CONNECT has the attribute `only store in load memory`", "it was never loaded"),
        ("attributes of that data block", "a CONNECT in the instance of the block itself"),
        "STEP 7 help: TSEND_C, TCON",
        unreached="the bench has no load memory",
    ),
)

_LINKED_BLOCKS: Final = (*SET_UP, "TSEND", "TRCV")  # these meet a partner over a connection

JOB_ERRORS: Final = (
    StatusRow(
        0x80C3,
        Condition.NO_SOCKET,
        (*C_BLOCKS, *TCON, *CLOSE, "TSEND", "TRCV", *UDP),
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
        Reproducibility.LOGIC,
        "STEP 7 help, Open User Communication",
        also=(Condition.NO_BUFFER, Condition.QUEUE_FULL, Condition.CONNECT_IN_USE),
        unsure="for TDISCON and T_RESET no list names it: here a full job queue shows it",
    ),
    StatusRow(
        0x80C4,
        Condition.NOT_NOW,
        (*SET_UP, *CLOSE, "TSEND", "TRCV", "TURCV"),
        "Not possible at this moment",
        (
            "TRCV, TRCV_C: EN_R is 1 while the connection is built again, or in the scan after its loss",
            "TSEND, TSEND_C: the partner takes no byte, so that a job cannot even begin",
            "a call of the network stack failed: the ledger names it",
            "TDISCON: the connection is still being built; or the partner's own reset came just before",
        ),
        (
            "wait and try again: the code speaks of something that passes",
            "`ss -tn`: a standing Send-Q means that the partner does not read",
            "EN_R to 0 in the scan of 80C5 keeps it away",
        ),
        Reproducibility.REAL,
        "STEP 7 help, Open User Communication",
        also=(
            Condition.STILL_ASKED,
            Condition.SEND_BUFFER_FULL,
            Condition.SEND_FAILED,
            Condition.RECEIVE_FAILED,
            Condition.POLL_DEL_FAILED,
            Condition.DISCONNECT_FAILED,
            Condition.RESET_FAILED,
        ),
        unsure="80C4 for one scan after 80C5 is a recommended reading",
    ),
    unreached_row(
        0x80C4,
        ("T_DIAG",),
        "Not possible at this moment",
        (
            "an internal error of the CPU that passes",
            "the interface takes over new settings",
        ),
        (
            "a new edge at REQ some scans later",
            "the diagnostic buffer of the CPU",
        ),
        "STEP 7 help: T_DIAG",
        unreached="to read how a connection stands takes no call that can fail",
    ),
    StatusRow(
        0x80C4,
        Condition.SEND_BUFFER_FULL,
        ("TUSEND",),
        "Not possible at this moment",
        (
            "the stack has no room for the datagram",
            "jobs follow each other faster than the line takes them",
        ),
        (
            "`ss -uan`: Send-Q of the local port",
            "the time between two jobs",
        ),
        Reproducibility.INJECTED,
        "STEP 7 help: TUSEND",
    ),
    StatusRow(
        0x80C5,
        Condition.PARTNER_CLOSED,
        _LINKED_BLOCKS,
        "The partner refused or closed",
        (
            "active: the machine is there, but no program listens on RemotePort (ECONNREFUSED)",
            "the partner closed or reset the connection in the middle of a job",
            "ISO-on-TCP: the partner has no such TSAP, or answered with a disconnect",
        ),
        (
            "`nc -vz RemoteAddress RemotePort`: refused means that no program listens",
            "the partner's log at that time; `tcpdump -ni any tcp port PORT`: who sends FIN or RST?",
            "with CONT = 1 the connection is built again; a send job is lost and needs a new edge",
            "EN_R to 0 until 7002 shows: else 80C4 follows",
        ),
        Reproducibility.REAL,
        "STEP 7 help, Open User Communication",
        also=(Condition.REFUSED,),
    ),
    unreached_row(
        0x80C5,
        UDP,
        "The partner closed",
        ("a connection has been ended by its partner", "never with datagrams between two IP addresses"),
        (
            "whether the partner is there at all: only an answer of its own can tell",
            "`tcpdump -ni any udp port PORT`: does anything come back?",
        ),
        "STEP 7 help: TUSEND, TURCV",
        unreached="datagrams have no connection that a partner could close",
    ),
    StatusRow(
        0x80C6,
        Condition.UNREACHABLE,
        _LINKED_BLOCKS,
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
        Reproducibility.REAL,
        "STEP 7 help, Open User Communication",
        also=(Condition.LINK_DEAD,),
        unsure="after how long keep-alive finds a connection dead is from memory: switch keep_alive",
    ),
    StatusRow(
        0x80C6,
        Condition.SEND_FAILED,
        ("TUSEND",),
        "The network did not take the datagram",
        (
            "no route to the address in ADDR (ENETUNREACH, EHOSTUNREACH)",
            "an earlier datagram was answered with port unreachable",
        ),
        (
            "`ip route get ADDRESS` with the address in ADDR",
            "the errno in the ledger",
        ),
        Reproducibility.INJECTED,
        "STEP 7 help: TUSEND",
        also=(Condition.UNREACHABLE,),
    ),
    unreached_row(
        0x80C7,
        (*TCON, "TSEND", "TRCV", *UDP),
        "Time limit of the job",
        (
            "the CPU has not ended the job in its own time",
            "an overloaded interface",
        ),
        (
            "the load of the interface and of the cycle",
            "a new edge at REQ",
        ),
        "STEP 7 help, Open User Communication",
        unreached="no manual says after which time; an attempt without an answer ends with 80C6",
    ),
    StatusRow(
        0x80C8,
        Condition.ID_OTHER,
        SET_UP,
        "ID in use with other settings",
        (
            "another connection of the program has this ID",
            "a CONNECT was copied and pointed at another partner, and its ID was not changed",
        ),
        (
            "the IDs of all descriptions: one each; the ledger names the CONNECT that has it",
            "TDISCON, or CONT = 0 at the other block, before the ID is used anew",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TCON",
        unsure="that TSEND_C and TRCV_C pass it on from TCON is inferred",
    ),
    StatusRow(
        0x80C9,
        Condition.MESSAGE_TOO_LONG,
        (*RCV_C, "TRCV", "TURCV"),
        "The message is longer than DATA or LEN",
        (
            "ISO-on-TCP: the partner's message has more bytes than this job has room for",
            "UDP: the datagram has; TCP never shows it, there the rest stays for the next job",
        ),
        (
            "the cause: bytes that came against bytes wanted; make DATA larger or LEN 0",
            "the message is gone as a whole, DATA is unchanged, and the next one is clean",
        ),
        Reproducibility.REAL,
        "STEP 7 help: TRCV, TURCV",
    ),
    unreached_row(
        0x80C9,
        TCON,
        "The caller is not the partner of CONNECT",
        (
            "another machine calls on this port",
            "RemoteAddress or RemotePort of the description names somebody else",
        ),
        (
            "`ss -tn` and `tcpdump -ni any tcp port PORT`: who calls?",
            "RemoteAddress 0.0.0.0 and RemotePort 0 take any partner",
        ),
        "STEP 7 help: TCON",
        unreached="a wrong caller is reset with a line in the ledger, and the block goes on waiting (7002)",
    ),
)
