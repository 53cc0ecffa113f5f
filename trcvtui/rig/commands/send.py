"""What a peer shall send, as the commands write it: a payload, its cuts and pauses, what is filled in."""

from __future__ import annotations

import re
from typing import Final

from trcvtui.project.names import expected_name
from trcvtui.project.project import Project
from trcvtui.project.tables import Kind, shown, whole
from trcvtui.rig.commands.counters_and_checksums import (
    CHECKSUMS,
    DIGITS,
    KINDS,
    NUMBER,
    NUMBERS,
    Fill,
    Order,
    as_order,
    in_order,
)
from trcvtui.rig.commands.payload import MOST_BYTES, text_bytes
from trcvtui.rig.commands.read_payload import Payload, read_payload
from trcvtui.rig.commands.tokens import Words, duration, value_of
from trcvtui.rig.commands.words import PeerSend
from trcvtui.udt.byte_text import parse_hex
from trcvtui.udt.layout.layout import BYTE_ORDERS

SIZE: Final = whole(1, MOST_BYTES)
TIMES: Final = whole(1, 1_000_000)
OFFSET: Final = whole(0, MOST_BYTES)
WIDTHS: Final[dict[str, Kind[int]]] = {NUMBER: whole(1, 8), DIGITS: whole(1, 19)}
TIMING: Final = ("split", "gap", "repeat", "every")
OPTIONS: Final = (*TIMING, *KINDS)
HEX_HOLE: Final = "{n}, {n:2}, {n:2:big} or a checksum such as {crc32} or {crc16-modbus:little}"
TEXT_HOLE: Final = "{n} or {n:3}, three digits"
FILL_FORM: Final = "an offset, a width and a byte order such as n=4:2:big or crc32=8:little"
_OPTION: Final = re.compile(rf"({'|'.join(OPTIONS)})=.*", re.DOTALL)
_HOLE: Final = re.compile(r"\{([^{}]*)\}")


def read_send(words: Words, project: Project, peer: str, holes_in_text: bool = False) -> PeerSend:
    """Return what stands behind `peer P1 send`; `holes_in_text`: {n} in a text is a number."""
    project = project.beside(peer)
    options = words.cut(lambda word: _OPTION.fullmatch(word) is not None)
    payload, fills = _read_message(words, project, holes_in_text)
    split: tuple[int, ...] = ()
    gaps: tuple[int, ...] = ()
    given = {"repeat": 1, "every": 0}
    for option in options:
        key, _, text = option.partition("=")
        if _OPTION.fullmatch(option) is None:
            raise words.wrong(shown(option), f"one of {'=, '.join(TIMING)}= or the end of the command")
        if key == "split":
            split = tuple([value_of(SIZE, size, "split=", words.where) for size in text.split(",")])
        elif key == "gap":
            gaps = tuple([duration(gap, "gap=", words.where) for gap in text.split(",")])
        elif key == "repeat":
            given[key] = value_of(TIMES, text, "repeat=", words.where)
        elif key == "every":
            given[key] = duration(text, "every=", words.where)
        else:
            fills.append(_fill_of(key, text, project, words))
    content = _with_room(payload.content, fills, words)
    return PeerSend(
        peer=peer,
        payload=content,
        split=split,
        gap_ns=gaps[-1] if gaps else 0,
        repeat=given["repeat"],
        every_ns=given["every"],
        text=payload.text,
        gaps_ns=gaps if len(set(gaps)) > 1 else (),
        fills=tuple(in_order(fills)),
    )


def _read_message(words: Words, project: Project, holes_in_text: bool) -> tuple[Payload, list[Fill]]:
    start, form = words.place, words.peek()
    has_holes = form == "hex" or (form == "text" and holes_in_text)
    if not has_holes or not _HOLE.search(words.to_come()):
        return read_payload(words, project), []
    words.next("")
    if form == "hex":
        content, fills = _hex_with_holes(words.rest_text("hex bytes"), project, words)
    else:
        content, fills = _text_with_holes(words, project)
    return Payload(content, words.written(start)), fills


