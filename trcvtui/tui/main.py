"""The bench: all panes at once, or on a small screen the instances and one pane at a time."""

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
from trcvtui.tui.messages import PaneActions
from trcvtui.tui.panes.function_block import ROWS, FunctionBlock, rows_needed
from trcvtui.tui.panes.instance_list import InstanceList
from trcvtui.tui.panes.peer_panel import PeerPanel
from trcvtui.tui.panes.received import Received
from trcvtui.tui.panes.status import StatusCard, StatusHistory
from trcvtui.tui.panes.timing import Timing
from trcvtui.tui.panes.udt_table import UdtTable
from trcvtui.tui.prompt import Prompt
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.help import TAKEN
from trcvtui.tui.widgets.hex_view import HexView
from trcvtui.tui.widgets.line_view import LineView
from trcvtui.tui.widgets.lines import KeyLine, TabLine
from trcvtui.tui.widgets.screens import FullScreen
from trcvtui.tui.widgets.typed_lines import FilterLine
from trcvtui.udt.layout.rules import NO_CHOICE

TABS, PAIR = "-tabs", "-pair"
LEAST_BELOW: Final = 32  # rows below the list of instances
LEAST_WIDTH, LEAST_HEIGHT, TINY, ROOMY, TALL = 128, 38, 16, 43, 54
BROAD, HIGH = 180, 56  # from here on STATUS stands beside timing and history; timing has a row of its own
BOTH_WIDTH, BOTH_BELOW, HIGH_BELOW = 140, 39, 51  # from here on history and timing both stand
PAIR_WIDTH, PAIR_HEIGHT = 100, 30  # from here on two panes stand side by side, or one above the other
MOST_INSTANCES: Final = 10  # rows of the list, its frame included
LEAST_HISTORY, MOST_HISTORY, LEAST_BYTES = 5, 12, 5
MOST_PEERS: Final = 3  # that are seen at once
OTHER_LINES: Final = 3  # header, prompt, keys
REST: Final = 0  # the row that takes what is left: bytes and members


def sizes(width: int, height: int, instances: int, block: int = ROWS) -> dict[str, bool]:
    """Return the class names and whether each holds; `block` is the height that pane 2 needs."""
    below = height - min(MOST_INSTANCES, instances + 2)
    tabs = width < LEAST_WIDTH or height < LEAST_HEIGHT or below < LEAST_BELOW
    high = height >= HIGH and below >= HIGH_BELOW + block - ROWS
    both = not tabs and below >= BOTH_BELOW + block - ROWS and (width >= BOTH_WIDTH or high)
    return {
        TABS: tabs,
        PAIR: tabs and width >= PAIR_WIDTH and height >= PAIR_HEIGHT,
        "-tiny": height < TINY,
        "-roomy": height >= ROOMY,
        "-tall": height >= TALL,
        "-both": both,
        "-broad": both and width >= BROAD,
        "-high": both and width < BROAD and high,
    }


def grid_rows(
    holds: Mapping[str, bool], height: int, timing: bool, block: int = ROWS, peers: int = 1
) -> tuple[int, ...]:
    """Return the heights of the rows of panes in `height` rows: nothing that the panes say changes them.

    `holds` are the classes of a size, `timing` whether timing was looked at after history.
    """
    tall = holds["-tall"]
    peer = 8 + max(0, min(MOST_PEERS, peers) - 1) if holds["-roomy"] else 8
    if not holds["-both"]:
        status, past = 11 if tall else 8, 12 if tall else 10 if timing else 7
        return status, min(past, height - status - LEAST_BYTES - peer), REST, peer
    high = 10 if holds["-high"] else 0
    strip = 0 if high else 2  # timing, and a strip of it below STATUS, wants more than the block
    spare = height - block - strip - high - peer
    half = (spare - (5 if high else 3)) // 2  # more for the bytes below it
    history = max(LEAST_HISTORY, min(MOST_HISTORY, half))
    if holds["-broad"]:
        return block + strip, history, REST, peer
    if high:
        return block, high, history, REST, peer
    beside = 10 if timing else 6
    return block + strip - beside, beside, history, REST, peer


BELOW_DIALOG_S: Final = 0.5
EXPORT, FIND = "export", "find"
EXPORT_LINES: Final = "export timing vcd, perhaps a FILE"


