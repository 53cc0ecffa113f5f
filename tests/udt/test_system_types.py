"""The system types of Siemens in a type: one table for `udt` and for the bytes of a CONNECT."""

from __future__ import annotations

from pathlib import Path

import pytest

from trcvtui.cli.main import main
from trcvtui.net.connection.description import ADDRESSES, CONNECTIONS
from trcvtui.system_types import STRUCTURES, Structure
from trcvtui.udt.layout.layout import Layout, lay_out
from trcvtui.udt.layout.rules import S7
from trcvtui.udt.sources import parse_source
from trcvtui.udt.system_types import system_types
from trcvtui.udt.type_set import join_declarations

HANDLES = "HW_ANY HW_IO HW_DEVICE HW_SUBMODULE HW_INTERFACE CONN_OUC PORT DB_ANY OB_ANY EVENT_ANY"


def udt(name: str, members: str) -> str:
    return f'TYPE "{name}"\nVERSION : 0.1\n   STRUCT\n{members}\n   END_STRUCT;\nEND_TYPE\n'


def laid(text: str, name: str, suffix: str = ".scl") -> Layout:
    return lay_out(
        join_declarations([parse_source(text, f"f{suffix}", suffix)], "f").get_type(name), S7, name
    )


def places(layout: Layout) -> dict[str, str]:
    """Return offsets by path, of a bit `9.0`; of an array the first element."""
    shown = {
        leaf.path: f"{leaf.offset}" + ("" if leaf.bit is None else f".{leaf.bit}") for leaf in layout.leaves()
    }
    return {
        path.removesuffix("[1]"): place for path, place in shown.items() if path[-1] != "]" or "[1]" in path
    }


@pytest.mark.parametrize("structure", STRUCTURES, ids=lambda structure: structure.name)
def test_each_field_lies_where_the_bytes_of_a_connect_have_it(structure: Structure) -> None:
    layout = lay_out(system_types()[structure.name.casefold()], S7, structure.name)
    offsets = {field.offset for field in structure.fields}
    assert layout.size == structure.size
    assert offsets <= {leaf.offset for leaf in layout.leaves()}
    assert all(leaf.bit in (None, 0) for leaf in layout.leaves())  # a BOOL has a byte of its own


def test_the_table_holds_all_descriptions_and_addresses() -> None:
    names = {structure.name for structure in STRUCTURES}
    assert names >= {*CONNECTIONS, *ADDRESSES, "IP_V4", "TDiag_Status"}


def test_a_connection_in_a_type_lies_at_even_bytes() -> None:
    members = """hw : HW_ANY; on : Bool;
      con {InstructionName := 'TCON_IP_v4'; LibVersion := '1.0'} : TCON_IP_v4; counter : UInt;"""
    layout = laid(udt("Link", members), "Link")
    assert layout.size == 20
    assert places(layout) == {
        "hw": "0",
        "on": "2.0",
        "con.InterfaceId": "4",
        "con.ID": "6",
        "con.ConnectionType": "8",
        "con.ActiveEstablished": "9.0",
        "con.RemoteAddress.ADDR": "10",
        "con.RemotePort": "14",
        "con.LocalPort": "16",
        "counter": "18",
    }


@pytest.mark.parametrize("name", [*HANDLES.split(), *HANDLES.lower().split(), '"HW_ANY"'])
def test_a_handle_has_16_bits_in_any_case_and_in_quotes(name: str) -> None:
    layout = laid(udt("T", f"a : Byte; b : Array[0..1] of {name}; c : {name};"), "T")
    assert [leaf.offset for leaf in layout.leaves()] == [0, 2, 4, 6] and layout.size == 8


def test_a_system_type_in_a_type_in_a_data_block_has_its_place() -> None:
    block = 'DATA_BLOCK "D"\n STRUCT a : Byte; in : Array[0..1] of "In"; END_STRUCT;\nBEGIN\nEND_DATA_BLOCK\n'
    layout = laid(udt("In", "b : Bool; to : tcon_param;") + block, "D", ".db")
    found = {leaf.path: leaf.offset for leaf in layout.leaves()}
    assert (found["in[0].to.id"], found["in[1].to.id"], layout.size) == (6, 72, 134)


def test_a_type_of_the_users_own_comes_first_and_a_difference_is_noted() -> None:
    own = udt("T", "c : TCON_Configured;") + udt("tcon_configured", "{};")
    for members, size, notes in (
        ("x : LReal", 8, ("1 value in 8 bytes, but the system type has 3 values in 6 bytes",)),
        ("InterfaceId : UInt; ID : Word; ConnectionType : Byte", 6, ()),
    ):
        types = join_declarations([parse_source(own.format(members), "f.scl", ".scl")], "f")
        assert lay_out(types.get_type("T"), S7).size == size
        assert types.notes.get("tcon_configured", ()) == notes


def test_no_source_of_another_vendor_has_system_types() -> None:
    text = "TYPE T : STRUCT p : PORT; END_STRUCT END_TYPE"
    read = parse_source(text, "f.st", ".st")
    assert "PORT" in join_declarations([read], "f").problems[0].found
    tia = parse_source(udt("S", "p : PORT;"), "f.scl", ".scl")
    assert join_declarations([read, tia], "f").names() == ["S"]
    assert join_declarations([read], "f", has_system_types=True).names()[:1] == ["T"]  # of a Siemens project


def test_what_is_not_verified_is_said_wherever_members_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "f.scl").write_text(
        udt("T", "a : TCON_IP_v4; b : Array[0..1] of TCON_QDN_SEC; e : EVENT_ANY;")
    )
    file = str(tmp_path / "f.scl")
    layouts = ["--layout", "s7-standard", "--layout", "packed"]
    for words in (["show", file], ["decode", file, "00"], ["compare", file, *layouts]):
        main(["udt", *words])
        told = capsys.readouterr().err
        assert "T: TCON_QDN: offsets not verified" in told and "T: TCON_QDN_SEC: offsets not verified" in told
        assert "TCON_IP_v4" not in told
    main(["udt", "show", file])
    assert "T: EVENT_ANY: 16 bits are not verified" in capsys.readouterr().err


def test_a_file_beside_comes_before_the_system_type(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "f.scl").write_text(udt("T", "p : Port;"))
    assert main(["udt", "show", str(tmp_path / "f.scl")]) == 0
    assert capsys.readouterr().out.startswith("T: 2 bytes")
    (tmp_path / "port.udt").write_text(udt("PORT", "a : LReal;"))
    assert main(["udt", "show", str(tmp_path / "f.scl")]) == 0
    said = capsys.readouterr()
    assert said.out.startswith("T: 8 bytes") and "T uses Port: found in port.udt beside FILE" in said.err
