"""The STATUS table of the Baosky TCP blocks (manual 7.15.1 to 7.15.9): words with ERROR=1, from 8080."""

from __future__ import annotations

from typing import Final

from msgspec.structs import replace

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reproducibility, StatusRow
from trcvtui.dialects.baosky.states import BOTH_BLOCKS, RECEIVE, SEND, STATES

CONNECTION_ERRORS: Final = (
    StatusRow(
        0x8080,
        Condition.NO_SOCKET,
        BOTH_BLOCKS,
        "No socket left",
        (
            "all connections of the PLC model are in use (T3: 8, T4: 32)",
            "the process has no free file descriptor (EMFILE)",
            "the operating system is out of memory for sockets (ENOBUFS, ENOMEM)",
        ),
        (
            "count the CONNECTs with CONT=1 against the model; set CONT=0 where none is needed",
            "the errno in the ledger; `ulimit -n` and `ls /proc/<pid>/fd | wc -l`",
            "a new attempt follows by itself after the retry time; CONT need not move",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.4, 7.15.7",
    ),
    StatusRow(
        0x8081,
        Condition.WRONG_LOCAL_ADDRESS,
        BOTH_BLOCKS,
        "LocalAddress is not usable",
        (
            "no network port of this PLC has that address",
            "LocalAddress is 0.0.0.0, a broadcast or a multicast address",
            "the address belongs to an interface that is no Ethernet port",
        ),
        (
            "`ip -br address`: LocalAddress has to be in that list",
            "CONNECT.LocalAddress: element [0] is the first number of the dotted address",
            "loopback is accepted unless the switch strict_local_address is on",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.4, 7.15.7",
    ),
    StatusRow(
        0x8082,
        Condition.REUSE_FAILED,
        BOTH_BLOCKS,
        "Address reuse was refused",
        (
            "the descriptor was closed or replaced under the socket",
            "a system call filter (container, sandbox) forbids setsockopt",
            "a fault was injected: a healthy socket never gives this",
        ),
        (
            "the ledger: call `set_reuse`, its errno, injected or not; `fault clear` removes faults",
            "the container or service profile that the process runs under",
        ),
        Reproducibility.INJECTED,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.7",
    ),
    StatusRow(
        0x8083,
        Condition.BIND_FAILED,
        BOTH_BLOCKS,
        "LocalPort could not be taken",
        (
            "another program or another CONNECT already listens on this address and port",
            "active with a fixed LocalPort: the old connection to this partner stands or is in TIME_WAIT",
            "a port below 1024 without the right to use it (EACCES)",
        ),
        (
            "`ss -ltnp 'sport = :<LocalPort>'` names the holder; it heals when the holder goes",
            "`ss -tan 'sport = :<LocalPort>'` shows TIME-WAIT; LocalPort 0 on an active CONNECT avoids it",
            "two CONNECTs with the same LocalPort in the project",
            "`sysctl net.ipv4.ip_unprivileged_port_start` when the errno is EACCES",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.7",
    ),
    StatusRow(
        0x8084,
        Condition.POLL_ADD_FAILED,
        BOTH_BLOCKS,
        "Socket could not be watched",
        (
            "the user's limit of epoll watches is reached (ENOSPC)",
            "the system is out of memory (ENOMEM)",
            "the descriptor is no longer a socket (EPERM, EBADF)",
        ),
        (
            "the ledger: call `poll_add`, its errno, and whether it says injected",
            "`sysctl fs.epoll.max_user_watches` and `ulimit -n`",
        ),
        Reproducibility.INJECTED,
        "Baosky library manual 7.15.1, 7.15.2",
    ),
    StatusRow(
        0x8086,
        Condition.ACCEPT_FAILED,
        BOTH_BLOCKS,
        "A client could not be accepted",
        (
            "no free file descriptor: the client waits in the queue and believes that it is connected",
            "the listener was shut down under the block (EINVAL)",
            "the client gave up while it was in the queue (ECONNABORTED)",
        ),
        (
            "the errno in the ledger; `ulimit -n` and `ls /proc/<pid>/fd | wc -l`",
            "`ss -ltn`: Recv-Q of the listener is the number of clients that wait",
            "free a descriptor: the same client is then taken, with the bytes it has sent meanwhile",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2",
    ),
    StatusRow(
        0x8087,
        Condition.POLL_DEL_FAILED,
        BOTH_BLOCKS,
        "Socket could not be taken off the watch",
        (
            "the descriptor was closed before it was unregistered (EBADF)",
            "it was unregistered already, or its number went to another socket (ENOENT)",
        ),
        (
            "the ledger: call `poll_del`; the loss or close after it stands in the same scan",
            "nothing to mend for the connection: it is gone, and 7002 or 7000 follows",
        ),
        Reproducibility.INJECTED,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.6",
    ),
    StatusRow(
        0x80A0,
        Condition.CONNECT_FAILED,
        BOTH_BLOCKS,
        "The partner could not be reached (active side)",
        (
            "ECONNREFUSED: the machine is there, but no program listens on RemotePort",
            "EHOSTUNREACH, ENETUNREACH: cable, address, mask or route",
            "ETIMEDOUT: a firewall swallows the call, or the machine is off",
            "ECONNRESET: the partner took the call and threw us out, its slot may still be in use",
        ),
        (
            "the errno in the ledger, then `nc -vz <RemoteAddress> <RemotePort>`",
            "`ip route get <RemoteAddress>` and `ip neigh`: FAILED there is a cable or a wrong address",
            "the partner: does its passive side run first, on this port, for this address?",
            "the partner still holds the old connection after a power cut: reset it there",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.5",
    ),
    StatusRow(
        0x80A1,
        Condition.NOT_CONNECTED,
        BOTH_BLOCKS,
        "Asked for data without a connection",
        (
            "EN_R was 1 or REQ rose before the connection was up; harmless for one scan at the start",
            "the connection was lost and the program asks again before it is back",
            "the partner never came: the reasons are those of 7002",
        ),
        (
            "start EN_R or REQ only after STATUS has been 7004",
            "TSEND_C: the edge is used up, so the next send needs a new one",
            "still no connection: `trcvtui status 7002`",
            "on a Siemens TCON the same number speaks of an ID or port in use: not here",
        ),
        Reproducibility.LOGIC,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.8, 7.15.9",
    ),
    StatusRow(
        0x80A2,
        Condition.DISCONNECT_FAILED,
        BOTH_BLOCKS,
        "Closing failed",
        (
            "the partner had reset the connection just before CONT fell (ENOTCONN)",
            "the descriptor was already gone (EBADF)",
        ),
        (
            "nothing to mend here: 7000 follows and everything is released",
            "why the partner resets: its log, and whether it left bytes unread when it closed",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.6",
    ),
    StatusRow(
        0x80A3,
        Condition.RESET_FAILED,
        BOTH_BLOCKS,
        "Reset failed",
        (
            "the partner had reset the connection just before COM_RST rose (ENOTCONN)",
            "the descriptor was already gone (EBADF)",
        ),
        (
            "nothing to mend here: 7002 follows and the connection is rebuilt",
            "the ledger: which call failed, and what the partner did in the scan before",
            "on a Siemens TCON the same number speaks of an existing connection: not here",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.7",
    ),
)


# The same number means something else on other vendors' blocks: rows where that misleads say so.

JOB_ERRORS: Final = (
    StatusRow(
        0x80A4,
        Condition.DATA_EMPTY,
        BOTH_BLOCKS,
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
        Reproducibility.LOGIC,
        "Baosky library manual 7.15.1, 7.15.2",
    ),
    StatusRow(
        0x80A5,
        Condition.LENGTH_WRONG,
        BOTH_BLOCKS,
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
        Reproducibility.LOGIC,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.8, 7.15.9",
    ),
    StatusRow(
        0x80A6,
        Condition.SHORT_FRAME,
        RECEIVE,
        "Frame ended too early (static mode)",
        (
            "the partner closed when only part of LEN had come",
            "the partner's message is shorter than LEN, and it closes after each message",
            "a shift from earlier left a remainder that never becomes a frame",
        ),
        (
            "bytes here against bytes wanted at the moment of the close: the ledger has both",
            "the partner's message length against LEN (or the size of DATA); else ad-hoc mode",
            "the next scan names the close itself; the part that had come is dropped, DATA is unchanged",
        ),
        Reproducibility.REAL,
        "Baosky library manual 7.15.1",
    ),
    StatusRow(
        0x80A7,
        Condition.NO_BUFFER,
        BOTH_BLOCKS,
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
        Reproducibility.LOGIC,
        "Baosky library manual 7.15.1, 7.15.2",
    ),
    StatusRow(
        0x80A8,
        Condition.SEND_BUFFER_FULL,
        SEND,
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
        Reproducibility.REAL,
        "Baosky library manual 7.15.2",
    ),
    StatusRow(
        0x80A9,
        Condition.SEND_FAILED,
        SEND,
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
        Reproducibility.REAL,
        "Baosky library manual 7.15.2",
    ),
    StatusRow(
        0x80AA,
        Condition.RECEIVE_FAILED,
        RECEIVE,
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
        Reproducibility.REAL,
        "Baosky library manual 7.15.1",
    ),
    StatusRow(
        0x80AB,
        Condition.LINK_DEAD,
        BOTH_BLOCKS,
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
        Reproducibility.NAMESPACE,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.4",
    ),
    StatusRow(
        0x80AC,
        Condition.QUEUE_FULL,
        BOTH_BLOCKS,
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
        Reproducibility.LOGIC,
        "Baosky library manual 7.15.1, 7.15.2, 7.15.6",
    ),
    StatusRow(
        0x80C3,
        Condition.CONNECT_IN_USE,
        BOTH_BLOCKS,
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
        Reproducibility.LOGIC,
        "Baosky library manual 7.15.1, 7.15.2",
    ),
    StatusRow(
        0x80C5,
        Condition.PARTNER_CLOSED,
        BOTH_BLOCKS,
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
        Reproducibility.REAL,
        "Baosky library manual 7.15.1, 7.15.2",
    ),
)

# fmt: off
INNER_BLOCKS: Final[dict[str, tuple[int, ...]]] = {
    "TCON": (
        0x0000, 0x0001, 0x7000, 0x7001, 0x7002, 0x7004,
        0x8080, 0x8081, 0x8082, 0x8083, 0x8084, 0x8086, 0x8087, 0x80A0, 0x80AB, 0x80AC,
    ),
    "TDISCON": (0x0000, 0x7003, 0x7007, 0x8087, 0x80A2, 0x80AC),
    "T_RESET": (
        0x0000, 0x7002, 0x7003, 0x7004, 0x7007, 0x8000,
        0x8080, 0x8081, 0x8082, 0x8083, 0x8084, 0x8086, 0x8087, 0x80A0, 0x80A3, 0x80AC,
    ),
    "TSEND": (
        0x0000, 0x7000, 0x7004, 0x7005, 0x7009,
        0x8087, 0x80A1, 0x80A4, 0x80A5, 0x80A7, 0x80A8, 0x80A9, 0x80AB, 0x80C3, 0x80C5,
    ),
    "TRCV": (
        0x0000, 0x7000, 0x7004, 0x7006, 0x7008,
        0x8087, 0x80A1, 0x80A4, 0x80A5, 0x80A6, 0x80A7, 0x80AA, 0x80AB, 0x80C3, 0x80C5,
    ),
}


def _inner(code: int) -> tuple[str, ...]:
    return tuple(block for block, codes in INNER_BLOCKS.items() if code in codes)


# Rows of the _C blocks, with the inner blocks that show the same code after them.
STATUS: Final[tuple[StatusRow, ...]] = tuple(
    replace(row, blocks=(*row.blocks, *_inner(row.code))) for row in STATES + CONNECTION_ERRORS + JOB_ERRORS
)
