"""The STATUS table of USEND_C and URECV_C, states and errors (manual 7.15.14, 7.15.15)."""

from __future__ import annotations

from functools import partial
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reproducibility, StatusRow

# Their own code tables could not be read: each code means what it means to the TCP blocks, where UDP has it.
# The manual's own words: 7001 is the ready state, and DONE lasts one scan.

RECEIVE_BLOCKS: Final = ("URECV_C",)
SEND_BLOCKS: Final = ("USEND_C",)
UDP: Final = RECEIVE_BLOCKS + SEND_BLOCKS
MANUAL: Final = "Baosky library manual 7.15.14, 7.15.15"
_error_row: Final = partial(StatusRow, manual=MANUAL)
_state_row: Final = partial(_error_row, error=False)

UDP_STATES: Final = (
    _state_row(
        0x0000,
        Condition.NOT_CALLED,
        UDP,
        "Not called",
        ("the program has not called this instance yet", "the PLC is in STOP: its UDP sockets are closed"),
        (
            "PLC mode: `plc run`, and watch whether the scan counter moves",
            "the instance's task: is it in the project, and does it come round?",
        ),
        Reproducibility.LOGIC,
    ),
    _state_row(
        0x0001,
        Condition.CREATING,
        UDP,
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
        Reproducibility.LOGIC,
    ),
    _state_row(
        0x7000,
        Condition.NO_JOB,
        UDP,
        "No job: CONT is 0",
        (
            "CONT is 0, so there is no socket, whatever REQ or EN_R say",
            "the socket was released and 7007 has been shown",
        ),
        (
            "pin CONT: what should raise it, and does it?",
            "datagrams that arrive now are lost without a word to the sender",
        ),
        Reproducibility.LOGIC,
    ),
    _state_row(
        0x7001,
        Condition.CREATED,
        UDP,
        "Ready: the UDP socket is there",
        (
            "the socket is bound; UDP has no connection, so this is the ready state",
            "USEND_C: REQ has not risen; URECV_C: EN_R is 0",
        ),
        (
            "this says nothing about the partner: whether it is there, only an answer can tell",
            "`ss -uln`: the port is listed; Recv-Q counts bytes that wait for EN_R",
        ),
        Reproducibility.REAL,
    ),
    _state_row(
        0x7003,
        Condition.CLOSING,
        UDP,
        "Releasing the UDP socket",
        (
            "CONT has just fallen; this shows for one scan",
            "what waits in the socket is dropped, without DONE and without ERROR",
        ),
        (
            "the next scan: 7007 when there was a socket, 7000 when there was none",
            "another block on this UDP_CONFIG loses the socket with it and makes it anew (0001, 7001)",
        ),
        Reproducibility.LOGIC,
    ),
    _state_row(
        0x7005,
        Condition.SENDING,
        SEND_BLOCKS,
        "Sending a datagram",
        (
            "REQ rose while ready: the stack was given the datagram in this very scan",
            "this shows for one scan, then 7009",
        ),
        (
            "pin ADDR: the target is named in the ledger and beside STATUS",
            "a further REQ edge in this scan is not seen",
        ),
        Reproducibility.REAL,
    ),
    _state_row(
        0x7006,
        Condition.RECEIVING,
        RECEIVE_BLOCKS,
        "Waiting for a datagram",
        (
            "EN_R is 1 and no datagram has come since the last job",
            "a datagram is here and shows in the next scan: one 7006 stands before each 7008",
            "a cut line or a partner without power looks the same: UDP cannot detect it",
        ),
        (
            "the partner's target: it must be this LocalAddress and LocalPort",
            "`ss -uln` Recv-Q, or `tcpdump udp port N`: does anything arrive at all?",
            "a firewall on this machine drops datagrams without a trace here",
        ),
        Reproducibility.REAL,
    ),
    _state_row(
        0x7007,
        Condition.CLOSED,
        UDP,
        "UDP socket released",
        (
            "CONT fell while the socket was there; this shows for one scan",
            "7000 follows, whatever REQ or EN_R say",
        ),
        (
            "pin CONT: was it meant to fall?",
            "other blocks on this UDP_CONFIG with CONT=1 make the socket anew",
        ),
        Reproducibility.REAL,
    ),
    _state_row(
        0x7008,
        Condition.RECEIVED,
        RECEIVE_BLOCKS,
        "Datagram received",
        (
            "one datagram is one job: RCVD_LEN is its size, also when it is shorter than LEN",
            "ADDR holds the sender's address and port from this scan on",
        ),
        (
            "copy RCVD_LEN in this very scan: together with DONE it is gone in the next",
            "bytes of DATA after RCVD_LEN are those of earlier datagrams",
            "UDP may lose, double and reorder: only a number inside the telegram can tell",
        ),
        Reproducibility.REAL,
    ),
    _state_row(
        0x7009,
        Condition.SENT,
        SEND_BLOCKS,
        "Datagram handed over",
        (
            "the local network stack has the whole datagram",
            "this is no receipt: it shows just the same when no program listens at the target",
        ),
        (
            "ADDR: is it the right machine and port?",
            "`tcpdump udp port N` at the partner; only an answer in your own protocol proves the arrival",
        ),
        Reproducibility.REAL,
    ),
)


