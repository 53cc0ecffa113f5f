"""A tap on the screen: its observer serves a screen, which is a child of the process that forwards.

Rule: the tap forwards whatever becomes of these two. All is let go when one of them is gone.
"""

from __future__ import annotations

import os
from contextlib import suppress
from multiprocessing.connection import Connection as Channel
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from trcvtui.engine.driver import ProcessDriver
from trcvtui.line.live_screen import ServedShadows
from trcvtui.net.os.tap_ways import ask_for_way, ask_what_is_open
from trcvtui.picture.protocol import EngineStopped
from trcvtui.replay.driver import serve_until_gone
from trcvtui.snapshots.conversations import TAP

if TYPE_CHECKING:
    from trcvtui.line.capture_player import ShadowLines
    from trcvtui.net.tap import TapOrder
    from trcvtui.picture.bench_update import BenchUpdate

OVER: Final = "the tap has ended"
TapChoice = tuple[list[list[str]], str | None, str | None, str | None]


class TapEnded(EngineStopped):
    """The tap was killed: the terminal belongs to the shell again, which reads the keys."""

    ends_screen = True


class TapDriver(ProcessDriver):
    """Shadows of a tap in a process of its own; each time it starts, the tap hands over a way for events.

    `kernel`: TAP, or ARMED_TAP for a screen whose keys act without a question.
    """

    def __init__(self, tap: int, asked: TapChoice, kernel: str = TAP) -> None:
        self._tap = tap
        super().__init__(tap_main, asked, kernel)

    def _arguments(self) -> tuple[Any, ...]:
        self._events = Channel(ask_for_way(self._tap))
        return self._events, *self._asked

    def picture(self) -> BenchUpdate | None:
        """Return the newest picture that has arrived; raise TapEnded."""
        picture = super().picture()
        if picture is not None and picture.over:
            raise TapEnded(f"{picture.over}: both ends have seen an end")
        return picture

    def cuts(self) -> str:
        return ask_what_is_open(self._tap)

    def _start(self) -> None:
        super()._start()
        self._events.close()  # its end is the end of the observer


def tap_main(channel: Channel, events: Channel, asked: TapChoice, kernel: str) -> None:
    serve_until_gone(channel, lambda: _TapServed(channel).run(events.fileno(), asked, kernel))


class _TapServed(ServedShadows):
    def _complain(self, text: str) -> None:
        self.tell("tap", text)
        if self._controller is not None:
            self._controller.complain(text)

    def run(self, fd: int, asked: TapChoice, kernel: str) -> None:
        from trcvtui.capture.pcap import RAW_IP, RTAC_SERIAL, Packet
        from trcvtui.diagnosis.judges import FilesJudge
        from trcvtui.line.live import KeptPackets
        from trcvtui.line.tap_observer import TapObserver, asked_plan
        from trcvtui.line.tapped import TapPackets
        from trcvtui.net.tap import events_of

        places, project, plc, dialect = asked
        plan = asked_plan(places, project, plc, dialect)
        to = plan.routes[0].to

        def order(given: TapOrder) -> None:
            with suppress(OSError):  # the tap has ended: soon it is said
                os.write(fd, given.line())

        def lines_of(first_ns: int) -> ShadowLines:
            judge.begins_ns = first_ns or None
            return self

        kept, packets = KeptPackets(), TapPackets()
        kept.interfaces = lambda: [(RAW_IP, "tap"), *((RTAC_SERIAL, name) for name in packets.lines)]
        end = plc or (str(to).removeprefix("udp:") if len(places) == 1 else None)
        end = None if to.kind == "serial" else end
        self.judge = judge = FilesJudge(kept.files, end, None if project is None else Path(project), True)
        looking = TapObserver(plan, lines_of, order, self._complain)
        self.show(looking.player, kernel)
        with suppress(OSError):
            os.write(fd, b"\n")
            for events in events_of(lambda most: os.read(fd, most)):
                for event in events:
                    for interface, ns, data, remarks in packets.of(event):
                        kept.keep(Packet(ns, interface, data, len(data), remarks, 0))
                    looking.take(event)
                self.serve()
        looking.end_all()
        self.go_on("tap", OVER)