def obey_line(line: str, pane: Timing) -> str:
    """Carry out a line; return what to tell about it, which may be nothing; raise UserError."""
    words = line.split(maxsplit=3)
    if words[0] == FIND:
        return _find(words[1:], pane)
    if words[1:3] != ["timing", "vcd"]:
        raise mistake("prompt", f"'{line}'", EXPORT_LINES)
    written, size = pane.write(Path(words[3]).expanduser() if len(words) > 3 else None)
    return f"{size} bytes in {written.absolute()}"


def _find(words: list[str], pane: Timing) -> str:
    if len(words) != 1:
        raise mistake("prompt", f"'{' '.join([FIND, *words])}'", "find and a code such as 7008 or 16#80C5")
    text = words[0].upper().removeprefix("W#").removeprefix("16#").removeprefix("0X")
    if not 1 <= len(text) <= 4 or not all(digit in "0123456789ABCDEF" for digit in text):
        raise mistake("prompt", f"'{words[0]}'", "a code of four hexadecimal digits")
    pane.find(int(text, 16))
    return ""


if TYPE_CHECKING:
    from trcvtui.tui.copy_formats import Format, Subject
    from trcvtui.tui.doctor import EvidencePlace
    from trcvtui.tui.forms.fields import ProjectPart

ZOOM, LIST, FROZEN, WITHIN = "-zoom", "-list", "-frozen", "-within"
MESSAGES: Final = "-messages"  # their table and their members have the screen
ENOUGH_ROWS: Final = 22  # of pane 5: so high, the table stands among the panes
SCENARIOS: Final = "scenarios"  # the line that is the screen's own
PAST: Final = {4, 8}  # history and timing
PAIRS: Final = ({2, 3}, {5, 6})  # stand side by side: Block and STATUS, bytes and members
LETTERS: Final = "".join(sorted(set("abcdefghijklmnopqrstuvwxyz") - TAKEN))


