"""The screen on a bench: pictures in, bench commands out. The screen has no logic of its own."""

from __future__ import annotations

import sys
from asyncio import to_thread
from collections.abc import Iterable
from functools import partial
from math import inf
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, ClassVar, Final

from textual import events
from textual.app import SystemCommand
from textual.binding import Binding
from textual.screen import Screen
from textual.widget import AwaitMount

from trcvtui.files import refuse_files
from trcvtui.picture.bench_update import UNSAVED_COMMANDS, BenchUpdate, restoring_commands
from trcvtui.picture.protocol import READ_ONLY, BenchDriver, EngineStopped, reads_only
from trcvtui.project.project import Project
from trcvtui.tui.formatting import plain
from trcvtui.tui.lab import LAB, is_for_lab
from trcvtui.tui.main import SCENARIOS_LINE, MainScreen
from trcvtui.tui.messages import CurveWanted
from trcvtui.tui.settings import ScreenSettings, load_settings
from trcvtui.tui.terminal_app import TerminalApp
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.dialogs import QuitTapScreen
from trcvtui.tui.widgets.theme import OWN_THEMES
from trcvtui.wording import count

if TYPE_CHECKING:
    from trcvtui.tui.curve import CurveScreen
    from trcvtui.tui.doctor import DoctorScreen, DoctorTarget
    from trcvtui.tui.framings import FramingScreen
    from trcvtui.tui.lab.lab import Lab
    from trcvtui.tui.lab.screen import LabScreen
    from trcvtui.tui.scenarios.screen import ScenariosScreen

FRAME_S: Final = 1 / 20
REST_FRAME_S: Final = 1 / 8  # while no key, paste or mouse event comes
ACTIVE_S: Final = 1.0  # after one of these
MOST_ADD_WAIT_S: Final = 1.0  # keys wait so long for what the form adds; held scans may add it later
ENGINE_ENDED_EXIT: Final = 1
DETACHED_EXIT: Final = 3  # the screen of a tap ends; the tap keeps forwarding


# A read-only screen may do only what this function and `reads_only` allow, so a new command or screen is
# refused by default. `files.refuse_files` also refuses each file that this process or its engine opens.


def is_read_only(screen: object) -> bool:
    """Return whether a read-only app may open this screen: it only displays, and it opens no file."""
    from textual.command import CommandPalette

    from trcvtui.tui.curve import CurveScreen
    from trcvtui.tui.forms.description import DescriptionScreen
    from trcvtui.tui.widgets.help import HelpScreen

    return isinstance(screen, MainScreen | HelpScreen | DescriptionScreen | CurveScreen | CommandPalette)


