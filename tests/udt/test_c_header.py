"""C headers: what a member is read as, and what is refused by name."""

from __future__ import annotations

import sys

import pytest

from tests import golden
from tests.udt.st_texts import lines_of, problems_of
from trcvtui.errors import Problem, UserError
from trcvtui.udt.ast import ArraySpec, Declaration, Formula, StructSpec, TypeName
from trcvtui.udt.layout.layout import lay_out, rules_for
from trcvtui.udt.sources.c_header import read_c_header
from trcvtui.udt.type_set import join_declarations
from trcvtui.udt.types import Pointer


def only(text: str) -> Declaration:
    read = read_c_header(text, "H")
    assert lines_of(read) == []
    (type_,) = read.types
    return type_


def members(text: str, before: str = "") -> dict[str, object]:
    spec = only(f"{before}\ntypedef struct {{ {text} }} T;").spec
    assert isinstance(spec, StructSpec)
    return {m.name: m.spec.name if isinstance(m.spec, TypeName) else m.spec for m in spec.members}


def line_of(text: str, before: str = "") -> str:
    (line,) = lines_of(read_c_header(f"{before}typedef struct {{ {text} }} T;", "H"))
    return line


def test_c_types_are_the_iec_types_of_their_size() -> None:
    found = members(
        "uint8_t a; int8_t b; uint16_t c; int16_t d; uint32_t e; int32_t f; uint64_t g; int64_t h;"
        "float i; double j; bool k; _Bool l; char m; signed char n; unsigned char o; short p;"
        "unsigned short int q; int r; unsigned s; long long t; unsigned long long int u; char16_t v;"
        "const volatile uint8_t w;"
    )
    assert " ".join(map(str, found.values())) == (
        "USINT SINT UINT INT UDINT DINT ULINT LINT REAL LREAL BOOL BOOL CHAR SINT USINT INT UINT DINT UDINT"
        " LINT ULINT WCHAR USINT"
    )


def test_what_is_taken_for_granted_is_noted() -> None:
    type_ = only("typedef struct { int a; char b[5]; enum { X, Y = 7, Z } c; union { int d; float e; }; } T;")
    assert type_.notes == (
        "int is taken as 4 bytes",
        "char[] is read as ARRAY OF CHAR: a text ends with its NUL",
        "an enum is taken as 4 bytes",
        "a member without a name is called anonymous_N",
    )


def test_arrays_pointers_and_several_names() -> None:
    found = members("uint16_t a, b[3][2]; void *p, (*q)(int); struct tag *next;")
    assert found["a"] == "UINT"
    assert isinstance(found["b"], ArraySpec) and found["b"].bounds == ((0, 2), (0, 1))
    assert [found[name] for name in ("p", "q", "next")] == [
        Pointer("POINTER TO void"),
        Pointer("POINTER TO a function"),
        Pointer("POINTER TO tag"),
    ]


def test_defines_and_values_of_enumerations_are_numbers() -> None:
    before = "#define N 5 // five\n#define M ((uint16_t)(N * 2 + 0x10UL)) /* more */\nenum { A, B = M };"
    read = read_c_header(
        f"{before}\nstatic const int K = B << 1;\ntypedef struct {{ char a[M], b[B], c[K / 2]; }} T;", "H"
    )
    assert [one[:2] for one in read.constants] == [("N", 5), ("M", 26), ("A", 0), ("B", 26), ("K", 52)]
    spec = read.types[0].spec
    assert isinstance(spec, StructSpec)
    assert [m.spec.bounds for m in spec.members if isinstance(m.spec, ArraySpec)] == [((0, 25),)] * 3


def test_a_number_of_another_header_is_asked_for() -> None:
    found = members("uint8_t a[LIMIT + 1];", '#include "limits.h"')["a"]
    assert isinstance(found, ArraySpec)
    assert found.bounds == ((0, Formula("(LIMIT + 1) - 1", "H:2:26")),)
    types = join_declarations([read_c_header("typedef struct { uint8_t a[LIMIT]; } T;", "H")], "H")
    assert types.unknown_constants == ("LIMIT",)


