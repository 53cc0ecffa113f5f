"""The rules of the doctor, one row a cause: what speaks for it, what silences it, and the remedy.

Rule 1: a judge that lacks a fact says nothing; "healthy" is what is left when nobody speaks.
Rule 2: a row that explains another one silences it, so that a storm is not told as ten resets.
"""

from __future__ import annotations

from bisect import bisect
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from statistics import median
from typing import Final

from trcvtui.records import NamedTuple
from trcvtui.rig.diagnosis.frame_causes import FRAME_JUDGES, Receiver
from trcvtui.rig.diagnosis.line_facts import (
    ClosedWindow,
    DirectionFacts,
    LateAck,
    LineFacts,
    Reads,
    SaidBytes,
)
from trcvtui.rig.diagnosis.sayings import Mend, Said
from trcvtui.rig.diagnosis.session_causes import line_errors, tls_refused, wrong_tsap
from trcvtui.rig.wording import count, times

SECOND: Final = 1_000_000_000
UNANSWERED_NS: Final = 3 * SECOND  # a SYN that waits so long has no answer
IDLE_NS: Final = 20 * SECOND
CLOSED_NS: Final = SECOND  # a window that nobody reads
AT_ONCE_NS: Final = 2 * SECOND
RELEASED_NS: Final = 1_500_000  # after the ACK that it waited for, a write leaves so soon
NEAR_NS: Final = 30_000_000
SHORT_LIFE_NS: Final = 30 * SECOND
STORM: Final = 4  # connections
MOST_AROUND: Final = 64  # conversations that one is compared with


class EndsGroup:
    """The conversations between the same two ends, in their order."""

    def __init__(self, lines: tuple[LineFacts, ...]) -> None:
        self.lines = lines

    @cached_property
    def built(self) -> tuple[LineFacts, ...]:
        """Return those that stood."""
        return tuple([one for one in self.lines if one.is_built])

    @cached_property
    def ended(self) -> tuple[LineFacts, ...]:
        """Return those that stood and were ended."""
        return tuple([one for one in self.built if one.end is not None])

    @cached_property
    def one_message(self) -> tuple[LineFacts, ...]:
        """Return those that the partner ended after its only message."""
        return tuple([one for one in self.ended if _is_one_message(one)])

    @cached_property
    def has_one_that_stands(self) -> bool:
        """Return whether most were ended while the same other one stood."""
        longest = max(self.built, key=lambda one: one.lasted_ns)
        beside = [one for one in self.ended if longest.first_ns < one.first_ns < longest.last_ns]
        return len(beside) * 2 > len(self.ended)

    @cached_property
    def refusals(self) -> int:
        """Return how many calls were answered by RST."""
        return sum(1 for one in self.lines if not one.is_built and one.listener.reset is not None)

    @cached_property
    def by_plc_and_resets(self) -> tuple[int, int]:
        """Return how many of them the PLC end ended, and how many of all ended by RST."""
        ends = [one.end for one in self.ended if one.end is not None]
        return sum(1 for end in ends if end.by_plc), sum(1 for end in ends if end.kind == "rst")

    @cached_property
    def life_and_period_ns(self) -> tuple[int, int]:
        """Return how long connections stood, and after what time the next one was built."""
        life = int(median(one.lasted_ns for one in self.ended))
        return life, int(median(b.first_ns - a.first_ns for a, b in pairwise(self.built)))


class LineCase(NamedTuple):
    """What is judged: a conversation, those between the same ends, those before it at the same listener."""

    line: LineFacts
    group: EndsGroup
    older: tuple[LineFacts, ...]
    reverse: EndsGroup  # the other end calls
    receiver: Receiver | None
    receivers: tuple[Receiver, ...]
    last_ns: int


class LineFinding(NamedTuple):
    """One cause found."""

    cause: str
    confidence: float
    said: Said
    mend: tuple[Mend, ...]


