"""The rules of the doctor, one row for each cause: its proof, its remedy, and the causes that silence it.

Rule 1: a judge that lacks a fact returns None. A conversation is healthy if no rule returns a finding.
Rule 2: a cause silences the causes that it explains: a storm is one finding, not ten resets.
"""

from __future__ import annotations

from bisect import bisect
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from statistics import median
from typing import Final, NamedTuple

from msgspec.structs import replace

from trcvtui.capture.quality import CaptureLimit
from trcvtui.diagnosis.frame_causes import FEW_MESSAGES, FRAME_RULES, speaks_session
from trcvtui.diagnosis.host_causes import DOUBLE_EFFECTS, judge_icmp_reports, judge_mtu, make_host_finding
from trcvtui.diagnosis.line_facts import (
    MOST_SHOWN,
    ClosedWindow,
    DirectionFacts,
    LateAck,
    LineFacts,
    RecordedReads,
    SegmentFacts,
)
from trcvtui.diagnosis.receiver import LOOPBACK, Receiver
from trcvtui.diagnosis.remedies import CauseRule, RemedyOffer
from trcvtui.diagnosis.restarts import find_half_open, judge_half_open
from trcvtui.diagnosis.session_causes import TPKT, is_http, judge_serial_errors, judge_tls, judge_wrong_tsap
from trcvtui.snapshots.doctor import Finding, Remedy
from trcvtui.wording import SECOND, count, format_ns, times

UNANSWERED_NS: Final = 3 * SECOND  # then a SYN has no answer
IDLE_NS: Final = 20 * SECOND
CLOSED_NS: Final = SECOND  # of a zero window
AT_ONCE_NS: Final = 2 * SECOND
AFTER_ACK_NS: Final = 1_500_000  # a write that waited for an ACK leaves so soon after it
NEAR_NS: Final = 30_000_000
SHORT_LIFE_NS: Final = 30 * SECOND
STORM: Final = 4  # connections
RECONNECT_NS: Final = 10 * SECOND  # within it the same ends build a new connection
PROVEN: Final = 0.95  # a fact of the protocol, or a remedy that was tried
UNTRIED_CONFIDENCE: Final = 0.85
MOST_AROUND: Final = 64  # conversations that one is compared with


class LineGroup:
    """The conversations between the same two ends, in the order of time."""

    def __init__(self, lines: tuple[LineFacts, ...], restarts: Mapping[LineFacts, LineFacts] = {}) -> None:
        self.lines = lines
        self.restarts = restarts  # of half-open connections: each with the call that proves it

    @cached_property
    def built(self) -> tuple[LineFacts, ...]:
        """Return the conversations whose SYN and its answer are both in the capture."""
        return tuple([one for one in self.lines if one.has_begin and one.answered_ns is not None])

    @cached_property
    def ended_lines(self) -> tuple[LineFacts, ...]:
        return tuple([one for one in self.built if one.end is not None])

    @cached_property
    def one_message_lines(self) -> tuple[LineFacts, ...]:
        return tuple([one for one in self.ended_lines if _is_one_message(one)])

    @cached_property
    def sequential_lines(self) -> tuple[LineFacts, ...]:
        """Return built conversations; each begins after the one before it in the result has ended."""
        found: list[LineFacts] = []
        for one in self.built:
            if not found or found[-1].last_ns <= one.first_ns:
                found.append(one)
        return tuple(found)

    @cached_property
    def harmful_end_count(self) -> int:
        """Return how many unrequested ends harmed a block; an end with unknown harm counts."""
        ends = [(one, one.end) for one in self.ended_lines if one.end is not None and not one.end.is_ours]
        return sum(one.has_harm_at(end.ns) and not (one.connect and end.by_plc) for one, end in ends)

    @cached_property
    def has_recovered(self) -> bool:
        """Return whether one of the conversations is open, and has been for ten seconds."""
        return any(one.is_built and one.end is None and one.lasted_ns >= RECONNECT_NS for one in self.lines)

    @cached_property
    def half_open_count(self) -> int:
        return sum(one in self.restarts for one in self.built)

    @cached_property
    def restart_calls(self) -> frozenset[LineFacts]:
        return frozenset(self.restarts[one] for one in self.lines if one in self.restarts)

    @cached_property
    def is_still_sending(self) -> bool:
        return any(
            one.is_built and one.end is None and len(one.messages) >= FEW_MESSAGES for one in self.lines
        )

    @cached_property
    def has_built_line(self) -> bool:
        return any(one.is_built for one in self.lines)

    @cached_property
    def ordinary_end_count(self) -> int:
        """Count the conversations that the caller ended after both sent and the caller acknowledged all."""
        return sum(1 for one in self.ended_lines if _has_ordinary_end(one))

    @cached_property
    def turned_away_count(self) -> int:
        return sum(map(_is_turned_away, self.ended_lines))

    @cached_property
    def refusal_count(self) -> int:
        return sum(one.listener.resets for one in self.lines if not one.is_built)

    @cached_property
    def plc_end_and_reset_counts(self) -> tuple[int, int]:
        """Return how many conversations the PLC end ended, and how many either end ended by RST."""
        ends = [one.end for one in self.ended_lines if one.end is not None]
        return sum(1 for end in ends if end.by_plc), sum(1 for end in ends if end.kind == "rst")

    @cached_property
    def life_and_period_ns(self) -> tuple[int, int]:
        """Return the median life of a connection, and the median time between two begins."""
        life = int(median(one.lasted_ns for one in self.ended_lines))
        return life, int(median(b.first_ns - a.first_ns for a, b in pairwise(self.built)))


