"""Finds counters, REALs, whole numbers and constants in messages of one size, from their bytes alone.

Rule: the proof of each member says how many of all messages agree with it. Other bytes stay bytes.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import isfinite
from typing import Final, NamedTuple

FEW_MESSAGES: Final = 4  # fewer show nothing
MOST_MESSAGES: Final = 500  # that are examined
MOST_BYTES: Final = 4096  # of a message
LEAST_SHARE: Final = 0.9  # of the steps that are alike
MOST_STEP: Final = 1000
REAL_RANGE: Final = 1e-4, 1e7  # magnitudes that plants measure
MOST_BYTE_RANGE: Final = 224  # largest span of the values of a number whose high byte never changes
MOST_REAL_RATIO: Final = 1e4  # between the largest and the smallest of one REAL
BIG, LITTLE = "big", "little"
_STRUCT_ORDERS: Final = {BIG: ">", LITTLE: "<"}


class FoundMember(NamedTuple):
    """A member. `proof` is a sentence. `order` is "" if the type has no byte order or any order fits."""

    at: int
    size: int
    type: str
    order: str
    proof: str


class FoundType(NamedTuple):
    """All bytes of a message as members in one byte order."""

    members: tuple[FoundMember, ...]
    order: str

    def st(self, name: str) -> str:
        """Return the type as ST. A counter at byte 4 has the name `counter_4`."""
        lines = [f"TYPE {name} :", "STRUCT"]
        for one in self.members:
            word = {"": "bytes", "REAL": "value", "INT": "number"}.get(one.type, "counter")
            type_ = one.type or ("BYTE" if one.size == 1 else f"ARRAY[0..{one.size - 1}] OF BYTE")
            lines.append(f"    {word}_{one.at} : {type_};  (* {one.proof} *)")
        return "\n".join((*lines, "END_STRUCT", "END_TYPE", ""))


def find_message_type(messages: Sequence[bytes]) -> FoundType | None:
    """Return the members of messages of one size. Return None for too few messages or without members."""
    size = len(messages[0]) if messages else 0
    if len(messages) < FEW_MESSAGES or size > MOST_BYTES or any(len(one) != size for one in messages):
        return None
    messages = messages[:MOST_MESSAGES]
    found, at = [], 0
    while at < size:
        member = _find_member(messages, at, size)
        if member is not None:
            found.append(member)
        at += member.size if member is not None else 1
    weights = Counter[str]()
    for one in found:
        weights[one.order] += one.size
    if not found:
        return None
    order = max((BIG, LITTLE), key=lambda each: weights[each])
    kept = [one for one in found if one.order in (order, "")]
    return FoundType(tuple(_fill_gaps(kept, messages, size)), order)


def _fill_gaps(found: Sequence[FoundMember], messages: Sequence[bytes], size: int) -> Iterator[FoundMember]:
    """Yield the members and, between the members, constant bytes and changing bytes separately."""
    at = 0
    for one in (*found, FoundMember(size, 0, "", "", "")):
        while at < one.at:
            end = at + 1
            fixed = _is_constant_byte(messages, at)
            while end < one.at and _is_constant_byte(messages, end) == fixed:
                end += 1
            value = messages[0][at : min(end, at + 8)].hex(" ").upper() + (" .." if end > at + 8 else "")
            yield FoundMember(at, end - at, "", "", f"always {value}" if fixed else "they change")
            at = end
        if one.size:
            yield one
            at = one.at + one.size


def _is_constant_byte(messages: Sequence[bytes], at: int) -> bool:
    return len({one[at] for one in messages}) == 1


def _find_member(messages: Sequence[bytes], at: int, size: int) -> FoundMember | None:
    if at % 2 == 0 and at + 4 <= size:
        found = _find_counter(messages, at, 4) or _find_real(messages, at)
        if found is not None:
            return found
    if at % 2 == 0 and at + 2 <= size:
        found = _find_counter(messages, at, 2) or _find_number(messages, at)
        if found is not None:
            return found
    return _find_counter(messages, at, 1)


def _find_counter(messages: Sequence[bytes], at: int, size: int) -> FoundMember | None:
    """Return a number that changes by the same step nearly each time."""
    type_ = {4: "UDINT", 2: "UINT", 1: "USINT"}[size]
    for order in (BIG, LITTLE):
        low = at + size - 1 if order == BIG else at
        high = at if order == BIG else at + size - 1
        if _is_constant_byte(messages, low):
            continue
        if size == 4 and _is_constant_byte(messages, high) and messages[0][high]:
            continue  # a constant high byte that is not 0 is no counter of 4 bytes
        values = [int.from_bytes(one[at : at + size], order) for one in messages]  # type: ignore[arg-type]
        steps = Counter((b - a) % (1 << 8 * size) for a, b in pairwise(values))
        step, often = steps.most_common(1)[0]
        if size == 2 and _is_constant_byte(messages, high) and values[-1] <= values[0]:
            continue  # only its low byte counts, and it has wrapped
        if 0 < step <= min(MOST_STEP, 1 << 8 * size - 3) and often >= LEAST_SHARE * (len(values) - 1):
            proof = f"counts by {step} in {often} of {len(values) - 1} steps"
            return FoundMember(at, size, type_, order if size > 1 else "", proof)
    return None


def _find_real(messages: Sequence[bytes], at: int) -> FoundMember | None:
    """Return a REAL, if in one byte order all values have a magnitude that is usual in plants."""
    spreads: dict[str, tuple[float, float, float]] = {}
    if len({one[at : at + 4] for one in messages}) < 2:
        return None
    for order, mark in _STRUCT_ORDERS.items():
        values = [struct.unpack_from(f"{mark}f", one, at)[0] for one in messages]
        sizes = [abs(value) for value in values if value]
        least, most = REAL_RANGE
        if not sizes or not all(isfinite(v) and least <= v <= most for v in sizes):
            continue
        if max(sizes) <= MOST_REAL_RATIO * min(sizes):
            spreads[order] = max(sizes) / min(sizes), min(values), max(values)
    if not spreads:
        return None
    order = min(spreads, key=lambda each: spreads[each][0])
    _, low, high = spreads[order]
    proof = f"{len(messages)} of {len(messages)} values lie between {low:.6g} and {high:.6g}"
    return FoundMember(at, 4, "REAL", order, proof)


def _find_number(messages: Sequence[bytes], at: int) -> FoundMember | None:
    """Return two bytes as a whole number if one byte has far fewer different values than the other byte."""
    different = [len({one[at + n] for one in messages}) for n in (0, 1)]
    low, high = max(different), min(different)
    if low < 2 * FEW_MESSAGES or high * 4 > low:
        return None
    order = BIG if different[0] == high else LITTLE
    values = [int.from_bytes(one[at : at + 2], order, signed=True) for one in messages]  # type: ignore[arg-type]
    if high == 1 and max(values) - min(values) > MOST_BYTE_RANGE:
        return None  # a byte with any value beside a constant one is no number
    proof = f"{len(messages)} values between {min(values)} and {max(values)}"
    return FoundMember(at, 2, "INT", order, proof)
