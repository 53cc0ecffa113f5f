"""What a peer sends: escaped text, seeded random bytes, a file; and the cutting into chunks."""

from __future__ import annotations

import random
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from trcvtui.errors import mistake
from trcvtui.files import READABLE, read_bytes, reason_of

MOST_BYTES: Final = 16 * 1024 * 1024
KEPT_BYTES: Final = 65536  # of what a peer has received: one job of the largest LEN
ESCAPES: Final = {"r": b"\r", "n": b"\n", "t": b"\t", "0": b"\0", "\\": b"\\", '"': b'"', "'": b"'"}
_PIECE: Final = re.compile(r"\\(?:x([0-9A-Fa-f]{2})|(.?))|([^\\]+)", re.DOTALL)


def text_bytes(text: str, where: str = "text") -> bytes:
    r"""Return the bytes of a text: UTF-8, with the escapes \r \n \t \0 \\ \" \' and \xNN."""
    parts = []
    for piece in _PIECE.finditer(text):
        hexadecimal, letter, plain = piece.groups()
        if plain is not None:
            parts.append(plain.encode("utf-8", "surrogatepass"))
        elif hexadecimal is not None:
            parts.append(bytes.fromhex(hexadecimal))
        elif letter in ESCAPES:
            parts.append(ESCAPES[letter])
        else:
            raise mistake(where, f"'\\{letter}'", r"an escape: \r \n \t \0 \\ \" or \xNN")
    return b"".join(parts)


def random_bytes(count: int, seed: int) -> bytes:
    """Return `count` bytes that depend on the seed alone."""
    return random.Random(seed).randbytes(count)


def file_bytes(path: Path, where: str) -> bytes:
    """Return the bytes of a file of at most 16 MiB; raise UserError when it cannot be read or is empty."""
    try:
        content = read_bytes(path, MOST_BYTES)
    except (OSError, ValueError) as failed:
        raise mistake(where, f"{reason_of(failed)}: '{path}'", READABLE) from None
    if len(content) > MOST_BYTES:
        raise mistake(where, f"'{path}' with more than that", f"at most {MOST_BYTES} bytes")
    if not content:
        raise mistake(where, f"'{path}', which is empty", "at least one byte")
    return content


def chunks(payload: bytes, split: Iterable[int]) -> tuple[memoryview, ...]:
    """Return the payload in pieces of the sizes of `split`, the rest as the last; no piece is empty."""
    view = memoryview(payload)
    pieces, start = [], 0
    for size in split:
        pieces.append(view[start : start + size])
        start += size
    pieces.append(view[start:])
    return tuple(piece for piece in pieces if len(piece))
