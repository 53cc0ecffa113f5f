"""The exported .ksy: it finds the same values in the bytes as `udt decode`, and the compiler takes it."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import given, settings

from tests.udt.export_types import EVERY_LAYOUT, plant, plant_bytes
from tests.udt.ksy_reader import Parsed, read_yaml
from tests.udt.udt_strategies import layout_of, layouts
from trcvtui.udt.exports import export
from trcvtui.udt.layout.layout import BYTE_ORDERS, Layout
from trcvtui.udt.layout.values import decode
from trcvtui.udt.types import StringType, ValueKind

# The compiler of Kaitai as `npm install kaitai-struct-compiler js-yaml` lays it down.
COMPILER = Path(os.environ.get("TRCVTUI_KSC", "/usr/local/lib")) / "node_modules"
COMPILE = """
const yaml = require(process.argv[1] + "/js-yaml");
const Compiler = require(process.argv[1] + "/kaitai-struct-compiler");
const text = require("fs").readFileSync(0, "utf8");
const compiler = typeof Compiler === "function" ? new Compiler() : Compiler;
compiler.compile(process.argv[2], yaml.load(text), null, false)
  .then(files => console.log(Object.values(files).join("")))
  .catch(problem => { console.error(String(problem)); process.exit(1); });
"""
with_compiler = pytest.mark.skipif(
    shutil.which("node") is None or not (COMPILER / "kaitai-struct-compiler").is_dir(),
    reason="kaitai-struct-compiler is not installed (TRCVTUI_KSC names the folder of its node_modules)",
)


def stored(layout: Layout, data: bytes) -> list[object]:
    """Return what a .ksy tells of each leaf: texts and BOOL as they read, of the others the stored count."""
    found: list[object] = []
    for leaf, value in zip(layout.leaves(), decode(layout, data), strict=True):
        is_text = isinstance(leaf.type, StringType)
        row = None if isinstance(leaf.type, StringType) else layout.rules.stored(leaf.type)
        if is_text or leaf.bit is not None or (row and row.kind is ValueKind.CHARACTER and row.size == 1):
            found.append(value)
            continue
        part = data[leaf.offset : leaf.offset + leaf.size]
        code = leaf.coding.code.replace("?", "B")
        found += struct.unpack(BYTE_ORDERS[layout.rules.byte_order] + code, part)
    return found


@pytest.mark.parametrize(("name", "more"), EVERY_LAYOUT)
def test_the_description_finds_what_udt_decode_finds(name: str, more: dict[str, str]) -> None:
    layout = plant(name, **more)
    data = plant_bytes(layout)
    assert Parsed(export(layout, "ksy")).values(data) == stored(layout, data)


@given(layouts())
@settings(max_examples=60, deadline=None)
def test_any_type_under_any_rules_is_described_byte_for_byte(layout: Layout) -> None:
    if not layout.size or not layout.leaf_count:
        return
    data = bytes(n % 90 + 33 if n % 3 else 0 for n in range(layout.size))  # no NaN, no lone surrogate
    assert Parsed(export(layout, "ksy")).values(data) == stored(layout, data)


def test_names_are_identifiers_and_the_own_name_is_told() -> None:
    text = export(layout_of("Class : INT; U1 : INT; größe : INT; _x : INT; Yes : BOOL;"), "ksy")
    entries = read_yaml(text)["seq"]
    assert [entry.get("id") for entry in entries[:5]] == ["class_", "u1_", "gro_e", "x", "yes"]
    assert [entry.get("doc") for entry in entries[:4]] == ["Class", "U1", "größe", "_x"]


def test_an_array_is_one_entry_however_long_it_is() -> None:
    short, long = (export(layout_of(f"a : ARRAY[1..{n}] OF DINT;"), "ksy") for n in (2, 60_000))
    assert short.count("\n") == long.count("\n")


@with_compiler
@pytest.mark.parametrize("language", ["python", "javascript"])
@pytest.mark.parametrize("name", ["baosky", "s7-standard"])
def test_the_compiler_takes_it(name: str, language: str) -> None:
    text = export(plant(name), "ksy")
    command = ["node", "-e", COMPILE, str(COMPILER), language]
    done = subprocess.run(command, input=text, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "Plant" in done.stdout and "flags" in done.stdout
