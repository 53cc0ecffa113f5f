"""The screens of an engine: their lines and requests, and the answers for them.

Rule 1: no screen stops a scan: nothing here waits, and all screens share one limit of messages.
Rule 2: an answer goes to the screen that sent the line; a message that answers no line goes to all screens.
Rule 3: a screen that ends or sends an invalid message is closed. If it is the first, the engine ends.
"""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Iterable, Iterator
from multiprocessing.connection import Connection as Channel
from typing import TYPE_CHECKING, Final

from msgspec import MsgspecError
from msgspec.structs import replace

from trcvtui import clock
from trcvtui.picture.bench_update import MOST_NUMBER, UpdateRequest, decode_request
from trcvtui.picture.protocol import MOST_TABS, READ_ONLY, reads_only
from trcvtui.picture.update_pipe import MOST_PICTURE, MessageReader, UpdatePipe
from trcvtui.snapshots.bench import LineAnswer

if TYPE_CHECKING:
    from trcvtui.engine.trigger_watch import FrozenScan
    from trcvtui.net.os.tab_listener import TabListener
    from trcvtui.project.project import Project

MOST_MESSAGES: Final = 64  # that are taken at once, of all screens together
MOST_MESSAGE_BYTES: Final = 4 << 20  # bytes, of a tab
MOST_UNREAD_ANSWERS: Final = 1024  # answers
MOST_ECHO_CHARS: Final = 1 << 18  # characters of the line in one
FIRST_MAKE_NS: Final = 2_000_000  # the first picture of a tab brings all that is kept


class AttachedScreen:
    """One screen. The first screen has `number` 0. The number of each line is unique among all screens."""

    def __init__(self, channel: Channel, number: int) -> None:
        self.channel, self.number = channel, number
        self.pipe, self._reader = (
            UpdatePipe(channel),
            MessageReader(channel, MOST_MESSAGE_BYTES if number else MOST_PICTURE),
        )
        self.request: UpdateRequest | None = None
        self.asked_at, self.make_ns = 0, FIRST_MAKE_NS if number else 0  # make_ns: for its last picture
        self.answers: list[LineAnswer] = []  # in no picture yet
        self.kept: FrozenScan | None = None  # a trigger's scan that it has not shown yet
        self.is_gone = False

    def read_message(self) -> tuple[int, str] | UpdateRequest | None:
        try:
            content = self._reader.read_message()
            got = None if content is None else decode_request(content)
        except (EOFError, OSError, ValueError, MsgspecError, RecursionError):
            got, self.is_gone = None, True  # rule 3
        return (self.number * MOST_NUMBER + got[0], got[1]) if isinstance(got, tuple) else got


class AttachedScreens:
    """The first screen, or `serve` in its place, and the tabs that connect to `serve` through `door`."""

    def __init__(self, channel: Channel, project: Project, read_only: bool, door: TabListener | None) -> None:
        self.first = AttachedScreen(channel, 0)
        self.all = deque([self.first])  # as their turns come
        self._read_only, self._door, self._came = read_only, door, 0
        self._hello = pickle.dumps(project, pickle.HIGHEST_PROTOCOL) if door is not None else b""

    def read_messages(
        self, deadline_ns: int
    ) -> Iterator[tuple[AttachedScreen, tuple[int, str] | UpdateRequest]]:
        """Yield messages until `deadline_ns`. Add and close tabs. EOFError: the first screen has ended."""
        if self._door is not None and (descriptor := self._door.accept()) is not None:
            self._came += 1
            self.all.append(tab := AttachedScreen(Channel(descriptor), self._came))
            tab.pipe.post(self._hello)
            tab.is_gone = len(self.all) - 1 > MOST_TABS  # closed below
        self.all.rotate(-1)
        for screen in tuple(self.all):
            for _ in range(MOST_MESSAGES // len(self.all)):  # rule 1
                if (message := screen.read_message()) is None:
                    break
                if self._read_only and not isinstance(message, UpdateRequest) and not reads_only(message[1]):
                    self.hand_out([LineAnswer(*message, READ_ONLY)])
                else:
                    yield screen, message
                if clock.now_ns() >= deadline_ns:
                    return  # the rest has time until the next gap
            if screen.is_gone and screen is self.first:
                if self._door is not None:
                    self._door.close()  # `serve` may have been killed
                raise EOFError
            if screen.is_gone:
                self.all.remove(screen)
                screen.channel.close()

    def hand_out(self, answers: Iterable[LineAnswer]) -> None:
        for answer in answers:
            number, own = divmod(answer.number, MOST_NUMBER)
            for screen in self.all:
                if number == screen.number or not answer.number:  # rule 2; 0: no line
                    screen.answers[:-MOST_UNREAD_ANSWERS] = []
                    screen.answers.append(replace(answer, number=own, line=answer.line[:MOST_ECHO_CHARS]))
