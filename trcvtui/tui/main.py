"""The main screen: all panes at once, or on a small terminal the instances and one pane at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final

from textual import events
from textual.binding import Binding
from textual.containers import Container
from textual.timer import Timer
from textual.widget import Widget

from trcvtui.errors import UserError, mistake
from trcvtui.tui import messages
from trcvtui.tui.messages import ScreenCallbacks
from trcvtui.tui.panes.function_block import ROWS, FunctionBlock, rows_needed
from trcvtui.tui.panes.instance_list import InstanceList
from trcvtui.tui.panes.peer_panel import PeerPanel
from trcvtui.tui.panes.received import ReceivedPane
from trcvtui.tui.panes.status import StatusCard, StatusHistory
from trcvtui.tui.panes.timing import Timing
from trcvtui.tui.panes.udt_table import UdtTable
from trcvtui.tui.prompt import Prompt
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.help import RESERVED
from trcvtui.tui.widgets.hex_view import HexView
from trcvtui.tui.widgets.line_view import LineView
from trcvtui.tui.widgets.lines import KeyLine, TabLine
from trcvtui.tui.widgets.screens import FullScreen
from trcvtui.tui.widgets.typed_lines import FilterLine
from trcvtui.udt.layout.rules import NO_CHOICE

TABS_CLASS, PAIR_CLASS = "-tabs", "-pair"
LEAST_PANE_ROWS: Final = 32  # rows below the list of instances
LEAST_WIDTH, LEAST_HEIGHT, TINY_HEIGHT, ROOMY_HEIGHT, TALL_HEIGHT = 128, 38, 16, 43, 54
BROAD, HIGH = 180, 56  # from here on STATUS is beside timing and history, or timing has its own row
BOTH_WIDTH, BOTH_BELOW, HIGH_BELOW = 140, 39, 51  # from here on history and timing are both visible
PAIR_WIDTH, PAIR_HEIGHT = 100, 30  # from here on a small terminal shows two panes together
MOST_LIST_ROWS: Final = 10  # rows of the list, its frame included
LEAST_HISTORY_ROWS, MOST_HISTORY_ROWS, LEAST_BYTES_ROWS = 5, 12, 5
MOST_PEERS_SHOWN: Final = 3  # visible without scrolling
OTHER_LINES: Final = 3  # header, prompt, keys
REST_ROW: Final = 0  # in place of a height: the row of bytes and members gets the remaining rows


def size_classes(width: int, height: int, instances: int, block: int = ROWS) -> dict[str, bool]:
    """Return whether each CSS class applies. `block` is the height that pane 2 needs."""
    below = height - min(MOST_LIST_ROWS, instances + 2)
    tabs = width < LEAST_WIDTH or height < LEAST_HEIGHT or below < LEAST_PANE_ROWS
    high = height >= HIGH and below >= HIGH_BELOW + block - ROWS
    both = not tabs and below >= BOTH_BELOW + block - ROWS and (width >= BOTH_WIDTH or high)
    return {
        TABS_CLASS: tabs,
        PAIR_CLASS: tabs and width >= PAIR_WIDTH and height >= PAIR_HEIGHT,
        "-tiny": height < TINY_HEIGHT,
        "-roomy": height >= ROOMY_HEIGHT,
        "-tall": height >= TALL_HEIGHT,
        "-both": both,
        "-broad": both and width >= BROAD,
        "-high": both and width < BROAD and high,
    }


def row_heights(
    holds: Mapping[str, bool], height: int, timing: bool, block: int = ROWS, peers: int = 1
) -> tuple[int, ...]:
    """Return the heights of the rows of panes. The heights never depend on what the panes show.

    `holds` is the result of `size_classes`. If `timing`, the timing pane was opened after the history.
    """
    tall = holds["-tall"]
    peer = 8 + max(0, min(MOST_PEERS_SHOWN, peers) - 1) if holds["-roomy"] else 8
    if not holds["-both"]:
        status, past = 11 if tall else 8, 12 if tall else 10 if timing else 7
        return status, min(past, height - status - LEAST_BYTES_ROWS - peer), REST_ROW, peer
    high = 10 if holds["-high"] else 0
    strip = 0 if high else 2  # timing, or its strip below STATUS, needs more rows than the block
    spare = height - block - strip - high - peer
    half = (spare - (5 if high else 3)) // 2  # the bytes below it get the larger part
    history = max(LEAST_HISTORY_ROWS, min(MOST_HISTORY_ROWS, half))
    if holds["-broad"]:
        return block + strip, history, REST_ROW, peer
    if high:
        return block, high, history, REST_ROW, peer
    beside = 10 if timing else 6
    return block + strip - beside, beside, history, REST_ROW, peer


BELOW_DIALOG_DELAY_S: Final = 0.5
EXPORT_VERB, FIND = "export", "find"
EXPORT_SYNTAX: Final = "export timing vcd, or export timing vcd FILE"


def run_timing_line(line: str, pane: Timing) -> str:
    """Carry out `find` or `export`. Return a message, or "" for none; raise UserError."""
    words = line.split(maxsplit=3)
    if words[0] == FIND:
        return _find_status(words[1:], pane)
    if words[1:3] != ["timing", "vcd"]:
        raise mistake("prompt", f"'{line}'", EXPORT_SYNTAX)
    written, size = pane.write_vcd(Path(words[3]).expanduser() if len(words) > 3 else None)
    return f"{size} bytes in {written.absolute()}"


def _find_status(words: list[str], pane: Timing) -> str:
    if len(words) != 1:
        raise mistake("prompt", f"'{' '.join([FIND, *words])}'", "find and a code such as 7008 or 16#80C5")
    text = words[0].upper().removeprefix("W#").removeprefix("16#").removeprefix("0X")
    if not 1 <= len(text) <= 4 or not all(digit in "0123456789ABCDEF" for digit in text):
        raise mistake("prompt", f"'{words[0]}'", "a code of up to four hexadecimal digits")
    pane.find(int(text, 16))
    return ""


if TYPE_CHECKING:
    from trcvtui.tui.copy_formats import CopyFormat, CopySource
    from trcvtui.tui.doctor import DoctorTarget
    from trcvtui.tui.forms.fields import ProjectPart

ZOOM, LIST, FROZEN_CLASS, WITHIN_CLASS = "-zoom", "-list", "-frozen", "-within"
MESSAGES_CLASS: Final = "-messages"  # the table of messages and its members take the whole screen
ENOUGH_TABLE_ROWS: Final = 22  # rows of pane 5: with fewer, the table of messages takes the whole screen
SCENARIOS_LINE: Final = "scenarios"  # a line that the screen carries out
PAST_PANES: Final = {4, 8}  # history and timing
PANE_PAIRS: Final = ({2, 3}, {5, 6})  # side by side: Block and STATUS, bytes and members
PIN_KEY_LETTERS: Final = "".join(sorted(set("abcdefghijklmnopqrstuvwxyz") - RESERVED))


class MainScreen(FullScreen[None]):
    """Passes new pictures to the panes, and requests of the panes to the app."""

    BINDINGS: ClassVar = [
        *[Binding(str(digit), f"pane({digit})", show=False) for digit in range(1, 9)],
        *[Binding(letter, f"pin('{letter}')", show=False) for letter in PIN_KEY_LETTERS],
        Binding("M,backslash", "zoom", show=False, id="zoom"),
        Binding("space", "hold", show=False, id="hold"),
        Binding("full_stop", "single_scan", show=False, id="single_scan"),
        Binding("F", "freeze", show=False, id="freeze"),
        Binding("T", "trigger", show=False, id="trigger"),
        Binding("colon", "prompt", show=False, id="prompt"),
        Binding("v", "members", show=False, id="members"),
        Binding("V", "theirs", show=False, id="theirs"),
        Binding("y", "yank", show=False, id="yank"),
        Binding("K", "mark", show=False, id="mark"),
        Binding("A", "app.add('instance')", show=False, id="add"),
        Binding("E", "change", show=False, id="change"),
        Binding("ctrl+z", "undo", show=False, id="undo"),
        Binding("ctrl+s", "save", show=False, id="save"),
        Binding("S,f2", "scenarios", show=False, id="scenarios"),
        Binding("L", "app.lab", show=False, id="lab"),
        Binding("question_mark,f1", "help", show=False, id="help"),
        Binding("R", "app.restart", show=False, id="restart"),
        Binding("escape", "calm", show=False),
        Binding("q", "app.quit", show=False, id="quit"),
    ]
    CSS_PATH = "main.tcss"

    def __init__(self, view_model: ViewModel, submit: Callable[[str], None]) -> None:
        super().__init__(view_model, KeyLine())
        self._owed: Timer | None = None  # until it ends, news below a dialog are not drawn
        self._submit = submit
        self._pane = 3
        self._past = 4  # history or timing: the open one where both share a place
        actions = ScreenCallbacks(submit, self.action_prompt, lambda text: self.prompt.show_error(text))
        self.instances = InstanceList(view_model, self.reset_for_selected)
        self.filter = FilterLine(
            self.instances.set_filter, self.instances.action_move, self.instances, self.instances.choose_first
        )
        self.tabs = TabLine()
        self.block = FunctionBlock(view_model, actions)
        self.status = StatusCard(view_model, actions, letter_of=self.block.letter_of)
        self.block.propose_value = self.status.propose_value
        self.timing = Timing(view_model, actions)
        self.history = StatusHistory(view_model, actions)
        self.received = ReceivedPane(view_model, lambda note: self.prompt.show_preview(note))
        self.table = UdtTable(view_model)
        self.peer = PeerPanel(view_model, actions)
        self._grid = Container(id="panes")
        self._rows = ""  # heights in the notation of CSS
        self._sizes: dict[str, bool] = {}
        self._block_rows, self._pane_rows = ROWS, 0
        self._instances = 0  # in the project when the panes were last arranged
        self.prompt = Prompt(
            view_model, self.peer.lines.wrap(submit), lambda: bool(getattr(self.app, "only_looks", False))
        )

    def compose(self) -> Iterator[Widget]:
        self._fit(*self.app.size)  # before the panes exist: a later change of classes styles them again
        self._grid.styles.grid_rows = self._rows = self._format_grid_rows()
        yield from (self.header, self.instances, self.tabs)
        with self._grid:
            yield from self._panes().values()
        yield self.prompt
        yield self.key_line

    def _panes(self) -> dict[int, Widget]:
        return {
            2: self.block,
            3: self.status,
            8: self.timing,  # before 4: the grid is filled in this order
            4: self.history,
            5: self.received,
            6: self.table,
            7: self.peer,
        }

    def _focus_target(self, digit: int) -> Widget:
        now = self.received.face is self.received.now
        decoded = self._decoded_view() if now else self.received.face.first
        inner: dict[int, Widget] = {1: self.instances, 5: decoded, 7: self.peer.focus_target}
        return inner.get(digit) or self._panes()[digit]

    def on_mount(self) -> None:
        self._arrange()
        self.set_focus(self.instances)
        self.show()

    async def mount_fields(self) -> None:
        """Make the input fields after the first frame: without them the first frame comes earlier."""
        with self.app.batch_update():
            await self.prompt.mount_input()
            await self.peer.mount_fields()
            await self.mount(self.filter, before=self.tabs)

    def on_resize(self, event: events.Resize) -> None:
        self._fit(*event.size)
        self._arrange()

    def _fit(self, width: int, height: int) -> None:
        self._instances = len(self._view_model.project.instances)
        self._block_rows = rows_needed(self._view_model.project)
        self._pane_rows = height - min(MOST_LIST_ROWS, self._instances + 2) - OTHER_LINES
        self._sizes = size_classes(width, height, self._instances, self._block_rows)
        self.update_classes(self._sizes)

    # -- what comes in ------------------------------------------------------------------------------

    def show(self) -> None:
        self.set_class(self._view_model.is_frozen, FROZEN_CLASS)
        if self._instances != len(self._view_model.project.instances):  # a longer list leaves fewer rows
            self._fit(*self.size)
            self._arrange()
        panes = self.header, self.instances, self.block, self.status, self.timing, self.history, self.table
        for pane in panes:
            pane.show()
        self.received.show()
        self.peer.show()
        self.prompt.accept_answers(self._view_model.answers)
        self._show_keys()

    def show_soon(self) -> None:
        """Draw panes below a dialog only twice a second: each drawing makes Textual paint both screens."""
        self.prompt.accept_answers(self._view_model.answers)
        self.peer.show_trial()
        if self._owed is None:
            self._owed = self.set_timer(BELOW_DIALOG_DELAY_S, self._show_delayed)

    def on_screen_resume(self) -> None:
        if self._owed is not None:
            self._owed.stop()
            self._show_delayed()

    def _show_delayed(self) -> None:
        self._owed = None
        self.show()

    def _show_keys(self) -> None:
        picture = self._view_model.live
        self.key_line.show_keys_of(self.focused, bool(picture and picture.holding))

    def forget_bench(self) -> None:
        self.block.forget()
        self.reset_for_selected()
        self.on_peer_selected()

    def run_own_line(self, line: str) -> bool:
        """Carry out a line of the timing pane; return False for any other line."""
        if line.split(maxsplit=1)[:1] not in ([EXPORT_VERB], [FIND]):
            return False
        try:
            self.prompt.show_result(line, run_timing_line(line, self.timing))
            self.history.code = self.timing.code
        except UserError as wrong:
            self.prompt.show_result(line, "", wrong.lines()[0])
        return True

    def show_end(self, last_words: str) -> None:
        """Show that the engine has ended and what you can do. Keep the last picture, with grey lamps."""
        self._set_running(False)
        self.prompt.show_error(last_words, stays=True)

    def show_restart(self) -> None:
        self._set_running(True)
        self.forget_bench()
        self.prompt.inform("the engine restarts")

    def _set_running(self, runs: bool) -> None:
        self.header.ended = not runs
        self.header.show()
        for pane in (self.instances, *self._grid.query(LineView)):
            pane.set_stale(not runs)

    # -- what the panes say -------------------------------------------------------------------------

    def reset_for_selected(self) -> None:
        self.history.clear_history()
        self.timing.reset_cursor()
        self.status.explain_at(None)
        self._show_links(range(0), range(0))
        self.table.cursor, self.table.shows_job, self.table.past = None, False, None
        self.received.data.cursor = self.received.job.cursor = None
        self.show()

    def on_peer_selected(self) -> None:
        self.peer.composer.check_line()
        self.peer.show()

    def on_edge_selected(self, message: messages.EdgeSelected) -> None:
        line = message.line
        self.status.explain_at(line)
        self.history.choose_edge(message.seq)
        self.timing.show_scan(line.scan if line else None, message.seq)

    def on_byte_selected(self, message: messages.ByteSelected) -> None:
        self.table.shows_job, self.table.past = message.of_job, None
        self._show_field_link(self.table.select_member_at(message.offset))
        self.table.show()
        self.received.show()

    def on_past_cursor_moved(self, message: messages.PastCursorMoved) -> None:
        """Decode the job of the selected byte in the past, and show the member at this byte."""
        of_job = self.received.face.job_of_cursor()
        mine = of_job is not None and of_job[0] == self._view_model.selected
        self.table.past = of_job[1:] if of_job is not None and mine else None
        if self.table.was_thrown_away:
            self.table.cursor = None
        in_data = mine and not self.table.was_thrown_away
        field = self.table.select_member_at(self.received.face.offset_in_job()) if in_data else range(0)
        self.received.face.show_field(field, goes_there=False)
        self.table.show()
        self.received.show()

    def on_message_chosen(self, message: messages.MessageChosen) -> None:
        """Show the scan of a message in STATUS, history and timing; without a message, go back to now."""
        if message.row is None:
            self.timing.action_now()
        else:
            self.status.explain_at(None)  # the edge may be forgotten: no other edge may explain the scan
            self.history.choose_edge(None)
            self.timing.go_to(message.row.scan)
        self.received.show()

    def on_field_selected(self, message: messages.FieldSelected) -> None:
        if self.table.past is not None:
            if not self.table.was_thrown_away:
                self.received.face.show_field(message.field, goes_there=True)
            self.received.show()
            return
        self._show_field_link(message.field)
        self._decoded_view().go_to(message.field.start)
        self.received.show()

    def _decoded_view(self) -> HexView:
        of_job = self.table.shows_job and self.received.job.display
        return self.received.job if of_job else self.received.data

    def _show_field_link(self, field: range) -> None:
        none = range(0)
        self._show_links(*((none, field) if self.table.shows_job else (field, none)))

    def _show_links(self, data: range, job: range) -> None:
        self.received.data.link_bytes(data)
        self.received.job.link_bytes(job)

    def on_descendant_focus(self, event: events.DescendantFocus) -> None:
        """Open the pane that got the focus, and show its keys."""
        if event.widget is not self.focused:  # it has lost the focus again
            return
        for digit, pane in self._panes().items():
            if pane in event.widget.ancestors_with_self:
                self._open_pane(digit)
        if not {self.received, self.prompt} & {*event.widget.ancestors}:
            self.received.end_search()
        self._show_keys()

    # -- actions ------------------------------------------------------------------------------------

    def action_pane(self, digit: int) -> None:
        if digit != 1:
            self._open_pane(digit)
        elif self.has_class(ZOOM):
            self.action_zoom()
        if digit != 1 and self.has_class(LIST):
            self.action_zoom()
        self.set_focus(self._focus_target(digit))

    def watch_focused(self) -> None:
        """Give the pane with the focus a class, because `:focus-within` would style all its parts again."""
        for pane in (self.received, self.peer):
            if pane.has_class(WITHIN_CLASS) != pane.has_focus_within:
                pane.set_class(pane.has_focus_within, WITHIN_CLASS, update=False)
                self.app.stylesheet.apply(pane)

    def go_to_place(self, place: DoctorTarget) -> None:
        """Show a scan of an instance in the timing pane, or a byte of its received stream in pane 5."""
        if place.instance != self._view_model.selected:
            self._view_model.selected = place.instance
            self.reset_for_selected()
        if place.scan is not None:
            self.action_pane(8)
            self.timing.go_to(place.scan)
        elif place.byte is not None:
            self.action_pane(5)
            self.received.go_to(place.byte)

    def _open_pane(self, digit: int) -> None:
        self._pane = digit
        if digit in PAST_PANES:
            self._past = digit
        self._arrange()

    def _arrange(self) -> None:
        self.set_class(self._table_needs_screen(), MESSAGES_CLASS)
        alone = any(map(self.has_class, (TABS_CLASS, ZOOM, MESSAGES_CLASS)))
        away = set() if self.has_class("-both") else PAST_PANES - {self._past}
        seen = self._visible_tabs() if alone else self._panes().keys() - away
        self.set_class(seen in PANE_PAIRS, "-beside")
        for digit, pane in self._panes().items():
            pane.display = digit in seen
        first, then = (self.timing, self.status) if self.has_class("-broad") else (self.status, self.timing)
        if (order := self._grid.children).index(first) > order.index(then):  # a grid is filled in child order
            self._grid.move_child(first, before=then)
        self.tabs.mark_open(self._pane, *seen)
        if (rows := self._format_grid_rows()) != self._rows:
            self._grid.styles.grid_rows = self._rows = rows

    def _heights(self) -> tuple[int, ...]:
        peers = len(self._view_model.project.peers)
        return row_heights(self._sizes, self._pane_rows, self._past == 8, self._block_rows, peers)

    def _format_grid_rows(self) -> str:
        return " ".join("1fr" if each == REST_ROW else str(each) for each in self._heights())

    def _table_needs_screen(self) -> bool:
        """Return whether messages and members take the whole screen, because pane 5 has too few rows."""
        rows = self._pane_rows - 2 - (1 if self.has_class(TABS_CLASS) else sum(self._heights()))
        return self.received.is_table and self._pane in (5, 6) and rows < ENOUGH_TABLE_ROWS

    def _visible_tabs(self) -> set[int]:
        if self.has_class(MESSAGES_CLASS) and not self.has_class(ZOOM):
            return {5, 6} if self.size.width >= PAIR_WIDTH else {self._pane}
        is_stream = self._pane in (5, 6) and self.received.is_past  # the stream needs the whole width
        if self.has_class(ZOOM) or not self.has_class(PAIR_CLASS) or is_stream:
            return {self._pane}
        return next((pair for pair in (*PANE_PAIRS, {3, 7}) if self._pane in pair), {self._pane})

    def action_zoom(self) -> None:
        """Toggle the zoom of the open pane, or of the list of instances if it is long and has the focus."""
        long_list = self.focused is self.instances and self.instances.show_vertical_scrollbar
        zoomed = next((each for each in (ZOOM, LIST) if self.has_class(each)), LIST if long_list else ZOOM)
        self.toggle_class(zoomed)
        self._arrange()

    async def action_pin(self, letter: str) -> None:
        place = "" if self._takes_pin_keys() else self.block.pin_key_hint(letter)
        if place:
            self.prompt.show_error(place)
        elif missing := self.block.press(letter):
            await self.run_action(f"app.press_from_afar({letter!r}, {missing!r})")

    def _takes_pin_keys(self) -> bool:
        return self.focused in (self.instances, self.block, self.status)

    async def on_key(self, event: events.Key) -> None:
        """Handle a character key that neither the pane with the focus nor the screen knows."""
        if event.is_printable:
            event.stop()  # the app would handle it a second time, with the new focus
            await self.run_action(f"app.press_from_afar({event.key!r})")

    def action_members(self) -> None:
        self.table.shows_job = not self.table.shows_job
        self._show_field_link(self.table.chosen_field())
        self.table.show()

    def action_theirs(self) -> None:
        """Show DATA in the layout that fits the received bytes, or in the PLC's own layout if none fits."""
        from trcvtui.diagnosis.data_view import make_view_command  # read when first asked for

        decl, offer = self._view_model.declaration, self.status.layout_offer()
        line = make_view_command(decl, offer.choice if offer else NO_CHOICE) if decl is not None else ""
        if line:
            self._submit(line)
        else:
            nothing = "no other layout fits the received bytes: L opens the lab, V there sets DATA to theirs"
            self.prompt.show_result("V", "", nothing if decl else "no DATA here")

    def action_yank(self) -> None:
        from trcvtui.tui.copy_formats import FIRST, PANE_LETTERS, YankScreen  # read when first asked for

        pane = self._focused_pane()
        if self.focused is self.received.table.first:
            self.run_worker(self._yank_messages())
        elif (subject := self._find_copy_source(pane)) is not None:
            self.app.push_screen(YankScreen(subject, PANE_LETTERS.get(pane, FIRST)), self._handle_yank)

    async def _yank_messages(self) -> None:
        from trcvtui.tui.copy_formats import MESSAGES_CSV  # read when first asked for

        if text := await self.received.table.csv():
            self._handle_yank((MESSAGES_CSV, text))
        else:
            self.prompt.show_error("no message to yank")

    def yank(self, letter: str) -> None:
        from trcvtui.tui.copy_formats import FORMATS

        form = next(form for form in FORMATS if form.letter == letter)
        subject = self._find_copy_source(self._focused_pane())
        if subject is None:
            return
        if text := form.write(subject):
            self._handle_yank((form, text))
        else:
            self.prompt.show_error(f"nothing to yank as {form.name}")

    def _focused_pane(self) -> str:
        return self.focused.id or "" if self.focused is not None else ""

    def _find_copy_source(self, pane: str) -> CopySource | None:
        """Return what to copy from a pane. If bytes are missing, return None and show why in the prompt."""
        from trcvtui.tui.copy_formats import make_copy_source

        if pane in ("peers", "payload"):
            return make_copy_source(self._view_model, of_job=False, of_peer=True)
        is_of_bytes = pane in ("stream", "data", "job", "udt", "messages", "message")
        lack = self.received.face.explain_lack() if is_of_bytes else ""
        if lack:
            self.prompt.show_error(f"nothing to yank: {lack}")
            return None
        of_job = pane == "job" or (pane == "udt" and self.table.shows_job)
        past = self.received.face.job_of_cursor()
        if past is not None and pane != "stream" and past[0] != self._view_model.selected:
            past = None  # pane 6 shows DATA beside a job of another instance
        found = make_copy_source(self._view_model, of_job, False, past)
        if pane == "stream":
            message, from_mark = self.received.past.bytes_to_copy()
            found = replace(found, message=message, from_mark=from_mark)
        return found

    def _handle_yank(self, taken: tuple[CopyFormat, str] | None) -> None:
        from trcvtui.tui.clipboard_and_files import yank

        if taken is not None and not self._refuse_if_read_only():
            self.run_worker(yank(self.app, *taken, self.prompt.inform, self.prompt.show_error))

    def _refuse_if_read_only(self) -> bool:
        refuses = getattr(self.app, "refuses", None)
        return bool(refuses and refuses())

    def action_change(self) -> None:
        from trcvtui.tui.forms.fields import all_parts, list_parts  # read when first asked for
        from trcvtui.tui.widgets.dialogs import ChoiceScreen

        near = list_parts(self._view_model, self.peer in (self.focused.ancestors if self.focused else ()))
        parts = [near, [part for part in all_parts(self._view_model.project) if part not in near]]
        choices = {
            f"{verb} {part}": (action, part)
            for some in parts
            for verb, action in (("Change", self.change_part), ("Remove", self.remove_part))
            for part in some
            if part.kind != "udt" or verb == "Remove"
        }
        if not choices:
            self.prompt.show_error("nothing to change: A adds a part")
            return

        def accept_choice(chosen: str | None) -> None:
            if chosen is not None:
                action, part = choices[chosen]
                action(part)

        rows = [
            (title, f"{'set' if action == self.change_part else 'remove'} {part.kind} {part.name}")
            for title, (action, part) in choices.items()
        ]
        self.app.push_screen(ChoiceScreen("Change or remove", rows, ""), accept_choice)

    def change_part(self, part: ProjectPart) -> None:
        from trcvtui.tui.forms.add_screen import ChangeScreen  # read when first asked for

        self.app.push_screen(ChangeScreen(lambda: self._view_model.project, part), self._submit_change)

    def _submit_change(self, line: str | None) -> None:
        if line:
            self._submit(line)

    def remove_part(self, part: ProjectPart) -> None:
        """Open the prompt with the line that removes a part. You see the effect before sending the line."""
        if not self._refuse_if_read_only():
            self.action_prompt(f"remove {part.kind} {part.name}")

    def action_undo(self) -> None:
        if self.prompt.is_open or self._refuse_if_read_only():
            return
        if self._view_model.project.undoable:
            self.action_prompt("undo")
        else:
            self.prompt.show_error("no edit of the project to undo")

    def action_save(self) -> None:
        self._submit("save project")

    def yank_line(self, line: str) -> None:
        """Copy a shell command, and show it with the result of copying."""
        from trcvtui.tui.clipboard_and_files import yank
        from trcvtui.tui.copy_formats import CopyFormat

        def report(text: str) -> None:
            self.prompt.inform(f"{line} · {text}")

        if not self._refuse_if_read_only():
            self.run_worker(yank(self.app, CopyFormat("", "it", lambda of: line), line, report, report))

    def action_mark(self) -> None:
        self._submit("mark")

    def action_hold(self) -> None:
        picture = self._view_model.live
        self._submit("go" if picture and picture.holding else "hold")
        if picture and picture.holding:
            self._thaw_for_step()

    def action_single_scan(self) -> None:
        picture = self._view_model.live
        if picture is not None and not picture.holding:
            self._submit("hold")
        self._submit("run 1")
        self._thaw_for_step()

    def _thaw_for_step(self) -> None:
        if self._view_model.fired is not None and self._view_model.fired.holds:
            self._view_model.thaw()

    def action_freeze(self) -> None:
        self._view_model.thaw() if self._view_model.is_frozen else self._view_model.freeze()
        self.show()

    def action_trigger(self) -> None:
        self.action_prompt("trigger ")

    def action_prompt(self, text: str = "", *then: str) -> None:
        self.prompt.open(text, *then)

    def action_calm(self) -> None:
        if self.has_class(ZOOM) or self.has_class(LIST):
            self.action_zoom()
        elif self.focused is self.instances and self.instances.words:
            self.filter.clear()
        self.history.action_now()

    def action_filter(self) -> None:
        self.action_pane(1)
        self.filter.open()

    def action_scenarios(self) -> None:
        self._submit(SCENARIOS_LINE)
