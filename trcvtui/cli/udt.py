"""Commands of `trcvtui udt`: a type, its layout, its bytes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from trcvtui.cli.options import (
    FAILED,
    GOOD,
    WRONG_INPUT,
    Args,
    CommandParser,
    add_commands,
    add_format,
    find_file,
    print_text,
)

BYTES = "HEX|@FILE|-"


def set_up_udt(parser: CommandParser) -> None:
    parser.description = "Shows and exports a type, its layouts and its bytes; finds and mends a mismatch."
    add_commands(parser, COMMANDS, required=True)


def _add_type(parser: CommandParser, formats: Sequence[str] = (), twice: bool = False) -> None:
    _add_files(parser)
    one: dict[str, Any] = {"action": "append", "default": []} if twice else {}
    layout = "layout of the type; default: baosky, for Siemens sources s7-standard"
    if twice:
        layout += (
            "; twice: ours, then theirs; same for --type, --byte-order, --text, --pointer-size, --string-even"
        )
    parser.add_argument("--type", metavar="NAME", help="name of the type, if FILE has several", **one)
    parser.add_argument("--layout", metavar="NAME", help=layout, **one)
    parser.add_argument("--byte-order", metavar="little|big", help="default: that of the layout", **one)
    parser.add_argument(
        "--text", metavar="FORM", help="form of STRING: s7, cstr or nul; default: that of the layout", **one
    )
    parser.add_argument("--pointer-size", metavar="4|8", help="bytes of a pointer; default: 8", **one)
    about = "yes: a STRING of odd size takes one byte more"
    parser.add_argument("--string-even", metavar="yes|no", help=about, **one)
    if formats:
        add_format(parser, *formats)


def _add_files(parser: CommandParser) -> None:
    parser.make_epilog = _list_formats
    about = "file that declares the type, a folder of such files, or - for stdin"
    parser.add_argument("file", metavar="FILE", type=find_file, help=about)
    many: dict[str, Any] = {"action": "append", "default": []}
    about = "constant that the type uses, such as GVL.MAX=10; repeatable"
    parser.add_argument("--constant", metavar="NAME=VALUE", help=about, **many)
    about = "file or folder with types and constants that FILE uses; repeatable"
    parser.add_argument("--with", metavar="FILE", dest="others", type=find_file, help=about, **many)
    about = "bytes of a C long; needed if the type has a long"
    parser.add_argument("--long-size", type=int, choices=(4, 8), help=about)


def _list_formats() -> str:
    from trcvtui.udt.layout.rules import layout_names
    from trcvtui.udt.sources import formats_text

    return f"layouts: {', '.join(layout_names())}; files: {formats_text()}"


def _printer(answer: str, bad: int = FAILED) -> Callable[[Args], int]:
    """Return a command that prints the result of `udt.command.ANSWER`: a text, None or (text, is good)."""

    def run(args: Args) -> int:
        from trcvtui.udt import command

        found = getattr(command, answer)(args)
        text, is_good = found if isinstance(found, tuple) else (found, True)
        if text is not None:  # None: it was written to --out
            print_text(text)
        return GOOD if is_good else bad

    return run


def _add_shown_type(parser: CommandParser) -> None:
    _add_type(parser, ("text", "json"))


def _add_decode(parser: CommandParser) -> None:
    _add_type(parser, ("text", "json", "md", "csv"))
    parser.add_argument("hex", metavar=BYTES, nargs="+", help="bytes in hex, a file with them, or stdin")


def _add_encode(parser: CommandParser) -> None:
    from trcvtui.udt.byte_text import BYTE_FORMS

    _add_type(parser, tuple(BYTE_FORMS))
    about = "JSON object in a file or on stdin: the value of each member by its path"
    parser.add_argument("values", metavar="VALUES.json|-", type=find_file, help=about)


def _add_export(parser: CommandParser) -> None:
    from trcvtui.udt.exports import LANGUAGES

    _add_type(parser)
    about = ", ".join(f"{name}: {title} (.{name})" for name, title in LANGUAGES.items())
    parser.add_argument("--to", metavar="|".join(LANGUAGES), required=True, help=about)
    parser.add_argument("--port", type=int, help="TCP port of the dissector; without it use Decode As")
    parser.add_argument("--out", metavar="FILE", help="write to this file, not to stdout")


def _add_compare(parser: CommandParser) -> None:
    _add_type(parser, ("text", "json"), twice=True)
    more = parser.add_argument(
        "hex", metavar=BYTES, nargs="+", default=[], help="compare also the values in these bytes"
    )
    more.required = False  # with "*" argparse takes none once an option comes before them


def _add_fit(parser: CommandParser) -> None:
    _add_shown_type(parser)
    parser.description = (
        "Ranks layouts, byte orders and other causes (a header of 1 to 64 bytes, bytes after a message, "
        "exchanged words or bytes, one byte short or long) by the bytes that arrived. Exit 0: one fits best, "
        "1: not sure. The layout options name the layout of your side: of equal results it is the first."
    )
    about = "one message, or several of one size in a row; in a file an empty line separates messages"
    parser.add_argument("hex", metavar=BYTES, nargs="+", help=about)


def _add_cure(parser: CommandParser) -> None:
    _add_type(parser, twice=True)
    parser.description = (
        "Prints the type for your side that has the layout of the partner, and swap code for the sender if "
        "the byte orders differ. Give a layout option once (the partner's), or twice (yours, then theirs)."
    )
    forms = ("scl", "st", "padded")
    about = "scl, st: type and swap code; padded: only the type, with gaps as members"
    parser.add_argument("--as", dest="form", choices=forms, required=True, help=about)


def _cure(args: Args) -> int:
    from trcvtui.tui.lab.lab_fix import format_cures
    from trcvtui.udt import command

    return print_text(format_cures(*command.choose_cure_sides(args), args.form).rstrip("\n"))


COMMANDS = {
    "types": ("list all types of a file", _add_shown_type, _printer("list_types", bad=WRONG_INPUT)),
    "show": ("show offset, size and type of each member, and padding", _add_shown_type, _printer("show")),
    "decode": ("turn bytes into values, also if bytes are missing", _add_decode, _printer("decode")),
    "encode": ("turn values into bytes, as hex on stdout", _add_encode, _printer("encode")),
    "export": ("write a dissector of the type for Wireshark", _add_export, _printer("export")),
    "compare": ("show two layouts side by side; exit 1: they differ", _add_compare, _printer("compare")),
    "fit": (
        "find the layout, byte order or other cause that fits the bytes; exit 1: not sure",
        _add_fit,
        _printer("fit"),
    ),
    "cure": ("print the type or the swap code that cures a mismatch", _add_cure, _cure),
}
