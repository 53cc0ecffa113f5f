"""States and failures of a block in neutral words; a dialect turns each into its STATUS."""

from __future__ import annotations

from enum import StrEnum
from typing import Final


class Condition(StrEnum):
    NOT_CALLED = "not called"
    NO_JOB = "no job"
    CREATING = "creating socket"
    CREATED = "socket created"
    ESTABLISHING = "connecting"
    CLOSING = "closing"
    CONNECTED = "connected"
    JOB_BEGINS = "connected, job begins"
    ESTABLISHED = "connection established"
    LINK_DONE = "connection established, DONE"
    STARTED = "job started"
    RUNNING = "job running"
    FINISHED = "job finished"
    NOTHING_TO_RESET = "nothing to reset"
    SENDING = "sending"
    RECEIVING = "receiving"
    RECEIVING_PART = "receiving, bytes are here"
    CLOSED = "closed by us"
    RECEIVED = "received"
    SENT = "sent"
    FRAME_AWAITED = "waiting for a frame"
    FRAME_PART = "part of a frame is here"
    FRAME_RECEIVED = "frame received"
    FRAME_GAP = "frame ended by a gap"
    BUFFER_EMPTY = "ComBuffer empty"
    RESETTING = "resetting"
    NO_SOCKET = "no socket"
    WRONG_LOCAL_ADDRESS = "wrong LocalAddress"
    REUSE_FAILED = "reuse refused"
    BIND_FAILED = "bind failed"
    POLL_ADD_FAILED = "poll add failed"
    ACCEPT_FAILED = "accept failed"
    POLL_DEL_FAILED = "poll remove failed"
    CONNECT_FAILED = "connect failed"
    NOT_CONNECTED = "not connected"
    DISCONNECT_FAILED = "disconnect failed"
    RESET_FAILED = "reset failed"
    DATA_EMPTY = "DATA empty"
    LENGTH_WRONG = "LEN wrong"
    SHORT_FRAME = "short frame"
    NO_BUFFER = "no buffer"
    SEND_BUFFER_FULL = "send buffer full"
    SEND_FAILED = "send failed"
    RECEIVE_FAILED = "receive failed"
    LINK_DEAD = "link dead"
    QUEUE_FULL = "queue full"
    CONNECT_IN_USE = "CONNECT in use"
    PARTNER_CLOSED = "partner closed"
    REFUSED = "partner refused"
    UNREACHABLE = "partner unreachable"
    NOT_NOW = "not possible now"
    FOUND_CLOSED = "found closed"
    STILL_ASKED = "no link, asked"
    ENDPOINT_THERE = "already connected"
    ID_BUILDING = "ID being built by another"
    ID_OTHER = "ID of another connection"
    ENDPOINT_GONE = "no such connection"
    LET_GO = "let go by another block"
    RESET_IN_JOB = "reset in a job"
    PORT_IN_USE = "port in use"
    PORT_RESERVED = "port reserved"
    REMOTE_WRONG = "wrong remote address"
    LEN_OVER_DATA = "LEN larger than DATA"
    AREA_CHANGED = "DATA or LEN changed"
    MESSAGE_TOO_LONG = "message too long"
    DATA_MISSING = "no DATA"
    DATA_REFUSED = "DATA of a type that is refused"
    DATA_SYMBOLIC = "LEN with a symbolic DATA"
    LEN_OF_TEXT = "LEN cuts a STRING"
    RESULT_WRONG = "RESULT cannot hold it"
    NO_DESCRIPTION = "no connection description"
    DESCRIPTION_LENGTH = "wrong length of CONNECT"
    ID_WRONG = "ID out of range"
    INTERFACE_WRONG = "wrong InterfaceId"
    INTERFACE_BARE = "interface without address"
    TYPE_WRONG = "wrong ConnectionType"
    NEEDS_ADDR = "UDP without ADDR"
    OTHER_TRANSPORT = "block does not fit the connection"
    UDP_ACTIVE = "UDP cannot be active"
    TSAP_WRONG = "wrong TSAP"
    PARAMETER_WRONG = "wrong connection parameter"
    NAME_EMPTY = "name of partner empty"
    NAME_NOT_FULL = "name of partner not fully qualified"
    NO_RESOLVER = "no DNS server"
    NAME_UNKNOWN = "name of partner unknown"
    TLS_MESSAGE = "TLS: no message that makes sense"
    TLS_HANDSHAKE = "TLS: handshake failed"
    TLS_UNSUPPORTED = "TLS: certificate not supported, or none"
    TLS_DISCARDED = "TLS: certificate discarded"
    TLS_NO_CA = "TLS: no authority for the certificate"
    TLS_EXPIRED = "TLS: certificate expired"
    TLS_INTEGRITY = "TLS: integrity check failed"
    TLS_EXTENSION = "TLS: extension not supported"
    TLS_SERVER_BARE = "TLS: server without certificate"
    TLS_DATAGRAMS = "TLS: not for datagrams"
    TLS_CLIENT_ASKS = "TLS: client asks for a client certificate"
    TLS_SERVER_CHECKS = "TLS: server checks a name"
    TLS_REFERENCE = "TLS: wrong number of a certificate"
    PARAMETER_CHANGED = "input changed while busy"
    SEND_OVERRUN = "larger than the ComBuffer"
    STRING_OVERRUN = "string full"
    ZERO_CHARACTER = "byte 00 in a string"
    NULL_POINTER = "pointer to nothing"
    NULL_RECEIVE_POINTER = "pReceiveData points to nothing"
    RECEIVE_LENGTH_WRONG = "SizeReceiveData wrong"
    DATA_OVERRUN = "size reached without the suffix"
    INTERNAL_FAULT = "internal error"


BUSY_CONDITIONS: Final = frozenset(
    {
        Condition.JOB_BEGINS,
        Condition.STARTED,
        Condition.RUNNING,
        Condition.SENDING,
        Condition.RECEIVING,
        Condition.RECEIVING_PART,
    }
)
DONE_CONDITIONS: Final = frozenset(
    {
        Condition.LINK_DONE,
        Condition.FINISHED,
        Condition.NOTHING_TO_RESET,
        Condition.SENT,
        Condition.RECEIVED,
    }
)
# The manual has RESETTING above its heading "exception": it is no error.
ERROR_CONDITIONS: Final = frozenset(list(Condition)[list(Condition).index(Condition.NO_SOCKET) :])
