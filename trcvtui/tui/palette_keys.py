"""The keys of the panes as entries of the palette: made of the bindings, so that none can be missing."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator
from functools import partial
from inspect import isawaitable
from typing import Final, NamedTuple

from textual.actions import parse
from textual.app import SystemCommand
from textual.binding import Binding
from textual.dom import DOMNode
from textual.keys import format_key
from textual.widget import Widget

from trcvtui.tui.main import MainScreen

PANES: Final = {
    1: "Instances", 2: "Block", 3: "STATUS", 4: "History", 5: "Received", 6: "Members", 7: "Peer",
    8: "Timing",
}  # fmt: skip
# Where the cursor goes by a key; by name nobody asks for it.
CURSOR: Final = frozenset(("move", "page", "edge", "step", "place"))
BY_HAND: Final = frozenset(("button", "write"))  # the palette tells more of these than a binding knows


class PaneKey(NamedTuple):
    """One binding of a pane."""

    digit: int
    widget: Widget
    binding: Binding

    @property
    def action(self) -> str:
        """Return the name of the action, without what it is given."""
        return parse(self.binding.action)[1]

    @property
    def key(self) -> str:
        """Return what the screen calls the key."""
        return format_key(self.binding.key).replace("left", "←").replace("right", "→")


def pane_keys(main: MainScreen) -> Iterator[PaneKey]:
    """Yield every binding of every pane that is no mere movement of a cursor."""
    for digit, widget in _places(main):
        for binding in own_bindings(type(widget)):
            key = PaneKey(digit, widget, binding)
            if key.action not in CURSOR:
                yield key


def _places(main: MainScreen) -> Iterator[tuple[int, Widget]]:
    """Yield what has keys of its own, with the digit of its pane."""
    yield from ((1, main.instances), (2, main.block), (3, main.status), (4, main.history))
    yield from ((5, main.received), (5, main.received.data), (5, main.received.stream), (6, main.table))
    if main.peer.lines.names:
        yield 7, main.peer.lines
    if main.peer.composer.is_mounted:
        yield from ((7, main.peer), (7, main.peer.peers), (7, main.peer.composer.cut_row))
    yield 8, main.timing


def own_bindings(kind: type[DOMNode]) -> Iterator[Binding]:
    """Yield what a class of this program binds by itself, each with its first key."""
    for declared in vars(kind).get("BINDINGS", ()):
        yield next(iter(Binding.make_bindings([declared])))


def commands_of_keys(main: MainScreen) -> Iterator[SystemCommand]:
    """Yield an entry for each key of a pane."""
    for key in pane_keys(main):
        if key.action not in BY_HAND:
            about = f"pane {key.digit}, key {key.key}"
            yield SystemCommand(
                f"{PANES[key.digit]}: {key.binding.description}", about, partial(_press, main, key)
            )


async def _press(main: MainScreen, key: PaneKey) -> None:
    """Go to the pane and do what the key does there."""
    main.action_pane(key.digit)
    if key.widget.can_focus:
        main.set_focus(key.widget)
    whose, name, parameters = parse(key.binding.action)
    target = main if whose == "screen" else key.widget
    act: Callable[..., Awaitable[object] | object] = getattr(target, f"action_{name}")
    done = act(*parameters)
    if isawaitable(done):
        await done