class CauseRule(NamedTuple):
    """One row. `silenced_by`: causes that explain it when they are found; `weakened_by`: that may."""

    cause: str
    judge: Callable[[LineCase], Said | None]
    mend: tuple[Mend, ...]
    silenced_by: tuple[str, ...] = ()
    weakened_by: tuple[str, ...] = ()


# -- building a connection -----------------------------------------------------------------------------------


def _syns(line: LineFacts) -> list[SaidBytes]:
    return line.caller.syns


def _is_tcp(case: LineCase) -> bool:
    return case.line.protocol == "tcp"


def _refused(case: LineCase) -> Said | None:
    line = case.line
    reset = line.listener.reset
    if not _is_tcp(case) or not line.has_begin or line.is_built or reset is None or not _syns(line):
        return None
    who = "the partner" if line.plc_calls else "the PLC end"
    text = f"{who} answers SYN with RST: nobody listens on port {_listener_end(line)[1]}"
    return Said(
        0.97, (text, f"{times(case.group.refusals)} in this capture"), way=_from_listener(line), at=reset
    )


def _filtered(case: LineCase) -> Said | None:
    line, syns = case.line, _syns(case.line)
    if not _is_tcp(case) or not line.has_begin or line.is_built or line.end is not None or not syns:
        return None
    if line.listener.segments or line.listener.acks or line.caller.segments:
        return None
    waited = case.last_ns - syns[0].ns
    if waited < SECOND or (len(syns) < 2 and waited < UNANSWERED_NS):
        return None
    text = f"{count(len(syns), 'SYN')} to port {_listener_end(line)[1]}, no answer in {_s(waited)}"
    before = next((one for one in reversed(case.older) if one.partner_end[0] == line.partner_end[0]), None)
    if before is not None and _outage(before):
        return Said(0.6, (text, "a connection between the same ends died before it"), way=_to_listener(line))
    return Said(0.95 if len(syns) > 2 else 0.85, (text,), way=_to_listener(line), at=syns[0])


def _second_client(case: LineCase) -> Said | None:
    line = case.line
    if not _is_tcp(case) or not line.has_begin or line.plc_calls:
        return None
    older = [one for one in case.older if _lives_at(one, line.first_ns)]
    if not older:
        return None
    first = older[0]
    since = f"the PLC end serves {first.partner} since {_s(line.first_ns - first.first_ns)} before"
    if not line.is_built:
        reset = line.listener.reset
        if reset is not None:
            return Said(0.93, (since, "this SYN was answered by RST"), way="from-plc", at=reset)
        if _filtered(case) is not None:
            return Said(0.85, (since, f"{count(len(_syns(line)), 'SYN')} without an answer"), way="to-plc")
        return None
    ended = line.end
    if ended is not None and ended.by_plc and not line.from_plc.segments:
        begun = line.established_ns or line.answered_ns or line.first_ns
        at_once = ended.ns - max(begun, line.to_plc.writes[0].ns if line.to_plc.writes else 0) < AT_ONCE_NS
        if at_once or ended.kind == "rst":
            word = "RST" if ended.kind == "rst" else "FIN"
            text = f"{word} from the PLC end after {_s(ended.ns - begun)}, it had said nothing"
            return Said(0.93, (since, text), way="from-plc", at=SaidBytes(ended.ns, 0, 0, ended.packet))
    said = line.to_plc.segments
    still = min(first.last_ns, line.last_ns if ended is not None else first.last_ns) - line.first_ns
    if not said and not line.from_plc.segments and still >= UNANSWERED_NS:
        text = f"it stands, and nobody says a byte in {_s(still)}"
        return Said(0.75 if ended is None else 0.6, (since, text), way="to-plc")
    has_answers = len(first.from_plc.writes) > 2 and not line.from_plc.segments
    if has_answers and said and line.lasted_ns >= UNANSWERED_NS:
        text = f"{count(said, 'segment')} of this client in {_s(line.lasted_ns)}, and no answer"
        return Said(0.7, (since, text), way="to-plc")
    return None


