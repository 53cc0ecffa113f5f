"""A sender's C struct with explicit padding: a C compiler and our own reader lay it out as wanted."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.udt.test_fit import TELEGRAMS, TYPES
from tests.udt.udt_strategies import layout_of
from trcvtui.udt.cure.c_write import c_text
from trcvtui.udt.layout.layout import Layout, lay_out, rules_for


def wanted(name: str, layout: str) -> Layout:
    """Return a telegram as the receiver lays it out."""
    return lay_out(TYPES.named(name), rules_for(layout))


def test_the_gaps_are_members() -> None:
    assert c_text(wanted("Weight", "natural8")) == (
        "#include <stdint.h>\n\n#pragma pack(push, 1)\n"
        "typedef struct {\n"
        "    uint8_t kind;\n"
        "    uint8_t _pad1[7];\n"
        "    double weight;\n"
        "    int16_t count;\n"
        "    uint8_t _pad2[6];\n"
        "} Weight_natural8;\n"
        "#pragma pack(pop)\n"
    )


def test_a_bit_has_no_member_in_c() -> None:
    assert c_text(wanted("Flags", "s7-standard")) is None


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_keywords_and_blanks_in_names_compile(tmp_path: Path) -> None:
    members = '"int" : INT; "a b" : DINT; a_b : DINT; int16_t : BYTE; c : STRUCT "for" : INT; END_STRUCT;'
    text = c_text(layout_of(members, "natural8"))
    assert text is not None
    for line in ("int16_t int_;", "int32_t a_b;", "int32_t a_b_2;", "uint8_t int16_t_;", "int16_t for_;"):
        assert line in text
    source = tmp_path / "check.c"
    source.write_text(text)
    compiled = subprocess.run(
        ["gcc", "-fsyntax-only", str(source)], capture_output=True, text=True, check=False
    )
    assert compiled.returncode == 0, compiled.stderr


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
@pytest.mark.parametrize("name", TELEGRAMS)
@pytest.mark.parametrize("layout", ["baosky", "natural8", "codesys-2", "baosky-slot4"])
def test_a_compiler_puts_every_member_where_it_is_wanted(name: str, layout: str, tmp_path: Path) -> None:
    sent = wanted(name, layout)
    text = c_text(sent)
    assert text is not None
    struct = text.rpartition("} ")[2].partition(";")[0]
    own = [leaf for leaf in sent.leaves() if "[" not in leaf.path]
    checks = [f'_Static_assert(offsetof({struct}, {leaf.path}) == {leaf.offset}, "");' for leaf in own]
    checks.append(f'_Static_assert(sizeof({struct}) == {sent.size}, "");')
    source = tmp_path / "check.c"
    source.write_text("#include <stddef.h>\n" + text + "\n".join(checks) + "\n")
    compiled = subprocess.run(
        ["gcc", "-fsyntax-only", str(source)], capture_output=True, text=True, check=False
    )
    assert compiled.returncode == 0, compiled.stderr
