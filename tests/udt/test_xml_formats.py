"""TwinCAT, Openness and PLCopen XML: what each feature is read as, and the line that a mistake gets."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as hyp

from tests import golden
from tests.udt.st_texts import bare, lines_of, problems_of
from trcvtui.errors import UserError
from trcvtui.udt.ast import Declarations, StructSpec, TypeName
from trcvtui.udt.layout.layout import lay_out
from trcvtui.udt.layout.rules import S7
from trcvtui.udt.sources import decode_text, parse_source, parse_xml_source, xml_source
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.sources.xml_source import MOST_DEPTH, read_xml
from trcvtui.udt.type_set import TypeSet, join_declarations

OPENNESS = """<?xml version="1.0" encoding="utf-8"?>
<Document><Engineering version="V21" />
  <SW.Types.PlcStruct ID="0"><AttributeList>
    <Interface><Sections xmlns="http://www.siemens.com/automation/Openness/SW/Interface/v5">
      <Section Name="None">
{}
      </Section></Sections></Interface>
    <Name>Motor</Name></AttributeList>
  </SW.Types.PlcStruct>
</Document>"""
PLCOPEN = """<?xml version="1.0" encoding="utf-8"?>
<project xmlns="http://www.plcopen.org/xml/{version}"><types><dataTypes>
{types}
</dataTypes><pous/></types>{more}</project>"""
ADDED = 'data name="http://www.3s-software.com/plcopenxml/{}" handleUnknown="implementation"'


def twincat(text: str, name: str = "Motor", object_: str = "DUT") -> Declarations:
    head = '\ufeff<?xml version="1.0" encoding="utf-8"?>\n<TcPlcObject Version="1.1.0.1">\n'
    cdata = f'  <{object_} Name="{name}">\n    <Declaration><![CDATA[{text}]]></Declaration>\n  </{object_}>'
    return parse_xml_source((head + cdata + "\n</TcPlcObject>").lstrip("\ufeff"), "F")


def openness(members: str) -> Declarations:
    return parse_xml_source(OPENNESS.format(members), "F")


def plcopen(types: str, version: str = "tc6_0200", more: str = "") -> Declarations:
    return parse_xml_source(PLCOPEN.format(types=types, version=version, more=more), "F")


def data_type(type_: str, added: str = "", name: str = "T") -> str:
    added = f"<addData>{added}</addData>" if added else ""
    return f'<dataType name="{name}"><baseType>{type_}</baseType>{added}</dataType>'


def st(text: str) -> object:
    return bare(read_st(text, "F"))


def line_of(text: str) -> str:
    with pytest.raises(UserError) as refused:
        parse_xml_source(text, "F")
    (line,) = refused.value.lines()
    return line


# -- the XML itself --------------------------------------------------------------------------------------


def test_malformed_xml_is_one_line_with_line_and_column() -> None:
    assert line_of("") == "F:1:1: found no element found, expected well-formed XML"
    assert line_of("<a>\n <b></a>") == "F:2:7: found mismatched tag, expected well-formed XML"


def test_a_billion_laughs_are_refused_at_their_first_line() -> None:
    laughs = "".join(f'<!ENTITY l{n} "{f"&l{n - 1};" * 10}">' for n in range(1, 10))
    text = f'<!DOCTYPE z [<!ENTITY l0 "ha">{laughs}]>\n<Document>&l9;</Document>'
    assert (
        line_of(text) == "F:1:13: found <!DOCTYPE z ...>, expected XML without a DTD or entity declarations"
    )


def test_nothing_is_fetched_from_elsewhere() -> None:
    assert "<!DOCTYPE a ...>" in line_of('<!DOCTYPE a SYSTEM "file:///etc/passwd"><a b="&x;"/>')
    assert "undefined entity" in line_of("<!DOCTYPE a><a>&x;</a>")


def test_depth_and_number_of_elements_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    assert f"{MOST_DEPTH} elements deep" in line_of("<a>" * 100_000)
    monkeypatch.setattr(xml_source, "MOST_ELEMENTS", 1000)
    assert "found more elements, expected at most 1000 in a file" in line_of("<a>" + "<b/>" * 2000)


@pytest.mark.parametrize(
    "codec", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "windows-1252", "iso-8859-15", "gb18030"]
)
def test_the_declared_encoding_is_the_one_that_is_read(codec: str) -> None:
    text = f'<?xml version="1.0" encoding="{codec.removesuffix("-sig").removesuffix("-le")}"?>\n<Tür/>'
    assert read_xml(decode_text(text.encode(codec)), "F").name == "Tür"


@pytest.mark.parametrize("codec", ["punycode", "unicode_escape", "rot13", "zip", "utf-16", "nothing", ""])
def test_a_declared_encoding_that_is_none_does_no_harm(codec: str) -> None:
    data = f'<?xml version="1.0" encoding="{codec}"?>\n<Tür/>'.encode()
    assert decode_text(data).endswith("<Tür/>")


def test_an_unknown_root_is_one_line() -> None:
    assert line_of("<html/>") == (
        "F:1:1: found <html>, expected <Document> (Siemens Openness), <project> (PLCopen) or"
        " <TcPlcObject> (TwinCAT)"
    )


# -- TwinCAT ---------------------------------------------------------------------------------------------


def test_a_tcdut_is_its_st_text_and_places_are_those_of_the_file() -> None:
    read = twincat("{attribute 'pack_mode' := '1'}\nTYPE Motor :\nSTRUCT\n  a : INT;\nEND_STRUCT\nEND_TYPE")
    (type_,) = read.types
    assert type_.where == "F:5:6" and not lines_of(read)
    assert isinstance(type_.spec, StructSpec) and type_.spec.pack == 1
    assert type_.spec.members[0].where == "F:7:3"


def test_a_tcdut_with_another_name_says_so() -> None:
    (type_,) = twincat("TYPE Pump : INT; END_TYPE").types
    assert (type_.name, type_.notes) == ("Pump", ("the XML calls it 'Motor', the declaration 'Pump'",))


def test_a_tcdut_without_a_type_is_told() -> None:
    assert lines_of(twincat("// later")) == ["F:4:5: found no type, expected TYPE ... END_TYPE"]
    assert line_of("<TcPlcObject><POU Name='x'/></TcPlcObject>") == (
        "F:1:1: found <POU> in it, expected a <DUT> or a <GVL>"
    )
    assert "<Declaration> with ST text" in line_of("<TcPlcObject><DUT Name='x'/></TcPlcObject>")


def test_a_tcgvl_gives_its_constants_under_both_names() -> None:
    read = twincat("VAR_GLOBAL CONSTANT\n  MAX : INT := 5;\nEND_VAR", "GVL", "GVL")
    assert [one[:2] for one in read.constants] == [("MAX", 5), ("GVL.MAX", 5)] and not read.types


# -- Openness --------------------------------------------------------------------------------------------


def test_a_global_data_block_is_a_type_too() -> None:
    udt = OPENNESS.format('<Member Name="a" Datatype="Int"/>')
    block = udt.replace("SW.Types.PlcStruct", "SW.Blocks.GlobalDB").replace(">Motor<", ">Line<")
    block = block.replace("<Name>", "<MemoryLayout>Optimized</MemoryLayout><Name>")
    read = parse_xml_source(block, "F")
    assert [each.name for each in read.types] == ["Line"] and read.sender.layout == "s7-standard"
    assert bare(read)[0][1:] == bare(parse_xml_source(udt, "F"))[0][1:]
    assert "optimised access" in read.types[0].notes[0]


def test_a_bad_openness_member_is_named_and_hides_no_other() -> None:
    read = openness('<Member Name="a" Datatype="Array[5..1] of Int"/>\n<Member Name="b" Datatype="Int"/>')
    assert lines_of(read) == ["F:6:1: found '1', expected a number from 5 upwards"]
    assert isinstance(read.types[0].spec, StructSpec) and len(read.types[0].spec.members) == 1
    for datatype in ("Array[1] of Int", "Array[] of Int", "Int;", "String[0]", " "):
        assert len(lines_of(openness(f'<Member Name="a" Datatype="{datatype}"/>'))) == 1


def copy(name: str, datatype: str, plain: str = "", **sections: str) -> str:
    sections = sections or {"None": plain}
    inner = "".join(f'<Section Name="{kind}">{members}</Section>' for kind, members in sections.items())
    return f'<Member Name="{name}" Datatype="{datatype}"><Sections>{inner}</Sections></Member>'


PAIR = '<Member Name="id" Datatype="UInt"/><Member Name="ok" Datatype="Bool"/>'
UNIT = copy("unit", "Array[0..1] of &quot;Unit&quot;", PAIR)
UNIT_UDT = 'TYPE "Unit" VERSION : 0.1 STRUCT id : UInt; {} END_STRUCT; END_TYPE'


def laid(types: TypeSet) -> list[tuple[str, int]]:
    layout = lay_out(types.get_type("Motor"), S7, "Motor")
    return [*((leaf.path, leaf.offset) for leaf in layout.leaves()), ("", layout.size)]


def test_members_in_the_sections_of_a_member_are_those_of_its_type() -> None:
    types = join_declarations([openness(UNIT + '<Member Name="end" Datatype="Byte"/>')], "F")
    first, second = [("unit[0].id", 0), ("unit[0].ok", 2)], [("unit[1].id", 4), ("unit[1].ok", 6)]
    assert laid(types) == [*first, *second, ("end", 8), ("", 10)] and not types.notes
    assert types.source_layout("Unit") == "s7-standard"
    nested = openness(copy("m", "&quot;Outer&quot;", UNIT + PAIR) + UNIT)  # a second copy, the same
    assert [leaf for leaf, _ in laid(join_declarations([nested], "F"))][4:6] == ["m.id", "m.ok"]
    empty = openness(copy("m", "&quot;Unit&quot;"))
    assert join_declarations([empty], "F").problems[0].found == "'Unit'"


def test_the_members_in_a_file_come_before_the_system_type_and_a_difference_is_noted() -> None:
    types = join_declarations([openness(copy("d", "TDiag_Status", PAIR))], "F")
    assert laid(types)[-1] == ("", 4)
    assert types.notes["tdiag_status"] == (
        "2 values in 4 bytes, but the system type has 8 values in 16 bytes",
    )
    same = '<Member Name="addr" Datatype="Array[1..4] of Byte"/>'
    assert not join_declarations([openness(copy("d", "IP_V4", same))], "F").notes


def test_a_declared_type_comes_before_its_copy_and_a_difference_is_noted() -> None:
    for member, size, notes in (
        ("more : LReal;", 20, ("2 values in 10 bytes, but the copy at F:6:64 has 2 values in 4 bytes",)),
        ("ok : Bool;", 8, ()),
    ):
        types = join_declarations(
            [openness(UNIT), parse_source(UNIT_UDT.format(member), "u.udt", ".udt")], "F"
        )
        assert laid(types)[-1] == ("", size) and types.notes.get("unit", ()) == notes


def test_two_copies_that_differ_are_refused_with_both_places() -> None:
    other = copy("b", "&quot;unit&quot;", '<Member Name="id" Datatype="Real"/>')
    (problem,) = join_declarations([openness(f"{UNIT}\n{other}")], "F").problems
    assert str(problem).startswith("F:7:") and problem.expected.endswith("the first is at F:6:64")


def test_an_instance_has_its_parameters_and_keeps_a_pointer_to_what_is_not_elementary() -> None:
    a, b, c = (f'<Member Name="{name}" Datatype="Int"/>' for name in "abc")
    sections = {"Input": a, "InOut": b, "Static": c, "Temp": PAIR, "Constant": PAIR}
    types = join_declarations([openness(copy("fb", "&quot;Drive&quot;", **sections))], "F")
    assert laid(types) == [("fb.a", 0), ("fb.b", 2), ("fb.c", 4), ("", 6)]
    assert "a guess" in types.notes["drive"][0]
    for datatype in ("DTL", "String", "Array[0..1] of Int", "Variant"):
        inner = f'<Member Name="io" Datatype="{datatype}"/>'
        with pytest.raises(UserError, match=r"Motor\.fb\.io: found "):
            laid(join_declarations([openness(copy("fb", "&quot;Drive&quot;", Input=a, InOut=inner))], "F"))
    timer = join_declarations([openness(copy("t", "TON_TIME", a))], "F")  # TIA lists less than it has
    assert "a guess" in timer.notes["ton_time"][0]


def test_a_mistake_in_a_copy_is_told_at_its_line_where_the_copy_counts() -> None:
    bad = openness(copy("m", "&quot;Unit&quot;", '\n<Member Name="x" Datatype="Array[5..1] of Int"/>'))
    assert (
        str(join_declarations([bad], "F").problems[0]) == "F:7:1: found '1', expected a number from 5 upwards"
    )
    assert join_declarations([bad, parse_source(UNIT_UDT.format(""), "u.udt", ".udt")], "F").names() == [
        "Motor",
        "Unit",
    ]


def test_a_block_is_no_data_type() -> None:
    assert line_of('<Document><SW.Blocks.FB ID="0"/></Document>') == (
        "F:1:1: found <SW.Blocks.FB>, expected <SW.Types.PlcStruct> or <SW.Blocks.GlobalDB>"
    )


# -- PLCopen ---------------------------------------------------------------------------------------------

STRUCT = """<struct>
  <variable name="a"><type><BYTE/></type><initialValue><simpleValue value="1"/></initialValue></variable>
  <variable name="b"><type><array><dimension lower="0" upper="GVL.MAX"/><dimension lower="1" upper="2"/>
    <baseType><string length="10"/></baseType></array></type></variable>
  <variable name="c"><type><subrangeSigned><range lower="-5" upper="5"/><baseType><INT/></baseType>
    </subrangeSigned></type></variable>
  <variable name="d"><type><pointer><baseType><derived name="Axis"/></baseType></pointer></type></variable>
  <variable name="e"><type><wstring length="LEN"/></type></variable>
  <variable name="f"><type><struct><variable name="g"><type><derived name="Lib.T"/></type></variable></struct>
    </type></variable>
  <variable name="h"><type><derived name="REFERENCE TO Axis"/></type></variable>