def _address(case: LineCase) -> Said | None:
    line = case.line
    if not _is_tcp(case) or not line.has_begin:
        return None
    if not line.is_built and case.reverse.lines and not (case.group.built or case.reverse.built):
        texts = ("both ends call each other, and nobody listens: both are active",)
        return Said(0.93, texts, at=_syns(line)[0] if _syns(line) else None)
    receiver = case.receiver
    is_sure = receiver is not None and receiver.connect != "" and line.guess.confidence >= 0.8
    if receiver is not None and is_sure and line.plc_calls is not None and receiver.active != line.plc_calls:
        is_said = "active" if receiver.active else "passive"
        who = "the PLC end" if line.plc_calls else "the partner"
        text = f"{receiver.connect} is {is_said} in the project, and {who} calls"
        return Said(0.85, (text,), instance=receiver.instance)
    if receiver is None and case.receivers and not line.plc_calls and not line.is_built:
        ports = sorted({one.local_port for one in case.receivers if not one.active and one.local_port})
        if ports and line.plc_end[1] not in ports and _refused(case) is not None:
            text = f"the partner calls port {line.plc_end[1]}, the project listens on {ports[0]}"
            return Said(0.98, (text,), way="to-plc")
    return None


# -- a connection that ends ----------------------------------------------------------------------------------


def _is_one_message(line: LineFacts) -> bool:
    """Return whether the partner ended it after its only message."""
    end = line.end
    return (
        end is not None
        and not end.by_plc
        and end.kind == "fin"
        and (len(line.messages) == 1 or _is_short(line.to_plc.writes))
        and len(line.answers) <= 1
        and (line.has_begin or len(line.to_plc.writes) == 1)
        and end.ns - line.messages[0].ns < 5 * SECOND
    )


def _is_short(writes: Sequence[SaidBytes]) -> bool:
    """Return whether these writes may be pieces of one message."""
    return 0 < len(writes) <= 3 and writes[-1].ns - writes[0].ns < AT_ONCE_NS // 40


def _closes(case: LineCase) -> Said | None:
    if not _is_tcp(case) or not case.line.is_built:
        return None
    ended, alike, stood = case.group.ended, case.group.one_message, len(case.group.built)
    if len(alike) < 2 or len(alike) < 0.7 * stood - 1 or len(alike) < 0.7 * len(ended):
        return None
    sure = 0.95 if len(alike) > 3 else 0.85 if len(alike) > 2 else 0.7
    end = alike[0].end
    texts = (f"the partner ended {len(alike)} of {count(stood, 'connection')} after one message",)
    at = SaidBytes(end.ns, 0, 0, end.packet) if end is not None else None
    return Said(sure, texts, way="to-plc", at=at)


def _storm(case: LineCase) -> Said | None:
    if not _is_tcp(case) or not case.line.is_built:
        return None
    built, ended = case.group.built, case.group.ended
    if len(built) < STORM or len(ended) < len(built) - 1 or _closes(case) is not None:
        return None
    if case.group.has_one_that_stands:
        return None  # what is lost beside it are further clients
    life, period = case.group.life_and_period_ns
    most = 10 * SHORT_LIFE_NS if len(built) > 7 else SHORT_LIFE_NS if len(built) > 5 else SHORT_LIFE_NS // 2
    if life > most or period > 2 * most:
        return None
    by_plc, resets = case.group.by_plc_and_resets
    who = f"ended by the PLC end {by_plc}, by the partner {len(ended) - by_plc} times"
    texts = (
        f"{count(len(built), 'connection')} built, {len(ended)} lost again, one each {_s(period)}",
        f"{who}; {resets} by RST; each stood {_s(life)}",
    )
    return Said(0.95 if len(built) > 5 else 0.88, texts, at=SaidBytes(built[0].first_ns, 0, 0, 0))


