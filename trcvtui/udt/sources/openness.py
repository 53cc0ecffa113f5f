"""Siemens Openness XML (SimaticML): PLC data types, global data blocks; trees of `Member[@Name][@Datatype]`.

Start values, comments and the copies of a UDT's members below a member of that UDT are left out: the name
of the type says it all.
"""

from __future__ import annotations

import re

from trcvtui.errors import Problem, mistake, noting
from trcvtui.udt import ast
from trcvtui.udt.layout.rules import S7
from trcvtui.udt.literals import QUALIFIED_NAME
from trcvtui.udt.sources.st import OPTIMISED
from trcvtui.udt.sources.xml_source import Element, bounds, deeper, text_type
from trcvtui.udt.types import Pointer

TYPE, DATA_BLOCK = "SW.Types.PlcStruct", "SW.Blocks.GlobalDB"

_ARRAY = re.compile(r"array\s*\[([^\[\]]{1,400})\]\s*of\s+(.+)", re.IGNORECASE | re.DOTALL)
_TEXT = re.compile(r"(w?)string\s*(?:\[([^\[\]]{1,200})\])?", re.IGNORECASE)
_POINTER = re.compile(r"ref_to\s+.+", re.IGNORECASE | re.DOTALL)
_QUOTED = re.compile(r'"([^"]+)"')


def read_openness(root: Element) -> ast.Declarations:
    """Return what an export declares; raise UserError when it holds something else."""
    structs = list(root.all(TYPE, DATA_BLOCK))
    if not structs:
        others = ", ".join(f"<{child.name}>" for child in root.children if child.name.startswith("SW."))
        raise mistake(root.where, others or "no type", f"<{TYPE}> or <{DATA_BLOCK}>")
    types: list[ast.Declaration] = []
    problems: list[Problem] = []
    for struct in structs:
        with noting(problems):
            types.append(_declaration(struct))
    return ast.Declarations(tuple(types), tuple(problems), sender=ast.SenderLayout(S7.name))


def _declaration(element: Element) -> ast.Declaration:
    name = element.at("AttributeList", "Name")
    if name is None or not name.text.strip():
        raise mistake(element.where, f"<{element.name}> without a name", "<AttributeList> with <Name>")
    sections = element.at("AttributeList", "Interface", "Sections") or element.at("Interface", "Sections")
    problems: list[Problem] = []
    if sections is None:
        problems.append(Problem(element.where, f"'{name.text.strip()}' without members", "<Sections>"))
        return ast.Declaration(name.text.strip(), None, element.where, tuple(problems))
    members = [m for section in sections.all("Section") for m in _members(section, 1, problems)]
    access = element.at("AttributeList", "MemoryLayout")
    notes = (OPTIMISED,) if access is not None and access.text.strip() == "Optimized" else ()
    spec = ast.StructSpec(tuple(members))
    is_data = element.name == DATA_BLOCK
    return ast.Declaration(name.text.strip(), spec, element.where, tuple(problems), notes, is_data)


def _members(element: Element, depth: int, problems: list[Problem]) -> list[ast.MemberSpec]:
    """Return the members in a section or a STRUCT; a bad one is noted and left out."""
    members: list[ast.MemberSpec] = []
    for member in element.all("Member"):
        with noting(problems):
            spec = _type(member.needed("Datatype"), member, depth, problems)
            members.append(ast.MemberSpec(member.needed("Name"), spec, member.where))
    return members


def _type(text: str, member: Element, depth: int, problems: list[Problem]) -> ast.Spec:
    text = text.strip()
    if array := _ARRAY.fullmatch(text):
        inner = _type(array.group(2), member, deeper(depth, member), problems)
        return ast.ArraySpec(_bounds(array.group(1), member), inner)
    if text.upper() == "STRUCT":
        return ast.StructSpec(tuple(_members(member, deeper(depth, member), problems)))
    if string := _TEXT.fullmatch(text):
        return text_type(string.group(2) or "", bool(string.group(1)), member.where)
    if _POINTER.fullmatch(text):
        return Pointer(text)
    if quoted := _QUOTED.fullmatch(text):
        return ast.Reference(quoted.group(1), member.where)
    if re.fullmatch(QUALIFIED_NAME, text):
        return ast.Reference(text, member.where)
    expected = 'a type such as Int, String[10], Array[0..3] of "T"'
    raise mistake(member.where, f"Datatype '{text[:40]}'", expected)


def _bounds(text: str, member: Element) -> tuple[tuple[ast.Number, ast.Number], ...]:
    ranges = text.split(",")
    if len(ranges) > ast.MOST_DIMENSIONS:
        raise mistake(member.where, f"{len(ranges)} dimensions", f"at most {ast.MOST_DIMENSIONS}")
    pairs: list[tuple[ast.Number, ast.Number]] = []
    for range_ in ranges:
        low, dots, high = range_.partition("..")
        if not dots:
            raise mistake(member.where, f"bounds '{range_.strip()[:40]}'", "low..high")
        pairs.append(bounds(low, high, member.where))
    return tuple(pairs)
