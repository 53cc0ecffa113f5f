"""The words of each cause: title, remedy, the STATUS that it leads to, a filter for Wireshark."""

from __future__ import annotations

from typing import Final, NamedTuple

from trcvtui.blocks.conditions import Condition
from trcvtui.snapshots.doctor import Remedy


class CauseWords(NamedTuple):
    """One row. `filter` selects the packets of a conversation that are evidence. "" selects all packets."""

    title: str
    remedy: str = ""
    leads_to: tuple[Condition, ...] = ()
    filter: str = ""


_SYN_FILTER, _RST_FILTER, _DATA_FILTER = "tcp.flags.syn == 1", "tcp.flags.reset == 1", "tcp.len > 0"
_COPY_FILTER: Final = "tcp.analysis.retransmission"
_LOSS_FILTER: Final = f"{_COPY_FILTER} || tcp.analysis.out_of_order || tcp.analysis.lost_segment"
_WINDOW_FILTER: Final = "tcp.window_size == 0 || tcp.analysis.window_update"
_PARTNER_CLOSED: Final = (Condition.PARTNER_CLOSED,)
_RECEIVING_PART: Final = (Condition.RECEIVING_PART,)
_CALL_FAILED: Final = (Condition.REFUSED, Condition.CONNECT_FAILED)  # a PLC has one of them
# fmt: off
_ROWS: Final[tuple[tuple[str, str, str, tuple[Condition, ...], str], ...]] = (
    ("address", "the two ends cannot connect as they are configured",
     "let one end call and the other listen, on the same port", (Condition.ESTABLISHING,), _SYN_FILTER),
    ("no-such-host", "no host has the address that is called", "correct the address, or plug the host in",
     (Condition.UNREACHABLE, Condition.CONNECT_FAILED), "arp"),
    ("duplicate-ip", "two devices have one address", "give one of them another address", (), "arp"),
    ("second-client", "a second client calls while the first is connected",
     "close the connection of the first client, or give the second client its own CONNECT and port",
     (), f"{_SYN_FILTER} || {_RST_FILTER}"),
    ("refused", "nothing listens on the port that is called",
     "start the listener before the call, or correct the port",
     _CALL_FAILED, f"{_SYN_FILTER} || {_RST_FILTER}"),
    ("turned-away", "the partner accepts the call and ends it at once",
     "free the partner's connection (another client holds it, or an old connection of this PLC, until "
     "keep-alive ends that), or add this PLC to the partner's address filter",
     _CALL_FAILED, f"{_SYN_FILTER} || tcp.flags.fin == 1 || {_RST_FILTER}"),
    ("filtered", "a call does not get through",
     "nothing comes back: check firewall, address and cable",
     (Condition.UNREACHABLE, Condition.CONNECT_FAILED, Condition.ESTABLISHING), _SYN_FILTER),
    ("wrong-tsap", "the TSAPs of both ends do not match",
     "set the remote TSAP of each end to the local TSAP of the other end", _PARTNER_CLOSED,
     f"{_DATA_FILTER} || tcp.flags.fin == 1 || {_RST_FILTER}"),
    ("plain-tcp", "the partner speaks plain TCP where the CONNECT speaks ISO-on-TCP",
     "give the CONNECT a description of plain TCP, or let the partner speak RFC 1006", (), _DATA_FILTER),
    ("tls-refused", "the TLS handshake failed",
     "let both ends speak TLS, and let each end trust the other end's certificate",
     (Condition.TLS_HANDSHAKE,), "tls"),
    ("line-errors", "the serial line garbles bytes",
     "give both ends the same baud rate, data bits, parity and stop bits; check cable and shield", (), ""),
    ("closes-each-message", "the partner ends its connection after each message",
     "let the partner keep its connection open: each close gives a receiver 80C5",
     _PARTNER_CLOSED, "tcp.flags.fin == 1"),
    ("reconnect-storm", "connections are lost and built again",
     "find out which end closes the connections, and why",
     _PARTNER_CLOSED, f"{_SYN_FILTER} || tcp.flags.fin == 1 || {_RST_FILTER}"),
    ("no-keep-alive", "an idle connection was forgotten on the way or at one end",
     "set KeepAliveTimeInterval below the time after which a device on the way forgets an idle connection",
     (Condition.LINK_DEAD,), "tcp.time_delta > 20"),
    ("half-open", "one end has restarted, and the other end keeps the old connection",
     "find the cause of the restart (supply, watchdog, a download); a shorter KeepAliveTimeInterval frees "
     "the old connection sooner",
     (Condition.RECEIVE_FAILED, Condition.LINK_DEAD), f"{_SYN_FILTER} || {_RST_FILTER}"),
    ("mtu", "large packets do not get through", "lower the MTU at both ends, or repair the network path",
     (Condition.LINK_DEAD,), f"{_COPY_FILTER} || tcp.options.sack_le"),
    ("dead-link", "one end is silent",
     "check cable, switch and power of the silent end; keep-alive detects a silent end sooner",
     (Condition.LINK_DEAD,), f"{_COPY_FILTER} || tcp.analysis.keep_alive"),
    ("resets", "an end resets the connection",
     "check the log of the device that sends RST for a crash, a timeout or a connection limit",
     (Condition.RECEIVE_FAILED,), _RST_FILTER),
    ("plc-not-reading", "the PLC does not read the received bytes",
     "nothing reads the bytes: keep EN_R at 1, or call the block in each scan", (), _WINDOW_FILTER),
    ("partner-not-reading", "the partner does not read the received bytes",
     "let the partner read, or send less often", (Condition.SENDING,), _WINDOW_FILTER),
    ("flood", "more data comes than the block takes",
     "let the partner send less often, call the block more often, or take several messages per job",
     (), f"{_DATA_FILTER} || {_WINDOW_FILTER}"),
    ("slow-ack", "small writes wait for an acknowledgement that comes late",
     "send each message with one write, or set TCP_NODELAY at the end that waits",
     (), f"{_DATA_FILTER} || tcp.analysis.ack_rtt > 0.03"),
    ("loss", "packets get lost on the way",
     "check cable, duplex mode, switch and radio between the ends", _RECEIVING_PART, _LOSS_FILTER),
    ("capture-incomplete", "the capture lacks packets that arrived",
     "", (), "tcp.analysis.ack_lost_segment || tcp.analysis.lost_segment"),
    ("header", "there are bytes before or after the members", "declare them as members", (), _DATA_FILTER),
    ("padding", "the partner packs the members differently", "give DATA its layout", (), _DATA_FILTER),
    ("byte-order", "the partner's numbers have another byte order", "give DATA the partner's byte order",
     (), _DATA_FILTER),
    ("encoding", "bytes were sent as a string, in UTF-8", "let the partner send bytes, not a string",
     (Condition.MESSAGE_TOO_LONG,), ""),
    ("text", "text comes where numbers are declared", "declare a text and convert it in the program",
     (), _DATA_FILTER),
    ("frame-short", "messages are shorter than a job expects",
     "compare LEN and the type of DATA with what the partner sends", _RECEIVING_PART, _DATA_FILTER),
    ("frame-long", "messages are longer than a job takes",
     "compare LEN and the type of DATA with what the partner sends", (), _DATA_FILTER),
    ("adhoc-missing", "messages have several lengths, but a job waits for one",
     "receive ad hoc", _RECEIVING_PART, _DATA_FILTER),
    ("shifted", "jobs begin inside messages",
     "reset the connection (COM_RST): the next frame then begins with a message", (), _DATA_FILTER),
    ("adhoc-splits", "a message comes in pieces, and each piece ends an ad-hoc job",
     "receive static with a fixed LEN, or cut them in the program (TwinCAT: ReceiveData)", (), _DATA_FILTER),
    ("merged", "several messages come at once", "receive static with LEN of one message", (), _DATA_FILTER),
    ("datagram-size", "a datagram is larger than LEN or DATA",
     "give DATA and LEN the size of the largest datagram", (Condition.MESSAGE_TOO_LONG,), "udp"),
    ("framing", "messages lack the prefix or suffix of a frame",
     "set prefix and suffix to those that the partner sends", (), _DATA_FILTER),
    ("members-unwritten", "frames end before DATA is full",
     "set LEN to 0 or to the size of DATA: then all members are written", (), _DATA_FILTER),
    ("odd-values", "members have values that no machine sends",
     "compare the type of DATA with what the partner sends, member by member", (), _DATA_FILTER),
    ("block-error", "a block shows an ERROR, and no other finding explains it", "", (), ""),
    ("not-connected", "a connection is requested, but not built",
     "check whether the partner calls, or listens, at this address and port", (), ""),
    ("job-waits", "a job has a part of its bytes, and no more come",
     "compare LEN and the type of DATA with what the partner sends", (), ""),
    ("limits", "the project asks for more than the PLC allows", "", (), ""),
    ("request-too-fast", "REQ rises before the previous job has ended",
     "wait for DONE or ERROR before the next REQ", (), ""),
    ("not-connected-request", "a job is requested without a connection",
     "wait for STATUS 7004 (connected) before you set EN_R or REQ", (Condition.NOT_CONNECTED,), ""),
)
# fmt: on
CAUSE_WORDS: Final = {row[0]: CauseWords(*row[1:]) for row in _ROWS}
CAUSED_CONDITIONS: Final = frozenset(condition for row in CAUSE_WORDS.values() for condition in row.leads_to)


def default_remedies(cause: str) -> tuple[Remedy, ...]:
    """Return the remedy of a cause for which no rule offers a better one, or () if there is none."""
    text = CAUSE_WORDS[cause].remedy
    return (Remedy(text),) if text else ()
