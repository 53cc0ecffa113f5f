"""In what the dialects of ST text differ, as far as the one parser has to know."""

from __future__ import annotations

from typing import NamedTuple


class Dialect(NamedTuple):
    """Plain IEC 61131-3 unless a field says otherwise."""

    # B&R: an enumeration without a base is a C enum of 4 bytes (udt.md 2.2).
    enum_base: str | None = None
    # TIA: `TYPE "n"`, lines such as VERSION : 0.1, then STRUCT; no colon behind the name.
    has_header: bool = False
    # CODESYS 2.3: between the types stand objects that are no text of IEC 61131-3.
    has_objects: bool = False
    # `(* (* *) *)`: whether a comment in a comment is one; where that does not work out, it is none.
    nests_comments: bool = True
    # The layout that a source of this dialect stands for, "" for none.
    layout: str = ""


IEC = Dialect()
