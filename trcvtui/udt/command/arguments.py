"""The arguments of `trcvtui udt`: show, decode, encode, export, compare, fit, cure (docs/udt.md)."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import Any, Final, TypeVar

BYTES: Final = "HEX|@FILE|-"

AnyParser = TypeVar("AnyParser", bound=argparse.ArgumentParser)


def add_udt(parser: AnyParser, given: Sequence[str]) -> dict[str, AnyParser]:
    """Add the commands to the parser of `udt`; return theirs by name.

    Where the first word that was given is a command, it is that one alone: each takes a millisecond.
    """
    commands = parser.add_subparsers(metavar="WHAT", required=True, parser_class=type(parser))
    made: dict[str, AnyParser] = {}
    for name in [word for word in given[:1] if word in COMMANDS] or COMMANDS:
        about, add = COMMANDS[name]
        made[name] = commands.add_parser(name, help=about)
        add(made[name])
    return made


def _show(show: argparse.ArgumentParser) -> None:
    _add_type(show, ("text", "json"))


def _decode(decode: argparse.ArgumentParser) -> None:
    _add_type(decode, ("text", "json", "md", "csv"))
    decode.add_argument("hex", metavar=BYTES, nargs="+", help="hex, a file of hex, or stdin")


def _encode(encode: argparse.ArgumentParser) -> None:
    _add_type(encode, ("hex", "iec", "st", "c", "python", "base64"))
    encode.add_argument("values", metavar="VALUES.json|-", help="an object of path: value")


def _export(export: argparse.ArgumentParser) -> None:
    _add_type(export)
    export.add_argument("--to", metavar="lua|ksy|imhex", required=True)
    export.add_argument("--port", type=int, help="lua: the TCP port; default: by Decode As")
    export.add_argument("--out", metavar="FILE", help="write here instead of stdout")


def _compare(compare: argparse.ArgumentParser) -> None:
    _add_type(compare, ("text", "json"), twice=True)
    more = compare.add_argument("hex", metavar=BYTES, nargs="+", default=[], help="compare values, too")
    more.required = False  # with "*" argparse takes none, as soon as an option stands before them


def _fit(fit: argparse.ArgumentParser) -> None:
    _add_type(fit, ("text", "json"))
    fit.description = (
        "Ranks layouts, byte orders and other causes (a header of 1 to 8 bytes, bytes after a message, "
        "exchanged words or bytes, one byte short or long) by the bytes that came. Exit 0 where one fits "
        "best, 1 where that is not sure. The layout options say what our own side uses: it is named first "
        "where several mean the same."
    )
    fit.add_argument(
        "hex",
        metavar=BYTES,
        nargs="+",
        help="one message, or several of one size in a row; in a file an empty line stands between messages",
    )


def _cure(cure: argparse.ArgumentParser) -> None:
    _add_type(cure, twice=True)
    cure.description = (
        "Prints the type for our side that lies as theirs does, and swap code for the sender where the byte "
        "orders differ. A layout option given once is theirs, given twice ours and theirs."
    )
    cure.add_argument(
        "--as",
        dest="form",
        choices=("scl", "st", "padded"),
        required=True,
        help="all of it in SCL or ST; padded: the type with its gaps as members alone, as our side writes it",
    )


COMMANDS: Final[dict[str, tuple[str, Callable[[argparse.ArgumentParser], None]]]] = {
    "show": ("members with offset, size, type; padding", _show),
    "decode": ("bytes to values, as far as they go", _decode),
    "encode": ("values to bytes, as hex on stdout", _encode),
    "export": ("the type for Wireshark, Kaitai or ImHex", _export),
    "compare": ("two layouts side by side; exit 1 where they differ", _compare),
    "fit": ("which layout, byte order or other cause fits the bytes; exit 1: not sure", _fit),
    "cure": ("the type or the swap code that cures a mismatch", _cure),
}


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
