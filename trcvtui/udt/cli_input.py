"""The input of `trcvtui udt`: hex or JSON from an argument, a file or stdin.

Rule: every mistake is one line with its place. Binary or too large input is refused.
"""

from __future__ import annotations

import math
import re
import sys
from functools import partial
from typing import Final

from trcvtui.errors import mistake
from trcvtui.files import read_bounded, reason_of
from trcvtui.udt.ast import Declarations

STDIN: Final = "-"
LARGEST_INPUT: Final = 16 * 1024 * 1024  # bytes of a file or of stdin; a job has at most 65535
EXPECTED_JSON: Final = 'a JSON object such as {"speed": 12.5}'


def read_hex_argument(given: str) -> bytes:
    """Return the bytes of hex text: the argument itself, the content of `@FILE`, or stdin for `-`."""
    from trcvtui.udt.byte_text import parse_hex

    return parse_hex(*_read_hex_text(given))


def read_messages(given: str) -> list[bytes]:
    """Return the messages in the input: in a file or on stdin an empty line separates them."""
    from trcvtui.udt.byte_text import parse_hex

    text, where = _read_hex_text(given)
    parse_hex(text, where)  # first as a whole: a mistake then has its line in the file
    messages = [text] if text == given else re.split(r"\n[ \t\r]*\n", text)
    found = [message for part in messages if (message := parse_hex(part))]
    if not found:
        raise mistake(where, "no bytes", "the bytes of a message")
    return found


def read_types(name: str) -> Declarations:
    """Return the declarations in a file, or in the text on stdin for `-`."""
    from trcvtui.udt.sources import declarations_in, declarations_of

    if name != STDIN:
        return declarations_in(name)
    if (data := _read_input(name)).strip():
        return declarations_of(data, where_of(name))
    expected = "a type: TYPE ... END_TYPE, STRUCT ... END_STRUCT or a data block"
    raise mistake(where_of(name), "nothing", expected)


def read_values(name: str) -> dict[str, object]:
    """Return the JSON object in a file, or on stdin for `-`."""
    import json

    where, text = where_of(name), _read_text(name)
    try:
        pairs = partial(_unique_members, where)
        values = json.loads(text, parse_float=partial(_parse_float, where), object_pairs_hook=pairs)
    except json.JSONDecodeError as wrong:
        place = f"{where}, line {wrong.lineno}, column {wrong.colno}"
        raise mistake(place, f"invalid JSON ({wrong.msg})", EXPECTED_JSON) from None
    except ValueError:  # Python refuses integers of more than 4300 digits
        raise mistake(where, "a number with too many digits", EXPECTED_JSON) from None
    except RecursionError:
        raise mistake(where, "brackets nested too deeply", EXPECTED_JSON) from None
    if not isinstance(values, dict):
        raise mistake(where, _JSON_KIND_NAMES.get(type(values), "a number"), EXPECTED_JSON)
    return values


# Python reads 1e999 as infinity and keeps the last of equal keys: here both are mistakes.


def _parse_float(where: str, text: str) -> float:
    number = float(text)
    if math.isinf(number):
        raise mistake(where, text[:40], 'a number in the range of LREAL, or "Infinity"')
    return number


def _unique_members(where: str, pairs: list[tuple[str, object]]) -> dict[str, object]:
    values: dict[str, object] = {}
    for key, value in pairs:
        if key in values:
            raise mistake(where, f"'{key[:60]}' a second time", "each path once")
        values[key] = value
    return values


_JSON_KIND_NAMES: Final = {list: "a list", str: "a text", bool: "true or false", type(None): "null"}


def _read_hex_text(given: str) -> tuple[str, str]:
    """Return hex text, and where it came from."""
    if given != STDIN and not given.startswith("@"):
        return given, "HEX"
    name = given.removeprefix("@")
    return _read_text(name), where_of(name)


def where_of(name: str) -> str:
    """Return the name that messages use for a file or for stdin."""
    return "stdin" if name == STDIN else name


def _read_input(name: str) -> bytes:
    try:
        data = _read_stdin() if name == STDIN else read_bounded(name, LARGEST_INPUT)
    except (OSError, ValueError) as failed:
        raise mistake(where_of(name), reason_of(failed), "text that can be read") from None
    if len(data) > LARGEST_INPUT:
        raise mistake(where_of(name), "a larger input", f"at most {LARGEST_INPUT} bytes")
    return data


def _read_text(name: str) -> str:
    data = _read_input(name)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as wrong:
        found = f"binary data (byte {wrong.start} is 16#{data[wrong.start]:02X})"
        raise mistake(where_of(name), found, "text; `xxd -p` makes hex text of a binary file") from None


def _read_stdin() -> bytes:
    stdin = getattr(sys.stdin, "buffer", None)  # None when the shell has closed it
    if stdin is None:
        raise OSError("a closed input")
    if stdin.isatty():
        sys.stderr.write("note: reading what you type or paste; Ctrl+D on an empty line ends it\n")
    return bytes(stdin.read(LARGEST_INPUT + 1))  # one more: `_read_input` refuses it
