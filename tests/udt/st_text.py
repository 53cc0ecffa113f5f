"""Random declarations, and ST text that an engineer would write for them: gaps, case and forms drawn."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from trcvtui.udt.ast import (
    ArraySpec,
    Declaration,
    EnumSpec,
    MemberSpec,
    Number,
    RangeSpec,
    Spec,
    StructSpec,
    TypeName,
)
from trcvtui.udt.types import ELEMENTARY, Pointer, RawType, StringType, ValueKind

HERE = ""
GAPS = [
    " ",
    "  ",
    "\n\t",
    "\r\n",
    " (* a (* b *) *) ",
    " // c\n",
    " /* ; */ ",
    " {attribute 'hide'} ",
    "{x := 'a } b'}",
]
INITIALS = ["", " := 5", " := (a := 1, b := [2(0)])", " := 'x; y'", " := T#1s500ms", " := Mode#Run"]
PLACES = ["", " AT %I*", " AT %QX0.1"]

names = st.from_regex(r"\A[a-zé_][a-z0-9]{0,4}_\Z")
numbers = st.integers(-40, 300)
whole = st.sampled_from(
    [name for name, row in ELEMENTARY.items() if row.kind in (ValueKind.INTEGER, ValueKind.BITS)]
)
ranges = st.tuples(numbers, st.integers(0, 20)).map(lambda b: (b[0], b[0] + b[1]))


def _reference(name: str) -> TypeName:
    return TypeName(name, HERE)


def _struct(members: list[tuple[str, Spec]], is_union: bool) -> StructSpec:
    found = tuple(MemberSpec(f"{name}{n}", spec, HERE) for n, (name, spec) in enumerate(members))
    return StructSpec(found, is_union=is_union)


leaves: st.SearchStrategy[Spec] = st.one_of(
    st.sampled_from([*ELEMENTARY, "Lib.T", "_.Kind", "motor_data"]).map(_reference),
    st.builds(StringType, st.none() | st.integers(1, 300), st.booleans()),
    st.builds(lambda base, b: RangeSpec(_reference(base), *b), whole, ranges),
    st.sampled_from(["POINTER TO INT", "REFERENCE TO Lib.T", "REF_TO ARRAY[0..9] OF BYTE"]).map(Pointer),
    st.just(RawType("Lib.Cyl", "an FB instance")),
    st.builds(
        lambda base, own: EnumSpec(
            _reference(base) if base else None, tuple((f"v{n}", number) for n, number in enumerate(own))
        ),
        st.none() | whole,
        st.lists(st.none() | numbers, min_size=1, max_size=4),
    ),
)
specs: st.SearchStrategy[Spec] = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.builds(lambda b, s: ArraySpec(tuple(b), s), st.lists(ranges, min_size=1, max_size=3), inner),
        st.builds(_struct, st.lists(st.tuples(names, inner), max_size=4), st.booleans()),
    ),
    max_leaves=8,
)


@st.composite
def declarations(draw: Any) -> list[Declaration]:
    """Return declarations of different names; STRUCT and UNION with a base and pack_mode or without."""
    found = []
    for n, spec in enumerate(draw(st.lists(specs, max_size=4))):
        if isinstance(spec, StructSpec):
            base = draw(st.none() | st.sampled_from(["Base", "Lib.Base"]).map(_reference))
            spec = spec._replace(base=base, pack=draw(st.none() | st.sampled_from([0, 1, 2, 4, 8])))
        if not isinstance(spec, RawType):  # an alias of an FB with arguments is an enumeration
            found.append(Declaration(f"{draw(names)}{n}", spec, HERE))
    return found


class Writer:
    """One way to write declarations down; `draw` chooses among the forms that mean the same."""

    def __init__(self, draw: Any) -> None:
        self.draw = draw

    def one_of(self, *forms: str) -> str:
        return str(self.draw(st.sampled_from(forms)))

    def spaced(self, *words: str) -> str:
        return "".join(word + self.one_of(*GAPS) for word in words)

    def word(self, word: str) -> str:
        return self.one_of(word, word.lower(), word.capitalize())

    def file(self, declared: list[Declaration]) -> str:
        text = self.one_of(*GAPS)
        for declaration in declared:
            text += self.declaration(declaration)
            text += self.one_of("", "END_TYPE TYPE ", "END_TYPE; {x} TYPE ")
        return "TYPE " + text + "END_TYPE" if declared else text

    def declaration(self, declaration: Declaration) -> str:
        spec = declaration.spec
        name = self.one_of(declaration.name, f"INTERNAL {declaration.name}", f'"{declaration.name}"')
        head, extends = [name], ""
        if isinstance(spec, StructSpec):
            if spec.pack is not None:
                head.insert(0, f"{{attribute 'pack_mode' := '{spec.pack}'}}")
            if spec.base is not None:
                extends = self.spaced(self.word("EXTENDS"), spec.base.name)
        colon = self.spaced(":")
        head_text = self.spaced(*head) + self.one_of(extends + colon, colon + extends)
        assert spec is not None
        return head_text + self.spec(spec) + self.one_of(*INITIALS) + self.spaced(";")

    def spec(self, spec: Spec) -> str:
        match spec:
            case TypeName(name):
                return self.one_of(name, name.lower()) if name.upper() in ELEMENTARY else name
            case StringType(length, wide):
                word = self.word("WSTRING" if wide else "STRING")
                return word if length is None else word + self.one_of(f"[{length}]", f"( {length} )")
            case RangeSpec(base, low, high):
                return f"{base.name}({self.number(low)}..{self.number(high)})"
            case Pointer(text):
                return text
            case RawType(name):
                return f"{name}(MAIN._a, b := 5)"
            case EnumSpec(base, values):
                return self.enumeration(base, values)
            case ArraySpec(bounds, element):
                ranges = ",".join(f"{self.number(low)}..{self.number(high)}" for low, high in bounds)
                return self.spaced(f"{self.word('ARRAY')} [{ranges}]{self.word('OF')}") + self.spec(element)
            case StructSpec(members, _, _, is_union):
                word = "UNION" if is_union else "STRUCT"
                body = "".join(map(self.member, members))
                return self.spaced(self.word(word)) + body + self.word(f"END_{word}")
        raise AssertionError(spec)

    def member(self, member: MemberSpec) -> str:
        name = self.one_of(member.name, f'"{member.name}"', f"`{member.name}`")
        head = self.spaced(name + self.one_of(*PLACES), ":")
        return head + self.spec(member.spec) + self.one_of(*INITIALS) + self.spaced(";")

    def enumeration(self, base: TypeName | None, values: tuple[tuple[str, Number | None], ...]) -> str:
        own = (name if number is None else f"{name} := {self.number(number)}" for name, number in values)
        text = f"({', '.join(own)}{self.one_of('', ',')})"
        return text if base is None else self.one_of(f"{text} {base.name}", f"{base.name} {text}")

    def number(self, number: Number) -> str:
        assert isinstance(number, int)
        forms = [str(number), f"LINT#{number}"]
        return self.one_of(*forms, *([f"16#{number:X}", f"2#{number:b}"] if number >= 0 else []))


def placeless(spec: Any) -> Any:
    """Return a specification with all places left out, and elementary types by their names in capitals."""
    match spec:
        case TypeName(name):
            return TypeName(name.upper() if name.upper() in ELEMENTARY else name, HERE)
        case tuple() if hasattr(spec, "_replace"):
            named: Any = spec
            changed = {key: placeless(value) for key, value in named._asdict().items()}
            return named._replace(**changed | ({"where": HERE} if "where" in changed else {}))
        case tuple():
            return tuple(map(placeless, spec))
    return spec