class LineCase(NamedTuple):
    """A conversation. `group` has all conversations of its ends, `older` earlier calls to its listener."""

    line: LineFacts
    group: LineGroup
    older: tuple[LineFacts, ...]
    reverse: LineGroup  # the other end calls
    receiver: Receiver | None
    receivers: tuple[Receiver, ...]
    last_ns: int
    is_foreign: bool = False  # of another program: it has no port of the project


# -- building a connection -----------------------------------------------------------------------------------


def _is_tcp(case: LineCase) -> bool:
    return case.line.protocol == "tcp"


def _judge_refused(case: LineCase) -> Finding | None:
    line = case.line
    reset = line.listener.reset
    by_icmp = judge_icmp_reports(line, case.receivers, "port")
    if by_icmp is not None:
        return by_icmp
    if not _is_tcp(case) or not line.has_begin or line.is_built or reset is None or not line.caller.syns:
        return None
    if line in case.group.restart_calls:
        return None  # half-open: the RST is the old connection's, not a closed port's
    side = "the partner" if line.plc_calls else "the PLC end"
    text = f"{side} answers SYN with RST: nothing listens on port {_listener_end(line)[1]}"
    texts = (text, f"seen {times(case.group.refusal_count)} in this capture")
    return Finding(0.97, texts, "to-plc" if line.plc_calls else "from-plc", reset, is_fact=True)


def _is_turned_away(line: LineFacts) -> bool:
    end, begun = line.end, line.established_ns or line.answered_ns
    is_silent = not line.to_plc.bytes and not line.from_plc.bytes
    is_theirs = end is not None and bool(line.plc_calls) and not end.by_plc
    return is_theirs and is_silent and begun is not None and end is not None and end.ns - begun < AT_ONCE_NS


def _judge_turned_away(case: LineCase) -> Finding | None:
    line, end, often = case.line, case.line.end, case.group.turned_away_count
    if end is None or not _is_tcp(case) or not _is_turned_away(line):
        return None
    is_needed = line.has_harm_at(end.ns) and (case.receiver is not None or line.harms)
    # One RST or three FINs if the end may have harmed a known receiver or job, else four of either.
    if often < (STORM if not is_needed else 1 if end.kind == "rst" else FEW_MESSAGES):
        return None
    text = f"the partner listens, accepts the call and ends it with {end.kind.upper()} before any byte"
    at = SegmentFacts(end.ns, 0, 0, end.packet)
    return Finding(0.95 if often > 2 else 0.85, (text, f"seen {times(often)} in this capture"), "to-plc", at)


def _judge_filtered(case: LineCase) -> Finding | None:
    line, syns = case.line, case.line.caller.syns
    by_icmp = judge_icmp_reports(line, case.receivers, "host", "admin")
    if by_icmp is not None:
        return by_icmp
    if not _is_tcp(case) or not line.has_begin or line.is_built or line.end is not None or not syns:
        return None
    if line.listener.segments or line.listener.acks or line.caller.segments:
        return None  # an end answered: nothing filters
    waited = case.last_ns - syns[0].ns
    if waited < SECOND or (len(syns) < 2 and waited < UNANSWERED_NS):
        return None  # the answer may still come
    text = f"{count(len(syns), 'SYN')} to port {_listener_end(line)[1]}, no answer in {format_ns(waited)}"
    before = next((one for one in reversed(case.older) if one.partner_end[0] == line.partner_end[0]), None)
    if before is not None and _find_outage(before):  # the partner may be off: less sure
        return Finding(0.6, (text, "an earlier connection to the same partner died"), _listener_way(line))
    return Finding(0.95 if len(syns) > 2 else 0.85, (text,), way=_listener_way(line), at=syns[0])


def _judge_second_client(case: LineCase) -> Finding | None:
    line = case.line
    if not _is_tcp(case) or not line.has_begin or line.plc_calls:
        return None
    older = [one for one in case.older if _is_alive_at(one, line.first_ns)]
    if not older:
        return None
    first = older[0]
    since = f"the PLC end had already served {first.partner} for {format_ns(line.first_ns - first.first_ns)}"
    if not line.is_built:
        reset = line.listener.reset
        if reset is not None:
            return Finding(0.93, (since, "it answered this client with RST"), way="from-plc", at=reset)
        if _judge_filtered(case) is not None:
            text = f"{count(len(line.caller.syns), 'SYN')} of this client without an answer"
            return Finding(0.85, (since, text), "to-plc")
        return None
    ended = line.end
    if ended is not None and ended.by_plc and not line.from_plc.segments:
        begun = line.established_ns or line.answered_ns or line.first_ns
        at_once = ended.ns - max(begun, line.to_plc.writes[0].ns if line.to_plc.writes else 0) < AT_ONCE_NS
        if at_once or ended.kind == "rst":
            word = "RST" if ended.kind == "rst" else "FIN"
            text = f"it sent this client no byte, only {word} after {format_ns(ended.ns - begun)}"
            return Finding(0.93, (since, text), way="from-plc", at=SegmentFacts(ended.ns, 0, 0, ended.packet))
    segments = line.to_plc.segments
    still = min(first.last_ns, line.last_ns if ended is not None else first.last_ns) - line.first_ns
    if not segments and not line.from_plc.segments and still >= UNANSWERED_NS:
        text = f"this client's connection has had no byte for {format_ns(still)}"
        return Finding(0.75 if ended is None else 0.6, (since, text), way="to-plc")
    has_answers = len(first.from_plc.writes) > 2 and not line.from_plc.segments
    if has_answers and segments and line.lasted_ns >= UNANSWERED_NS:
        text = f"{count(segments, 'segment')} of this client in {format_ns(line.lasted_ns)}, and no answer"
        return Finding(0.7, (since, text), way="to-plc")
    return None


