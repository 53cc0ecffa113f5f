"""Bytes as text: parses hex, writes the forms of other tools and a `hexdump -v -C`, searches bytes.

Rule: nothing is guessed. An error names the first character that is not hex, and its place.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Final

from trcvtui.errors import UserError, mistake

ROW: Final = 16
_SHOWN_CHARACTERS: Final = bytes(byte if 0x20 <= byte < 0x7F else ord(".") for byte in range(256))


def hexdump(content: bytes) -> bytes:
    """Return the dump of all bytes, each line with its line feed, and the length in the last line."""
    lines = [_hexdump_line(content[start : start + ROW], start) for start in range(0, len(content), ROW)]
    return b"".join([*lines, b"%08x\n" % len(content)]) if content else b""


def _hexdump_line(row: bytes, offset: int) -> bytes:
    left, right = row[:8].hex(" "), row[8:].hex(" ")
    return f"{offset:08x}  {left:<24} {right:<24} |".encode() + row.translate(_SHOWN_CHARACTERS) + b"|\n"


EXPECTED_HEX: Final = "hex bytes such as 01 02 0A"
_HEX_GROUP: Final = re.compile(r"[^\s,]+")
_HEX_PREFIX: Final = re.compile(r"(?:0x|16#)", re.IGNORECASE)
_NON_HEX_DIGIT: Final = re.compile(r"[^0-9a-f]", re.IGNORECASE)
_LONGEST_SHOWN: Final = 20


def parse_hex(text: str, where: str = "hex") -> bytes:
    """Return the bytes of hex text. Raise UserError with the position of the first thing that is not hex.

    A group is whole bytes, two digits each. A lone digit, as `0x1` or `1` between blanks, is one byte.
    """
    try:
        return bytes.fromhex(text)
    except ValueError:
        return b"".join(_parse_group(text, found, where) for found in _HEX_GROUP.finditer(text))


def _parse_group(text: str, group: re.Match[str], where: str) -> bytes:
    mark = _HEX_PREFIX.match(group[0])
    start = 0 if mark is None else mark.end()
    digits = group[0][start:]
    wrong = _NON_HEX_DIGIT.search(digits)
    if wrong is not None:
        place = group.start() + start + wrong.start()
        raise _make_hex_error(text, place, where, f"'{wrong[0]}'")
    if not digits or (len(digits) % 2 and len(digits) != 1):
        shown = group[0] if len(group[0]) <= _LONGEST_SHOWN else group[0][:_LONGEST_SHOWN] + "..."
        raise _make_hex_error(text, group.start(), where, f"'{shown}' with {len(digits)} digits")
    return bytes.fromhex(digits if len(digits) != 1 else "0" + digits)


def _make_hex_error(text: str, place: int, where: str, found: str) -> UserError:
    line_start = text.rfind("\n", 0, place) + 1
    column = place - line_start + 1
    if "\n" not in text.strip():
        return mistake(f"{where}, position {column}", found, EXPECTED_HEX)
    return mistake(f"{where}, line {text.count(chr(10), 0, place) + 1}, column {column}", found, EXPECTED_HEX)


# Each returns the bytes in the form of its name; `name` is the variable, if the form has one.


def hex_lines(content: bytes, name: str = "") -> str:
    return "\n".join(_format_rows(content, "{:02x}", " "))


def iec_list(content: bytes, name: str = "") -> str:
    return ",\n".join(_format_rows(content, "16#{:02X}", ", "))


def st_array(content: bytes, name: str) -> str:
    items = ",\n    ".join(_format_rows(content, "16#{:02X}", ", "))
    last = len(content) - 1
    return f"{identifier(name)} : ARRAY[0..{last}] OF BYTE := [\n    {items}\n];" if content else ""


def c_array(content: bytes, name: str) -> str:
    items = ",\n    ".join(_format_rows(content, "0x{:02X}", ", "))
    head = f"const uint8_t {identifier(name)}[{len(content)}]"
    return f"{head} = {{\n    {items}\n}};" if content else ""


def python_bytes(content: bytes, name: str) -> str:
    pieces = [content[at : at + ROW] for at in range(0, len(content), ROW)]
    written = "\n".join('    b"' + "".join(f"\\x{byte:02x}" for byte in piece) + '"' for piece in pieces)
    return f"{identifier(name)} = (\n{written}\n)" if pieces else ""


def base64_text(content: bytes, name: str = "") -> str:
    import base64  # here, since the other forms do not need it

    return base64.b64encode(content).decode("ascii")


def _format_rows(content: bytes, form: str, between: str) -> Iterator[str]:
    for at in range(0, len(content), ROW):
        yield between.join(form.format(byte) for byte in content[at : at + ROW])


def identifier(name: str) -> str:
    """Return the name as a variable name that is legal in the languages of all output forms."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII)
    return word if word and not word[0].isdigit() else f"_{word}"


# The choices of `udt encode --format`; `hex` is one line, as the contract requires.
BYTE_FORMS: Final[dict[str, Callable[[bytes, str], str]]] = {
    "hex": lambda content, name: content.hex(" "),
    "iec": iec_list,
    "st": st_array,
    "c": c_array,
    "python": python_bytes,
    "base64": base64_text,
}


