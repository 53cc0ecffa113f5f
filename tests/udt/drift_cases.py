"""Telegrams of senders whose type has drifted from ours: a member more, fewer, wider or narrower."""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from tests.udt.blind_cases import content, random_type, realistic
from trcvtui.errors import UserError
from trcvtui.udt.compare.fit import Fit, fit
from trcvtui.udt.layout.layout import Layout, Profile, lay_out, profiles_for
from trcvtui.udt.layout.values import decode_leaf
from trcvtui.udt.types import ELEMENTARY, Elementary, Member, StringType, Struct

MORE = ("BOOL", "BYTE", "INT", "UINT", "DINT", "REAL", "LREAL")
WIDER = {
    "BYTE": "WORD",
    "USINT": "UINT",
    "SINT": "INT",
    "INT": "DINT",
    "UINT": "UDINT",
    "REAL": "LREAL",
    "WORD": "DWORD",
    "DINT": "LINT",
    "UDINT": "ULINT",
    "DWORD": "LWORD",
}
WIDTHS = WIDER | {wide: narrow for narrow, wide in WIDER.items()}
KINDS = ("more", "fewer", "width")


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
    theirs = _drifted(ours, kind, rng)
    profiles = profiles_for(ours)
    profile = profiles[0] if rng.random() < 0.4 else rng.choice(profiles)
    if theirs is None or len(ours.members) < 3:
        return None
    try:
        layout = lay_out(theirs, profile.rules, "T")
        lay_out(ours, profile.rules, "T")
    except UserError:
        return None
    count = rng.choice([1, 1, 2, 4])
    sent = [content(layout, realistic, seed, number, rng) for number in range(count)]
    return DriftCase(ours, layout, profile, sent)


def _drifted(ours: Struct, kind: str, rng: random.Random) -> Struct | None:
    at, members = rng.randrange(len(ours.members)), list(ours.members)
    match kind:
        case "more":
            added = StringType(rng.randint(4, 20)) if rng.random() < 0.15 else ELEMENTARY[rng.choice(MORE)]
            members.insert(at + rng.randint(0, 1), Member("added", added))
        case "fewer":
            del members[at]
        case "width":
            found = [n for n, one in enumerate(members) if _other_width(one, rng)]
            if not found:
                return None
            at = rng.choice(found)
            members[at] = _other_width(members[at], rng) or members[at]
    return replace(ours, members=tuple(members))


def _other_width(member: Member, rng: random.Random) -> Member | None:
    type_ = member.type
    if isinstance(type_, StringType):
        return replace(member, type=replace(type_, length=(type_.length or 80) + rng.choice([-1, 1, 4, 9])))
    if isinstance(type_, Elementary) and type_.name in WIDTHS:
        return replace(member, type=ELEMENTARY[WIDTHS[type_.name]])
    return None


# -- measuring -----------------------------------------------------------------------------------------------


def values(found: Fit, message: bytes) -> dict[str, object]:
    """Return the values as a reading finds them, the members' own by path."""
    layout, cause = found.layout, found.cause
    unit = bytes(max(-cause.front, 0)) + message[max(cause.front, 0) :]
    unit = (cause.of_all(unit[: layout.size]) if cause.of_all else unit).ljust(layout.size, b"\0")
    read: dict[str, object] = {}
    for leaf in layout.leaves():
        raw = unit[leaf.offset : leaf.offset + leaf.size]
        is_number = not isinstance(leaf.type, StringType) and not leaf.coding.code.endswith("s")
        change = cause.of_member.get(leaf.size) if cause.of_member and is_number else None
        read[leaf.path] = decode_leaf(layout, leaf, change(raw) if change else raw)
    return read


def is_right(case: DriftCase, found: Fit) -> bool:
    """Return whether a reading finds what was sent in every member that both have, and no other one."""
    for message in case.messages:
        sent = {
            leaf.path: decode_leaf(case.theirs, leaf, _raw(leaf, message)) for leaf in case.theirs.leaves()
        }
        ours = {leaf.path for leaf in lay_out(case.ours, case.profile.rules, "T").leaves()}
        read = values(found, message)
        if any(path not in sent or sent[path] != value for path, value in read.items() if path in ours):
            return False
        if len(message) % max(found.layout.size + found.cause.front + found.cause.back, 1):
            return False
    return True


def _raw(leaf: object, message: bytes) -> bytes:
    return message[leaf.offset : leaf.offset + leaf.size]  # type: ignore[attr-defined]


class DriftTally(NamedTuple):
    """Cases: all, sure and right, falsely sure, the right reading of the first rank, among the readings."""

    cases: int
    sure: int
    false: list[int]
    first: int
    late: list[int]  # a right one is among them, not of the first rank

    def __str__(self) -> str:
        """Return the figures in one line."""
        return (
            f"{self.cases} cases: sure and right {self.sure}, falsely sure {len(self.false)}, "
            f"first {self.first}, right but later {len(self.late)}"
        )


def measure(seeds: Iterable[int], kind: str, most: int) -> DriftTally:
    """Return the figures of the first `most` cases."""
    cases = sure = first = 0
    false, late = [], []
    for seed in seeds:
        case = make(seed, kind)
        if case is None:
            continue
        fits = fit(case.ours, case.messages, "T")
        right = [one for one in fits if is_right(case, one)]
        is_first = any(one.rank == 1 for one in right)
        cases, first = cases + 1, first + is_first
        if right and not is_first:
            late.append(seed)
        if fits[0].fits_best and fits[0] not in right:
            false.append(seed)
        sure += fits[0].fits_best and fits[0] in right
        if cases == most:
            break
    return DriftTally(cases, sure, false, first, late)
