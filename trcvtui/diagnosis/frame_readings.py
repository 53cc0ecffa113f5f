"""A reading of frames that makes sense but differs from the PLC's reading, with all differences.

Rule: message = bytes before + members + bytes after. The cause is the first difference, in the order bytes
before (`header`), packing (`padding`), byte order, bytes after (`frame-long`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from msgspec.structs import replace

from trcvtui.diagnosis.data_values import describe_odd_values, make_data_layout
from trcvtui.diagnosis.receiver import Receiver
from trcvtui.diagnosis.remedies import NO_OFFER, RemedyOffer, finding_to_plc, offer_frame_reset
from trcvtui.snapshots.doctor import Finding, Remedy
from trcvtui.wording import count

if TYPE_CHECKING:
    from trcvtui.udt.compare.fit import Fit
    from trcvtui.udt.layout.rules import LayoutRules
    from trcvtui.udt.types import Type

CLEAR_LEAD: Final = 6.0  # points of `fit`, ahead of the PLC's reading
NOT_KNOWN: Final = "not known"
UNSURE_CONFIDENCE: Final = 0.8  # of a reading with bytes that nothing explains


def judge_readings(
    frames: list[bytes], receiver: Receiver, type_: Type, rules: LayoutRules
) -> Finding | None:
    from trcvtui.udt.compare.fit import drop_near_drifts, rank

    if len(frames) < 2 and len(frames[0]) != receiver.need:
        return _judge_single_frame(frames, receiver, type_, rules)
    fits = drop_near_drifts(rank(type_, frames, receiver.type_name, own=rules, sender=receiver.sender))
    own = next((one for one in fits if not one.cause.kind and _has_rules(one, rules)), None)
    best = _choose_plainest(fits, rules)
    if best is None or own is best or best.members <= 0 or (own is not None and own.rank == best.rank):
        return None
    ahead = best.score - own.score if own is not None else 40.0
    is_own_size = own is not None and own.layout.size == len(frames[0])
    is_clear = best.is_ahead or (ahead > 4 * CLEAR_LEAD and best.members > 2 * CLEAR_LEAD)
    if ahead < CLEAR_LEAD or (is_own_size and not is_clear):
        return None
    sides = _describe_extra_bytes(best, frames)
    cause, offer = _classify_reading(best, frames, receiver, rules, sides)
    if not cause:
        return None
    ours = "none" if own is None else f"{own.score:+.1f}"
    said = f"{len(frames)} frames read as {best.name}: {best.score:+.1f} points; read as the PLC does: {ours}"
    sure = 0.95 if ahead > (2 if best.is_ahead else 4) * CLEAR_LEAD else 0.8
    if len(sides) > 1 and any(NOT_KNOWN in side for side in sides):
        sure = min(sure, UNSURE_CONFIDENCE)
    texts = (said, *(reason.text for reason in best.reasons[:2]))
    return replace(finding_to_plc(receiver, sure, texts, None, offer), cause=cause)


def _choose_plainest(fits: Sequence[Fit], rules: LayoutRules) -> Fit | None:
    """Return the best reading, or one nearly as good that differs less from the PLC's reading."""
    near = [one for one in fits if one.score > fits[0].score - CLEAR_LEAD]
    return min(near, key=lambda one: (one.cause.front > 0) + (not _has_rules(one, rules)), default=None)


def _judge_single_frame(
    frames: list[bytes], receiver: Receiver, type_: Type, rules: LayoutRules
) -> Finding | None:
    """Read the only message in another layout of exactly its size, if machines send such values."""
    from trcvtui.udt.compare.fit import rank

    size = len(frames[0])
    found = [
        one
        for one in rank(type_, frames, receiver.type_name, own=rules, sender=receiver.sender)
        if not one.cause.kind
        and one.layout.size == size
        and one.members > 0
        and not describe_odd_values(receiver._replace(rules=one.layout.rules, need=size), frames)
    ]
    if not found or (len(found) > 1 and found[1].score > found[0].score - CLEAR_LEAD):
        return None  # one message cannot decide between two layouts
    best = found[0]
    text = f"the only message has {size} bytes, like {receiver.type_name} read as {best.name}"
    offer = _offer_partner_layout(f"lay DATA out as the partner does: {best.profile}", best, receiver, rules)
    return replace(
        finding_to_plc(receiver, 0.7, (f"{text}; a job waits for {receiver.need}",), None, offer),
        cause="padding",
    )


def _has_rules(one: Fit, rules: LayoutRules) -> bool:
    return any((p.layout, p.byte_order) == (rules.name, rules.byte_order) for p in one.profiles)