</struct>"""
STRUCT_ST = """STRUCT a : BYTE := 1; b : ARRAY[0..GVL.MAX, 1..2] OF STRING(10); c : INT(-5..5);
    d : POINTER TO Axis; e : WSTRING(LEN); f : STRUCT g : Lib.T; END_STRUCT
    h : REFERENCE TO Axis; END_STRUCT"""


@pytest.mark.parametrize("version", ["tc6.xsd", "tc6_0100", "tc6_0200", "tc6_0201"])
def test_a_plcopen_struct_is_the_same_as_in_st(version: str) -> None:
    read = plcopen(data_type(STRUCT), version)
    assert not lines_of(read)
    assert bare(read) == st(f"TYPE T : {STRUCT_ST} END_TYPE")


def test_a_plcopen_enumeration_has_its_base_and_values() -> None:
    values = (
        '<values><value name="A"/><value name="B" value="16#10"/><value name="C" value="B + 1"/></values>'
    )
    assert bare(plcopen(data_type(f"<enum>{values}<baseType><UDINT/></baseType></enum>"))) == st(
        "TYPE T : (A, B := 16#10, C := B + 1) UDINT; END_TYPE"
    )


def test_codesys_additions_extend_and_pack() -> None:
    added = (
        f"<{ADDED.format('datatypeinheritance')}><Inheritance><Extends>Base</Extends></Inheritance></data>"
        f"<{ADDED.format('attributes')}><Attributes>"
        "<Attribute Name='pack_mode' Value='1'/></Attributes></data>"
    )
    (type_,) = plcopen(
        data_type('<struct><variable name="a"><type><INT/></type></variable></struct>', added)
    ).types
    assert isinstance(type_.spec, StructSpec) and type_.spec.pack == 1
    assert isinstance(type_.spec.base, TypeName) and type_.spec.base.name == "Base"
    (line,) = lines_of(plcopen(data_type("<struct/>", added.replace("'1'", "'3'"))))
    assert line.startswith("F:3:") and line.endswith("found pack_mode '3', expected 0, 1, 2, 4 or 8")


def test_the_st_text_of_an_export_goes_before_its_xml() -> None:
    text = "TYPE T :\nUNION\n  a : REAL; b : LINT; // a &lt; b\nEND_UNION\nEND_TYPE"
    plain = f"<InterfaceAsPlainText><xhtml>{text}</xhtml></InterfaceAsPlainText>"
    added = f"<{ADDED.format('interfaceasplaintext')}>\n{plain}</data>"
    read = plcopen(data_type("<struct/>", added))
    assert bare(read) == st(text)
    assert read.types[0].where == "F:4:6"


def test_data_types_are_found_wherever_codesys_writes_them() -> None:
    more = (
        "<instances><configurations><configuration name='D'><resource name='A'><addData>"
        f"<{ADDED.format('datatype')}>{data_type('<INT/>', name='Hidden')}</data>"
        f"<{ADDED.format('union')}>"
        "<union name='U'><variable name='a'><type><REAL/></type></variable></union></data>"
        "</addData></resource></configuration></configurations></instances>"
    )
    read = plcopen("", more=more)
    assert bare(read) == st("TYPE Hidden : INT; END_TYPE TYPE U : UNION a : REAL; END_UNION END_TYPE")


def test_constants_of_global_variables_are_read() -> None:
    more = (
        "<instances><globalVars name='GVL' constant='true'><variable name='MAX'><type><INT/></type>"
        "<initialValue><simpleValue value='16#10'/></initialValue></variable></globalVars></instances>"
    )
    read = plcopen(data_type("<INT/>"), more=more)
    assert [one[:2] for one in read.constants] == [("MAX", 16), ("GVL.MAX", 16)]


def test_each_plcopen_mistake_is_one_line() -> None:
    golden.mistakes("types in PLCopen XML", lambda text: problems_of(plcopen(data_type(text))))
    deep = "<array><dimension lower='0' upper='1'/><baseType>" * 40 + "<INT/>" + "</baseType></array>" * 40
    for type_, told in (("", "with nothing in it, expected a type"), (deep, "32 levels")):
        (line,) = lines_of(plcopen(data_type(type_)))
        assert told in line


SAMPLES = (
    PLCOPEN.format(types=data_type(STRUCT), version="tc6_0200", more=""),
    OPENNESS.format('<Member Name="a" Datatype="Array[0..3] of Struct"><Member Name="b"/></Member>'),
)


@given(hyp.sampled_from(SAMPLES), hyp.data())
def test_a_sample_with_a_part_left_out_ends_in_types_or_lines(text: str, data: hyp.DataObject) -> None:
    begin = data.draw(hyp.integers(0, len(text)))
    end = data.draw(hyp.integers(begin, min(len(text), begin + 60)))
    try:
        parse_xml_source(text[:begin] + text[end:], "F")
    except UserError as refused:
        assert refused.lines()
