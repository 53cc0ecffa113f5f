"""PLCopen TC6 XML with the CODESYS additions, and TwinCAT files. Both contain the ST text of types.

`dataType/baseType/...` is read by local names in every version of the schema. A `dataType` is read at any
place: CODESYS writes some into `addData` of a resource. If a type has ST text, that text is read instead.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from trcvtui.errors import Problem, collect_problems, mistake
from trcvtui.udt import ast
from trcvtui.udt.constants import evaluate
from trcvtui.udt.literals import parse_integer
from trcvtui.udt.sources.st import read_spec, read_st
from trcvtui.udt.sources.xml_source import Element, next_depth
from trcvtui.udt.types import Pointer

OBJECT_ELEMENTS = ("DUT", "GVL")


def read_twincat(root: Element) -> ast.Declarations:
    """Return the type of a DUT, or the constants of a GVL; raise UserError for any other object."""
    object_ = next(root.each(*OBJECT_ELEMENTS), None)
    if object_ is None:
        kinds = ", ".join(f"<{child.name}>" for child in root.children[:3]) or "nothing"
        raise mistake(root.where, f"{kinds} in it", "a <DUT> or a <GVL>")
    text = object_.find("Declaration")
    if text is None or not text.text.strip():
        raise mistake(object_.where, f"<{object_.name}> without text", "<Declaration> with ST text")
    read = read_element_text(text)
    if object_.name == "GVL":
        return qualify_constants(read, object_.get("Name"))
    if not read.types and not read.problems:
        return read._replace(problems=(Problem(text.where, "no type", "TYPE ... END_TYPE"),))
    return read._replace(types=tuple(note_other_name(type_, object_.get("Name")) for type_ in read.types))


def read_element_text(text: Element) -> ast.Declarations:
    """Return what the ST text in an element declares, with places in the file."""
    return read_st(text.text, text.source, text.text_line)


def note_other_name(declaration: ast.Declaration, name: str) -> ast.Declaration:
    """Return the declaration; add a note if the XML gives the type another name."""
    if not name or name.casefold() == declaration.name.casefold():
        return declaration
    note = f"the XML calls it '{name}', the declaration '{declaration.name}'"
    return declaration._replace(notes=(*declaration.notes, note))


def qualify_constants(read: ast.Declarations, list_: str) -> ast.Declarations:
    """Add each constant also as `GVL.NAME`, because bounds may use that name."""
    if not list_:
        return read
    both = tuple(constant._replace(name=f"{list_}.{constant.name}") for constant in read.constants)
    return read._replace(constants=(*read.constants, *both))


# -- PLCopen -------------------------------------------------------------------------------------------------

NON_TYPE_ELEMENTS = ("documentation", "addData")


def read_plcopen(root: Element) -> ast.Declarations:
    """Return all data types of a project, and the constants of its global variables."""
    types: list[ast.Declaration] = []
    problems: list[Problem] = []
    for element in root.search("dataType", "union"):
        # A UNION without a name is the type of a variable.
        if element.name == "union" and not element.get("name"):
            continue
        with collect_problems(problems):
            types.extend(_declarations(element))
    if not types and not problems:
        problems.append(Problem(root.where, "no data type", "<dataType> in a PLCopen project"))
    constants = [constant for list_ in root.search("globalVars") for constant in _constants(list_).constants]
    return ast.Declarations(tuple(types), tuple(problems), tuple(constants))


def _declarations(element: Element) -> Iterator[ast.Declaration]:
    name = element.require("name")
    plain = _st_text_element(element)
    if plain is not None:
        read = read_element_text(plain)
        if read.types or read.problems:
            yield from (note_other_name(type_, name) for type_ in read.types)
            if read.problems:
                yield ast.Declaration(name, None, plain.where, read.problems)
            return
    walk = _TypeReader()
    spec: ast.Spec | None = None
    with collect_problems(walk.problems):
        spec = walk.struct(element, 0) if element.name == "union" else walk.base(element, 0)
        if isinstance(spec, ast.StructSpec):
            spec = spec._replace(base=_read_extends(element), pack=_read_pack(element))
    yield ast.Declaration(name, spec, element.where, tuple(walk.problems))


def _vendor_parts(element: Element, kind: str) -> Iterator[Element]:
    """Yield what the vendor added under `.../plcopenxml/kind`."""
    added = element.find("addData")
    for data in added.each("data") if added else ():
        if data.get("name").rpartition("/")[2].lower() == kind:
            yield from data.children


def _st_text_element(element: Element) -> Element | None:
    """Return the element with the ST text of a type, None without ST text."""
    for plain in _vendor_parts(element, "interfaceasplaintext"):
        text = plain.find("xhtml") or plain
        if text.text.strip():
            return text
    return None


def _read_extends(element: Element) -> ast.TypeName | None:
    for inheritance in _vendor_parts(element, "datatypeinheritance"):
        base = inheritance.find("Extends")
        if base is not None and base.text.strip():
            return ast.TypeName(base.text.strip(), base.where)
    return None


def _read_pack(element: Element) -> int | None:
    for attributes in _vendor_parts(element, "attributes"):
        for attribute in attributes.each("Attribute"):
            if attribute.get("Name").lower() == "pack_mode":
                pack = parse_integer(attribute.get("Value"))
                if pack not in ast.PACK_MODES:
                    raise mistake(attribute.where, f"pack_mode '{attribute.get('Value')}'", "0, 1, 2, 4 or 8")
                return pack
    return None


def _constants(list_: Element) -> ast.Declarations:
    plain = _st_text_element(list_)
    if plain is not None:
        return qualify_constants(read_element_text(plain), list_.get("name"))
    found: list[ast.Constant] = []
    for variable in list_.each("variable") if list_.get("constant").strip() in ("true", "1") else ():
        value = variable.find("initialValue", "simpleValue")
        whole = parse_integer(value.get("value")) if value else None
        if whole is not None and variable.get("name"):
            found.append(ast.Constant(variable.get("name"), whole, variable.where))
    return qualify_constants(ast.Declarations((), (), tuple(found)), list_.get("name"))


class _TypeReader:
    """Reads one type, and collects the problems in it."""

    def __init__(self) -> None:
        self.problems: list[Problem] = []

    def base(self, element: Element, depth: int) -> ast.Spec:
        inner = element.find("baseType")
        if inner is None:
            raise mistake(element.where, f"<{element.name}> without a type", "<baseType>")
        return self.type(inner, depth)

    def type(self, element: Element, depth: int) -> ast.Spec:
        inner = _find_type_element(element)
        if inner is None:
            raise mistake(element.where, f"<{element.name}> with nothing in it", "a type")
        depth = next_depth(depth, inner)
        return SPECS[inner.name](self, inner, depth) if inner.name in SPECS else _reference(inner)

    def struct(self, element: Element, depth: int) -> ast.Spec:
        members: list[ast.MemberSpec] = []
        for variable in element.each("variable"):
            with collect_problems(self.problems):
                name, type_ = variable.require("name"), variable.find("type")
                if type_ is None:
                    raise mistake(variable.where, f"member '{name}' without a type", "<type>")
                members.append(ast.MemberSpec(name, self.type(type_, depth), variable.where))
        return ast.StructSpec(tuple(members), is_union=element.name == "union")

    def array(self, element: Element, depth: int) -> ast.Spec:
        pairs = [_bounds(dimension) for dimension in element.each("dimension")]
        if not pairs:
            raise mistake(element.where, "<array> without bounds", '<dimension lower="..." upper="..."/>')
        return ast.ArraySpec(tuple(pairs), self.base(element, depth))

    def enum(self, element: Element, _depth: int) -> ast.Spec:
        list_, base = element.find("values"), _find_type_element(element.find("baseType"))
        values = [(value.require("name"), _value(value)) for value in (list_.each("value") if list_ else ())]
        if not values:
            raise mistake(element.where, "<enum> without values", '<value name="..."/>')
        return ast.EnumSpec(_reference(base) if base else None, tuple(values))

    def range(self, element: Element, _depth: int) -> ast.Spec:
        limits, base = element.find("range"), _find_type_element(element.find("baseType"))
        if limits is None or base is None:
            raise mistake(element.where, f"an incomplete <{element.name}>", "<range> and <baseType>")
        return ast.RangeSpec(_reference(base), *_bounds(limits))

    def pointer(self, element: Element, _depth: int) -> ast.Spec:
        target = _find_type_element(element.find("baseType"))
        return Pointer("POINTER TO " + (_reference(target).name if target else "?"))

    def derived(self, element: Element, _depth: int) -> ast.Spec:
        # CODESYS writes types that the schema lacks as text: `REFERENCE TO Axis`.
        return read_spec(element.require("name"), element.where, first_line=0)

    def string(self, element: Element, _depth: int) -> ast.Spec:
        length = element.get("length").strip()
        return read_spec(element.name + (f"[{length}]" if length else ""), element.where, first_line=0)


def _find_type_element(element: Element | None) -> Element | None:
    """Return the element of the type in <type> or <baseType>, None without such an element."""
    children = element.children if element else ()
    return next((child for child in children if child.name not in NON_TYPE_ELEMENTS), None)


def _bounds(element: Element) -> tuple[ast.Number, ast.Number]:
    low, high = (_number(element.require(limit), element.where) for limit in ("lower", "upper"))
    for limit in (low, high):
        evaluate(limit, lambda name: None)  # refuses what is not a formula
    if isinstance(low, int) and isinstance(high, int) and high < low:
        raise mistake(element.where, f"'{high}'", f"a number from {low} upwards")
    return low, high


def _number(text: str, where: str) -> ast.Number:
    plain = parse_integer(text)
    return ast.Formula(text, where) if plain is None else plain


def _value(value: Element) -> ast.Number | None:
    """Return the number of an enumeration value. None means one more than the value before."""
    text = value.get("value").strip()
    return _number(text, value.where) if text else None


def _reference(element: Element) -> ast.TypeName:
    """Return a type by its name: `<derived name="T"/>`, or `<INT/>`."""
    name = element.require("name") if element.name == "derived" else element.name
    return ast.TypeName(name, element.where)


SPECS: dict[str, Callable[[_TypeReader, Element, int], ast.Spec]] = {
    "struct": _TypeReader.struct,
    "union": _TypeReader.struct,
    "array": _TypeReader.array,
    "enum": _TypeReader.enum,
    "subrangeSigned": _TypeReader.range,
    "subrangeUnsigned": _TypeReader.range,
    "pointer": _TypeReader.pointer,
    "derived": _TypeReader.derived,
    "string": _TypeReader.string,
    "wstring": _TypeReader.string,
    "STRING": _TypeReader.string,
    "WSTRING": _TypeReader.string,
}
