"""One type written in several formats is one declaration; every file that breaks off ends in a line."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as hyp

from tests.udt.xml_writer import bare, in_openness, in_plcopen, in_st
from trcvtui.errors import UserError
from trcvtui.udt.ast import (
    ArraySpec,
    Declaration,
    EnumSpec,
    Formula,
    MemberSpec,
    PointerSpec,
    RangeSpec,
    Reference,
    Spec,
    StructSpec,
    TextSpec,
)
from trcvtui.udt.sources import read_xml_file
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.types import ROWS, StringType, ValueKind

WHOLE = [row.name for row in ROWS if row.kind in (ValueKind.INTEGER, ValueKind.BITS) and row.name != "BIT"]

numbers = hyp.one_of(
    hyp.integers(-3, 9), hyp.sampled_from(["MAX", "GVL.MAX+1", "2*LEN"]).map(lambda text: Formula(text, ""))
)
names = hyp.sampled_from(["Motor", "Axis_1", "Größe"]).map(lambda name: Reference(name, ""))
elementary = hyp.sampled_from([row.name for row in ROWS]).map(lambda name: Reference(name, ""))
whole = hyp.sampled_from(WHOLE).map(lambda name: Reference(name, ""))
texts: hyp.SearchStrategy[Spec] = hyp.one_of(
    hyp.builds(StringType, hyp.one_of(hyp.none(), hyp.integers(1, 254)), hyp.booleans()),
    hyp.builds(TextSpec, hyp.just(Formula("LEN", "")), hyp.booleans()),
)
ranges = hyp.builds(RangeSpec, whole, hyp.integers(-9, 0), hyp.integers(1, 9))
pointers = names.map(lambda reference: PointerSpec(f"POINTER TO {reference.name}"))
bounds = hyp.lists(hyp.tuples(hyp.just(-3), numbers), min_size=1, max_size=3).map(tuple)
values = hyp.lists(hyp.one_of(hyp.none(), numbers), min_size=1, max_size=4).map(
    lambda found: tuple((f"V{n}", value) for n, value in enumerate(found))
)
enumerations = hyp.builds(EnumSpec, hyp.one_of(hyp.none(), whole), values)
leaves: hyp.SearchStrategy[Spec] = hyp.one_of(elementary, names, texts)
every_leaf: hyp.SearchStrategy[Spec] = hyp.one_of(leaves, ranges, pointers, enumerations)


def structs(inner: hyp.SearchStrategy[Spec], unions: bool) -> hyp.SearchStrategy[Spec]:
    """Return STRUCTs, and UNIONs if they are wanted, of up to five members."""
    return hyp.builds(
        lambda specs, union: StructSpec(
            tuple(MemberSpec(f"m{n}", spec, "") for n, spec in enumerate(specs)), is_union=union and unions
        ),
        hyp.lists(inner, max_size=5),
        hyp.booleans(),
    )


def types(leaf: hyp.SearchStrategy[Spec], unions: bool) -> hyp.SearchStrategy[Spec]:
    """Return types of all kinds that a format knows."""
    return hyp.recursive(
        leaf,
        lambda inner: hyp.one_of(hyp.builds(ArraySpec, bounds, inner), structs(inner, unions)),
        max_leaves=8,
    )


@pytest.mark.slow
@given(hyp.lists(types(every_leaf, True), min_size=1, max_size=3))
def test_a_type_is_the_same_in_st_and_in_plcopen_xml(specs: list[Spec]) -> None:
    declared = [Declaration(f"T{n}", spec, "") for n, spec in enumerate(specs)]
    text = read_st("".join(map(in_st, declared)), "F")
    assert not text.problems and not any(type_.problems for type_ in text.types)
    assert bare(read_xml_file(in_plcopen(declared), "F")) == bare(text)


@given(structs(types(leaves, False), False))
def test_a_type_is_the_same_in_st_and_in_openness_xml(spec: Spec) -> None:
    declared = Declaration("Motor data", spec, "")
    text = read_st(in_st(declared._replace(name='"Motor data"')), "F")
    assert not text.problems and not any(type_.problems for type_ in text.types)
    assert bare(read_xml_file(in_openness(declared), "F")) == bare(text)


SAMPLES = {
    "plcopen": in_plcopen(
        [
            Declaration("E", EnumSpec(Reference("INT", ""), (("A", None), ("B", 5))), ""),
            Declaration("S", StructSpec((MemberSpec("a", ArraySpec(((0, 3),), StringType(9)), ""),)), ""),
        ]
    ),
    "openness": in_openness(
        Declaration("S", StructSpec((MemberSpec("a", ArraySpec(((0, 3),), Reference("INT", "")), ""),)), "")
    ),
    "twincat": '<?xml version="1.0"?><TcPlcObject><DUT Name="S"><Declaration><![CDATA[TYPE S : STRUCT\n'
    " a : INT; END_STRUCT END_TYPE]]></Declaration></DUT></TcPlcObject>",
}


def test_every_sample_that_breaks_off_ends_in_one_line() -> None:
    for text in SAMPLES.values():
        assert read_xml_file(text, "F").types
        for length in range(len(text)):
            refusal(text[:length])


@given(hyp.sampled_from(sorted(SAMPLES)), hyp.data())
def test_a_sample_with_a_part_left_out_ends_in_types_or_lines(sample: str, data: hyp.DataObject) -> None:
    text = SAMPLES[sample]
    begin = data.draw(hyp.integers(0, len(text)))
    end = data.draw(hyp.integers(begin, min(len(text), begin + 60)))
    try:
        read_xml_file(text[:begin] + text[end:], "F")
    except UserError as refused:
        assert refused.lines()


def refusal(text: str) -> str:
    """Return the one line of a text that cannot be read."""
    try:
        read_xml_file(text, "F")
    except UserError as refused:
        (line,) = refused.lines()
        return line
    raise AssertionError(f"{text[-80:]!r} is read, but it breaks off")
