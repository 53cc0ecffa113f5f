"""The screen of the scenarios: a list of files, and one of them played step by step.

Rule: the engine plays. This screen sends `scenario` commands and shows the player in the newest picture.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import ClassVar, Final

from textual import events
from textual.containers import Horizontal, Vertical
from textual.widget import Widget

from trcvtui.snapshots.scenario import PlayerSnapshot
from trcvtui.tui import messages
from trcvtui.tui.formatting import clip, plain
from trcvtui.tui.messages import ScreenCallbacks
from trcvtui.tui.panes.instance_list import InstanceList
from trcvtui.tui.panes.status import StatusCard, StatusHistory
from trcvtui.tui.panes.timing import Timing
from trcvtui.tui.scenarios.panes import ScenarioList, ScenarioListModel, ScenarioText, TraceList
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import hidden_bindings
from trcvtui.tui.widgets.lines import TabLine
from trcvtui.tui.widgets.screens import TABS_CLASS, PaletteCommand, SideScreen
from trcvtui.tui.widgets.typed_lines import FilterLine
from trcvtui.wording import count

HIGH_SCREEN_ROWS: Final = 42  # from here on traces, history and timing are all visible
PLAYING_CLASS: Final = "-playing"
READ_INTERVAL_S: Final = 1 / 30
KERNELS: Final = ("sim", "live")
KERNEL_WORDS: Final = {"sim": "the simulated network", "live": "real sockets"}
LIST, STEPS, TRACES, STATUS, HISTORY, TIMING = 1, 2, 4, 5, 6, 7
PAST_PANES: Final = {TRACES, HISTORY, TIMING}  # on a lower screen they share one place
LIVE_KERNEL: Final = "live"
ENDS_LIVE_QUESTION: Final = "a scenario ends the live bench and its connections: y loads it, esc goes back"
LONGEST_LINE: Final = 60
FOOTER_KEYS: Final = (
    ("enter", "load"), ("n", "step"), ("r", "to the end"), ("k", "sim | live"),
    ("v", "all panes"), ("/", "filter"), ("1-7", "pane"), ("?", "help"), ("esc", "leave"),
)  # fmt: skip
PLAY_TABS: Final = (
    (LIST, "Scenarios"), (STEPS, "Steps"), (STATUS, "STATUS"), (HISTORY, "History"), (TIMING, "Timing"),
)  # fmt: skip
KEY_ACTIONS: Final = {
    "enter": "load", "n": "step", "r": "run", "k": "kernel", "/": "filter", "?": "help",
    "v": "panes", "esc": "leave",
}  # fmt: skip


class ScenariosScreen(SideScreen[Path | None]):
    """The list of scenarios, and the text and progress of one; the screen returns the last chosen file."""

    BINDINGS: ClassVar = hidden_bindings({
        **{str(digit): f"pane({digit})" for digit in range(1, 8)},
        "enter": "load", "n,space": "step", "r": "run", "k": "kernel", "v": "panes", "y": "sure",
        "slash": "filter", "escape,q,S,f2": "leave",
    })  # fmt: skip
    CSS_PATH = "scenarios.tcss"
    LEAST_SIZE = 110, 30

    def __init__(
        self,
        view_model: ViewModel,
        say: Callable[[str], int | None],
        model: ScenarioListModel,
        loaded: Path | None = None,
    ) -> None:
        super().__init__(view_model, say, FOOTER_KEYS, KEY_ACTIONS)
        self._model = model
        self._kernel = KERNELS[0]
        self._loaded = loaded  # set at once, before the engine answers
        self._question: Callable[[], None] | None = None  # `y` runs it and ends the live bench
        self.keeps_the_play = False  # `v`: the main screen shows the loaded scenario
        self._bench = view_model.bench
        self._trouble = ""
        self._open = STEPS if loaded is not None else LIST
        self._past = TRACES
        self.list = ScenarioList(model)
        self.text = ScenarioText(model)
        self.instances = InstanceList(view_model, self.reset_for_selected, digit=3)
        self.traces = TraceList(view_model)
        actions = ScreenCallbacks(self._refuse_prompt, self._refuse_prompt, self._show_error)
        self.status = StatusCard(view_model, actions, STATUS)
        self.history = StatusHistory(view_model, actions, HISTORY)
        self.timing = Timing(view_model, actions, TIMING)
        self.tabs = TabLine(PLAY_TABS[:2], LIST)
        self.filter = FilterLine(self._set_filter, self.list.action_move, self.list)
        self._left = Vertical(id="left")
        self._play = Vertical(id="play")

    def compose(self) -> Iterator[Widget]:
        yield self.header
        yield self.tabs
        with Horizontal(id="stage"):
            with self._left:
                yield self.list
                yield self.status
            with self._play:
                yield from (self.text, self.instances, self.traces, self.history, self.timing)
        yield from (self.outcome, self.filter, self.key_line)

    def on_mount(self) -> None:
        self.set_focus(self.list if self._open == LIST else self.text)
        self.set_interval(READ_INTERVAL_S, self._read_next_files)
        self._read_next_files()

    def _read_next_files(self) -> None:
        if not self._model.is_read:
            self._model.read_next_files()
            self.show()

    # -- what is shown ------------------------------------------------------------------------------

    @property
    def _player(self) -> PlayerSnapshot | None:
        """Return the player of the loaded scenario; None until the first picture with this player."""
        player = self._view_model.picture.player if self._view_model.picture else None
        return player if player is not None and player.path == str(self._loaded) else None

    def show(self) -> None:
        self._read_answers()
        player = self._player
        if player is not None and player.finished and self._loaded is not None:
            self._note_outcome(self._loaded, not player.failed_steps)
        self._update_play_state(player is not None)
        self.header.show()
        self.list.show()
        self.text.show_player(player, self._kernel_shown(player))
        if player is not None:
            self.traces.show_player(player)
            for pane in (self.instances, self.status, self.history, self.timing):
                pane.show()
        self._show_outcome(player)
        self.show_keys()

    def _update_play_state(self, plays: bool) -> None:
        if self._bench != self._view_model.bench:
            self._bench = self._view_model.bench
            self.reset_for_selected()
        if plays != self.has_class(PLAYING_CLASS):
            self.set_class(plays, PLAYING_CLASS)
            self.arrange_panes()

    def _kernel_shown(self, player: PlayerSnapshot | None) -> str:
        picture = self._view_model.picture
        return picture.kernel if player is not None and picture is not None else self._kernel

    def _read_answers(self) -> None:
        for answer in self.take_answers():
            if answer.error and not self._trouble:
                self._trouble = answer.error
                if answer.line.startswith("scenario load"):
                    self._loaded = None

    def _note_outcome(self, path: Path, held: bool) -> None:
        if self._model.outcomes.get(path) is not held:
            self._model.outcomes[path] = held
            self._model.revision += 1

    def _show_outcome(self, player: PlayerSnapshot | None) -> None:
        if self._question is not None:
            self.outcome.write(f"? {ENDS_LIVE_QUESTION}", "warn")
        elif self._trouble:
            self.outcome.write(f"✗ {self._trouble}", "error")
        elif player is None:
            self.outcome.write(
                f"enter loads it on {KERNEL_WORDS[self._kernel]}; k: on {KERNEL_WORDS[self._other_kernel()]}"
            )
        else:
            self.outcome.write(*_describe_outcome(player))

    def _other_kernel(self) -> str:
        return KERNELS[1 - KERNELS.index(self._kernel)]

    # -- what the panes say -------------------------------------------------------------------------

    def on_scenario_chosen(self) -> None:
        self._trouble, self._question = "", None
        self.show()

    def reset_for_selected(self) -> None:
        self.history.clear_history()
        self.timing.reset_cursor()
        self.status.explain_at(None)
        if self.is_mounted and self._bench == self._view_model.bench:
            self.call_after_refresh(self.show)

    def on_edge_selected(self, message: messages.EdgeSelected) -> None:
        line = message.line
        self.status.explain_at(line)
        self.history.choose_edge(message.seq)
        self.timing.show_scan(line.scan if line else None, message.seq)

    def on_descendant_focus(self, event: events.DescendantFocus) -> None:
        panes: dict[int, Widget] = {STATUS: self.status, HISTORY: self.history, TIMING: self.timing}
        own = next((digit for digit, pane in panes.items() if pane is event.widget), None)
        if event.widget in (self.list, self.filter):
            self._open = LIST
        elif own is not None or event.widget in self._play.query("*"):
            self._open = own or STEPS
        if event.widget is self.traces or own in PAST_PANES:
            self._past = own or TRACES
        self.arrange_panes()
        self.show()

    def arrange_panes(self) -> None:
        alone, plays = self.has_class(TABS_CLASS), self.has_class(PLAYING_CLASS)
        steps = self._open == STEPS or not alone
        self.traces.tail = 2 if alone else 4
        self._left.display = not alone or self._open in (LIST, STATUS)
        self._play.display = not alone or self._open not in (LIST, STATUS)
        self.list.display = not alone or self._open == LIST
        self.status.display = plays and (not alone or self._open == STATUS)
        self.text.display, self.instances.display = steps, plays and steps
        past = PAST_PANES if self.size.height >= HIGH_SCREEN_ROWS and not alone else {self._past}
        self.traces.display = plays and steps and (alone or TRACES in past)
        self.history.display = plays and (self._open == HISTORY if alone else HISTORY in past)
        self.timing.display = plays and (self._open == TIMING if alone else TIMING in past)
        self.tabs.set_tabs(PLAY_TABS if plays else PLAY_TABS[:2])
        self.tabs.mark_open(self._open)

    def _set_filter(self, words: str) -> None:
        self._model.set_filter(words)
        self.show()

    # -- actions ------------------------------------------------------------------------------------

    def action_pane(self, digit: int) -> None:
        panes: dict[int, Widget] = {
            LIST: self.list,
            STEPS: self.text,
            3: self.instances,
            TRACES: self.traces,
            STATUS: self.status,
            HISTORY: self.history,
            TIMING: self.timing,
        }
        if digit > STEPS and self._player is None:
            return
        self._open = digit if digit in dict(PLAY_TABS) else STEPS
        self._past = digit if digit in PAST_PANES else self._past
        self.arrange_panes()
        self.set_focus(panes[digit])

    def action_filter(self) -> None:
        self.action_pane(LIST)
        self.filter.open()

    def action_kernel(self) -> None:
        self._kernel = self._other_kernel()
        self._trouble = ""
        self.show()
        self._question = None
        if self._loaded is not None:
            self.outcome.write(f"enter loads it again, on {KERNEL_WORDS[self._kernel]}")

    def _ask_on_live(self, then: Callable[[], None]) -> None:
        """Call `then`, but ask first if the call would end a live bench."""
        picture = self._view_model.live
        is_live = picture is not None and picture.player is None and picture.kernel == LIVE_KERNEL
        if self._loaded is None and is_live and self._model.chosen is not None:
            self._trouble, self._question = "", then
            self.show()
        else:
            then()

    def action_sure(self) -> None:
        then, self._question = self._question, None
        if then is not None:
            then()

    def action_load(self) -> None:
        self._ask_on_live(self._load)

    def _load(self) -> None:
        path, self._trouble = self._model.chosen, ""
        file = self._model.read(path) if path is not None else None
        if path is None or file is None:
            return
        if file.problem:
            self._trouble = file.problem
            self.show()
            return
        self._loaded = path
        self._send(f"load {path} {self._kernel}")
        self.action_pane(STEPS)

    def action_step(self) -> None:
        """Run the next step of the chosen scenario; if the scenario is not loaded, only load it."""
        if self._is_loaded():
            self._send("step")
        else:
            self.action_load()

    def action_run(self) -> None:
        """Run all remaining steps of the chosen scenario. Load the scenario first if needed."""
        self._ask_on_live(self._run)

    def _run(self) -> None:
        if not self._is_loaded():
            self._load()
        if self._is_loaded():
            self._send("run")

    def _is_loaded(self) -> bool:
        return self._loaded is not None and self._loaded == self._model.chosen

    def _send(self, words: str) -> None:
        self._trouble = ""
        self.send(f"scenario {words}")

    def _refuse_prompt(self, *lines: str) -> None:
        self._show_error("no prompt here: v shows the scenario in all panes, with a prompt")

    def _show_error(self, text: str) -> None:
        self._trouble = text
        self.show()

    def action_panes(self) -> None:
        if self._player is None:
            self._show_error("no scenario is loaded: enter loads the chosen one")
            return
        self.keeps_the_play = True
        self.dismiss(self._loaded)

    def action_leave(self) -> None:
        if self._loaded is not None or self._player is not None:
            self._say("scenario stop")
        self.dismiss(self._model.chosen)

    def palette_rows(self) -> Iterator[PaletteCommand]:
        yield "Load the scenario", "on a fresh bench · key enter", "load"
        yield "Next step", "key n", "step"
        yield "Run to the end", "key r", "run"
        yield f"Load on {KERNEL_WORDS[self._other_kernel()]}", "with the next enter · key k", "kernel"
        yield "All panes", "the loaded scenario in all panes; S returns here · key v", "panes"
        yield "Filter the scenarios", "key /", "filter"
        yield "Leave the scenarios", "the project starts again · key esc", "leave"
        yield "Help", "key ?", "help"


def _describe_outcome(player: PlayerSnapshot) -> tuple[str, str]:
    failed, steps = player.failed_steps, player.steps
    if player.finished:
        if not failed:
            return f"✓ passed: all {count(len(steps), 'step')}", "done"
        ended = "; a failed wait ends a scenario" if player.current < len(steps) else ""
        return f"✗ FAILED: {len(failed)} of {count(len(steps), 'step')}{ended}", "error"
    line = clip(plain(steps[player.current].line), LONGEST_LINE)
    if player.running:
        return f"▶ {line}: {count(player.scans_of_step, 'scan')} so far", "busy"
    so_far = f"✗ {count(len(failed), 'step')} failed so far · " if failed else ""
    return f"{so_far}n: {line}", "warn" if failed else "dim"
