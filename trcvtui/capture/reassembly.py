"""Makes conversations from packets: reassembled TCP streams, UDP datagrams in their order.

Rule 1: the first copy of a byte counts. A later copy that differs is an event.
Rule 2: bytes that the receiver acknowledged but the capture lacks are a hole. Nothing fills a hole.
Rule 3: bytes that wait for earlier bytes or for comparison are bounded, for each direction and in total.
"""

from __future__ import annotations

import struct
from bisect import bisect, insort
from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from enum import Enum
from itertools import islice
from typing import Final, NamedTuple

from trcvtui.capture.hosts import ArpNote, HostFact, HostNotes, TimedNote, append_note, parse_host_note
from trcvtui.capture.packets import (
    SACK_OPTION,
    TCP,
    UDP,
    Fragment,
    Fragments,
    IpPayload,
    OtherPacket,
    SkipReason,
    find_ip_header,
    ip_identification,
    other_frame,
    parse_packet,
    read_macs,
    read_window_scale,
    sack_blocks,
)  # fmt: skip
from trcvtui.capture.pcap import ETHERNET, NOTES, OWN_PREFIX, RTAC_SERIAL, USER0, Packet

MOST_CONVERSATIONS: Final = 28_000
MOST_KINDS: Final = 1024  # of packets without TCP and UDP
MOST_WAITING: Final = 1 << 20  # of one direction
MOST_WAITING_OF_ALL: Final = 32 << 20
MOST_SEGMENTS_WAITING: Final = 512  # of one direction: a new segment is compared with those it overlaps
MOST_KEPT_BYTES: Final = 8 << 20  # delivered bytes, for comparison with a second copy
MOST_COMPARED: Final = 256  # segments back from the newest
SEGMENT_COST: Final = 200  # bytes of memory for a kept segment beside its data
PATIENCE_NS: Final = 20_000_000  # a capture may have a packet so long after the ACK of its bytes
SILENCE_NS: Final = 10_000_000_000
COPY_NS: Final = 200_000_000  # a mirror port's copy comes within this time, with the same IP number
UNNUMBERED_NS: Final = 300_000  # the same, where packets have no IP number
REORDER_NS: Final = 1_000_000  # a capture may have packets out of order by so much
MOST_RECENT: Final = 4096  # packets that another one may be a copy of
LEAST_WINDOW: Final = 4096  # a smaller window may lack its scale (no SYN in the capture)
FASTEST_BYTES: Final = 1 << 26  # bytes in no time; then a byte a nanosecond: eight gigabits a second
MOST_SACKED: Final = 64  # blocks of SACK that are kept of one direction
MOST_FACTS: Final = 64  # of hosts
MOST_JUMP: Final = 1 << 30  # of a sequence number: the largest window
ENDED_KEPT_NS: Final = 60_000_000_000  # a growing capture keeps an ended conversation so long
SILENT_NS: Final = 120_000_000_000  # the same for a silent one: UDP, or any where there are many
FOREVER_NS: Final = 1 << 62
SENT_END, RECEIVED_END = -1, -2  # ports of the ends of a serial line; its name is their address

_FIN, _SYN, _RST, _ACK = 1, 2, 4, 16
_SEQ_MASK: Final = 0xFFFFFFFF
_SEQ_HALF: Final = 0x80000000
# Ethernet, IPv4 without options and TCP: the head of nearly every packet.
_USUAL_HEAD: Final = struct.Struct(">12xHBxHHHxB2x12sIIBBH").unpack_from
_TCP_HEAD: Final = struct.Struct(">IIBBH").unpack_from
# RTAC serial: twelve bytes before the data; its events with data by their number: begin and end of each way.
_SERIAL_HEAD: Final = 12
_SERIAL_ENDS: Final = {1: SENT_END, 2: RECEIVED_END, 3: SENT_END, 4: RECEIVED_END}
_SERIAL_ERRORS: Final = {7: b"framing", 8: b"parity", 9: b"break", 10: b"overrun"}  # of what was received


class SegmentKind(Enum):
    SYN = "SYN"
    ANSWER = "answer"
    ESTABLISHED = "established"
    BYTES = "bytes"
    FIN = "FIN"
    RST = "RST"
    KEEP_ALIVE = "keep-alive"
    KEEP_ALIVE_ACK = "keep-alive ACK"
    ZERO_WINDOW = "zero window"
    WINDOW_OPENS = "window opens"
    WINDOW_PROBE = "window probe"
    RETRANSMISSION = "retransmission"
    DIFFERENT_COPY = "different copy"
    MISSING = "missing"
    SILENCE = "silence"
    ACK = "ACK"
    EARLY = "early"
    LATE = "late"
    LINE_ERROR = "line error"
    CHALLENGE = "challenge ACK"


class ConversationEvent(NamedTuple):
    """One event. `at` is its offset in the direction. `size` is its number of bytes, or the nanoseconds of
    a silence. An ACK event has no bytes; its `size` is the window. EARLY bytes were captured while bytes
    before them were missing. LATE bytes fill this gap and were sent after the EARLY bytes, as a
    retransmission. The `data` of a LINE_ERROR of a serial line is framing, parity, break or overrun.
    """

    ns: int
    conversation: Conversation
    direction: WireDirection
    kind: SegmentKind
    at: int
    size: int
    data: bytes


