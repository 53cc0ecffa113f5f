"""B&R Automation Studio: `.typ` with many types in a block, `.var` with the constants of their bounds."""

from __future__ import annotations

from trcvtui.udt.ast import Declarations
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.sources.st_cursor import Dialect

B_AND_R = Dialect(enum_base="DINT")


def read_b_and_r(text: str, name: str) -> Declarations:
    """Return what a file of types or variables declares."""
    return read_st(text, name, dialect=B_AND_R)
