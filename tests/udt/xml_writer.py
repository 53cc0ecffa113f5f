"""Declarations without places, and declarations written out as ST, as PLCopen XML and as Openness XML."""

from __future__ import annotations

from xml.sax.saxutils import escape, quoteattr

from trcvtui.udt.ast import (
    ArraySpec,
    Declaration,
    Declarations,
    EnumSpec,
    Formula,
    MemberSpec,
    Number,
    PointerSpec,
    RangeSpec,
    Reference,
    Spec,
    StructSpec,
    TextSpec,
)
from trcvtui.udt.types import StringType


def bare(read: Declarations) -> tuple[tuple[str, object], ...]:
    """Return types and their specifications without the places where they stand."""
    return tuple((type_.name, _bare(type_.spec)) for type_ in read.types)


def _bare(value: object) -> object:
    match value:
        case Reference(name, _):
            return name.upper().removeprefix("_.")
        case Formula(text, _):
            return text.replace(" ", "")
        case MemberSpec(name, spec, _):
            return name, _bare(spec)
        case tuple() if hasattr(value, "_fields"):
            return (type(value).__name__, *(_bare(part) for part in value))
        case tuple():
            return tuple(_bare(part) for part in value)
    return value


def number(value: Number) -> str:
    return str(value) if isinstance(value, int) else value.text


def in_st(type_: Declaration) -> str:
    assert type_.spec is not None
    return f"TYPE {type_.name} : {st_spec(type_.spec)}; END_TYPE\n"


def st_spec(spec: Spec) -> str:
    match spec:
        case Reference(name=name):
            return name
        case StringType(length=length, wide=wide):
            return ("WSTRING" if wide else "STRING") + ("" if length is None else f"[{length}]")
        case TextSpec(length=formula, wide=wide):
            return ("WSTRING" if wide else "STRING") + f"[{formula.text}]"
        case RangeSpec(base, low, high):
            return f"{base.name}({number(low)}..{number(high)})"
        case PointerSpec(text):
            return text
        case ArraySpec(bounds, element):
            return f"ARRAY[{_ranges(bounds)}] OF {st_spec(element)}"
        case EnumSpec(base, values):
            listed = ", ".join(n if v is None else f"{n} := {number(v)}" for n, v in values)
            return f"({listed})" + (f" {base.name}" if base else "")
        case StructSpec(members=members, is_union=is_union):
            word = "UNION" if is_union else "STRUCT"
            return f"{word} " + " ".join(f"{m.name} : {st_spec(m.spec)};" for m in members) + f" END_{word}"
    raise AssertionError(spec)


def _ranges(bounds: tuple[tuple[Number, Number], ...]) -> str:
    return ", ".join(f"{number(low)}..{number(high)}" for low, high in bounds)


def in_plcopen(types: list[Declaration]) -> str:
    """Return a project with these types, as an IDE writes it."""
    rows = []
    for type_ in types:
        assert type_.spec is not None
        rows.append(
            f'<dataType name="{type_.name}"><baseType>\n{_plcopen(type_.spec)}\n</baseType></dataType>'
        )
    return (
        '<project xmlns="http://www.plcopen.org/xml/tc6_0201"><types><dataTypes>'
        + "\n".join(rows)
        + ("</dataTypes><pous/></types></project>")
    )


def _plcopen(spec: Spec) -> str:
    match spec:
        case Reference(name=name):
            return f"<{name}/>" if name.isupper() else f'<derived name="{name}"/>'
        case StringType(length=length, wide=wide):
            return f"<{'w' * wide}string" + ("/>" if length is None else f' length="{length}"/>')
        case TextSpec(length=formula, wide=wide):
            return f'<{"w" * wide}string length="{formula.text}"/>'
        case RangeSpec(base, low, high):
            limits = f'<range lower="{number(low)}" upper="{number(high)}"/>'
            return f"<subrangeSigned>{limits}<baseType>{_plcopen(base)}</baseType></subrangeSigned>"
        case PointerSpec(text):
            target = _plcopen(Reference(text.removeprefix("POINTER TO "), ""))
            return f"<pointer><baseType>{target}</baseType></pointer>"
        case ArraySpec(bounds, element):
            sides = "".join(f'<dimension lower="{number(a)}" upper="{number(b)}"/>' for a, b in bounds)
            return f"<array>{sides}<baseType>{_plcopen(element)}</baseType></array>"
        case EnumSpec(base, values):
            rows = "".join(
                f'<value name="{n}"/>' if v is None else f'<value name="{n}" value="{number(v)}"/>'
                for n, v in values
            )
            ends = f"<baseType>{_plcopen(base)}</baseType>" if base else ""
            return f"<enum><values>{rows}</values>{ends}</enum>"
        case StructSpec(members=members, is_union=is_union):
            word = "union" if is_union else "struct"
            inner = "\n".join(
                f'<variable name="{m.name}"><type>{_plcopen(m.spec)}</type></variable>' for m in members
            )
            return f"<{word}>{inner}</{word}>"
    raise AssertionError(spec)


def in_openness(type_: Declaration) -> str:
    """Return the export of one PLC data type."""
    assert isinstance(type_.spec, StructSpec)
    sections = f'<Sections xmlns="urn:v5"><Section Name="None">{_members(type_.spec)}</Section></Sections>'
    return (
        '<Document><SW.Types.PlcStruct ID="0"><AttributeList><Interface>'
        f"{sections}</Interface><Name>{escape(type_.name)}</Name></AttributeList></SW.Types.PlcStruct></Document>"
    )


def _members(struct: StructSpec) -> str:
    rows = []
    for member in struct.members:
        inner: Spec = member.spec
        while isinstance(inner, ArraySpec):
            inner = inner.element
        below = _members(inner) if isinstance(inner, StructSpec) else ""
        rows.append(
            f'<Member Name="{member.name}" Datatype={quoteattr(_datatype(member.spec))}>{below}</Member>'
        )
    return "\n".join(rows)


def _datatype(spec: Spec) -> str:
    match spec:
        case StructSpec():
            return "Struct"
        case ArraySpec(bounds, element):
            return f"Array[{_ranges(bounds)}] of {_datatype(element)}"
        case Reference(name=name):
            return name.capitalize() if name.isupper() else f'"{name}"'
        case StringType(length=length, wide=wide):
            return ("WString" if wide else "String") + ("" if length is None else f"[{length}]")
        case TextSpec(length=formula, wide=wide):
            return ("WString" if wide else "String") + f"[{formula.text}]"
    raise AssertionError(spec)
