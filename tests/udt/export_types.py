"""One type with everything in it that an export must carry, and values for it."""

from __future__ import annotations

from tests.udt.udt_strategies import types_of
from trcvtui.udt.layout.layout import LAYOUTS, Layout, lay_out, rules_for
from trcvtui.udt.layout.values import encode

SOURCE = """
TYPE E_State : (Idle := 0, Running := 1, Off := 2, Fault := -1) INT; END_TYPE
TYPE Axis : STRUCT pos : LREAL; m : ARRAY[1..2,0..1] OF INT; on : BOOL; END_STRUCT END_TYPE
TYPE Both : UNION r : REAL; raw : ARRAY[0..3] OF BYTE; END_UNION END_TYPE
TYPE Plant EXTENDS Axis : STRUCT
    id : DINT; state : E_State; flags : ARRAY[0..9] OF BOOL; grid : ARRAY[0..1,0..2] OF BOOL;
    f1 : BOOL; f2 : BOOL; bit1 : BIT; bit2 : BIT; and : BYTE; größe : WORD; größe_ : SINT;
    axes : ARRAY[1..2] OF Axis; b : Both; inner : STRUCT x : INT; y : USINT; END_STRUCT;
    t : TIME; lt : LTIME; d : DATE; ld : LDATE; tod : TOD; ltod : LTOD; dt : DT; ldt : LDT;
    s : STRING[5]; w : WSTRING[4]; c : CHAR; wc : WCHAR; s5 : S5TIME; dtl : DTL;
    p : POINTER TO INT; q : ULINT; li : LINT; lw : LWORD; dw : DWORD; sub : INT(0..10); r : REAL;
    names : ARRAY[0..1] OF STRING[3]; rows : ARRAY[0..1] OF ARRAY[2..3] OF UINT; last : BOOL;
END_STRUCT END_TYPE
"""
VALUES = {
    "pos": -1234.5678, "m[1,0]": 1, "m[1,1]": -2, "m[2,0]": 300, "m[2,1]": -30000, "on": True,
    "id": -7, "state": 2, "flags[0]": True, "flags[9]": True, "grid[1,2]": True, "f2": True, "bit1": True,
    "and": 0xA5, "größe": 0x1234, "größe_": -5, "axes[1].pos": 0.1, "axes[2].m[2,1]": 77, "axes[2].on": True,
    "b.r": 2.5, "inner.x": -9, "inner.y": 200,
    "t": "T#1h2m3s4ms", "lt": "LTIME#1d2h3m4s5ms6us7ns", "d": "D#2024-02-29", "ld": "LDATE#1999-12-31",
    "tod": "TOD#23:59:59.999", "ltod": "LTOD#12:00:00.000000001", "dt": "DT#2026-01-31-12:30:15",
    "ldt": "LDT#2024-02-29-23:59:59.123456789", "s": "ab\xf6\xff!", "w": "\u4f60\xf6b", "c": "\xe9",
    "wc": "\u20ac", "s5": "S5T#1m30s", "dtl": "DTL#2024-01-31-12:30:15.25", "p": 0x1000,
    "q": 2**64 - 1, "li": -(2**63), "lw": 2**63 + 1, "dw": 0xDEADBEEF, "sub": 10, "r": 1.25,
    "names[0]": "a\xe4", "names[1]": "xyz", "rows[1][3]": 65535, "last": True,
}  # fmt: skip


def plant(layout: str = "baosky", byte_order: str | None = None, text: str | None = None) -> Layout:
    """Return the type laid out."""
    return lay_out(types_of(SOURCE).get_type("Plant"), rules_for(layout, byte_order, text), "Plant")


def plant_bytes(layout: Layout) -> bytes:
    """Return the bytes of the values."""
    return encode(layout, VALUES)


EVERY_LAYOUT = [
    *((name, {}) for name in LAYOUTS),
    ("baosky", {"byte_order": "big"}),
    ("baosky", {"text": "cstr"}),
    ("codesys-8", {"text": "s7", "byte_order": "big"}),
]
