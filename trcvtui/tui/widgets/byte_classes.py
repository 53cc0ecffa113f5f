"""What a byte is, apart from how it is drawn: its class and its character (after hexyl).

The character tells the class as well, so that the colour is never the only sign.
"""

from __future__ import annotations

from typing import Final

NULL, PRINTABLE, SPACE, CONTROL, HIGH = "null", "printable", "space", "control", "high"
CLASSES: Final = (NULL, PRINTABLE, SPACE, CONTROL, HIGH)


def byte_class(byte: int) -> str:
    """Return the class of a byte 0..255."""
    if byte == 0:
        return NULL
    if byte in b" \t\n\r\x0b\x0c":
        return SPACE
    if byte < 0x20 or byte == 0x7F:
        return CONTROL
    return PRINTABLE if byte < 0x80 else HIGH


def byte_character(byte: int) -> str:
    """Return the one character that stands for a byte in the text column."""
    if 0x20 <= byte < 0x7F:
        return chr(byte)
    return {NULL: "⋄", SPACE: "_", CONTROL: "•", HIGH: "×"}[byte_class(byte)]


CLASS_OF: Final = tuple(byte_class(byte) for byte in range(256))
CHARACTER_OF: Final = tuple(byte_character(byte) for byte in range(256))
HEX_OF: Final = tuple(f"{byte:02x}" for byte in range(256))