def test_a_type_of_another_header_is_an_unknown_type() -> None:
    types = join_declarations(
        [
            read_c_header(
                '#include "x.h"\ntypedef struct { pos_t a; uint8_t b; } T; typedef struct { int c; } U;', "H"
            )
        ],
        "H",
    )
    assert types.names() == ["U"]
    assert [str(p) for p in types.problems] == ["H:2:18: found 'pos_t', expected a known type"]


def test_typedefs_tags_and_macros_name_types() -> None:
    before = (
        "typedef unsigned char u8; typedef unsigned short UINT;\n#define WORD16 unsigned short\n"
        "typedef struct inner { u8 a; } Inner; typedef struct inner Same; struct plain { int x; };\n"
    )
    read = read_c_header(
        before + "typedef struct { u8 a; UINT b; WORD16 c; struct inner d; struct plain e; Same f; } T;", "H"
    )
    assert lines_of(read) == []
    spec = read.types[-1].spec
    assert isinstance(spec, StructSpec)
    assert [m.spec.name for m in spec.members if isinstance(m.spec, TypeName)] == [
        *("USINT", "UINT", "UINT", "Inner", "plain", "Same")
    ]
    assert join_declarations([read], "H").problems == ()


def test_the_layout_c_is_that_of_the_compiler_packed_or_not() -> None:
    for pragma, size in (("", 16), ("#pragma pack(1)\n", 9)):
        types = join_declarations(
            [read_c_header(f"{pragma}typedef struct {{ char a; double b; }} T;", "H")], "H"
        )
        assert lay_out(types.get_type("T"), rules_for("c")).size == size


@pytest.mark.parametrize(
    ("text", "packs"),
    [
        ("#pragma pack(push, 1)\n{0}\n#pragma pack(pop)\n{1}", (1, None)),
        ("#pragma pack(2)\n{0}\n#pragma pack()\n{1}", (2, None)),
        ("#pragma pack(push)\n#pragma pack(4)\n{0}\n#pragma pack(pop)\n{1}", (4, None)),
        ("#define P 1\n#pragma pack(push, id, P)\n{0}\n#pragma pack(pop, id)\n{1}", (1, None)),
        ("{0}\n#pragma once\n#pragma pack(16)\n{1}", (None, 8)),
        ("#if 0\n#pragma pack(1)\n#endif\n{0}{1}", (None, None)),
        ("namespace a::b {\n#pragma pack(1)\n{0}\n#pragma pack()\n}\n{1}", (1, None)),
        ('#define B() _Pragma("pack(1)")\n#define E __pragma(pack())\nB()\n{0}\nE\n{1}', (1, None)),
    ],
)
def test_pragma_pack_holds_from_line_to_line(text: str, packs: tuple[int | None, int | None]) -> None:
    one, two = "typedef struct { char a; int b; } A;", "typedef struct { char a; int b; } B;"
    read = read_c_header(text.replace("{0}", one).replace("{1}", two), "H")
    assert lines_of(read) == []
    assert tuple(t.spec.pack for t in read.types if isinstance(t.spec, StructSpec)) == packs


@pytest.mark.parametrize(
    "text",
    [
        "typedef struct __attribute__((packed)) { char a; int b; } T;",
        "typedef struct { char a; int b; } __attribute__((__packed__)) T;",
        "#define PACKED __attribute__((packed))\ntypedef struct PACKED tag { char a; int b; } T;",
        "typedef __packed struct { char a; int b; } T;",
        "#define P( one ) one __attribute__((packed))\nP(\ntypedef struct { char a; int b; }) T;",
    ],
)
def test_a_packed_attribute_packs_its_structure(text: str) -> None:
    spec = only(text).spec
    assert isinstance(spec, StructSpec) and spec.pack == 1


def test_what_would_move_a_member_is_refused_by_name() -> None:
    golden.mistakes(
        "members of a C header",
        lambda text: problems_of(read_c_header(f"typedef struct {{ {text} }} T;", "H")),
    )


