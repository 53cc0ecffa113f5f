"""Ranks the readings of bytes by evidence. A reading is a profile, with or without another cause.

Rule: a tie is reported as a tie, with the difference of the tied readings. A reading "fits best" only if the
members themselves are evidence for it, and clearly more than for any other reading.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from trcvtui.udt.compare.causes import CAUSES, DRIFTS, NONE, FitCause
from trcvtui.udt.compare.compare import describe_difference
from trcvtui.udt.compare.doubt import CLEAR_OF_DRIFT, find_doubt, reading_name, reads_same_values
from trcvtui.udt.compare.drift import find_drifted_layouts
from trcvtui.udt.compare.extra_bytes import surrounding_causes, usual_length
from trcvtui.udt.compare.reading import EvidenceCache, JudgedLayout, Reading, Reason
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

MOST_LENGTHS: Final = 256  # the last messages, whose lengths are judged
MOST_FITS: Final = 64  # readings returned
FAR_BEHIND: Final = 40.0  # points behind the best one at which a reading with a cause is dropped
MOST_NAMED: Final = 3  # readings that a sentence names
TIE_POINTS: Final = 1.0  # a smaller lead is no evidence
# Limits of the search for the type in longer messages; a place below MISPLACED_POINTS is given up.
MOST_PLACED_AND_MESSAGES: Final = (32, 4)
MISPLACED_POINTS: Final = -30.0


@dataclass(frozen=True, slots=True)
class Fit:
    """One way to read the bytes: the profiles that read them so, the other cause, the points and reasons.

    `members` are the points of the members in `score`. `reasons` begin with the weightiest reason. Only the
    first reading can be `fits_best`. If that reading does not fit best, `doubt` says why. If one odd value
    is the only objection, the first reading is still `is_ahead`. `same` are the readings with the same
    value at the same place for every member. No byte decides between such readings, only how rare their
    causes are, so all share a `rank`.
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
        return f"{self.profile}, {self.cause}" if self.cause.kind else str(self.profile)

    def __str__(self) -> str:
        also = "; ".join(str(profile) for profile in self.profiles[1:])
        return f"{self.name} ({self.score:+.1f}" + (f"; the same for these bytes: {also})" if also else ")")


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

    Each of `messages` is one or several telegrams, sent at once, from the first byte on. If not
    `framed`, `messages` are pieces of one stream that begins with a message, and their lengths mean
    nothing. Among equal readings, the layout `sender`, probable for the type's source, comes first. Then
    comes `own`, the rules of our side.
    """
    judged = messages[-MOST_LENGTHS:] if framed else [b"".join(messages)] if messages else []
    chosen = profiles_for(type_) if profiles is None else tuple(profiles)
    own = own or LAYOUTS[DEFAULT_LAYOUT]
    chosen = tuple(sorted(chosen, key=lambda one: (one.layout != sender, _strangeness(one, own))))
    lengths = [len(message) for message in judged]
    different = set(lengths)
    known: EvidenceCache = {}
    layouts = group_same_layouts(type_, chosen, name, own)
    tried: list[tuple[tuple[Profile, ...], Layout, Iterable[FitCause]]] = []
    for same, layout in layouts:
        size = layout.size
        fitting = [cause for cause in CAUSES if cause is NONE or cause.can_fit(size, framed, different)]
        fitting += surrounding_causes(size, usual_length(lengths)) if framed else ()
        tried.append((same, layout, fitting))
    if framed and judged:
        drifted = find_drifted_layouts(layouts, judged, own)
        tried += [(same, layout, (cause,)) for same, layout, cause in drifted]
    found = []
    for same, layout, causes in tried:
        look = JudgedLayout(layout, known)
        ways = [*causes, *_find_likeliest_place(look, judged)] if framed else causes
        readings = (Reading.judge(same, look, cause, judged, framed) for cause in ways)
        found += [reading for reading in readings if reading is not None]
    if framed and len(messages) > len(judged):
        limit = Reason(0.0, "", f"only the last {len(judged)} of {len(messages)} messages are judged")
        for reading in found:
            reading.others.append(limit)
    found.sort(key=lambda one: (not one.has_length, -one.score, *one.strangeness(sender, own)))
    return tuple(_merge_readings(found, judged))


def _find_likeliest_place(look: JudgedLayout, messages: Sequence[bytes]) -> tuple[FitCause, ...]:
    """Return the type's likeliest place in longer messages, judged only by its members, or ()."""
    size, length = look.layout.size, usual_length([len(message) for message in messages])
    members, most = look.members[: MOST_PLACED_AND_MESSAGES[0]], MOST_PLACED_AND_MESSAGES[1]
    some = list(dict.fromkeys(message for message in messages if len(message) == length))[-most:]
    best, place = 0.0, None
    ways = [*surrounding_causes(size, length)]
    for cause in ways:
        points = 0.0
        for member in members:
            start, stop = member.start + cause.front, member.stop + cause.front
            known = [look.evidence(member, message[start:stop]) for message in some]
            points += sum(one.points for one in known if one is not None)
            if points < MISPLACED_POINTS:
                break
        if points > best:
            best, place = points, cause
    # The more places are tried, the likelier one of them fits by chance.
    return () if place is None else (place._replace(is_guess=True, cost=place.cost - math.log(len(ways))),)


