"""Names in project files and commands: IEC identifiers, and the known name nearest to a wrong one."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final
from unicodedata import category

from trcvtui.errors import one_line

IDENTIFIER_TEXT: Final = "a name of letters, digits and _ that begins with no digit"
NO_HIDDEN: Final = "a name without control and bidirectional characters"
_HIDDEN: Final = frozenset({"Cc", "Zl", "Zp"})
_TURNS: Final = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
MOST_LISTED: Final = 16
ALIKE: Final = 0.7  # of 1: STATE is near STATUS, C2 is not near C1


def is_identifier(text: str) -> bool:
    """Return whether the text is an IEC identifier, of the letters and digits of any script."""
    return text.isidentifier()


def hidden_in(path: str) -> str:
    """Return the control and bidirectional characters of a file's name, escaped; "" where it has none."""
    return one_line("".join(sorted({one for one in path if one in _TURNS or category(one) in _HIDDEN})))


def parse_reference(text: str | None) -> str | None:
    """Return `C1` of `@C1`, None for any other text."""
    return text[1:] if text and text.startswith("@") and is_identifier(text[1:]) else None


def expected_name(wrong: str, known: Iterable[str], what: str) -> str:
    """Return what was expected instead of a wrong name: the nearest known one, or all of them.

    `what` says what the names are, such as `CONNECT`.
    """
    names = list(dict.fromkeys(known))
    near = nearest(wrong, names)
    if near is not None:
        return near
    if not names:
        return f"the name of {with_article(what)}, but there is none"
    listed = ", ".join(names[:MOST_LISTED]) + (", ..." if len(names) > MOST_LISTED else "")
    return listed if len(names) == 1 else f"one of {listed}"


def with_article(word: str) -> str:
    """Return `an instance`, `a CONNECT`."""
    return f"{'an' if word[:1] in 'aeioAEIO' else 'a'} {word}"  # UDT and UDP_CONFIG begin with a you


def nearest(wrong: str, known: Iterable[str]) -> str | None:
    """Return the known name that the wrong one was most likely meant to be, None when none is near."""
    folded = {name.casefold(): name for name in known}
    if wrong.casefold() in folded:
        return folded[wrong.casefold()]
    # Imported here: a file without mistakes does not pay for it.
    import difflib

    found = difflib.get_close_matches(wrong.casefold()[:100], folded, n=1, cutoff=ALIKE)
    return folded[found[0]] if found else None
