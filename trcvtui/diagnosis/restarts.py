"""Finds half-open connections: the caller has restarted, and the called end has not noticed that."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from trcvtui.diagnosis.line_facts import LineFacts, SegmentFacts
from trcvtui.snapshots.doctor import Finding
from trcvtui.wording import SECOND, format_ns

RECONNECT_NS: Final = 10 * SECOND
ANSWER_NS: Final = SECOND // 2
MOST_LATER: Final = 64  # conversations that one is compared with


def find_half_open(
    lines: Sequence[LineFacts], groups: Iterable[Sequence[LineFacts]]
) -> Mapping[LineFacts, LineFacts]:
    """Return the half-open connections, each with the call that proves it.

    Each of `groups` has the connections of one caller to one listener.
    """
    found: dict[LineFacts, LineFacts] = {}
    at_ends: dict[frozenset[tuple[bytes, int]], list[LineFacts]] = {}
    for line in lines:
        if line.protocol == "tcp":
            at_ends.setdefault(frozenset((line.plc_end, line.partner_end)), []).append(line)
    for same in at_ends.values():
        old = None
        for number, line in enumerate(same):
            later = same[number + 1 : number + MOST_LATER]
            if old is not None and old.end is None and line.has_begin and _is_answered_by_old(line, later):
                found[old] = line
            old = line if line.is_built else old
    for group in groups:
        resets = [one for one in group if one.end is not None and one.end.kind == "rst" and one.is_built]
        for one in resets:
            new = next((each for each in group[-MOST_LATER:] if _has_forgotten(one, each)), None)
            found |= {one: new} if new is not None else {}
    return found


def _is_answered_by_old(new: LineFacts, later: Sequence[LineFacts]) -> bool:
    """Return whether a SYN is answered by an ACK of the old connection, or by RST before the next call."""
    is_built = any(one.is_built and one.first_ns - new.first_ns < RECONNECT_NS for one in later)
    return bool(new.listener.challenges) or (new.listener.reset is not None and not new.is_built and is_built)


def _has_forgotten(old: LineFacts, new: LineFacts) -> bool:
    """Return whether a caller, after a new call, answers bytes on its old connection with RST."""
    end, caller, spoken = old.end, old.caller.writes, old.listener.writes
    if (
        end is None
        or end.by_plc != bool(old.plc_calls)
        or end.is_ours
        or not (new.is_built and new.has_begin)
    ):
        return False
    is_silent = not caller or caller[-1].ns < new.first_ns  # on the old connection, since the new call
    is_answer = bool(spoken) and new.first_ns < spoken[-1].ns <= end.ns < spoken[-1].ns + ANSWER_NS
    return is_silent and is_answer and old.first_ns < new.first_ns


def judge_half_open(old: LineFacts, restarts: Mapping[LineFacts, LineFacts]) -> Finding | None:
    if (new := restarts.get(old)) is None:
        return None
    side = "the PLC end" if new.plc_calls else "the partner"
    before = [one.ns for flow in (old.to_plc, old.from_plc) for one in flow.writes if one.ns < new.first_ns]
    silence = format_ns(new.first_ns - max(before, default=old.first_ns))
    texts = (
        f"{side} calls again after {silence} of silence while its old connection is still open",
        "the other end still answers for the old connection, and the caller resets it (RST)",
    )
    at = SegmentFacts(new.first_ns, 0, 0, new.first_packet)
    way, is_fact = "from-plc" if new.plc_calls else "to-plc", bool(new.listener.challenges)
    return Finding(0.95 if is_fact else 0.85, texts, way, at, is_fact=is_fact)