def _judge_address(case: LineCase) -> Finding | None:
    line = case.line
    if not _is_tcp(case) or not line.has_begin:
        return None
    was_built = case.group.has_built_line or case.reverse.has_built_line
    if not line.is_built and case.reverse.lines and not was_built:
        texts = ("both ends call each other, and neither listens: both are active",)
        return Finding(0.93, texts, at=next(iter(line.caller.syns), None))
    receiver = case.receiver
    is_sure = receiver is not None and receiver.connect != "" and line.guess.confidence >= 0.8
    if receiver is not None and is_sure and line.plc_calls is not None and receiver.active != line.plc_calls:
        role = "active" if receiver.active else "passive"
        side = "the PLC end" if line.plc_calls else "the partner"
        text = f"{receiver.connect} is {role} in the project, but {side} calls"
        return Finding(0.85, (text,), instance=receiver.instance)
    if receiver is None and case.receivers and not line.plc_calls and not line.is_built:
        ports = sorted({one.local_port for one in case.receivers if not one.active and one.local_port})
        if ports and line.plc_end[1] not in ports and _judge_refused(case) is not None:
            text = f"the partner calls port {line.plc_end[1]}, but the project listens on {ports[0]}"
            return Finding(0.98, (text,), way="to-plc")
    return None


# -- a connection that ends ----------------------------------------------------------------------------------


def _is_one_message(line: LineFacts) -> bool:
    end = line.end
    return (
        end is not None
        and not end.by_plc
        and end.kind == "fin"
        and (len(line.messages) == 1 or _is_short_burst(line.to_plc.writes))
        and len(line.answers) <= 1
        and (line.has_begin or len(line.to_plc.writes) == 1)
        and end.ns - line.messages[0].ns < 5 * SECOND
    )


def _is_short_burst(writes: Sequence[SegmentFacts]) -> bool:
    return 0 < len(writes) <= 3 and writes[-1].ns - writes[0].ns < AT_ONCE_NS // 40


def _judge_closes(case: LineCase) -> Finding | None:
    if not _is_tcp(case) or not case.line.is_built:
        return None
    ended, alike, built = case.group.ended_lines, case.group.one_message_lines, len(case.group.built)
    if len(alike) < 2 or len(alike) < 0.7 * built - 1 or len(alike) < 0.7 * len(ended):
        return None
    sure = 0.95 if len(alike) > 3 else 0.85 if len(alike) > 2 else 0.7
    end = alike[0].end
    texts = (f"the partner ended {len(alike)} of {count(built, 'connection')} after one message",)
    at = SegmentFacts(end.ns, 0, 0, end.packet) if end is not None else None
    return Finding(sure, texts, way="to-plc", at=at)


def _has_ordinary_end(line: LineFacts) -> bool:
    end = line.end
    is_caller = end is not None and end.by_plc == bool(line.plc_calls)
    return is_caller and bool(line.to_plc.bytes and line.from_plc.bytes) and not line.listener.unacked


def _judge_storm(case: LineCase) -> Finding | None:
    if not _is_tcp(case) or not case.line.is_built:
        return None
    built, ended = case.group.sequential_lines, case.group.ended_lines
    if len(built) < STORM or len(ended) < len(case.group.built) - 1 or _judge_closes(case) is not None:
        return None
    if case.receiver is None and case.group.ordinary_end_count * 2 >= len(ended):
        return None  # short sessions that their caller ended
    if case.group.harmful_end_count * 2 <= len(ended) or case.group.half_open_count * 2 >= len(built):
        return None
    life, period = case.group.life_and_period_ns
    most = 10 * SHORT_LIFE_NS if len(built) > 7 else SHORT_LIFE_NS if len(built) > 5 else SHORT_LIFE_NS // 2
    if life > most or period > 2 * most:
        return None  # too slow for a storm
    by_plc, resets = case.group.plc_end_and_reset_counts
    ends = f"the PLC end ended {by_plc} of them, the partner {len(ended) - by_plc}"
    texts = (
        f"{count(len(built), 'connection')} built, one every {format_ns(period)}; {len(ended)} lost again",
        f"{ends}; {resets} ended by RST; a connection usually lasted {format_ns(life)}",
    )
    at = SegmentFacts(built[0].first_ns, 0, 0, 0)
    packets = tuple([one.first_packet for one in built[:MOST_SHOWN]])
    share = by_plc / len(ended)
    by = "the PLC end" if share >= 0.9 else "the partner" if share <= 0.1 else ""
    mend = (Remedy(f"find out why {by} closes the connections"),) if by else ()
    return Finding(0.95 if len(built) > 5 else 0.88, texts, at=at, packets=packets, mend=mend)


def _judge_resets(case: LineCase) -> Finding | None:
    line, end = case.line, case.line.end
    if end is None or not end.is_reset or not line.is_built or not _is_tcp(case):
        return None
    side, other = ("the PLC end", "the partner") if end.by_plc else ("the partner", "the PLC end")
    lost = line.to_plc if end.by_plc else line.from_plc
    size = line.to_plc.bytes + line.from_plc.bytes
    text = f"RST from {side} at {line.to_seconds(end.ns):.3f} s, after {count(size, 'byte')} of both ends"
    way = "from-plc" if end.by_plc else "to-plc"
    at = SegmentFacts(end.ns, line.to_plc.bytes, 0, end.packet)

    def finding(confidence: float, *texts: str, is_remark: bool = False) -> Finding:
        return Finding(confidence, (text, *texts), way=way, at=at, is_remark=is_remark)

    later = [one.first_ns for one in case.group.lines[-MOST_AROUND:] if one.first_ns > line.first_ns]
    if end.is_ours or (end.by_plc and line.connect is not None):
        return finding(0.0, "it was requested here", is_remark=True)
    if (line.from_plc if end.by_plc else line.to_plc).probes_open:
        return finding(0.0, "this end gave up: its keep-alive probe had no answer", is_remark=True)
    if not line.has_harm_at(end.ns):
        return finding(0.0, "no block lost anything by this RST", is_remark=True)
    part = _describe_partial_job(line, case.receiver) or _describe_partial_frame(line)
    if part:
        return finding(0.96, part)
    if CaptureLimit.NO_LIFE in line.qualities:
        is_new = any(0 <= ns - end.ns < RECONNECT_NS for ns in later)
        if case.receiver is None or is_new:
            return finding(0.0, "the RST answers a packet of an old connection", is_remark=True)
    if lost.unacked and lost.is_heard and line.has_begin and CaptureLimit.ACKS_MISSING not in line.qualities:
        return finding(0.85, f"{count(lost.unacked, 'byte')} of {other} were not acknowledged and are lost")
    sizes = [one.size for one in line.messages]
    is_even = len(sizes) > 2 and sizes.count(sizes[-1]) * 5 >= 4 * len(sizes)
    # Without a receiver, or after equal messages and without a new connection, it may be an ordinary end.
    if line.harms is None and (case.receiver is None or (is_even and not later)):
        return finding(0.0, "no byte was on its way when the RST came", is_remark=True)
    text_of_harm = (
        "a block showed an ERROR or lost a job" if line.harms else "a CONNECT has to stay connected"
    )
    return finding(0.85 if size else 0.6, text_of_harm)


