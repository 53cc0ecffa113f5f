"""Siemens text sources: `.udt` and `.scl` of TIA, `.s7dcl` of SIMATIC SD."""

from __future__ import annotations

from trcvtui.errors import mistake
from trcvtui.udt.ast import Declarations
from trcvtui.udt.layout.rules import S7
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.sources.st_cursor import Dialect

TIA = Dialect(has_header=True, layout=S7.name)
SIMATIC_SD = Dialect(layout=S7.name)


def read_tia(text: str, name: str) -> Declarations:
    """Return what a TIA source declares; the blocks in it are passed over."""
    return read_st(text, name, dialect=TIA)


def read_simatic_sd(text: str, name: str) -> Declarations:
    """Return what a SIMATIC SD file declares; one with a block in it has the same suffix and no types."""
    return read_st(text, name, dialect=SIMATIC_SD)


def refuse_texts(_text: str, name: str) -> Declarations:
    """Raise the UserError of a `.s7res`: the texts that belong to a `.s7dcl`."""
    raise mistake(name, "the texts of a SIMATIC SD file", "the .s7dcl file beside it")
