"""What a user hands to `trcvtui udt`: the arguments, and hex or JSON as an argument, a file or stdin.

Rule: every mistake is one line with its place; what is no text, or too large, is refused.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Sequence
from typing import Any, Final

from trcvtui.errors import mistake

BYTES: Final = "HEX|@FILE|-"


def add_udt(parser: Any, given: Sequence[str]) -> dict[str, Any]:
    """Add the commands to the parser of `udt`; return theirs by name.

    Where the first word that was given is a command, it is that one alone: each takes a millisecond.
    """
    commands = parser.add_subparsers(metavar="WHAT", required=True)
    made: dict[str, Any] = {}
    for name in [word for word in given[:1] if word in COMMANDS] or COMMANDS:
        about, add = COMMANDS[name]
        made[name] = commands.add_parser(name, help=about)
        add(made[name])
    return made


def _show(show: Any) -> None:
    _add_type(show, ("text", "json"))


def _decode(decode: Any) -> None:
    _add_type(decode, ("text", "json", "md", "csv"))
    decode.add_argument("hex", metavar=BYTES, nargs="+", help="hex, a file of hex, or stdin")


def _encode(encode: Any) -> None:
    from trcvtui.udt.byte_text import BYTE_FORMS

    _add_type(encode, tuple(BYTE_FORMS))
    encode.add_argument("values", metavar="VALUES.json|-", help="an object of path: value")


def _export(export: Any) -> None:
    _add_type(export)
    from trcvtui.udt.exports import LANGUAGES

    help_ = ", ".join(f"{name}: {title} (.{name})" for name, title in LANGUAGES.items())
    export.add_argument("--to", metavar="|".join(LANGUAGES), required=True, help=help_)
    export.add_argument("--port", type=int, help="the TCP port; default: by Decode As")
    export.add_argument("--out", metavar="FILE", help="write here instead of stdout")


def _compare(compare: Any) -> None:
    _add_type(compare, ("text", "json"), twice=True)
    more = compare.add_argument("hex", metavar=BYTES, nargs="+", default=[], help="compare values, too")
    more.required = False  # with "*" argparse takes none, as soon as an option stands before them


def _fit(fit: Any) -> None:
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


def _cure(cure: Any) -> None:
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


COMMANDS: Final[dict[str, tuple[str, Callable[[Any], None]]]] = {
    "show": ("members with offset, size, type; padding", _show),
    "decode": ("bytes to values, as far as they go", _decode),
    "encode": ("values to bytes, as hex on stdout", _encode),
    "export": ("the type for Wireshark", _export),
    "compare": ("two layouts side by side; exit 1 where they differ", _compare),
    "fit": ("which layout, byte order or other cause fits the bytes; exit 1: not sure", _fit),
    "cure": ("the type or the swap code that cures a mismatch", _cure),
}


def _add_type(parser: Any, formats: Sequence[str] = (), twice: bool = False) -> None:
    parser.add_argument("file", metavar="FILE", help="the file that declares the type")
    one: dict[str, Any] = {"action": "append", "default": []} if twice else {}
    layout = "default: baosky, of a Siemens source s7-standard"
    if twice:
        layout += "; twice: ours, then theirs; so with --type and each option down to --string-even"
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


def last_words() -> str:
    """Return what stands below the help of each command: the formats of files, and the layouts."""
    from trcvtui.udt.layout.rules import layout_names
    from trcvtui.udt.sources import formats_text

    return f"layouts: {', '.join(layout_names())}; files: {formats_text()}"


# -- hex and JSON ------------------------------------------------------------------------------------------

STDIN: Final = "-"
LARGEST: Final = 16 * 1024 * 1024  # bytes of a file or of stdin; a job has 65535
EXPECTED_JSON: Final = 'a JSON object such as {"speed": 12.5}'


def given_bytes(given: str) -> bytes:
    """Return the bytes of hex text: the argument itself, the content of `@FILE`, or stdin for `-`."""
    from trcvtui.udt.byte_text import parse_hex

    name = _file_of(given)
    return parse_hex(given, "HEX") if name is None else parse_hex(_text(name), _where(name))


def given_messages(given: str) -> list[bytes]:
    """Return the bytes as messages: a file, and stdin, may have several, with an empty line between them."""
    from trcvtui.udt.byte_text import parse_hex

    name = _file_of(given)
    if name is None:
        where, messages = "HEX", [parse_hex(given, "HEX")]
    else:
        where, text = _where(name), _text(name)
        parse_hex(text, where)  # so that a mistake is told with its line in the file
        messages = [parse_hex(part) for part in re.split(r"\n[ \t\r]*\n", text)]
    found = [message for message in messages if message]
    if not found:
        raise mistake(where, "no bytes", "a message")
    return found


def given_values(name: str) -> dict[str, object]:
    """Return the JSON object that stands in a file, or on stdin for `-`."""
    import json

    where, text = _where(name), _text(name)
    try:
        values = json.loads(text, parse_float=_number, object_pairs_hook=_each_once)
    except _Refused as refused:
        raise mistake(where, refused.found, refused.expected) from None
    except json.JSONDecodeError as wrong:
        place = f"{where}, line {wrong.lineno}, column {wrong.colno}"
        raise mistake(place, f"no JSON ({wrong.msg})", EXPECTED_JSON) from None
    except ValueError:  # Python reads no number of more than 4300 digits
        raise mistake(where, "a number of too many digits", EXPECTED_JSON) from None
    except RecursionError:
        raise mistake(where, "brackets nested too deeply", EXPECTED_JSON) from None
    if not isinstance(values, dict):
        raise mistake(where, f"JSON, but {_KINDS.get(type(values), 'a number')}", EXPECTED_JSON)
    return values


class _Refused(Exception):
    """JSON that Python takes and changes without a word."""

    def __init__(self, found: str, expected: str) -> None:
        super().__init__(found)
        self.found, self.expected = found, expected


def _number(text: str) -> float:
    number = float(text)
    if math.isinf(number):
        raise _Refused(text[:40], 'a number in the range of LREAL, or "Infinity"')
    return number


def _each_once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    values: dict[str, object] = {}
    for key, value in pairs:
        if key in values:
            raise _Refused(f"'{key[:60]}' a second time", "each path once")
        values[key] = value
    return values


_KINDS: Final = {list: "a list", str: "a text", bool: "true or false", type(None): "null"}


def _file_of(given: str) -> str | None:
    """Return the file of `@FILE`, `-` for stdin; None where the argument itself is the hex."""
    return given.removeprefix("@") if given == STDIN or given.startswith("@") else None


def _where(name: str) -> str:
    return "stdin" if name == STDIN else name


def _text(name: str) -> str:
    from trcvtui.files import reason_of

    try:
        data = _content(name)
    except (OSError, ValueError) as failed:
        raise mistake(_where(name), reason_of(failed), "text that can be read") from None
    if len(data) > LARGEST:
        raise mistake(_where(name), "more than that", f"at most {LARGEST} bytes")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as wrong:
        found = f"binary data (byte {wrong.start} is 16#{data[wrong.start]:02X})"
        raise mistake(_where(name), found, "text; `xxd -p` makes hex text of a binary file") from None


def _content(name: str) -> bytes:
    if name == STDIN:
        stdin = getattr(sys.stdin, "buffer", None)  # None when the shell has closed it
        if stdin is None:
            raise OSError("nothing, it is closed")
        return bytes(stdin.read(LARGEST + 1))
    from trcvtui.files import read_bytes

    return read_bytes(name, LARGEST)
