"""Collects typed facts with numbers in one pass over the conversations of a capture. It judges nothing.

Rule 1: a fact that a source cannot know, such as windows in our own recordings, is None and never a guess.
Rule 2: memory is bounded, for each conversation and for all. Bytes beyond the bound are only counted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from ipaddress import ip_address
from math import log
from typing import Final, NamedTuple

from trcvtui.capture.command import read_captures
from trcvtui.capture.hosts import HostFact
from trcvtui.capture.packets import SkipReason
from trcvtui.capture.plc_end import NO_KNOWN_ENDS, KnownEnds, PlcEnd, PlcGuess, address_text, guess_plc
from trcvtui.capture.quality import CaptureLimit, find_limits
from trcvtui.capture.reassembly import (
    MOST_JUMP,
    Conversation,
    ConversationEvent,
    Conversations,
    SegmentKind,
    WireDirection,
    distance,
)
from trcvtui.errors import Problem

MOST_WRITES: Final = 4096  # of one direction
MOST_WRITES_OF_ALL: Final = 400_000
MOST_CONTENT: Final = 64 << 10  # bytes of one direction
MOST_CONTENT_OF_ALL: Final = 48 << 20
MOST_MOMENTS: Final = 256  # of one kind and direction
WIRE_WINDOW: Final = 65_535  # the only window that our own recordings write
MOST_SHOWN: Final = 8  # packets of a finding
JOINED_NS: Final = 50_000_000  # after a full segment the rest follows so soon
LATE_NS: Final = 30_000_000, 260_000_000  # from and to: a delayed ACK
REORDERED_NS: Final = 3_000_000
SPURIOUS_NS: Final = 200_000_000  # a sender that waited so long for an ACK has not received it
OUTAGE_COPIES: Final = 2  # copies without an answer
# An ERROR belongs to the end of a connection if it shows from so long before it to so long after it.
HARM_BEFORE_NS: Final = 100_000_000
HARM_AFTER_NS: Final = 2_000_000_000
PAUSE_NS: Final = 4_000_000  # after it a message begins
FULL_SEGMENT: Final = 536  # bytes: a smaller segment is not full
LARGE_SEGMENT: Final = 1200  # a segment of most networks; a smaller one may be a message
SCANS_BETWEEN_JOBS: Final = 3  # at most, while bytes wait
MOST_PIECES: Final = 64  # of one message
PAUSE_JUMP: Final = 5.0  # times longer: pauses between messages, and inside them


class SegmentFacts(NamedTuple):
    """Bytes that came together, at byte `at` of their direction. `packet` is a number in the capture."""

    ns: int
    at: int
    size: int
    packet: int


NOWHERE: Final = SegmentFacts(0, 0, 0, 0)


class LineMessage(NamedTuple):
    """A message of `pieces` writes. `pause_ns` is the longest pause between two of these writes."""

    ns: int
    at: int
    size: int
    pieces: int
    pause_ns: int
    packet: int


class ClosedWindow(NamedTuple):
    """A zero window from `ns` to `until_ns`. If `until_ns` is None, the window stays zero to the end."""

    ns: int
    until_ns: int | None
    packet: int


class LateAck(NamedTuple):
    """A small write with a late ACK: the time to the ACK, and the time from the ACK to the next write."""

    write: SegmentFacts
    wait_ns: int
    after_ns: int


class Outage(NamedTuple):
    """`copies` retransmissions without an answer, from `ns` to `until_ns` (None: to the end)."""

    copies: int
    ns: int
    until_ns: int | None
    packet: int


class WireEnding(NamedTuple):
    """How a conversation ended, by `fin` or `rst`, and by whom. `is_reset`: by RST, or FIN and then RST."""

    kind: str
    by_plc: bool
    ns: int
    packet: int
    is_reset: bool
    is_ours: bool  # asked for at our tap


@dataclass(slots=True, eq=False)
class DirectionFacts:
    bytes: int = 0
    segments: int = 0
    cut: int = 0
    missing: int = 0
    writes: list[SegmentFacts] = field(default_factory=list)
    line_errors: Counter[str] = field(default_factory=Counter)  # of a serial line, as its driver reports them
    content: bytearray = field(default_factory=bytearray)  # from byte 0 to the first hole, bounded
    newest: SegmentFacts | None = None
    syns: list[SegmentFacts] = field(default_factory=list)
    resent: int = 0
    spurious: int = 0  # copies of acknowledged bytes, after a long wait for the ACK
    longest_wait_ns: int = 0  # from a segment to its copy
    is_heard: bool = False  # bytes of it were acknowledged
    has_jumped: bool = False  # its sequence numbers, further than possible
    is_reset_behind: bool = False  # its RST came right after its FIN
    late: int = 0  # holes that were filled later than a reordered packet would be
    early_ns: int | None = None
    resent_since_heard: int = 0  # copies since the other end was heard
    copies_since: SegmentFacts = NOWHERE
    moments: list[tuple[SegmentFacts, str]] = field(default_factory=list)  # of copies, early bytes, holes
    outages: list[Outage] = field(default_factory=list)  # times in which there were copies alone, no answer
    closed: list[ClosedWindow] = field(default_factory=list)  # its own window
    lowest_window: int | None = None
    highest_window: int = 0
    last_window: int = 0
    acks: int = 0
    keep_alives: int = 0
    keep_alives_answered: int = 0
    probes_open: int = 0  # since the other end was heard
    probes_since: SegmentFacts = NOWHERE
    challenges: int = 0  # ACKs of an old connection, in answer to a SYN
    again: SegmentFacts = NOWHERE  # the copied bytes, how often so far; `stuck`: the most
    again_often: int = 0
    stuck: SegmentFacts = NOWHERE
    stuck_often: int = 0
    sacked: tuple[tuple[int, int], ...] = ()  # bytes from and to: the other end has them after a hole
    acked_at: int = 0  # the other end has all bytes up to here
    slow: list[LateAck] = field(default_factory=list)
    late_ack: LateAck | None = None  # until the next write; `after_ns` is then its time
    last_ns: int = 0
    unacked: int = 0
    ended: SegmentFacts | None = None
    reset: SegmentFacts | None = None
    resets: int = 0

    def mark_moment(self, write: SegmentFacts, kind: str) -> None:
        if len(self.moments) < MOST_MOMENTS:
            self.moments.append((write, kind))

    def packets_of(self, *kinds: str) -> tuple[int, ...]:
        """Return the numbers of the first packets at which odd things of these kinds occurred."""
        found = dict.fromkeys(write.packet for write, kind in self.moments if kind in kinds)
        return tuple([*found][:MOST_SHOWN])

    def first_of(self, kind: str) -> SegmentFacts | None:
        """Return the first write at which an odd thing of this kind occurred, or None if there is none."""
        return next((write for write, known in self.moments if known == kind), None)


class RecordedReads(NamedTuple):
    """Reads in place of segments, in our own recordings. A read has at most the bytes its job lacks."""

    job: int
    interval_ns: int

    def may_cut(self, before: SegmentFacts, gap_ns: int) -> bool:
        """Return whether the end of a job, not a pause, separates a write from the next one."""
        return (before.at + before.size) % self.job == 0 and gap_ns <= SCANS_BETWEEN_JOBS * self.interval_ns


class IdleTime(NamedTuple):
    """A time without any packet: when it ended, how long it was, whose packet ended it."""

    until_ns: int
    size_ns: int
    packet: int


class LineFacts:
    """What is known of one conversation. `to_plc` is the direction from the partner to the PLC."""

    def __init__(self, talk: _ConversationFacts, guess: PlcGuess, first_ns: int, is_recording: bool) -> None:
        conversation = talk.conversation
        self.number, self.protocol = conversation.number, conversation.protocol
        self.guess = guess
        self.qualities: frozenset[CaptureLimit] = frozenset()
        self.harms: Sequence[int] | None = None  # ns (UTC) of ERRORs and lost jobs; None: not known
        self.since_ns, self.until_ns = 0, 1 << 62  # messages before and after are not judged
        self.connect: str | None = None  # of our own run; "": none, None: not known
        is_there = guess.says is conversation.there
        self.from_plc, self.to_plc = (talk.there, talk.back) if is_there else (talk.back, talk.there)
        self.plc_end, self.partner_end = guess.says.address, guess.says.other.address
        self.plc, self.partner = address_text(self.plc_end), address_text(self.partner_end)
        self.zero_ns, self.first_packet = first_ns, talk.first_packet
        self.first_ns, self.last_ns = conversation.first_ns, conversation.last_ns
        self.has_begin = conversation.begins_with_syn
        self.established_ns = talk.established_ns
        self.answered_ns = talk.answered_ns
        self.idles = talk.idles
        self.undelivered = conversation.undelivered
        self.doubled: HostFact | None = None  # the address of an end has two devices
        self.gone: frozenset[bytes] = frozenset()  # ends whose last ARP requests have no answer
        listener = conversation.listener
        self.plc_calls = None if listener is None else listener is not guess.says
        self.end: WireEnding | None = None
        if conversation.end is not None:
            kind, who = conversation.end
            flow = self.from_plc if who is guess.says else self.to_plc
            of_kind = flow.ended if kind == "fin" else flow.reset
            at = of_kind or SegmentFacts(self.last_ns, 0, 0, 0)
            is_reset = kind == "rst" or flow.is_reset_behind
            self.end = WireEnding(kind, who is guess.says, at.ns, at.packet, is_reset, conversation.is_ours)
        ways = (self.to_plc, self.from_plc)
        copies = any(way.resent or way.keep_alives or way.late for way in ways)
        windows = {way.lowest_window for way in ways} | {way.highest_window for way in ways}
        has_acks = any(way.acks > 1 for way in ways)  # one is the handshake's: recordings have that, too
        self.reads: RecordedReads | None = None  # of a static job, where these are the writes
        self.is_wire = not is_recording and (copies or has_acks or not windows <= {None, 0, WIRE_WINDOW})

    @property
    def caller(self) -> DirectionFacts:
        return self.from_plc if self.plc_calls else self.to_plc

    @property
    def listener(self) -> DirectionFacts:
        return self.to_plc if self.plc_calls else self.from_plc

    @property
    def is_built(self) -> bool:
        """Return whether the connection was established, or began before the capture."""
        return (
            self.established_ns is not None
            or self.answered_ns is not None
            or not self.has_begin
            or bool(self.to_plc.writes and self.from_plc.writes)
        )

    @property
    def lasted_ns(self) -> int:
        return self.last_ns - self.first_ns

    def make_filter(self, evidence: str, of_group: bool) -> str:
        """Return a Wireshark filter for the packets of a conversation that are evidence, or "" if none are.

        If `of_group`, the filter covers all conversations with the same listener.
        """
        if self.protocol == "serial" or evidence == "arp":
            return "" if self.protocol == "serial" else evidence
        ends, ip = (self.plc_end, self.partner_end), "ip" if len(self.plc_end[0]) == 4 else "ipv6"
        parts = [f"{ip}.addr == {text}" for text in dict.fromkeys(str(ip_address(each)) for each, _ in ends)]
        listener = self.partner_end if self.plc_calls else self.plc_end
        parts += [f"{self.protocol}.port == {port}" for _, port in ((listener,) if of_group else ends)]
        parts += [f"({evidence})" if "||" in evidence else evidence] if evidence else []
        return " && ".join(parts)

    def has_harm_at(self, ns: int) -> bool:
        """Return whether a block showed an ERROR or lost a job near `ns`, and True if that is unknown."""
        return self.harms is None or any(-HARM_BEFORE_NS <= one - ns <= HARM_AFTER_NS for one in self.harms)

    def to_seconds(self, ns: int) -> float:
        """Return a time as seconds from the first packet of the capture."""
        return round((ns - self.zero_ns) / 1e9, 6)

    @cached_property
    def messages(self) -> tuple[LineMessage, ...]:
        """Return the messages to the PLC; a pause or bytes from the PLC separate two messages."""
        writes = [one for one in self.to_plc.writes if self.since_ns <= one.ns < self.until_ns]
        return _messages(writes, self.from_plc.writes, self.protocol == "udp", self.reads)

    @cached_property
    def answers(self) -> tuple[LineMessage, ...]:
        return _messages(self.from_plc.writes, self.to_plc.writes, self.protocol == "udp")


class CaptureFacts(NamedTuple):
    """The conversations of one capture, what could not be read, the hosts, and when it ended."""

    lines: tuple[LineFacts, ...]
    found: Conversations
    troubles: tuple[Problem, ...]
    last_ns: int
    hosts: tuple[HostFact, ...] = ()


@dataclass(slots=True, eq=False)
class _ConversationFacts:
    conversation: Conversation
    first_packet: int = 0
    there: DirectionFacts = field(default_factory=DirectionFacts)
    back: DirectionFacts = field(default_factory=DirectionFacts)
    answered_ns: int | None = None
    established_ns: int | None = None
    idles: list[IdleTime] = field(default_factory=list)


class _Collector:
    def __init__(self) -> None:
        self.talks: list[_ConversationFacts] = []
        self.found = Conversations(self._add_event, is_detailed=True)
        self._writes = self._content = 0

    def _add_event(self, event: ConversationEvent) -> None:
        ns, conversation, direction, kind, at, size, data = event
        number = conversation.number - 1
        while number >= len(self.talks):
            self.talks.append(_ConversationFacts(self.found.all[len(self.talks)], self.found.packets))
        talk = self.talks[number]
        there = direction is conversation.there
        own, other = (talk.there, talk.back) if there else (talk.back, talk.there)
        if kind is SegmentKind.BYTES:
            self._add_bytes(own, other, ns, at, size, data)
        elif kind is SegmentKind.ACK:
            self._add_ack(own, other, ns, size)
        elif kind is SegmentKind.LINE_ERROR:
            own.line_errors[data.decode()] += 1
            own.mark_moment(SegmentFacts(ns, at, size, self.found.packets), "line error")
        else:
            self._add_rare(talk, direction, own, other, kind, SegmentFacts(ns, at, size, self.found.packets))
        is_said = kind is not SegmentKind.MISSING or conversation.is_cut
        if is_said and kind is not SegmentKind.SILENCE:
            own.last_ns = ns
            if other.probes_open and other.reset is None:
                other.probes_open = 0
            if other.resent_since_heard:
                _end_outage(other, ns)

    def _add_bytes(
        self, own: DirectionFacts, other: DirectionFacts, ns: int, at: int, size: int, data: bytes
    ) -> None:
        own.segments += 1
        own.bytes += size
        if own.early_ns is not None:
            own.late += ns - own.early_ns > REORDERED_NS
            own.early_ns = None
        content = own.content
        if len(content) == at and at < MOST_CONTENT and self._content < MOST_CONTENT_OF_ALL:
            content += data
            self._content += size
        own.newest = SegmentFacts(ns, at, size, self.found.packets)
        if len(own.writes) < MOST_WRITES and self._writes < MOST_WRITES_OF_ALL:
            self._writes += 1
            own.writes.append(own.newest)
        late = own.late_ack
        if late is not None:
            own.late_ack = None
            if len(own.slow) < MOST_MOMENTS:
                own.slow.append(late._replace(after_ns=ns - late.after_ns))

    def _add_ack(self, own: DirectionFacts, other: DirectionFacts, ns: int, window: int) -> None:
        own.acks += 1
        own.last_window = window
        own.highest_window = max(own.highest_window, window)
        own.lowest_window = window if own.lowest_window is None else min(own.lowest_window, window)
        last = other.newest
        if last is not None:
            wait = ns - last.ns
            if LATE_NS[0] <= wait <= LATE_NS[1] and last.size < FULL_SEGMENT and other.late_ack is None:
                other.late_ack = LateAck(last, wait, ns)

    def _add_rare(
        self, talk: _ConversationFacts, direction: WireDirection, own: DirectionFacts, other: DirectionFacts,
        kind: SegmentKind, at: SegmentFacts,
    ) -> None:  # fmt: skip
        match kind:
            case SegmentKind.MISSING:
                self._add_hole(own, at, direction)
            case SegmentKind.RETRANSMISSION if at.size:
                self._add_copy(own, at, direction)
            case SegmentKind.SYN | SegmentKind.RETRANSMISSION:
                own.syns.append(at)
            case SegmentKind.ANSWER:
                talk.answered_ns = talk.answered_ns or at.ns
            case SegmentKind.ESTABLISHED:
                talk.established_ns = talk.established_ns or at.ns
            case SegmentKind.CHALLENGE:
                own.challenges += 1
            case SegmentKind.FIN:
                own.ended = own.ended or at
            case SegmentKind.RST:
                own.reset = own.reset or at
                own.resets += 1
                own.is_reset_behind |= own.ended is not None and other.last_ns < own.ended.ns
            case SegmentKind.KEEP_ALIVE:
                own.keep_alives += 1
                own.probes_open += 1
                own.probes_since = at if own.probes_open == 1 else own.probes_since
            case SegmentKind.KEEP_ALIVE_ACK:
                other.keep_alives_answered += 1
            case SegmentKind.ZERO_WINDOW if len(own.closed) < MOST_MOMENTS:
                own.closed.append(ClosedWindow(at.ns, None, at.packet))
            case SegmentKind.WINDOW_OPENS if own.closed and own.closed[-1].until_ns is None:
                own.closed[-1] = own.closed[-1]._replace(until_ns=at.ns)
            case SegmentKind.EARLY:
                own.early_ns = own.early_ns or at.ns
                own.mark_moment(at, "early")
            case SegmentKind.LATE:
                own.late += 1
                own.early_ns = None
                own.mark_moment(at, "resent")
            case SegmentKind.SILENCE if len(talk.idles) < MOST_MOMENTS:
                talk.idles.append(IdleTime(at.ns, at.size, at.packet))

    def _add_copy(self, own: DirectionFacts, at: SegmentFacts, direction: WireDirection) -> None:
        waits = [at.ns - one.ns for one in own.writes[-64:] if one.at <= at.at < one.at + one.size]
        wait = max(waits, default=0)
        # Already acknowledged: the ACK was late or lost, not the bytes.
        if at.at + at.size <= direction.position - distance(direction.next, direction.acked):
            if wait >= SPURIOUS_NS:
                own.spurious += 1
                own.mark_moment(at, "spurious")
            return
        is_same = (own.again.at, own.again.size) == (at.at, at.size)
        own.again, own.again_often = at, own.again_often + 1 if is_same else 1
        if own.again_often > own.stuck_often:
            own.stuck, own.stuck_often = at, own.again_often
        own.longest_wait_ns = max(own.longest_wait_ns, wait)
        own.resent += 1
        own.resent_since_heard += 1
        if own.resent_since_heard == 1:
            own.copies_since = at
        own.mark_moment(at, "resent")

    def _add_hole(self, own: DirectionFacts, at: SegmentFacts, direction: WireDirection) -> None:
        own.early_ns = None  # bytes after a hole did not come late
        cut, own.cut = direction.cut - own.cut, direction.cut
        if cut == at.size:  # snaplen: the capture has only the first bytes of each packet
            last = own.writes[-1] if own.writes else None
            own.bytes += cut
            if last is not None and last.packet == at.packet and last.at + last.size == at.at:
                own.writes[-1] = last._replace(size=last.size + cut)
            elif len(own.writes) < MOST_WRITES and self._writes < MOST_WRITES_OF_ALL:
                self._writes += 1
                own.segments += 1
                own.writes.append(at)
            return
        own.missing += at.size
        own.mark_moment(at, "missing")


def _end_outage(flow: DirectionFacts, ns: int | None) -> None:
    """End an outage at `ns`, when the other end is heard again (None: never)."""
    if flow.resent_since_heard >= OUTAGE_COPIES and len(flow.outages) < MOST_MOMENTS:
        since = flow.copies_since
        flow.outages.append(Outage(flow.resent_since_heard, since.ns, ns, since.packet))
    flow.resent_since_heard = 0


def make_line_of_writes(protocol: str, writes: Sequence[SegmentFacts], content: bytes) -> LineFacts:
    """Return an established line on which the partner sends these bytes and nothing else happens."""
    conversation = Conversation(1, protocol, 0, ((bytes(4), 0), (bytes(4), 1)))
    conversation.mark_established()
    conversation.last_ns = writes[-1].ns if writes else 0
    talk = _ConversationFacts(conversation)
    talk.established_ns = 0
    flow = talk.there
    flow.writes, flow.content = list(writes), bytearray(content)
    flow.segments, flow.bytes = len(writes), len(content)
    return LineFacts(talk, PlcGuess(conversation.back, 1.0, "project"), 0, True)


def collect_facts(
    paths: Sequence[str],
    given: PlcEnd | None = None,
    known: KnownEnds = NO_KNOWN_ENDS,
    receives: bool = False,
    until_ns: int = 0,
) -> CaptureFacts:
    """Return the facts of one capture; `given` and `known` decide which end of a conversation is the PLC.

    If `receives`, the PLC is known to receive. So when only one end sends, the PLC is the other end.
    The capture ends at `until_ns`, and a conversation without an end is silent until this time.
    """
    collector, troubles = _Collector(), list[Problem]()
    found = collector.found
    read_captures(paths, found, troubles)
    first_ns = found.first_ns or 0
    is_recording = SkipReason.JOURNAL in found.not_read
    last_ns = max(until_ns, first_ns, *(each.last_ns for each in found.all))
    while len(collector.talks) < len(found.all):
        collector.talks.append(_ConversationFacts(found.all[len(collector.talks)]))
    lines, hosts = [], tuple(found.host_facts())
    doubled = {one.ends[0]: one for one in hosts if one.cause == "duplicate-ip"}
    gone = frozenset(one.ends[0] for one in hosts if one.cause == "no-such-host")
    for talk in collector.talks:
        conversation = talk.conversation
        guess = guess_plc(conversation, given, known)
        says = [one for one in (conversation.there, conversation.back) if one.byte_count]
        if receives and guess.confidence < 0.8 and len(says) == 1 and guess.says is says[0]:  # the partner
            guess = PlcGuess(says[0].other, 0.65, "it receives alone")
        for facts, direction in ((talk.there, conversation.there), (talk.back, conversation.back)):
            left = (direction.next - direction.acked) & 0xFFFFFFFF
            _end_outage(facts, None)
            facts.unacked = left if left < MOST_JUMP and direction.has_base else 0
            facts.acked_at = direction.position - facts.unacked
            base = direction.position, direction.next
            facts.sacked = tuple([(_index(a, *base), _index(b, *base)) for a, b in direction.sacked.items()])
            facts.is_heard, facts.has_jumped = direction.is_heard, direction.has_jumped
        lines.append(LineFacts(talk, guess, first_ns, is_recording))
        lines[-1].qualities = frozenset(find_limits(conversation, found.drops))
        lines[-1].connect = known.find_connect(guess.says) if known.connects else None
        ends = {lines[-1].plc_end[0], lines[-1].partner_end[0]}
        lines[-1].doubled = next((doubled[end] for end in ends if end in doubled), None)
        lines[-1].gone = gone & ends
        if conversation.end is None:
            lines[-1].last_ns = max(conversation.last_ns, until_ns)
    if not is_recording and any(line.is_wire for line in lines):  # one wire conversation: all are
        for line in lines:
            line.is_wire = True
    return CaptureFacts(tuple(lines), found, tuple(troubles), last_ns, hosts)


def _index(seq: int, position: int, following: int) -> int:
    return position + distance(seq, following)


# -- messages ------------------------------------------------------------------------------------------------


def _messages(
    writes: Sequence[SegmentFacts],
    others: Sequence[SegmentFacts],
    is_datagram: bool,
    reads: RecordedReads | None = None,
) -> tuple[LineMessage, ...]:
    if is_datagram or len(writes) < 2:
        return tuple([LineMessage(w.ns, w.at, w.size, 1, 0, w.packet) for w in writes])
    most = max(write.size for write in writes)
    turns, place = [False] * len(writes), 0
    for number, write in enumerate(writes):
        while place < len(others) and others[place].ns <= write.ns:
            turns[number] = turns[number] or others[place].ns > writes[number - 1].ns
            place += 1
    gaps = [
        writes[n].ns - writes[n - 1].ns
        for n in range(1, len(writes))
        if not turns[n] and writes[n].at == writes[n - 1].at + writes[n - 1].size
    ]
    limit = _find_pause_limit(gaps, 7)
    if limit:
        return _join_writes(writes, turns, most, limit, reads)
    found, pieces = _join_writes(writes, turns, most, 0, reads), _find_pause_limit(gaps, MOST_PIECES)
    joined = _join_writes(writes, turns, most, pieces, reads) if pieces else found
    sizes = [one.size for one in joined[:-1]]
    often = Counter(sizes).most_common(1)
    return joined if often and often[0][1] * 10 >= 9 * len(sizes) >= 40 else found


def _join_writes(
    writes: Sequence[SegmentFacts], turns: Sequence[bool], most: int, limit: int, reads: RecordedReads | None
) -> tuple[LineMessage, ...]:
    """Return the writes as messages. A write within `limit` ns of the last write continues its message."""
    found: list[LineMessage] = []
    for number, write in enumerate(writes):
        before = writes[number - 1]
        gap = write.ns - before.ns
        is_full = fills_segment(before.size, most, gap)
        continues = number and not turns[number] and write.at == before.at + before.size
        is_cut = reads is not None and reads.may_cut(before, gap)
        if continues and (is_full or is_cut or gap < limit):
            last = found[-1]
            found[-1] = last._replace(
                size=last.size + write.size, pieces=last.pieces + 1, pause_ns=max(last.pause_ns, gap)
            )
        else:
            found.append(LineMessage(write.ns, write.at, write.size, 1, 0, write.packet))
    return tuple(found)


def fills_segment(size: int, largest: int, gap_ns: int) -> bool:
    """Return whether a write fills a segment, and the next write comes soon enough to continue it."""
    soon_ns = JOINED_NS if largest >= LARGE_SEGMENT else JOINED_NS // 25
    return size == largest >= FULL_SEGMENT and gap_ns < soon_ns


def _find_pause_limit(gaps: Sequence[int], share: int) -> int:
    """Return the shortest pause between messages in ns, or 0 if all pauses are of one kind.

    A pause is inside a message or between two messages. Each kind is at least 1/`share` of all pauses.
    """
    ordered = sorted(max(gap, 1000) for gap in gaps)
    low = max(2, len(ordered) // share)
    if len(ordered) < 2 * low:
        return 0
    jumps = [
        (log(ordered[n] / ordered[n - 1]), n)
        for n in range(low, len(ordered) - low + 1)
        if n < len(ordered) and ordered[n - 1] < 2_000_000_000
    ]
    best = max(jumps, default=(0.0, 0))
    return ordered[best[1]] if best[0] > log(PAUSE_JUMP) else 0
