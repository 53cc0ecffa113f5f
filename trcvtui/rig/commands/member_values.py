"""Values of UDT members in bench commands: `12.5`, `'abc'`, `{speed=1.5, arr[0]=3}` to bytes and back."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

from trcvtui.errors import Problem, UserError, mistake
from trcvtui.project.tables import shown
from trcvtui.udt.layout.coding import Value
from trcvtui.udt.layout.layout import Layout, Leaf
from trcvtui.udt.layout.values import decode_leaf, encode, encode_leaf
from trcvtui.udt.literals import NAME

# `name`, `st.arr[2].x`, `[1,2].y`, each with `=` behind it.
_STEPS: Final = rf"(?:\.{NAME}|\[[^\]]*\])*"
_PATH: Final = re.compile(rf"\s*((?:{NAME}|\[[^\]]*\]){_STEPS})\s*=\s*")
_EMPTY: Final = re.compile(r"\{\s*\}")
_PLAIN: Final = re.compile(r"[^,{}'\"]*")
_END: Final = re.compile(r"\s*([,}])")
_QUOTED: Final = re.compile(r"""'((?:[^$']|\$.)*)'|"((?:[^\\"]|\\.)*)\"""", re.DOTALL)
_IEC_ESCAPE: Final = re.compile(r"\$([0-9A-Fa-f]{2}|.)", re.DOTALL)
_C_ESCAPE: Final = re.compile(r"\\(x[0-9A-Fa-f]{2}|.)", re.DOTALL)
_NAMED: Final = {"r": "\r", "n": "\n", "l": "\n", "t": "\t", "p": "\f"}
VALUES_FORM: Final = "members such as {speed=1.5, name='x', arr[0]=3}"


def unquoted(text: str) -> str:
    r"""Return the text inside IEC quotes ('$N' escapes) or double quotes ("\n" escapes), else the text."""
    found = _QUOTED.fullmatch(text)
    if found is None:
        return text
    if found[1] is not None:
        return _IEC_ESCAPE.sub(lambda e: _named(e[1], e[1]), found[1])
    return _C_ESCAPE.sub(lambda e: _named(e[1], e[1][1:]), found[2])


def _named(letter: str, digits: str) -> str:
    if len(digits) == 2:
        return chr(int(digits, 16))
    return _NAMED.get(letter.lower(), letter)


def quoted(text: str) -> str:
    """Return a text in IEC quotes, as `unquoted` reads it back (codes 0 to 255 outside ASCII as $hh)."""
    parts = []
    for character in text:
        code = ord(character)
        if character in "$'":
            parts.append("$" + character)
        elif code < 0x20 or 0x7F <= code <= 0xFF:
            parts.append(f"${code:02X}")
        else:
            parts.append(character)
    return f"'{''.join(parts)}'"


def struct_bytes(layout: Layout, braces: str, where: str) -> bytes:
    """Return the bytes of `{speed=1.5, st={x=1}}`, 0 where nothing is named; raise UserError."""
    values = dict(members_of(braces, where))
    return _told(where, lambda: encode(layout, values))


def members_of(braces: str, where: str) -> list[tuple[str, str]]:
    """Return `{speed=1.5, st={x=1}}` as paths and texts without quotes; raise UserError."""
    members, end = _read_braces(braces, 0, where)
    if end != len(braces):
        raise mistake(where, shown(braces[end:]), VALUES_FORM)
    return members


def _read_braces(text: str, at: int, where: str) -> tuple[list[tuple[str, str]], int]:
    if text[at : at + 1] != "{":
        raise mistake(where, shown(text[at:]), VALUES_FORM)
    empty = _EMPTY.match(text, at)
    if empty is not None:
        return [], empty.end()
    members: list[tuple[str, str]] = []
    while True:
        path = _PATH.match(text, at + 1)  # behind { or ,
        if path is None:
            raise mistake(where, shown(text[at:]), VALUES_FORM)
        inner, at = _read_value(text, path.end(), where)
        members += [(_joined(path[1], name), value) for name, value in inner]
        end = _END.match(text, at)
        if end is None:
            raise mistake(where, shown(text[at:]), ", or } behind a value")
        if end[1] == "}":
            return members, end.end()
        at = end.end() - 1


def _read_value(text: str, at: int, where: str) -> tuple[list[tuple[str, str]], int]:
    if text[at : at + 1] == "{":
        return _read_braces(text, at, where)
    found = _QUOTED.match(text, at) or _PLAIN.match(text, at)
    assert found is not None
    return [("", unquoted(found[0].strip()))], found.end()


def _joined(path: str, name: str) -> str:
    return path + name if not name or name.startswith("[") else f"{path}.{name}"


def leaf_bytes(layout: Layout, leaf: Leaf, text: str, where: str) -> bytes:
    """Return the bytes of one value, such as 12.5, TRUE, T#5s or 'abc'."""
    return _told(where, lambda: encode_leaf(layout, leaf, unquoted(text)))


def leaf_value(layout: Layout, leaf: Leaf, payload: bytes) -> Value:
    """Return the value of one leaf's bytes."""
    return decode_leaf(layout, leaf, payload)


def _told(where: str, act: Callable[[], bytes]) -> bytes:
    """Let the problems of a value name the command that holds it."""
    try:
        return act()
    except UserError as refused:
        raise UserError(
            Problem(f"{where}: {problem.where}", problem.found, problem.expected)
            for problem in refused.problems
        ) from None
