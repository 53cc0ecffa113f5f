"""Bytes as another tool takes them: hex, `16#..` list, ST array, C array, Python bytes, base64."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Final

A_LINE: Final = 16


def hex_lines(content: bytes, name: str = "") -> str:
    """Return hex, sixteen bytes a line."""
    return "\n".join(_lines(content, "{:02x}", " "))


def iec_list(content: bytes, name: str = "") -> str:
    """Return the bytes as a list of `16#..`."""
    return ",\n".join(_lines(content, "16#{:02X}", ", "))


def st_array(content: bytes, name: str) -> str:
    """Return the declaration of an ARRAY OF BYTE with the bytes as its initial value."""
    items = ",\n    ".join(_lines(content, "16#{:02X}", ", "))
    last = len(content) - 1
    return f"{identifier(name)} : ARRAY[0..{last}] OF BYTE := [\n    {items}\n];" if content else ""


def c_array(content: bytes, name: str) -> str:
    """Return the definition of an array in C."""
    items = ",\n    ".join(_lines(content, "0x{:02X}", ", "))
    head = f"const uint8_t {identifier(name)}[{len(content)}]"
    return f"{head} = {{\n    {items}\n}};" if content else ""


def python_bytes(content: bytes, name: str) -> str:
    """Return an assignment in Python."""
    pieces = [content[at : at + A_LINE] for at in range(0, len(content), A_LINE)]
    written = "\n".join('    b"' + "".join(f"\\x{byte:02x}" for byte in piece) + '"' for piece in pieces)
    return f"{identifier(name)} = (\n{written}\n)" if pieces else ""


def base64_text(content: bytes, name: str = "") -> str:
    """Return the bytes in base64, one line."""
    import base64  # only who asks for it pays for it

    return base64.b64encode(content).decode("ascii")


def _lines(content: bytes, form: str, between: str) -> Iterator[str]:
    for at in range(0, len(content), A_LINE):
        yield between.join(form.format(byte) for byte in content[at : at + A_LINE])


def identifier(name: str) -> str:
    """Return the name as a variable may be called in each of these languages."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII)
    return word if word and not word[0].isdigit() else f"_{word}"


# What `udt encode --format` takes; `hex` is one line, as the contract has it.
BYTE_FORMS: Final[dict[str, Callable[[bytes, str], str]]] = {
    "hex": lambda content, name: content.hex(" "),
    "iec": iec_list,
    "st": st_array,
    "c": c_array,
    "python": python_bytes,
    "base64": base64_text,
}
