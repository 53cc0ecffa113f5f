"""What is said of each cause: a title in plain words, the STATUS that it leads to, a filter for Wireshark."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.conditions import Condition
from trcvtui.records import NamedTuple


class CauseWords(NamedTuple):
    """One row; `filter` shows the evidence among the packets of its conversation, "": all of them."""

    title: str
    leads_to: tuple[Condition, ...] = ()
    filter: str = ""


_SYN, _RST, _DATA = "tcp.flags.syn == 1", "tcp.flags.reset == 1", "tcp.len > 0"
_COPY: Final = "tcp.analysis.retransmission"
_CLOSED: Final = "tcp.window_size == 0 || tcp.analysis.window_update"
_GONE: Final = (Condition.PARTNER_CLOSED,)
_WAITS: Final = (Condition.RECEIVING_PART,)
# fmt: off
_ROWS: Final[tuple[tuple[str, str, tuple[Condition, ...], str], ...]] = (
    ("address", "the ends do not look for each other where they are", (Condition.ESTABLISHING,), _SYN),
    ("second-client", "a further client wants the connection of another one", (), f"{_SYN} || {_RST}"),
    ("refused", "nothing listens on the port that is called", (Condition.REFUSED,), f"{_SYN} || {_RST}"),
    ("filtered", "no answer to a call", (Condition.UNREACHABLE, Condition.ESTABLISHING), _SYN),
    ("wrong-tsap", "the TSAPs of both ends do not fit", _GONE, "cotp"),
    ("tls-refused", "the TLS handshake failed", (Condition.TLS_HANDSHAKE,), "tls"),
    ("line-errors", "the serial line garbles bytes", (), ""),
    ("closes-each-message", "the partner ends its connection after each message",
     _GONE, "tcp.flags.fin == 1"),
    ("reconnect-storm", "connections are lost and built again",
     _GONE, f"{_SYN} || tcp.flags.fin == 1 || {_RST}"),
    ("no-keep-alive", "an idle connection was forgotten on the way",
     (Condition.LINK_DEAD,), "tcp.time_delta > 20"),
    ("dead-link", "one end has fallen silent", (Condition.LINK_DEAD,), f"{_COPY} || tcp.analysis.keep_alive"),
    ("resets", "an end resets the connection", _GONE, _RST),
    ("plc-not-reading", "the PLC does not take what is there", (), _CLOSED),
    ("partner-not-reading", "the partner does not take what is there",
     (Condition.SENDING,), _CLOSED),
    ("flood", "more comes than the block takes", (), _CLOSED),
    ("slow-ack", "small writes wait for late acknowledgements", (), "tcp.analysis.ack_rtt > 0.03"),
    ("loss", "packets get lost on the way", _WAITS, f"{_COPY} || tcp.analysis.out_of_order"),
    ("capture-incomplete", "the capture lacks packets that arrived",
     (), "tcp.analysis.ack_lost_segment || tcp.analysis.lost_segment"),
    ("header", "bytes stand before or after the members", (), _DATA),
    ("padding", "the partner packs its members otherwise", (), _DATA),
    ("byte-order", "the partner's numbers are turned round", (), _DATA),
    ("frame-short", "messages are shorter than a job waits for", _WAITS, _DATA),
    ("frame-long", "messages are longer than a job takes", (), _DATA),
    ("adhoc-missing", "messages of several lengths meet a job of one length", _WAITS, _DATA),
    ("shifted", "jobs begin inside messages", (), _DATA),
    ("adhoc-splits", "a message comes in pieces, and each ends an ad-hoc job", (), _DATA),
    ("merged", "several messages come at once", (), _DATA),
    ("datagram-size", "a datagram is larger than LEN or DATA", (Condition.MESSAGE_TOO_LONG,), "udp"),
    ("framing", "messages lack the marks that a frame has", (), _DATA),
    ("limits", "the project asks for more than the PLC does", (), ""),
    ("request-too-fast", "REQ rises before the job before has ended", (), ""),
    ("not-connected-request", "a job is asked for without a connection", (Condition.NOT_CONNECTED,), ""),
)
# fmt: on
CAUSES: Final = {row[0]: CauseWords(*row[1:]) for row in _ROWS}
TOLD: Final = frozenset(condition for row in CAUSES.values() for condition in row.leads_to)