def _resets(case: LineCase) -> Said | None:
    line, end = case.line, case.line.end
    if end is None or end.kind != "rst" or not line.is_built or not _is_tcp(case):
        return None
    said = line.to_plc.bytes + line.from_plc.bytes
    who = "the PLC end" if end.by_plc else "the partner"
    sizes = [one.size for one in line.messages]
    usual = max(set(sizes), key=sizes.count) if sizes else 0
    texts = [f"RST from {who} at {line.seconds(end.ns):.3f} s, after {said} bytes"]
    sure = 0.85 if said else 0.6
    is_even = len(sizes) > 2 and sizes.count(usual) * 5 >= 4 * len(sizes) and sizes[-1] == usual
    if is_even and not any(one.first_ns > line.first_ns for one in case.group.lines[-MOST_AROUND:]):
        return None  # between two frames, and nobody came back: an end without a FIN
    if len(sizes) > 2 and sizes[-1] < usual and sizes.count(usual) * 2 > len(sizes):
        texts.append(f"in mid frame: {sizes[-1]} of {usual} bytes had come")
        sure = 0.93
    way = "from-plc" if end.by_plc else "to-plc"
    return Said(sure, tuple(texts), way=way, at=SaidBytes(end.ns, line.to_plc.bytes, 0, end.packet))


# -- silence -------------------------------------------------------------------------------------------------


def _outage(line: LineFacts) -> tuple[DirectionFacts, int, int, int, bool] | None:
    """Return who said copies alone, how many, from when, how long, and whether it came back."""
    for said in (line.from_plc, line.to_plc):
        other = line.to_plc if said is line.from_plc else line.from_plc
        for one in said.outages:
            until = one.until_ns if one.until_ns is not None else line.last_ns
            closed = any(
                window.ns <= one.ns and (window.until_ns is None or window.until_ns >= one.ns)
                for window in other.closed
            )
            since = _said_before(said, one.ns)
            if until - since >= SECOND and not closed:
                return said, one.copies, since, until - since, one.until_ns is not None
    return None


def _said_before(said: DirectionFacts, ns: int) -> int:
    """Return when the bytes were said that were said again at `ns`."""
    before = [write.ns for write in said.writes if write.ns <= ns]
    return before[-1] if before else ns


def _dead_link(case: LineCase) -> Said | None:
    line = case.line
    if not _is_tcp(case) or not line.is_built:
        return None
    found = _outage(line)
    if found is not None:
        said, copies, since, size, back = found
        who = "the PLC end" if said is line.from_plc else "the partner"
        other = "the partner" if said is line.from_plc else "the PLC end"
        texts = [f"{who} said its bytes {copies} times again, {other} gave no answer for {_s(size)}"]
        if said.unacked:
            texts.append(f"{said.unacked} bytes were never acknowledged")
        sure = (0.95 if copies > 2 else 0.8) if not back else 0.75 if size > 3 * SECOND else 0.0
        at = SaidBytes(since, 0, 0, 0)
        way = "from-plc" if said is line.from_plc else "to-plc"
        return Said(sure, tuple(texts), way=way, at=at) if sure else None
    for said in (line.from_plc, line.to_plc):
        lacking = said.keep_alives - said.keep_alives_answered
        if line.is_wire and lacking >= 3 and said.keep_alives_answered * 2 < said.keep_alives:
            who = "the PLC end" if said is line.from_plc else "the partner"
            way = "from-plc" if said is line.from_plc else "to-plc"
            return Said(0.9, (f"{lacking} keep-alive probes of {who} have no answer",), way=way)
    return None


