"""M8: decode of a whole UDT against one struct.Struct, construct and dissect.cstruct; and of a page."""

from __future__ import annotations

import importlib
import importlib.util
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import Effort, Figure, alternate, ratios, spread
from trcvtui.udt.layout.layout import MOST_LEAVES, Layout, lay_out, rules_for
from trcvtui.udt.layout.value_text import value_text
from trcvtui.udt.layout.values import decode, decode_leaves
from trcvtui.udt.types import ELEMENTARY, Array, Member, Struct

NAMES: Final = ("BYTE", "DINT", "BYTE", "INT", "REAL", "LREAL", "WORD", "UDINT")
CODES: Final = {
    "B": ("Int8ul", "uint8"),
    "H": ("Int16ul", "uint16"),
    "h": ("Int16sl", "int16"),
    "i": ("Int32sl", "int32"),
    "I": ("Int32ul", "uint32"),
    "f": ("Float32l", "float"),
    "d": ("Float64l", "double"),
}
REPEATS: Final = 25  # the eight members that often, one after the other
SLICE_S: Final = 0.05
ROWS: Final = 40  # of a page
LARGEST: Final = (("show",), ("show", "--format", "json"), ("decode",), ("decode", "--format", "json"))
POINT: Final = "TYPE Point : STRUCT x : BOOL; y : INT; z : BYTE; w : BYTE; END_STRUCT END_TYPE"
# A small process of its own: what a child used at most begins with what its parent has.
CHILD: Final = """import resource, subprocess, sys
subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)"""
SMALL, LARGE = 100, 16_000  # elements of the arrays that a page is read from


