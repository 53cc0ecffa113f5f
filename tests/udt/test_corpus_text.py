"""Text files of other people's projects: read, or answered with lines that are right; cut, never a traceback.

TRCVTUI_UDT_CORPUS names their folder; with TRCVTUI_ORACLE every file is cut at every byte.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.udt.corpus import FULL, OWN, cuts, files, of_others
from trcvtui.errors import UserError
from trcvtui.udt.layout.layout import lay_out, rules_for
from trcvtui.udt.sources import decode_text, read_file, read_files, read_text
from trcvtui.udt.type_set import TypeSet, join
from trcvtui.udt.types import Array, Struct, Type, Union, Unplaced, type_text

SUFFIXES = (".st", ".iecst", ".txt", ".udt", ".scl", ".s7dcl", ".exp", ".typ", ".var")
FILES = files(*SUFFIXES)
# What a file on its own may lack: a type or a constant of another file.
LACKS = ("a known type", "a known constant")


def lay_out_all(types: TypeSet) -> None:
    for name in types.names():
        try:
            lay_out(types.named(name), rules_for(), name)
        except UserError as refused:
            assert refused.lines()


def unplaced(type_: Type) -> list[str]:
    """Return the names of what nobody can lay out in a type."""
    match type_:
        case Unplaced(name=name):
            return [name]
        case Array(element=element):
            return unplaced(element)
        case Struct() | Union():
            return [name for member in type_.members for name in unplaced(member.type)]
    return []


@pytest.mark.parametrize(
    "path", [path for path in FILES if path.name != "one_bad.st"], ids=lambda path: path.name
)
def test_a_file_is_read_and_lacks_at_most_what_other_files_declare(path: Path) -> None:
    types = read_file(path)
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
    alone = sum(len(read_file(path).types) for path in own)
    together = read_files(own)
    assert len(together.types) >= alone
    known = {*together.types, *together.broken}
    missing = [problem.found.strip("'").casefold() for problem in together.problems]
    assert [name for name in missing if name in known] == []


def test_own_samples_of_every_format_hold_what_they_say() -> None:
    found = {}
    for path in sorted(OWN.iterdir()):
        if path.suffix in SUFFIXES and path.name not in ("one_bad.st", "telegram.st"):
            types = read_file(path)
            assert types.problems == (), path
            found[path.name] = {name: type_text(types.named(name)) for name in types.names()}
    assert {name: list(types) for name, types in found.items()} == {
        "b_and_r.typ": ["LineMode_enum", "Line_typ", "Inner_typ"],
        "codesys_2_3.exp": ["Türdaten", "DoorBits"],
        "simatic_ax.st": ["Mode", "Limits", "Station"],
        "simatic_sd.s7dcl": ["Tank", "Level"],
        "tia.udt": ["Pump data", "Pump kind"],
        "twincat.st": ["ST_Valve", "ST_Base", "U_Raw"],
        "windows_1252.st": ["Tür"],
        "with_mark.st": ["Motor"],
    }
    valve = read_file(OWN / "twincat.st").named("ST_Valve")
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


@pytest.mark.slow
@pytest.mark.timeout(3600 if FULL else 60)
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_a_file_cut_anywhere_gives_types_or_lines(path: Path) -> None:
    data = path.read_bytes()
    for end in cuts(len(data), sample=2_000_000 // (len(data) + 10_000)):
        types = join([read_text(decode_text(data[:end]), "cut", path.suffix)], "cut")
        for problem in types.problems:
            assert problem.where.startswith("cut:")
            assert "\n" not in str(problem)
        lay_out_all(types)
