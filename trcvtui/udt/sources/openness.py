"""Siemens Openness XML (SimaticML): PLC data types, global data blocks; trees of `Member[@Name][@Datatype]`.

Start values, comments and the copies of a UDT's members below a member of that UDT are left out: the name
of the type says it all.
"""

from __future__ import annotations

import re

from trcvtui.errors import Problem, mistake, noting
from trcvtui.udt import ast
from trcvtui.udt.layout.rules import S7
from trcvtui.udt.sources.st import OPTIMISED, read_spec
from trcvtui.udt.sources.xml_source import Element, deeper

TYPE, DATA_BLOCK = "SW.Types.PlcStruct", "SW.Blocks.GlobalDB"


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
    """Return the type that ST text names; the members of a STRUCT in it stand below the element."""
    is_struct = re.search(r"(?i)(?<![\w\"])struct\s*$", text)
    spec = read_spec(text[: is_struct.start()] + "INT" if is_struct else text, member.where, first_line=0)
    if is_struct:
        return _filled(spec, ast.StructSpec(tuple(_members(member, deeper(depth, member), problems))))
    return spec


def _filled(spec: ast.Spec, struct: ast.StructSpec) -> ast.Spec:
    return spec._replace(element=_filled(spec.element, struct)) if isinstance(spec, ast.ArraySpec) else struct
