"""XML as a tree with line numbers: no entities, bounded depth and size, names without namespace.

Rule: a document type definition is refused, so nothing is fetched or expanded (XXE, billion laughs).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from xml.parsers import expat

from trcvtui.errors import UserError, mistake
from trcvtui.udt.ast import MOST_NESTED

MOST_DEPTH = 200  # levels of elements
MOST_ELEMENTS = 400_000  # bounds the memory for a hostile file

# The encodings of XML exports; other codecs of Python are slow or not character sets.
_CODEC = re.compile(
    r"utf-?(8|16|32)([-_]?[bl]e)?|us-ascii|ascii|iso-?8859-\d{1,2}|latin-?\d{1,2}|windows-\d{3,5}|cp\d{3,5}"
    r"|gb2312|gbk|gb18030|big5|shift_jis|euc-(jp|kr)|koi8-[ru]",
    re.IGNORECASE,
)
_DECLARED_ENCODING = re.compile(rb"""<\?xml\b[^>]{0,200}?\bencoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")
_UTF16_STARTS = ((b"<\0?\0", "utf-16-le"), (b"\0<\0?", "utf-16-be"))


class Element:
    """One element: its name without namespace, attributes, children, text, and the place where it begins."""

    __slots__ = ("attributes", "children", "name", "pieces", "place", "source", "text_line")

    def __init__(self, name: str, attributes: dict[str, str], source: str, place: tuple[int, int]) -> None:
        self.name, self.attributes, self.source, self.place = name, attributes, source, place
        self.children: list[Element] = []
        self.pieces: list[str] = []
        self.text_line = place[0]

    @property
    def where(self) -> str:
        """Return file, line and column of the element, both from 1."""
        return f"{self.source}:{self.place[0]}:{self.place[1]}"

    @property
    def text(self) -> str:
        return "".join(self.pieces)

    def get(self, attribute: str) -> str:
        return self.attributes.get(attribute, "")

    def require(self, attribute: str) -> str:
        """Return an attribute without surrounding blanks; raise UserError if it is missing or empty."""
        value = self.get(attribute).strip()
        if not value:
            raise mistake(self.where, f"<{self.name}> without {attribute}", f'{attribute}="..."')
        return value

    def each(self, *names: str) -> Iterator[Element]:
        return (child for child in self.children if child.name in names)

    def find(self, *path: str) -> Element | None:
        """Follow a path of names, each time to the first child of the name; return the element or None."""
        found: Element | None = self
        for name in path:
            found = next(found.each(name), None) if found is not None else None
        return found

    def search(self, *names: str) -> Iterator[Element]:
        """Yield elements with these names in file order, at any depth, but none inside a found element."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            if element.name in names:
                yield element
            else:
                waiting.extend(reversed(element.children))


def xml_codec(data: bytes) -> str | None:
    """Return the encoding of XML without a byte order mark, or None if it is undeclared or not accepted."""
    for begin, codec in _UTF16_STARTS:
        if data.startswith(begin):
            return codec
    declared = _DECLARED_ENCODING.match(data[:400].lstrip())
    name = declared.group(1).decode("ascii") if declared else ""
    # Bytes that begin with a readable `<?xml` cannot be UTF-16 or UTF-32, whatever they declare.
    is_wide = name.lower().startswith(("utf-1", "utf1", "utf-3"))
    return name if _CODEC.fullmatch(name) and not is_wide else None


def read_xml(text: str, name: str) -> Element:
    """Return the root element of a text; raise UserError."""
    builder = _TreeBuilder(name)
    try:
        # The text is decoded already: its declared encoding no longer applies.
        builder.parser.Parse(text.encode("utf-8", "replace"), True)
    except expat.ExpatError as failed:
        found = expat.ErrorString(failed.code) or "no XML"
        raise mistake(f"{name}:{failed.lineno}:{failed.offset + 1}", found, "well-formed XML") from None
    return builder.root


class _TreeBuilder:
    root: Element

    def __init__(self, source: str) -> None:
        self.source = source
        self.path: list[Element] = []
        self.count = 0
        self.parser = parser = expat.ParserCreate("utf-8")
        parser.buffer_text = False  # else the place of a text would be its end
        parser.StartElementHandler = self.start
        parser.EndElementHandler = self.end
        parser.CharacterDataHandler = self.add_text
        parser.StartDoctypeDeclHandler = self.refuse_doctype

    def place(self) -> tuple[int, int]:
        return self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1

    def refusal(self, found: str, expected: str) -> UserError:
        line, column = self.place()
        return mistake(f"{self.source}:{line}:{column}", found, expected)

    def start(self, name: str, attributes: dict[str, str]) -> None:
        self.count += 1
        if len(self.path) >= MOST_DEPTH:
            raise self.refusal(f"<{name[:40]}> {MOST_DEPTH} elements deep", f"at most {MOST_DEPTH} levels")
        if self.count > MOST_ELEMENTS:
            raise self.refusal("more elements", f"at most {MOST_ELEMENTS} in a file")
        element = Element(name.rpartition(":")[2], attributes, self.source, self.place())
        if self.path:
            self.path[-1].children.append(element)
        else:
            self.root = element
        self.path.append(element)

    def end(self, _name: str) -> None:
        self.path.pop()

    def add_text(self, text: str) -> None:
        element = self.path[-1]
        if not element.pieces:
            element.text_line = self.parser.CurrentLineNumber
        element.pieces.append(text)

    def refuse_doctype(self, name: str, system: str | None, public: str | None, declares: int) -> None:
        # With an external DTD the parser silently drops entities that it does not know.
        if declares or system or public:
            raise self.refusal(f"<!DOCTYPE {name[:40]} ...>", "XML without a DTD or entity declarations")


def next_depth(depth: int, element: Element) -> int:
    """Return the depth inside an element; raise UserError if it is more than `MOST_NESTED`."""
    if depth >= MOST_NESTED:
        expected = f"at most {MOST_NESTED} levels of STRUCT and ARRAY"
        raise mistake(element.where, "a type nested deeper", expected)
    return depth + 1