TwoEnds = tuple[tuple[bytes, int], tuple[bytes, int]]  # addresses and ports, of a first sender first
SegmentHead = tuple[bytes, int, int, int, int, int]  # ends, number of its IP packet, seq, ack, flags, bytes
KeptPiece = tuple[int, bytes, int, int]  # from which byte on, bytes, when, number of their IP packet


class WireDirection:
    __slots__ = (
        "acked", "address", "conversation", "copies", "cut", "early_number", "fin", "has_base", "has_fin",
        "has_jumped", "has_overrun", "is_closed_window", "is_firm", "is_heard", "is_steady", "kept",
        "largest", "last_ns", "mac", "missing", "next", "other", "position", "probe", "retransmitted",
        "sacked", "scale", "segments", "syn", "told_ack", "unread", "waiting", "waiting_cost",
        "waiting_since", "was_probed", "widest", "window",
    )  # fmt: skip

    def __init__(self, conversation: Conversation, address: tuple[bytes, int], mac: bytes) -> None:
        self.conversation = conversation
        self.other: WireDirection = self
        self.address = address  # of its sender; of a serial line its name, and SENT_END or RECEIVED_END
        self.mac = mac
        self.segments = self.retransmitted = self.missing = 0
        self.cut = 0  # bytes of `missing` that the capture's own limit cut off
        self.copies = 0  # packets that a mirror port has shown twice
        self.largest = 0  # bytes of a segment
        self.last_ns = 0  # when its sender was heard last
        self.sacked: dict[int, int] = {}  # sequence numbers that the other end has, behind a hole
        self.window = self.widest = 0  # the newest and the largest window, without scale
        self.scale: int | None = None  # bits; None: not known
        self.is_heard = False  # bytes of it were acknowledged
        self.has_jumped = False  # sequence numbers that no window allows
        self.has_overrun = False  # more in flight than the other end's window in the capture
        self.next = self.position = 0  # sequence number and byte of what comes next
        self.has_base = self.is_firm = False  # is `next` known; has it proved right
        self.is_steady = False  # a segment that begins at `next` takes the fast path
        self.told_ack = -1  # the newest ACK number of its sender; -1: none yet
        self.acked = 0  # sequence number up to which the other end has acknowledged
        self.syn: int | None = None
        self.fin: int | None = None  # the byte before which its sender has ended
        self.has_fin = False
        self.unread = 0  # newest bytes of the other end that its program cannot have read when it ended
        self.is_closed_window = False  # its sender's window is 0
        self.was_probed = False
        self.probe = b""
        self.kept: deque[KeptPiece] | None = None
        self.waiting: list[tuple[int, bytes]] = []
        self.waiting_cost = 0
        self.early_number = 0  # of the last packet that came before an earlier one
        self.waiting_since: int | None = None

    @property
    def byte_count(self) -> int:
        return self.position - self.missing

    def allows_fast_path(self) -> bool:
        """Return whether `add_packets` may take its fast path, because only bytes in order can come."""
        other, conversation = self.other, self.conversation
        return (
            self.is_firm
            and (conversation.is_established or not conversation.begins_with_syn)
            and not self.waiting
            and self.fin is None
            and not (self.is_closed_window or other.is_closed_window or other.was_probed or self.probe)
        )


class Conversation:
    """The two directions between two ends. `there` is the direction of the first packet."""

    __slots__ = ("back", "begins_with_syn", "end", "first_ns", "goes_back", "is_cut", "is_established",
                 "is_ours", "last_ns", "listener", "number", "protocol", "sent", "tap",
                 "there", "undelivered")  # fmt: skip

    def __init__(
        self, number: int, protocol: str, ns: int, ends: TwoEnds, macs: tuple[bytes, bytes] = (b"", b"")
    ) -> None:
        self.number = number
        self.protocol = protocol
        self.first_ns = self.last_ns = ns
        self.begins_with_syn = self.is_established = False
        self.goes_back = False  # in time
        self.is_cut = False  # a packet of it is
        self.is_ours = False  # a tap of ours has reset it
        self.tap = ""  # name of our tap: its packets come in order, none comes twice
        self.sent: bool | None = None  # first packet: True by the PLC of our recording, None: other captures
        self.undelivered: list[TimedNote] = []  # of its packets
        self.listener: WireDirection | None = None
        self.end: tuple[str, WireDirection] | None = None  # "fin" or "rst", and the direction that sent it
        self.there = WireDirection(self, ends[0], macs[0])
        self.back = WireDirection(self, ends[1], macs[1])
        self.there.other, self.back.other = self.back, self.there

    def mark_established(self) -> None:
        """Mark the SYN as sent and answered, although the capture has no packet of the handshake."""
        self.begins_with_syn = self.is_established = True
        self.listener = self.back

    @property
    def forget_after_ns(self) -> int:
        """Return how long the conversation must be silent before a growing capture forgets it, in ns."""
        if self.protocol == "udp" and not self.tap:
            return SILENT_NS
        return ENDED_KEPT_NS if self.end is not None else FOREVER_NS