def _describe_partial_job(line: LineFacts, receiver: Receiver | None) -> str:
    """Return a text if the stream ends inside a job, or "" if it ends elsewhere or its jobs are unknown."""
    flow = line.to_plc
    if receiver is None or receiver.is_secure or not line.has_begin or flow.missing:
        return ""
    if receiver.is_whole:
        at, content = 0, flow.content
        while at + 4 <= len(content) and content[at] == TPKT:
            at += max(int.from_bytes(content[at + 2 : at + 4], "big"), 4)
        return "inside a unit of ISO-on-TCP" if len(content) == flow.bytes and at != len(content) else ""
    is_static = receiver.need and not receiver.adhoc and CaptureLimit.SESSION not in line.qualities
    part = flow.bytes % receiver.need if is_static else 0
    return f"inside a job: {part} of {receiver.need} bytes had arrived" if part else ""


def _describe_partial_frame(line: LineFacts) -> str:
    sizes = [one.size for one in line.messages]
    usual = max(set(sizes), key=sizes.count) if sizes else 0
    if line.qualities & {CaptureLimit.SNAPLEN, CaptureLimit.CLOCK}:
        return ""
    if sizes.count(usual) < 3 or sizes.count(usual) * 2 <= len(sizes) or sizes[-1] >= usual:
        return ""
    content, part = bytes(line.to_plc.content), line.messages[-1]
    in_turn = abs(len(line.answers) - len(line.messages)) < 2  # else the PLC end also sends unasked
    if sizes.count(sizes[-1]) > 1 or (in_turn and line.answers[-1].ns > part.ns):
        return ""  # as long as whole ones, or answered as one
    whole = [content[one.at : one.at + part.size] for one in line.messages if one.size == usual]
    begin = content[part.at : part.at + part.size]
    if any(
        len({each[n : n + 1] for each in whole}) == 1 and begin[n : n + 1] != whole[0][n : n + 1]
        for n in (0, 1)
    ):
        return ""  # no whole one begins like it: a message of another kind
    last = begin[:4]
    is_unit = last[:1] == bytes([TPKT]) and int.from_bytes(last[2:4], "big") == sizes[-1]
    return "" if is_unit else f"inside a frame: {sizes[-1]} of {usual} bytes had arrived"


# -- silence -------------------------------------------------------------------------------------------------


def _find_outage(line: LineFacts) -> tuple[DirectionFacts, int, int, int, bool, int] | None:
    for flow in (line.from_plc, line.to_plc):
        other = line.to_plc if flow is line.from_plc else line.from_plc
        for one in flow.outages:
            until = one.until_ns if one.until_ns is not None else line.last_ns
            closed = any(
                window.ns <= one.ns and (window.until_ns is None or window.until_ns >= one.ns)
                for window in other.closed
            )
            since = next((write.ns for write in reversed(flow.writes) if write.ns <= one.ns), one.ns)
            if until - since >= SECOND and not closed:  # copies to a zero window are no outage
                return flow, one.copies, since, until - since, one.until_ns is not None, one.packet
    return None


def _judge_dead_link(case: LineCase) -> Finding | None:
    line = case.line
    if not _is_tcp(case) or not line.is_built:
        return None
    found = _find_outage(line)
    if found is not None:
        flow, copies, since, size, back, packet = found
        side = "the PLC end" if flow is line.from_plc else "the partner"
        other = "the partner" if flow is line.from_plc else "the PLC end"
        texts = [f"{side} repeated its bytes {times(copies)}, but {other} was silent for {format_ns(size)}"]
        if flow.unacked:
            texts.append(f"{flow.unacked} bytes were never acknowledged")
        texts += [_GONE_TEXT] * bool(line.gone)
        sure = (0.95 if copies > 2 else 0.8) if not back else 0.75 if size > 3 * SECOND else 0.0
        at = SegmentFacts(since, 0, 0, packet)
        way = "from-plc" if flow is line.from_plc else "to-plc"
        return Finding(sure, tuple(texts), way=way, at=at) if sure else None
    return _judge_keep_alive_probes(case)


