"""`peer P1 try-splits PAYLOAD on INSTANCE [gap=T#30ms] [differ=0]` and `peer P1 try-splits stop`."""

from __future__ import annotations

from typing import Final

from trcvtui.blocks.parameters import RECEIVERS, SPEAKS_UDP
from trcvtui.project.project import Project
from trcvtui.project.tables import shown, whole
from trcvtui.rig.commands.read_conditions import read_instance
from trcvtui.rig.commands.read_payload import read_payload
from trcvtui.rig.commands.tokens import Words
from trcvtui.rig.commands.values import duration, value_of
from trcvtui.rig.commands.words import TrySplits, TryStop

RECEIVES: Final = RECEIVERS - SPEAKS_UDP
LONGEST: Final = 1024  # a message of n bytes takes n runs of some scans each
DIFFER: Final = whole(0, LONGEST - 1)
ANY: Final = "any"


def read_trial(words: Words, project: Project, peer: str) -> TrySplits | TryStop:
    """Return a `try-splits` command; raise UserError."""
    if words.peek() == "stop":
        words.next("")
        return TryStop(peer)
    aim = words.apart(lambda word: word == "on")
    payload = read_payload(words, project)
    if not 2 <= len(payload.content) <= LONGEST:
        raise words.wrong(f"{len(payload.content)} byte(s)", f"2 to {LONGEST} bytes, which can be cut")
    aim.next("on and the name of an instance that receives")
    instance = read_instance(aim, project)
    if instance.block not in RECEIVES:
        raise aim.wrong(f"'{instance.name}', a {instance.block}", "an instance that receives")
    gap, differ = 0, 0
    while aim:
        word = aim.next("")
        key, equals, text = word.partition("=")
        if key == "gap" and equals:
            gap = duration(text, "gap=", aim.where)
        elif key == "differ" and equals:
            differ = -1 if text == ANY else value_of(DIFFER, text, "differ=", aim.where)
        else:
            raise aim.wrong(shown(word), "gap=T#30ms, differ=0, differ=any or the end of the command")
    return TrySplits(peer, payload.content, instance.name, gap, None if differ < 0 else differ, payload.text)
