"""Siemens Openness XML (SimaticML): PLC data types, global data blocks; trees of `Member[@Name][@Datatype]`.

Start values and comments are left out. A member of a UDT, an FB or a system type has the members that stand
in its own `Sections`; without these the name of the type says it all.
"""

from __future__ import annotations

import re

from trcvtui.errors import Problem, mistake, noting
from trcvtui.udt import ast
from trcvtui.udt.layout.rules import S7
from trcvtui.udt.sources.st import OPTIMISED, read_spec
from trcvtui.udt.sources.xml_source import Element, deeper
from trcvtui.udt.types import BUILTIN_TYPES, ELEMENTARY, Unplaced

TYPE, DATA_BLOCK = "SW.Types.PlcStruct", "SW.Blocks.GlobalDB"
NOT_STORED = ("Temp", "Constant", "Return")
BY_POINTER = "an in-out parameter, of which an instance keeps a pointer"
INSTANCE = (
    "members of an FB instance as the file lists them; it may hide some: the places after it are a guess"
)


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
    notes: list[str] = []
    if sections is None:
        problems.append(Problem(element.where, f"'{name.text.strip()}' without members", "<Sections>"))
        return ast.Declaration(name.text.strip(), None, element.where, tuple(problems))
    members = [m for section in sections.all("Section") for m in _members(section, 1, problems, notes)]
    access = element.at("AttributeList", "MemoryLayout")
    if access is not None and access.text.strip() == "Optimized":
        notes.insert(0, OPTIMISED)
    spec = ast.StructSpec(tuple(members))
    of_type = tuple(problems), tuple(dict.fromkeys(notes)), element.name == DATA_BLOCK
    return ast.Declaration(name.text.strip(), spec, element.where, *of_type)


def _members(element: Element, depth: int, problems: list[Problem], notes: list[str]) -> list[ast.MemberSpec]:
    """Return the members in a section or a STRUCT; a bad one is noted and left out."""
    members: list[ast.MemberSpec] = []
    for member in element.all("Member"):
        with noting(problems):
            spec = _type(member.needed("Datatype"), member, depth, problems, notes)
            members.append(ast.MemberSpec(member.needed("Name"), spec, member.where))
    return members


def _type(text: str, member: Element, depth: int, problems: list[Problem], notes: list[str]) -> ast.Spec:
    """Return the type that ST text names; the members of a STRUCT or a named type in it stand below it."""
    is_struct = re.search(r"(?i)(?<![\w\"])struct\s*$", text)
    spec = read_spec(text[: is_struct.start()] + "INT" if is_struct else text, member.where, first_line=0)
    if is_struct:
        members = _members(member, deeper(depth, member), problems, notes)
        return _filled(spec, ast.StructSpec(tuple(members)))
    of = spec
    while isinstance(of, ast.ArraySpec):
        of = of.element
    own = member.at("Sections")
    if own is None or not isinstance(of, ast.Reference) or of.name.upper() in ELEMENTARY:
        return spec
    stored = [
        (section.get("Name"), one)
        for section in own.all("Section")
        if section.get("Name") not in NOT_STORED
        for one in _members(section, deeper(depth, member), problems, notes)
    ]
    if not stored:
        return spec
    if of.name.casefold() in BUILTIN_TYPES or any(name not in ("", "None") for name, _ in stored):
        notes.append(f"{of.name}: {INSTANCE}")
    inner = tuple([_kept(one) if name == "InOut" else one for name, one in stored])
    return _filled(spec, ast.StructSpec(inner, copy_of=of))


def _kept(member: ast.MemberSpec) -> ast.MemberSpec:
    """Return what an instance keeps of an in-out parameter: the value of an elementary one."""
    row = ELEMENTARY.get(member.spec.name.upper()) if isinstance(member.spec, ast.Reference) else None
    is_value = row is not None and row.name not in ("DT", "DTL")
    return member if is_value else member._replace(spec=Unplaced(member.name, BY_POINTER))


def _filled(spec: ast.Spec, struct: ast.StructSpec) -> ast.Spec:
    return spec._replace(element=_filled(spec.element, struct)) if isinstance(spec, ast.ArraySpec) else struct
