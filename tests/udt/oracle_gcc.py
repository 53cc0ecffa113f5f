"""Random types as IEC types and as C, and what gcc makes of them: sizes, alignments, offsets."""

from __future__ import annotations

import array
import re
import subprocess
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from random import Random
from typing import NamedTuple

from trcvtui.udt.types import (
    ELEMENTARY,
    Array,
    Elementary,
    Enumeration,
    Member,
    Pointer,
    StringType,
    Struct,
    Subrange,
    Type,
    Union,
)

PACKS = (8, 4, 2, 1)
MOST_LEAVES = 60
C_TYPES = {"b": "int8_t", "h": "int16_t", "i": "int32_t", "q": "int64_t", "f": "float", "d": "double"}
C_TYPES |= {"B": "uint8_t", "H": "uint16_t", "I": "uint32_t", "Q": "uint64_t", "?": "_Bool", "12s": "dtl"}
ROWS = [row for row in ELEMENTARY.values() if row.name != "BIT"]
HEAD = """#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
typedef struct { uint16_t year; uint8_t parts[6]; uint32_t ns; } dtl;
"""


class Case(NamedTuple):
    """A random type and the pack that it is laid out with."""

    type: Struct | Union
    pack: int


class Measured(NamedTuple):
    """What a type came to: its size, its alignment, and the offsets of its leaves in declared order."""

    size: int
    align: int
    offsets: list[int]


def cases(count: int, seed: int) -> Iterator[Case]:
    """Yield random types, each pack in turn."""
    random = Random(seed)
    for number in range(count):
        type_ = _record(random, 3)
        while _leaves(type_) > MOST_LEAVES:
            type_ = _record(random, 3)
        yield Case(type_, PACKS[number % len(PACKS)])


def _leaves(type_: Type) -> int:
    match type_:
        case Struct(base=base, members=members) | Union(base=base, members=members):
            return sum(_leaves(member.type) for member in members) + (_leaves(base) if base else 0)
        case Array(element=element):
            return type_.count * _leaves(element)
        case _:
            return 1


def _record(random: Random, depth: int) -> Struct | Union:
    pack = random.choice((None, None, None, 0, 1, 2, 4, 8))
    members = [_type(random, depth - 1) for _ in range(random.randint(0 if depth < 3 else 1, 6))]
    if random.random() < 0.2:
        return Union("U", _members(members), None, pack)
    base = _record(random, depth - 1) if depth and random.random() < 0.2 else None
    return Struct("S", _members(members), base if isinstance(base, Struct) else None, pack)


def _members(types: Sequence[Type]) -> tuple[Member, ...]:
    return tuple(Member(f"m{number}", type_) for number, type_ in enumerate(types))


def _type(random: Random, depth: int) -> Type:
    chance = random.random()
    if depth > 0 and chance < 0.3:
        return _record(random, depth)
    if chance < 0.5:
        lows = [random.randint(-2, 2) for _ in range(random.randint(1, 2))]
        return Array(tuple((low, low + random.randint(0, 2)) for low in lows), _type(random, depth - 1))
    return _leaf(random)


def _leaf(random: Random) -> Type:
    row = random.choice(ROWS)
    match random.randrange(8):
        case 0:
            return StringType(random.randint(1, 9), random.random() < 0.5)
        case 1:
            return Pointer("POINTER TO BYTE")
        case 2:
            return Subrange(ELEMENTARY["INT"], 0, 9)
        case 3:
            return Enumeration("E", ELEMENTARY[random.choice(("SINT", "UINT", "DINT"))], (("A", 0),))
        case _:
            return row


