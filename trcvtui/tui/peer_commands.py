"""What the peer pane can say: its buttons as a table, and the send command made of the composer's fields."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from trcvtui.rig.picture import PeerSnapshot

_BARE_QUOTE: Final = re.compile(r'(\\.)|"')
HEX, TEXT, UDT = "hex", "text", "udt"
MODES: Final = (HEX, TEXT, UDT)


@dataclass(frozen=True, slots=True)
class Button:
    """One button: letter, label and bench command for a peer; with `edit` the user completes it."""

    letter: str
    label: Callable[[PeerSnapshot], str]
    line: Callable[[PeerSnapshot], str]
    edit: bool = False


def _always(text: str) -> Callable[[PeerSnapshot], str]:
    return lambda peer: text


def _says(words: str) -> Callable[[PeerSnapshot], str]:
    return lambda peer: f"peer {peer.name} {words}"


SEND: Final = "s"
BUTTONS: Final = (
    Button(SEND, _always("Send"), _says("send")),
    Button(
        "c",
        lambda peer: "Connect" if peer.active else "Listen",
        lambda peer: f"peer {peer.name} {'connect' if peer.active else 'listen'}",
    ),
    Button("f", _always("FIN"), _says("close")),
    Button("r", _always("RST"), _says("rst")),
    Button("h", _always("Half-close"), _says("shutdown")),
    Button(
        "z",
        lambda peer: "Resume" if peer.stalled else "Stall",
        lambda peer: f"peer {peer.name} {'resume' if peer.stalled else 'stall'}",
    ),
)
FAULT: Final = Button("u", _always("Fault …"), _always("fault recv ECONNRESET on "), edit=True)
CLEAR: Final = Button("u", _always("Clear faults"), _always("fault clear"))


def buttons_for(faults: bool) -> tuple[Button, ...]:
    """Return the buttons; an armed fault turns the last one into its end."""
    return (*BUTTONS, CLEAR if faults else FAULT)


def send_line(peer: str, mode: str, payload: str, options: tuple[tuple[str, str], ...]) -> str:
    """Return the bench command that sends a payload; options are (name, text), empty ones are left out."""
    given = "".join(f" {name}={text.strip()}" for name, text in options if text.strip())
    return f"peer {peer} send {mode} {_quoted(payload) if mode == TEXT else payload.strip()}{given}"


def _quoted(text: str) -> str:
    # Escapes such as \r\n are the user's own; only a bare quote would end the text early.
    return '"' + _BARE_QUOTE.sub(lambda found: found[1] or '\\"', text) + '"'
