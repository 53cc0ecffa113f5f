"""Framing advice: how to cut the bytes of a ComBuffer, with reasons and a preview. Enter applies it."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Final

from trcvtui.commands.table import parse_script
from trcvtui.diagnosis.readings.framing_advice import advise_framings
from trcvtui.diagnosis.readings.framing_command import make_commands
from trcvtui.diagnosis.readings.proposal import FramingAdvice, PreviewFrame, Proposal
from trcvtui.errors import UserError
from trcvtui.plc.snapshot import block_row
from trcvtui.project.project import Project
from trcvtui.tui.formatting import clip, pad
from trcvtui.tui.view_model.view_model import ViewModel
from trcvtui.tui.widgets.dialogs import LabelledText, ViewDialog
from trcvtui.tui.widgets.hex_view import CLASS_OF, HEX_OF, make_marks
from trcvtui.tui.widgets.line_view import Part, Row, hidden_bindings, row, rule

NO_READER: Final = "no ReceiveData or ReceiveString reads this ComBuffer: A adds one"
GOOD_ENDINGS: Final = ("suffix", "size reached")


def buffer_for(view_model: ViewModel) -> str:
    """Return the ComBuffer that the selected instance reads or feeds, else the project's first one."""
    project, instance = view_model.project, view_model.instance
    if instance is not None and block_row(instance.block).buffer_pin:
        return instance.connect
    names = [b.name for b in project.combuffers]
    fed = [b.name for b in project.combuffers if instance is not None and b.source == instance.name]
    return next(iter((*fed, *names)), "")


def find_framed_block(buffer: str, view_model: ViewModel) -> str:
    """Return the selected instance if it cuts this ComBuffer's bytes, else the first instance that does."""
    readers = [
        i.name for i in view_model.project.instances if i.connect == buffer and block_row(i.block).affix_pins
    ]
    return view_model.selected if view_model.selected in readers else next(iter(readers), "")


