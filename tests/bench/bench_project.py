"""The project that the tests of the bench commands speak to."""

from __future__ import annotations

import tomllib
from pathlib import Path

from trcvtui.project.file import read_project
from trcvtui.project.project import Project

TELEGRAM = """
TYPE Point : STRUCT x : INT; y : INT; END_STRUCT END_TYPE
TYPE Mode : (Off := 0, On := 7) INT; END_TYPE
TYPE Telegram : STRUCT
    id : DINT; speed : REAL; flag : BOOL; mode : Mode; t : TIME; name : STRING[8];
    m : ARRAY[1..2, 0..1] OF INT; pts : ARRAY[0..2] OF Point; w : WORD;
END_STRUCT END_TYPE
"""
TEXT = """
dialect = "baosky"
[[udt]]
file = "telegram.st"
[[data]]
name = "rx"
type = "Telegram"
[[data]]
name = "raw"
type = "ARRAY[0..7] OF BYTE"
[[data]]
name = "n"
type = "INT"
[[connect]]
name = "C1"
[[instance]]
name = "X"
block = "TRCV_C"
connect = "C1"
data = "rx"
[[instance]]
name = "Y"
block = "TRCV_C"
connect = "C1"
[[peer]]
name = "P1"
active = true
remote = "@C1"
[[peer]]
name = "P2"
active = false
[[message]]
name = "hello"
text = 'text "hello" split=2 gap=T#20ms'
[[message]]
name = "numbered"
text = "hex 01 {n:2:big}"
peer = "P1"
[[sequence]]
name = "start_up"
steps = ["hello", "T#100ms", "numbered"]
"""


def bench_project(folder: Path) -> Project:
    """Return the project; its UDT file and `x.bin` stand in the folder."""
    (folder / "telegram.st").write_text(TELEGRAM)
    (folder / "x.bin").write_bytes(b"\x00\x01file")
    return read_project(tomllib.loads(TEXT), "b.toml", folder)
