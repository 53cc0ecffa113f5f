"""Telegrams of hidden types: a random type, values as machines send them, a sender's profile, and one cause.

Nothing here knows how the lab judges; the values are drawn in ways of their own.
"""

from __future__ import annotations

import math
import random
import string
from collections.abc import Callable, Iterable
from typing import Literal, NamedTuple

from trcvtui.errors import UserError
from trcvtui.udt.compare.fit import Fit, rank
from trcvtui.udt.layout.coding import coding_of
from trcvtui.udt.layout.layout import Layout, Leaf, Profile, lay_out, layout_shape, profiles_for
from trcvtui.udt.layout.values import encode
from trcvtui.udt.types import (
    DAY,
    ELEMENTARY,
    MS,
    SECOND,
    Array,
    Elementary,
    Enumeration,
    Member,
    Pointer,
    StringType,
    Struct,
    Subrange,
    Type,
    ValueKind,
)

CAUSES = ("none", "header", "trailer", "word-swap", "byte-swap", "short", "long")
FILLS = ("round", "round-16", "zeros", "constant", "ones", "text", "random-numbers", "small", "negative")
USUAL = ("REAL",) * 3 + ("LREAL", "INT", "INT", "UINT", "DINT", "DINT", "UDINT", "BOOL", "BOOL", "BYTE")
RARE = ("WORD", "DWORD", "USINT", "SINT", "TIME", "DT", "DATE", "TOD", "LINT", "ULINT", "LTIME", "CHAR")


class Case(NamedTuple):
    """A type, what came, and what is hidden: the sender's profile, the cause, its number of bytes."""

    type: Type
    messages: list[bytes]
    profile: Profile
    cause: str
    n: int
    seed: int


# -- types ---------------------------------------------------------------------------------------------------


def random_type(chance: random.Random) -> Struct:
    """Return a STRUCT of 2 to about 30 leaves."""
    count = chance.choice([2, 3, 4, 5, 6, 8, 10, 14])
    return Struct("T", tuple(Member(f"m{n}", _member(chance, 0)) for n in range(count)))


def _member(chance: random.Random, depth: int) -> Type:
    drawn = chance.random()
    if drawn < 0.12:
        return StringType(chance.choice([1, 4, 6, 8, 10, 15, 20, 32, 80]), wide=chance.random() < 0.1)
    if drawn < 0.18:
        count = chance.randint(2, 6)
        step = chance.choice([1, 1, 1, 10])
        values = tuple((f"v{n}", n * step) for n in range(count))
        is_named = chance.random() < 0.6
        base = ELEMENTARY[chance.choice(["INT", "INT", "USINT", "DINT"])] if is_named else ELEMENTARY["INT"]
        return Enumeration("E", base, values, is_named)
    if drawn < 0.20:
        return Subrange(ELEMENTARY["INT"], 0, chance.choice([10, 100, 1000]))
    if drawn < 0.32 and depth < 2:
        low = chance.choice([0, 1])
        return Array(((low, low + chance.randint(1, 6)),), _member(chance, depth + 1))
    if drawn < 0.42 and depth < 2:
        count = chance.randint(1, 4)
        return Struct("", tuple(Member(f"s{n}", _member(chance, depth + 1)) for n in range(count)))
    return ELEMENTARY[chance.choice(USUAL if chance.random() < 0.8 else RARE)]


# -- values --------------------------------------------------------------------------------------------------

Draw = Callable[[Leaf, Layout, random.Random], object]


def realistic(leaf: Leaf, layout: Layout, chance: random.Random) -> object:
    """Return a value as machines send it."""
    type_ = leaf.type
    if isinstance(type_, StringType):
        return _text(type_, layout, chance)
    if isinstance(type_, Enumeration):
        return chance.choice(type_.values)[1]
    if isinstance(type_, Subrange):
        return chance.randint(type_.low, type_.high)
    if isinstance(type_, Pointer):
        return "16#0"
    return _elementary(layout.rules.storage(type_), leaf, layout, chance)


