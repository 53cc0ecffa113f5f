"""Baosky STATUS words with ERROR=1, 8080 to 80A3: what fails while a connection is built, closed or reset."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reach, StatusRow
from trcvtui.dialects.baosky.states import BOTH

CONNECTION_ERRORS: Final = (
    StatusRow(
        0x8080,
        Condition.NO_SOCKET,
        BOTH,
        True,
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
        Reach.REAL,
        "7.15.1, 7.15.2, 7.15.4, 7.15.7",
    ),
    StatusRow(
        0x8081,
        Condition.WRONG_LOCAL_ADDRESS,
        BOTH,
        True,
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
        Reach.REAL,
        "7.15.1, 7.15.2, 7.15.4, 7.15.7",
    ),
    StatusRow(
        0x8082,
        Condition.REUSE_FAILED,
        BOTH,
        True,
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
        Reach.INJECTED,
        "7.15.1, 7.15.2, 7.15.7",
    ),
    StatusRow(
        0x8083,
        Condition.BIND_FAILED,
        BOTH,
        True,
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
        Reach.REAL,
        "7.15.1, 7.15.2, 7.15.7",
    ),
    StatusRow(
        0x8084,
        Condition.POLL_ADD_FAILED,
        BOTH,
        True,
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
        Reach.INJECTED,
        "7.15.1, 7.15.2",
    ),
    StatusRow(
        0x8086,
        Condition.ACCEPT_FAILED,
        BOTH,
        True,
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
        Reach.REAL,
        "7.15.1, 7.15.2",
    ),
    StatusRow(
        0x8087,
        Condition.POLL_DEL_FAILED,
        BOTH,
        True,
        "Socket could not be taken off the watch",
        (
            "the descriptor was closed before it was unregistered (EBADF)",
            "it was unregistered already, or its number went to another socket (ENOENT)",
        ),
        (
            "the ledger: call `poll_del`; the loss or close behind it stands in the same scan",
            "nothing to mend for the connection: it is gone, and 7002 or 7000 follows",
        ),
        Reach.INJECTED,
        "7.15.1, 7.15.2, 7.15.6",
    ),
    StatusRow(
        0x80A0,
        Condition.CONNECT_FAILED,
        BOTH,
        True,
        "The partner could not be reached (active side)",
        (
            "ECONNREFUSED: the machine is there, but nobody listens on RemotePort",
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
        Reach.REAL,
        "7.15.1, 7.15.2, 7.15.5",
    ),
    StatusRow(
        0x80A1,
        Condition.NOT_CONNECTED,
        BOTH,
        True,
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
        Reach.LOGIC,
        "7.15.1, 7.15.2, 7.15.8, 7.15.9",
    ),
    StatusRow(
        0x80A2,
        Condition.DISCONNECT_FAILED,
        BOTH,
        True,
        "Closing failed",
        (
            "the partner had reset the connection just before CONT fell (ENOTCONN)",
            "the descriptor was already gone (EBADF)",
        ),
        (
            "nothing to mend here: 7000 follows and everything is released",
            "why the partner resets: its log, and whether it left bytes unread when it closed",
        ),
        Reach.REAL,
        "7.15.1, 7.15.2, 7.15.6",
    ),
    StatusRow(
        0x80A3,
        Condition.RESET_FAILED,
        BOTH,
        True,
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
        Reach.REAL,
        "7.15.1, 7.15.2, 7.15.7",
    ),
)
