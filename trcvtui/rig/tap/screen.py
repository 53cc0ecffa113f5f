"""A tap on the screen: who looks on serves a screen; the screen is a child of the process that forwards.

Rule: the tap forwards whatever becomes of these two. All is let go when one of them is gone.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from multiprocessing.connection import Connection as Channel
from pathlib import Path
from typing import Any

from trcvtui.rig.engine.driver import EngineDriver
from trcvtui.rig.watch.live_screen import ServedShadows, serve_live

Asked = tuple[list[list[str]], str | None, str | None, str | None]


class TapDriver(EngineDriver):
    """Shadows of a tap in a process of its own, which gets the events of the tap over `events`."""

    def __init__(self, events: Channel, asked: Asked) -> None:
        self._events, self._asked_of = events, asked
        super().__init__(Path("tap"), "tap")

    def _program(self) -> tuple[Callable[..., None], tuple[Any, ...]]:
        return tap_main, (self._events, self._asked_of)

    def _start(self) -> None:
        super()._start()
        self._events.close()  # its end is the end of who looks on


def tap_main(channel: Channel, events: Channel, asked: Asked) -> None:
    """Serve the screen with what the tap tells."""
    serve_live(channel, lambda: _TapServed(channel).run(events.fileno(), asked))


class _TapServed(ServedShadows):
    """Shadows on the conversations of a tap."""

    def run(self, fd: int, asked: Asked) -> None:
        """Play what the tap tells; when it is gone, go on showing what there was."""
        from trcvtui.net.tap import events_of, route_of
        from trcvtui.rig.tap.looking import LookingOn, TapPlan

        places, project, plc, dialect = asked
        routes = [route_of(name, listen, to, ("LISTEN", "CONNECT")) for name, listen, to in places]
        plan = TapPlan(routes, None if project is None else Path(project), plc, dialect)
        order = lambda given: os.write(fd, given.line())  # noqa: E731
        looking = LookingOn(plan, lambda ns: self, order, lambda text: self.tell("tap", text))
        self.show(looking.player, "tap")
        os.write(fd, b"\n")
        for events in events_of(lambda most: os.read(fd, most)):
            for event in events:
                looking.take(event)
            self.serve()
        self.go_on("the tap has ended")
