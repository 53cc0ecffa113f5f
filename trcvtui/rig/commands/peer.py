"""The `peer` commands: the connection and its trouble, what is sent, what is answered, what is tried."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from trcvtui.project.names import expected_name
from trcvtui.project.project import Project
from trcvtui.project.tables import shown
from trcvtui.rig.commands.check import read_check
from trcvtui.rig.commands.library import read_any_send, read_play
from trcvtui.rig.commands.read_conditions import read_peer
from trcvtui.rig.commands.reply import read_reply
from trcvtui.rig.commands.tokens import Words
from trcvtui.rig.commands.trial import read_trial
from trcvtui.rig.commands.words import (
    BenchCommand,
    PeerClose,
    PeerConnect,
    PeerListen,
    PeerResume,
    PeerRst,
    PeerShutdown,
    PeerStall,
)

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