class FramingList(LabelledText):
    """The proposals, then evidence, preview and command lines of the proposal under the cursor."""

    def __init__(self, instance: str, project: Callable[[], Project]) -> None:
        super().__init__(id="framings")
        self.advice: FramingAdvice | None = None
        self.cursor = 0
        self.problem = ""
        self._instance = instance
        self._project = project

    @property
    def chosen_proposal(self) -> Proposal | None:
        proposals = self.advice.proposals if self.advice is not None else ()
        return proposals[self.cursor] if self.cursor < len(proposals) else None

    def lines(self) -> tuple[str, ...]:
        """Return the chosen proposal's lines; raise UserError if the block cannot apply the proposal."""
        chosen = self.chosen_proposal
        return make_commands(chosen, self._project(), self._instance) if chosen is not None else ()

    def make_rows(self) -> list[Row]:
        if self.advice is None:
            return [row(("waiting for the recorded bytes …", "dim"))]
        rows = [row((clip(self.advice.said, self._width), "dim"))]
        rows += [self._proposal_row(n, each) for n, each in enumerate(self.advice.proposals)]
        chosen = self.chosen_proposal
        return [*rows, *self._detail_rows(chosen)] if chosen is not None else rows

    def _proposal_row(self, number: int, proposal: Proposal) -> Row:
        chosen = number == self.cursor
        result = f"{proposal.frames} of {proposal.of_frames} frames complete"
        room = self._width - len(result) - 7
        title = proposal.title + self._describe_alike(number, proposal)
        parts: list[Part] = [
            ("▸ " if chosen else "  ", "key"),
            (f"{number + 1} ", "dim"),
            (pad(clip(title, room), room + 1), "strong" if proposal.framing is not None else "dim"),
            (result, "on" if proposal.frames == proposal.of_frames else "warn"),
        ]
        return row(*parts, style="cursor" if chosen else "")

    def _describe_alike(self, number: int, proposal: Proposal) -> str:
        """Return ` · same cuts as N` if an earlier proposal N has the same cuts, else ""."""
        proposals = self.advice.proposals if self.advice is not None else ()
        first = next(n for n, each in enumerate(proposals) if each.rank == proposal.rank)
        return f" · same cuts as {first + 1}" if first != number else ""

    def _detail_rows(self, chosen: Proposal) -> list[Row]:
        rows = [rule(self._width, ("── why ", "dim"))]
        rows += self._labelled_rows("for", chosen.evidence, "")
        rows += self._labelled_rows("but", chosen.doubt, "warn")
        rows += self._labelled_rows("instead", [chosen.instead] if chosen.instead else [], "strong")
        rows.append(rule(self._width, ("── frames ", "dim")))
        rows += [self._frame_row(frame, chosen) for frame in chosen.preview]
        return [*rows, rule(self._width, ("── enter runs ", "dim")), *self._effect_rows()]

    def _effect_rows(self) -> list[Row]:
        problem = self.problem or ("" if self._instance else NO_READER)
        try:
            lines = () if problem else self.lines()
        except UserError as wrong:
            problem = wrong.lines()[0]
        return self._labelled_rows("✗", [problem], "error") if problem else self._labelled_rows("", lines, "")

    def _frame_row(self, frame: PreviewFrame, chosen: Proposal) -> Row:
        framing = chosen.framing
        prefix = min(frame.size, len(framing.prefix)) if framing is not None else 0
        suffix = len(framing.suffix) if framing is not None and frame.ending == "suffix" else 0
        marks = make_marks(0, frame.size, prefix, suffix)
        head = f"{frame.start:>6} {frame.size:>5} B "
        room = (self._width - len(head) - len(frame.ending) - 4) // 3
        parts: list[Part] = [(head, "dim")]
        for place, byte in enumerate(frame.content[:room]):
            parts.append((marks.seam_sign(place) or " ", "key"))
            parts.append((HEX_OF[byte], marks.style(place) or CLASS_OF[byte]))
        tail = "…" if frame.size > min(room, len(frame.content)) else ""
        return row(*parts, (f"{tail}  {frame.ending}", "dim" if frame.ending in GOOD_ENDINGS else "warn"))

    def action_move(self, rows: int) -> None:
        count = len(self.advice.proposals) if self.advice is not None else 0
        self.cursor = max(0, min(count - 1, self.cursor + rows))
        self.problem = ""
        self.scroll_to(y=0, animate=False)
        self.draw()


class FramingScreen(ViewDialog[tuple[str, ...]]):
    """The screen of the proposals. The answer is the bench lines to run, none if you leave the screen."""

    BINDINGS: ClassVar = hidden_bindings({"enter": "apply", "r": "again", "B": "leave"})
    DEFAULT_CSS = """
    FramingScreen FramingList {
        width: 110; height: auto; max-height: 100%; border-subtitle-color: $foreground;
    }
    """

    def __init__(self, view_model: ViewModel) -> None:
        self._view_model = view_model
        self.buffer = buffer_for(view_model)
        self.instance = find_framed_block(self.buffer, view_model)
        self.list = FramingList(self.instance, lambda: view_model.project)
        super().__init__(self.list, ())
        self.list.set_title(None, "Framing advice", f"{self.buffer} → {self.instance or 'no block'}")
        self.list.border_subtitle = "↑↓ choose · enter apply · r read again · page up, down · esc"

    def on_mount(self) -> None:
        self.action_again()

    def action_again(self) -> None:
        self._view_model.recordings_wanted = (self.buffer,)
        self.list.draw()

    def show(self) -> None:
        picture = self._view_model.live
        found = dict(picture.recordings).get(self.buffer) if picture is not None else None
        if found is None or not self._view_model.recordings_wanted:
            return
        self._view_model.recordings_wanted = ()
        self.list.advice, self.list.cursor, self.list.problem = advise_framings(found), 0, ""
        self.list.draw()

    def action_apply(self) -> None:
        try:
            lines = self.list.lines() if self.instance else ()
            parse_script("\n".join(lines), self._view_model.project, "framing")
        except UserError as wrong:
            self.list.problem = wrong.lines()[0]
            self.list.draw()
            return
        if lines:
            self.dismiss(lines)

    def action_leave(self) -> None:
        self._view_model.recordings_wanted = ()
        super().action_leave()
