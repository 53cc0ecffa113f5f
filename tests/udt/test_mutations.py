"""A source with one mistake in it ends in types or in lines: no traceback, no hang.

TRCVTUI_MUTATIONS says how many of each source.
"""

from __future__ import annotations

import os
import random
import re
from pathlib import Path

import pytest

from trcvtui.cli.main import main

COUNT = int(os.environ.get("TRCVTUI_MUTATIONS", "60"))

XML = """<?xml version="1.0" encoding="utf-8"?>
<Document><Engineering version="V17" />
<SW.Blocks.GlobalDB ID="0"><AttributeList><Interface><Sections xmlns="http://x/v5"><Section Name="Static">
<Member Name="no" Datatype="Int"/>
<Member Name="unit" Datatype="Array[0..1] of &quot;Unit&quot;">
<Sections><Section Name="None">
<Member Name="id" Datatype="UInt"/>
<Member Name="limits" Datatype="Struct"><Member Name="low" Datatype="Real"/></Member>
</Section></Sections></Member>
<Member Name="drive" Datatype="&quot;Drive&quot;">
<Sections><Section Name="Input"><Member Name="on" Datatype="Bool"/></Section>
<Section Name="InOut"><Member Name="speed" Datatype="Real"/></Section>
<Section Name="Static"><Member Name="unit" Datatype="&quot;Unit&quot;"><Sections><Section Name="None">
<Member Name="id" Datatype="UInt"/>
<Member Name="limits" Datatype="Struct"><Member Name="low" Datatype="Real"/></Member>
</Section></Sections></Member></Section></Sections></Member>
<Member Name="diag" Datatype="TDiag_Status"/>
<Member Name="to" Datatype="TCON_IP_RFC" Version="1.0"/>
</Section></Sections></Interface><MemoryLayout>Standard</MemoryLayout><Name>Db</Name></AttributeList>
</SW.Blocks.GlobalDB></Document>
"""
SCL = """TYPE "Link"
VERSION : 0.1
   STRUCT
      hw : HW_ANY;
      ids : Array[0..3] of "CONN_OUC";
      con {InstructionName := 'TCON_IP_v4'; LibVersion := '1.0'} : TCON_IP_v4;
      safe : Array[1..2] of TCON_QDN_SEC;
   END_STRUCT;
END_TYPE
TYPE "TADDR_Param"
VERSION : 0.1
   STRUCT
      own : Struct
         port : PORT;
      END_STRUCT;
   END_STRUCT;
END_TYPE
DATA_BLOCK "Line"
{ S7_Optimized_Access := 'FALSE' }
VERSION : 0.1
   STRUCT
      link : "Link";
      to : TADDR_Param;
      state : TDiag_Status;
   END_STRUCT;
BEGIN
   link.hw := 64;
END_DATA_BLOCK
"""
B_AND_R = {
    "Logical/Global.var": "VAR CONSTANT\n\tLANES : USINT := 4;\nEND_VAR\n",
    "Logical/Lib/Lib.typ": "TYPE\n\tReport_typ : STRUCT\n\t\tno : UDINT;\n\tEND_STRUCT;\nEND_TYPE\n",
    "Logical/Lib/SG4/Lib.h": "typedef struct Report_typ\n{\n\tunsigned long no;\n\tfloat w;\n} Report_typ;\n",
    "Logical/Prog1/Variables.var": "VAR\n\ta : Report_typ;\nEND_VAR\n",
    "Logical/Prog2/Variables.var": "VAR\n\tb : ARRAY[1..LANES] OF LREAL;\nEND_VAR\n",
    "Logical/Prog1/Types.typ": (
        "TYPE\n\tMode_enum :\n\t\t(\n\t\tOFF,\n\t\tON := 4\n\t\t);\n"
        "\tLane_typ : STRUCT\n\t\tmode : Mode_enum;\n"
        "\t\tspeed : ARRAY[1..LANES] OF REAL;\n\t\treport : Report_typ;\n\tEND_STRUCT;\nEND_TYPE\n"
    ),
}
WORDS = (
    *(
        "Int",
        "STRING[300]",
        "Struct",
        "END_STRUCT",
        "TYPE",
        "TCON_IP_V4_SEC",
        "IP_V4",
        '"Link"',
        "TON",
        "VARIANT",
    ),
    *(
        "Array[0..9999999999] of Byte",
        "ARRAY[1..LANES] OF",
        "unsigned",
        "<Member>",
        "]]>",
        "&",
        "(*",
        "'",
        "0",
        "",
    ),
    *(
        "Section",
        "Sections",
        "Datatype",
        "Unit",
        "LANES",
        "LANES := LANES",
        "Report_typ",
        "{",
        "\0",
        "\N{SNOWMAN}",
    ),
)


def mutant(text: str, chance: random.Random) -> str:
    """Return the text with one word, one line or a stretch of it changed."""
    match chance.randrange(4):
        case 0:
            words = list(re.finditer(r"[\w.]+|[^\w\s]", text))
            begin, end = chance.choice(words).span() if words else (0, 0)
            return text[:begin] + chance.choice(WORDS) + text[end:]
        case 1:
            lines = text.splitlines(keepends=True) or [""]
            at = chance.randrange(len(lines))
            lines[at : at + 1] = chance.choice(
                ([], [lines[at]] * 2, [chance.choice(lines)], [chance.choice(WORDS)])
            )
            return "".join(lines)
        case 2:
            return text[: chance.randrange(len(text) + 1)]
        case _:
            begin = chance.randrange(len(text) + 1)
            return text[:begin] + text[begin + chance.randrange(40) :]


def ends_well(*words: str) -> None:
    assert main(["udt", *words]) in (0, 1, 2)


@pytest.mark.parametrize(
    ("name", "text", "type_"), [("f.xml", XML, "Db"), ("f.scl", SCL, "Line")], ids=["Openness", "SCL"]
)
def test_a_source_with_a_mistake_ends_in_types_or_lines(
    name: str, text: str, type_: str, tmp_path: Path
) -> None:
    chance = random.Random(64)
    file = tmp_path / name
    file.write_text(text)
    assert main(["udt", "show", str(file), "--type", type_]) == 0
    for _ in range(COUNT):
        file.write_text(mutant(text, chance), encoding="utf-8")
        ends_well("types", str(file))
        ends_well("show", str(file), "--type", type_)


def test_a_folder_with_a_mistake_in_a_file_ends_in_types_or_lines(tmp_path: Path) -> None:
    chance = random.Random(64)
    for name, text in B_AND_R.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    types, library = str(tmp_path / "Logical/Prog1/Types.typ"), str(tmp_path / "Logical/Lib")
    assert main(["udt", "show", types, "--with", library, "--type", "Lane_typ"]) == 0
    for _ in range(COUNT):
        name = chance.choice(list(B_AND_R))
        (tmp_path / name).write_text(mutant(B_AND_R[name], chance), encoding="utf-8")
        ends_well("types", str(tmp_path), "--long-size", "4")
        ends_well("types", types, "--with", library)
        ends_well("types", types)
        (tmp_path / name).write_text(B_AND_R[name])
