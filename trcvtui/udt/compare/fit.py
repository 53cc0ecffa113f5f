"""Which reading fits? Profiles, with or without another cause, ranked by what the bytes at hand say.

Rule: a tie is a tie, and is told with what the tied readings differ in. "Fits best" is said only where the
members themselves speak for a reading, and clearly more than for any other one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from trcvtui.udt.compare.beside import surrounding_causes, usual_length
from trcvtui.udt.compare.causes import CAUSES, DRIFTS, NONE, FitCause
from trcvtui.udt.compare.compare import describe_difference
from trcvtui.udt.compare.doubt import CLEAR_OF_DRIFT, find_doubt, reading_name, reads_same_values
from trcvtui.udt.compare.drift import find_drifted_layouts
from trcvtui.udt.compare.reading import EvidenceCache, LayoutView, Reading, Reason
from trcvtui.udt.layout.layout import (
    DEFAULT_LAYOUT,
    LAYOUTS,
    Layout,
    LayoutRules,
    Profile,
    group_same_layouts,
    profiles_for,
)
from trcvtui.udt.types import Type

MOST_LENGTHS: Final = 256  # messages, the last ones, of which the lengths are looked at
MOST_FITS: Final = 64  # that are returned; those without a cause all
FAR_BEHIND: Final = 40.0  # points that a reading with a cause may be worse than the best one, and be returned
MOST_NAMED: Final = 3  # members that a sentence names
TIE_POINTS: Final = 1.0  # points: less is no evidence
# Where members lie in longer messages is looked for with so many members and messages, and given up below.
MOST_PLACED_AND_MESSAGES: Final = (32, 4)
MISPLACED_POINTS: Final = -30.0


@dataclass(frozen=True, slots=True)
class Fit:
    """One way to read the bytes: all profiles that mean it, the cause beside them, the points and why.

    `members` are the members' own points, part of `score`. `reasons` have the weightiest first. `fits_best`
    is said of one reading at most; `doubt` says why it is not said of the first one, which `is_ahead` where
    one odd value is all that speaks against it. `same` are the readings
    that find the same value at the same place for every member: they share one `rank` (1, 1, 3), for no
    byte speaks for one of them, and differ at most in how rare their causes are.
    """

    profiles: tuple[Profile, ...]
    layout: Layout
    score: float
    reasons: tuple[Reason, ...]
    cause: FitCause = NONE
    members: float = 0.0
    fits_best: bool = False
    is_ahead: bool = False
    doubt: str = ""
    rank: int = 1
    same: tuple[str, ...] = ()

    @property
    def profile(self) -> Profile:
        return self.profiles[0]

    @property
    def name(self) -> str:
        """Return the first profile and the cause."""
        return f"{self.profile}, {self.cause}" if self.cause.kind else str(self.profile)

    def __str__(self) -> str:
        """Return the profiles by name, with their points."""
        also = ", ".join(str(profile) for profile in self.profiles[1:])
        return f"{self.name} ({self.score:+.1f})" + (f", the same for these bytes: {also}" if also else "")


def rank(
    type_: Type,
    messages: Sequence[bytes],
    name: str = "",
    *,
    framed: bool = True,
    profiles: Iterable[Profile] | None = None,
    own: LayoutRules | None = None,
    sender: str = "",
) -> tuple[Fit, ...]:
    """Return every reading of the bytes, the best first.

    `messages` are what the sender sent at once, each from its first byte, one telegram or several; not
    `framed`: they are pieces of one stream that begins with a message, and their lengths say nothing. `own`
    are the rules of our own side: it is named first where several mean the same, after the layout that the
    source of the type is likely to have, `sender`.
    """
    seen = messages[-MOST_LENGTHS:] if framed else [b"".join(messages)] if messages else []
    asked = profiles_for(type_) if profiles is None else tuple(profiles)
    own = own or LAYOUTS[DEFAULT_LAYOUT]
    asked = tuple(sorted(asked, key=lambda one: (one.layout != sender, _strangeness(one, own))))
    lengths = [len(message) for message in seen]
    different = set(lengths)
    known: EvidenceCache = {}
    layouts = group_same_layouts(type_, asked, name, own)
    tried: list[tuple[tuple[Profile, ...], Layout, Iterable[FitCause]]] = []
    for same, layout in layouts:
        size = layout.size
        fitting = [cause for cause in CAUSES if cause is NONE or cause.can_fit(size, framed, different)]
        fitting += surrounding_causes(size, usual_length(lengths)) if framed else ()
        tried.append((same, layout, fitting))
    if framed and seen:
        drifted = find_drifted_layouts(layouts, seen, own)
        tried += [(same, layout, (cause,)) for same, layout, cause in drifted]
    found = []
    for same, layout, causes in tried:
        look = LayoutView(layout, known)
        ways = [*causes, *_find_likeliest_place(look, seen)] if framed else causes
        readings = (Reading.judge(same, look, cause, seen, framed) for cause in ways)
        found += [reading for reading in readings if reading is not None]
    if framed and len(messages) > len(seen):
        said = Reason(0.0, "", f"only the last {len(seen)} of {len(messages)} messages are judged")
        for reading in found:
            reading.others.append(said)
    found.sort(key=lambda one: (not one.has_length, -one.score, *one.strangeness(sender, own)))
    return tuple(_merge_readings(found, seen))


def _find_likeliest_place(look: LayoutView, messages: Sequence[bytes]) -> tuple[FitCause, ...]:
    """Return the likeliest place of the members in longer messages, whatever the bytes beside them are."""
    size, length = look.layout.size, usual_length([len(message) for message in messages])
    members, most = look.members[: MOST_PLACED_AND_MESSAGES[0]], MOST_PLACED_AND_MESSAGES[1]
    some = list(dict.fromkeys(message for message in messages if len(message) == length))[-most:]
    best, place = 0.0, None
    ways = [*surrounding_causes(size, length)]
    for cause in ways:
        points = 0.0
        for member in members:
            start, stop = member.start + cause.front, member.stop + cause.front
            said = [look.evidence(member, message[start:stop]) for message in some]
            points += sum(one.points for one in said if one is not None)
            if points < MISPLACED_POINTS:
                break
        if points > best:
            best, place = points, cause
    return () if place is None else (place._replace(is_guess=True, cost=place.cost - math.log(len(ways))),)


def _strangeness(profile: Profile, own: LayoutRules) -> int:
    """Return the lower the usual: our own profile, our own layout, a vendor's byte order, others."""
    if profile.layout == own.name:
        return int(profile.byte_order != own.byte_order)
    return 2 if profile.byte_order == LAYOUTS[profile.layout].byte_order else 3


