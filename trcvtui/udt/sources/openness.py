"""Siemens Openness XML (SimaticML): data types and global data blocks as `Member[@Name][@Datatype]` trees.

Start values and comments are left out. The `Sections` of a member contain a copy of its type.
"""

from __future__ import annotations

import re

from trcvtui.errors import Problem, collect_problems, mistake
from trcvtui.udt import ast
from trcvtui.udt.layout.rules import S7
from trcvtui.udt.resolve import references
from trcvtui.udt.sources.st import OPTIMISED_NOTE, read_spec
from trcvtui.udt.sources.xml_source import Element, next_depth
from trcvtui.udt.types import BUILTIN_TYPES, ELEMENTARY, RawType

TYPE_ELEMENT, DATA_BLOCK_ELEMENT = "SW.Types.PlcStruct", "SW.Blocks.GlobalDB"
UNSTORED_SECTIONS = ("Temp", "Constant", "Return")
BY_POINTER_NOTE = "this in-out parameter is stored as a pointer"
INSTANCE_NOTE = "this FB instance may have members that the file hides: the places after it are a guess"

Copies = list[ast.Declaration]


def read_openness(root: Element) -> ast.Declarations:
    """Return what an export declares; raise UserError if it has neither a type nor a data block."""
    structs = list(root.each(TYPE_ELEMENT, DATA_BLOCK_ELEMENT))
    if not structs:
        others = ", ".join(f"<{child.name}>" for child in root.children if child.name.startswith("SW."))
        raise mistake(root.where, others or "no type", f"<{TYPE_ELEMENT}> or <{DATA_BLOCK_ELEMENT}>")
    types: list[ast.Declaration] = []
    problems: list[Problem] = []
    copies: Copies = []
    for struct in structs:
        with collect_problems(problems):
            types.append(_declaration(struct, copies))
    sender = ast.SenderLayout(S7.name)
    return ast.Declarations(tuple(types), tuple(problems), sender=sender, copies=tuple(copies))


def _declaration(element: Element, copies: Copies) -> ast.Declaration:
    name = element.find("AttributeList", "Name")
    if name is None or not name.text.strip():
        raise mistake(element.where, f"<{element.name}> without a name", "<AttributeList> with <Name>")
    sections = element.find("AttributeList", "Interface", "Sections") or element.find("Interface", "Sections")
    problems: list[Problem] = []
    if sections is None:
        problems.append(Problem(element.where, f"'{name.text.strip()}' without members", "<Sections>"))
        return ast.Declaration(name.text.strip(), None, element.where, tuple(problems))
    members = [m for section in sections.each("Section") for m in _members(section, 1, problems, copies)]
    access = element.find("AttributeList", "MemoryLayout")
    notes = (OPTIMISED_NOTE,) if access is not None and access.text.strip() == "Optimized" else ()
    spec = ast.StructSpec(tuple(members))
    is_data = element.name == DATA_BLOCK_ELEMENT
    return ast.Declaration(name.text.strip(), spec, element.where, tuple(problems), notes, is_data)


def _members(element: Element, depth: int, problems: list[Problem], copies: Copies) -> list[ast.MemberSpec]:
    """Return the members in a section or a STRUCT; a bad member is left out, with a problem."""
    members: list[ast.MemberSpec] = []
    for member in element.each("Member"):
        with collect_problems(problems):
            spec = _type(member.require("Datatype"), member, depth, problems, copies)
            members.append(ast.MemberSpec(member.require("Name"), spec, member.where))
    return members


def _type(text: str, member: Element, depth: int, problems: list[Problem], copies: Copies) -> ast.Spec:
    """Return the type that ST text names; the members of a STRUCT in it are child elements."""
    # An ARRAY OF STRUCT is read with INT as its element, then `_wrap` puts the STRUCT there.
    is_struct = re.search(r"(?i)(?<![\w\"])struct\s*$", text)
    spec = read_spec(text[: is_struct.start()] + "INT" if is_struct else text, member.where, first_line=0)
    if is_struct:
        return _wrap(
            spec, ast.StructSpec(tuple(_members(member, next_depth(depth, member), problems, copies)))
        )
    named = next(references(spec), None)
    own = member.find("Sections")
    if own is not None and named is not None and named.name.upper() not in ELEMENTARY:
        _keep_copy(named.name, own, next_depth(depth, member), copies)
    return spec


def _keep_copy(name: str, own: Element, depth: int, copies: Copies) -> None:
    """Add to `copies` the type that a member contains as a copy."""
    problems: list[Problem] = []
    members: list[ast.MemberSpec] = []
    kinds = set()
    for section in own.each("Section"):
        kind = section.get("Name")
        found = [] if kind in UNSTORED_SECTIONS else _members(section, depth, problems, copies)
        members += map(_instance_member, found) if kind == "InOut" else found
        kinds |= {kind} if found else set()
    if members or problems:
        is_instance = name.casefold() in BUILTIN_TYPES or not kinds <= {"", "None"}
        notes = (INSTANCE_NOTE,) if is_instance else ()
        spec = ast.StructSpec(tuple(members))
        copies.append(ast.Declaration(name, spec, own.where, tuple(problems), notes))


def _instance_member(member: ast.MemberSpec) -> ast.MemberSpec:
    """Return an in-out parameter of an instance: a value if elementary, not DT or DTL, else a pointer."""
    row = ELEMENTARY.get(member.spec.name.upper()) if isinstance(member.spec, ast.TypeName) else None
    is_value = row is not None and row.name not in ("DT", "DTL")
    return member if is_value else member._replace(spec=RawType(member.name, BY_POINTER_NOTE))


def _wrap(spec: ast.Spec, struct: ast.StructSpec) -> ast.Spec:
    return spec._replace(element=_wrap(spec.element, struct)) if isinstance(spec, ast.ArraySpec) else struct
