"""The largest types allowed are shown, decoded and compared line by line: memory does not grow with them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.udt.answers import show_json, show_text
from tests.udt.udt_strategies import layouts, types_of
from trcvtui.udt.layout.layout import MOST_LEAVES, Layout, lay_out, rules_for
from trcvtui.udt.layout.values import decode, stream, values_of

MIB = 1024 * 1024
LIMITED = """import resource, sys
most = int(sys.argv.pop(1))
resource.setrlimit(resource.RLIMIT_AS, (most, most))
from trcvtui.cli.main import main
sys.exit(main(sys.argv[1:]))"""
# Beside the program's 50 MiB a leaf has 150 bytes: half a million in `make soak`, a quarter of them here.
POINTS_DECODED, ALLOWED = (MOST_LEAVES // 8, 128) if "TRCVTUI_SOAK" in os.environ else (MOST_LEAVES // 32, 68)
POINTS = "TYPE Point : STRUCT x : BOOL; y : INT; z : BYTE; w : BYTE; END_STRUCT END_TYPE\n"


def lines_of(*argv: str, mib: int = 128) -> int:
    """Return how many lines a command prints in so much address space; the program itself has 50 MiB."""
    words = [sys.executable, "-c", LIMITED, str(mib * MIB), "udt", *argv]
    ran = subprocess.run(words, capture_output=True, check=False)
    assert ran.returncode in (0, 1), ran.stderr.decode()
    return ran.stdout.count(b"\n")


@pytest.mark.slow
@pytest.mark.parametrize("answer", ["text", "json"])
def test_a_million_leaves_are_shown_in_bounded_memory(answer: str, tmp_path: Path) -> None:
    source = tmp_path / "big.st"
    source.write_text(f"{POINTS} TYPE Big : ARRAY[1..{MOST_LEAVES // 4}] OF Point; END_TYPE")
    printed = lines_of("show", str(source), "--type", "Big", "--format", answer)
    gaps = MOST_LEAVES // 2  # after each BOOL and at the end of each Point
    assert printed == (MOST_LEAVES + gaps + 2 if answer == "text" else MOST_LEAVES * 6 + gaps * 4 + 11)


@pytest.mark.slow
def test_hundreds_of_thousands_of_leaves_are_decoded_and_compared_in_bounded_memory(tmp_path: Path) -> None:
    source, content = tmp_path / "big.st", tmp_path / "zeros.hex"
    source.write_text(f"{POINTS} TYPE Big : ARRAY[1..{POINTS_DECODED}] OF Point; END_TYPE")
    content.write_text("00" * 6 * POINTS_DECODED)
    given_, leaves = (str(source), "--type", "Big", f"@{content}"), POINTS_DECODED * 4
    assert lines_of("decode", *given_, mib=ALLOWED) == leaves + 2
    assert lines_of("decode", *given_, "--format", "json", mib=ALLOWED) == leaves + 7
    assert lines_of("decode", *given_, "--format", "csv", mib=ALLOWED) == leaves + 1
    compared = lines_of("compare", *given_, "--layout", "packed", "--layout", "cap4", mib=ALLOWED)
    assert compared == leaves + 4


def test_the_gaps_of_a_union_of_large_arrays_are_found_in_one_walk() -> None:
    types = types_of(
        "TYPE P : STRUCT a : INT; b : BYTE; END_STRUCT Q : STRUCT a : BYTE; b : DINT; END_STRUCT\n"
        "U : UNION p : ARRAY[1..250000] OF P; q : ARRAY[1..125000] OF Q; END_UNION END_TYPE"
    )
    layout = lay_out(types.named("U"), rules_for())
    assert sum(1 for _ in layout.padding()) == 125000, "byte 3 of every 8: the rest belongs to p or to q"


@pytest.fixture
def small_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("trcvtui.udt.layout.values.FEW", 1)
    monkeypatch.setattr("trcvtui.udt.layout.values.PAGE", 2)
    monkeypatch.setattr("trcvtui.udt.layout.values.MOST_AT_ONCE", 3)


@pytest.mark.slow
@pytest.mark.usefixtures("small_pages")
@given(layout=layouts(), data=st.binary(max_size=200))
def test_leaves_and_values_are_the_same_one_after_the_other_and_all_at_once(
    layout: Layout, data: bytes
) -> None:
    made = [
        (offset, path + leaf.path, leaf._replace(path="", offset=0))
        for offset, path, leaf in stream(layout, lambda leaf: leaf)
    ]
    assert made == [(leaf.offset, leaf.path, leaf._replace(path="", offset=0)) for leaf in layout.leaves()]
    assert repr([*values_of(layout, data)]) == repr([*decode(layout, data)])


@pytest.mark.slow
@pytest.mark.usefixtures("small_pages")
@given(layout=layouts())
def test_members_stand_in_offset_order_and_those_at_one_offset_in_declared_order(layout: Layout) -> None:
    by_offset = sorted(layout.leaves(), key=lambda leaf: leaf.offset)
    assert [member["path"] for member in show_json(layout)["members"]] == [leaf.path for leaf in by_offset]
    gaps = [(gap["offset"], gap["size"]) for gap in show_json(layout)["padding"]]
    assert gaps == [*layout.padding()]
    offsets = [line.split()[0] for line in show_text(layout).splitlines()[2:] if line[0] in " 0123456789"]
    assert len(offsets) >= len(by_offset) + len(gaps)
