"""How a project file says ISO-on-TCP: TSAPs, TPDU sizes, and a peer that speaks it."""

from __future__ import annotations

from typing import Final

from trcvtui.errors import UserError
from trcvtui.net.description import LONGEST_SELECTOR
from trcvtui.net.iso_on_tcp import OWN_SIZE_CODE, IsoSettings
from trcvtui.plc.tables import TRUTH, Kind, Table, of_text
from trcvtui.udt.hexadecimal import parse_hex

LONGEST_MESSAGE: Final = 65536
SIZES: Final = {1 << code: code for code in range(7, 14)}  # 128 .. 8192 bytes
HEX_DIGITS: Final = frozenset("0123456789abcdefABCDEF")


def parse_selector(text: str) -> bytes | None:
    """Return a TSAP: `hex E0 02`, `E0 02` and `E0.02` are bytes, everything else is text, `text ...` too."""
    word, _, rest = text.partition(" ")
    if word == "hex":
        found = hex_of(rest)
    elif word == "text":
        found = _ascii(rest)
    else:
        pairs = text.replace(".", " ").split()
        are_bytes = bool(pairs) and all(len(one) == 2 and HEX_DIGITS.issuperset(one) for one in pairs)
        found = bytes.fromhex("".join(pairs)) if are_bytes else _ascii(text)
    return found if found is not None and len(found) <= LONGEST_SELECTOR else None


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


TSAP: Final = of_text('a TSAP of at most 32 bytes such as "E0 02", "hex e0 02" or "TCP-1"', parse_selector)
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