def test_a_base_class_and_a_std_array_lie_as_in_cpp() -> None:
    text = (
        "#pragma pack(push, 1)\nstruct Base { enum { N = 3 }; const uint32_t result; };\n"
        "struct D final : public Base { [[nodiscard]] D() : Base() {} uint8_t a[N]; };\n"
        "using Mac = std::array<std::uint8_t, 6>;\n#pragma pack(pop)\nenum { N = 9 };\n"
        "struct A { const std::array<uint8_t, 16> a; std::array<std::array<Mac, 2>, 3> b{}; };\n"
    )
    types = join_declarations([read_c_header(text, "H.hpp")], "H.hpp")
    assert types.problems == ()
    layouts = [lay_out(types.get_type(name), rules_for("c")) for name in ("D", "A")]
    assert [layout.size for layout in layouts] == [7, 16 + 6 * 6]
    assert [(leaf.path, leaf.offset) for leaf in layouts[0].leaves()][:2] == [("result", 0), ("a[0]", 4)]


def test_what_changes_a_class_of_cpp_is_refused_at_its_line() -> None:
    def problems(text: str) -> tuple[Problem, ...]:
        types = join_declarations([read_c_header(text, "H.hpp")], "H.hpp")
        assert not {"V", "W"} <= {*types.names(), "W" if "W" not in text else ""}
        return types.problems

    golden.mistakes("C++ in a header", problems)


def test_a_bad_type_never_hides_a_good_one() -> None:
    read = read_c_header(
        "typedef struct { int int; } A;\ntypedef struct { int a; } B;\ntypedef struct { A a; } C;", "H"
    )
    assert join_declarations([read], "H").names() == ["B"]
    assert len(lines_of(read)) == 1


def test_conditions_choose_what_counts() -> None:
    text = (
        '#ifndef H_\n#define H_\n#ifdef __cplusplus\nextern "C" {\n#endif\n#define V 2\n'
        "#if V > 1 && defined(H_) && !defined(X)\n"
        "typedef struct { int a; } A;\n#elif 1\nno\n#else\nno\n#endif\n"
        "#if V == 1\ntypedef struct { int a; } B;\n#else\ntypedef struct { int a; } C;\n#endif\n#endif\n"
        "static inline int f(struct g *x) { return x ? 1 : 2; }\nint h(unknown_t *x);\n"
    )
    text += "#ifdef __LITTLE_ENDIAN_BITFIELD\nstruct L { int a; };\n#else\nno\n#endif"
    read = read_c_header(text, "H")
    assert lines_of(read) == [] and [type_.name for type_ in read.types] == ["A", "C", "L"]
    assert [type_.where for type_ in read.types] == ["H:8:27", "H:17:27", "H:23:8"]


def test_directives_that_do_not_close_are_told() -> None:
    for text in ("#if 1", "#endif", "#else", "/* open", "#pragma pack(3)", "#pragma pack(pop)", "#error no"):
        assert len(lines_of(read_c_header(text, "H"))) == 1, text


def test_hostile_headers_end_at_once() -> None:
    lol = "".join(f"#define L{n} L{n + 1} L{n + 1} x\n" for n in range(60)) + "typedef struct { L0 a; } T;"
    sums = (
        "".join(f"#define L{n} (L{n + 1}+L{n + 1})\n" for n in range(99))
        + "typedef struct { char a[L0]; } T;"
    )
    for text in (
        lol,
        sums,
        "typedef struct {" * 5000,
        "typedef int a[" + "(" * 5000,
        "#if 1\n" * 5000,
        "/*" * 50_000,
        "namespace " * 50_000,
        "#define D(x) x x\ntypedef struct { " + "D(" * 60 + "char a;" + ")" * 60 + " } T;",
    ):
        try:
            read_c_header(text, "H")
        except UserError as refused:
            assert refused.lines()
    assert lines_of(read_c_header("typedef struct { char a[1 << 60 << 60]; } T;", "H"))


def test_without_pycparser_one_line_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pycparser.c_parser", None)
    with pytest.raises(UserError) as refused:
        read_c_header("", "device.h")
    assert refused.value.lines() == [
        "device.h: found a C header, but no pycparser, expected this package: pip install 'trcvtui[c]'"
    ]