def _judge_keep_alive_probes(case: LineCase) -> Finding | None:
    line, odd = case.line, None
    ways = ((line.from_plc, "the PLC end", "from-plc"), (line.to_plc, "the partner", "to-plc"))
    for flow, side, way in ways if line.is_wire else ():
        is_plc = flow is line.from_plc
        gives_up = line.end is not None and line.end.kind == "rst" and line.end.by_plc == is_plc
        is_gone = (line.partner_end if is_plc else line.plc_end)[0] in line.gone
        n, since = flow.probes_open, flow.probes_since
        if n >= (2 if gives_up or is_gone else 3):
            texts = [f"the last {n} keep-alive probes of {side} have no answer"]
            texts += ["then it gave up the connection (RST)"] * gives_up + [_GONE_TEXT] * is_gone
            return Finding(0.92, tuple(texts), way=way, at=since)
        lacking = flow.keep_alives - flow.keep_alives_answered
        if lacking >= 3 and flow.keep_alives_answered * 2 < flow.keep_alives:
            return Finding(0.9, (f"{lacking} keep-alive probes of {side} have no answer",), way=way)
        if n and case.last_ns - since.ns >= SECOND:
            text = (
                f"the last keep-alive probe of {side} has no answer in {format_ns(case.last_ns - since.ns)}"
            )
            odd = Finding(0.0, (text,), way=way, at=since, is_remark=True)
    return odd


def _judge_no_keep_alive(case: LineCase) -> Finding | None:
    line = case.line
    if not _is_tcp(case) or not line.is_built or not line.is_wire:
        return None
    is_here = line.plc_end[0] == line.partner_end[0] or line.plc_end[0][:1] == LOOPBACK
    if line.to_plc.keep_alives or line.from_plc.keep_alives or is_here:
        return None  # on one host no device forgets
    dead = _find_outage(line)
    end = line.end
    for idle in line.idles:
        if idle.size_ns < IDLE_NS or (dead is not None and idle.until_ns > dead[2] + AT_ONCE_NS):
            continue  # not idle: an end waited for an answer
        texts = [f"{format_ns(idle.size_ns)} without a packet or a keep-alive probe"]
        at = SegmentFacts(idle.until_ns - idle.size_ns, 0, 0, idle.packet)
        is_reset = end is not None and end.kind == "rst" and end.ns - idle.until_ns < AT_ONCE_NS
        is_reset = is_reset and end is not None and end.packet != idle.packet  # else it answers that packet
        if end is not None and is_reset and not _has_written_since(line, end.by_plc, idle.until_ns):
            texts.append("then an RST: one end had forgotten the connection")
            return Finding(0.93, tuple(texts), at=at)
        if dead is not None and 0 <= dead[2] - idle.until_ns < AT_ONCE_NS:
            texts.append("the bytes sent after that were not acknowledged")
            return Finding(0.93, tuple(texts), at=at)
    if end is None:
        lines = case.group.lines
        after = next((one for one in lines[-MOST_AROUND:] if one.first_ns > line.last_ns), None)
        size = after.first_ns - line.last_ns if after is not None else 0
        if size >= IDLE_NS and dead is None and not _has_parallel_connection(case, line.last_ns):
            texts = [
                f"{format_ns(size)} without a packet or a keep-alive probe",
                "then a new connection between the same ends: the old one was never ended",
            ]
            return Finding(0.9, tuple(texts), at=SegmentFacts(line.last_ns, 0, 0, 0))
    return _judge_replaced_connection(case)


def _has_written_since(line: LineFacts, by_plc: bool, since_ns: int) -> bool:
    writes = (line.from_plc if by_plc else line.to_plc).writes
    return bool(writes) and writes[-1].ns >= since_ns


def _has_parallel_connection(case: LineCase, ns: int) -> bool:
    """Return whether the same ends had another connection at `ns`, so a new connection replaces nothing."""
    others = [one for one in case.group.lines[-MOST_AROUND:] if one is not case.line and one.is_built]
    return any(one.first_ns <= ns < one.last_ns for one in others)


def _judge_replaced_connection(case: LineCase) -> Finding | None:
    line = case.line
    for idle in line.idles:
        since = idle.until_ns - idle.size_ns
        heard = sum(flow.last_ns > since for flow in (line.to_plc, line.from_plc))
        new = [
            one for one in case.group.built[-MOST_AROUND:] if since + IDLE_NS <= one.first_ns <= idle.until_ns
        ]
        if new and heard < 2 and not _has_parallel_connection(case, since):
            texts = (
                f"{format_ns(new[0].first_ns - since)} without a packet or a keep-alive probe",
                "then a new connection between the same ends, and no answer on the old one",
            )
            return Finding(0.85, texts, at=SegmentFacts(since, 0, 0, idle.packet))
    return None


# -- windows, delays, losses ---------------------------------------------------------------------------------


def _measure_closed_windows(line: LineFacts, flow: DirectionFacts) -> tuple[int, int, ClosedWindow] | None:
    if not line.is_wire or not flow.closed:
        return None
    ends = [one.until_ns if one.until_ns is not None else line.last_ns for one in flow.closed]
    longest = max(end - one.ns for end, one in zip(ends, flow.closed, strict=True))
    return len(flow.closed), longest, flow.closed[0]


def _judge_not_reading(case: LineCase, by_plc: bool) -> Finding | None:
    line = case.line
    flow = line.from_plc if by_plc else line.to_plc
    found = _measure_closed_windows(line, flow)
    if found is None:
        return None
    often, longest, first = found
    if longest < CLOSED_NS // 2 or (often >= 4 and longest < 3 * SECOND):
        return None  # many short ones are a flood
    if by_plc and often > 1 and flow.closed[0].until_ns is not None and _describe_overload(case):
        return None  # it reads, but too slowly: a flood
    side = "the PLC end" if by_plc else "the partner"
    texts = (f"{side} announced a zero window {times(often)}, for up to {format_ns(longest)}",)
    sure = 0.95 if longest >= CLOSED_NS else 0.75
    way = "to-plc" if by_plc else "from-plc"
    packets = tuple([one.packet for one in flow.closed[:MOST_SHOWN]])
    return Finding(sure, texts, way=way, at=SegmentFacts(first.ns, 0, 0, first.packet), packets=packets)