def _text(type_: StringType, layout: Layout, chance: random.Random) -> str:
    most = layout.rules.text.length(type_)
    kind = chance.random()
    if kind < 0.12:
        return ""
    if kind < 0.4:
        word = chance.choice(["Line", "Pump", "M", "LOT-", "Rezept ", "Station_", "OK", "ÖL"])
        return (word + str(chance.randint(0, 9999)))[:most]
    letters = string.ascii_uppercase + string.digits if kind < 0.8 else string.ascii_letters + " -_./"
    return "".join(chance.choices(letters, k=chance.randint(1, most)))


def _elementary(row: Elementary, leaf: Leaf, layout: Layout, chance: random.Random) -> object:
    match row.kind:
        case ValueKind.BOOL:
            return chance.random() < 0.5
        case ValueKind.REAL:
            return _real(chance)
        case ValueKind.CHARACTER:
            return chance.choice(string.ascii_uppercase + string.digits)
        case ValueKind.BITS:
            return chance.choice(
                [0, 1, 3, chance.randrange(1 << 8 * row.size), 1 << chance.randrange(8 * row.size)]
            )
        case ValueKind.INTEGER:
            return _whole(row, chance)
    unit = row.unit_ns or MS
    match row.kind:
        case ValueKind.DURATION:
            ns = chance.choice([100 * MS, SECOND, 60 * SECOND, MS]) * chance.randint(0, 5000)
        case ValueKind.TIME_OF_DAY:
            ns = chance.randrange(86_400) * SECOND + chance.choice([0, chance.randrange(1000) * MS])
        case ValueKind.DATE:
            ns = chance.randint(13_000, 22_000) * DAY
        case _:
            ns = chance.randint(13_000, 22_000) * DAY + chance.randrange(86_400) * SECOND
    if row.code.endswith("s") or row.name == "S5TIME":
        return None
    count = max(min((ns - row.epoch_ns) // unit, row.limits[1]), 0)
    return _shown(leaf, layout, count)


def _shown(leaf: Leaf, layout: Layout, count: int) -> object:
    to_value = coding_of(leaf.type, layout.rules).to_value
    return to_value(count) if to_value else count


def _real(chance: random.Random) -> float:
    drawn = chance.random()
    if drawn < 0.08:
        return 0.0
    if drawn < 0.35:
        return round(chance.uniform(-500, 2000), chance.choice([0, 1, 2]))
    if drawn < 0.45:
        return float(chance.choice([1, 2, 5, 10, 50, 100, 250, 1000, 1500]))
    if drawn < 0.6:
        return chance.gauss(0, 1) * chance.choice([0.001, 0.01, 1, 10])
    return math.exp(chance.uniform(-4, 11))


def _whole(row: Elementary, chance: random.Random) -> int:
    low, high = row.limits
    drawn = chance.random()
    if drawn < 0.1:
        return 0
    if drawn < 0.4:
        return min(chance.randint(1, 100), high)
    if drawn < 0.5 and low:
        return chance.randint(max(-1000, low), -1)
    if drawn < 0.9:
        return min(int(math.exp(chance.uniform(0, math.log(min(high, 10**7))))), high)
    return chance.randint(max(low, -(10**9)), min(high, 2 * 10**9))


# Numbers that are hard on whoever judges the byte order by them; texts and dates stay as they are.
def filled(fill: str) -> Draw:
    """Return a way to draw values in which all numbers are of one odd kind."""

    def draw(leaf: Leaf, layout: Layout, chance: random.Random) -> object:
        type_ = leaf.type
        if isinstance(type_, StringType | Pointer):
            return "" if fill in ("zeros", "constant", "ones") else realistic(leaf, layout, chance)
        row = layout.rules.storage(type_)
        if row.kind is ValueKind.BOOL:
            return False if fill == "zeros" else realistic(leaf, layout, chance)
        if row.kind is ValueKind.REAL:
            return (
                0.0
                if fill == "zeros"
                else float(256 * chance.randint(0, 400))
                if "round" in fill
                else _real(chance)
            )
        if (
            row.kind not in (ValueKind.INTEGER, ValueKind.BITS, ValueKind.DURATION)
            or row.code.endswith("s")
            or row.name == "S5TIME"
        ):
            return realistic(leaf, layout, chance) if fill != "zeros" else None
        number = _odd(fill, row, chance)
        low, high = row.limits
        return (
            _shown(leaf, layout, max(min(number, high), low))
            if row.kind is ValueKind.DURATION
            else max(min(number, high), low)
        )

    return draw


def _odd(fill: str, row: Elementary, chance: random.Random) -> int:
    size, (low, high) = row.size, row.limits
    match fill:
        case "zeros":
            return 0
        case "round":
            return (
                256 * chance.choice([chance.randint(0, 20), chance.randint(0, max(high // 256, 1))])
                if size > 1
                else 0
            )
        case "round-16":
            return (1 << 8 * (size - 1)) * chance.randint(1, 100) if size > 1 else 0
        case "constant":
            return int.from_bytes(b"\x01" * size, "little")
        case "ones":
            return -1 if low else high
        case "text":
            letters = "".join(chance.choices(string.ascii_letters + string.digits, k=size))
            return int.from_bytes(letters.encode(), chance.choice(["big", "big", "little"]))
        case "random-numbers":
            return chance.randint(low, high)
        case "negative":
            return -chance.randint(1, 300) if low else chance.randint(1, 300)
        case _:
            return chance.randint(0, 9)


# -- messages ------------------------------------------------------------------------------------------------


def content(layout: Layout, draw: Draw, seed: int, number: int, rng: random.Random) -> bytes:
    """Return message `number`: some members stay, some change a little, some are drawn anew."""
    values = {}
    for at, leaf in enumerate(layout.leaves()):
        fixed = random.Random(f"{seed}/{at}")
        stays = fixed.random() < 0.5
        value = draw(leaf, layout, fixed if stays else rng)
        if value is not None:
            values[leaf.path] = value
    return encode(layout, values)


def swapped(layout: Layout, data: bytes, cause: str, way: int) -> bytes:
    """Return the message as a sender with that cause has it."""
    out = bytearray(data)
    if cause == "byte-swap" and way < 3:
        for at in range(0, len(data) - 1, 2):
            out[at], out[at + 1] = data[at + 1], data[at]
        return bytes(out)
    if cause == "word-swap" and way == 3:
        for at in range(0, len(data) - 3, 4):
            out[at : at + 4] = data[at + 2 : at + 4] + data[at : at + 2]
        return bytes(out)
    for leaf in layout.leaves():
        if isinstance(leaf.type, StringType) or leaf.coding.code.endswith("s") or leaf.size not in (2, 4, 8):
            continue
        part = data[leaf.offset : leaf.offset + leaf.size]
        words = [part[at : at + 2] for at in range(0, leaf.size, 2)]
        if cause == "word-swap":
            if way == 1 and leaf.size == 8:
                continue
            if way == 2 and leaf.size == 8:
                words = [words[2], words[3], words[0], words[1]]
            words.reverse()
        else:
            words = [word[::-1] for word in words]
        out[leaf.offset : leaf.offset + leaf.size] = b"".join(words)
    return bytes(out)


def make(seed: int, cause: str, fill: str = "", default: bool | None = None) -> Case | None:
    """Return a case; None where this seed makes none (a cause that changes nothing, a type too long)."""
    rng = random.Random(f"{seed}-{cause}-{fill}")
    type_ = random_type(rng)
    profiles = profiles_for(type_)
    is_default = rng.random() < 0.4 if default is None else default
    profile = profiles[0] if is_default else rng.choice(profiles)
    try:
        layout = lay_out(type_, profile.rules, "T")
    except UserError:
        return None
    draw = filled(fill) if fill else realistic
    count = rng.choice([1, 1, 2, 4])
    plain = [content(layout, draw, seed, number, rng) for number in range(count)]
    n, messages = 0, plain
    match cause:
        case "header":
            messages, n = _with_header(plain, rng)
        case "trailer":
            ending = rng.choice([b"\r\n", b"\r\n", b"\r\n", b"\n", b"\r", b"\x03", b"\r\n\0"])
            messages, n = [one + ending for one in plain], len(ending)
        case "short":
            messages, n = [one[:-1] for one in plain], 1
        case "long":
            messages, n = [one + bytes([rng.choice([0, rng.randrange(256)])]) for one in plain], 1
        case "word-swap" | "byte-swap":
            way = rng.choice([0, 0, 1, 2, 3])
            messages = [swapped(layout, one, cause, way) for one in plain]
            if messages == plain:
                return None
    return Case(type_, messages, profile, cause, n, seed)


def _with_header(plain: list[bytes], rng: random.Random) -> tuple[list[bytes], int]:
    kind = rng.random()
    size = len(plain[0])
    if kind < 0.5:
        n = rng.choice([2, 2, 4, 1])
        order: Literal["big", "little"] = "big" if rng.random() < 0.6 else "little"
        counted = size + (n if rng.random() < 0.3 else 0)
        return [(counted % (1 << 8 * n)).to_bytes(n, order) + one for one in plain], n
    n = rng.randint(1, 8)
    fixed = bytes(rng.choice([rng.randrange(256), rng.choice([0, 0xAA, 0x55, 0x02, 0x01])]) for _ in range(n))
    if kind < 0.7 and n >= 3:
        fixed = fixed[:-2] + (size % 65536).to_bytes(2, "big")
    return [fixed + one for one in plain], n


# -- measuring -----------------------------------------------------------------------------------------------


def is_right(case: Case, found: Fit) -> bool:
    """Return whether a reading is the hidden one: the cause, its bytes, and a profile that lies alike."""
    if (found.cause.kind or "none") != case.cause or found.cause.n != case.n:
        return False
    return same_bytes(case, found)


def same_bytes(case: Case, found: Fit) -> bool:
    """Return whether a reading has a profile in which this type lies as in the hidden one."""
    hidden = lay_out(case.type, case.profile.rules, "T")
    return layout_shape(hidden, by_bytes=True) == layout_shape(found.layout, by_bytes=True)


class Tally(NamedTuple):
    """Cases of one cause: all, the right one first, "fits best" said, said with another profile or cause.

    `among`: the right one shares the first rank with others that no byte tells from it.
    """

    cases: int
    first: int
    among: int
    said: int
    wrong: int
    seeds: tuple[int, ...]
    missed: tuple[int, ...]

    def __str__(self) -> str:
        """Return the figures in one line."""
        first, among = self.first / max(self.cases, 1), self.among / max(self.cases, 1)
        return (
            f"{self.cases} cases: first {first:.1%}, of the first rank {among:.1%}, "
            f"said {self.said}, wrong {self.wrong}"
        )


def measure(seeds: Iterable[int], cause: str, fill: str = "", joined: bool = False) -> Tally:
    """Return the figures of one cause."""
    cases = first = among = said = 0
    wrong: list[int] = []
    missed: list[int] = []
    for seed in seeds:
        case = make(seed, cause, fill)
        if case is None:
            continue
        messages = [b"".join(case.messages)] if joined else case.messages
        fits = rank(case.type, messages, "T")
        best = fits[0]
        right = is_right(case, best)
        among += any(is_right(case, one) for one in fits if one.rank == 1)
        cases, first, said = cases + 1, first + right, said + best.fits_best
        if not right:
            missed.append(seed)
        if best.fits_best and not any(is_right(case, one) for one in fits if one.rank == 1):
            wrong.append(seed)
    return Tally(cases, first, among, said, len(wrong), tuple(wrong), tuple(missed))
