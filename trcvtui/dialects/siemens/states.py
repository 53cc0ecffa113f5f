"""The Siemens blocks in groups that share a row, and the STATUS words without ERROR, 0000 to 7006."""

from __future__ import annotations

from functools import partial
from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.blocks.status import Reproducibility, StatusRow

SEND_C: Final = ("TSEND_C",)
RCV_C: Final = ("TRCV_C",)
C_BLOCKS: Final = SEND_C + RCV_C
TCON: Final = ("TCON",)
SET_UP: Final = C_BLOCKS + TCON  # these build a connection
SEND: Final = (*SEND_C, "TSEND")
RECEIVE: Final = (*RCV_C, "TRCV")
UDP: Final = ("TUSEND", "TURCV")
JOBS: Final = SEND + RECEIVE + UDP  # these move bytes
CLOSE: Final = ("TDISCON", "T_RESET")
SINGLE_BLOCKS: Final = TCON + CLOSE + ("T_DIAG", "TSEND", "TRCV") + UDP
ALL_BLOCKS: Final = C_BLOCKS + SINGLE_BLOCKS


# Causes and checks are for the reader at the cabinet; `ss`, `nc`, `ip` and `tcpdump` are meant for the
# machine that runs the bench.

_state_row: Final = partial(StatusRow, error=False)
STATES: Final = (
    _state_row(
        0x0000,
        Condition.FINISHED,
        ALL_BLOCKS,
        "A job ended well (DONE = 1), or not called",
        (
            "with DONE (TRCV, TRCV_C, TURCV: NDR): the job ended in this very scan",
            "sent means: the local stack has every byte; the partner may not have read one of them",
            "without DONE: the block has not been called, or the CPU is in STOP",
        ),
        (
            "with DONE: copy RCVD_LEN and DATA in this scan; in the next one RCVD_LEN is 0 again",
            "TSEND_C, TSEND: whether the partner took it is seen with `ss -tn` (Send-Q 0) or in its answer",
            "a standing 0000: CPU mode, and whether the task with this call comes round",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help, Open User Communication; Siemens FAQ 109479564",
        also=(Condition.NOT_CALLED, Condition.SENT, Condition.RECEIVED),
    ),
    _state_row(
        0x0001,
        Condition.JOB_BEGINS,
        C_BLOCKS,
        "The connection is up",
        (
            "REQ or EN_R stood at 1 while the connection was built: its job starts here, with BUSY = 1",
            "switch status_0001_always: it shows for each connection, with BUSY = 0 where no job waits",
        ),
        (
            "one scan only; the next shows 7005 (TSEND_C) or 7006 (TRCV_C)",
            "no 0001 although REQ was pulsed: with cont_mode level a pulse that ends before that is lost",
            "cont_mode manual keeps the first edge; BUSY is 1 from it on, and further ones do not count",
        ),
        Reproducibility.REAL,
        "STEP 7 help: TSEND_C; Siemens FAQ 109479564",
        also=(Condition.ESTABLISHED,),
        unsure="whether a connection that no job waits for shows it, too: switch status_0001_always",
    ),
    _state_row(
        0x0001,
        Condition.NOTHING_TO_RESET,
        ("T_RESET",),
        "There was no connection to reset",
        (
            "the endpoint is there, but the partner has not come yet or has just gone",
            "a reset that came twice: the first one is still at work",
        ),
        (
            "T_DIAG: State 2 or 3 means that it is still being built",
            "not an error: nothing has to be reset, and whoever waits goes on waiting",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: T_RESET",
    ),
    _state_row(
        0x0003,
        Condition.CLOSED,
        C_BLOCKS,
        "The connection is closed",
        (
            "CONT fell while a connection stood; 7003 has shown before",
            "cont_mode level: CONT fell in a transfer, which is lost with the connection",
            "cont_mode manual: the job has ended, and CONT was 0 at its edge of REQ, or has fallen since",
            "cont_mode manual, TRCV_C: data has come, and CONT was 0 when the connection was begun",
        ),
        (
            "one scan, then 7000; cont_mode manual: 7001 where CONT or EN_R is 1, or REQ has risen",
            "the other block on this connection shows 80AA, one scan later if it is called first",
        ),
        Reproducibility.REAL,
        "STEP 7 help: TSEND_C; Siemens FAQ 109479564",
    ),
    _state_row(
        0x7000,
        Condition.NO_JOB,
        C_BLOCKS,
        "No job, and no connection",
        (
            "CONT is 0; with cont_mode level REQ and EN_R mean nothing without it",
            "cont_mode manual: EN_R is 0, or REQ has not risen since the last job ended the connection",
            "the program took CONT away, often in its own error handling",
            "an ordered close has ended: 7003 and 0003 stand before it",
        ),
        (
            "pin CONT: 1 builds the connection and keeps it, with REQ and EN_R at 0 as well",
            "what writes CONT: from the cross references of the tag, not from this call alone",
            "an S7-1200 lets REQ and EN_R connect, an S7-1500 only CONT: switch cont_mode",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TRCV_C; Siemens FAQ 109479564",
    ),
    _state_row(
        0x7000,
        Condition.NO_JOB,
        SINGLE_BLOCKS,
        "No job",
        (
            "REQ has not risen, or stays 1 since the last job: one edge, one job",
            "TRCV, TURCV: EN_R is 0",
        ),
        (
            "REQ has to be 0 for one call before the next edge counts",
            "7000 says nothing about the connection: T_DIAG tells whether it stands",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help, Open User Communication",
    ),
    _state_row(
        0x7001,
        Condition.CREATING,
        C_BLOCKS,
        "Starting to build the connection",
        (
            "CONT has just risen; cont_mode manual: or REQ has, or EN_R is 1; this shows for one scan",
            "the block builds a lost or refused connection again: 80A3, 80AA, 80C5 or 80C6 before it",
        ),
        (
            "again and again: read the code of the scan before it, which is the reason",
            "TRCV_C beside a TSEND_C that came first: it shows 7002 at once, never 7001",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help: TSEND_C, TRCV_C; Siemens FAQ 109479564",
        unsure="that it shows again after 80AA and a failed attempt is an inference",
    ),
    _state_row(
        0x7001,
        Condition.STARTED,
        SINGLE_BLOCKS,
        "A job starts",
        (
            "REQ has just risen (TRCV, TURCV: EN_R is 1 and the next job begins)",
            "TSEND, TUSEND: DATA is copied in this scan",
        ),
        (
            "call the block on until DONE or ERROR: a call that is skipped hides the result",
            "TRCV: it comes back after each frame, as long as EN_R is 1",
        ),
        Reproducibility.LOGIC,
        "STEP 7 help, Open User Communication",
    ),
    _state_row(
        0x7002,
        Condition.ESTABLISHING,
        C_BLOCKS,
        "Connecting, or waiting for the partner",
        (
            "passive: no partner has come, or another one was turned away",
            "active: no answer yet, or the pause after an attempt that failed",
            "both ends are active, or both are passive",
            "two _C blocks on it: the one called first has it already, the other follows one scan later",
        ),
        (
            "ActiveEstablished: TRUE at exactly one end; the ports side by side, the TSAPs crosswise",
            "passive: `ss -ltn` shows LocalPort, or 102 (IsoPort); from the partner `nc -vz ADDRESS PORT`",
            "active: `nc -vz RemoteAddress PORT`; the history keeps each code of an attempt that failed",
            "`tcpdump -ni any tcp port PORT`: a SYN without an answer is a firewall or the cable",
        ),
        Reproducibility.REAL,
        "STEP 7 help: TSEND_C, TRCV_C; Siemens FAQ 109479564",
        also=(Condition.CREATED,),
    ),
    _state_row(
        0x7002,
        Condition.RUNNING,
        SINGLE_BLOCKS,
        "The job is running",
        (
            "TCON: the partner has not come or answered yet",
            "TSEND, TUSEND: the stack has not taken all bytes, or has, which shows in the next scan",
            "TRCV, TURCV: ready and waiting; on TCP perhaps with part of the frame here",
            "TRCV: a cut line or a partner without power looks the same until keep-alive ends it",
        ),
        (
            "TRCV: on TCP a LEN larger than the partner's frame waits forever; messages are whole",
            "TSEND: `ss -tn`, a Send-Q that stands still means that the partner does not read",
            "TCON: the checks of TSEND_C's 7002, `trcvtui status 7002 --block TSEND_C`",
            "TURCV: it hears broadcasts of its own network, none to 255.255.255.255, and no multicast group",
        ),
        Reproducibility.REAL,
        "STEP 7 help, Open User Communication",
    ),
    _state_row(
        0x7003,
        Condition.CLOSING,
        C_BLOCKS,
        "Closing the connection",
        (
            "CONT fell: 0003 and 7000 follow; cont_mode manual: after the job, if one waits or runs",
            "cont_mode manual: a job has ended that had CONT = 0; after an error without 0003",
            "COM_RST rose while connected: 7002 follows, and the connection is built again",
            "switch teardown_before_error: the scan before a loss is told with its code",
        ),
        (
            "pins CONT and COM_RST in the scan before: which of them moved?",
            "a frame that was half here is dropped: the ledger counts its bytes",
            "COM_RST must not be wired to a constant: the block writes it back itself",
        ),
        Reproducibility.REAL,
        "STEP 7 help: TSEND_C, TRCV_C; Siemens FAQ 109479564",
        unsure="7003 after COM_RST and before an error is not documented",
    ),
    _state_row(
        0x7004,
        Condition.CONNECTED,
        C_BLOCKS,
        "Connected, nothing asked for",
        (
            "TSEND_C: no rising edge at REQ; a REQ that stays 1 sends once only",
            "TRCV_C: EN_R is 0, so what arrives piles up unread in the socket; the connection stays",
            "TRCV_C: the other block on this connection closes it, 80AA follows",
            "quiet for long: a cut line or a partner without power looks the same until keep-alive ends it",
        ),
        (
            "TSEND_C: REQ has to go back to 0 for one call before the next edge",
            "TRCV_C: pin EN_R has to be 1",
            "`ss -tn`: Recv-Q above 0 means that the partner sends and no block reads",
        ),
        Reproducibility.REAL,
        "STEP 7 help: TSEND_C, TRCV_C; Siemens FAQ 109479564",
    ),
    _state_row(
        0x7005,
        Condition.SENDING,
        SEND_C,
        "Sending",
        (
            "a send job has started; at least one scan, however fast the line",
            "the partner does not read, so the rest of DATA has no room",
        ),
        (
            "`ss -tn`: a Send-Q that does not shrink means that the partner has stopped reading",
            "the partner's receive call: is it enabled, and is its area large enough?",
            "REQ: edges until DONE or ERROR are not noticed and not kept",
        ),
        Reproducibility.REAL,
        "STEP 7 help: TSEND_C; Siemens FAQ 109479564",
    ),
    _state_row(
        0x7006,
        Condition.RECEIVING,
        RCV_C,
        "Receiving, or ready and waiting",
        (
            "nothing has come: normal with EN_R = 1; a cut line or a partner without power looks the same "
            "until keep-alive ends it",
            "on TCP: LEN (0: the size of DATA) is larger than what the partner sends, so it is never full",
            "EN_R fell, and the job goes on: cont_mode level to its end, manual once a byte is here",
            "on TCP: an earlier frame was cut, so the stream is shifted",
        ),
        (
            "compare the bytes here and wanted; on ISO-on-TCP any message, on UDP any datagram ends the job",
            "compare the partner's length with LEN; `trcvtui udt show FILE` prints the size of a type",
            "frames of varying length: ad-hoc mode, or ISO-on-TCP, which keeps their ends",
            "if values look shifted, pulse COM_RST and look at the first frame after it",
        ),
        Reproducibility.REAL,
        "STEP 7 help: TRCV_C; Siemens FAQ 109479564",
        also=(Condition.RECEIVING_PART,),
    ),
)
