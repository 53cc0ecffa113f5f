"""`feed RX ...`: what arrives on the simulated line of a ComBuffer."""

from __future__ import annotations

from typing import Final

from trcvtui.project.names import expected_name
from trcvtui.project.project import SERIAL, SIMULATED, ComBufferDecl, Project
from trcvtui.project.tables import shown
from trcvtui.rig.commands.read_payload import FORMS, is_payload, read_payload
from trcvtui.rig.commands.tokens import Words
from trcvtui.rig.commands.words import FeedLine

BREAK: Final = "break"


def may_be_fed(buffer: ComBufferDecl) -> bool:
    """Return whether bench commands may let bytes arrive in a ComBuffer: a line of its own, no way out."""
    return buffer.source in (SIMULATED, SERIAL) and not buffer.line


def read_feed(words: Words, project: Project) -> FeedLine:
    """Return `feed RX hex 01 02`, `feed RX text "abc"` or `feed RX break`; raise UserError."""
    name = words.next("the name of a ComBuffer")
    lines = [buffer.name for buffer in project.combuffers if may_be_fed(buffer)]
    if name not in lines:
        raise words.wrong(shown(name), expected_name(name, lines, f'ComBuffer with source = "{SIMULATED}"'))
    if words.peek() == BREAK:
        words.next(BREAK)
        return FeedLine(name, None)
    form = words.peek()
    if form and not is_payload(form):
        expected = expected_name(form, (*FORMS, BREAK), "form of payload")
        raise words.wrong(shown(words.next(BREAK)), expected)
    payload = read_payload(words, project)
    return FeedLine(name, payload.content, payload.text)