class Conversations:
    """All conversations of a capture, made from its packets. Their events go to `on_event`.

    ACK, EARLY, LATE and LINE_ERROR are events only with `is_detailed`.
    """

    def __init__(
        self, on_event: Callable[[ConversationEvent], None] | None = None, is_detailed: bool = False
    ) -> None:
        self.names: Callable[[int], str] = str  # interface number to name; a serial line has that name
        self.noted: Callable[[int, bytes], object] | None = None  # called with the notes of our tap
        self.is_tapped = False  # our tap announces each conversation: there are no others
        self.all: list[Conversation] = []
        self.not_read: Counter[SkipReason] = Counter()
        self.others: Counter[OtherPacket] = Counter()
        self.drops = 0  # packets that the capturing program lost
        self.unlisted = 0  # packets of conversations above the limit
        self.hosts = HostNotes()
        self.first_ns: int | None = None
        self.recorded_to: int | None = None  # by the journal of a recording of ours
        self.packets = 0
        self._on_event = on_event
        self._is_detailed = is_detailed and on_event is not None
        self._fragments = Fragments()
        self._flows: dict[bytes, WireDirection] = {}  # addresses and ports of the sender and the receiver
        self._kept: deque[deque[KeptPiece]] = deque()  # whose oldest piece goes next
        self._kept_cost = 0
        self._waiting_cost = 0
        self._recent: dict[SegmentHead, int] = {}  # packets, and when they came
        self._before: dict[SegmentHead, int] = {}  # those that came before
        self._count = 0  # conversations, with those that are forgotten

    def add_packet(self, packet: Packet, link_type: int) -> None:
        self.add_packets((packet,), {packet.interface: link_type})

    def add_packets(self, packets: Iterable[Packet], link_types: Sequence[int] | dict[int, int]) -> None:
        """Take packets. The next segment of a steady direction takes a fast path of few operations."""
        flow_of, has_sink, deliver = self._flows.get, self._on_event is not None, self._deliver
        is_detailed = self._is_detailed
        for packet in packets:
            self.packets += 1
            ns, interface, data, _, _, _, _ = packet
            if link_types[interface] != ETHERNET:
                self._add_packet_slowly(packet, link_types[interface])
                continue
            try:
                (kind, head, total, number, fragment, protocol, key, seq, ack, offset, flags, window) = (
                    _USUAL_HEAD(data)
                )
            except struct.error:
                self._add_packet_slowly(packet, ETHERNET)
                continue
            if (
                (direction := flow_of(key)) is None
                or not direction.is_steady
                or seq != direction.next
                or flags & 0x17 != _ACK
                or not window
                or head != 0x45
                or kind != 0x800
                or protocol != TCP
                or fragment & 0x3FFF
                or not 0 <= ns - direction.conversation.last_ns <= SILENCE_NS
            ):
                self._add_packet_slowly(packet, ETHERNET)
                continue
            begin, end = 34 + (offset >> 4) * 4, 14 + total
            if end > len(data) or begin > end:
                self._add_packet_slowly(packet, ETHERNET)
                continue
            direction.conversation.last_ns = direction.last_ns = ns
            if ack != direction.told_ack:
                direction.told_ack = ack
                self._handle_ack(ns, direction.other, ack, end - begin)
            direction.window = window
            if window > direction.widest:
                direction.widest = window
            if end > begin:
                size = end - begin
                if size > direction.largest:
                    direction.largest = size
                if (scale := direction.other.scale) is not None:
                    fly = (seq + size - direction.acked) & _SEQ_MASK
                    if LEAST_WINDOW <= direction.other.window << scale < fly < MOST_JUMP:
                        direction.has_overrun = True
                direction.segments += 1
                payload = data[begin:end]
                if has_sink or self._kept_cost > MOST_KEPT_BYTES or direction.kept is None:
                    deliver(ns, direction, payload, number)
                    continue
                at = direction.position
                direction.kept.append((at, payload, ns, number))
                self._kept.append(direction.kept)
                self._kept_cost += size + SEGMENT_COST
                direction.position = at + size
                direction.next = (seq + size) & _SEQ_MASK
            elif is_detailed:
                if offset > 0x80 or (offset == 0x80 and data[56] == SACK_OPTION):  # else a time stamp alone
                    _add_sack(direction.other, data[54:begin])
                self._report_event(ns, direction, SegmentKind.ACK, size=window)

    def close(self) -> None:
        for conversation in self.all:
            self._flush(conversation)

    def _flush(self, conversation: Conversation) -> None:
        for direction in (conversation.there, conversation.back):
            while direction.waiting:
                self._skip_missing(conversation.last_ns, direction, direction.waiting[0][0])
            left = distance(direction.acked, direction.next)
            if direction.has_base and left > 1:
                self._skip_missing(conversation.last_ns, direction, direction.position + left)

    def forget_silent(self, ns: int) -> list[int]:
        """Forget conversations silent for long: UDP, ended or, if many exist, any. Return their numbers."""
        is_full = len(self.all) > MOST_CONVERSATIONS // 2
        over = [
            each for each in self.all if ns - each.last_ns > (SILENT_NS if is_full else each.forget_after_ns)
        ]
        if not over:
            return []
        for each in over:
            self._flush(each)
        gone = set(over)
        pieces = [d.kept for each in over for d in (each.there, each.back) if d.kept is not None]
        self._kept_cost -= sum(len(data) + SEGMENT_COST for kept in pieces for _, data, _, _ in kept)
        dropped = {id(kept) for kept in pieces}
        self._kept = deque([kept for kept in self._kept if id(kept) not in dropped])
        self.all = [each for each in self.all if each not in gone]
        for key in [key for key, flow in self._flows.items() if flow.conversation in gone]:
            del self._flows[key]
        return [each.number for each in over]

    # -- one packet --------------------------------------------------------------------------------------

    def _add_packet_slowly(self, packet: Packet, link_type: int) -> None:
        data = packet.data
        if link_type == USER0:  # none of the line's packets
            if self.names(packet.interface) != NOTES:
                self.not_read[SkipReason.JOURNAL] += 1
                self.recorded_to = packet.ns
            elif self.noted is not None:
                self.noted(packet.ns, data)
            return
        if self.first_ns is None:
            self.first_ns = packet.ns
        if link_type == RTAC_SERIAL:
            self._add_serial_packet(packet)
            return
        found = parse_packet(link_type, data, packet.length)
        if isinstance(found, Fragment):
            self._add_fragment(packet, link_type, found)
            return
        if isinstance(found, SkipReason):
            self.not_read[found] += 1
        elif isinstance(found, OtherPacket):
            if not self._read_host_note(packet, link_type):
                self._count_skipped(found)
        elif found.protocol == UDP:
            self._add_datagram(packet, link_type, found)
        elif len(data) >= found.at + 16:
            self._add_tcp_packet(packet, link_type, found)
        else:
            self.not_read[SkipReason.CUT] += 1

    def _count_skipped(self, kind: OtherPacket) -> None:
        is_known = kind in self.others or len(self.others) < MOST_KINDS
        self.others[kind if is_known else OtherPacket("packet", " of more kinds")] += 1

    def _read_host_note(self, packet: Packet, link_type: int) -> bool:
        """Read a packet without TCP and UDP; return whether it has an ARP or ICMP note."""
        data, note = packet.data, parse_host_note(link_type, packet.data)
        if isinstance(note, ArpNote):
            self.hosts.add_arp(packet.ns, self.packets, note)
            return True
        at = find_ip_header(link_type, data)
        if at >= 0 and data[at] >> 4 == 4:
            self.hosts.mark_heard(data[at + 12 : at + 16])
        if note is not None:
            flow = self._flows.get(note.flow_key)
            notes = self.hosts.icmps if flow is None else flow.conversation.undelivered
            append_note(notes, packet.ns, self.packets, note)
        return note is not None

    def host_facts(self) -> list[HostFact]:
        """Return the facts of ARP and ICMP outside of any conversation, in order of time."""
        heard_ns: dict[bytes, int] = {}
        for each in self.all:
            for end in (each.there, each.back):
                host = end.address[0]
                heard_ns[host] = max(heard_ns.get(host, 0), end.last_ns)
        is_whole = not (self.drops or self.not_read[SkipReason.CUT])
        lacking = self._fragments.count_lost() if is_whole else {}
        return sorted(self.hosts.facts(heard_ns, lacking), key=lambda fact: fact.ns)[:MOST_FACTS]

    def _add_datagram(self, packet: Packet, link_type: int, found: IpPayload) -> None:
        _, source, target, ports, at, end = found
        key = b"".join((b"U", source, target, ports))
        direction = self._flows.get(key) or self._open_conversation(packet, link_type, key, found, "udp")
        if direction is not None:
            self._take_datagram(packet.ns, direction, packet.data[at + 8 : end], max(end - at - 8, 0))

    def _add_serial_packet(self, packet: Packet) -> None:
        data = packet.data
        error = _SERIAL_ERRORS.get(data[8]) if len(data) >= _SERIAL_HEAD else None
        has_data = len(data) > _SERIAL_HEAD
        sender = RECEIVED_END if error else _SERIAL_ENDS.get(data[8]) if has_data else None
        if sender is None:
            if len(data) >= _SERIAL_HEAD:
                self._count_skipped(other_frame(RTAC_SERIAL, data))
            else:
                self.not_read[SkipReason.CUT] += 1
            return
        name = self.names(packet.interface).encode()
        direction = self._flows.get(b"S%d" % sender + name)
        if direction is None:
            ends = (name, sender), (name, SENT_END + RECEIVED_END - sender)
            direction = self._make_conversation(packet.ns, "serial", ends, (b"", b""))
            if direction is None:
                return
            for each in (direction, direction.other):
                self._flows[_flow_key("serial", each.address, each.other.address)] = each
        if error and self._is_detailed:
            self._report_event(packet.ns, direction, SegmentKind.LINE_ERROR, direction.position, 1, error)
        if has_data:
            self._take_datagram(packet.ns, direction, data[_SERIAL_HEAD:], packet.length - _SERIAL_HEAD)

    def _add_tcp_packet(self, packet: Packet, link_type: int, found: IpPayload) -> None:
        _, source, target, ports, at, end = found
        seq, ack, offset, flags, window = _TCP_HEAD(packet.data, at + 4)
        begin, key = at + (offset >> 4) * 4, b"".join((source, target, ports))
        direction = self._flows.get(key)
        if direction is not None and flags & _SYN and self._is_new_connection(direction, seq, flags):
            direction = None
        direction = direction or self._open_conversation(packet, link_type, key, found, "tcp")
        if direction is None:
            return
        ns, size, number = packet.ns, max(end - begin, 0), ip_identification(link_type, packet.data)
        direction.conversation.is_cut |= packet.length > len(packet.data)
        if self._is_copy(ns, number, (key, number, seq, ack, flags, size), direction):
            direction.copies += 1
            return
        self._note_time(ns, direction)
        if flags & 0x17 == _ACK and not size and _is_challenge(direction, ack):
            self._report_event(ns, direction, SegmentKind.CHALLENGE)
            return
        if flags & _SYN:
            direction.scale = read_window_scale(packet.data[at + 20 : begin])
            self._handle_syn(ns, direction, seq, flags)
            seq = (seq + 1) & _SEQ_MASK
        elif flags & _ACK and not direction.conversation.is_established:
            self._establish(ns, direction)
        if flags & _ACK:
            if self._is_detailed and offset > 0x50 and not flags & _SYN:
                _add_sack(direction.other, packet.data[at + 20 : begin])
            self._handle_ack(ns, direction.other, ack, size)
        if not flags & (_RST | _SYN):
            self._update_window(ns, direction, window)
            if self._is_detailed and not size and not flags & _FIN:
                self._report_event(ns, direction, SegmentKind.ACK, size=window)
            if self._is_detailed and size:
                self._detect_late_segment(ns, direction, seq, number)
        if not flags & _RST:
            direction.window = window
            direction.widest = direction.widest if flags & _SYN else max(direction.widest, window)
            ahead = distance(seq, direction.next) if direction.is_firm else 0
            direction.has_jumped |= abs(ahead) >= MOST_JUMP
            if ahead > -MOST_JUMP:  # else it is no copy of anything
                self._take_segment(ns, direction, seq, packet.data[begin:end], size, flags)
        elif direction.conversation.end is None or direction.conversation.end[0] == "fin":
            direction.conversation.is_ours = any(
                each.startswith(f"{OWN_PREFIX}rst") for each in packet.comments
            )
            self._estimate_unread(direction)
            self._report_event(ns, direction, SegmentKind.RST)
            direction.conversation.end = direction.conversation.end or ("rst", direction)
        if flags & (_ACK | _SYN):
            direction.told_ack = ack
        for one in (direction, direction.other):
            one.is_steady = one.allows_fast_path()

    def _is_copy(self, ns: int, number: int, packet: SegmentHead, direction: WireDirection) -> bool:
        before = self._recent.get(packet, self._before.get(packet))
        soon = COPY_NS if number else UNNUMBERED_NS
        if before is not None and 0 <= ns - before <= soon:
            return True
        if len(self._recent) == MOST_RECENT:
            self._recent, self._before = {}, self._recent
        self._recent[packet] = ns
        seq, size = packet[2], packet[5]
        at = direction.position + distance(seq, direction.next) + direction.has_fin
        for begin, data, then, of in islice(reversed(direction.kept or ()), MOST_COMPARED) if size else ():
            if begin <= at or ns - then > soon:
                return begin == at and len(data) == size and of == number and 0 <= ns - then <= soon
        return False

    def _add_fragment(self, packet: Packet, link_type: int, piece: Fragment) -> None:
        self.not_read[SkipReason.FRAGMENT] += 1
        whole = self._fragments.add(piece, packet.ns)
        if whole is None:
            return
        data, count = whole
        self.not_read[SkipReason.FRAGMENT] -= count
        self.not_read += Counter()  # drops the counts that are 0 now
        self._add_packet_slowly(packet._replace(data=data, length=len(data)), link_type)

    def _open_conversation(
        self, packet: Packet, link_type: int, key: bytes, found: IpPayload, name: str
    ) -> WireDirection | None:
        _, source, target, ports, _, _ = found
        ends = (source, int.from_bytes(ports[:2], "big")), (target, int.from_bytes(ports[2:], "big"))
        there = self._make_conversation(packet.ns, name, ends, read_macs(link_type, packet.data))
        if there is not None:
            there.conversation.sent = packet.sent
            self._flows[key] = there
            self._flows[_flow_key(name, *ends[::-1])] = there.other
        return there

    def _make_conversation(
        self, ns: int, protocol: str, ends: TwoEnds, macs: tuple[bytes, bytes]
    ) -> WireDirection | None:
        """Make a conversation; return its first direction, or None if too many exist or `is_tapped`."""
        if len(self.all) >= MOST_CONVERSATIONS or self.is_tapped:
            self.unlisted += 1
            return None
        self._count += 1
        made = Conversation(self._count, protocol, ns, ends, macs)
        self.all.append(made)
        return made.there

    def open_tapped(self, ns: int, talk: Conversation, wire: TwoEnds, is_new: bool) -> bool:
        """Add a conversation that a tap announces. Packets of this conversation will have the ends `wire`.

        If no SYN will come, a KEEP_ALIVE event announces `talk`. Return False above MOST_CONVERSATIONS.
        """
        if len(self.all) >= MOST_CONVERSATIONS:
            self.unlisted += 1
            return False
        keys = _flow_key(talk.protocol, *wire), _flow_key(talk.protocol, *wire[::-1])
        self._flows.update(zip(keys, (talk.there, talk.back), strict=True))
        self.all.append(talk)
        self.first_ns = self.first_ns or ns
        if not is_new or talk.protocol != "tcp":
            self._report_event(ns, talk.there, SegmentKind.KEEP_ALIVE)
        return True

    def _is_new_connection(self, direction: WireDirection, seq: int, flags: int) -> bool:
        conversation = direction.conversation
        if direction.syn == seq:  # a copy, unless all has ended: our recordings count from 0 each time
            return not flags & _ACK and conversation.is_established and conversation.end is not None
        if flags & _ACK:
            return direction.has_base and direction.is_firm
        if direction.syn is None and direction.other.syn is not None and not direction.is_firm:
            return direction.acked != (seq + 1) & _SEQ_MASK  # the capture may have its answer before it
        return direction.has_base or direction.other.has_base

    def _establish(self, ns: int, direction: WireDirection) -> None:
        listener = direction.conversation.listener
        if listener is not None and listener is not direction and listener.has_base:
            direction.conversation.is_established = True
            self._report_event(ns, direction, SegmentKind.ESTABLISHED)

    def _note_time(self, ns: int, direction: WireDirection) -> None:
        conversation = direction.conversation
        silence = ns - conversation.last_ns
        direction.last_ns = ns
        if silence > SILENCE_NS:
            self._report_event(ns, direction, SegmentKind.SILENCE, size=silence)
        conversation.goes_back |= silence < -REORDER_NS
        conversation.last_ns = max(ns, conversation.last_ns)

    def _take_datagram(self, ns: int, direction: WireDirection, data: bytes, size: int) -> None:
        self._note_time(ns, direction)
        direction.segments += 1
        at = direction.position
        direction.position += len(data)
        self._report_event(ns, direction, SegmentKind.BYTES, at, size, data)
        if size > len(data):
            direction.conversation.is_cut = True
            direction.cut += size - len(data)
            self._skip_missing(ns, direction, direction.position + size - len(data))

    def _handle_syn(self, ns: int, direction: WireDirection, seq: int, flags: int) -> None:
        conversation = direction.conversation
        if direction.syn == seq:
            end = conversation.end if not conversation.is_established else None
            is_refused = end == ("rst", direction.other)
            # Some stacks repeat a refused SYN with its number, also after their own RST of an old connection.
            conversation.end = None if end is not None and end[0] == "rst" else conversation.end
            self._report_event(ns, direction, SegmentKind.SYN if is_refused else SegmentKind.RETRANSMISSION)
            return
        direction.syn = seq
        direction.next = (seq + 1) & _SEQ_MASK
        direction.acked = direction.next
        direction.has_base = direction.is_firm = True
        conversation.begins_with_syn = True
        conversation.listener = direction if flags & _ACK else conversation.listener or direction.other
        self._report_event(ns, direction, SegmentKind.ANSWER if flags & _ACK else SegmentKind.SYN)

    def _update_window(self, ns: int, direction: WireDirection, window: int) -> None:
        if direction.is_closed_window != (not window):
            direction.is_closed_window = not window
            self._report_event(ns, direction, SegmentKind.WINDOW_OPENS if window else SegmentKind.ZERO_WINDOW)

    def _detect_late_segment(self, ns: int, direction: WireDirection, seq: int, number: int) -> None:
        if distance(seq, direction.next) > 0:
            direction.early_number = number
            return
        fills = seq == direction.next and direction.waiting and number and direction.early_number
        if fills and 0 < (number - direction.early_number) & 0xFFFF < 1 << 15:
            self._report_event(ns, direction, SegmentKind.LATE, direction.position)

    def _handle_ack(self, ns: int, direction: WireDirection, ack: int, size: int) -> None:
        """Take an ACK for bytes of this direction. The packet with the ACK carries `size` bytes."""
        if not direction.has_base:
            direction.next = direction.acked = ack  # a guess, until bytes come
            direction.has_base = True
            return
        if direction.was_probed and not size and ack == direction.next:
            direction.was_probed = False
            self._report_event(ns, direction.other, SegmentKind.KEEP_ALIVE_ACK)
        if distance(ack, direction.acked) > 0:
            direction.acked = ack
            if direction.segments:
                direction.is_heard = True
            beyond = distance(ack, direction.next)
            if beyond >= MOST_JUMP or beyond > FASTEST_BYTES + ns - direction.conversation.first_ns:
                direction.has_jumped = True
            if direction.probe and beyond == 1:
                probe, direction.probe = direction.probe, b""
                self._deliver(ns, direction, probe)  # the window was closed, the byte got in
            elif beyond <= 0:
                direction.waiting_since = None
            elif direction.waiting_since is None:
                direction.waiting_since = ns
        if not direction.is_firm and not direction.byte_count and distance(ack, direction.next) > 0:
            direction.next = ack

    def _take_segment(
        self, ns: int, direction: WireDirection, seq: int, payload: bytes, size: int, flags: int
    ) -> None:
        is_tapped = bool(direction.conversation.tap)
        if not direction.has_base or (not direction.is_firm and (size > 1 or is_tapped)):
            direction.next = seq
            direction.acked = direction.acked if direction.has_base else seq
            direction.has_base = True
            direction.waiting_since = None
        direction.is_firm = direction.is_firm or size > 0
        ahead = distance(seq, direction.next)
        if (
            ahead == -1
            and size <= 1
            and not flags & (_FIN | _SYN)
            and distance(direction.acked, direction.next) >= 0
        ):
            direction.was_probed = True
            self._report_event(ns, direction, SegmentKind.KEEP_ALIVE)
            return
        if size == 1 and not ahead and direction.other.is_closed_window and payload:
            direction.probe = payload
            self._report_event(ns, direction, SegmentKind.WINDOW_PROBE, direction.position, 1)
            return
        at = direction.position + ahead + direction.has_fin  # a FIN has a number, and is no byte
        if is_tapped and ahead > 0:
            self._skip_missing(ns, direction, at)
        if flags & _FIN and direction.fin is None:
            direction.fin = at + size
        if size:
            direction.segments += 1
            direction.largest = max(direction.largest, size)
            if direction.other.scale is not None and size > 1:  # 1: a probe of a closed window
                fly = (seq + size - direction.acked) & _SEQ_MASK
                room = direction.other.window << direction.other.scale
                direction.has_overrun |= LEAST_WINDOW <= room < fly < MOST_JUMP
            direction.probe = b""
            if direction.fin is not None and at + size > direction.fin:
                size = max(direction.fin - at, 0)
                payload = payload[:size]
            self._place_bytes(ns, direction, at, payload)
            if size > len(payload) and at + size > direction.position:  # cut by the capture's own limit
                direction.cut += size - len(payload)
                self._skip_missing(ns, direction, at + size)
        since = direction.waiting_since
        if since is not None and ns - since > PATIENCE_NS:
            self._give_up_waiting(ns, direction)
        self._handle_fin(ns, direction)

    def _handle_fin(self, ns: int, direction: WireDirection) -> None:
        if direction.fin is None or direction.has_fin or direction.position < direction.fin:
            return
        direction.has_fin = True
        direction.next = (direction.next + 1) & _SEQ_MASK
        self._estimate_unread(direction)
        self._report_event(ns, direction, SegmentKind.FIN, direction.position)
        conversation = direction.conversation
        conversation.end = conversation.end or ("fin", direction)

    def _estimate_unread(self, direction: WireDirection) -> None:
        other = direction.other
        waits = distance(other.next, other.acked) - other.has_fin if other.has_base else 0
        misses = direction.widest - direction.window
        direction.unread = max(waits, 0) + (0 if direction.scale is None else misses << direction.scale)

    # -- bytes -------------------------------------------------------------------------------------------

    def _place_bytes(self, ns: int, direction: WireDirection, at: int, data: bytes) -> None:
        """Put bytes into their place. Early bytes wait. No delivered or waiting byte changes (rule 1)."""
        old = direction.position - at
        if old > 0:
            self._compare_copy(ns, direction, at, data[:old])
            at, data = direction.position, data[old:]
        if data and at == direction.position and not direction.waiting:
            self._deliver(ns, direction, data)
            return
        first = max(bisect(direction.waiting, (at, b"")) - 1, 0)
        last = bisect(direction.waiting, (at + len(data), b""))
        for begin, other in direction.waiting[first:last] if data else ():
            if not data or begin >= at + len(data):
                break
            end = begin + len(other)
            if end <= at:
                continue
            if begin > at:
                self._queue_bytes(direction, at, data[: begin - at])
                at, data = begin, data[begin - at :]
            copy = data[: end - at]
            self._report_copy(ns, direction, at, copy, other[at - begin : at - begin + len(copy)])
            at, data = at + len(copy), data[len(copy) :]
        if data:
            self._queue_bytes(direction, at, data)
            if self._is_detailed:
                self._report_event(ns, direction, SegmentKind.EARLY, at, len(data))
        self._deliver_waiting(ns, direction)
        while direction.waiting and (
            direction.waiting_cost > MOST_WAITING
            or self._waiting_cost > MOST_WAITING_OF_ALL
            or len(direction.waiting) >= MOST_SEGMENTS_WAITING
        ):
            self._skip_missing(ns, direction, direction.waiting[0][0])

    def _queue_bytes(self, direction: WireDirection, at: int, data: bytes) -> None:
        insort(direction.waiting, (at, data))
        cost = len(data) + SEGMENT_COST
        direction.waiting_cost += cost
        self._waiting_cost += cost

    def _deliver_waiting(self, ns: int, direction: WireDirection) -> None:
        waiting = direction.waiting
        ready = 0
        while ready < len(waiting) and waiting[ready][0] <= direction.position:
            at, data = waiting[ready]
            ready += 1
            cost = len(data) + SEGMENT_COST
            direction.waiting_cost -= cost
            self._waiting_cost -= cost
            old = direction.position - at
            if old < len(data):
                self._deliver(ns, direction, data[old:])
        del waiting[:ready]
        if ready:
            direction.waiting_since = None

    def _give_up_waiting(self, ns: int, direction: WireDirection) -> None:
        direction.waiting_since = None
        left = distance(direction.acked, direction.next)
        if direction.waiting and left > 0:
            self._skip_missing(ns, direction, min(direction.waiting[0][0], direction.position + left))
        elif left > 1:
            self._skip_missing(ns, direction, direction.position + left)

    def _skip_missing(self, ns: int, direction: WireDirection, to: int) -> None:
        count = to - direction.position
        if count > 0:
            self._report_event(ns, direction, SegmentKind.MISSING, direction.position, count)
            direction.missing += count
            direction.position = to
            direction.next = (direction.next + count) & _SEQ_MASK
        self._deliver_waiting(ns, direction)
        self._handle_fin(ns, direction)

    def _deliver(self, ns: int, direction: WireDirection, data: bytes, number: int = 0) -> None:
        at, size = direction.position, len(data)
        direction.position = at + size
        direction.next = (direction.next + size) & _SEQ_MASK
        kept = direction.kept
        if kept is None:
            kept = direction.kept = deque()
        kept.append((at, data, ns, number))
        self._kept.append(kept)
        self._kept_cost += size + SEGMENT_COST
        most = MOST_KEPT_BYTES if self._kept_cost <= MOST_KEPT_BYTES else MOST_KEPT_BYTES * 3 // 4
        while self._kept_cost > most:
            self._kept_cost -= len(self._kept.popleft().popleft()[1]) + SEGMENT_COST
        if self._on_event is not None:
            self._report_event(ns, direction, SegmentKind.BYTES, at, size, data)

    def _compare_copy(self, ns: int, direction: WireDirection, at: int, data: bytes) -> None:
        first = bytearray(data)
        for begin, kept, _, _ in islice(reversed(direction.kept or ()), MOST_COMPARED):
            if begin + len(kept) <= at:
                break
            low, high = max(begin, at), min(begin + len(kept), at + len(data))
            if low < high:
                first[low - at : high - at] = kept[low - begin : high - begin]
        self._report_copy(ns, direction, at, data, bytes(first))

    def _report_copy(self, ns: int, direction: WireDirection, at: int, data: bytes, first: bytes) -> None:
        direction.retransmitted += len(data)
        self._report_event(ns, direction, SegmentKind.RETRANSMISSION, at, len(data))
        if data != first:
            self._report_event(ns, direction, SegmentKind.DIFFERENT_COPY, at, len(data), data)

    def _report_event(
        self,
        ns: int,
        direction: WireDirection,
        kind: SegmentKind,
        at: int = 0,
        size: int = 0,
        data: bytes = b"",
    ) -> None:
        if self._on_event is not None:
            self._on_event(ConversationEvent(ns, direction.conversation, direction, kind, at, size, data))


