"""A name as a pattern: letters and digits of any script, with the marks that many write beside them."""

from __future__ import annotations

from typing import Final

# `\w` knows no combining marks (Hindi vowels, Thai tones, decomposed accents); bidirectional and zero-width
# characters and spaces, which stand between them, are left out.
_MARKS: Final = (
    r"\u0300-\u036f\u0483-\u0489\u0591-\u05bd\u05bf\u05c1\u05c2\u05c4\u05c5\u05c7\u0610-\u061a\u064b-\u065f"
    r"\u0670\u06d6-\u06dc\u06df-\u06e4\u0711-\u074a\u07a6-\u07b0\u0900-\u0963\u0981-\u09e3\u0a01-\u0a51"
    r"\u0a81-\u0ae3\u0b01-\u0b63\u0b82-\u0bcd\u0c00-\u0c63\u0c81-\u0ce3\u0d00-\u0d63\u0d81-\u0df3"
    r"\u0e31-\u0e3a\u0e47-\u0e4e\u0eb1-\u0ebc\u0ec8-\u0ece\u0f18-\u0fbc\u102b-\u103e\u1056-\u109d"
    r"\u17b4-\u17d3\u1ab0-\u1aff\u1b00-\u1b44\u1dc0-\u1dff\u20d0-\u20f0\u302a-\u302f\u3099\u309a"
)
NAME: Final = rf"[^\W\d][\w{_MARKS}]*"