def _no_keep_alive(case: LineCase) -> Said | None:
    line = case.line
    if not _is_tcp(case) or not line.is_built or not line.is_wire:
        return None
    if line.to_plc.keep_alives or line.from_plc.keep_alives:
        return None
    dead = _outage(line)
    end = line.end
    for idle in line.idles:
        if idle.size_ns < IDLE_NS or (dead is not None and idle.until_ns > dead[2] + AT_ONCE_NS):
            continue  # it was idle, and not waiting for an answer
        texts = [f"{_s(idle.size_ns)} without a packet, no keep-alive probe"]
        at = SaidBytes(idle.until_ns - idle.size_ns, 0, 0, idle.packet)
        if end is not None and end.kind == "rst" and end.ns - idle.until_ns < AT_ONCE_NS:
            texts.append("then RST: one end had forgotten the connection")
            return Said(0.93, tuple(texts), at=at)
        if dead is not None and 0 <= dead[2] - idle.until_ns < AT_ONCE_NS:
            texts.append("then bytes that nobody acknowledged")
            return Said(0.93, tuple(texts), at=at)
    if end is None:
        lines = case.group.lines
        after = next((one for one in lines[-MOST_AROUND:] if one.first_ns > line.last_ns), None)
        size = after.first_ns - line.last_ns if after is not None else 0
        if size >= IDLE_NS and dead is None:
            texts = [
                f"{_s(size)} without a packet, no keep-alive probe",
                "then a new connection between the same ends: the old one was never ended",
            ]
            return Said(0.9, tuple(texts), at=SaidBytes(line.last_ns, 0, 0, 0))
    return _left_behind(case)


def _left_behind(case: LineCase) -> Said | None:
    """Return that a silent connection got no answer any more where a new one stood already."""
    line = case.line
    for idle in line.idles:
        since = idle.until_ns - idle.size_ns
        heard = sum(said.last_ns > since for said in (line.to_plc, line.from_plc))
        new = [
            one for one in case.group.built[-MOST_AROUND:] if since + IDLE_NS <= one.first_ns <= idle.until_ns
        ]
        if new and heard < 2:
            texts = (
                f"{_s(new[0].first_ns - since)} without a packet, no keep-alive probe",
                "then a new connection between the same ends, and no answer on the old one",
            )
            return Said(0.85, texts, at=SaidBytes(since, 0, 0, idle.packet))
    return None


# -- windows, delays, losses ---------------------------------------------------------------------------------


def _closed(line: LineFacts, said: DirectionFacts, last_ns: int) -> tuple[int, int, ClosedWindow] | None:
    """Return how often a window was closed, the longest time of it, and the first one."""
    if not line.is_wire or not said.closed:
        return None
    ends = [one.until_ns if one.until_ns is not None else line.last_ns for one in said.closed]
    longest = max(end - one.ns for end, one in zip(ends, said.closed, strict=True))
    return len(said.closed), longest, said.closed[0]


def _not_reading(case: LineCase, by_plc: bool) -> Said | None:
    line = case.line
    said = line.from_plc if by_plc else line.to_plc
    found = _closed(line, said, case.last_ns)
    if found is None or not _is_tcp(case):
        return None
    often, longest, first = found
    if longest < CLOSED_NS // 2 or (often >= 4 and longest < 3 * SECOND):
        return None
    if by_plc and often > 1 and said.closed[0].until_ns is not None and _too_fast(case):
        return None  # it reads, and too slowly
    who = "the PLC end" if by_plc else "the partner"
    texts = (f"{who} told a window of 0 {times(often)}, the longest time for {_s(longest)}",)
    sure = 0.95 if longest >= CLOSED_NS else 0.75
    way = "to-plc" if by_plc else "from-plc"
    return Said(sure, texts, way=way, at=SaidBytes(first.ns, 0, 0, first.packet))


def _flood(case: LineCase) -> Said | None:
    line, said = case.line, case.line.from_plc
    found = _closed(line, said, case.last_ns)
    rate = _too_fast(case)
    if found is not None and _is_tcp(case) and (found[0] >= 3 or (found[0] >= 2 and rate)):
        often, longest, first = found
        opened = sum(1 for one in said.closed if one.until_ns is not None)
        if (opened >= 2 and longest < 3 * SECOND) or (opened and rate):
            texts = [f"the window of the PLC end closed {times(often)} and opened again: it reads too slowly"]
            at = SaidBytes(first.ns, 0, 0, first.packet)
            return Said(0.9, (*texts, *rate), way="to-plc", at=at)
    low, high = said.lowest_window, said.highest_window
    if line.is_wire and low is not None and high >= 1024 and low * 5 < high and said.acks >= 8:
        falls = said.last_window * 3 < high or rate
        if falls and line.to_plc.bytes > 2 * (high - low) // 3:
            text = f"the window of the PLC end fell from {high} to {low}: its backlog grows"
            return Said(0.8, (text, *rate), way="to-plc")
    return Said(0.8, rate, way="to-plc") if rate else None


