"""CODESYS 2.3 and TwinCAT 2 `.exp`: ST text whose headers are comments, between objects of other kinds."""

from __future__ import annotations

import re

from trcvtui.udt.ast import Declarations
from trcvtui.udt.sources.st import read_st
from trcvtui.udt.sources.st_cursor import Dialect

CODESYS_2 = Dialect(has_objects=True)

_NESTED = r"\(\* @NESTEDCOMMENTS := '(Yes|No)' \*\)"


def read_exp(text: str, name: str) -> Declarations:
    """Return what an export declares; its own headers say whether comments nest."""
    said = re.findall(_NESTED, text)
    nests = "No" not in said or "Yes" in said
    return read_st(text, name, dialect=CODESYS_2._replace(nests_comments=nests))
