"""Global variables as a PLC keeps them: from their declaration, and to their snapshot."""

from __future__ import annotations

from trcvtui.blocks.data_area import DataArea
from trcvtui.plc.elements import elements_of, text_lens_of
from trcvtui.plc.snapshot import DataSnapshot
from trcvtui.project.project import DataDecl


def area_of(decl: DataDecl) -> DataArea:
    """Return the bytes of a variable."""
    texts = text_lens_of(decl.type, decl.size)
    return DataArea(decl.name, decl.type_name, decl.size, elements_of(decl.type), decl.optimized, texts)


def data_snapshot(data: DataArea) -> DataSnapshot:
    """Return a variable as it stands."""
    return DataSnapshot(data.name, data.type_name, data.size, data.generation)