def leaders(fits: Sequence[Fit]) -> tuple[Fit, ...]:
    """Return the best one and those that are tied with it by their points."""
    return tuple(fit for fit in fits if fit.score > fits[0].score - TIE_POINTS)


def drop_near_drifts(fits: Sequence[Fit]) -> list[Fit]:
    """Return the readings, but the drifts only where they are clearly ahead: of many some are, by chance."""
    ahead = max((fit.score for fit in fits if fit.cause.kind not in DRIFTS), default=0.0) + CLEAR_OF_DRIFT
    return [fit for fit in fits if fit.cause.kind not in DRIFTS or fit.score > ahead]


def verdict(fits: Sequence[Fit]) -> str:
    """Return what the ranking says, in one sentence."""
    if not fits:
        return "this type cannot be laid out"
    best, tied = fits[0], leaders(fits)
    if best.fits_best:
        other = next((one for one in fits if one.rank > 1), None)
        after = f"; next is {other.name} ({other.score:+.1f})" if other else ""
        return f"{best} fits best{after}"
    if best.score <= 0 or (best.members <= 0 and len(tied) == 1):
        return f"no profile fits these bytes well; the least bad is {best}"
    if len(tied) == 1:
        return f"{best} is ahead, but that is not sure: {best.doubt}"
    names = " and ".join(fit.name for fit in tied[:MOST_NAMED])
    more = f" (and {len(tied) - MOST_NAMED} more)" if len(tied) > MOST_NAMED else ""
    return f"{names}{more} cannot be told apart by these bytes: {_describe_difference(tied[0], tied[1])}"


def _describe_difference(one: Fit, other: Fit) -> str:
    if one.cause != other.cause:
        causes = [str(fit.cause) or "no other cause" for fit in (one, other)]
        return f"the first two are {' and '.join(causes)}"
    return f"the first two differ only in {describe_difference(one.layout, other.layout)}"


def _merge_readings(found: list[Reading], messages: Sequence[bytes]) -> Iterator[Fit]:
    merged: dict[object, list[Reading]] = {}
    for reading in found:
        merged.setdefault(reading.meaning, []).append(reading)
    rows = list(merged.values())[:MOST_FITS]
    rows = [row for row in rows if not row[0].cause.kind or row[0].score >= rows[0][0].score - FAR_BEHIND]
    doubt = find_doubt([row[0] for row in rows], messages)
    odd = f"machines seldom send such a value: {rows[0][0].odd}" if rows and rows[0][0].odd else ""
    number = 0
    for together in _group_same_rows(rows) if messages else [rows]:
        rank = number + 1
        for row in together:
            first, number = row[0], number + 1
            profiles = tuple(dict.fromkeys(profile for one in row for profile in one.profiles))
            yield Fit(
                profiles, first.look.layout, first.score, first.reasons(), first.cause,
                round(first.own_points, 2), number == 1 and not (doubt or odd), number == 1 and not doubt,
                (doubt or odd) if number == 1 else "",
                rank, tuple(reading_name(other[0]) for other in together if other is not row),
            )  # fmt: skip


def _group_same_rows(rows: list[list[Reading]]) -> Iterator[list[list[Reading]]]:
    """Yield the rows, those that read the same together, each of them less than `CLEAR` below their best."""
    left = rows
    while left:
        best = left[0][0]
        near = [row for row in left if any(reads_same_values(best, one) for one in row)]
        yield near
        left = [row for row in left if row not in near]
