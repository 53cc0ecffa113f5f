"""Files of other people's projects: read, or answered with lines that are right; cut, never a traceback.

TRCVTUI_UDT_CORPUS names their folder; with TRCVTUI_ORACLE every file is cut at every byte.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.udt.corpus import FULL, OWN, cuts, files, needs_given, of_others
from tests.udt.st_texts import bare
from trcvtui.errors import UserError
from trcvtui.udt.ast import Declarations
from trcvtui.udt.layout.layout import lay_out, rules_for
from trcvtui.udt.sources import decode_text, parse_source, read_files
from trcvtui.udt.type_set import TypeSet, join_declarations
from trcvtui.udt.types import ELEMENTARY, Array, RawType, StringType, Struct, Type, Union, type_text

SUFFIXES = (".st", ".iecst", ".txt", ".udt", ".scl", ".s7dcl", ".exp", ".typ", ".var")
FILES = files(*SUFFIXES)
EVERY_FILE = [*FILES, *files(".xml", ".tcdut", ".tcgvl", ".h")]
# What a file on its own may lack: a type or a constant of another file.
LACKS = ("a known type", "a known constant")


def lay_out_all(types: TypeSet) -> None:
    for name in types.names():
        try:
            lay_out(types.get_type(name), rules_for(), name)
        except UserError as refused:
            assert refused.lines()


def unplaced(type_: Type) -> list[str]:
    """Return the names of what nobody can lay out in a type."""
    match type_:
        case RawType(name=name):
            return [name]
        case Array(element=element):
            return unplaced(element)
        case Struct() | Union():
            return [name for member in type_.members for name in unplaced(member.type)]
    return []


@pytest.mark.parametrize(
    "path", [path for path in EVERY_FILE if path.name != "one_bad.st"], ids=lambda path: path.name
)
def test_a_file_is_read_and_lacks_at_most_what_other_files_declare(path: Path) -> None:
    types = read_files([path])
    assert types.types or types.broken
    wrong = [str(problem) for problem in types.problems if not problem.expected.startswith(LACKS)]
    assert wrong == []
    lay_out_all(types)


@pytest.mark.parametrize(
    "folder",
    of_others(sorted({path.parent for path in FILES if path.parent != OWN})),
    ids=lambda folder: folder.name,
)
def test_the_files_of_one_project_complete_each_other(folder: Path) -> None:
    own = [path for path in FILES if path.parent == folder]
    alone = sum(len(read_files([path]).types) for path in own)
    together = read_files(own)
    assert len(together.types) >= alone
    known = {*together.types, *together.broken}
    missing = [problem.found.strip("'").casefold() for problem in together.problems]
    assert [name for name in missing if name in known] == []


def test_own_samples_of_every_format_hold_what_they_say() -> None:
    found = {}
    for path in sorted(OWN.iterdir()):
        if path.suffix in SUFFIXES and path.name not in ("one_bad.st", "telegram.st"):
            types = read_files([path])
            assert types.problems == (), path
            found[path.name] = {name: type_text(types.get_type(name)) for name in types.names()}
    assert {name: list(types) for name, types in found.items()} == {
        "b_and_r.typ": ["LineMode_enum", "Line_typ", "Inner_typ"],
        "codesys_2_3.exp": ["Türdaten", "DoorBits"],
        "simatic_ax.st": ["Mode", "Limits", "Station"],
        "simatic_sd.s7dcl": ["Tank", "Level"],
        "tia.udt": ["Pump data", "Pump kind", "Pumps"],
        "twincat.st": ["ST_Valve", "ST_Base", "U_Raw"],
        "windows_1252.st": ["Tür"],
        "with_mark.st": ["Motor"],
    }
    valve = read_files([OWN / "twincat.st"]).get_type("ST_Valve")
    assert isinstance(valve, Struct)
    assert (valve.pack, type_text(valve.base) if valve.base else "") == (1, "ST_Base")
    assert [(member.name, type_text(member.type)) for member in valve.members] == [
        ("open", "BIT"),
        ("closed", "BIT"),
        ("position", "INT(0..100)"),
        ("timer", "TON"),
        ("drive", "Lib.FB_Drive"),
        ("raw", "U_Raw"),
        ("text", "STRING[41]"),
        ("back", "REFERENCE TO ST_Base"),
    ]
    assert unplaced(valve) == ["TON", "Lib.FB_Drive"]


XML_FILES = files(".xml", ".tcdut", ".tcgvl", ".h")
SOURCES = (".scl", ".s7dcl", ".udt")


def declared(path: Path) -> Declarations:
    return parse_source(decode_text(path.read_bytes()), str(path), path.suffix)


PAIRS = [
    (path, source)
    for path in XML_FILES
    if path.suffix == ".xml" and path.parent != OWN
    for suffix in SOURCES
    if (source := path.with_suffix(suffix)).exists()
]


@needs_given
def test_the_corpus_holds_types_in_two_formats() -> None:
    assert len(PAIRS) >= 7


@pytest.mark.parametrize(("xml", "source"), of_others(PAIRS, 2), ids=lambda path: path.name)
def test_a_type_in_two_formats_is_one_declaration_and_one_layout(xml: Path, source: Path) -> None:
    assert bare(declared(xml)) == bare(declared(source))
    (name,) = (type_.name for type_ in declared(xml).types)
    sides = []
    for suffix in (xml.suffix, source.suffix):
        types = read_files(path for path, other in PAIRS for path in (path, other) if path.suffix == suffix)
        for profile in ("s7-standard", "codesys-8"):
            laid = lay_out(types.get_type(name), rules_for(profile), name)
            sides.append((profile, [(leaf.path, leaf.offset, leaf.size) for leaf in laid.leaves()]))
    assert sides[:2] == sides[2:] and sides[0][1]


@pytest.mark.slow
@pytest.mark.timeout(3600 if FULL else 120)
@pytest.mark.parametrize("path", EVERY_FILE, ids=lambda path: path.name)
def test_a_file_cut_anywhere_gives_types_or_lines(path: Path) -> None:
    data = path.read_bytes()
    is_xml = path in XML_FILES and path.suffix != ".h"
    whole = len(data.rstrip()) if is_xml else 0
    for end in cuts(len(data), 30 if path in XML_FILES else 2_000_000 // (len(data) + 10_000)):
        try:
            types = join_declarations([parse_source(decode_text(data[:end]), "cut", path.suffix)], "cut")
        except UserError as refused:
            (line,) = refused.lines()
            assert line.startswith("cut") and path in XML_FILES
        else:
            assert end >= whole, "XML that breaks off is no XML"
            lines = [str(problem) for problem in types.problems]
            assert all(line.startswith("cut:") and "\n" not in line for line in lines)
            lay_out_all(types)


def test_own_samples_hold_what_they_say() -> None:
    motor = read_files([OWN / "motor.TcDUT"]).get_type("ST_Motor")
    assert isinstance(motor, Struct) and motor.pack == 1
    assert [member.type for member in motor.members] == [
        ELEMENTARY["BOOL"],
        ELEMENTARY["LREAL"],
        StringType(10),
    ]
    tank = read_files([OWN / "openness.xml"]).get_type("Tank")
    assert isinstance(tank, Struct) and [member.name for member in tank.members] == ["State", "Levels", "At"]
    plant = read_files([OWN / "plcopen.xml"]).get_type("Anlage")
    assert isinstance(plant, Struct) and plant.pack == 2 and isinstance(plant.members[1].type, Array)
    assert plant.members[1].type.bounds == ((1, 4),)
    station = read_files([OWN / "device.h"]).get_type("Station")
    assert isinstance(station, Struct) and station.pack is None
    assert lay_out(station, rules_for("codesys-8"), "Station").size == 1 + 1 + 16 + 8 + 5 + 1 + 8
