"""Everything that can be done, by name, for the command palette."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Final

from textual.app import SystemCommand

from trcvtui.tui.formatting import plain
from trcvtui.tui.peer_commands import SEND, buttons_for

if TYPE_CHECKING:
    from trcvtui.tui.app import BenchApp

PANES: Final = {
    1: "Instances", 2: "Block", 3: "STATUS", 4: "History", 5: "Received", 6: "Members", 7: "Peer",
}  # fmt: skip


def commands(app: BenchApp) -> Iterator[SystemCommand]:
    """Yield the commands that make sense now."""
    yield from _of_scans(app)
    yield from _of_block(app)
    yield from _of_peer(app)
    yield from _of_instances(app)
    yield from _of_screen(app)


def _of_scans(app: BenchApp) -> Iterator[SystemCommand]:
    for title, key, line in (
        ("Hold the scans", "space", "hold"),
        ("Let the scans go on", "space", "go"),
        ("PLC to STOP", "", "plc stop"),
        ("PLC to RUN", "", "plc run"),
        ("Clear all faults", "", "fault clear"),
    ):
        yield SystemCommand(title, _said(line, key), partial(app.submit, line))
    yield SystemCommand("One single scan", "run 1 · key .", app.main.action_single_scan)


def _of_block(app: BenchApp) -> Iterator[SystemCommand]:
    name = plain(app.scene.selected)
    for pin in app.main.block.drawing().inputs:
        title = f"{'Pulse' if pin.edge else 'Toggle' if pin.is_bool else 'Write'} {pin.name}"
        about = f"{name}: {pin.text}" + (f" · key {pin.letter}" if pin.letter else "")
        yield SystemCommand(title, about, partial(app.main.block.press, pin.letter))


def _of_peer(app: BenchApp) -> Iterator[SystemCommand]:
    peer = app.scene.peer_snapshot
    if peer is None:
        return
    for button in buttons_for(bool(app.scene.snapshot and app.scene.snapshot.faults)):
        line = app.main.peer.composer.line or "the payload" if button.letter == SEND else button.line(peer)
        press = partial(app.main.peer.action_button, button.letter)
        yield SystemCommand(f"Peer {plain(peer.name)}: {button.label(peer)}", plain(line), press)
    for other in app.scene.peers:
        if other.name != peer.name:
            yield SystemCommand(
                f"Peer {plain(other.name)}", "speak for this peer", partial(_peer, app, other.name)
            )


def _of_instances(app: BenchApp) -> Iterator[SystemCommand]:
    for instance in app.scene.instances:
        if instance.name != app.scene.selected:
            about = f"select this instance of {instance.block}"
            yield SystemCommand(
                f"Instance {plain(instance.name)}", about, partial(_select, app, instance.name)
            )


def _of_screen(app: BenchApp) -> Iterator[SystemCommand]:
    for digit, name in PANES.items():
        yield SystemCommand(f"Pane {name}", f"go there · key {digit}", partial(app.main.action_pane, digit))
    yield SystemCommand("Zoom the pane", "alone on the screen, and back · key M", app.main.action_zoom)
    yield SystemCommand("Command line", "type a bench command · key :", app.main.action_prompt)
    yield SystemCommand("Help", "keys, and the STATUS table of the dialect · key ?", app.main.action_help)


def _said(line: str, key: str) -> str:
    return f"{line} · key {key}" if key else line


def _select(app: BenchApp, name: str) -> None:
    from trcvtui.tui.messages import InstanceSelected

    app.main.post_message(InstanceSelected(name))


def _peer(app: BenchApp, name: str) -> None:
    from trcvtui.tui.messages import PeerSelected

    app.main.post_message(PeerSelected(name))
