"""Doubt: why the best reading of bytes is not sure. Rule: another possible reading is named, not hidden."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from trcvtui.udt.compare.causes import BYTE_TOO_FEW, DRIFTS, FEWER
from trcvtui.udt.compare.reading import Reading, is_number

CLEAR_LEAD: Final = 5.0  # points ahead of the next other reading
CLEAR_OF_DRIFT: Final = 7.4  # ahead of a drift: padding may hide that a member or two differ
CLEAR_LEAD_OF_FEWER: Final = 10.0  # ahead of a type with a member fewer: the next ones may fit its place
CLEAR_LEAD_IN_ORDER: Final = 3.0  # ahead of one in the same byte order, by `fair_score`
LEAD_LESS_WHERE_ODD: Final = 2.0  # points less if the other one has a value that machines do not send
CLEAR_OWN_LEAD: Final = 3.0  # of the members' points; below it a rare cause is no evidence against the other
LEAST_OWN_POINTS: Final = 4.0  # of the members


def find_doubt(ranked: Sequence[Reading], messages: Sequence[bytes]) -> str:
    """Return why the first reading is not sure, or "" if it is sure."""
    if not ranked or not messages:
        return "there are no bytes"
    best = ranked[0]
    return _own_doubt(best, messages) or next(filter(None, (_rival(best, one) for one in ranked[1:])), "")


def _own_doubt(best: Reading, messages: Sequence[bytes]) -> str:
    """Return why a reading by itself is not sure, or "" if there is no objection."""
    if not best.has_length:
        return "no message has the length of the type"
    others = len(messages) - best.cutting.fitting
    if others and len(messages) > 1:
        return f"{others} of {len(messages)} messages have another length"
    if best.cutting.several > 1 and len(messages) > 1:
        return "every message is several times as long as the type"
    if best.cause.kind == BYTE_TOO_FEW and any(
        is_number(member) and not parts for member, parts in best.read
    ):
        return "the missing byte belongs to a number"
    ending = {message[-2:] for message in messages}
    last = best.read[-1][0] if best.read else None
    if best.cause.kind is None and last and last.leaf.size > 1 and is_number(last) and ending <= {b"\r\n"}:
        return "every message ends in CR LF, which is read as a number"
    if best.cause.kind in DRIFTS:
        return "whether and where the sender's type differs is a guess"
    if not best.has_meaning:
        return "the bytes before or behind the members have no known meaning"
    if best.filled:
        return f"{best.filled}: a member may lie there"
    if best.narrow:
        return best.narrow
    if number := best.find_exchanged():
        return f"{number} is likelier with its bytes exchanged"
    if best.own_points < LEAST_OWN_POINTS:
        return "the members themselves are too little evidence"
    if len(set(b"".join(messages))) == 1:
        return "all bytes are the same"
    return ""


def _rival(best: Reading, other: Reading) -> str:
    """Return why another reading may be right instead, or "" if it cannot be right."""
    is_one_way = other.order_key == best.order_key or (best.cause.kind is None and best.widest_number <= 2)
    if is_one_way and best.cause.kind in (None, other.cause.kind) and reads_same_values(best, other):
        return ""
    is_other_place = other.cause.kind not in DRIFTS and other.places_key != best.places_key
    if not is_other_place and all(
        best.values_by_path.get(path) == has for path, has in other.values_by_path.items()
    ):
        return ""
    is_rare = other.order_key != best.order_key and abs(other.own_points - best.own_points) < CLEAR_OWN_LEAD
    clear_of_drift = CLEAR_LEAD_OF_FEWER if other.cause.kind == FEWER else CLEAR_OF_DRIFT
    clear = clear_of_drift - best.cause.cost if other.cause.kind in DRIFTS else CLEAR_LEAD
    clear -= LEAD_LESS_WHERE_ODD if other.odd else 0.0
    if other.score > best.score - clear + (other.cause.cost if is_rare else 0.0):
        if reads_same_values(best, other):
            return f"{reading_name(other)} ({other.score:+.1f}) reads the same values at the same places"
        if abs(other.own_points - best.own_points) < 0.01 and other.order_key != best.order_key:
            return f"{reading_name(other)} ({other.score:+.1f}) reads other values that are just as likely"
        return f"{reading_name(other)} ({other.score:+.1f}) has nearly as many points"
    if best.cause.kind is None and other.cause.kind is not None:
        return ""  # it needs two rare things: a cause, and numbers that are all round
    ahead = CLEAR_LEAD - best.order_points if other.order_key != best.order_key else CLEAR_LEAD_IN_ORDER
    if other.fair_score > (best.score if other.has_plain else best.fair_score) - ahead:
        return f"{reading_name(other)} may be right: as likely if multiples of 256 do not count"
    return ""


def reads_same_values(best: Reading, other: Reading) -> bool:
    return other.score > best.score - CLEAR_LEAD and other.values_key == best.values_key


def reading_name(reading: Reading) -> str:
    return f"{reading.profiles[0]}, {reading.cause}" if reading.cause.kind else str(reading.profiles[0])