def _too_fast(case: LineCase) -> tuple[str, ...]:
    """Return that messages come faster than scans, if so; a closed window holds the sender back."""
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
    return (f"{jobs / taken * 1e9:.0f} messages a second, one job a scan of {ms:g} ms takes {1000 / ms:.0f}",)


def _slow_ack(case: LineCase) -> Said | None:
    line = case.line
    if not line.is_wire:
        return None
    begun = line.established_ns
    trip = 2 * RELEASED_NS if begun is None else begun - line.first_ns  # nobody saw how long it takes
    for said, way in ((line.to_plc, "to-plc"), (line.from_plc, "from-plc")):
        limit = RELEASED_NS + (trip if trip < 100 * RELEASED_NS else 0)
        slow = [one for one in said.slow if one.after_ns <= limit]
        near = [one for one in said.slow if limit < one.after_ns <= limit + NEAR_NS]
        if len(slow) < 3 or len(slow) * 6 < min(said.segments, 256) or len(near) * 3 > len(slow):
            continue  # a sender with a period meets ACKs by chance: then before and after them, too
        if _has_period(said, line.from_plc if said is line.to_plc else line.to_plc, [*slow, *near]):
            continue
        usual = median(one.wait_ns for one in slow)
        texts = (
            f"{count(len(slow), 'small write')} of {said.segments} waited {usual / 1e6:.0f} ms for an ACK, "
            "and the next one left with it",
        )
        return Said(0.92 if len(slow) > 4 else 0.75, texts, way=way, at=slow[0].write)
    return None


def _has_period(said: DirectionFacts, other: DirectionFacts, slow: Sequence[LateAck]) -> bool:
    """Return whether writes that waited neither for an ACK nor for an answer came after the same time."""
    waited, answers = {one.write.at for one in slow}, [write.ns for write in other.writes]
    others = [
        b.ns - a.ns
        for a, b in pairwise(said.writes)
        if a.at not in waited and bisect(answers, a.ns) == bisect(answers, b.ns)
    ]
    usual = median(one.wait_ns + one.after_ns for one in slow)
    return len(others) > 2 and 0.75 * usual <= median(others) <= 1.33 * usual


def _loss(case: LineCase) -> Said | None:
    line = case.line
    if not _is_tcp(case):
        return None
    best: Said | None = None
    for said, way in ((line.to_plc, "to-plc"), (line.from_plc, "from-plc")):
        odd = said.resent + said.late
        if odd and odd * 200 >= said.segments and (odd >= 3 or odd * 12 >= said.segments):
            share = odd / max(said.segments + said.resent, 1)
            texts = [f"{said.resent} segments sent again, {said.late} came late, of {said.segments}"]
            if said.missing:
                texts.append(f"{said.missing} bytes are missing in the capture")
            at = said.first_of("resent") or said.first_of("early")
            sure = 0.92 if odd > 4 else 0.8 if odd > 2 else 0.6
            found = Said(sure, (*texts, f"{share:.1%}"), way=way, at=at)
        elif said.missing and not said.resent:
            at = said.first_of("missing")
            text = (
                f"{said.missing} bytes are missing in the capture only: their ACK is there, no copy of them"
            )
            found = Said(0.75, (text,), way=way, at=at)
        else:
            continue
        best = found if best is None or found.confidence > best.confidence else best
    return best


# -- the rows ------------------------------------------------------------------------------------------------


def _s(ns: int) -> str:
    return f"{ns / 1e9:.3g} s"


def _listener_end(line: LineFacts) -> tuple[bytes, int]:
    return line.partner_end if line.plc_calls else line.plc_end


