"""Bench commands of the peer pane: a table of its buttons, and the `send` of the composer's fields."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from trcvtui.plc.snapshot import block_row
from trcvtui.project.project import Project
from trcvtui.snapshots.bench import PeerSnapshot

_BARE_QUOTE: Final = re.compile(r'(\\.)|"')
HEX, TEXT, UDT = "hex", "text", "udt"
PAYLOAD_MODES: Final = (HEX, TEXT, UDT)


@dataclass(frozen=True, slots=True)
class Button:
    """One button with letter, label and bench command for a peer. If `edit`, you complete the command."""

    letter: str
    label: Callable[[PeerSnapshot], str]
    line: Callable[[PeerSnapshot], str]
    edit: bool = False


def _always(text: str) -> Callable[[PeerSnapshot], str]:
    return lambda peer: text


def _peer_line(words: str) -> Callable[[PeerSnapshot], str]:
    return lambda peer: f"peer {peer.name} {words}"


SEND: Final = "s"
BUTTONS: Final = (
    Button(SEND, _always("Send"), _peer_line("send")),
    Button(
        "c",
        lambda peer: "Connect" if peer.active else "Listen",
        lambda peer: f"peer {peer.name} {'connect' if peer.active else 'listen'}",
    ),
    Button("f", lambda peer: "Close" if peer.udp else "FIN", _peer_line("close")),
    Button("r", _always("RST"), _peer_line("rst")),
    Button("h", _always("Half-close"), _peer_line("shutdown")),
    Button(
        "z",
        lambda peer: "Resume" if peer.stalled else "Stall",
        lambda peer: f"peer {peer.name} {'resume' if peer.stalled else 'stall'}",
    ),
)
NO_PEER: Final = "no peer: A adds one"
CONNECTED_LETTERS: Final = "rh"  # RST and half-close: UDP has neither
SILENCE_BUTTON: Final = Button(
    "l",
    lambda peer: "Wire up" if peer.silent else "Silence",
    lambda peer: f"link {peer.link} {'up' if peer.silent else 'down'}",
)
EVERY_SPLIT_LETTER, FORM_LETTER = "e", "o"
TRY_BUTTON: Final = Button(EVERY_SPLIT_LETTER, _always("Every split"), _peer_line("try-splits"))
REPLY: Final = Button("a", _always("Reply …"), _peer_line("reply on contains hex 05 send hex 06"), edit=True)
NO_REPLY_BUTTON: Final = Button("d", _always("No replies"), _peer_line("reply off"))
CHECK_BUTTON: Final = Button("b", _always("Check …"), _peer_line("check on size=64 every=T#100ms"), edit=True)
NO_CHECK_BUTTON: Final = Button("b", _always("Check off"), _peer_line("check off"))
FAULT_BUTTON: Final = Button("u", _always("Fault …"), _always("fault recv ECONNRESET on "), edit=True)
CLEAR_BUTTON: Final = Button("u", _always("Clear faults"), _always("fault clear"))


def buttons_for(faults: bool, peer: PeerSnapshot | None = None) -> tuple[Button, ...]:
    """Return the buttons that make sense for a peer. While a fault is armed, `u` clears faults."""
    silence = (SILENCE_BUTTON,) if peer is not None and peer.link else ()
    is_udp = peer is not None and peer.udp
    always = tuple(button for button in BUTTONS if not (is_udp and button.letter in CONNECTED_LETTERS))
    tries = (TRY_BUTTON,) if peer is not None and not is_udp else ()
    replies = (REPLY, NO_REPLY_BUTTON) if peer is not None and peer.replies else (REPLY,)
    checks = NO_CHECK_BUTTON if peer is not None and peer.check is not None else CHECK_BUTTON
    return (*always, *silence, CLEAR_BUTTON if faults else FAULT_BUTTON, *tries, *replies, checks)


def make_try_splits_line(peer: str, mode: str, payload: str, instance: str, gap: str) -> str:
    """Return the bench command that tries every split of a payload, with only the first pause in `gap`."""
    options = f" gap={gap.split(',')[0].strip()}" if gap.strip() else ""
    message = _quote(payload) if mode == TEXT else payload.strip()
    return f"peer {peer} try-splits {mode} {message} on {instance}{options} differ=any"


def receiver_for(link: str, selected: str, project: Project) -> str:
    """Return the receiving instance on a peer's CONNECT. Prefer the selected instance, then the first."""
    names = [i.name for i in project.instances if i.connect == link and block_row(i.block).receives_stream]
    return selected if selected in names else next(iter(names), "")


def make_send_line(peer: str, mode: str, payload: str, options: tuple[tuple[str, str], ...]) -> str:
    """Return the bench command that sends a payload. Options without text are left out."""
    given = "".join(f" {name}={text.strip()}" for name, text in options if text.strip())
    return f"peer {peer} send {mode} {_quote(payload) if mode == TEXT else payload.strip()}{given}"


def _quote(text: str) -> str:
    # Escapes such as \r\n are the user's own; only a bare quote would end the text early.
    return '"' + _BARE_QUOTE.sub(lambda found: found[1] or '\\"', text) + '"'
