"""`feed RX ...`: what arrives on the simulated line of a ComBuffer."""

from __future__ import annotations

from trcvtui.plc.names import expected_name
from trcvtui.plc.project import SERIAL, SIMULATED, Project
from trcvtui.plc.tables import shown
from trcvtui.rig.bench_payload import read_payload
from trcvtui.rig.bench_tokens import Words
from trcvtui.rig.bench_words import FeedLine

BREAK = "break"


def read_feed(words: Words, project: Project) -> FeedLine:
    """Return `feed RX hex 01 02`, `feed RX text "abc"` or `feed RX break`; raise UserError."""
    name = words.next("the name of a ComBuffer")
    lines = [buffer.name for buffer in project.combuffers if buffer.source in (SIMULATED, SERIAL)]
    if name not in lines:
        raise words.wrong(shown(name), expected_name(name, lines, f'ComBuffer with source = "{SIMULATED}"'))
    if words.peek() == BREAK:
        words.next(BREAK)
        return FeedLine(name, None)
    payload = read_payload(words, project)
    return FeedLine(name, payload.content, payload.text)