class MainScreen(FullScreen[None]):
    """Hands what changed to the panes, and what the panes ask for to the app."""

    BINDINGS: ClassVar = [
        *[Binding(str(digit), f"pane({digit})", show=False) for digit in range(1, 9)],
        *[Binding(letter, f"pin('{letter}')", show=False) for letter in LETTERS],
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
        self._owed: Timer | None = None  # what came below a dialog will be shown
        self._submit = submit
        self._pane = 3
        self._past = 4  # history or timing, where one place is for both
        actions = PaneActions(submit, self.action_prompt, lambda text: self.prompt.complain(text))
        self.instances = InstanceList(view_model, self.follow_selected)
        self.filter = FilterLine(
            self.instances.narrow, self.instances.action_move, self.instances, self.instances.choose_listed
        )
        self.tabs = TabLine()
        self.block = FunctionBlock(view_model, actions)
        self.status = StatusCard(view_model, actions, letter_of=self.block.letter_of)
        self.block.proposed = self.status.proposed
        self.timing = Timing(view_model, actions)
        self.history = StatusHistory(view_model, actions)
        self.received = Received(view_model, lambda note: self.prompt.foretell(note))
        self.table = UdtTable(view_model)
        self.peer = PeerPanel(view_model, actions)
        self._grid = Container(id="panes")
        self._rows = ""  # as the style sheet writes them
        self._sizes: dict[str, bool] = {}
        self._block_rows, self._pane_rows = ROWS, 0
        self._instances = 0  # of the project, when the panes were arranged
        self.prompt = Prompt(
            view_model, self.peer.lines.heard(submit), lambda: bool(getattr(self.app, "only_looks", False))
        )

    def compose(self) -> Iterator[Widget]:
        self._fit(*self.app.size)  # before there are panes: afterwards all of them would be styled again
        self._grid.styles.grid_rows = self._rows = self._wanted_rows()
        yield from (self.header, self.instances, self.tabs)
        with self._grid:
            yield from self._panes().values()
        yield self.prompt
        yield self.key_line

    def _panes(self) -> dict[int, Widget]:
        return {
            2: self.block,
            3: self.status,
            8: self.timing,  # before 4: where all stand, the grid is filled in this order
            4: self.history,
            5: self.received,
            6: self.table,
            7: self.peer,
        }

    def _focus_target(self, digit: int) -> Widget:
        now = self.received.face is self.received.now
        decoded = self._decoded_view() if now else self.received.face.first
        inner: dict[int, Widget] = {1: self.instances, 5: decoded, 7: self.peer.first}
        return inner.get(digit) or self._panes()[digit]

    def on_mount(self) -> None:
        self._arrange()
        self.set_focus(self.instances)
        self.show()

    async def prepare(self) -> None:
        """Make the fields that can be typed into: they need not stand in the first frame."""
        with self.app.batch_update():
            await self.prompt.prepare()
            await self.peer.prepare()
            await self.mount(self.filter, before=self.tabs)

    def on_resize(self, event: events.Resize) -> None:
        """Take all panes side by side only where nothing has to be cut."""
        self._fit(*event.size)
        self._arrange()

    def _fit(self, width: int, height: int) -> None:
        self._instances = len(self._view_model.project.instances)
        self._block_rows = rows_needed(self._view_model.project)
        self._pane_rows = height - min(MOST_INSTANCES, self._instances + 2) - OTHER_LINES
        self._sizes = sizes(width, height, self._instances, self._block_rows)
        self.update_classes(self._sizes)

    # -- what comes in ------------------------------------------------------------------------------

    def show(self) -> None:
        self.set_class(self._view_model.is_frozen, FROZEN)
        if self._instances != len(self._view_model.project.instances):  # more of them leave less to the panes
            self._fit(*self.size)
            self._arrange()
        panes = self.header, self.instances, self.block, self.status, self.timing, self.history, self.table
        for pane in panes:
            pane.show()
        self.received.show()
        self.peer.show()
        self.prompt.answered(self._view_model.answers)
        self._show_keys()

    def show_soon(self) -> None:
        """Show below a dialog: each time Textual paints both anew as a whole, so twice a second."""
        self.prompt.answered(self._view_model.answers)
        self.peer.show_trial()
        if self._owed is None:
            self._owed = self.set_timer(BELOW_DIALOG_S, self._show_owed)

    def on_screen_resume(self) -> None:
        if self._owed is not None:
            self._owed.stop()
            self._show_owed()

    def _show_owed(self) -> None:
        self._owed = None
        self.show()

    def _show_keys(self) -> None:
        picture = self._view_model.live
        self.key_line.show_keys_of(self.focused, bool(picture and picture.holding))

    def begin_anew(self) -> None:
        self.block.forget()
        self.follow_selected()
        self.on_peer_selected()

    def obeys(self, line: str) -> bool:
        """Carry out a line that is for the timing pane; return whether it is."""
        if line.split(maxsplit=1)[:1] not in ([EXPORT], [FIND]):
            return False
        try:
            self.prompt.did(line, obey_line(line, self.timing))
            self.history.code = self.timing.code
        except UserError as wrong:
            self.prompt.did(line, "", wrong.lines()[0])
        return True

    def end(self, last_words: str) -> None:
        """The engine has ended: say so with what can be done, and leave the last picture, its lamps grey."""
        self._run(False)
        self.prompt.complain(last_words, stays=True)

    def restart(self) -> None:
        self._run(True)
        self.begin_anew()
        self.prompt.tell("the engine is started anew")

    def _run(self, runs: bool) -> None:
        self.header.ended = not runs
        self.header.show()
        for pane in (self.instances, *self._grid.query(LineView)):
            pane.end(not runs)

    # -- what the panes say -------------------------------------------------------------------------

    def follow_selected(self) -> None:
        self.history.forget()
        self.timing.forget()
        self.status.point_at(None)
        self._link(range(0), range(0))
        self.table.cursor, self.table.of_job, self.table.past = None, False, None
        self.received.data.cursor = self.received.job.cursor = None
        self.show()

    def on_peer_selected(self) -> None:
        self.peer.composer.judge()
        self.peer.show()

    def on_edge_selected(self, message: messages.EdgeSelected) -> None:
        line = message.line
        self.status.point_at(line)
        self.history.point_at(message.seq)
        self.timing.point_at(line.scan if line else None, message.seq)

    def on_byte_selected(self, message: messages.ByteSelected) -> None:
        self.table.of_job, self.table.past = message.of_job, None
        self._link_decoded(self.table.field_at(message.offset))
        self.table.show()
        self.received.show()

    def on_past_selected(self, message: messages.PastSelected) -> None:
        """Decode the job that the selected byte of the past belongs to, and show its member."""
        of_job = self.received.face.job_of_cursor()
        mine = of_job is not None and of_job[0] == self._view_model.selected
        self.table.past = of_job[1:] if of_job is not None and mine else None
        if self.table.was_thrown_away:
            self.table.cursor = None
        in_data = mine and not self.table.was_thrown_away
        field = self.table.field_at(self.received.face.byte_in_job()) if in_data else range(0)
        self.received.face.show_field(field, goes_there=False)
        self.table.show()
        self.received.show()

    def on_message_chosen(self, message: messages.MessageChosen) -> None:
        """Show the scan of a message in STATUS, history and over time; None: go back to now."""
        if message.row is None:
            self.timing.action_now()
        else:
            self.status.point_at(None)  # where the edge is not known any more, no other one explains it
            self.history.point_at(None)
            self.timing.go_to(message.row.scan)
        self.received.show()

    def on_field_selected(self, message: messages.FieldSelected) -> None:
        if self.table.past is not None:
            if not self.table.was_thrown_away:
                self.received.face.show_field(message.field, goes_there=True)
            self.received.show()
            return
        self._link_decoded(message.field)
        self._decoded_view().go_to(message.field.start)
        self.received.show()

    def _decoded_view(self) -> HexView:
        of_job = self.table.of_job and self.received.job.display
        return self.received.job if of_job else self.received.data

    def _link_decoded(self, field: range) -> None:
        none = range(0)
        self._link(*((none, field) if self.table.of_job else (field, none)))

    def _link(self, data: range, job: range) -> None:
        self.received.data.show_link(data)
        self.received.job.show_link(job)

    def on_descendant_focus(self, event: events.DescendantFocus) -> None:
        """Open the pane that got the focus, and name its keys; one that has lost it again stays closed."""
        if event.widget is not self.focused:
            return
        for digit, pane in self._panes().items():
            if pane in event.widget.ancestors_with_self:
                self._open(digit)
        if not {self.received, self.prompt} & {*event.widget.ancestors}:
            self.received.end_search()
        self._show_keys()

    # -- actions ------------------------------------------------------------------------------------

    def action_pane(self, digit: int) -> None:
        if digit != 1:
            self._open(digit)
        elif self.has_class(ZOOM):
            self.action_zoom()
        if digit != 1 and self.has_class(LIST):
            self.action_zoom()
        self.set_focus(self._focus_target(digit))

    def watch_focused(self) -> None:
        """Frame the pane in which the focus is; `:focus-within` would have all of its parts styled again."""
        for pane in (self.received, self.peer):
            if pane.has_class(WITHIN) != pane.has_focus_within:
                pane.set_class(pane.has_focus_within, WITHIN, update=False)
                self.app.stylesheet.apply(pane)

    def go_to_place(self, place: EvidencePlace) -> None:
        """Show a scan of an instance over time, or a byte of what it has received."""
        if place.instance != self._view_model.selected:
            self._view_model.selected = place.instance
            self.follow_selected()
        if place.scan is not None:
            self.action_pane(8)
            self.timing.go_to(place.scan)
        elif place.byte is not None:
            self.action_pane(5)
            self.received.go_to(place.byte)

    def _open(self, digit: int) -> None:
        self._pane = digit
        if digit in PAST:
            self._past = digit
        self._arrange()

    def _arrange(self) -> None:
        self.set_class(self._table_wants_more(), MESSAGES)
        alone = any(map(self.has_class, (TABS, ZOOM, MESSAGES)))
        away = set() if self.has_class("-both") else PAST - {self._past}
        seen = self._in_tabs() if alone else self._panes().keys() - away
        self.set_class(seen in PAIRS, "-beside")
        for digit, pane in self._panes().items():
            pane.display = digit in seen
        first, then = (self.timing, self.status) if self.has_class("-broad") else (self.status, self.timing)
        if (order := self._grid.children).index(first) > order.index(then):  # a grid is filled in their order
            self._grid.move_child(first, before=then)
        self.tabs.mark(self._pane, *seen)
        if (rows := self._wanted_rows()) != self._rows:
            self._grid.styles.grid_rows = self._rows = rows

    def _heights(self) -> tuple[int, ...]:
        peers = len(self._view_model.project.peers)
        return grid_rows(self._sizes, self._pane_rows, self._past == 8, self._block_rows, peers)

    def _wanted_rows(self) -> str:
        return " ".join("1fr" if each == REST else str(each) for each in self._heights())

    def _table_wants_more(self) -> bool:
        """Return whether the messages and their members take the screen: pane 5 is too low for them."""
        rows = self._pane_rows - 2 - (1 if self.has_class(TABS) else sum(self._heights()))
        return self.received.is_table and self._pane in (5, 6) and rows < ENOUGH_ROWS

    def _in_tabs(self) -> set[int]:
        if self.has_class(MESSAGES) and not self.has_class(ZOOM):
            return {5, 6} if self.size.width >= PAIR_WIDTH else {self._pane}
        is_stream = self._pane in (5, 6) and self.received.is_past  # which wants the whole width
        if self.has_class(ZOOM) or not self.has_class(PAIR) or is_stream:
            return {self._pane}
        return next((pair for pair in (*PAIRS, {3, 7}) if self._pane in pair), {self._pane})

    def action_zoom(self) -> None:
        """Give the pane the whole screen, or take it back; the list of instances where it is a long one."""
        long_list = self.focused is self.instances and self.instances.show_vertical_scrollbar
        zoomed = next((each for each in (ZOOM, LIST) if self.has_class(each)), LIST if long_list else ZOOM)
        self.toggle_class(zoomed)
        self._arrange()

    async def action_pin(self, letter: str) -> None:
        place = "" if self._takes_pins() else self.block.place_of_pin(letter)
        if place:
            self.prompt.complain(place)
        elif missing := self.block.press(letter):
            await self.run_action(f"app.press_from_afar({letter!r}, {missing!r})")

    def _takes_pins(self) -> bool:
        return self.focused in (self.instances, self.block, self.status)

    async def on_key(self, event: events.Key) -> None:
        """Take a key that neither the pane with the focus nor the screen knows."""
        if event.is_printable:
            event.stop()  # above, it would act again on what has the focus then
            await self.run_action(f"app.press_from_afar({event.key!r})")

    def action_members(self) -> None:
        self.table.of_job = not self.table.of_job
        self._link_decoded(self.table.chosen_field())
        self.table.show()

    def action_theirs(self) -> None:
        """View DATA as theirs: in the layout that fits what came; as the PLC lays it out again."""
        from trcvtui.diagnosis.data_view import view_command  # read when first asked for

        decl, offer = self._view_model.declaration, self.status.offer()
        line = view_command(decl, offer.choice if offer else NO_CHOICE) if decl is not None else ""
        if line:
            self._submit(line)
        else:
            nothing = "no other layout fits what came: L opens the lab, V there takes theirs into DATA"
            self.prompt.did("V", "", nothing if decl else "no DATA here")

    def action_yank(self) -> None:
        from trcvtui.tui.copy_formats import FIRST, FIRST_OF_PANE, YankScreen  # read when first asked for

        pane = self._focused_pane()
        if self.focused is self.received.table.first:
            self.run_worker(self._yank_messages())
        elif (subject := self._subject(pane)) is not None:
            self.app.push_screen(YankScreen(subject, FIRST_OF_PANE.get(pane, FIRST)), self._yanked)

    async def _yank_messages(self) -> None:
        from trcvtui.tui.copy_formats import AS_TABLE  # read when first asked for

        if text := await self.received.table.csv():
            self._yanked((AS_TABLE, text))
        else:
            self.prompt.complain("no message is there to be yanked")

    def yank(self, letter: str) -> None:
        from trcvtui.tui.copy_formats import FORMATS

        form = next(form for form in FORMATS if form.letter == letter)
        subject = self._subject(self._focused_pane())
        if subject is None:
            return
        if text := form.write(subject):
            self._yanked((form, text))
        else:
            self.prompt.complain(f"nothing is there to yank as {form.name}")

    def _focused_pane(self) -> str:
        return self.focused.id or "" if self.focused is not None else ""

    def _subject(self, pane: str) -> Subject | None:
        """Return what a pane shows; None where its bytes are not here, which the prompt says."""
        from trcvtui.tui.copy_formats import subject_of

        if pane in ("peers", "payload"):
            return subject_of(self._view_model, of_job=False, of_peer=True)
        is_of_bytes = pane in ("stream", "data", "job", "udt", "messages", "message")
        lack = self.received.face.lack() if is_of_bytes else ""
        if lack:
            self.prompt.complain(f"nothing to yank: {lack}")
            return None
        of_job = pane == "job" or (pane == "udt" and self.table.of_job)
        past = self.received.face.job_of_cursor()
        if past is not None and pane != "stream" and past[0] != self._view_model.selected:
            past = None  # pane 6 shows DATA beside a job of another instance
        found = subject_of(self._view_model, of_job, False, past)
        if pane == "stream":
            message, from_mark = self.received.past.copied()
            found = replace(found, message=message, from_mark=from_mark)
        return found

    def _yanked(self, taken: tuple[Format, str] | None) -> None:
        from trcvtui.tui.clipboard_and_files import take

        if taken is not None and not self._is_refused():
            self.run_worker(take(self.app, *taken, self.prompt.tell, self.prompt.complain))

    def _is_refused(self) -> bool:
        refuses = getattr(self.app, "refuses", None)
        return bool(refuses and refuses())

    def action_change(self) -> None:
        from trcvtui.tui.forms.fields import all_parts, parts_at_hand  # read when first asked for
        from trcvtui.tui.widgets.dialogs import ChoiceScreen

        near = parts_at_hand(self._view_model, self.peer in (self.focused.ancestors if self.focused else ()))
        parts = [near, [part for part in all_parts(self._view_model.project) if part not in near]]
        choices = {
            f"{verb} {part}": (action, part)
            for some in parts
            for verb, action in (("Change", self.change_part), ("Remove", self.remove_part))
            for part in some
            if part.kind != "udt" or verb == "Remove"
        }
        if not choices:
            self.prompt.complain("nothing is there to change: A adds")
            return

        def take(chosen: str | None) -> None:
            if chosen is not None:
                action, part = choices[chosen]
                action(part)

        rows = [
            (title, f"{'set' if action == self.change_part else 'remove'} {part.kind} {part.name}")
            for title, (action, part) in choices.items()
        ]
        self.app.push_screen(ChoiceScreen("Change or remove", rows, ""), take)

    def change_part(self, part: ProjectPart) -> None:
        from trcvtui.tui.forms.add_screen import ChangeScreen  # read when first asked for

        self.app.push_screen(ChangeScreen(lambda: self._view_model.project, part), self._changed)

    def _changed(self, line: str | None) -> None:
        if line:
            self._submit(line)

    def remove_part(self, part: ProjectPart) -> None:
        """Open the prompt with the line that removes a part: it is seen first, and what it does."""
        if not self._is_refused():
            self.action_prompt(f"remove {part.kind} {part.name}")

    def action_undo(self) -> None:
        if self.prompt.is_open or self._is_refused():
            return
        if self._view_model.project.undoable:
            self.action_prompt("undo")
        else:
            self.prompt.complain("no edit of the project is there to be taken back")

    def action_save(self) -> None:
        self._submit("save project")

    def yank_line(self, line: str) -> None:
        """Print a line of a shell, and put it where what is yanked goes."""
        from trcvtui.tui.clipboard_and_files import take
        from trcvtui.tui.copy_formats import Format

        def tell(told: str) -> None:
            self.prompt.tell(f"{line} · {told}")

        if not self._is_refused():
            self.run_worker(take(self.app, Format("", "it", lambda of: line), line, tell, tell))

    def action_mark(self) -> None:
        self._submit("mark")

    def action_hold(self) -> None:
        picture = self._view_model.live
        self._submit("go" if picture and picture.holding else "hold")
        if picture and picture.holding:
            self._step_on()

    def action_single_scan(self) -> None:
        picture = self._view_model.live
        if picture is not None and not picture.holding:
            self._submit("hold")
        self._submit("run 1")
        self._step_on()

    def _step_on(self) -> None:
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
        self._submit(SCENARIOS)
