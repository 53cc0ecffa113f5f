"""The `peer` commands: connect, listen, close, rst, shutdown, send, stall, resume."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

from trcvtui.plc.names import expected_name
from trcvtui.plc.project import Project
from trcvtui.plc.tables import shown, whole
from trcvtui.rig.bench_conditions import read_peer
from trcvtui.rig.bench_payload import read_payload
from trcvtui.rig.bench_tokens import Words
from trcvtui.rig.bench_values import duration, value_of
from trcvtui.rig.bench_words import (
    BenchCommand,
    PeerClose,
    PeerConnect,
    PeerListen,
    PeerResume,
    PeerRst,
    PeerSend,
    PeerShutdown,
    PeerStall,
)
from trcvtui.rig.payload import MOST_BYTES

SIMPLE: Final[dict[str, Callable[[str], BenchCommand]]] = {
    "connect": PeerConnect,
    "listen": PeerListen,
    "close": PeerClose,
    "rst": PeerRst,
    "shutdown": PeerShutdown,
    "stall": PeerStall,
    "resume": PeerResume,
}
VERBS: Final = (*SIMPLE, "send")
OF_CONNECTIONS: Final = ("connect", "rst", "shutdown")
OF_UDP: Final = "one of " + ", ".join(verb for verb in VERBS if verb not in OF_CONNECTIONS)
SIZE: Final = whole(1, MOST_BYTES)
TIMES: Final = whole(1, 1_000_000)
OPTIONS: Final = ("split", "gap", "repeat", "every")
_OPTION: Final = re.compile(rf"({'|'.join(OPTIONS)})=.*", re.DOTALL)


def read_peer_command(words: Words, project: Project) -> BenchCommand:
    """Return a `peer` command; raise UserError."""
    peer = read_peer(words, project)
    verb = words.next(f"one of {', '.join(VERBS)}")
    if verb == "send":
        return _read_send(words, project, peer.name)
    if verb not in SIMPLE:
        raise words.wrong(shown(verb), expected_name(verb, VERBS, "peer command"))
    words.finish()
    if peer.udp and verb in OF_CONNECTIONS:
        raise words.wrong(f"{verb} of the UDP peer '{peer.name}', which has no connection", OF_UDP)
    if verb == "connect" and not peer.active:
        raise words.wrong(
            f"connect of the passive peer '{peer.name}'", "listen, or a peer with active = true"
        )
    if verb == "listen" and peer.active:
        raise words.wrong(
            f"listen of the active peer '{peer.name}'", "connect, or a peer with active = false"
        )
    return SIMPLE[verb](peer.name)


def _read_send(words: Words, project: Project, peer: str) -> PeerSend:
    options = words.cut(lambda word: _OPTION.fullmatch(word) is not None)
    payload = read_payload(words, project)
    split: tuple[int, ...] = ()
    given = {"gap": 0, "repeat": 1, "every": 0}
    for option in options:
        key, _, text = option.partition("=")
        if _OPTION.fullmatch(option) is None:
            raise words.wrong(shown(option), f"one of {'=, '.join(OPTIONS)}= or the end of the command")
        if key == "split":
            split = tuple([value_of(SIZE, size, "split=", words.where) for size in text.split(",")])
        elif key == "repeat":
            given[key] = value_of(TIMES, text, "repeat=", words.where)
        else:
            given[key] = duration(text, f"{key}=", words.where)
    return PeerSend(peer, payload.content, split, given["gap"], given["repeat"], given["every"], payload.text)
