"""Another layout for DATA that fits the received bytes, by the size of a message or by its values.

Rule: an offer needs evidence: the exact size of another layout, or a clear suspicion.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from trcvtui.project.project import DataDecl
from trcvtui.udt.layout.layout import BYTE_ORDERS, Layout, Leaf, group_same_layouts, lay_out, profiles_for
from trcvtui.udt.layout.rules import LayoutChoice, rules_for
from trcvtui.udt.types import Elementary, Enumeration, ValueKind
from trcvtui.wording import count

# Rule: a suspicion needs two members, one of them of four bytes or more, and none that speaks against it (one
# where there is no other). Small numbers look sensible in either order and say nothing.

# Rule: a value between sensible and senseless is doubtful and says nothing.

SENSIBLE_REAL: Final = (1e-5, 1e8)
SENSELESS_REAL: Final = (1e-15, 1e18)


def judge_swap(row: Elementary, read: float, swapped: float) -> int:
    """Return 1 if the value makes sense only when swapped, -1 if only as read, else 0."""
    if row.kind is ValueKind.REAL:
        good, bad = is_sensible_real, is_senseless_real
        return (bad(read) and good(swapped)) - (good(read) and bad(swapped))
    large = 1 << 8 * (row.size - 1)  # needs its highest byte
    small = 1 << 4 * row.size  # does not need the upper half of its bytes
    read, swapped = abs(read), abs(swapped)
    return (read >= large and 0 < swapped < small) - (swapped >= large and 0 < read < small)


def is_sensible_real(value: float, within: tuple[float, float] = SENSIBLE_REAL) -> bool:
    """Return whether machines send numbers of this magnitude; False for 0, which proves nothing."""
    low, high = within
    return math.isfinite(value) and low <= abs(value) <= high


def is_senseless_real(value: float) -> bool:
    """Return whether a number is not finite, or has a magnitude that no machine sends."""
    low, high = SENSELESS_REAL
    return not math.isfinite(value) or 0 < abs(value) < low or abs(value) > high


MOST_LEAVES: Final = 256  # members that are examined
MOST_NAMED: Final = 2  # members in the sentence
OTHER_BYTE_ORDER: Final = {"little": "big", "big": "little"}
NUMBER_KINDS: Final = frozenset({ValueKind.INTEGER, ValueKind.REAL})


@dataclass(frozen=True, slots=True)
class SwappedMember:
    """A member, its value in the layout's byte order, and its value in the other byte order."""

    path: str
    as_read: int | float
    swapped: int | float


@dataclass(frozen=True, slots=True)
class SwapSuspicion:
    """The members that make sense only in the byte order `other`, not in `order`."""

    order: str
    other: str
    suspects: tuple[SwappedMember, ...]

    def __str__(self) -> str:
        named = self.suspects[:MOST_NAMED]
        swapped = " and ".join(f"{s.path} = {_format_number(s.swapped)}" for s in named)
        as_read = " and ".join(_format_number(s.as_read) for s in named)
        more = len(self.suspects) - len(named)
        others = f" (and {count(more, 'more member')})" if more else ""
        return (
            f"members look swapped: {swapped} in {self.other}-endian, but {as_read} in {self.order}-endian, "
            f"as DATA is read now{others}"
        )


def byte_order_suspicion(layout: Layout, content: bytes) -> SwapSuspicion | None:
    """Return the members that make sense only with swapped bytes, or None without clear evidence."""
    order = layout.rules.byte_order
    here, there = BYTE_ORDERS[order], BYTE_ORDERS[OTHER_BYTE_ORDER[order]]
    suspects: list[SwappedMember] = []
    clear = asked = 0
    for leaf in layout.leaves(0, min(layout.leaf_count, MOST_LEAVES)):
        row = _find_number_type(leaf)
        part = content[leaf.offset : leaf.offset + leaf.size]
        if row is None or len(part) < leaf.size or leaf.bit is not None:
            continue
        (read,), (swapped,) = struct.unpack(here + row.code, part), struct.unpack(there + row.code, part)
        asked += read != swapped
        verdict = judge_swap(row, read, swapped)
        if verdict < 0:
            return None
        if verdict:
            suspects.append(SwappedMember(leaf.path or "the value", read, swapped))
            clear += leaf.size >= 4
    if not clear or len(suspects) < min(2, asked):
        return None
    suspects.sort(key=lambda suspect: not isinstance(suspect.as_read, float))  # REALs show it best
    return SwapSuspicion(order, OTHER_BYTE_ORDER[order], tuple(suspects))


def _find_number_type(leaf: Leaf) -> Elementary | None:
    row = leaf.type.base if isinstance(leaf.type, Enumeration) else leaf.type
    if isinstance(row, Elementary) and row.kind in NUMBER_KINDS and row.size > 1:
        return row
    return None


def _format_number(value: float) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


class LayoutOffer(NamedTuple):
    choice: LayoutChoice
    why: str


def find_layout_offer(decl: DataDecl, size: int | None, content: bytes) -> LayoutOffer | None:
    """Return a layout for DATA. Messages had `size` bytes; `content` is the newest message or a part of it.

    If `size` is None or fits, only the byte order may change. Return None if no other layout fits better.
    """
    if size is not None and size != decl.size:
        found = _find_layout_of_size(decl, size)
        order = _order(found, content) if found is not None else None
        if found is None or order is None:
            return None
        name = found.rules.name
        why = f"{count(size, 'byte')} came: the size of {decl.type_name} in the layout {name}"
        return LayoutOffer(LayoutChoice(name, None if rules_for(name).byte_order == order else order), why)
    suspicion = byte_order_suspicion(decl.layout, content)
    if suspicion is None:
        return None
    choice = decl.choice._replace(byte_order=suspicion.other)
    return LayoutOffer(choice, f"the members make sense as {suspicion.other}-endian")


def _find_layout_of_size(decl: DataDecl, size: int) -> Layout | None:
    """Return the first layout with this size; layouts with the same byte order are tried first."""
    own = decl.layout.rules
    laid_out = group_same_layouts(decl.type, profiles_for(decl.type))
    found = [layout for _, layout in laid_out if layout.size == size]
    same = [layout for layout in found if layout.rules.byte_order == own.byte_order]
    return next(iter([*same, *found]), None)


def _order(layout: Layout, content: bytes) -> str | None:
    """Return the byte order in which the members make sense, None where that is not clear."""
    own = layout.rules.byte_order
    if byte_order_suspicion(layout, content) is not None:
        return OTHER_BYTE_ORDER[own]
    swapped = lay_out(layout.type, replace(layout.rules, byte_order=OTHER_BYTE_ORDER[own]))
    has_order = any(map(_find_number_type, layout.leaves(0, min(layout.leaf_count, MOST_LEAVES))))
    return own if not has_order or byte_order_suspicion(swapped, content) is not None else None


def make_view_command(decl: DataDecl, choice: LayoutChoice) -> str:
    words = []
    for name, now, wanted in zip(choice._fields, decl.choice, choice, strict=True):
        if wanted != now:
            words.append(f"{name}={'' if wanted is None else str(wanted).lower()}")
    return f"set data {decl.name} {' '.join(words)}" if words else ""


def make_choice(layout: str, byte_order: str, text: str) -> LayoutChoice:
    """Return these settings as a choice; a setting that the layout implies is None."""
    rules = rules_for(layout)
    return LayoutChoice(
        layout,
        None if rules.byte_order == byte_order else byte_order,
        None if text in ("", rules.text.name) else text,
    )
