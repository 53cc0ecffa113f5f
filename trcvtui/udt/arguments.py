"""The arguments of `trcvtui udt`: show, decode, encode, export, compare (contract 4.1, docs/udt.md)."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, Final, TypeVar

BYTES: Final = "HEX|@FILE|-"

AnyParser = TypeVar("AnyParser", bound=argparse.ArgumentParser)


def add_udt(parser: AnyParser) -> dict[str, AnyParser]:
    """Add the commands to the parser of `udt`; return theirs by name."""
    commands = parser.add_subparsers(metavar="WHAT", required=True, parser_class=type(parser))
    show = commands.add_parser("show", help="members with offset, size, type; padding")
    _add_type(show, ("text", "json"))
    decode = commands.add_parser("decode", help="bytes to values, as far as they go")
    _add_type(decode, ("text", "json", "md", "csv"))
    decode.add_argument("hex", metavar=BYTES, nargs="+", help="hex, a file of hex, or stdin")
    encode = commands.add_parser("encode", help="values to bytes, as hex on stdout")
    _add_type(encode, ("hex", "iec", "st", "c", "python", "base64"))
    encode.add_argument("values", metavar="VALUES.json|-", help="an object of path: value")
    export = commands.add_parser("export", help="the type for Wireshark, Kaitai or ImHex")
    _add_type(export)
    export.add_argument("--to", metavar="lua|ksy|imhex", required=True)
    export.add_argument("--port", type=int, help="lua: the TCP port; default: by Decode As")
    export.add_argument("--out", metavar="FILE", help="write here instead of stdout")
    compare = commands.add_parser("compare", help="two layouts side by side; exit 1 where they differ")
    _add_type(compare, ("text", "json"), twice=True)
    more = compare.add_argument("hex", metavar=BYTES, nargs="+", default=[], help="compare values, too")
    more.required = False  # with "*" argparse takes none, as soon as an option stands before them
    return {"show": show, "decode": decode, "encode": encode, "export": export, "compare": compare}


def _add_type(parser: argparse.ArgumentParser, formats: Sequence[str] = (), twice: bool = False) -> None:
    parser.add_argument("file", metavar="FILE", help="the file that declares the type")
    one: dict[str, Any] = {"action": "append", "default": []} if twice else {}
    layout = "default: baosky, of a Siemens source s7-standard"
    if twice:
        layout += "; twice: ours and theirs, as of --type and of every option down to --string-even"
    parser.add_argument("--type", metavar="NAME", help="may be left out when the file holds one type", **one)
    parser.add_argument("--layout", metavar="NAME", help=layout, **one)
    parser.add_argument("--byte-order", metavar="little|big", help="default: that of the layout", **one)
    parser.add_argument("--text", metavar="FORM", help="of STRING: s7, cstr or nul; default as above", **one)
    parser.add_argument("--pointer-size", metavar="4|8", help="bytes of a pointer; default: 8", **one)
    parser.add_argument(
        "--string-even", metavar="yes|no", help="whether a STRING of odd size takes one byte more", **one
    )
    parser.add_argument(
        "--constant", metavar="NAME=VALUE", action="append", default=[], help="such as GVL.MAX=10"
    )
    parser.add_argument(
        "--with",
        metavar="FILE",
        dest="others",
        action="append",
        default=[],
        help="a file of types and constants that FILE uses; repeatable",
    )
    if formats:
        parser.add_argument("--format", choices=formats, default=formats[0], help=f"default: {formats[0]}")
