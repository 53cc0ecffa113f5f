"""XML files by their root element: one row a format; the suffix alone does not tell them apart."""

from __future__ import annotations

from collections.abc import Callable

from trcvtui.errors import mistake
from trcvtui.udt.ast import Declarations
from trcvtui.udt.sources.openness import read_openness
from trcvtui.udt.sources.plcopen import read_plcopen
from trcvtui.udt.sources.twincat import read_twincat
from trcvtui.udt.sources.xml_source import Element, read_xml

ROOTS: dict[str, Callable[[Element], Declarations]] = {
    "Document": read_openness,
    "project": read_plcopen,
    "TcPlcObject": read_twincat,
}
EXPECTED = "<Document> (Siemens Openness), <project> (PLCopen) or <TcPlcObject> (TwinCAT)"


def read_xml_file(text: str, name: str) -> Declarations:
    """Return what an XML file declares; raise UserError when it is no XML, or of no known format."""
    root = read_xml(text, name)
    reader = ROOTS.get(root.name)
    if reader is None:
        raise mistake(root.where, f"<{root.name[:40]}>", EXPECTED)
    return reader(root)


def refuse_export(_text: str, name: str) -> Declarations:
    """Raise the UserError of a CODESYS 3 `.export`: a dump of internal objects (udt.md section 4)."""
    raise mistake(name, "a CODESYS .export", "PLCopen XML (in CODESYS: Project, Export PLCopenXML)")