class _Writer:
    """C text of records: each a typedef of its own, so that each has its own pack."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.names: dict[Struct | Union, str] = {}

    def name(self, type_: Struct | Union, pack: int) -> str:
        if type_ not in self.names:
            fields = [] if type_.base is None else [self.field("base", type_.base, pack)]
            fields += [self.field(member.name, member.type, pack) for member in type_.members]
            name = self.names[type_] = f"t{len(self.names)}"
            own = pack if type_.pack is None else max(type_.pack, 1)
            word = "union" if isinstance(type_, Union) else "struct"
            self.lines += [f"#pragma pack(push, {own})", f"typedef {word} {{ {' '.join(fields)} }} {name};"]
            self.lines.append("#pragma pack(pop)")
        return self.names[type_]

    def field(self, name: str, type_: Type, pack: int) -> str:
        sizes = ""
        while isinstance(type_, Array):
            sizes += "".join(f"[{high - low + 1}]" for low, high in type_.bounds)
            type_ = type_.element
        if isinstance(type_, StringType):
            assert type_.length is not None
            return f"{'uint16_t' if type_.wide else 'char'} {name}{sizes}[{type_.length + 1}];"
        return f"{self.c_name(type_, pack)} {name}{sizes};"

    def c_name(self, type_: Type, pack: int) -> str:
        match type_:
            case Struct() | Union():
                return self.name(type_, pack)
            case Elementary(code=code) | Subrange(base=Elementary(code=code)):
                return C_TYPES[code]
            case Enumeration(base=base):
                return C_TYPES[base.code]
            case _:
                return "void *"


def _designators(type_: Type, path: str = "") -> Iterator[str]:
    """Yield the leaves of a type in declared order, as C names them."""
    match type_:
        case Struct(base=base, members=members) | Union(base=base, members=members):
            for name, inner in [("base", base), *((m.name, m.type) for m in members)]:
                if inner is not None:
                    yield from _designators(inner, f"{path}.{name}" if path else name)
        case Array(bounds=((low, high), *rest), element=element):
            below = Array(tuple(rest), element) if rest else element
            for index in range(high - low + 1):
                yield from _designators(below, f"{path}[{index}]")
        case _:
            yield path


def measured(batch: Sequence[Case], folder: Path) -> list[Measured]:
    """Compile the types and return what gcc says of each."""
    writer = _Writer()
    asked = [(writer.name(case.type, case.pack), [*_designators(case.type)]) for case in batch]
    return _measured(HEAD + "\n".join(writer.lines) + "\n", asked, folder)


WHOLE = ("char", "int8_t", "unsigned short", "int", "uint32_t", "long", "unsigned long", "long long")
INNER = (
    "struct { char x; int64_t y; }",
    "struct { char x; int y; } NAME_PACKED",
    "union { short x; float y; }",
)
PLAIN = (*WHOLE, *INNER, "float", "double", "bool", "enum Mode", "void *")
BITS = {"uint8_t": 8, "unsigned short": 16, "int": 32, "unsigned": 32, "long": 64, "uint64_t": 64, "bool": 1}
C_HEAD = """#include <stdbool.h>
#include <stdint.h>
#define NAME_PACKED __attribute__((packed))
#define MAVPACKED( one ) one __attribute__((packed))
#define BEGIN(n) _Pragma("pack(push, 1)")
#define END _Pragma("pack(pop)")
enum Mode { OFF, ON };
"""


class Header(NamedTuple):
    """A C header, and of each of its types the members that are no bit-fields."""

    text: str
    members: dict[str, list[str]]


def header(count: int, seed: int) -> Header:
    """Return random types with bit-fields, `long`, arrays without a length, and every way to pack them."""
    random = Random(seed)
    text, members = C_HEAD, dict[str, list[str]]()
    for number in range(count):
        name, word = f"T{number}", random.choice(("struct", "struct", "struct", "union"))
        fields = [_field(random, f"m{place}", list(members)) for place in range(random.randint(1, 8))]
        members[name] = [
            field.split()[-1].partition("[")[0].rstrip(";") for field in fields if ":" not in field
        ]
        if members[name] and random.random() < 0.2:
            length = "0" if word == "union" or random.random() < 0.5 else ""
            fields.append(
                f"{random.choice((*WHOLE, 'double', 'enum Mode', *[*members][:-1]))} tail[{length}];"
            )
        body, pack = "{\n  " + "\n  ".join(fields) + "\n}", 2 ** random.randint(0, 4)
        ways = (
            *[f"typedef {word} {body} {name};"] * 2,
            f"typedef {word} NAME_PACKED {body} {name};",
            f"MAVPACKED(\ntypedef {word} t{number} {body}) {name};",
            f"#pragma pack(push, {pack})\ntypedef {word} {body} {name};\n#pragma pack(pop)",
            f"BEGIN(1)\ntypedef {word} {body} {name};\nEND",
        )
        text += random.choice(ways) + "\n"
    return Header(text, members)


def _field(random: Random, name: str, known: list[str]) -> str:
    chance = random.random()
    if chance < 0.55:
        base = random.choice(list(BITS))
        width = random.choice((0, 1, BITS[base], random.randint(1, BITS[base])))
        return f"{base} {name if width and random.random() < 0.8 else ''} : {width};"
    size = f"[{random.randint(1, 3)}]" if random.random() < 0.2 else ""
    base = random.choice(known[-20:] if known and chance < 0.65 else PLAIN)
    return f"{base} {name}{size};"


CPP_HEAD = """#include <array>
#include <cstdint>
enum E8 : uint8_t { E8_A, E8_B = 200 };
enum class E16 : std::uint16_t { A, TWO = 7 };
constexpr int TWO = 2;
using U32 = uint32_t;
class Other;
"""
PLAIN_CPP = ("uint8_t", "std::uint16_t", "U32", "double", "bool", "E8", "E16", "unsigned short", "long long")
# What adds nothing to the size of a class.
NOTHING = (
    'C(int a) : C() { const char *text = "};{"; (void)text; }\n  C() {}',
    "~C() { for (;;) { break; } }",
    "uint32_t f{n}() const { return 1; }",
    "inline int g{n}(int a, const uint8_t *p);",
    "C &operator=(const C &other) = default;",
    "explicit operator bool() const noexcept { return '{' == '}'; }",
    "static uint16_t h{n}(uint32_t x) { return x; };",
    "friend bool operator==(const C &a, const C &b) { return true; }",
    "friend class Other;",
    "static U32 s{n};",
    "static const uint16_t READ{n} = 0x0002;",
    'static_assert(sizeof(int) == 4, "};");',
    "private:",
    "public :",
    "struct Forward{n};",
    "enum { ONE{n} = 1 };",
)
# Members with what they need; `m` begins the names of all.
MEMBERS = (
    *["{t} m{n};"] * 4,
    "{t} m{n}[TWO];",
    "volatile {t} m{n}[2][TWO];",
    "uint16_t m{n} = TWO + 1;",
    "U32 m{n}{{3}};",
    "int (*m{n})(int, const char *);",
    "static constexpr int K{n} = 5;\n  uint8_t m{n}[K{n}];",
    "enum {{ L{n} = 3 }};\n  uint8_t m{n}[L{n}];",
    "struct N{n} {{ uint8_t a; U32 b; int f() {{ return a; }} }};\n  N{n} m{n}[2];",
    "using T{n} = uint16_t;\n  T{n} m{n};",
    "typedef uint8_t T{n}[3];\n  T{n} m{n};",
    "struct {{ uint8_t a; {t} b; }} m{n};",
    "U32 b{n} : {bits};",
    *["std::array<{t}, 3> m{n};", "std::array<{t}, 1 + TWO> m{n}[2];"],
    "std::array<std::array<U32, 2>, TWO> m{n} = {{}};",
    "using A{n} = std::array<{t}, 2>;\n  A{n} m{n};",
)
# What changes it, or may.
SIZED = (
    *("virtual void f();", "virtual ~C() {}", "uint8_t &r;", "Vector<int> v;", "alignas(16) uint8_t a;"),
    *("int C::*p;", "Unknown u;", "UNKNOWN(3);", "UNKNOWN(3) int f();", "template <class T> void f(T a) {}"),
)


class Classes(NamedTuple):
    """A header of C++, of each of its types the members; those that are to be refused, and that may be."""

    header: Header
    refused: dict[str, str]
    unsure: set[str]


def classes(count: int, seed: int) -> Classes:
    """Return random classes with what adds nothing to their size, and some with what does."""
    random = Random(seed)
    text, members, refused, unsure = CPP_HEAD, dict[str, list[str]](), dict[str, str](), set[str]()
    for number in range(count):
        name, places = f"C{number}", [f"{number}_{place}" for place in range(random.randint(1, 6))]
        lines, known = [], [*members][-(number % 30) or len(members) :]  # no deeper than these
        for n in places:
            kind = random.choice((*PLAIN_CPP, *known[-6:]))
            lines.append(random.choice(MEMBERS).format(t=kind, n=n, bits=random.randint(1, 31)))
        for place, line in enumerate(random.sample(NOTHING, random.randint(0, 5))):
            at = random.randint(0, len(lines))
            lines.insert(at, re.sub(r"\bC\b", name, line.replace("{n}", str(place + 10))))
        is_packed, base = random.random() < 0.1, random.choice(known or [""])
        word = "struct __attribute__((packed))" if is_packed else random.choice(("struct", "class"))
        head = f"{word} {name}"
        if random.random() < 0.1:
            bad = re.sub(r"\bC\b", name, random.choice((*SIZED, "", "")))
            refused[name] = f"{head}{' : Base' * (not bad)} {{\n  " + "\n  ".join([*lines, bad]) + "\n};\n"
            continue
        own = [f"m{n}" for n in places if re.search(rf"\bm{n}\b", " ".join(lines))]
        base = base if not own or (random.random() < 0.4 and not is_packed) else ""
        members[name] = [*members.get(base, ()), *own]
        unsure |= {name} if base or is_packed or unsure & set(re.findall(r"C\d+", " ".join(lines))) else set()
        head += f" : {random.choice(('', 'public ', 'private '))}{base}" * bool(base)
        body = f"{head} {{\n  " + "\n  ".join(lines) + "\n};"
        pack = random.choice((0, 0, 1, 2, 4))
        text += f"#pragma pack(push, {pack})\n{body}\n#pragma pack(pop)\n" if pack else f"{body}\n"
    return Classes(Header(text, members), refused, unsure)


def measured_header(given: Header, folder: Path, compiler: str = "gcc") -> list[Measured]:
    """Compile a header and return what gcc or g++ says of each of its types."""
    (folder / "types.h").write_text(given.text)
    head = '#include <stddef.h>\n#include <stdint.h>\n#include <stdio.h>\n#include "types.h"\n'
    return _measured(head, [*given.members.items()], folder, compiler)


def _measured(
    head: str, asked: Sequence[tuple[str, list[str]]], folder: Path, compiler: str = "gcc"
) -> list[Measured]:
    numbers: list[str] = []
    for name, places in asked:
        offsets = [f"(uint32_t)offsetof({name}, {place})" for place in places]
        numbers += [f"(uint32_t)sizeof({name})", f"(uint32_t)_Alignof({name})", *offsets]
    table = f"static const uint32_t numbers[] = {{\n{','.join(numbers)}\n}};\n"
    main = "int main(void) { return fwrite(numbers, sizeof numbers, 1, stdout) != 1; }\n"
    source, program = folder / "types.c", folder / "types"
    source.write_text(head + table + main)
    how = {"gcc": "-std=gnu11", "g++": "-std=gnu++17 -x c++ -fno-access-control -D_Alignof=alignof"}[compiler]
    words = [*how.split(), "-w", "-Wno-packed-bitfield-compat", "-o"]
    subprocess.run([compiler, *words, program, source], check=True)
    answer = subprocess.run([program], capture_output=True, check=True).stdout
    found = iter(array.array("I", answer))
    return [Measured(next(found), next(found), [*islice(found, len(places))]) for _, places in asked]