def _classify_reading(
    best: Fit, frames: list[bytes], receiver: Receiver, rules: LayoutRules, sides: Sequence[str]
) -> tuple[str, RemedyOffer]:
    """Return the cause that the best reading points to, or "" if it points to none, and the remedy."""
    from trcvtui.udt.compare.causes import BYTE_TOO_MANY, HEADER, SWAP_CAUSES, TRAILER
    from trcvtui.udt.compare.drift import MOST_LEAVES
    from trcvtui.udt.compare.extra_bytes import has_length_field

    kind, order = best.cause.kind, best.layout.rules.byte_order
    if kind in {swap.kind for swap in SWAP_CAUSES}:
        swap = Remedy("swap the words or bytes of each number, as the partner does")
        return "byte-order", RemedyOffer((swap,))
    if kind not in (None, HEADER, TRAILER, BYTE_TOO_MANY):
        return "", NO_OFFER
    own, has_other_order = make_data_layout(receiver), order != rules.byte_order
    own_size = receiver.need if kind is None or own is None else own.size
    is_packed = best.layout.size != own_size or not (has_other_order or _has_rules(best, rules))
    text = ""
    if is_packed:
        text = f"lay DATA out as the partner does: {best.profile}"
    elif has_other_order:
        text = f"read DATA as the partner sends it: {order}-endian"
    cause = "padding" if is_packed else "byte-order"
    if not sides:
        return cause, _offer_partner_layout(text, best, receiver, rules)
    has_numbers = any(leaf.size > 1 for leaf in best.layout.leaves(0, MOST_LEAVES))
    if not has_numbers and not has_length_field(best.cause, frames, receiver.need):
        return "", NO_OFFER  # single bytes read equally well from any place
    cause = "header" if best.cause.front else cause if text else "frame-long"
    declare = f"declare {' and '.join(sides)}: then a frame has {len(frames[0])} bytes"
    leave = "" if text else "; or let the partner omit these bytes"
    return cause, RemedyOffer((Remedy("; ".join(filter(None, (f"{declare}{leave}", text)))),))


def _describe_extra_bytes(best: Fit, frames: Sequence[bytes]) -> list[str]:
    """Return a text for the bytes before the members, and a text for the bytes after them."""
    from trcvtui.udt.compare.causes import cut_messages
    from trcvtui.udt.compare.extra_bytes import extra_evidence

    cause, size = best.cause, best.layout.size
    if cause.front < 0 or cause.back < 0:
        return []
    units, extras, *_ = cut_messages(cause, size, frames, True, len(frames))
    said = [extra_evidence(cause, a, unit, b) for (a, b), unit in zip(extras, units, strict=True)]
    sides = []
    if cause.front:
        words = _name_extra_content([before for before, _ in extras], [one.before for one in said if one])
        sides.append(f"{count(cause.front, 'byte')} before the members ({words})")
    if cause.back:
        words = _name_extra_content([after for _, after in extras], [one.after for one in said if one])
        them = "them" if sides else "the members"
        sides.append(f"{count(cause.back, 'byte')} after {them} ({words})")
    return sides


def _name_extra_content(parts: Sequence[bytes], names: Sequence[str]) -> str:
    if names and all(names):
        return Counter(names).most_common(1)[0][0]  # a sum of few bytes is another one by chance
    size = len(parts[0])
    fixed = parts[0].hex(" ").upper() if size <= 8 else f"{parts[0][:8].hex(' ').upper()} .."
    if len(set(parts)) == 1:
        return "zeros" if not any(parts[0]) else f"always {fixed}"
    return f"a counter and bytes {NOT_KNOWN}" if _has_counter(parts) else NOT_KNOWN


def _has_counter(parts: Sequence[bytes]) -> bool:
    """Return whether a byte changes by the same step from frame to frame."""
    if len(parts) < 4:
        return False
    for column in zip(*parts, strict=True):
        steps = {(b - a) % 256 for a, b in pairwise(column)}
        if len(steps) == 1 and steps != {0}:
            return True
    return False


def _offer_partner_layout(text: str, best: Fit, receiver: Receiver, rules: LayoutRules) -> RemedyOffer:
    profile, data = best.profile, receiver.data
    ours = (("layout", rules.name), ("byte_order", rules.byte_order), ("text", rules.text.name))
    theirs = zip(ours, (profile.layout, profile.byte_order, profile.text or rules.text.name), strict=True)
    other = [f"{key}={has}" for (key, had), has in theirs if has != had]
    if not (data and other):
        return RemedyOffer((Remedy(text),))
    first, *more = other
    line, size = f"set data {data} {' '.join(other)}", best.layout.size
    mends = [Remedy(f"also set {one}", None, f"data.{data}.{one}") for one in more]
    cured = receiver._replace(rules=best.layout.rules, room=size, need=min(receiver.need, size))
    if receiver.need == receiver.room:
        cured = cured._replace(need=size)
    reset = offer_frame_reset(receiver) if cured.need != receiver.need else ()
    return RemedyOffer((Remedy(text, line, f"data.{data}.{first}"), *mends, *reset), cured)