def _judge_flood(case: LineCase) -> Finding | None:
    line, flow = case.line, case.line.from_plc
    found, rate = _measure_closed_windows(line, flow), _describe_overload(case)
    if found is not None and (found[0] >= 3 or (found[0] >= 2 and rate)):
        often, longest, first = found
        opened = sum(1 for one in flow.closed if one.until_ns is not None)
        if (opened >= 2 and longest < 3 * SECOND) or (opened and rate):
            texts = [f"the PLC end closed its window {times(often)} and opened it again: it reads too slowly"]
            at = SegmentFacts(first.ns, 0, 0, first.packet)
            return Finding(0.9, (*texts, *rate), "to-plc", at, is_remark=case.receiver is None)
    low, high = flow.lowest_window, flow.highest_window
    if line.is_wire and low is not None and high >= 1024 and low * 5 < high and flow.acks >= 8:
        falls = flow.last_window * 3 < high or rate
        if falls and line.to_plc.bytes > 2 * (high - low) // 3:
            text = f"the window of the PLC end fell from {high} to {low}: its backlog grows"
            at = line.to_plc.writes[0]
            return Finding(0.8, (text, *rate), "to-plc", at, is_remark=case.receiver is None)
    return Finding(0.8, rate, "to-plc", line.to_plc.writes[0]) if rate else None  # of a known receiver


def _describe_overload(case: LineCase) -> tuple[str, ...]:
    line, receiver = case.line, case.receiver
    closed = line.from_plc.closed
    writes = [one for one in line.to_plc.writes if not closed or one.ns <= closed[0].ns]
    if receiver is None or not receiver.interval_ns or len(writes) < 50:
        return ()
    taken = max(writes[-1].ns - writes[0].ns, 1)
    size = writes[-1].at + writes[-1].size - writes[0].at
    jobs = size / receiver.need if receiver.need and not receiver.adhoc else len(line.messages)
    scans = taken / receiver.interval_ns
    if taken < SECOND // (100 if closed else 2) or jobs <= scans * 1.05:
        return ()
    ms = receiver.interval_ns / 1e6
    rate = f"{jobs / taken * 1e9:.0f} messages come each second"
    return (f"{rate}, but one job per scan of {ms:g} ms takes only {1000 / ms:.0f}",)


def _judge_slow_ack(case: LineCase) -> Finding | None:
    line = case.line
    if not line.is_wire:
        return None
    begun = line.established_ns
    trip = 2 * AFTER_ACK_NS if begun is None else begun - line.first_ns  # the handshake is not in the capture
    for flow, way in ((line.to_plc, "to-plc"), (line.from_plc, "from-plc")):
        limit = AFTER_ACK_NS + (trip if trip < 100 * AFTER_ACK_NS else 0)
        slow = [one for one in flow.slow if one.after_ns <= limit]
        near = [one for one in flow.slow if limit < one.after_ns <= limit + NEAR_NS]
        if len(slow) < 3 or len(slow) * 6 < min(flow.segments, 256) or len(near) * 3 > len(slow):
            continue  # a periodic sender meets ACKs by chance, then also a while after them
        if _has_period(flow, line.from_plc if flow is line.to_plc else line.to_plc, [*slow, *near]):
            continue
        usual = median(one.wait_ns for one in slow)
        packets = tuple([one.write.packet for one in slow[:MOST_SHOWN]])
        texts = (
            f"{len(slow)} of {flow.segments} segments are small writes that waited {usual / 1e6:.0f} ms "
            "for an ACK; then the next write left at once",
        )
        sure = 0.92 if len(slow) > 4 else 0.75
        return Finding(sure, texts, way=way, at=slow[0].write, packets=packets)
    return None


def _has_period(flow: DirectionFacts, other: DirectionFacts, slow: Sequence[LateAck]) -> bool:
    waited, answers = {one.write.at for one in slow}, [write.ns for write in other.writes]
    others = [
        b.ns - a.ns
        for a, b in pairwise(flow.writes)
        if a.at not in waited and bisect(answers, a.ns) == bisect(answers, b.ns)
    ]
    usual = median(one.wait_ns + one.after_ns for one in slow)
    return len(others) > 2 and 0.75 * usual <= median(others) <= 1.33 * usual


def _judge_loss(case: LineCase) -> Finding | None:
    line = case.line
    if not _is_tcp(case):
        return None
    best: Finding | None = None
    for flow, way in ((line.to_plc, "to-plc"), (line.from_plc, "from-plc")):
        odd = flow.resent + flow.late
        if _judge_no_keep_alive(case) is not None:
            odd -= sum(one.copies for one in flow.outages)  # copies on a forgotten connection: no loss
        share = odd / max(flow.segments + flow.resent, 1)
        is_often = odd >= 3 and odd * 100 >= flow.segments
        is_long = flow.longest_wait_ns >= SECOND and odd * 20 >= flow.segments >= 3
        of_all = flow.segments + flow.resent
        text = f"of {of_all} segments, {flow.resent} sent again and {flow.late} late: {share:.1%}"
        at, packets = flow.first_of("resent") or flow.first_of("early"), flow.packets_of("resent")
        if is_often or is_long:
            waited = f"the longest wait for a repeated segment was {format_ns(flow.longest_wait_ns)}"
            sure = 0.92 if odd > 4 else 0.8 if odd > 2 else 0.6
            texts = (text, *([waited] if flow.longest_wait_ns else []))
            found = Finding(sure, texts, way=way, at=at, packets=packets)
        elif flow.spurious >= 3 and flow.spurious * 20 > flow.segments:
            lost = f"{flow.spurious} segments were sent again although they had arrived: their ACKs get lost"
            packets = flow.packets_of("spurious")
            found = Finding(0.7, (lost,), way=way, at=flow.first_of("spurious"), packets=packets)
        elif odd:
            found = Finding(0.0, (text,), way=way, at=at, is_remark=True, packets=packets)
        else:
            continue
        best = found if best is None or found.confidence > best.confidence else best
    return best