def measure(effort: Effort) -> Iterator[Figure]:
    """Yield the cost of a whole decode against three others, and of a page of a large UDT against a small."""
    layout = lay_out(_flat(), rules_for("codesys-8"))
    data = bytes(range(1, 252)) * (layout.size // 251 + 1)
    yield _whole(layout, data, effort.pairs)
    for name, make in (("construct", _construct), ("dissect.cstruct", _cstruct)):
        if importlib.util.find_spec(name.partition(".")[0]) is None:
            yield Figure.missing(f"decode / {name}", f"needs the package {name}")
        else:
            yield _quicker(name, make(layout), layout, data, effort.pairs)
    yield _page(effort.pairs)
    for argv in LARGEST:
        yield from _large(f"{MOST_LEAVES} leaves", f"ARRAY[1..{MOST_LEAVES // 4}] OF Point", *argv)
    yield from _large("65535 bytes", "ARRAY[1..65535] OF BYTE", "show")


def _large(size: str, declared: str, *argv: str) -> Iterator[Figure]:
    """Yield what a command costs for a type of many leaves."""
    with tempfile.TemporaryDirectory() as folder:
        source, content = Path(folder, "big.st"), Path(folder, "zeros.hex")
        source.write_text(f"{POINT} TYPE Big : {declared}; END_TYPE")
        content.write_text("00" * 2 * MOST_LEAVES)
        given = [str(source), "--type", "Big", *(["@" + str(content)] if argv[0] == "decode" else [])]
        program = [sys.executable, "-c", CHILD, sys.executable, "-m", "trcvtui", "udt", argv[0]]
        ran = subprocess.run([*program, *given, *argv[1:]], capture_output=True, text=True, check=True)
    seconds, mib = map(float, ran.stdout.split())
    case = f"udt {' '.join(argv)} of {size}"
    yield Figure(f"{case}: processor time", f"{seconds:.2f} s", seconds)
    yield Figure(f"{case}: peak memory", f"{mib:.0f} MiB", mib)


def _flat() -> Struct:
    rows = [ELEMENTARY[name] for name in NAMES * REPEATS]
    return Struct("Flat", tuple(Member(f"m{n}", row) for n, row in enumerate(rows)))


def _whole(layout: Layout, data: bytes, pairs: int) -> Figure:
    plain = struct.Struct(_format(layout))
    assert plain.unpack_from(data) == decode(layout, data)
    figures = alternate(
        lambda: _each(lambda: decode(layout, data)), lambda: _each(lambda: plain.unpack_from(data)), pairs
    )
    share = ratios(figures)
    mine = spread([1e9 * ours / layout.leaf_count for ours, _ in figures])
    note = f"{layout.leaf_count} members of {layout.size} bytes; {mine.text(1, ' ns')} a member"
    return Figure.of("decode / struct.Struct", share, note=note)


def _quicker(name: str, theirs: Callable[[bytes], Any], layout: Layout, data: bytes, pairs: int) -> Figure:
    figures = alternate(
        lambda: 1 / _each(lambda: decode(layout, data)), lambda: 1 / _each(lambda: theirs(data)), pairs
    )
    return Figure.of(f"decode / {name}", ratios(figures), 1, note="times as quick, the same members")


def _page(pairs: int) -> Figure:
    small, large = (_Pages(count) for count in (SMALL, LARGE))
    figures = alternate(lambda: _each(large.next_page), lambda: _each(small.next_page), pairs)
    share = ratios(figures)
    mine = spread([1e6 * ours for ours, _ in figures])
    note = (
        f"{ROWS} rows with their text, {large.size} against {small.size} bytes; {mine.text(0, ' us')} a page"
    )
    return Figure.of("a page of a large UDT / of a small one", share, note=note)


class _Pages:
    """A UDT of many elements, and one page after the other of it: none is read twice in a row."""

    def __init__(self, count: int) -> None:
        element = Struct("E", tuple(Member(f"m{n}", ELEMENTARY[name]) for n, name in enumerate(NAMES)))
        self.layout = lay_out(Array(((1, count),), element), rules_for("codesys-8"))
        self.size = self.layout.size
        self.data = bytes(self.size)
        self.at = 0

    def next_page(self) -> list[str]:
        start = self.at = (self.at + 7 * ROWS) % (self.layout.leaf_count - ROWS)
        leaves = self.layout.leaves(start, start + ROWS)
        values = decode_leaves(self.layout, self.data, start, start + ROWS)
        rows = zip(leaves, values, strict=True)
        return [value_text(leaf, v, self.data[leaf.offset : leaf.offset + leaf.size]) for leaf, v in rows]


def _format(layout: Layout) -> str:
    """Return the layout as one would write it for `struct` by hand."""
    parts, end = ["<"], 0
    for leaf in layout.leaves():
        parts.append(f"{leaf.offset - end}x" * (leaf.offset > end) + leaf.coding.code)
        end = leaf.offset + leaf.size
    return "".join(parts) + f"{layout.size - end}x" * (layout.size > end)


def _construct(layout: Layout) -> Callable[[bytes], Any]:
    construct = importlib.import_module("construct")
    fields, end = [], 0
    for leaf in layout.leaves():
        if leaf.offset > end:
            fields.append(construct.Padding(leaf.offset - end))
        fields.append(leaf.path / getattr(construct, CODES[leaf.coding.code][0]))
        end = leaf.offset + leaf.size
    parse: Callable[[bytes], Any] = construct.Struct(*fields).parse
    return parse


def _cstruct(layout: Layout) -> Callable[[bytes], Any]:
    cstruct = importlib.import_module("dissect.cstruct").cstruct
    fields = " ".join(f"{CODES[leaf.coding.code][1]} {leaf.path};" for leaf in layout.leaves())
    loaded = cstruct().load(f"struct flat {{ {fields} }};", align=True)
    flat: Callable[[bytes], Any] = loaded.flat
    return flat


def _each(act: Callable[[], object]) -> float:
    """Return the seconds that one call takes, over a slice of calls."""
    calls, began = 0, time.perf_counter()
    while (spent := time.perf_counter() - began) < SLICE_S:
        for _ in range(10):
            act()
        calls += 10
    return spent / calls
