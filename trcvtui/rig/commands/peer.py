"""The `peer` commands: the connection and its trouble, what is sent, what is answered, what is tried."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.blocks.table import block_row
from trcvtui.project.names import expected_name
from trcvtui.project.project import Project
from trcvtui.project.tables import shown, whole
from trcvtui.rig.commands.check_frames import LEAST_SIZE
from trcvtui.rig.commands.library import read_any_send, read_play
from trcvtui.rig.commands.read_conditions import read_instance, read_peer
from trcvtui.rig.commands.read_payload import read_payload
from trcvtui.rig.commands.reply import read_reply
from trcvtui.rig.commands.tokens import Words, duration, value_of
from trcvtui.rig.commands.words import (
    DEFAULT_CHECK_NS,
    DEFAULT_CHECK_SIZE,
    BenchCommand,
    CheckOff,
    CheckOn,
    PeerClose,
    PeerConnect,
    PeerListen,
    PeerResume,
    PeerRst,
    PeerShutdown,
    PeerStall,
    TrySplits,
    TryStop,
)

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
    if not block_row(instance.block).receives_stream:
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
    if not block_row(instance.block).receives_stream or instance.data is None:
        raise words.wrong(f"'{instance.name}', a {instance.block}", "an instance that receives, with DATA")
    return instance.name


SIMPLE: Final[dict[str, Callable[[str], BenchCommand]]] = {
    "connect": PeerConnect,
    "listen": PeerListen,
    "close": PeerClose,
    "rst": PeerRst,
    "shutdown": PeerShutdown,
    "stall": PeerStall,
    "resume": PeerResume,
}
TALKS: Final[dict[str, Callable[[Words, Project, str], BenchCommand]]] = {
    "send": read_any_send,
    "play": read_play,
    "reply": read_reply,
    "check": read_check,
    "try-splits": read_trial,
}
VERBS: Final = (*SIMPLE, *TALKS)
OF_CONNECTIONS: Final = ("connect", "rst", "shutdown", "try-splits")
OF_UDP: Final = "one of " + ", ".join(verb for verb in VERBS if verb not in OF_CONNECTIONS)


def read_peer_command(words: Words, project: Project) -> BenchCommand:
    """Return a `peer` command; raise UserError."""
    peer = read_peer(words, project)
    verb = words.next(f"one of {', '.join(VERBS)}")
    if verb not in VERBS:
        raise words.wrong(shown(verb), expected_name(verb, VERBS, "peer command"))
    if verb in SIMPLE:
        words.finish()
    if peer.udp and verb in OF_CONNECTIONS:
        raise words.wrong(f"{verb} of the UDP peer '{peer.name}', which has no connection", OF_UDP)
    if verb in TALKS:
        return TALKS[verb](words, project, peer.name)
    if verb == "connect" and not peer.active:
        raise words.wrong(
            f"connect of the passive peer '{peer.name}'", "listen, or a peer with active = true"
        )
    if verb == "listen" and peer.active:
        raise words.wrong(
            f"listen of the active peer '{peer.name}'", "connect, or a peer with active = false"
        )
    return SIMPLE[verb](peer.name)