class BenchApp(TerminalApp):
    """Shows the newest picture and asks for the next: 20 times a second, 8 times while the bench rests."""

    BINDINGS: ClassVar = [
        Binding("P", "picture", show=False, id="picture"),
        Binding("X", "dropped", show=False, id="dropped"),
        Binding("B", "framings", show=False, id="framings"),
        Binding("J", "doctor", show=False, id="doctor"),
        Binding("C", "description", show=False, id="description"),
    ]

    def __init__(
        self,
        driver: BenchDriver,
        project: Project,
        settings: ScreenSettings | None = None,
        read_only: bool = False,
        replay: bool = False,
    ) -> None:
        super().__init__(settings or ScreenSettings())
        self.only_looks = read_only
        self._engine = driver
        self._home = project.path
        self.view_model = ViewModel(project)
        self._is_replay = replay
        self.main = _replay_screen(self) if replay else MainScreen(self.view_model, self.submit)
        self.scenarios: ScenariosScreen | None = None  # None: closed
        self._scenario: Path | None = None  # the last choice
        self.lab: LabScreen | None = None  # None: closed
        self.card: FramingScreen | DoctorScreen | CurveScreen | None = None  # the open one shows pictures
        self._lab: Lab | None = None  # its choices outlive the screen
        self.last_words = ""
        self.remembers = False  # put the project into the list of recent ones
        self._engines, self._starts = 1, False  # engines started so far; the last one has sent no picture yet
        self._edits: list[str] = []  # lines that have changed the project: a new engine gets them again
        self._again: tuple[str, ...] = ()  # lines that restore the bench on a new engine
        self._warned: tuple[int, object] = 0, 0  # number of the key that caused a warning, and its subject
        self._worked_at = monotonic()  # the last key, paste or mouse event
        self._due_at = 0.0  # the next request at rest
        self._before: BenchUpdate | None = None  # the newest picture at the last request
        self._addition: tuple[str, str, float] | None = None  # kind, name, deadline of the waiting keys

    def on_mount(self) -> None:
        # Not as the default screen: an input field in it fails at start (Textual issue 6444).
        self.set_up_terminal()
        self.push_screen(self.main)
        self._refresh_picture()
        self.set_interval(FRAME_S, self._tick)
        self.call_after_refresh(self.finish_start)

    async def mount_fields(self) -> None:
        await self.main.mount_fields()

    def show_start_message(self) -> None:
        if self.remembers:
            from trcvtui.tui.recent_projects import remember_project  # after the first frame

            self.run_worker(to_thread(remember_project, self._home))
        if self.only_looks:
            self.main.prompt.inform("read-only: this screen shows the bench and sends no commands")
        if self.problems:
            first, *more = self.problems
            self.main.prompt.show_error(first + (f" (and {len(more)} more: ? lists all)" if more else ""))

    def end_children(self, is_dead: bool) -> None:
        if is_dead:
            self._engine.close()

    # -- pictures and lines -------------------------------------------------------------------------

    def _tick(self) -> None:
        """Show a new picture; ask for the next one, less often while the bench rests."""
        now = monotonic()
        is_due = now >= self._due_at or self._needs_each_frame(now)
        self._refresh_picture(is_due)
        if is_due and self.view_model.live is not self._before:
            self._before = self.view_model.live
            self._due_at = max(now - FRAME_S, min(now, self._due_at)) + REST_FRAME_S  # 8 a second on average

    def _needs_each_frame(self, now: float) -> bool:
        """Return whether each frame asks for a picture; only the main screen on a bench may rest."""
        may_rest = self.screen_stack[-1:] == [self.main] and self._is_on_a_bench
        is_slow = self.main.prompt.is_waiting or self.view_model.known_messages.is_behind
        return now < self._worked_at + ACTIVE_S or not may_rest or is_slow

    @property
    def _is_on_a_bench(self) -> bool:
        picture = self.view_model.live
        return picture is not None and picture.kernel in ("sim", "live") and picture.player is None

    async def on_event(self, event: events.Event) -> None:
        await super().on_event(event)
        if isinstance(event, events.Key | events.Paste | events.MouseEvent):
            if not self._needs_each_frame(monotonic()):  # do not wait for the slow frame of a bench at rest
                self.call_later(self._refresh_picture)
            self._worked_at = monotonic()

    def _refresh_picture(self, asks: bool = True) -> None:
        if self.last_words:
            return
        try:
            picture = self._engine.poll_picture()
            before, unsaved = self.view_model.bench, self.view_model.unsaved_count
            if picture is not None:
                self.view_model.accept_picture(picture)
                self._edits += [answer.edit for answer in picture.answers if answer.edit]
            if unsaved and not self.view_model.unsaved_count:  # a new engine reads them in the saved file
                self._edits = [line for line in self._edits if line.startswith(UNSAVED_COMMANDS)]
            if asks:
                self._engine.request(
                    self.view_model.make_request()
                )  # the engine packs it while this one is drawn
            if picture is not None:
                if self._starts:
                    self.main.prompt.inform(f"engine {self._engines} runs")
                self._show_picture(before)
                self._select_addition()
                self._resume_keys()
        except EngineStopped as stopped:
            if stopped.ends_screen:
                self.exit(return_code=1, message=str(stopped))
            else:
                self._handle_engine_end(stopped)

    def _resume_keys(self) -> None:
        if self._starts:
            self._starts = False
            self.call_after_refresh(self.process_kept_keys)

    def _show_picture(self, before: int) -> None:
        if self.card is not None:
            self.card.show()
        above = self.scenarios or self.lab
        if above is not None:
            if above.is_mounted:
                above.show()
        elif self.main.is_mounted:
            if self.view_model.bench != before:
                self.main.forget_bench()
            if len(self.screen_stack) > 1 and self.screen is not self.main:
                self.main.show_soon()
            else:
                self.main.show()

    def submit(self, line: str) -> None:
        """Carry out a line of this screen, or send a bench command to the engine if the engine runs."""
        if self.only_looks and not reads_only(line):
            self.main.prompt.show_result(line, "", READ_ONLY)
            return
        if self._is_replay and line == SCENARIOS_LINE:
            self._show_refusal()
            return
        if is_for_lab(line):
            self._open_lab(line)
            return
        if line == SCENARIOS_LINE:
            self._open_scenarios()
            return
        if self.main.run_own_line(line):
            return
        number = self._send_line(line)
        if number is not None:
            self.main.prompt.show_sent_line(line, number)

    def push_screen(self, screen: Any, *how: Any, **more: Any) -> Any:
        """Open a screen; a read-only app refuses most, a replay refuses screens that change the bench."""
        if (self.only_looks and not is_read_only(screen)) or (self._is_replay and not _is_for_replay(screen)):
            self._show_refusal()
            return AwaitMount(self.screen, [])
        return super().push_screen(screen, *how, **more)

    def refuses(self) -> bool:
        """Return whether this app is read-only; if so, show that the action is refused."""
        if self.only_looks:
            self._show_refusal()
        return self.only_looks

    def _show_refusal(self) -> None:
        text = READ_ONLY
        if self._is_replay:
            from trcvtui.snapshots.replay import CANNOT_CHANGE_TEXT as text
        (self.main.prompt.show_error if self.screen is self.main else self._notify)(text)

    def _send_line(self, line: str) -> int | None:
        if self.only_looks and not reads_only(line):
            self._show_refusal()
            return None
        if not self.last_words:
            try:
                return self._engine.submit(line)
            except EngineStopped as stopped:
                self._handle_engine_end(stopped)
        return None

    def _handle_engine_end(self, stopped: EngineStopped) -> None:
        self.last_words = words = str(stopped).strip() or "the engine has ended"
        why = words.splitlines()[-1]
        if stopped.is_internal:
            from trcvtui.bench.error_report import write_report  # read when first needed

            view = self.view_model
            report = write_report(words, view.project, [*view.lines], stopped.folder)
            why, self.last_words = f"{why}; {report}", f"{words}\n{report}"
        if self.scenarios is not None:
            self.scenarios.dismiss(None)
        if self.lab is not None and self.screen is self.lab:
            self.lab.dismiss()
        way = "" if self.only_looks else "R restarts the engine, "
        self.main.show_end(
            f"{why}; {'a new tab starts an engine, ' if self._engine.is_shared else way}q quits"
        )
        self._select_addition()
        self._resume_keys()

    def action_restart(self) -> None:
        """If the engine has ended, restart the engine. Else record the run, or stop recording."""
        if self.screen is not self.main:
            return
        if self.only_looks:
            self.main.prompt.show_error(READ_ONLY)
            return
        picture = self.view_model.live
        is_recording = picture is not None and picture.is_recording
        if not self.last_words:
            text = f"R once more {'ends the recording' if is_recording else 'records the run'}, for all tabs"
            if not self._engine.is_shared or self._confirm_or_warn("R", text):
                self.submit("record stop" if is_recording else "record")
            return
        if self._engine.is_shared:
            self.exit()  # the page has a button for a new session
            return
        self.last_words = ""
        self._engines, self._starts = self._engines + 1, True
        self._keeps_keys = True  # until `process_kept_keys`
        self._engine.restart()
        if picture is not None:  # None: the new engine ended before its first picture, so its lines are kept
            self._again = ()
        if picture is not None and self._is_on_a_bench:
            self._again = *self._edits, *restoring_commands(picture.snapshot, self.view_model.project)
        for line in self._again:
            self._engine.submit(line)
        self.view_model.forget_all()
        self.main.show_restart()

    # -- scenarios ----------------------------------------------------------------------------------

    def _open_scenarios(self) -> None:
        from trcvtui.scenario.scenario import find_files  # read when first asked for
        from trcvtui.tui.scenarios.panes import ScenarioListModel
        from trcvtui.tui.scenarios.screen import ScenariosScreen

        if self.scenarios is None and not self.last_words:
            player = self.view_model.picture.player if self.view_model.picture is not None else None
            loaded = Path(player.path) if player is not None else None
            model = ScenarioListModel(find_files(self._home), loaded or self._scenario)
            self.scenarios = ScenariosScreen(self.view_model, self._send_line, model, loaded)
            self.push_screen(self.scenarios, self._handle_scenarios_closed)

    def _handle_scenarios_closed(self, chosen: Path | None) -> None:
        keeps = self.scenarios is not None and self.scenarios.keeps_the_play
        self.scenarios = None
        self._scenario = chosen or self._scenario
        if keeps:
            self.main.forget_bench()
        elif self.view_model.picture is not None and self.view_model.picture.player is not None:
            self.view_model.leave_scenario()
            self.main.forget_bench()
        self.main.show()

    # -- the lab ------------------------------------------------------------------------------------

    def action_lab(self) -> None:
        self.submit(LAB)

    def _open_lab(self, line: str) -> None:
        from trcvtui.tui.lab.lab import Lab  # read when first asked for
        from trcvtui.tui.lab.screen import LabScreen

        if self.lab is not None or self.scenarios is not None or self.last_words:
            return
        self._lab = self._lab or Lab(self.view_model)
        self._lab.choose_initial()
        self.lab = LabScreen(self.view_model, self._lab, self._send_line)
        self.push_screen(self.lab, self._handle_lab_closed)
        if line.split()[1:]:
            self.call_later(self.lab.run_line, line)

    def _handle_lab_closed(self, nothing: None) -> None:
        self.lab = None
        self.main.show()

    async def action_press_from_afar(self, key: str, missing: str = "") -> None:
        from trcvtui.tui.palette import press_other_pane_key  # read when first asked for

        await press_other_pane_key(self.main, key, missing)

    def action_description(self) -> None:
        from trcvtui.tui.forms.description import DescriptionScreen  # read when first asked for

        if self.screen is not self.main:
            return
        configs = [each for each in self.view_model.project.connects if each.description is not None]
        instance = self.view_model.instance
        if configs and instance is not None:
            self.push_screen(DescriptionScreen(configs, instance.connect, self.view_model.list_listen_ends()))
        else:
            self.main.prompt.show_error("no CONNECT of this project has a connection description")

    # -- frames -------------------------------------------------------------------------------------

    def action_dropped(self) -> None:
        if self.screen is self.main:
            self.main.action_pane(5)
            self.main.received.action_dropped()

    def action_framings(self) -> None:
        from trcvtui.tui.framings import FramingScreen  # read when first asked for

        if self.screen is not self.main or self.refuses():
            return
        if not self.view_model.project.combuffers:
            self.main.prompt.show_error("no ComBuffer in this project: framing advice needs its bytes")
            return
        self.card = FramingScreen(self.view_model)
        self.push_screen(self.card, self._handle_framing_lines)

    def _handle_framing_lines(self, lines: tuple[str, ...] | None) -> None:
        self.card = None
        for line in lines or ():
            self.submit(line)

    def action_doctor(self) -> None:
        from trcvtui.tui.doctor import DoctorScreen  # read when first asked for

        if self.screen is self.main and not self.refuses():
            self.card = DoctorScreen(self.view_model)
            self.push_screen(self.card, self._handle_card_result)

    def _handle_card_result(self, place: DoctorTarget | None) -> None:
        self.card = None
        if place is not None and place.line:
            self.main.action_prompt(place.line)
        elif place is not None:
            self.main.go_to_place(place)

    def on_curve_wanted(self, message: CurveWanted) -> None:
        from trcvtui.tui.curve import CurveScreen  # read when first asked for

        if self.screen is self.main:
            self.card = CurveScreen(self.view_model, message.path)
            self.push_screen(self.card, self._handle_card_result)

    # -- the project --------------------------------------------------------------------------------

    def action_add(self, kind: str) -> None:
        from trcvtui.tui.forms.add_screen import AddScreen  # read when first asked for

        if self.screen is self.main:
            self.push_screen(AddScreen(lambda: self.view_model.project, kind, {}), self._submit_addition)

    def _submit_addition(self, line: str | None) -> None:
        """Send the line. Later keys wait until the new part exists, as they are meant for that part."""
        if line:
            self.submit(line)
            _, kind, name, *_ = line.split()
            if kind in ("instance", "peer") and not self.last_words:
                self._addition, self._keeps_keys = (kind, name, monotonic() + MOST_ADD_WAIT_S), True

    def _select_addition(self) -> None:
        """Select the added part as soon as the part exists; keys wait for it MOST_ADD_WAIT_S at most."""
        if self._addition is None:
            return
        view, (kind, name, until) = self.view_model, self._addition
        is_peer, holds = kind == "peer", bool(view.live and view.live.holding)
        of_kind = (view.project.peers, view.peers) if is_peer else (view.project.instances, view.instances)
        is_known, is_there = (any(each.name == name for each in parts) for parts in of_kind)
        is_late = bool(self.last_words) or monotonic() > until or (is_known and holds)
        if is_there or (is_known and is_late):
            self._addition = None
            if is_peer:
                view.peer = name
                self.main.on_peer_selected()
            elif not view.is_frozen:
                view.selected = name
                self.main.reset_for_selected()
                self.main.action_pane(1)
        elif is_late:  # the keys go now; the part is still selected when it comes
            self._addition = kind, name, inf
        if is_there or is_late:
            self.call_after_refresh(self.process_kept_keys)

    async def action_quit(self) -> None:
        """End the bench, after a warning about unsaved edits and connections that are cut.

        After any other key, the warning about edits comes again. A `serve` tab keeps edits: no warning.
        """
        picture, unsaved = self.view_model.live, self.view_model.unsaved_count
        if unsaved and not self.last_words and not self._engine.is_shared:
            what = f"{count(unsaved, picture.unsaved_word if picture else '')} to the project unsaved"
            if not self._confirm_or_warn(unsaved, f"{what}: `save project` saves them, q quits"):
                return
        if isinstance(self.screen, QuitTapScreen):
            self.screen.action_leave()
        elif cuts := self._engine.describe_quit_cuts():
            self.push_screen(QuitTapScreen(cuts), self._handle_quit_choice)
        else:
            self.exit()

    def _confirm_or_warn(self, what: object, text: str) -> bool:
        """Return whether the previous key caused the same warning; if it did not, show the warning."""
        is_meant, self._warned = self._warned == (self._keys - 1, what), (self._keys, what)
        if not is_meant:
            (self.main.prompt.show_error if self.screen is self.main else self._notify)(text)
        return is_meant

    def _handle_quit_choice(self, key: str) -> None:
        if key:
            self.exit(return_code=0 if key == "c" else DETACHED_EXIT)

    def action_picture(self) -> None:
        from trcvtui.tui.clipboard_and_files import screenshot  # read when first asked for

        if not self.is_web and self.refuses():  # a browser downloads the picture: no file is written here
            return
        prompt, on_bench = self.main.prompt, self.screen is self.main
        screenshot(self, *((prompt.inform, prompt.show_error) if on_bench else (self._notify, self._notify)))

    def _with_the_users_key(self, command: SystemCommand) -> SystemCommand:
        about, mark, key = command.help.rpartition("key ")
        help = about + mark + self.key_names.get(key, key)
        return command._replace(title=plain(command.title), help=plain(help))

    def _notify(self, text: str) -> None:
        self.notify(plain(text), markup=False)

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        from trcvtui.tui.palette import PaletteContext, list_commands  # read when first asked for

        above = self.scenarios or self.lab
        if above is not None:
            yield from above.commands()
        else:
            for command in list_commands(
                PaletteContext(self.view_model, self.main, self.submit, self.action_add, self.action_lab)
            ):
                yield self._with_the_users_key(command)
        for name, theme in OWN_THEMES.items():
            look = "the 16 colours of the terminal" if theme.ansi else f"{name} colours"
            yield SystemCommand(f"Theme {name}", look, partial(setattr, self, "theme", theme.name))
        yield SystemCommand("Theme", "choose a colour theme", self.action_change_theme)
        yield SystemCommand(
            "Record", "record the run, or stop; restart an engine that has ended · key R", self.action_restart
        )
        yield SystemCommand("Screenshot", "save the screen as an SVG file · key P", self.action_picture)
        what = "close this tab" if self._engine.is_shared else "end the bench"
        yield SystemCommand("Quit", f"{what} · key q", self.action_quit)


def _replay_screen(app: BenchApp) -> MainScreen:
    from trcvtui.tui.replay import ReplayScreen  # a bench has no time line

    return ReplayScreen(app.view_model, app.submit)


def _is_for_replay(screen: object) -> bool:
    """Return whether a replay may open this screen: one that does not change the bench."""
    from trcvtui.tui.forms.add_screen import AddScreen
    from trcvtui.tui.scenarios.screen import ScenariosScreen

    return not isinstance(screen, AddScreen | ScenariosScreen)


def run_app(
    driver: BenchDriver,
    project: Project,
    theme: str | None = None,
    read_only: bool = False,
    replay: bool = False,
    remembers: bool = False,
) -> int:
    """Open the screen on a bench or a replay. Return the exit code, 1 if the engine ended by itself."""
    settings = load_settings((*BenchApp.BINDINGS, *MainScreen.BINDINGS), theme)
    if read_only:
        refuse_files("this screen is read-only")
    app = BenchApp(driver, project, settings, read_only, replay)
    app.remembers = remembers and not read_only
    app.run()
    if app.last_words:
        sys.stderr.write(f"{app.last_words.rstrip()}\n")
        return ENGINE_ENDED_EXIT
    return app.return_code or 0