# Rule: `29 00` is hex, `"abc"` a text, `=41` and `=-1.5` a number in every size that can hold it.

SEARCH_WHERE: Final = "find"
EXPECTED_SEARCH: Final = "hex such as 29 00, a text such as abc, or a number such as =41 or =1234.5"
LONGEST_PATTERN: Final = 256
_INTEGER_CODES: Final = (("INT", "h", "H"), ("DINT", "i", "I"), ("LINT", "q", "Q"))
_REAL_CODES: Final = (("REAL", "f"), ("LREAL", "d"))


@dataclass(frozen=True, slots=True)
class SearchPatterns:
    """Bytes equal to any of `patterns` are a hit. `about` describes the patterns."""

    patterns: tuple[bytes, ...]
    about: str


def parse_search(text: str) -> SearchPatterns:
    """Read a quoted text, a number after `=`, hex, or any other text as patterns; raise UserError."""
    text = text.strip()
    if text[:1] in ('"', "'"):
        found = _parse_text_search(text)
    elif text[:1] == "=":
        found = _parse_number_search(text[1:].strip())
    else:
        found = _parse_hex_search(text) or _parse_text_search(f'"{text}"')
    if not all(found.patterns):
        raise mistake(SEARCH_WHERE, "nothing", EXPECTED_SEARCH)
    if max(map(len, found.patterns)) > LONGEST_PATTERN:
        raise mistake(SEARCH_WHERE, f"{max(map(len, found.patterns))} bytes", f"at most {LONGEST_PATTERN}")
    return found


def _parse_hex_search(text: str) -> SearchPatterns | None:
    try:
        content = parse_hex(text)
    except UserError:
        return None
    return SearchPatterns((content,), f"hex {content[:16].hex(' ')}")


def _parse_text_search(text: str) -> SearchPatterns:
    inside = text[1:-1] if len(text) > 1 and text.endswith(text[0]) else text[1:]
    return SearchPatterns((inside.encode(),), f"text {len(inside.encode())} B")


def _parse_number_search(text: str) -> SearchPatterns:
    try:
        value = int(text.replace("16#", "0x"), 0)
    except ValueError:
        return _parse_real_search(text)
    found = [
        (name, struct.pack(order + (signed if value < 0 else plain), value))
        for name, signed, plain in _INTEGER_CODES
        for order in "<>"
        if _fits_bits(value, 8 * struct.calcsize(plain))
    ]
    if not found:
        raise mistake(SEARCH_WHERE, text, "a number of at most 64 bits")
    if value == 0:
        found = found[:2]  # INT alone: a DINT or LINT 0 is a hit of an INT 0 already
    return _make_patterns(found)


def _fits_bits(value: int, bits: int) -> bool:
    return bool(-(1 << bits - 1) <= value < 1 << bits)  # signed or unsigned


def _parse_real_search(text: str) -> SearchPatterns:
    try:
        value = float(text)
        return _make_patterns(
            [(name, struct.pack(order + code, value)) for name, code in _REAL_CODES for order in "<>"]
        )
    except (ValueError, OverflowError):
        raise mistake(SEARCH_WHERE, f"'{text[:20]}'", EXPECTED_SEARCH) from None


def _make_patterns(found: list[tuple[str, bytes]]) -> SearchPatterns:
    patterns = tuple(dict.fromkeys(pattern for _, pattern in found))
    names = list(dict.fromkeys(name for name, _ in found))
    return SearchPatterns(patterns, f"{', '.join(names)} in either byte order")


# -- in bytes ------------------------------------------------------------------------------------------------


def find_first(content: bytes, patterns: tuple[bytes, ...], start: int = 0) -> int | None:
    """Return the first place from `start` on at which one of the patterns begins."""
    found = [place for pattern in patterns if (place := content.find(pattern, max(0, start))) >= 0]
    return min(found, default=None)


def find_last(content: bytes, patterns: tuple[bytes, ...], before: int) -> int | None:
    """Return the last place before `before` at which a pattern begins, or None."""
    if before <= 0:
        return None
    found = [place for p in patterns if (place := content.rfind(p, 0, before - 1 + len(p))) >= 0]
    return max(found, default=None)


def find_all(content: bytes, patterns: tuple[bytes, ...]) -> Iterator[range]:
    """Yield the range of bytes of every hit, for one pattern after the other."""
    for pattern in patterns:
        place = content.find(pattern)
        while place >= 0:
            yield range(place, place + len(pattern))
            place = content.find(pattern, place + 1)


MOST_HITS: Final = 10_000
MOST_BYTES_COUNTED: Final = 1024 * 1024  # bytes times patterns; beyond it hits are not counted


def describe_hit(runs: Sequence[tuple[int, bytes]], patterns: tuple[bytes, ...], place: int) -> str:
    """Return `hit 2 of 7` for a place, or "" if there are too many bytes or hits to count."""
    if sum(len(content) for _, content in runs) * len(patterns) > MOST_BYTES_COUNTED:
        return ""
    found = (start + match.start for start, content in runs for match in find_all(content, patterns))
    places = sorted(set(islice(found, MOST_HITS)))
    is_counted = next(found, None) is None and place in places
    return f"hit {places.index(place) + 1} of {len(places)}" if is_counted else ""