def _from_listener(line: LineFacts) -> str:
    return "to-plc" if line.plc_calls else "from-plc"


def _to_listener(line: LineFacts) -> str:
    return "from-plc" if line.plc_calls else "to-plc"


def _lives_at(line: LineFacts, ns: int) -> bool:
    """Return whether a connection stands, and is no corpse."""
    if not line.is_built or (line.end is not None and line.end.ns <= ns):
        return False
    return _outage(line) is None and (line.last_ns > ns or ns - line.last_ns < IDLE_NS)


def _of(judge: Callable[[LineFacts, Receiver | None], Said | None]) -> Callable[[LineCase], Said | None]:
    return lambda case: judge(case.line, case.receiver)


LOSES: Final = ("dead-link", "plc-not-reading", "partner-not-reading", "no-keep-alive")
RULES: Final = (
    CauseRule("address", _address, (Mend("let one end call and the other listen, on one port"),)),
    CauseRule(
        "second-client",
        _second_client,
        (Mend("end the first connection before, or give the second client a CONNECT and a port of its own"),),
        ("address",),
    ),
    CauseRule(
        "refused",
        _refused,
        (Mend("start the listener, or mend the port: the passive end must be up before the call"),),
        ("address", "second-client"),
    ),
    CauseRule(
        "filtered",
        _filtered,
        (Mend("look for a firewall, a wrong address, a cable: nothing comes back"),),
        ("address", "second-client"),
    ),
    CauseRule(
        "wrong-tsap",
        lambda case: wrong_tsap(case.line),
        (Mend("make the TSAPs of both ends the same: the local one here is the remote one there"),),
    ),
    CauseRule(
        "tls-refused",
        lambda case: tls_refused(case.line),
        (Mend("let both ends speak TLS, and trust the certificate that the other one shows"),),
    ),
    CauseRule(
        "line-errors",
        lambda case: line_errors(case.line),
        (
            Mend(
                "give both ends the same baud rate, data bits, parity and stop bits; look at cable and shield"
            ),
        ),
    ),
    CauseRule(
        "closes-each-message",
        _closes,
        (Mend("let the partner keep its connection open; each close costs a receiver its 80C5"),),
        ("wrong-tsap", "tls-refused", "second-client"),
    ),
    CauseRule(
        "reconnect-storm",
        _storm,
        (Mend("find who ends the connections, and why, before the retry"),),
        ("wrong-tsap", "tls-refused", "second-client", "closes-each-message"),
    ),
    CauseRule(
        "no-keep-alive",
        _no_keep_alive,
        (Mend("set KeepAliveTimeInterval below the time after which the way forgets an idle connection"),),
    ),
    CauseRule(
        "dead-link",
        _dead_link,
        (Mend("look at cable, switch and power of the end that is silent; keep-alive tells it sooner"),),
        ("no-keep-alive",),
    ),
    CauseRule(
        "resets",
        _resets,
        (Mend("look what the end that resets it says of it: a crash, a timeout, a limit"),),
        (
            "second-client",
            "no-keep-alive",
            "wrong-tsap",
            "tls-refused",
            "dead-link",
            "plc-not-reading",
            "partner-not-reading",
        ),
        ("frame-short", "frame-long", "adhoc-missing", "padding", "header", "byte-order", "reconnect-storm"),
    ),
    CauseRule(
        "plc-not-reading",
        lambda case: _not_reading(case, True),
        (Mend("keep EN_R at 1, or call the block in each scan: nobody takes the bytes"),),
    ),
    CauseRule(
        "partner-not-reading",
        lambda case: _not_reading(case, False),
        (Mend("let the partner read, or send less often"),),
    ),
    CauseRule(
        "flood",
        _flood,
        (Mend("let the partner send less often, call the block faster, or take several messages a job"),),
        weakened_by=("plc-not-reading",),
    ),
    CauseRule(
        "slow-ack",
        _slow_ack,
        (Mend("send a message with one write, or set TCP_NODELAY at the end that waits"),),
    ),
    CauseRule("loss", _loss, (Mend("look at cable, duplex, switch and radio of this way"),), LOSES),
    *(
        CauseRule(row.cause, _of(row.judge), row.mend, row.silenced_by, row.weakened_by)
        for row in FRAME_JUDGES
    ),
)