# Their own code tables could not be read: each code means what it means to the TCP blocks, where UDP has it.
# The manual's own words: 80A5 above 2048 bytes.

UDP_ERRORS: Final = (
    _error_row(
        0x8080,
        Condition.NO_SOCKET,
        UDP,
        "No socket left",
        (
            "the system has no free descriptor or no memory for a UDP socket",
            "too many blocks and peers hold sockets at the same time",
        ),
        (
            "the ledger: EMFILE is this process's limit (`ulimit -n`), ENFILE the system's",
            "the next attempt follows by itself (switch retry)",
        ),
        Reproducibility.INJECTED,
    ),
    _error_row(
        0x8081,
        Condition.WRONG_LOCAL_ADDRESS,
        UDP,
        "LocalAddress is no port of this PLC",
        (
            "LocalAddress of the UDP_CONFIG is 0.0.0.0 or was left out",
            "LocalAddress belongs to another machine, or to a port that is no Ethernet",
            "it is a multicast or broadcast address",
        ),
        (
            "`ip -br address`: is LocalAddress in the list, and is its link up?",
            "a UDP_CONFIG that was copied from another PLC still holds that one's address",
        ),
        Reproducibility.REAL,
    ),
    _error_row(
        0x8083,
        Condition.BIND_FAILED,
        UDP,
        "LocalPort cannot be bound",
        (
            "another UDP_CONFIG, or another program, has this UDP port",
            "a port below 1024 needs rights that this process does not have (EACCES)",
        ),
        (
            "`ss -ulnp`: who has the port?",
            "TCP ports do not count: UDP has port numbers of its own",
            "LocalPort 0 takes a free one",
        ),
        Reproducibility.REAL,
    ),
    _error_row(
        0x8084,
        Condition.POLL_ADD_FAILED,
        UDP,
        "Socket not taken into the poll set",
        ("the system refused one more descriptor in the poll set", "a planned fault on poll_add"),
        (
            "the ledger names the errno: ENOSPC is a limit of the system",
            "the socket is closed again and the next attempt follows by itself (switch retry)",
        ),
        Reproducibility.INJECTED,
    ),
    _error_row(
        0x8087,
        Condition.POLL_DEL_FAILED,
        UDP,
        "Socket not taken out of the poll set",
        ("the descriptor was closed underneath, which no bench command does", "a planned fault on poll_del"),
        ("the ledger names the errno", "the socket is closed all the same; 7000 follows"),
        Reproducibility.INJECTED,
    ),
    _error_row(
        0x80A1,
        Condition.NOT_CONNECTED,
        UDP,
        "Asked for data before the socket was there",
        (
            "USEND_C: REQ rose before 7001; this edge is lost",
            "URECV_C: EN_R is 1 and the socket could not be created yet",
        ),
        (
            "raise REQ only while STATUS is 7001",
            "the code before it: 8080, 8081 or 8083 say why there is no socket",
            "switch not_connected: URECV_C shows it once, as long as it lasts, or never",
        ),
        Reproducibility.LOGIC,
    ),
    _error_row(
        0x80A2,
        Condition.DISCONNECT_FAILED,
        UDP,
        "Releasing the socket failed",
        ("the call that closes the socket answered an error", "a planned fault on close"),
        ("the ledger names the errno", "the socket is gone all the same; 7000 follows"),
        Reproducibility.INJECTED,
    ),
    _error_row(
        0x80A4,
        Condition.DATA_EMPTY,
        UDP,
        "DATA has no byte",
        ("no variable is bound to DATA", "the bound variable has size 0, or was shrunk to nothing"),
        (
            "pin DATA of the call, in a project file the key `data` of the instance",
            "the size of the variable: `trcvtui udt show FILE`; on the bench `resize`",
        ),
        Reproducibility.LOGIC,
    ),
    _error_row(
        0x80A5,
        Condition.LENGTH_WRONG,
        UDP,
        "LEN does not fit into a datagram",
        (
            "LEN is above 2048, the longest datagram of these blocks",
            "LEN is larger than DATA",
            "LEN is 0 and DATA itself is larger than 2048 bytes",
        ),
        (
            "pin LEN against the size of DATA: `trcvtui udt show FILE` counts the padding too",
            "a larger telegram has to be cut by the program, or needs the TCP blocks",
            "the socket stays; as soon as LEN fits the job starts",
        ),
        Reproducibility.LOGIC,
    ),
    _error_row(
        0x80A7,
        Condition.NO_BUFFER,
        UDP,
        "No buffer for the job",
        (
            "more jobs run at the same time than there are buffers (switch buffers)",
            "a planned fault on buffer",
        ),
        (
            "how many blocks are at 7005 or 7006 at the same time?",
            "URECV_C tries again in each scan, USEND_C with the next REQ edge",
        ),
        Reproducibility.LOGIC,
    ),
    _error_row(
        0x80A8,
        Condition.SEND_BUFFER_FULL,
        SEND_BLOCKS,
        "Send buffer full",
        (
            "the stack has no room for the datagram now; it was not sent",
            "many datagrams at once on a slow or blocked interface",
        ),
        ("send it again with a new REQ edge", "`ss -un` Send-Q, and the speed of the interface"),
        Reproducibility.INJECTED,
    ),
    _error_row(
        0x80A9,
        Condition.SEND_FAILED,
        SEND_BLOCKS,
        "The datagram could not be sent",
        (
            "ADDR holds no target: RemoteAddress 0.0.0.0 or RemotePort 0",
            "there is no way to RemoteAddress (ENETUNREACH), or it is a broadcast address (EACCES)",
            "RemotePort is `@NAME`, and no peer of that name has listened yet",
        ),
        (
            "ADDR: which address and port stand in it? URECV_C on the same ADDR overwrites it",
            "`ip route get ADDRESS` on the machine that runs the bench",
            "a partner that is merely off or does not listen shows 7009, never this",
        ),
        Reproducibility.REAL,
    ),
    _error_row(
        0x80AA,
        Condition.RECEIVE_FAILED,
        RECEIVE_BLOCKS,
        "The datagram could not be taken",
        (
            "it is larger than LEN (LEN=0: than DATA); it is lost, DATA and ADDR stay as they were",
            "the receive call answered an error",
        ),
        (
            "have and need beside STATUS: the size that came against the room for it",
            "give DATA and LEN the size of the partner's longest datagram, 2048 at most",
            "switch large_datagram = cut takes the first bytes instead",
        ),
        Reproducibility.REAL,
    ),
    _error_row(
        0x80C3,
        Condition.CONNECT_IN_USE,
        UDP,
        "UDP_CONFIG already in use",
        (
            "another block of the same kind works on this UDP_CONFIG: one URECV_C with EN_R=1 at a time",
            "an instance that was deleted or downloaded in mid job still holds it",
        ),
        (
            "the owner is named beside STATUS and in Instances",
            "one UDP_CONFIG for each receiver, or EN_R of the other one to 0",
            "CONT to 0 on any block of this UDP_CONFIG frees it",
        ),
        Reproducibility.LOGIC,
    ),
)

UDP_STATUS: Final = UDP_STATES + UDP_ERRORS
