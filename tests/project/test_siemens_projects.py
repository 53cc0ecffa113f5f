"""What a project file of a Siemens dialect may say that another may not."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from trcvtui.errors import UserError
from trcvtui.project.file import read_project
from trcvtui.project.project import Project

DATA = """
[[data]]
name = "rx"
type = "ARRAY[0..7] OF BYTE"
optimized = true
"""
INSTANCE = """
[[connect]]
name = "C1"

[[instance]]
name = "T"
block = "TRCV_C"
connect = "C1"
ADHOC = true
"""


def project(dialect: str, tables: str) -> Project:
    return read_project(tomllib.loads(f'dialect = "{dialect}"\n{tables}'), "b.toml", Path("."))


def mistake(dialect: str, tables: str) -> str:
    with pytest.raises(UserError) as raised:
        project(dialect, tables)
    [line] = raised.value.lines()
    return line


def test_data_may_be_symbolic() -> None:
    [data] = project("s7-1500", DATA).data
    assert data.optimized
    [plain] = project("s7-1500", DATA.replace("optimized = true", "")).data
    assert not plain.optimized


def test_to_other_vendors_symbolic_means_nothing() -> None:
    assert mistake("baosky", DATA) == (
        "b.toml: data rx: optimized: found an unknown key, expected one of name, type, "
        "layout, byte_order, text, pointer_size, string_even"
    )


def test_instructions_before_3_have_no_adhoc_pin() -> None:
    assert mistake("s7-1200-legacy", INSTANCE) == (
        "b.toml: instance T: ADHOC: found a pin, "
        "expected another: blocks of s7-1200-legacy have none of that name"
    )
    newer = project("s7-1500", INSTANCE)
    assert "ADHOC" in [pin.name for pin in newer.pins("TRCV_C")]
    older = project("s7-1200-legacy", INSTANCE.replace("ADHOC = true", ""))
    assert "ADHOC" not in [pin.name for pin in older.pins("TRCV_C")]
