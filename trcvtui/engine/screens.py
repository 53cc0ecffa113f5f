"""The screens of an engine: what each of them says and asks for, and what it has to be told; all in turns.

Rule 1: none of them stops a scan. Nothing here waits, and what is taken at once does not grow with their number.
Rule 2: an answer goes to the screen that gave the line, what is told of itself to all.
Rule 3: a screen that ends, or says what no screen says, is closed; with the first one the engine ends.
"""

from __future__ import annotations

import pickle
from collections import deque
from collections.abc import Iterable, Iterator
from multiprocessing.connection import Connection as Channel
from typing import TYPE_CHECKING, Final

from msgspec.structs import replace

from trcvtui.picture.bench_update import MOST_NUMBER, BenchUpdate, UpdateRequest, unpacked
from trcvtui.picture.protocol import MOST_TABS
from trcvtui.picture.update_pipe import MessageReader, UpdatePipe
from trcvtui.snapshots.bench import Answer

if TYPE_CHECKING:
    from trcvtui.engine.trigger_watch import KeptScan
    from trcvtui.net.os.tab_door import TabDoor
    from trcvtui.project.project import Project

MOST_MESSAGES: Final = 64  # that are taken at once, of all screens
MOST_MESSAGE: Final = 4 << 20  # bytes
MOST_UNREAD: Final = 1024  # answers for one screen


class AttachedScreen:
    """One screen; `number` counts them from 0."""

    def __init__(self, channel: Channel, number: int) -> None:
        self.channel, self.number = channel, number
        self.pipe = UpdatePipe(channel)
        self._arriving = MessageReader(channel, MOST_MESSAGE)
        self.request: UpdateRequest | None = None
        self.asked_at = 0
        self.is_answered = True  # all lines that were taken have their answer in a picture
        self.answers: deque[Answer] = deque(maxlen=MOST_UNREAD)
        self.kept: KeptScan | None = None  # the scan of a trigger, which it has not been shown
        self.is_gone = False

    @property
    def waits(self) -> bool:
        """Return whether it waits for a picture, or for the rest of one."""
        return self.request is not None or self.pipe.is_busy()

    def message(self) -> tuple[int, str] | UpdateRequest | None:
        try:
            content = self._arriving.next()
            return None if content is None else unpacked(content)
        except (EOFError, OSError, ValueError):
            self.is_gone = True
            return None

    def go_on(self, until: int) -> None:
        """Write what the channel takes."""
        try:
            self.pipe.go_on(until)
        except OSError:
            self.is_gone = True


class AttachedScreens:
    """The first screen, or `serve` in its place, and the tabs that come in by the door of `serve`."""

    def __init__(self, channel: Channel, door: TabDoor | None, project: Project) -> None:
        self.first = AttachedScreen(channel, 0)
        self.all = deque([self.first])
        self._door, self._came = door, 0
        self._hello = pickle.dumps(project, pickle.HIGHEST_PROTOCOL) if door is not None else b""

    def in_turns(self) -> Iterator[AttachedScreen]:
        """Yield each one once; who was yielded is the last one the next time."""
        for _ in range(len(self.all)):
            self.all.rotate(-1)
            yield self.all[-1]

    def messages(self) -> Iterator[tuple[AttachedScreen, tuple[int, str] | UpdateRequest]]:
        """Yield what they say, at most MOST_MESSAGES; raise EOFError when the first one is gone."""
        self._let_in()
        left, is_quiet = MOST_MESSAGES, False
        while left > 0 and not is_quiet:
            is_quiet = True
            for screen in self.in_turns():
                message = screen.message()
                if message is not None:
                    left, is_quiet = left - 1, False
                    yield screen, message
        for screen in [screen for screen in self.all if screen.is_gone]:
            if screen is self.first:
                if self._door is not None:
                    self._door.remove()  # `serve` may have been killed
                raise EOFError
            self.all.remove(screen)
            screen.channel.close()

    def _let_in(self) -> None:
        descriptor = self._door.accept() if self._door is not None else None
        if descriptor is not None and len(self.all) <= MOST_TABS:
            self._came += 1
            tab = AttachedScreen(Channel(descriptor), self._came)
            tab.pipe.post(self._hello)
            self.all.append(tab)
        elif descriptor is not None:
            Channel(descriptor).close()

    def line_number(self, screen: AttachedScreen, number: int) -> int:
        """Return the number of a line among those of all screens."""
        return screen.number * MOST_NUMBER + number

    def hand_out(self, answers: Iterable[Answer]) -> None:
        for answer in answers:
            of, number = divmod(answer.number, MOST_NUMBER)
            for screen in self.all:
                if screen.number == of or not answer.number:
                    screen.answers.append(replace(answer, number=number))

    def hand_out_kept(self, kept: KeptScan | None) -> None:
        for screen in self.all if kept is not None else ():
            screen.kept = kept

    def forget_kept(self) -> None:
        """Forget what was kept: there is a fresh bench."""
        for screen in self.all:
            screen.kept = None

    def own(self, picture: BenchUpdate, screen: AttachedScreen) -> BenchUpdate:
        """Return a picture with the answers that are for this screen."""
        self.hand_out(picture.answers)
        answers = tuple(screen.answers)
        screen.answers.clear()
        if picture.fired is not None:
            screen.kept = None
        return replace(picture, answers=answers, tabs=len(self.all) - 1)

