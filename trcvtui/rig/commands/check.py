"""`peer P1 check on [size=64] [every=T#100ms] [on TRCV_C_1]` and `peer P1 check off`."""

from __future__ import annotations

from typing import Final

from trcvtui.project.project import Project
from trcvtui.project.tables import shown, whole
from trcvtui.rig.commands.check_frames import LEAST_SIZE
from trcvtui.rig.commands.read_conditions import read_instance
from trcvtui.rig.commands.tokens import Words
from trcvtui.rig.commands.trial import RECEIVES
from trcvtui.rig.commands.values import duration, value_of
from trcvtui.rig.commands.words import DEFAULT_CHECK_NS, DEFAULT_CHECK_SIZE, CheckOff, CheckOn

SIZE: Final = whole(LEAST_SIZE, 65507)  # the largest datagram
FORM: Final = "size=64, every=T#100ms, on and an instance, or the end of the command"


def read_check(words: Words, project: Project, peer: str) -> CheckOn | CheckOff:
    """Return a `check` command; raise UserError."""
    word = words.next("on or off")
    if word == "off":
        words.finish()
        return CheckOff(peer)
    if word != "on":
        raise words.wrong(shown(word), "on or off")
    size, every, instance = DEFAULT_CHECK_SIZE, DEFAULT_CHECK_NS, ""
    while words:
        key, equals, text = words.next("").partition("=")
        if key == "size" and equals:
            size = value_of(SIZE, text, "size=", words.where)
        elif key == "every" and equals:
            every = duration(text, "every=", words.where)
        elif key == "on" and not equals:
            instance = _receiver(words, project)
        else:
            raise words.wrong(shown(key), FORM)
    return CheckOn(peer, size, every, instance)


def _receiver(words: Words, project: Project) -> str:
    instance = read_instance(words, project)
    if instance.block not in RECEIVES or instance.data is None:
        raise words.wrong(f"'{instance.name}', a {instance.block}", "an instance that receives, with DATA")
    return instance.name