def _flow_key(protocol: str, source: tuple[bytes, int], target: tuple[bytes, int]) -> bytes:
    """Return the key of a direction in `_flows`. The packet methods build the same key in parts."""
    if protocol == "serial":
        return b"S%d" % source[1] + source[0]
    kind = b"U" if protocol == "udp" else b""
    ports = source[1].to_bytes(2, "big"), target[1].to_bytes(2, "big")
    return b"".join((kind, source[0], target[0], *ports))


def distance(one: int, other: int) -> int:
    """Return how far `one` is after `other`, modulo 2**32; negative if `one` is before `other`."""
    far = (one - other) & _SEQ_MASK
    return far - (_SEQ_MASK + 1) if far & _SEQ_HALF else far


def _add_sack(direction: WireDirection, options: bytes) -> None:
    for begin, end in sack_blocks(options):
        if begin in direction.sacked or len(direction.sacked) < MOST_SACKED:
            direction.sacked[begin] = end


def _is_challenge(direction: WireDirection, ack: int) -> bool:
    """Return whether an ACK that answers a SYN acknowledges an older connection (RFC 5961)."""
    caller = direction.other
    is_first = direction.syn is None and caller.syn is not None and not direction.conversation.is_established
    return is_first and not caller.segments and not direction.segments and ack != caller.next
