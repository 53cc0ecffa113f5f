"""The screen of `trcvtui fleet` reads the broker 20 times a second and sorts the list twice a second."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from typing import ClassVar, Final

from textual.app import SystemCommand
from textual.binding import Binding
from textual.containers import Vertical
from textual.screen import Screen
from textual.widget import Widget

from trcvtui import clock
from trcvtui.fleet.broker import BrokerAccess, BrokerConnection
from trcvtui.fleet.fleet_list import GROUP_KEYS, Entry, GroupHead, count_sick, filter_lines, group_lines
from trcvtui.fleet.reader import FleetReader, state_topics
from trcvtui.fleet.seen_fleet import ERROR, STATES, FleetLine, FleetModel
from trcvtui.tui.fleet.card import FleetCardScreen
from trcvtui.tui.fleet.table import NO_AGENT_LINES, FleetColumnHead, FleetTable
from trcvtui.tui.formatting import plain
from trcvtui.tui.messages import FleetEntryOpened, KeyClicked
from trcvtui.tui.settings import ScreenSettings, load_settings
from trcvtui.tui.terminal_app import TerminalApp
from trcvtui.tui.widgets.dialogs import ResultScreen
from trcvtui.tui.widgets.help import KeyTable, key_rows
from trcvtui.tui.widgets.line_view import Row, hidden_bindings, pane_title
from trcvtui.tui.widgets.lines import HeaderWord, KeyLine, OutcomeLine, WordLine
from trcvtui.tui.widgets.theme import OWN_THEMES
from trcvtui.tui.widgets.typed_lines import FilterLine
from trcvtui.wording import count

NS_PER_S: Final = 1_000_000_000
FRAME_S: Final = 1 / 20
READ_BUDGET_NS: Final = 20_000_000  # of each frame, for messages
ORDER_INTERVAL_NS: Final = NS_PER_S // 2  # between two sorts of the list
AGE_INTERVAL_NS: Final = 10 * NS_PER_S  # so often errors older than an hour are dropped, without any message
NO_MATCH_LINES: Final = ("  no line has these words in its names, its state or its STATUS; esc: all",)
NO_DATA_LINES: Final = ("  nothing has come from the broker yet",)
FOOTER_KEYS: Final = (("/", "filter"), ("g", "group"), ("ctrl+p", "palette"), ("?", "help"), ("q", "quit"))
KEY_ACTIONS: Final = {
    "↑↓": "move", "enter": "open", "/": "filter", "g": "group", "ctrl+p": "app.command_palette",
    "?": "help", "q": "app.quit",
}  # fmt: skip
HELP_TABLES: Final[tuple[tuple[str, KeyTable], ...]] = (
    ("Lines", (
        ("↑ ↓, j k", "choose a line; the cursor follows this line when the list is sorted again"),
        ("home, end or G", "the first row: the cursor stays on the worst line; the last row"),
        ("enter or →", "open the card of a line, or open and close a group; mouse: double click"),
        ("←", "to the head of the group"),
        ("/", "only lines with these words: names, `offline`, `ERROR`, a state, a code; esc: all"),
        ("g", "group by site, by cause, or not at all"),
        ("P", "save the screen as an SVG file; the path is shown"),
        ("ctrl+p", "command palette"),
        ("? or F1", "this help"),
        ("q or ctrl+q", "quit"),
    )),
    ("Order", (
        ("1", "lines whose agent is offline, then lines whose engine makes no scan"),
        ("2", "lines with ERROR now; then with a finding of the doctor"),
        ("3", "stuck: a job has some of its bytes and got no more for 10 s; then not connected"),
        ("4", "errors in the last hour; within one state, the line that has been in it longest is first"),
    )),
    ("Signs", (
        ("✗ ■ ▲", "offline or no scan; good or, in red, ERROR; a finding, or stuck"),
        ("□ ◆", "not connected; good, with errors in the last hour"),
        ("·▁▂▃▄▅▆▇█", "errors in each five minutes: 0, 1, from 2, 4, 8, 16, 32, 64, 128 on"),
        ("was 80AA, +1", "after the STATUS: the last ERROR within an hour; one more instance"),
        ("● ◆ ○", "a group: some lines need attention; errors in the last hour; none"),
        ("clock?", "after the STATUS: the agent's clock is wrong; the card shows by how much"),
        ("? in state", "the agent has sent no figures of this line yet"),
    )),
)  # fmt: skip


class FleetHeader(WordLine):
    """The broker and its state, the number of lines, and how many of them are bad."""

    def __init__(self, broker: BrokerAccess, pattern: str, reader: FleetReader) -> None:
        super().__init__(id="header")
        self._broker, self._pattern, self._reader = broker, pattern, reader
        self.shown: list[FleetLine] = []

    def header_words(self) -> list[HeaderWord]:
        reader = self._reader
        pieces = [HeaderWord("trcvtui fleet", "dim", 60), HeaderWord(plain(str(self._broker)), "strong", 20)]
        if self._pattern != "*":
            pieces.append(HeaderWord(f"site {plain(self._pattern)}", "", 15))
        if not self._broker.has_tls:
            pieces.append(HeaderWord("no TLS", "warn", 40))
        pieces.append(HeaderWord(count(len(self.shown), "line"), "", 3))
        for shows, number in count_sick(self.shown):
            pieces.append(HeaderWord(f"{number} {STATES[shows]}", "error" if shows <= ERROR else "warn", 4))
        if missing := sum(line.missing for line in self.shown if line.newest_error is not None):
            pieces.append(HeaderWord(f"{count(missing, 'event')} missing", "warn", 10))
        if reader.refused:
            pieces.append(HeaderWord(f"{count(reader.refused, 'message')} refused", "warn", 12))
        if not reader.is_up:
            pieces.append(HeaderWord(" BROKER AWAY ", "stop", 0))
        elif not reader.has_caught_up:
            pieces.append(HeaderWord("reading …", "busy", 2))
        return pieces


class FleetScreen(Screen[None]):
    """The screen: header, filter, list, message and keys."""

    BINDINGS: ClassVar = hidden_bindings({
        "slash": "filter", "g": "group", "escape": "calm", "question_mark,f1": "help",
    })  # fmt: skip
    CSS_PATH = "fleet.tcss"

    def __init__(self, broker: BrokerAccess, pattern: str, reader: FleetReader) -> None:
        super().__init__()
        self._reader = reader
        self._typed = self._by = ""
        self._opened: set[str] = set()
        self._ordered_at = self._aged_at = -AGE_INTERVAL_NS
        self._shown = -1, False  # the version of the fleet, and whether its broker was connected
        self.head = FleetHeader(broker, pattern, reader)
        self.heads = FleetColumnHead()
        self.table = FleetTable(self.utc_seconds)
        self.filter = FilterLine(self.set_filter, self.table.action_move, self.table)
        self.outcome = OutcomeLine()
        self.key_line = KeyLine(FOOTER_KEYS, KEY_ACTIONS)
        self._frame = Vertical(id="fleet-frame")

    def utc_seconds(self) -> float:
        return clock.utc_ns() / NS_PER_S

    def compose(self) -> Iterator[Widget]:
        yield self.head
        yield self.filter
        with self._frame:
            yield self.heads
            yield self.table
        yield self.outcome
        yield self.key_line

    def on_mount(self) -> None:
        self.set_focus(self.table)
        self.advance(clock.now_ns())

    # -- what is shown ------------------------------------------------------------------------------

    def advance(self, now: int) -> bool:
        """Sort a changed or old list, else update ages; return False if it is too early for both."""
        if now < self._ordered_at + ORDER_INTERVAL_NS:
            return False
        self._ordered_at = now
        is_old = now >= self._aged_at + AGE_INTERVAL_NS
        version = self._reader.fleet.version, self._reader.is_up
        if is_old or version != self._shown:
            self._shown = version
            self._aged_at = now if is_old else self._aged_at
            self.sort_and_show()
        else:
            self.table.show()
        self.show_broker_state()
        return True

    def sort_and_show(self) -> None:
        wall = self.utc_seconds()
        ordered = self._reader.fleet.sort_lines(wall)
        self.head.shown = ordered
        lines = filter_lines(ordered, self._typed) if self._typed else ordered
        entries: list[Entry] = group_lines(lines, self._by, self._opened, wall) if self._by else [*lines]
        nothing = NO_AGENT_LINES if self._reader.is_up else NO_DATA_LINES
        self.table.nothing = NO_MATCH_LINES if ordered and not lines else nothing
        self.table.set_entries(entries)
        words = [f"by {self._by}"] if self._by else []
        if self._typed:
            words.append(f"{len(lines)} of {len(ordered)} with {plain(self._typed)}, esc: all")
        self._frame.border_title = pane_title(None, "Lines", " · ".join([*words, "the worst first"]))

    def show_broker_state(self) -> None:
        reader = self._reader
        words, style = reader.last_refusal, "warn"
        if not reader.is_up:
            before = "; the list shows the last known state" if self.head.shown else ""
            words, style = f"{reader.why}{before}; retrying", "error"
        self.outcome.display = bool(words)
        self.outcome.write(words, style)
        self.head.show()
        self.key_line.show_keys_of(self.focused, holding=False)

    # -- keys ---------------------------------------------------------------------------------------

    def set_filter(self, typed: str) -> None:
        self._typed = typed.strip()
        self.sort_and_show()

    def action_filter(self) -> None:
        self.filter.open()

    def action_group(self) -> None:
        ways = ["", *GROUP_KEYS]
        self._by = ways[(ways.index(self._by) + 1) % len(ways)]
        self._opened.clear()
        self.sort_and_show()

    def action_calm(self) -> None:
        """Clear the filter; if there is no filter, end the grouping."""
        if self._typed:
            self.filter.clear()
        elif self._by:
            self._by = ""
            self.sort_and_show()

    def action_move(self) -> None:
        self.table.action_move(1)

    def action_open(self) -> None:
        self.table.action_open()

    def action_help(self) -> None:
        self.app.push_screen(FleetHelpScreen())

    async def on_key_clicked(self, message: KeyClicked) -> None:
        await self.run_action(message.action)

    def on_fleet_entry_opened(self, message: FleetEntryOpened) -> None:
        if isinstance(message.entry, GroupHead):
            self._opened ^= {message.entry.name}
            self.sort_and_show()
        else:
            self.app.push_screen(FleetCardScreen(message.entry, self.utc_seconds))


class FleetHelpScreen(ResultScreen):
    BINDINGS: ClassVar = [Binding("question_mark,f1", "leave", show=False)]

    def __init__(self) -> None:
        super().__init__("help", "Help", "esc closes", help_rows)


def help_rows(width: int) -> list[Row]:
    return [each for title, table in HELP_TABLES for each in key_rows(title, table, width, {})]


class FleetApp(TerminalApp):
    BINDINGS: ClassVar = [Binding("q", "quit", show=False), Binding("P", "picture", show=False)]

    def __init__(
        self, broker: BrokerAccess, pattern: str, reader: FleetReader, settings: ScreenSettings | None = None
    ) -> None:
        super().__init__(settings or ScreenSettings())
        self._reader = reader
        self.main = FleetScreen(broker, pattern, reader)

    def on_mount(self) -> None:
        self.set_up_terminal()
        self.push_screen(self.main)
        self.set_interval(FRAME_S, self.advance_frame)
        self.call_after_refresh(self.finish_start)

    def advance_frame(self) -> None:
        self.read_broker(READ_BUDGET_NS)

    def read_broker(self, most_ns: int) -> None:
        now = clock.now_ns()
        self._reader.advance(now, self.main.utc_seconds(), most_ns)
        if self.main.is_mounted and self.main.advance(now) and isinstance(self.screen, FleetCardScreen):
            self.screen.card.draw()

    def show_start_message(self) -> None:
        if self.problems:
            self.notify(self.problems[0], markup=False)

    def action_picture(self) -> None:
        from trcvtui.tui.clipboard_and_files import screenshot  # read when first asked for

        tell = partial(self.notify, markup=False)
        screenshot(self, tell, tell)

    def get_system_commands(self, screen: Screen[object]) -> Iterable[SystemCommand]:
        main = self.main
        yield SystemCommand("Filter", "only lines with some words · key /", main.action_filter)
        yield SystemCommand("Group", "by site, by cause, or not at all · key g", main.action_group)
        for name, theme in OWN_THEMES.items():
            yield SystemCommand(f"Theme {name}", "colours", partial(setattr, self, "theme", theme.name))
        yield SystemCommand("Screenshot", "save the screen as an SVG file · key P", self.action_picture)
        yield SystemCommand("Help", "keys and signs · key ?", main.action_help)
        yield SystemCommand("Quit", "end the screen · key q", self.exit)


def run_fleet(broker: BrokerAccess, pattern: str, client_id: str, theme: str | None) -> int:
    connection = BrokerConnection(broker, client_id, topics=state_topics(pattern))
    reader = FleetReader(connection, FleetModel(), pattern)
    settings = load_settings((), theme)
    connection.start()
    try:
        app = FleetApp(broker, pattern, reader, settings)
        app.run()
    finally:
        connection.close()
    return app.return_code or 0