def _judge_capture_incomplete(case: LineCase) -> Finding | None:
    if CaptureLimit.GAPS not in case.line.qualities:
        return None
    texts, at = [], None
    for flow, way in ((case.line.to_plc, "to the PLC"), (case.line.from_plc, "from the PLC")):
        size = "more bytes than possible" if flow.has_jumped else count(flow.missing, "byte")
        texts += [f"the capture lacks {size} {way} that the other end received"] if flow.missing else []
        at = at or flow.first_of("missing")
    texts = texts or ["the sequence numbers jump further than any window"]
    return Finding(0.0, tuple(texts), at=at, is_remark=True)


# -- the rows ------------------------------------------------------------------------------------------------


def _listener_end(line: LineFacts) -> tuple[bytes, int]:
    return line.partner_end if line.plc_calls else line.plc_end


def _listener_way(line: LineFacts) -> str:
    return "from-plc" if line.plc_calls else "to-plc"


def _is_alive_at(line: LineFacts, ns: int) -> bool:
    if not line.is_built or (line.end is not None and line.end.ns <= ns):
        return False
    return _find_outage(line) is None and (line.last_ns > ns or ns - line.last_ns < IDLE_NS)


def _adapt_frame_rule(row: CauseRule) -> Callable[[LineCase], Finding | None]:
    return lambda case: row.judge(case.line, case.receiver)


_LACKS_CLOCK: Final = (CaptureLimit.CLOCK,)
_LACKS_ACKS: Final = (CaptureLimit.ONE_DIRECTION, CaptureLimit.ACKS_MISSING, CaptureLimit.CLOCK)
STALL_CAUSES: Final = ("dead-link", "mtu", "plc-not-reading", "partner-not-reading")
_GONE_TEXT: Final = "the other end answers no ARP request: it is off, or its cable is unplugged"
_REFUSALS: Final = ("second-client", "turned-away", "wrong-tsap", "tls-refused")
_MISREAD_CAUSES: Final = ("frame-short", "frame-long", "adhoc-missing", "padding", "header", "byte-order")
_LACKS_COPIES: Final = (CaptureLimit.GAPS, CaptureLimit.DROPS, CaptureLimit.ONE_DIRECTION, CaptureLimit.CLOCK)
CAUSE_RULES: Final = (
    CauseRule("address", _judge_address, blind=(CaptureLimit.ONE_DIRECTION,)),
    CauseRule("duplicate-ip", lambda case: case.line.doubled and make_host_finding(case.line.doubled, ())),
    CauseRule("second-client", _judge_second_client, ("address",)),
    CauseRule("refused", _judge_refused, ("address", "second-client")),
    CauseRule("turned-away", _judge_turned_away, ("address", "second-client")),
    CauseRule("filtered", _judge_filtered, ("address", "second-client", "refused"), blind=_LACKS_CLOCK),
    CauseRule("wrong-tsap", lambda case: judge_wrong_tsap(case.line)),
    CauseRule("tls-refused", lambda case: judge_tls(case.line)),
    CauseRule("line-errors", lambda case: judge_serial_errors(case.line)),
    CauseRule("closes-each-message", _judge_closes, _REFUSALS),
    CauseRule("half-open", lambda case: judge_half_open(case.line, case.group.restarts), blind=_LACKS_CLOCK),
    CauseRule(
        "reconnect-storm", _judge_storm, (*_REFUSALS, "closes-each-message", "half-open"), blind=_LACKS_CLOCK
    ),
    CauseRule("no-keep-alive", _judge_no_keep_alive, ("half-open",), blind=_LACKS_ACKS),
    CauseRule("mtu", lambda case: judge_mtu(case.line), blind=_LACKS_CLOCK),
    CauseRule("dead-link", _judge_dead_link, ("no-keep-alive", "half-open", "mtu"), blind=_LACKS_ACKS),
    CauseRule(
        "resets",
        _judge_resets,
        (*_REFUSALS, *STALL_CAUSES, "no-keep-alive", "half-open"),
        (*_MISREAD_CAUSES, "reconnect-storm"),
    ),
    CauseRule("plc-not-reading", lambda case: _judge_not_reading(case, True), blind=_LACKS_CLOCK),
    CauseRule("partner-not-reading", lambda case: _judge_not_reading(case, False), blind=_LACKS_CLOCK),
    CauseRule("flood", _judge_flood, (), ("plc-not-reading",), _LACKS_CLOCK),
    CauseRule("slow-ack", _judge_slow_ack, blind=_LACKS_ACKS),
    CauseRule("loss", _judge_loss, STALL_CAUSES, blind=_LACKS_COPIES),
    CauseRule("capture-incomplete", _judge_capture_incomplete),
    *(row._replace(judge=_adapt_frame_rule(row), blind=(CaptureLimit.SESSION,)) for row in FRAME_RULES),
)


