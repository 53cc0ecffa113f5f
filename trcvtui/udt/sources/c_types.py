"""The types of C, each with the IEC type of its size; those without one size, and what to write instead."""

from __future__ import annotations

# One IEC type for each C type; the words of a type are sorted, `signed` and a needless `int` left out.
C_TYPES = {
    "int8_t": "SINT",
    "int16_t": "INT",
    "int32_t": "DINT",
    "int64_t": "LINT",
    "uint8_t": "USINT",
    "uint16_t": "UINT",
    "uint32_t": "UDINT",
    "uint64_t": "ULINT",
    "bool": "BOOL",
    "_Bool": "BOOL",
    "char": "CHAR",
    "char8_t": "CHAR",
    "char16_t": "WCHAR",
    "float": "REAL",
    "double": "LREAL",
    "float32_t": "REAL",
    "float64_t": "LREAL",
    "char signed": "SINT",
    "char unsigned": "USINT",
    "short": "INT",
    "short unsigned": "UINT",
    "int": "DINT",
    "int unsigned": "UDINT",
    "long long": "LINT",
    "long long unsigned": "ULINT",
}
FOUR_BYTES = ("int", "int unsigned")
# No size of their own in C; INT, UINT and BOOL have two bytes or one in IEC 61131-3, and four on Windows.
NO_ONE_SIZE = {
    **dict.fromkeys(("long", "long unsigned"), "int32_t or int64_t: its size differs between compilers"),
    **dict.fromkeys(
        ("size_t", "ssize_t", "ptrdiff_t", "intptr_t", "uintptr_t", "time_t"), "a type of one size"
    ),
    **dict.fromkeys(("wchar_t", "double long", "void", "int128"), "a type of one size, such as uint16_t"),
    **dict.fromkeys(("INT", "UINT", "BOOL"), "its typedef in this header: PLCs and Windows differ about it"),
}
LANGUAGE = ("char", "short", "int", "long", "float", "double", "void", "_Bool")
# What is declared in headers that are not read, and no word of the language.
NAMED_TYPES = frozenset(
    name for name in (*C_TYPES, *NO_ONE_SIZE) if name.isidentifier() and name not in LANGUAGE
)