def _strangeness(profile: Profile, own: LayoutRules) -> int:
    """Return 0 for our own profile, 1 for our layout, 2 for the usual byte order of a layout, else 3."""
    if profile.layout == own.name:
        return int(profile.byte_order != own.byte_order)
    return 2 if profile.byte_order == LAYOUTS[profile.layout].byte_order else 3


def tied_readings(fits: Sequence[Fit]) -> tuple[Fit, ...]:
    """Return the best reading, and all readings that tie with it by points."""
    return tuple(fit for fit in fits if fit.score > fits[0].score - TIE_POINTS)


def drop_near_drifts(fits: Sequence[Fit]) -> list[Fit]:
    """Drop drifts not clearly ahead of all readings without drift: of many, some lead by chance."""
    ahead = max((fit.score for fit in fits if fit.cause.kind not in DRIFTS), default=0.0) + CLEAR_OF_DRIFT
    return [fit for fit in fits if fit.cause.kind not in DRIFTS or fit.score > ahead]


def verdict(fits: Sequence[Fit]) -> str:
    """Return the result of the ranking in one sentence."""
    if not fits:
        return "this type cannot be laid out"
    best, tied = fits[0], tied_readings(fits)
    if best.fits_best:
        other = next((one for one in fits if one.rank > 1), None)
        after = f"; next is {other.name} ({other.score:+.1f})" if other else ""
        return f"{best} fits best{after}"
    if best.score <= 0 or (best.members <= 0 and len(tied) == 1):
        return f"no layout fits these bytes well; the nearest is {best}"
    if len(tied) == 1:
        return f"{best} has the most points, but is not sure: {best.doubt}"
    names = " and ".join(f"'{fit.name}'" for fit in tied[:MOST_NAMED])
    more = f" (and {len(tied) - MOST_NAMED} more)" if len(tied) > MOST_NAMED else ""
    return f"these bytes do not decide between {names}{more}: {_describe_difference(tied[0], tied[1])}"


def _describe_difference(one: Fit, other: Fit) -> str:
    if one.cause != other.cause:
        causes = [str(fit.cause) or "the layout alone" for fit in (one, other)]
        return f"the first has the cause {causes[0]}, the second {causes[1]}"
    return f"the first two differ only in {describe_difference(one.layout, other.layout)}"


def _merge_readings(found: list[Reading], messages: Sequence[bytes]) -> Iterator[Fit]:
    merged: dict[object, list[Reading]] = {}
    for reading in found:
        merged.setdefault(reading.meaning_key, []).append(reading)
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
    """Yield groups of rows that read the same values as the best row of the group."""
    rest = rows
    while rest:
        best = rest[0][0]
        near = [row for row in rest if any(reads_same_values(best, one) for one in row)]
        yield near
        rest = [row for row in rest if row not in near]