def judge_case(case: LineCase) -> tuple[tuple[Finding, ...], list[Finding], dict[str, CaptureLimit]]:
    """Return the findings, surest first; the remarks; the causes that cannot be judged, and why."""
    blind = {rule.cause: each for rule in CAUSE_RULES for each in rule.blind if each in case.line.qualities}
    seen = {rule.cause: rule for rule in CAUSE_RULES if rule.cause not in blind}

    def judge(receiver: Receiver | None) -> dict[str, Finding]:
        made = {cause: rule.judge(case._replace(receiver=receiver)) for cause, rule in seen.items()}
        return {cause: one for cause, one in made.items() if one is not None}

    by_cause = judge(case.receiver)
    if "duplicate-ip" in by_cause:
        by_cause = {cause: one for cause, one in by_cause.items() if cause not in DOUBLE_EFFECTS}
    remarks = [replace(one, cause=cause) for cause, one in by_cause.items() if one.is_remark]
    by_cause = {cause: one for cause, one in by_cause.items() if not one.is_remark}
    findings = weigh_findings(by_cause, CAUSE_RULES, judge)
    if "duplicate-ip" in by_cause:  # first and the others halved: the second device may cause anything
        first = [one for one in findings if one.cause == "duplicate-ip"]
        rest = [replace(one, confidence=one.confidence / 2) for one in findings if one not in first]
        findings = (*first, *rest)
    not_judged = blind if _is_tcp(case) else {}  # the qualities are those of TCP
    return ((), [*remarks, *findings], not_judged) if case.is_foreign else (findings, remarks, not_judged)


def weigh_findings(
    by_cause: Mapping[str, Finding],
    rules: Sequence[CauseRule],
    judge: Callable[[Receiver], Mapping[str, Finding]],
) -> tuple[Finding, ...]:
    """Return the findings that no other cause silences, the surest first.

    Remedies with a `cured` receiver are tried: `judge` returns the findings for this receiver. If these
    findings contain the cause or a new cause, these remedies are not offered.
    """
    found: list[tuple[float, Finding]] = []  # each with the confidence of its rule
    for rule in rules:
        made = by_cause.get(rule.cause)
        if made is None or any(cause in by_cause for cause in rule.silenced_by):
            continue
        share = 0.5 if any(cause in by_cause for cause in rule.weakened_by) else 1.0
        if by_cause.get("resets", made).confidence > PROVEN and rule.cause in ("resets", "reconnect-storm"):
            share = 1.0 if rule.cause == "resets" else 0.5  # a cut message comes before the number of ends
        mend, is_tried = made.mend, made.is_fact
        if isinstance(made.trial, RemedyOffer) and made.trial.cured is not None:
            after = {cause for cause, one in judge(made.trial.cured).items() if not one.is_remark}
            is_tried = rule.cause not in after <= by_cause.keys()  # cured, without a new cause
            mend = tuple([replace(one, tried=True) for one in mend]) if is_tried else made.trial.otherwise
        sure = min(made.confidence * share, PROVEN if is_tried else UNTRIED_CONFIDENCE)
        found.append((made.confidence, replace(made, confidence=sure, cause=rule.cause, mend=mend)))
    found.sort(key=lambda each: (-each[1].confidence, -each[0]))
    return tuple([one for _, one in found])


def make_cases(
    lines: Sequence[LineFacts], receivers: tuple[Receiver, ...], last_ns: int
) -> Iterator[LineCase]:
    between: dict[_EndsKey, list[LineFacts]] = {}
    calls: dict[tuple[str, bytes, bytes], list[LineFacts]] = {}
    for line in lines:
        between.setdefault(_ends_key(line), []).append(line)
        calls.setdefault(_hosts_key(line), []).append(line)
    restarts = find_half_open(lines, between.values())
    groups = {ends: LineGroup(tuple(found), restarts) for ends, found in between.items()}
    reverses = {hosts: LineGroup(tuple(found)) for hosts, found in calls.items()}
    only = _only_receiver(lines, receivers)
    fitting = [_find_receiver(line, receivers, only) for line in lines]
    pairs = [*zip(lines, fitting, strict=True)]
    has_own_line = any(known is not None and known.connect and line.is_built for line, known in pairs)
    ports = frozenset[int]().union(*(one.ports for one in receivers))
    before: dict[tuple[str, tuple[bytes, int]], deque[LineFacts]] = {}
    for line, receiver in pairs:
        older = before.setdefault((line.protocol, _listener_end(line)), deque(maxlen=MOST_AROUND))
        kind, caller, listener = _hosts_key(line)
        reverse = reverses.get((kind, listener, caller), _EMPTY_GROUP) if caller != listener else _EMPTY_GROUP
        is_other = receiver is None and not line.connect and _listener_end(line)[1] not in ports
        foreign = is_other and (has_own_line or is_http(line))
        group = groups[_ends_key(line)]
        yield LineCase(line, group, tuple(older), reverse, receiver, receivers, last_ns, foreign)
        older.append(line)


def _find_receiver(line: LineFacts, receivers: Sequence[Receiver], only: Receiver | None) -> Receiver | None:
    found = next((one for one in receivers if one.fits(line)), None)
    if only is not None and line.is_built and (line.protocol == "udp") == only.is_datagram:
        found = only if only.has_end_of(line) else None
    if found is not None:
        line.since_ns, line.until_ns = found.since_ns, found.until_ns
        is_seen = found.need and not (found.is_whole or found.is_secure)
        line.qualities |= {CaptureLimit.SESSION} if is_seen and speaks_session(line, found) else set()
    if found is not None and found.need and not found.adhoc and not line.is_wire:
        line.reads = RecordedReads(found.need, found.interval_ns)
    return found


def _only_receiver(lines: Sequence[LineFacts], receivers: Sequence[Receiver]) -> Receiver | None:
    known = [one for one in receivers if not one.is_serial]
    if len(known) != 1 or any(known[0].fits(line) or line.connect is not None for line in lines):
        return None
    return known[0] if any(known[0].has_end_of(line) for line in lines) else None


_EndsKey = tuple[str, bytes, tuple[bytes, int]]
_EMPTY_GROUP: Final = LineGroup(())


def _ends_key(line: LineFacts) -> _EndsKey:
    caller = line.plc_end if line.plc_calls else line.partner_end
    return line.protocol, caller[0], _listener_end(line)


def _hosts_key(line: LineFacts) -> tuple[str, bytes, bytes]:
    protocol, caller, listener = _ends_key(line)
    return protocol, caller, listener[0]
