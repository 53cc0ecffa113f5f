"""The base of the screens that fill the terminal: header, keys, help, answers, the palette."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import ClassVar, Final, Generic, TypeVar

from textual import events
from textual.app import SystemCommand
from textual.binding import Binding
from textual.screen import Screen

from trcvtui.snapshots.bench import LineAnswer
from trcvtui.tui import messages
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import LineView
from trcvtui.tui.widgets.lines import HeaderLine, KeyLine, Keys, OutcomeLine

Result = TypeVar("Result")
TABS_CLASS: Final = "-tabs"  # of a screen that is too small for all of its panes
PaletteCommand = tuple[str, str, str]  # title, description, action


class FullScreen(Screen[Result], Generic[Result]):
    """A screen with a header above and a line of keys below; a click on a key or a tab acts as the key."""

    def __init__(self, view_model: ViewModel, key_line: KeyLine) -> None:
        super().__init__()
        self._view_model = view_model
        self.header = HeaderLine(view_model)
        self.key_line = key_line

    async def on_key_clicked(self, message: messages.KeyClicked) -> None:
        await self.run_action(message.action)

    def action_help(self) -> None:
        from trcvtui.tui.widgets.help import HelpScreen  # imported on first use

        self.app.push_screen(HelpScreen(self._view_model, self.focused))


class SideScreen(FullScreen[Result], Generic[Result]):
    """A screen beside the bench, with an outcome line. The screen sends commands and shows the answers.

    Below `LEAST_SIZE`, in columns and rows, the CSS class `-tabs` shows one pane at a time.
    """

    BINDINGS: ClassVar = [Binding("question_mark,f1", "help", show=False)]
    LEAST_SIZE: ClassVar[tuple[int, int]] = (0, 0)

    def __init__(
        self, view_model: ViewModel, say: Callable[[str], int | None], keys: Keys, actions: Mapping[str, str]
    ) -> None:
        super().__init__(view_model, KeyLine(keys, actions))
        self._say = say
        self._asked: set[int] = set()
        self.outcome = OutcomeLine()

    def show(self) -> None:
        raise NotImplementedError

    def arrange_panes(self) -> None:
        """Show all panes, or only the pane of the open tab."""

    def on_resize(self, event: events.Resize) -> None:
        width, height = self.LEAST_SIZE
        self.set_class(event.size.width < width or event.size.height < height, TABS_CLASS)
        self.arrange_panes()
        self.call_after_refresh(self.show)

    def send(self, line: str) -> bool:
        """Send a line to the engine; its answer comes by `answers`. Return whether the line is sent."""
        number = self._say(line)
        if number is not None:
            self._asked.add(number)
        return number is not None

    def take_answers(self) -> Iterator[LineAnswer]:
        for number, answer in self._view_model.answers.items():
            if number in self._asked:
                self._asked.discard(number)
                yield answer

    def show_keys(self, more: Keys = ()) -> None:
        own = self.focused.keys() if isinstance(self.focused, LineView) else ()
        self.key_line.show_keys((*more, *own), holding=False)

    def palette_rows(self) -> Iterator[PaletteCommand]:
        raise NotImplementedError

    def commands(self) -> Iterator[SystemCommand]:
        for title, about, action in self.palette_rows():
            yield SystemCommand(title, about, partial(self._start_action, action))

    def _start_action(self, action: str) -> None:
        self.run_worker(self.run_action(action))
