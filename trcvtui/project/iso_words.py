"""How a project file says ISO-on-TCP: TSAPs, TPDU sizes, and a peer that speaks it."""

from __future__ import annotations

import re
from typing import Final

from trcvtui.errors import UserError
from trcvtui.net.connection.description import LONGEST_SELECTOR, selector_bytes
from trcvtui.net.layers.iso_on_tcp import OWN_SIZE_CODE, IsoSettings
from trcvtui.project.tables import TRUTH, Kind, Table, of_text
from trcvtui.udt.byte_text import parse_hex

LONGEST_MESSAGE: Final = 65536
SIZES: Final = {1 << code: code for code in range(7, 14)}  # 128 .. 8192 bytes
_TIA: Final = re.compile(r"[0-9a-fA-F]{2}\.[0-9a-fA-F]{2}")  # as TIA writes a TSAP of two bytes


def parse_selector(text: str) -> bytes | None:
    """Return a TSAP: `16#E002` and TIA's `E0.02` are bytes, `text:E002` and what cannot be hex are text.

    What could be either is None (`either_way` says how to write each), and so is what no TSAP can be.
    `hex E0 02` and `text E0 02` are from older files.
    """
    if text.startswith(("16#", "hex ")):
        found = hex_of(text[3:].replace(".", " ")) or None
    elif text.startswith(("text:", "text ")):
        found = _ascii(text[5:])
    elif _TIA.fullmatch(text):
        found = bytes.fromhex(text.replace(".", ""))
    else:
        found = None if _is_ambiguous(text) else _ascii(text)
    return found if found is not None and len(found) <= LONGEST_SELECTOR else None


def _is_ambiguous(text: str) -> bool:
    return bool(text) and not text.strip("0123456789abcdefABCDEF .")


def either_way(text: str) -> str:
    """Return how to write the two things that a text of hex digits can be, "" where it is none."""
    if not _is_ambiguous(text) or _TIA.fullmatch(text):
        return ""
    digits = "".join(char for char in text if char not in " .").upper()
    digits = digits.zfill(len(digits) + len(digits) % 2)
    as_text = f'"text:{text}" (the text)'
    if not digits or len(digits) > 2 * LONGEST_SELECTOR:
        return as_text
    return f'"16#{digits}" (the bytes {selector_bytes(bytes.fromhex(digits))}) or {as_text}'


def hex_of(text: str) -> bytes | None:
    """Return the bytes of a text in hex, None when it is none."""
    try:
        return parse_hex(text)
    except UserError:
        return None


def db_bytes(text: str) -> bytes | None:
    """Return the bytes of a DB; a lone digit is a copy that was cut off, not a byte."""
    groups = text.replace(",", " ").split()
    lone = any(len(group.lower().removeprefix("0x").removeprefix("16#")) % 2 for group in groups)
    return None if lone else hex_of(text)


def _ascii(text: str) -> bytes | None:
    return text.encode("ascii") if text.isascii() else None


TSAP: Final = of_text(
    'a TSAP of at most 32 bytes such as "16#E002", "E0.02" or "TCP-1"', parse_selector, either_way
)
TPDU: Final[Kind[int]] = Kind(
    "a TPDU size: 128, 256, 512, 1024, 2048, 4096 or 8192",
    lambda value: SIZES.get(value) if isinstance(value, int) else None,
    lambda text: SIZES.get(int(text)) if text.isascii() and text.isdigit() and len(text) < 6 else None,
)


DB_BYTES: Final = of_text(
    'the bytes of a DB in hex, two digits each, such as "00 40 00 01 0b 01 ..."', db_bytes
)


def read_iso(table: Table) -> IsoSettings | None:
    """Return what a peer's table says about ISO-on-TCP, None where it speaks plain TCP."""
    is_iso = table.get("iso", TRUTH, False)
    if not is_iso:
        for key in ("local_tsap", "remote_tsap", "tpdu"):
            if table.has(key):
                table.know(key)
                table.wrong(key, "a word of ISO-on-TCP", "iso = true beside it")
        return None
    return IsoSettings(
        local=table.get("local_tsap", TSAP, b""),
        remote=table.get("remote_tsap", TSAP, b""),
        cap=LONGEST_MESSAGE,
        size_code=table.get("tpdu", TPDU, OWN_SIZE_CODE),
    )
