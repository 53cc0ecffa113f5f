"""The screen of the UDT lab: one type in two profiles on the same bytes, the profile that fits, the cure.

Rule: the lab changes nothing by itself. The keys R, V, u and the form of constants send commands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import ClassVar, Final

from textual import events
from textual.containers import Horizontal, Vertical
from textual.widget import Widget

from trcvtui.errors import UserError
from trcvtui.files import is_same_file
from trcvtui.tui import messages
from trcvtui.tui.copy_formats import CopyFormat
from trcvtui.tui.formatting import plain
from trcvtui.tui.lab import UDT, is_for_lab
from trcvtui.tui.lab.lab import HEX, OURS, SOURCE_TITLES, SOURCES, THEIRS, Lab
from trcvtui.tui.lab.lab_lines import CONSTANT, RELOAD, describe_outcome, goes_to_engine_too, run_lab_line
from trcvtui.tui.lab.panes import ConstantsForm, CureText, FitList, LabHex, ProblemsScreen
from trcvtui.tui.lab.tree import ColumnHead, LabHead, LabTree
from trcvtui.tui.view_model.validity import find_mistake
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.line_view import LineView, hidden_bindings, pane_title
from trcvtui.tui.widgets.lines import TabLine
from trcvtui.tui.widgets.screens import TABS_CLASS, PaletteCommand, SideScreen
from trcvtui.tui.widgets.typed_lines import CommandLine
from trcvtui.udt.byte_text import hex_lines
from trcvtui.udt.compare.fit_report import reason_lines
from trcvtui.udt.exports import LANGUAGES, export
from trcvtui.udt.layout.rules import LAYOUTS
from trcvtui.udt.sources import formats_text

FOOTER_KEYS: Final = (
    ("e", "byte order"), ("f", "fit"), ("c", "cure"), ("o p", "profile"), ("s", "STRING"), ("x", "swap"),
    (":", "command"), ("?", "help"), ("esc", "leave"),
)  # fmt: skip
OPEN_ACTION: Final = "ask('udt open ')"
# Title, key, action: for the palette and the tests.
LAB_COMMANDS: Final = (
    ("Choose the type", "t", "type"),
    ("Choose our profile", "o", "profile('ours')"),
    ("Choose their profile", "p", "profile('theirs')"),
    ("Other byte order for theirs", "e", "order('theirs')"),
    ("Other byte order for ours", "E", "order('ours')"),
    ("Next STRING form for theirs", "s", "text('theirs')"),
    ("Next STRING form for ours", "S", "text('ours')"),
    ("Exchange ours and theirs", "x", "exchange"),
    ("Choose the bytes", "b", "bytes"),
    ("Which profile fits?", "f", "fit"),
    ("Cure: type for our side, for the sender, swap code", "c", "cure"),
    ("Cure in ST or SCL", "d", "language"),
    ("Next difference", "n", "difference(1)"),
    ("Fold everything, open everything", "z", "fold_all"),
    ("Open a type file", "O", OPEN_ACTION),
    ("Enter hex bytes", "X", "ask('udt hex ')"),
    ("Unknown constants", "C", "constants"),
    ("Problems in the type files", "w", "problems"),
    ("Apply a changed type to DATA", "R", "into_data"),
    ("Lay out DATA as theirs", "V", "data_as_theirs"),
    ("Use this type for DATA", "u", "use"),
    ("Yank", "y", "yank"),
    ("Command line", ":", "ask('udt ')"),
    ("Help", "?", "help"),
    ("Leave the lab", "esc", "leave"),
)
KEY_ACTIONS: Final = {**{key: action for _, key, action in LAB_COMMANDS}, "o p": "profile('theirs')"}


def find_yank_text(pane: str, lab: Lab, cure: CureText) -> tuple[CopyFormat, str] | None:
    """Return the text of a pane and its format; None if the pane has no text."""
    match pane:
        case "tree":
            text, name, suffix = _comparison_text(lab), "both sides", ".txt"
        case "hex":
            text, name, suffix = hex_lines(lab.bytes.content, ""), "bytes as hex", ".txt"
        case "fit":
            text, name, suffix = _ranking_text(lab), "the ranking", ".txt"
        case _:
            found = cure.build_cure()
            text = found.source if found.text else ""
            name, suffix = f"the cure in {cure.language.upper()}", f".{cure.language}"
    return (CopyFormat(pane[0], name, lambda of: "", suffix), text) if text else None


def _comparison_text(lab: Lab) -> str:
    from trcvtui.udt.compare.compare import comparison_text  # read when first asked for

    comparison = lab.comparison()
    if comparison is None:
        return ""
    content = lab.bytes.content
    return f"{comparison_text(comparison, list(comparison.rows(content)), content)}\n"


def _ranking_text(lab: Lab) -> str:
    lines = [lab.judgement] if lab.fits else []
    for found in lab.fits:
        lines.append(str(found))
        lines += [f"    {line}" for line in reason_lines(found)]
    return "\n".join(lines) + "\n" if lines else ""


RELOAD_INTERVAL_S: Final = 1.0  # between two checks of the files
TREE, BYTES, FIT, CURE = 1, 2, 3, 4
PANE_NAMES: Final = ((TREE, "Members"), (BYTES, "Bytes"), (FIT, "Fit"), (CURE, "Cure"))
PANE_DIGITS: Final = {"tree": TREE, "hex": BYTES, "fit": FIT, "cure": CURE}
PANES_BY_DIGIT: Final = {digit: name for name, digit in PANE_DIGITS.items()}


class LabScreen(SideScreen[None]):
    BINDINGS: ClassVar = hidden_bindings({
        **{str(digit): f"pane({digit})" for digit, _ in PANE_NAMES},
        **{key: action for _, key, action in LAB_COMMANDS if len(key) == 1 and key not in ":?"},
        "N": "difference(-1)", "left_square_bracket": "message(-1)", "right_square_bracket": "message(1)",
        "colon": "ask('udt ')", "escape,q,L": "leave",
    })  # fmt: skip
    CSS_PATH = "lab.tcss"
    LEAST_SIZE = 120, 30

    def __init__(self, view_model: ViewModel, lab: Lab, say: Callable[[str], int | None]) -> None:
        super().__init__(view_model, say, FOOTER_KEYS, KEY_ACTIONS)
        self.lab = lab
        self._trouble = self._message = ""
        self._open = TREE
        self.tabs = TabLine(PANE_NAMES, TREE)
        self.head = LabHead(lab)
        self.columns = ColumnHead(lab)
        self.tree_view = LabTree(lab)
        self.hex = LabHex(lab)
        self.fit = FitList(lab)
        self.cure = CureText(lab)
        self.ask = CommandLine(self.run_line)
        self._members = Vertical(id="lab-members")
        self._side = Vertical(id="lab-side")

    def compose(self) -> Iterator[Widget]:
        yield from (self.header, self.tabs, self.head)
        with Horizontal(id="stage"):
            with self._members:
                yield self.columns
                yield self.tree_view
            with self._side:
                yield from (self.hex, self.fit, self.cure)
        yield from (self.outcome, self.ask, self.key_line)

    def on_mount(self) -> None:
        self.fit.set_title(FIT, "Which profile fits?", "enter: as theirs")
        self.set_focus(self.tree_view)
        self.set_interval(RELOAD_INTERVAL_S, self.reload_files)
        self._ask_constants()

    # -- what is shown ------------------------------------------------------------------------------

    def show(self) -> None:
        self.lab.follow_bench()
        self._view_model.past_wanted = self.lab.bytes.make_request()
        for answer in self.take_answers():
            self._trouble, self._message = answer.error, answer.message or f"{answer.line} ✓"
        for line in (self.header, self.head, self.columns, self.tree_view):
            line.show()
        self.hex.show_row(self.tree_view.chosen_row)
        self.fit.show()
        self.cure.show()
        self._members.border_title = pane_title(TREE, "Members", "≠ differs · ░ padding")
        self.hex.set_title(BYTES, "Bytes", f"{self.hex.link_text}░ padding, ▒ theirs")
        self.outcome.write(*describe_outcome(self.lab, self._trouble, self._message))
        declared, name = self._view_model.declaration, self.lab.type_name
        is_other = declared is not None and name.casefold() not in ("", declared.type_name.casefold())
        self.show_keys((("u", f"use for {declared.name}"),) if declared is not None and is_other else ())

    def reload_files(self) -> None:
        if self.lab.reload_if_changed():
            self._trouble = self._message = ""
            self._ask_constants()
            self.show()

    # -- lines --------------------------------------------------------------------------------------

    def run_line(self, line: str) -> None:
        """Carry out a line of the lab; send any other line to the bench."""
        self._trouble = self._message = ""
        if not is_for_lab(line):
            self.send(line)
            return
        try:
            pane = run_lab_line(line, self.lab)
        except UserError as wrong:
            self._trouble = wrong.lines()[0]
        else:
            if pane:
                self.action_pane(PANE_DIGITS[pane])
            if goes_to_engine_too(line):  # after the lab itself: a wrong line is not sent
                self.send(line)
            self._ask_constants()
        self.show()

    # -- what the panes say -------------------------------------------------------------------------

    def on_lab_row_selected(self) -> None:
        found = self.tree_view.chosen_row
        if found is not None and found.key:
            self.hex.go_to(found.ours.offset)
        self.show()

    def on_byte_selected(self, message: messages.ByteSelected) -> None:
        ours = self.lab.layout(OURS)
        leaf = ours.leaf_number_at(message.offset) if ours is not None and message.offset >= 0 else None
        if leaf is not None:
            self.tree_view.show_leaf(leaf)
        self.show()

    def on_profile_chosen(self, message: messages.ProfileChosen) -> None:
        found = self.lab.fits[message.number]
        profile = found.profile
        text = profile.text or self.lab.profiles[THEIRS].text
        self.run_line(f"udt theirs {profile.layout} {profile.byte_order} {text}")
        also = f"; also: {found.cause}" if found.cause.kind else ""
        self._message = f"theirs is now {profile}{also}; 4 or c: the cure"
        self.show()

    def on_descendant_focus(self, event: events.DescendantFocus) -> None:
        for digit, pane in self._panes().items():
            if event.widget is pane:
                self._open = digit
        self.arrange_panes()
        self.show()

    def _panes(self) -> dict[int, LineView]:
        return {TREE: self.tree_view, BYTES: self.hex, FIT: self.fit, CURE: self.cure}

    def arrange_panes(self) -> None:
        alone = self.has_class(TABS_CLASS)
        self._members.display = not alone or self._open == TREE
        self._side.display = not alone or self._open != TREE
        for digit in (BYTES, FIT, CURE):
            self._panes()[digit].display = not alone or self._open == digit
        self.tabs.mark_open(self._open)

    # -- actions ------------------------------------------------------------------------------------

    def action_pane(self, digit: int) -> None:
        self._open = digit
        self.arrange_panes()
        self.set_focus(self._panes()[digit])

    def action_type(self) -> None:
        rows = [(name, "") for name in self.lab.type_names()]
        self._open_choice(f"Types of {self.lab.files.name}", rows, self.lab.type_name, "type")

    def action_profile(self, side: str) -> None:
        rows = [
            (name, f"{rules.byte_order}-endian, STRING {rules.text.name}, alignment up to {rules.cap}")
            for name, rules in LAYOUTS.items()
        ]
        self._open_choice(f"Layout of {side}", rows, self.lab.profiles[side].layout, side)

    def action_bytes(self) -> None:
        rows = [(name, SOURCE_TITLES[name]) for name in SOURCES]
        self._open_choice("Bytes", rows, self.lab.bytes.source, "bytes")

    def _open_choice(self, title: str, rows: list[tuple[str, str]], now: str, word: str) -> None:
        from trcvtui.tui.widgets.dialogs import ChoiceScreen  # read when first asked for

        def accept_choice(name: str | None) -> None:
            if name == HEX and word == "bytes":  # the bytes are still to be typed
                self.action_ask(f"{UDT} {HEX} ")
            elif name is not None:
                self.run_line(f"{UDT} {word} {name}")

        self.app.push_screen(ChoiceScreen(title, rows, now), accept_choice)

    def action_order(self, side: str) -> None:
        self._apply_change(lambda: self.lab.swap_order(side))

    def action_text(self, side: str) -> None:
        self._apply_change(lambda: self.lab.next_text_form(side))

    def action_exchange(self) -> None:
        self._apply_change(self.lab.exchange_profiles)

    def action_message(self, step: int) -> None:
        self._apply_change(lambda: self.lab.bytes.step_messages(step))

    def _apply_change(self, change: Callable[[], None]) -> None:
        self._trouble = self._message = ""
        change()
        self.show()

    def action_fit(self) -> None:
        self.fit.cursor = 0
        self.run_line("udt fit")

    def action_cure(self) -> None:
        if self.focused is self.cure:
            self.cure.next_kind()
        self.cure.is_requested = True
        self.action_pane(CURE)
        self.show()

    def action_language(self) -> None:
        self.cure.next_language()

    def action_difference(self, step: int) -> None:
        found = self.tree_view.chosen_row
        at = found.leaf if found is not None and found.key else -1
        leaf = self.lab.next_difference(at, step) if step > 0 or at >= 0 else None
        if leaf is None:
            self._message = "no other member differs"
            self.show()
            return
        self.action_pane(TREE)
        self.tree_view.show_leaf(leaf, opens=True)

    def action_fold_all(self) -> None:
        self.tree_view.action_fold_all()

    def action_ask(self, text: str) -> None:
        self.ask.open(text or "udt ")

    def action_constants(self) -> None:
        self.lab.asked_for = ()
        if self.lab.files.types.unknown_constants:
            self._ask_constants()
        else:
            self._message = "every constant is known"
            self.show()

    def _ask_constants(self) -> None:
        names = self.lab.files.types.unknown_constants
        if not names or names == self.lab.asked_for:  # ask once; C asks again
            return
        self.lab.asked_for = names
        self.app.push_screen(ConstantsForm(names, self.lab.files.name), self._handle_constants)

    def _handle_constants(self, given: dict[str, int] | None) -> None:
        if given:
            pairs = " ".join(f"{name}={number}" for name, number in given.items())
            self.run_line(f"{UDT} {CONSTANT} {pairs}")

    def action_problems(self) -> None:
        lines = [str(problem) for problem in self.lab.files.types.problems]
        self.app.push_screen(ProblemsScreen(lines or ["no problem in the type files"]))

    def action_into_data(self) -> None:
        """Let the PLC read the types again, and resize DATA to the changed type."""
        declared = self._view_model.declaration
        if self.lab.opened is not None or declared is None:
            self._trouble = "R needs DATA and a type of the project's own files"
        else:
            self.send(f"{UDT} {RELOAD}")
            self.send(f"resize {declared.name} {declared.type_name}")
        self.show()

    def action_use(self) -> None:
        """Give DATA of the selected instance the lab's type; first add the type's file to the project."""
        declared, project, opened = self._view_model.declaration, self._view_model.project, self.lab.opened
        first, self._trouble = f"{UDT} {RELOAD}", ""
        if opened and not any(is_same_file(opened.paths[0], each) for each in project.udt_files):
            first = f"add udt {opened.paths[0].resolve()}"
            self._trouble = find_mistake(first, project)
        if declared is None or not self.lab.type_name:
            what = "a type (t, O)" if declared is not None else "an instance with DATA to be selected"
            self._trouble = f"u uses the type for DATA and needs {what}"
        elif not self._trouble:
            self.send(first)
            self.send(f"set data {declared.name} type={self.lab.type_name}")
        self.show()

    def action_data_as_theirs(self) -> None:
        """Send the bench line that gives DATA the sender's layout. This is another cure of a mismatch."""
        from trcvtui.diagnosis.data_view import make_choice, make_view_command

        declared, theirs = self._view_model.declaration, self.lab.profiles["theirs"]
        if self.lab.opened is not None or declared is None:
            self._trouble = "V needs DATA and the project's own types"
        elif line := make_view_command(declared, make_choice(theirs.layout, theirs.byte_order, theirs.text)):
            self.send(line)
            self._message = f"{declared.name} gets the layout of theirs: {line}"
        else:
            self._message = f"{declared.name} already has the layout of theirs"
        self.show()

    def action_yank(self) -> None:
        from trcvtui.tui.clipboard_and_files import yank

        found = find_yank_text(PANES_BY_DIGIT[self._open], self.lab, self.cure)
        if found is None:
            self._trouble = "nothing to yank"
            self.show()
            return
        self.run_worker(yank(self.app, *found, self._show_text, partial(self._show_text, is_wrong=True)))

    def action_export(self, name: str) -> None:
        from trcvtui.tui.clipboard_and_files import yank

        layout, text = self.lab.layout(OURS), ""
        self._trouble, self._message = "nothing to export", ""
        try:
            text = export(layout, name) if layout is not None else ""
        except UserError as refused:
            self._trouble = refused.lines()[0]
        if not text:
            self.show()
            return
        form = CopyFormat(name, LANGUAGES[name], lambda of: "", f".{name}")
        self.run_worker(yank(self.app, form, text, self._show_text, partial(self._show_text, is_wrong=True)))

    def _show_text(self, text: str, is_wrong: bool = False) -> None:
        self._message, self._trouble = ("", plain(text)) if is_wrong else (plain(text), "")
        self.show()

    def action_leave(self) -> None:
        self.dismiss()

    def palette_rows(self) -> Iterator[PaletteCommand]:
        for title, key, action in LAB_COMMANDS:
            yield title, f"key {key}" + (f"; {formats_text()}" if action == OPEN_ACTION else ""), action
        for name, title in LANGUAGES.items():
            yield f"Export ours: {title}", f".{name}", f"export('{name}')"
