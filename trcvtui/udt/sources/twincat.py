"""TwinCAT files, `.TcDUT` and `.TcGVL`: ST text in `TcPlcObject/<DUT or GVL>/Declaration`."""

from __future__ import annotations

from trcvtui.errors import Problem, mistake
from trcvtui.udt.ast import Declaration, Declarations
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.sources.xml_source import Element

OBJECTS = ("DUT", "GVL")


def read_twincat(root: Element) -> Declarations:
    """Return the type of a DUT, or the constants of a GVL; raise UserError for any other object."""
    object_ = next(root.all(*OBJECTS), None)
    if object_ is None:
        kinds = ", ".join(f"<{child.name}>" for child in root.children[:3]) or "nothing"
        raise mistake(root.where, f"{kinds} in it", "a <DUT> or a <GVL>")
    text = object_.at("Declaration")
    if text is None or not text.text.strip():
        raise mistake(object_.where, f"<{object_.name}> without text", "<Declaration> with ST text")
    read = read_inside(text)
    if object_.name == "GVL":
        return qualified(read, object_.get("Name"))
    if not read.types and not read.problems:
        return read._replace(problems=(Problem(text.where, "no type", "TYPE ... END_TYPE"),))
    return read._replace(types=tuple(named(type_, object_.get("Name")) for type_ in read.types))


def read_inside(text: Element) -> Declarations:
    """Return what the ST text in an element declares; places in it are those of the file."""
    return read_st(text.text, text.source, text.text_line)


def named(declaration: Declaration, name: str) -> Declaration:
    """Return the declaration, with a note when the XML around it has another name."""
    if not name or name.casefold() == declaration.name.casefold():
        return declaration
    note = f"the XML calls it '{name}', the declaration '{declaration.name}'"
    return declaration._replace(notes=(*declaration.notes, note))


def qualified(read: Declarations, list_: str) -> Declarations:
    """Return constants also as `GVL.NAME`, as bounds name them."""
    if not list_:
        return read
    both = tuple(constant._replace(name=f"{list_}.{constant.name}") for constant in read.constants)
    return read._replace(constants=(*read.constants, *both))
