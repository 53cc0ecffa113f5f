"""The forms in which a bench command gives bytes: hex, text, udt, file, random."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from trcvtui.project.names import expected_name
from trcvtui.project.project import Project
from trcvtui.project.tables import shown, whole
from trcvtui.rig.commands.member_values import struct_bytes
from trcvtui.rig.commands.payload import MOST_BYTES, file_bytes, random_bytes, text_bytes
from trcvtui.rig.commands.tokens import Words, value_of
from trcvtui.udt.byte_text import parse_hex
from trcvtui.udt.layout.layout import lay_out

SEED: Final = whole(0, (1 << 63) - 1)
COUNT: Final = whole(1, MOST_BYTES)


@dataclass(frozen=True, slots=True)
class Payload:
    """Bytes, and how the command wrote them."""

    content: bytes
    text: str


def is_payload(word: str) -> bool:
    """Return whether a word begins a form of payload."""
    return word in FORMS


def read_payload(words: Words, project: Project) -> Payload:
    """Return the payload that the words from here to the last one give; raise UserError."""
    start = words.place
    form = words.next("hex, text, udt, file or random")
    if form not in FORMS:
        raise words.wrong(shown(form), expected_name(form, FORMS, "form of payload"))
    content = FORMS[form](words, project)
    return Payload(content, words.written(start))


def _hex(words: Words, project: Project) -> bytes:
    expected = "hex bytes such as 01 02 0A"
    content = parse_hex(words.rest_text(expected), f"{words.where}: hex")
    if not content:
        raise words.wrong("no bytes", expected)
    return content


def _text(words: Words, project: Project) -> bytes:
    written = words.next('a text such as "abc"')
    words.finish()
    if len(written) < 2 or written[0] != '"' or written[-1] != '"':
        raise words.wrong(shown(written), 'a text in double quotes such as "abc"')
    content = text_bytes(written[1:-1], f"{words.where}: text")
    if not content:
        raise words.wrong('""', "at least one character")
    return content


def _udt(words: Words, project: Project) -> bytes:
    name = words.next("the name of a UDT")
    if name.casefold() not in project.types.types:
        raise words.wrong(shown(name), expected_name(name, project.types.names(), "UDT"))
    braces = words.rest_text("members in braces such as {speed=1.5}")
    layout = lay_out(project.types.named(name), project.rules_of(name), name)
    content = struct_bytes(layout, braces, words.where)
    if not content:
        raise words.wrong(f"{name}, which has no bytes", "a UDT with members")
    return content


def _file(words: Words, project: Project) -> bytes:
    name = words.next("the name of a file")
    words.finish()
    return file_bytes(project.base / _bare(name), f"{words.where}: file")


def _bare(name: str) -> str:
    return name[1:-1] if len(name) > 2 and name[0] == name[-1] and name[0] in "\"'" else name


def _random(words: Words, project: Project) -> bytes:
    count = value_of(COUNT, words.next("a number of bytes"), "", words.where)
    seed = 0
    if words:
        key, _, text = words.next("seed=1").partition("=")
        if key != "seed":
            raise words.wrong(shown(key), "seed=1 or the end of the command")
        seed = value_of(SEED, text, "seed=", words.where)
    words.finish()
    return random_bytes(count, seed)


FORMS: Final[dict[str, Callable[[Words, Project], bytes]]] = {
    "hex": _hex,
    "text": _text,
    "udt": _udt,
    "file": _file,
    "random": _random,
}