def findings_of(case: LineCase) -> tuple[LineFinding, ...]:
    """Return what is found, the surest first."""
    found: list[LineFinding] = []
    by_cause: dict[str, Said] = {}
    for rule in RULES:
        said = rule.judge(case)
        if said is not None:
            by_cause[rule.cause] = said
    for rule in RULES:
        said = by_cause.get(rule.cause)
        if said is not None and not any(cause in by_cause for cause in rule.silenced_by):
            share = 0.5 if any(cause in by_cause for cause in rule.weakened_by) else 1.0
            found.append(LineFinding(rule.cause, said.confidence * share, said, said.mend or rule.mend))
    return tuple(sorted(found, key=lambda one: -one.confidence))


def cases_of(lines: Sequence[LineFacts], receivers: tuple[Receiver, ...], last_ns: int) -> Iterator[LineCase]:
    """Yield the cases of one capture."""
    between: dict[_Ends, list[LineFacts]] = {}
    calls: dict[tuple[str, bytes, bytes], list[LineFacts]] = {}
    for line in lines:
        between.setdefault(_between(line), []).append(line)
        calls.setdefault(_hosts(line), []).append(line)
    groups = {ends: EndsGroup(tuple(found)) for ends, found in between.items()}
    reverses = {hosts: EndsGroup(tuple(found)) for hosts, found in calls.items()}
    only = _only_receiver(lines, receivers)
    fitting = [_receiver_of(line, receivers, only) for line in lines]
    before: dict[tuple[str, tuple[bytes, int]], deque[LineFacts]] = {}
    for line, receiver in zip(lines, fitting, strict=True):
        older = before.setdefault((line.protocol, _listener_end(line)), deque(maxlen=MOST_AROUND))
        kind, caller, listener = _hosts(line)
        reverse = reverses.get((kind, listener, caller), _NOBODY) if caller != listener else _NOBODY
        yield LineCase(line, groups[_between(line)], tuple(older), reverse, receiver, receivers, last_ns)
        older.append(line)


def _receiver_of(line: LineFacts, receivers: Sequence[Receiver], only: Receiver | None) -> Receiver | None:
    """Return who takes the messages of a conversation; tell the facts how much a job of it reads."""
    found = next((one for one in receivers if one.fits(line)), None)
    if only is not None and line.is_built and (line.protocol == "udp") == only.is_datagram:
        found = only if not only.connect or only.has_address_of(line) else None
    if found is not None and found.need and not found.adhoc and not line.is_wire:
        line.reads = Reads(found.need, found.interval_ns)
    return found


def _only_receiver(lines: Sequence[LineFacts], receivers: Sequence[Receiver]) -> Receiver | None:
    """Return the only receiver of a project whose ports no conversation has.

    It is meant all the same where a foreign capture has one of its addresses; without its name where it holds
    what two ends said to each other, and nothing else.
    """
    known = [one for one in receivers if not one.is_serial]
    if len(known) != 1 or any(known[0].fits(line) or line.connect is not None for line in lines):
        return None
    if any(known[0].has_address_of(line) for line in lines):
        return known[0]
    is_one = len({_between(line) for line in lines}) == 1
    return known[0]._replace(instance="", connect="") if is_one else None


_Ends = tuple[str, bytes, tuple[bytes, int]]
_NOBODY: Final = EndsGroup(())


def _between(line: LineFacts) -> _Ends:
    caller = line.plc_end if line.plc_calls else line.partner_end
    return line.protocol, caller[0], _listener_end(line)


def _hosts(line: LineFacts) -> tuple[str, bytes, bytes]:
    protocol, caller, listener = _between(line)
    return protocol, caller, listener[0]