def _hex_with_holes(text: str, project: Project, words: Words) -> tuple[bytes, list[Fill]]:
    content, fills, at = bytearray(), list[Fill](), 0
    for hole in _HOLE.finditer(text):
        content += parse_hex(" " * at + text[at : hole.start()], f"{words.where}: hex")
        fills.append(_hole_of(hole[1], len(content), project, words))
        content += bytes(fills[-1].width)
        at = hole.end()
    content += parse_hex(" " * at + text[at:], f"{words.where}: hex")
    return bytes(content), fills


def _text_with_holes(words: Words, project: Project) -> tuple[bytes, list[Fill]]:
    written = words.next("")
    words.finish()
    if len(written) < 2 or written[0] != '"' or written[-1] != '"':
        raise words.wrong(shown(written), 'a text in double quotes such as "abc"')
    text, content, fills, at = written[1:-1], bytearray(), list[Fill](), 0
    for hole in _HOLE.finditer(text):
        name, _, width = hole[1].partition(":")
        if name != NUMBER:
            continue
        content += text_bytes(text[at : hole.start()], f"{words.where}: text")
        digits = WIDTHS[DIGITS].from_text(width or "1")
        if digits is None:
            raise words.wrong(shown(hole[0]), TEXT_HOLE)
        fills.append(Fill(DIGITS, len(content), digits, hole=True))
        content += b"0" * digits
        at = hole.end()
    content += text_bytes(text[at:], f"{words.where}: text")
    if not content:
        raise words.wrong('""', "at least one character")
    return bytes(content), fills


def _hole_of(text: str, offset: int, project: Project, words: Words) -> Fill:
    kind, *more = text.strip().split(":")
    if kind not in (NUMBER, *CHECKSUMS):
        raise words.wrong(f"'{{{text}}}'", HEX_HOLE)
    return _fill(kind, offset, more, f"{{{text}}}", HEX_HOLE, project, words, hole=True)


def _fill_of(kind: str, text: str, project: Project, words: Words) -> Fill:
    first, *more = text.split(":")
    offset = value_of(OFFSET, first, f"{kind}=", words.where)
    return _fill(kind, offset, more, f"{kind}={text}", FILL_FORM, project, words)


def _fill(
    kind: str,
    offset: int,
    more: list[str],
    written: str,
    form: str,
    project: Project,
    words: Words,
    hole: bool = False,
) -> Fill:
    """Return a fill of `[width][:order]`; a checksum has its own width."""
    width: int | None = CHECKSUMS[kind][0] if kind in CHECKSUMS else 1
    if kind in NUMBERS and more:
        width = WIDTHS[kind].from_text(more.pop(0))
    order = more.pop(0) if more and kind != DIGITS else None
    if width is None or more:
        raise words.wrong(shown(written), form)
    if order is not None and order not in BYTE_ORDERS:
        raise words.wrong(f"{shown(written)}", expected_name(order, BYTE_ORDERS, "byte order"))
    if kind in CHECKSUMS and offset == 0:
        raise words.wrong(shown(written), "at least one byte before the checksum")
    return Fill(kind, offset, width, _order(kind, width, order, project), hole)


def _order(kind: str, width: int, order: str | None, project: Project) -> Order:
    if width == 1 or kind == DIGITS:
        return "little"
    own = "little" if kind == "crc16-modbus" else project.layout.byte_order  # as Modbus sends it
    return as_order(order or own)


def _with_room(content: bytes, fills: list[Fill], words: Words) -> bytes:
    """Return the payload long enough for everything that is filled in; there is no hole between."""
    for fill in sorted(fills, key=lambda fill: fill.offset):
        if fill.offset > len(content):
            found = f"{fill.kind}={fill.offset} behind {len(content)} bytes"
            raise words.wrong(found, f"an offset from 0 to {len(content)}")
        content += bytes(max(0, fill.offset + fill.width - len(content)))
    return content
