"""STRING and WSTRING: with a header of lengths, or with a NUL behind the characters (udt.md 2.2 and 3.3).

The bytes behind the text have any value; encode writes zeros. WSTRING is UTF-16 in the data's byte order.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from trcvtui.udt.layout.coded import Coding, Refused
from trcvtui.udt.layout.rules import BYTE_ORDERS, LayoutRules
from trcvtui.udt.types import Text

# What is no text in the encoding becomes codes that nothing else has, and comes back as the same bytes.
ODD_CODES = {
    "latin-1": "strict",
    "utf-8": "surrogateescape",
    "utf-16-le": "surrogatepass",
    "utf-16-be": "surrogatepass",
}


def text_coding(type_: Text, rules: LayoutRules) -> Coding:
    """Return how a text is stored under these rules."""
    charset = "utf-8" if type_.utf8 else "latin-1"
    if type_.wide:
        charset = "utf-16-le" if rules.byte_order == "little" else "utf-16-be"
    return (_headed if rules.text.header else _ended)(type_, rules, charset)


def _headed(type_: Text, rules: LayoutRules, charset: str) -> Coding:
    longest = rules.text.length(type_)
    lengths = struct.Struct(BYTE_ORDERS[rules.byte_order] + ("HH" if type_.wide else "BB"))
    unit = lengths.size // 2
    characters_of = _checked(type_, longest, charset, has_nul=True)

    def to_value(raw: bytes) -> str:
        # An actual length beyond the field ends at the field (udt.md U12).
        actual: int = lengths.unpack_from(raw)[1]
        return raw[lengths.size :][: actual * unit].decode(charset, ODD_CODES[charset])

    def to_raw(value: object) -> bytes:
        characters = characters_of(value)
        return lengths.pack(longest, len(characters) // unit) + characters

    def odd(raw: bytes) -> str:
        own, actual = lengths.unpack_from(raw)
        if actual > longest:
            return f" (length {actual} of {longest})"
        return f" (longest {own}, not {longest})" if own != longest else ""

    return Coding(f"{rules.text.size(type_)}s", to_value, to_raw, odd)


def _ended(type_: Text, rules: LayoutRules, charset: str) -> Coding:
    unit = 2 if type_.wide else 1
    longest = rules.text.length(type_)

    def to_value(raw: bytes) -> str:
        # Without a NUL the text ends with the last character that may be one (udt.md U12).
        return raw[: min(_end(raw, unit), longest * unit)].decode(charset, ODD_CODES[charset])

    def odd(raw: bytes) -> str:
        end = _end(raw, unit)
        if end > longest * unit:
            return " (no NUL)" if end == len(raw) else f" (length {end // unit} of {longest})"
        return ""

    to_raw = _checked(type_, longest, charset, has_nul=False)
    return Coding(f"{rules.text.size(type_)}s", to_value, to_raw, odd)


def _end(raw: bytes, unit: int) -> int:
    """Return where the first NUL stands, or the end."""
    if unit == 1:
        end = raw.find(0)
    else:
        end = next((at for at in range(0, len(raw), 2) if not raw[at] and not raw[at + 1]), -1)
    return len(raw) if end < 0 else end


def _checked(type_: Text, longest: int, charset: str, has_nul: bool) -> Callable[[object], bytes]:
    unit = 2 if type_.wide else 1
    codes = "" if type_.wide else ", codes 0 to 255" if has_nul else ", codes 1 to 255"
    expected = f"text of at most {longest} characters{codes}"
    if type_.utf8:
        expected = f"text of at most {longest} bytes in UTF-8" + ("" if has_nul else ", none of code 0")
    if type_.wide and not has_nul:
        expected += ", none of code 0"

    def characters_of(value: object) -> bytes:
        if not isinstance(value, str) or ("\0" in value and not has_nul):
            raise Refused(expected)
        try:
            characters = value.encode(charset, ODD_CODES[charset])
        except UnicodeEncodeError:
            raise Refused(expected) from None
        if len(characters) > longest * unit:
            raise Refused(expected)
        return characters

    return characters_of
