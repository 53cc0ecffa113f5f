"""Telegrams of senders whose type has drifted from ours: a member more, fewer, wider or narrower."""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from tests.udt.blind_cases import content, random_type, realistic
from trcvtui.errors import UserError
from trcvtui.udt.compare.fit import Fit, rank
from trcvtui.udt.layout.layout import Layout, Profile, lay_out, profiles_for
from trcvtui.udt.layout.values import decode_leaf
from trcvtui.udt.types import ELEMENTARY, Array, Elementary, Member, StringType, Struct, Type

LEAST_MEMBERS = 8
MESSAGES = (4, 6, 8, 12)
MORE = ("BOOL", "BYTE", "INT", "UINT", "DINT", "REAL", "LREAL")
WIDER = {
    "BYTE": "WORD", "USINT": "UINT", "SINT": "INT", "INT": "DINT", "UINT": "UDINT", "REAL": "LREAL",
    "WORD": "DWORD", "DINT": "LINT", "UDINT": "ULINT", "DWORD": "LWORD",
}  # fmt: skip
WIDTHS = WIDER | {wide: narrow for narrow, wide in WIDER.items()}
DRIFTS = ("more", "fewer", "width")


class DriftCase(NamedTuple):
    """Our type, the sender's layout of its own, and its messages."""

    ours: Struct
    theirs: Layout
    profile: Profile
    messages: list[bytes]


def make(seed: int, kind: str) -> DriftCase | None:
    """Return a case, of kind "" one that did not drift; None where this seed makes none."""
    rng = random.Random(f"{seed}-drift-{kind}")
    ours = random_type(rng)
    theirs = drifted(ours, kind, rng)
    profiles = profiles_for(ours)
    profile = profiles[0] if rng.random() < 0.4 else rng.choice(profiles)
    if theirs is None or len(ours.members) < LEAST_MEMBERS:
        return None
    try:
        layout = lay_out(theirs, profile.rules, "T")
        lay_out(ours, profile.rules, "T")
    except UserError:
        return None
    sent = [content(layout, realistic, seed, number, rng) for number in range(rng.choice(MESSAGES))]
    return DriftCase(ours, layout, profile, sent)


def drifted(ours: Struct, kind: str, rng: random.Random) -> Struct | None:
    """Return the type with one change, in it or in a STRUCT below it; None where it has none."""
    at, members = rng.randrange(len(ours.members)), list(ours.members)
    below = drifted_below(members[at].type, kind, rng)
    if below is not None:
        members[at] = replace(members[at], type=below)
        return replace(ours, members=tuple(members))
    match kind:
        case "more":
            added = StringType(rng.randint(4, 20)) if rng.random() < 0.15 else ELEMENTARY[rng.choice(MORE)]
            members.insert(at + rng.randint(0, 1), Member("added", added))
        case "fewer":
            del members[at]
        case "width":
            found = [n for n, one in enumerate(members) if other_width(one, rng)]
            if not found:
                return None
            at = rng.choice(found)
            members[at] = other_width(members[at], rng) or members[at]
    return replace(ours, members=tuple(members))


def drifted_below(type_: Type, kind: str, rng: random.Random) -> Type | None:
    match type_:
        case Array(element=element):
            inner = drifted_below(element, kind, rng)
            return inner and replace(type_, element=inner)
        case Struct(members=members) if kind != "fewer" or len(members) > 1:
            return drifted(type_, kind, rng)
    return None


def other_width(member: Member, rng: random.Random) -> Member | None:
    type_ = member.type
    if isinstance(type_, StringType):
        return replace(
            member, type=replace(type_, length=max((type_.length or 80) + rng.choice([-1, 1, 4, 9]), 1))
        )
    if isinstance(type_, Elementary) and type_.name in WIDTHS:
        return replace(member, type=ELEMENTARY[WIDTHS[type_.name]])
    return None


# -- measuring -----------------------------------------------------------------------------------------------


def values(found: Fit, message: bytes) -> dict[str, object]:
    """Return the values as a reading finds them, by path."""
    layout, cause = found.layout, found.cause
    unit = bytes(max(-cause.front, 0)) + message[max(cause.front, 0) :]
    unit = (cause.of_all(unit[: layout.size]) if cause.of_all else unit).ljust(layout.size, b"\0")
    read: dict[str, object] = {}
    for leaf in layout.leaves():
        raw = unit[leaf.offset : leaf.offset + leaf.size]
        is_text = isinstance(leaf.type, StringType)
        is_number = not is_text and not leaf.coding.code.endswith("s")
        change = cause.of_member.get(leaf.size) if cause.of_member and is_number else None
        change = cause.of_text if is_text else change
        read[leaf.path] = decode_leaf(layout, leaf, change(raw) if change else raw)
    return read


def is_right(case: DriftCase, found: Fit) -> bool:
    """Return whether a reading finds what was sent in every member that both have, of every message."""
    size = found.layout.size + found.cause.front + found.cause.back
    ours = {leaf.path for leaf in lay_out(case.ours, case.profile.rules, "T").leaves()}
    shared = ours & {leaf.path for leaf in case.theirs.leaves()}
    for message in case.messages:
        sent = {
            leaf.path: decode_leaf(case.theirs, leaf, message[leaf.offset : leaf.offset + leaf.size])
            for leaf in case.theirs.leaves()
        }
        read = values(found, message)
        differs = any(path in read and read[path] != sent[path] for path in shared)
        if len(message) % size or differs:
            return False
    return True


class DriftTally(NamedTuple):
    """Cases: all, sure and right; seeds of those falsely sure, of those with the right reading not first."""

    cases: int
    sure: int
    false: list[int]
    late: list[int]

    def __str__(self) -> str:
        """Return the figures in one line."""
        late = f"right but not first {len(self.late)}"
        return f"{self.cases} cases: sure and right {self.sure}, falsely sure {len(self.false)}, {late}"


def measure(seeds: Iterable[int], kind: str, most: int) -> DriftTally:
    """Return the figures of the first `most` cases."""
    cases = sure = 0
    false, late = [], []
    for seed in seeds:
        case = make(seed, kind)
        if case is None:
            continue
        fits = rank(case.ours, case.messages, "T")
        right = [one for one in fits if is_right(case, one)]
        best, cases = fits[0], cases + 1
        if right and right[0].rank > 1:
            late.append(seed)
        if best.fits_best and best not in right:
            false.append(seed)
        sure += best.fits_best and best in right
        if cases == most:
            break
    return DriftTally(cases, sure, false, late)
